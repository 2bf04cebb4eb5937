"""Which uncertain input matters most: Sobol indices of the objective, and the same to first order from gradients."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.motion.evaluator import Evaluator, NoisyEvaluator, with_noise_after
from pretouch.uncertainty import Uncertainty, sample_inputs

from .problem import RobustProblem

__all__ = ["InputImportance", "rank_uncertain_inputs"]

_PARTS: Final = 16  # of the samples, from which the spread of the estimates is found
_FEWEST: Final = 4 * _PARTS


# With two independent sets of samples A and B, and C like A but with one input from B (I. M. Sobol, Math. Comput.
# Simul. 55 (2001) 271), the share of the variance that an input has alone, and the share that would be left if all
# others were known, are
#
#     S = mean(f_B (f_C - f_A)) / Var f   (A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259),
#     T = mean((f_A - f_C)^2) / (2 Var f)   (M. J. W. Jansen, Comput. Phys. Commun. 117 (1999) 35).
#
# Inputs that were estimated together count as one: what is measured better is the calibration. To first order the
# objective is linear in the inputs, and the share is (df/dx)^2 Var x over the sum of them all. Where encounters are
# solved with noise, that is one more input: B meets other noise than A.
@dataclass(frozen=True, slots=True, kw_only=True)
class InputImportance(Value):
    """How much of the variance of the objective one input is the cause of.

    Args:
        name: the input, the name of several that go together, or "noise".
        inputs: the inputs themselves.
        alone: S, the share that would be saved by knowing this input exactly, in the mean.
        alone_error: the standard error of its estimate.
        total: T, the share that would be left if everything else were known.
        total_error: the standard error of its estimate.
        by_gradient: the share to first order, from gradients at the given values; None where there are none.
    """

    name: str
    inputs: tuple[str, ...]
    alone: float
    alone_error: float
    total: float
    total_error: float
    by_gradient: float | None


def rank_uncertain_inputs(problem: RobustProblem, gain: float) -> tuple[InputImportance, ...]:
    """Rank uncertain inputs by their share of the variance of the objective at a gain [N s], the largest first."""
    # Each of the two sets has as many samples as the task asks for; more where these are too few to tell shares at all.
    # Shares are NaN where some encounter has no contact.
    task, uncertainty = problem.task, problem.task.uncertainty
    if not uncertainty:
        return ()
    samples = max(task.samples or 0, _FEWEST)
    own = task.evaluate
    other = None if own is None else with_noise_after(own, samples)
    both = _two_sets(uncertainty, samples, task.seed or 0)
    mine, theirs = ({name: values[:, k] for name, values in both.items()} for k in (0, 1))

    def values(inputs: Mapping[str, FloatArray], noise: Evaluator | None = own) -> FloatArray:
        ensemble = RobustProblem.over(task, problem.axis, inputs, evaluate=noise).ensemble
        result = ensemble.contacts(gain)
        found = task.goal.value(result.end, ensemble.speed, task.impact)
        return np.where(result.reached, found, np.nan)

    f_a, f_b = values(mine), values(theirs, other)
    pieces = np.array_split(np.arange(samples), min(_PARTS, samples))
    linear = _linear_shares(problem, gain)
    found = []
    members = {n: k.inputs(n) for n, k in uncertainty.items()}
    if isinstance(own, NoisyEvaluator):
        members["noise"] = ()
    for name, varied in members.items():
        f_c = values({**mine, **{member: theirs[member] for member in varied}}, own if varied else other)
        alone, total = _shares(f_a, f_b, f_c)
        parts = np.array([_shares(f_a[part], f_b[part], f_c[part]) for part in pieces])
        error = parts.std(axis=0, ddof=1) / np.sqrt(len(parts)) if len(parts) > 1 else np.full(2, np.nan)
        found.append(
            InputImportance(
                name=name,
                inputs=tuple(varied),
                alone=alone,
                alone_error=float(error[0]),
                total=total,
                total_error=float(error[1]),
                by_gradient=None if linear is None else linear[name],
            )
        )
    return tuple(sorted(found, key=lambda one: -np.nan_to_num(one.total, nan=-1.0)))


def _two_sets(uncertainty: Uncertainty, samples: int, seed: int) -> dict[str, FloatArray]:
    """Return two independent sets of samples by input, shape (samples, 2)."""
    sets = [sample_inputs(uncertainty, samples, seed=s, sampling="random") for s in (2 * seed, 2 * seed + 1)]
    return {name: np.stack([one[name] for one in sets], axis=1) for name in sets[0]}


def _shares(f_a: FloatArray, f_b: FloatArray, f_c: FloatArray) -> tuple[float, float]:
    """Return S and T; the mean is taken off first, which changes neither and takes noise from S."""
    every = np.concatenate([f_a, f_b])
    middle, variance = every.mean(), every.var()
    if variance == 0:
        return 0.0, 0.0
    return float(((f_b - middle) * (f_c - f_a)).mean() / variance), float(((f_a - f_c) ** 2).mean() / (2 * variance))


def _linear_shares(problem: RobustProblem, gain: float) -> dict[str, float] | None:
    """Return the share of each input to first order, about the means."""
    task, uncertainty = problem.task, problem.task.uncertainty
    if task.evaluate is not None or not problem.criterion(-1).has_gradients:
        return None
    center: dict[str, float] = {}
    for name, known in uncertainty.items():
        center |= zip(known.inputs(name), known.means(), strict=True)
    inner = RobustProblem.over(task, problem.axis, {name: np.array([value]) for name, value in center.items()})
    result = inner.ensemble.contacts(gain)
    if not result.reached.all():
        return None
    slopes = {name: float(inner.slope(result, name)[0]) for name in center}
    variances = {
        name: known.variance_along(np.array([slopes[member] for member in known.inputs(name)]))
        for name, known in uncertainty.items()
    }
    total = sum(variances.values())
    return {name: v / total if total > 0 else 0.0 for name, v in variances.items()}
