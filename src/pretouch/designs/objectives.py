"""Define objectives as weighted sums of squares, for example of excursion and contact speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, finite, nonnegative
from pretouch.motion.contact import ContactState

from .impact import ImpactModel
from .quantities import check_quantity, contact_value

OBSTACLE_SPEED = "obstacle speed"
Scale: TypeAlias = float | Literal["obstacle speed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """One term of an objective: weight * (quantity / scale)^2.

    Args:
        quantity: a key of QUANTITY_UNITS, such as `displacement`, `relative_velocity`, `time`, `impact_force`, or a
            `ContactQuantity`.
        scale: the typical value, in SI, not 0; its sign has no effect. Or `"obstacle speed"`: the speed of the
            obstacle in each scenario, for velocities only.
        weight: w >= 0.
    """

    quantity: str
    scale: Scale
    weight: float = 1.0

    def __post_init__(self) -> None:
        check_types(self)
        check_quantity(self.quantity, "quantity")
        nonnegative(self.weight, "weight")
        if isinstance(self.scale, str):
            if self.scale != OBSTACLE_SPEED:
                raise InvalidInputError(
                    f"scale: found {self.scale!r}, expected a number or {OBSTACLE_SPEED!r}", value=self.scale
                )
            if "velocity" not in self.quantity and "speed" not in self.quantity:
                raise InvalidInputError(f"scale: {OBSTACLE_SPEED!r} scales velocities, not {self.quantity!r}")
        elif finite(self.scale, "scale") == 0:
            raise InvalidInputError("scale: found 0, expected a typical value other than 0")

    def scale_for(self, obstacle_speed: Any) -> Any:
        """Return the scale of a quantity in the objective.

        An example is the obstacle's speed [m/s].

        Raises:
            InvalidInputError: the scale is the obstacle's speed, but the obstacle is at rest.
        """
        if not isinstance(self.scale, str):
            return self.scale
        if np.any(np.asarray(obstacle_speed) == 0):
            raise InvalidInputError(
                f"scale: found {OBSTACLE_SPEED!r}, but the obstacle is at rest and its speed is 0. Set the scale of "
                f"the {self.quantity} to a number in m/s",
                value=OBSTACLE_SPEED,
            )
        return np.abs(obstacle_speed)

    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> Any:
        """Return the value of one objective term at contact.

        It is weight * (quantity / scale)^2. `obstacle_speed` is |x_o'| at the start [m/s].
        """
        with np.errstate(over="ignore"):  # an infinite objective is never the least
            return self.weight * (contact_value(self.quantity, state, impact) / self.scale_for(obstacle_speed)) ** 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """A design objective: a weighted sum of squared, scaled quantities at contact.

    A subclass that overrides `value` needs no terms; reports then show the name of the class.

    Args:
        terms: the terms, at least one with a positive weight.
        name: its name in reports.

    Examples:
        >>> Objective(terms=(Term(quantity="largest_acceleration", scale=10.0),), name="gentle").name
        'gentle'
    """

    terms: tuple[Term, ...] = ()
    name: str = "custom"

    def __post_init__(self) -> None:
        check_types(self)
        custom = type(self).value is not Objective.value or type(self).parts is not Objective.parts
        if not custom and not any(term.weight > 0 for term in self.terms):
            raise InvalidInputError("terms: found none with a positive weight, expected one or more")

    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> FloatArray:
        """Return the value of the objective at contact.

        Args:
            state: the state at contact.
            obstacle_speed: |x_o'| at the start [m/s], for scales that equal it.
            impact: the physical properties, for terms with forces.

        Returns:
            The objective, of the shape of the state.
        """
        return np.asarray(sum(self.parts(state, obstacle_speed, impact).values()), dtype=np.float64)

    def parts(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> Mapping[str, Any]:
        """Return the contribution of each quantity to the objective.

        It is the sum of all terms with this quantity.
        """
        parts: dict[str, Any] = {}
        for term in self.terms:
            part = term.value(state, obstacle_speed, impact)
            parts[term.quantity] = parts[term.quantity] + part if term.quantity in parts else part
        return parts


@check_arguments
def excursion_objective(
    *, position_scale: float, velocity_scale: Scale, position_weight: float = 1.0, velocity_weight: float = 1.0
) -> Objective:
    """Make an objective of excursion and contact velocity.

    The letter defines it in L(20). It is the weighted sum of squared excursion and squared contact velocity.

    Args:
        position_scale: x_typ [m]; x is the deviation from the reference at contact, x - x_d.
        velocity_scale: l'_typ [m/s], or `"obstacle speed"`. The choice matters if speeds are compared. In the letter's
            Fig. 6, with the scale fixed at 0.3 m/s, the optimal |D_p| grows with the obstacle speed from 0.05 to 1 m/s.
            If the scale equals the obstacle speed, the optimal |D_p| falls up to 0.5 m/s.
        position_weight: w_1 >= 0.
        velocity_weight: w_2 >= 0.

    Returns:
        The objective.

    Examples:
        >>> excursion_objective(position_scale=0.5, velocity_scale=0.3).name
        'excursion'
    """
    price = Term(quantity="displacement", scale=position_scale, weight=position_weight)
    speed = Term(quantity="relative_velocity", scale=velocity_scale, weight=velocity_weight)
    return Objective(terms=(price, speed), name="excursion")


@check_arguments
def time_objective(
    *, time_scale: float, velocity_scale: Scale, time_weight: float = 1.0, velocity_weight: float = 1.0
) -> Objective:
    """Make an objective of contact time and contact velocity.

    The letter defines it in L(22). It is the weighted sum of squared contact time and squared contact velocity.

    Args:
        time_scale: t_typ [s].
        velocity_scale: l'_typ [m/s], or `"obstacle speed"`.
        time_weight: w_3 >= 0.
        velocity_weight: w_4 >= 0.

    Returns:
        The objective.

    Examples:
        >>> time_objective(time_scale=1.0, velocity_scale=0.01).name
        'time'
    """
    price = Term(quantity="time", scale=time_scale, weight=time_weight)
    speed = Term(quantity="relative_velocity", scale=velocity_scale, weight=velocity_weight)
    return Objective(terms=(price, speed), name="time")
