"""@@"""

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
    """Results of one gain in each of the fresh encounters.

    Args:
        gain: the law's number, such as D_p [N s].
        objective: the objective, shape (n,); infinite without contact.
        reached: which encounters end in contact, shape (n,).
        state: the state at the end of each encounter, fields of shape (n,).
        inputs: the uncertain inputs by name, in SI, shape (n,) each.
        impact: the physical properties, or None.
    """

    gain: float
    objective: FloatArray
    reached: BoolArray
    state: ContactState
    inputs: dict[str, FloatArray]
    impact: ImpactModel | None

    def magnitude(self, quantity: str) -> FloatArray:
        """Return |quantity| in SI for a name of QUANTITY_UNITS, shape (n,); infinite without contact."""
        values = np.abs(np.asarray(quantity_of(quantity, self.state, self.impact)))
        return np.where(self.reached, np.broadcast_to(values, self.reached.shape), np.inf)

    def reaches(self, quantity: str, share: float) -> float:
        """Return a quantile of the magnitude of a quantity, in SI: it is not exceeded in this share of encounters."""
        return float(np.sort(self.magnitude(quantity))[math.ceil(share * len(self.objective)) - 1])

    def __repr__(self) -> str:
        return f"<RobustOutcomes: {len(self.objective)} encounters with gain {self.gain:.4g}>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustTradeOff(Value):
    """The measure of the objective over the gain, on the samples of the design.

    Args:
        gain: the law's number, such as D_p [N s], ascending, shape (n,).
        value: the measure; infinite if relevant encounters end without contact.
        feasible: whether every constraint holds with its required probability.
    """

    gain: FloatArray
    value: FloatArray
    feasible: BoolArray

    def __repr__(self) -> str:
        return f"<RobustTradeOff: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g}>"


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
# the objective is linear in the inputs, and the share is (df/dx)^2 Var x over the sum of all these terms. If encounters
# have noise, the noise is one more input: B has other noise than A.
@dataclass(frozen=True, slots=True, kw_only=True)
class InputImportance(Value):
    """Share of one uncertain input in the variance of the objective (Sobol indices).

    Args:
        name: the input, the name of several inputs that were estimated together, or "noise".
        inputs: the names of these inputs.
        alone: first-order index S: the mean share of the variance that knowing this input exactly would remove.
        alone_error: standard error of S.
        total: total index T: the share of the variance that would remain if all other inputs were known.
        total_error: standard error of T.
        by_gradient: the share to first order, from gradients at the given values; None without gradients.
    """

    name: str
    inputs: tuple[str, ...]
    alone: float
    alone_error: float
    total: float
    total_error: float
    by_gradient: float | None


def rank_uncertain_inputs(problem: RobustProblem, gain: float) -> tuple[InputImportance, ...]:
    """Rank uncertain inputs by their share in the variance of the objective at a gain, the largest first."""
    # Each of the two sets has the number of samples of the task, but at least _FEWEST. Shares are NaN if an encounter
    # ends without contact.
    task, uncertainty = problem.task, problem.task.uncertainty
    if not uncertainty:
        return ()
    samples = max(task.samples or 0, _FEWEST)
    noise_a = task.evaluate
    noise_b = None if noise_a is None else with_noise_after(noise_a, samples)
    both = _two_sets(uncertainty, samples, task.seed or 0)
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
    """Return two independent sets of samples by input, shape (samples, 2)."""
    sets = [sample_inputs(uncertainty, samples, seed=s, sampling="random") for s in (2 * seed, 2 * seed + 1)]
    return {name: np.stack([samples_of[name] for samples_of in sets], axis=1) for name in sets[0]}


def _shares(f_a: FloatArray, f_b: FloatArray, f_c: FloatArray) -> tuple[float, float]:
    """Return S and T; the mean is subtracted first, which changes neither and reduces the error of S."""
    every = np.concatenate([f_a, f_b])
    middle, variance = every.mean(), every.var()
    if variance == 0:
        return 0.0, 0.0
    return float(((f_b - middle) * (f_c - f_a)).mean() / variance), float(((f_a - f_c) ** 2).mean() / (2 * variance))


def _linear_shares(problem: RobustProblem, gain: float) -> dict[str, float] | None:
    """Return the share of each input to first order around the means."""
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


_TAIL = 0.01  # probability of each tail that is cut off the range of an unbounded input


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Price(Value):
    """Comparison of the robust gain with the optimal gain for each exactly known value of one input.

    Args:
        name: the input.
        unit: its SI unit.
        value: its values, shape (n,).
        best_gain: the optimal gain for each value, such as D_p [N s]; NaN without an optimal gain.
        best: the objective of the optimal gain.
        robust: the objective of the robust gain; NaN without contact.
        low: the smallest possible value of the input, or its 1 % quantile if it has no bounds.
        high: the largest possible value, or the 99 % quantile.
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
        """Relative loss of the robust gain compared with the optimal one."""
        return self.robust / self.best - 1

    def __repr__(self) -> str:
        most = np.max(self.loss, initial=0.0, where=np.isfinite(self.loss))
        return f"<Price: {self.name} from {self.low:g} to {self.high:g} {self.unit}, loss up to {most:.3g}>"


def price_of_robustness(problem: GainProblem, name: str, count: int, gain: float | None) -> Price:
    """Compare one gain with the optimal gain for each of many values of an input, the others at their given values."""
    # Inputs that were estimated together with it take their likeliest values. The optimal gains ignore constraints, so
    # that the loss is never negative; part of the loss may be caused by constraints.
    if type(count) is not int or count < 2:
        raise InvalidInputError(f"count: found {count!r}, expected a whole number of at least 2")
    if gain is None:
        raise ResultUnavailableError("price: there is no robust gain to compare; see the status, or pass a gain")
    task = problem.task.replace(constraints=())
    joint, members = _distribution_of(task.uncertainty, name)
    marginal = joint.alone(members.index(name))
    low, high = marginal.support
    if not (np.isfinite(low) and np.isfinite(high)):
        low, high = marginal.quantile(_TAIL), marginal.quantile(1 - _TAIL)
    x = np.linspace(low, high, count)
    values = dict(zip(members, joint.others(members.index(name), x), strict=True)) | {name: x}
    ensemble = make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon, law=task.law)
    result = ensemble.contacts(gain)
    robust = np.where(result.reached, task.goal.value(result.end, ensemble.speed, task.impact), np.nan)

    def design(**changes: Any) -> GainDesign:
        return GainDesign.of(GainProblem(task=task.replace(**changes), axis=problem.axis))

    if all(member in SCENARIO_INPUTS for member in ensemble.values):
        designs = design(scenario=ensemble.scenario)
        best, least = np.asarray(designs.gain), np.asarray(designs.objective)
    else:
        each = [design(scenario=s, sensor=c) for s, c in map(ensemble.at, range(count))]
        best, least = (np.array([getattr(d, n) for d in each], dtype=np.float64) for n in ("gain", "objective"))
    unit = input_units(task.sensor)[name]
    return Price(name=name, unit=unit, value=x, best_gain=best, best=least, robust=robust, low=low, high=high)


def _distribution_of(uncertainty: Uncertainty, name: str) -> tuple[JointDistribution, tuple[str, ...]]:
    """Return the joint distribution of an input, and the names of all inputs that it describes."""
    for key, joint in uncertainty.items():
        if name in joint.inputs(key):
            return joint, joint.inputs(key)
    raise InvalidInputError(f"price: found {name!r}, expected an uncertain input: {', '.join(names_of(uncertainty))}")
