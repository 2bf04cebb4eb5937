"""What a robust gain is seen beside: all gains, each encounter, what inputs do, and what knowing them would gain."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactState
from pretouch.motion.evaluator import Evaluator, NoisyEvaluator, with_noise_after
from pretouch.motion.scenario import SCENARIO_INPUTS, input_units
from pretouch.uncertainty import JointDistribution, Uncertainty, make_ensemble, sample_inputs
from pretouch.uncertainty.ensemble import names_of

from ..constraints import ImpactModel, quantity_of
from ..gain import GainDesign
from ..problem import GainProblem
from .problem import RobustProblem


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustOutcomes(Value):
    """What one gain leads to in each of the fresh encounters.

    Args:
        gain: D_p [N s].
        objective: the objective, shape (n,); infinite where there is no contact.
        reached: which encounters end in contact, shape (n,).
        state: the state at the end of each, fields of shape (n,).
        inputs: the uncertain inputs by name, in SI, shape (n,) each.
        impact: the physical properties, where given.
    """

    gain: float
    objective: FloatArray
    reached: BoolArray
    state: ContactState
    inputs: dict[str, FloatArray]
    impact: ImpactModel | None

    def magnitude(self, quantity: str) -> FloatArray:
        """Return |quantity| in SI of one of QUANTITY_UNITS, shape (n,); infinite where there is no contact."""
        found = np.abs(np.asarray(quantity_of(quantity, self.state, self.impact)))
        return np.where(self.reached, np.broadcast_to(found, self.reached.shape), np.inf)

    def reaches(self, quantity: str, share: float) -> float:
        """Return the magnitude of a quantity that is not exceeded in a share of the encounters, in SI."""
        return float(np.sort(self.magnitude(quantity))[math.ceil(share * len(self.objective)) - 1])

    def __repr__(self) -> str:
        return f"<RobustOutcomes: {len(self.objective)} encounters with gain {self.gain:.4g}>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustTradeOff(Value):
    """The measure of the objective over the gain, on the samples of the design.

    Args:
        gain: D_p [N s], ascending, shape (n,).
        value: the measure; infinite where the encounters that count do not end in contact.
        feasible: where every constraint holds as often as it must.
    """

    gain: FloatArray
    value: FloatArray
    feasible: BoolArray

    def __repr__(self) -> str:
        return f"<RobustTradeOff: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g}>"


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
    if not problem.has_slopes():
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


_TAIL = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Price(Value):
    """What one input, known exactly, would gain: the robust gain beside the one made for each value of the input.

    Args:
        name: the input.
        unit: its SI unit.
        value: its values, shape (n,).
        best_gain: the gain that is optimal for each [N s]; NaN where there is none.
        best: the objective there.
        robust: the objective of the robust gain; NaN where it does not end in contact.
        low: the input's 1 % quantile, or the smallest value that is possible.
        high: its 99 % quantile, or the largest.
    """

    name: str
    unit: str
    value: FloatArray
    best_gain: FloatArray
    best: FloatArray
    robust: FloatArray
    low: float
    high: float

    @property
    def loss(self) -> FloatArray:
        """By how much the robust gain is worse than the best, as a share of the best objective."""
        return self.robust / self.best - 1

    def __repr__(self) -> str:
        most = np.max(self.loss, initial=0.0, where=np.isfinite(self.loss))
        return f"<Price: {self.name} from {self.low:g} to {self.high:g} {self.unit}, loss up to {most:.3g}>"


def price_of_robustness(problem: GainProblem, name: str, count: int, gain: float | None) -> Price:
    """Hold one gain [N s] against the best gain for each of many values of an input, the others as they are given."""
    # Inputs that were estimated together with it follow at their likeliest values. The gains made for each value keep
    # no constraints, so that the loss is never negative, and part of it what constraints cost.
    if type(count) is not int or count < 2:
        raise InvalidInputError(f"count: found {count!r}, expected a whole number of at least 2")
    if gain is None:
        raise ResultUnavailableError("price: there is no robust gain, so it has no price; see the status")
    task = problem.task.replace(constraints=())
    known, members = _known(task.uncertainty, name)
    own = known.alone(members.index(name))
    low, high = own.support
    if not (np.isfinite(low) and np.isfinite(high)):
        low, high = own.quantile(_TAIL), own.quantile(1 - _TAIL)
    x = np.linspace(low, high, count)
    values = dict(zip(members, known.others(members.index(name), x), strict=True)) | {name: x}
    several = make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon, law=task.law)
    result = several.contacts(gain)
    robust = np.where(result.reached, task.goal.value(result.end, several.speed, task.impact), np.nan)

    def one(**changes: Any) -> GainDesign:
        return GainDesign.of(GainProblem(task=task.replace(**changes), axis=problem.axis))

    if all(member in SCENARIO_INPUTS for member in several.values):
        found = one(scenario=several.scenario)
        best, least = np.asarray(found.gain), np.asarray(found.objective)
    else:
        each = [one(scenario=s, sensor=c) for s, c in map(several.at, range(count))]
        best, least = (np.array([getattr(d, n) for d in each], dtype=np.float64) for n in ("gain", "objective"))
    unit = input_units(task.sensor)[name]
    return Price(name=name, unit=unit, value=x, best_gain=best, best=least, robust=robust, low=low, high=high)


def _known(uncertainty: Uncertainty, name: str) -> tuple[JointDistribution, tuple[str, ...]]:
    """Return what is known of an input, and the inputs that it is known together with, itself among them."""
    for key, known in uncertainty.items():
        if name in known.inputs(key):
            return known, known.inputs(key)
    raise InvalidInputError(f"price: found {name!r}, expected an uncertain input: {', '.join(names_of(uncertainty))}")
