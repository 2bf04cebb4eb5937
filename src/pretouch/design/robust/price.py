"""The price of robustness: what knowing an input exactly would have gained."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.motion.inputs import SCENARIO_INPUTS, input_units
from pretouch.uncertainty import JointDistribution, Uncertainty, make_ensemble
from pretouch.uncertainty.sampling import names_of

from ..problem import GainProblem
from ..result import GainDesign

__all__ = ["Price", "price_of_robustness"]

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
    several = make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon)
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
