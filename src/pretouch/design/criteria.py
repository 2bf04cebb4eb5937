"""What an encounter is appraised by: a number, made of quantities at contact, and how it follows them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch.motion.contact import ContactResult, ContactState

from .constraints import Constraint
from .impact import ImpactModel
from .objectives import OBSTACLE_SPEED, Objective
from .own_objective import appraise
from .quantities import quantity_of

__all__ = ["Criterion", "along", "magnitude", "merit", "ratio"]

Slope: TypeAlias = Callable[[str], Any]
"""From a quantity at contact to its derivative by some input."""

Rates: TypeAlias = list[tuple[str, Any]]

_WITH_GRADIENTS: Final = frozenset(
    ("time", "position", "velocity", "acceleration", "displacement", "relative_velocity", "virtual_force")
) | {"impact_force", "gain"}


# Every derivative of an objective or a limit, by whatever input, is this chain rule with the derivatives of the
# contact.
@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """A number of an encounter, from a result; and its derivative by each quantity that it is made of, from a state."""

    value: Callable[[ContactResult], Any]
    rates: Callable[[ContactState], Rates]
    has_gradients: bool  # of all of these: not where one needs the whole motion, or a class of the user's computes it

    def slope(self, state: ContactState, of: Slope) -> FloatArray:
        """Differentiate the number by an input, which `along` follows: in SI, of the shape of the state."""
        total = np.zeros(np.shape(state.time))
        for quantity, rate in self.rates(state):
            total = total + rate * np.asarray(of(quantity))
        return total


def along(of: Callable[[str, str], Any], by: str, velocity: Any = 0.0) -> Slope:
    """Follow one input: from a quantity to its derivative by it, the gain and the obstacle's speed among them."""
    # `of` is the derivative of a quantity by an input, as `ContactGradients` has it; `velocity` is that of the obstacle
    # at the start [m/s], for what follows its speed.

    def slope(quantity: str) -> Any:
        if quantity == "gain":
            return float(by == "gain")
        if quantity == OBSTACLE_SPEED:
            return np.sign(velocity) if by == "obstacle.velocity" else 0.0
        return of(quantity, by)

    return slope


def ratio(constraint: Constraint, impact: ImpactModel | None) -> Criterion:
    """Make the criterion |quantity| / limit."""
    return magnitude(constraint.quantity, impact, constraint.limit)


def magnitude(quantity: str, impact: ImpactModel | None, unit: float = 1.0) -> Criterion:
    """Make the criterion |quantity|, by a unit of it."""

    def rates(state: ContactState) -> Rates:
        return [_at_contact(quantity, np.sign(quantity_of(quantity, state, impact)) / unit, state, impact)]

    return Criterion(
        value=lambda result: np.abs(quantity_of(quantity, result.end, impact)) / unit,
        rates=rates,
        has_gradients=quantity in _WITH_GRADIENTS,
    )


def merit(objective: Objective, obstacle_speed: Any, impact: ImpactModel | None) -> Criterion:
    """Make the criterion that an objective is: the sum of weight (q / s)^2; s may be the obstacle's speed [m/s]."""

    def rates(state: ContactState) -> Rates:
        found = []
        for term in objective.terms:
            value, scale = quantity_of(term.quantity, state, impact), term.scale_for(obstacle_speed)
            rate = 2 * term.weight * value / np.square(scale)
            found.append(_at_contact(term.quantity, rate, state, impact))
            if term.scale == OBSTACLE_SPEED:
                found.append((OBSTACLE_SPEED, -rate * value / scale))
        return found

    own = type(objective) is not Objective  # a class of the user's may compute anything
    return Criterion(
        value=lambda result: appraise(objective, result.end, result.reached, obstacle_speed, impact),
        rates=rates,
        has_gradients=not own and all(term.quantity in _WITH_GRADIENTS for term in objective.terms),
    )


def _at_contact(quantity: str, rate: Any, state: ContactState, impact: ImpactModel | None) -> tuple[str, Any]:
    """Return a rate as one by a quantity that has gradients: an impact force follows the relative velocity."""
    if quantity != "impact_force":
        return quantity, rate
    if impact is None:
        raise ResultUnavailableError("impact_force: needs the physical properties of robot and obstacle")
    return "relative_velocity", rate * impact.peak_force_slope(state.relative_velocity)
