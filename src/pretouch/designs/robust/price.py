"""Compute the benefit of exact knowledge of an uncertain input.

An example of an input is the object's speed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.motion.scenario import SCENARIO_INPUTS, input_units
from pretouch.uncertainty import Ensemble, JointDistribution, Uncertainty, make_ensemble
from pretouch.uncertainty.ensemble import names_of

from ..gain import GainDesign
from ..problem import GainProblem
from ..task import Task

_TAIL = 0.01  # probability of each tail that the range of an unbounded input excludes


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Price(Value):
    """Comparison of the robust gain with exact knowledge of an input.

    For each value of this input, another gain would be optimal.

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
        """Relative loss of the robust gain for each input value.

        It is the increase of the objective over that of the optimal gain.
        """
        return self.robust / self.best - 1

    def __repr__(self) -> str:
        most = np.max(self.loss, initial=0.0, where=np.isfinite(self.loss))
        return f"<Price: {self.name} from {self.low:g} to {self.high:g} {self.unit}, loss up to {most:.3g}>"


def price_of_robustness(problem: GainProblem, name: str, count: int, gain: float | None) -> Price:
    """Compare one gain with the optimal gain for each input value.

    The other inputs keep their given values. Inputs that were estimated together with this input take their likeliest
    values. The optimal gains ignore constraints, so that the loss is never negative; constraints may cause part of the
    loss.

    Returns:
        The comparison over the values of this input.

    Raises:
        InvalidInputError: the count is no whole number >= 2.
        ResultUnavailableError: there is no gain.
    """
    if type(count) is not int or count < 2:
        raise InvalidInputError(f"count: found {count!r}, expected a whole number that is 2 or larger", value=count)
    if gain is None:
        raise ResultUnavailableError("price: there is no robust gain to compare; see the status, or pass a gain")
    task = problem.task.replace(constraints=())
    joint, members = _distribution_of(task.uncertainty, name)
    marginal = joint.alone(members.index(name))
    low, high = marginal.support
    if not (np.isfinite(low) and np.isfinite(high)):
        low, high = marginal.quantile(_TAIL), marginal.quantile(1 - _TAIL)
    x = np.linspace(low, high, count)
    ensemble = _ensemble(task, name, x)

    def design(**changes: Any) -> GainDesign:
        return GainDesign.of(GainProblem(task=task.replace(**changes), axis=problem.axis))

    if all(member in SCENARIO_INPUTS for member in ensemble.values):
        designs = design(scenario=ensemble.scenario)
        best, least = np.asarray(designs.gain), np.asarray(designs.objective)
    else:
        each = [design(scenario=s, sensor=c) for s, c in map(ensemble.at, range(count))]
        best, least = (np.array([getattr(d, n) for d in each], dtype=np.float64) for n in ("gain", "objective"))
    unit, robust = input_units(task.sensor)[name], _objectives(task, ensemble, gain)
    return Price(name=name, unit=unit, value=x, best_gain=best, best=least, robust=robust, low=low, high=high)


def price_of_gain(problem: GainProblem, price: Price, gain: float) -> Price:
    """Compare another gain with the optimal gains of an earlier comparison.

    Returns:
        The comparison, without a new search.
    """
    task = problem.task
    return replace(price, robust=_objectives(task, _ensemble(task, price.name, price.value), gain))


def _ensemble(task: Task, name: str, x: FloatArray) -> Ensemble:
    """Return one encounter for each value of an uncertain input."""
    joint, members = _distribution_of(task.uncertainty, name)
    values = dict(zip(members, joint.others(members.index(name), x), strict=True)) | {name: x}
    return make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon, law=task.law)


def _objectives(task: Task, ensemble: Ensemble, gain: float) -> FloatArray:
    """Return the objective of one gain in each encounter; NaN without contact."""
    result = ensemble.contacts(gain)
    return np.where(result.reached, task.goal.value(result.end, ensemble.speed, task.impact), np.nan)


def _distribution_of(uncertainty: Uncertainty, name: str) -> tuple[JointDistribution, tuple[str, ...]]:
    """Return the distribution of an input, and all inputs of that distribution."""
    for key, joint in uncertainty.items():
        if name in joint.inputs(key):
            return joint, joint.inputs(key)
    raise InvalidInputError(
        f"price: found {name!r}, expected the name of an uncertain input: {', '.join(names_of(uncertainty))}",
        value=name,
    )
