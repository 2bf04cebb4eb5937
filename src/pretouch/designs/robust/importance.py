"""Compute which share of the objective's variance each uncertain input causes (Sobol indices)."""

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

_PARTS: Final = 16  # parts of the samples, whose estimates give the standard error
_FEWEST: Final = 4 * _PARTS


# Let A and B be two independent sets of samples, and C like A but with one input from B (I. M. Sobol, Math. Comput.
# Simul. 55 (2001) 271). The share of the variance by an input alone, and the share that would remain if all other
# inputs were known, are
#
#     S = mean(f_B (f_C - f_A)) / Var f   (A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259),
#     T = mean((f_A - f_C)^2) / (2 Var f)   (M. J. W. Jansen, Comput. Phys. Commun. 117 (1999) 35).
#
# Inputs that were estimated together count as one, because a better calibration improves all of them. To first order
# the objective is linear in the inputs, and an input's share is (df/dx)^2 Var x over the sum of these terms for all
# inputs. If encounters have noise, the noise is one more input: B has other noise than A.
@dataclass(frozen=True, slots=True, kw_only=True)
class InputImportance(Value):
    """Influence of one uncertain input on the objective.

    It is the input's share in the variance of the objective, as Sobol indices.

    Args:
        name: the input, the name of several inputs that were estimated together, or "noise".
        inputs: the names of these inputs.
        alone: first-order index S: the share of the variance that would vanish on average if this input were known.
        alone_error: standard error of S.
        total: total index T: the share of the variance that would remain if all other inputs were known.
        total_error: standard error of T.
        by_gradient: the share to first order, from gradients at the nominal inputs; None without gradients.
    """

    name: str
    inputs: tuple[str, ...]
    alone: float
    alone_error: float
    total: float
    total_error: float
    by_gradient: float | None


def rank_uncertain_inputs(problem: RobustProblem, gain: float) -> tuple[InputImportance, ...]:
    """Rank uncertain inputs by their influence on the objective.

    Each of the two sets has the number of samples of the task, but at least _FEWEST. Shares are NaN if an encounter
    ends without contact.

    Returns:
        The inputs, with the largest share in the variance first.
    """
    task, uncertainty = problem.task, problem.task.uncertainty
    if not uncertainty:
        return ()
    samples = max(task.robust.samples or 0, _FEWEST)
    noise_a = task.evaluate
    noise_b = None if noise_a is None else with_noise_after(noise_a, samples)
    both = _two_sets(uncertainty, samples, task.robust.seed)
    set_a, set_b = ({name: values[:, k] for name, values in both.items()} for k in (0, 1))

    def values(inputs: Mapping[str, FloatArray], noise: Evaluator | None = noise_a) -> FloatArray:
        ensemble = RobustProblem.over(task, problem.axis, inputs, evaluate=noise).ensemble
        result = ensemble.contacts(gain)
        objective = task.goal.value(result.end, ensemble.speed, task.impact)
        return np.where(result.reached, objective, np.nan)

    f_a, f_b = values(set_a), values(set_b, noise_b)
    pieces = np.array_split(np.arange(samples), min(_PARTS, samples))
    linear = _linear_shares(problem, gain)
    importance = []
    members = {name: distribution.inputs(name) for name, distribution in uncertainty.items()}
    if isinstance(noise_a, NoisyEvaluator):
        members["noise"] = ()
    for name, varied in members.items():
        f_c = values({**set_a, **{member: set_b[member] for member in varied}}, noise_a if varied else noise_b)
        alone, total = _shares(f_a, f_b, f_c)
        parts = np.array([_shares(f_a[part], f_b[part], f_c[part]) for part in pieces])
        error = parts.std(axis=0, ddof=1) / np.sqrt(len(parts)) if len(parts) > 1 else np.full(2, np.nan)
        importance.append(
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
    return tuple(sorted(importance, key=lambda entry: -np.nan_to_num(entry.total, nan=-1.0)))


def _two_sets(uncertainty: Uncertainty, samples: int, seed: int) -> dict[str, FloatArray]:
    """Draw two independent sets of samples of each uncertain input."""
    sets = [sample_inputs(uncertainty, samples, seed=s, sampling="random") for s in (2 * seed, 2 * seed + 1)]
    return {name: np.stack([samples_of[name] for samples_of in sets], axis=1) for name in sets[0]}


def _shares(f_a: FloatArray, f_b: FloatArray, f_c: FloatArray) -> tuple[float, float]:
    """Return the first-order and the total Sobol index of one uncertain input.

    Subtracting the mean changes neither index and reduces the error of the first one.
    """
    every = np.concatenate([f_a, f_b])
    middle, variance = every.mean(), every.var()
    if variance == 0:
        return 0.0, 0.0
    return float(((f_b - middle) * (f_c - f_a)).mean() / variance), float(((f_a - f_c) ** 2).mean() / (2 * variance))


def _linear_shares(problem: RobustProblem, gain: float) -> dict[str, float] | None:
    """Estimate the variance share of each input from gradients."""
    task, uncertainty = problem.task, problem.task.uncertainty
    if not problem.has_slopes():
        return None
    center: dict[str, float] = {}
    for name, distribution in uncertainty.items():
        center |= zip(distribution.inputs(name), distribution.means(), strict=True)
    inner = RobustProblem.over(task, problem.axis, {name: np.array([value]) for name, value in center.items()})
    result = inner.ensemble.contacts(gain)
    if not result.reached.all():
        return None
    slopes = {name: float(inner.slope(result, name)[0]) for name in center}
    variances = {
        name: distribution.variance_along(np.array([slopes[member] for member in distribution.inputs(name)]))
        for name, distribution in uncertainty.items()
    }
    total = sum(variances.values())
    return {name: v / total if total > 0 else 0.0 for name, v in variances.items()}
