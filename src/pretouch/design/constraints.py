"""Constraints: limits of the quantities of a contact."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.arguments import check_arguments
from pretouch._core.blocks import Cell, Measured
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite, float_or_array, positive
from pretouch._core.values import check_types
from pretouch._core.vocabulary import unit_of
from pretouch.motion.contact import ContactState

_STEP = 0.02  # step of the difference, relative to the velocity
_STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # central difference of order 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactModel(ABC):
    """A lossless normal impact of two free bodies; losses would only make the peak force smaller.

    The peak force is no upper bound if a force drives the bodies together during the impact, such as the robot's drive.

    Args:
        robot_mass: the *physical* reflected mass of the robot at the contact point [kg], not the virtual M_a.
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
    """

    robot_mass: float
    obstacle_mass: float = math.inf

    def __post_init__(self) -> None:
        check_types(self)
        positive(self.robot_mass, "robot_mass", "kg")
        if not math.isinf(self.obstacle_mass):
            positive(self.obstacle_mass, "obstacle_mass", "kg")

    @property
    def reduced_mass(self) -> float:
        """The reduced mass mu = 1 / (1/m_robot + 1/m_obstacle) [kg]."""
        return 1 / (1 / self.robot_mass + 1 / self.obstacle_mass)

    @abstractmethod
    def peak_force(self, relative_velocity: ArrayLike) -> Any:
        """Return the peak force [N] of an impact at the given relative velocity [m/s]."""

    def peak_force_slope(self, relative_velocity: ArrayLike) -> Any:
        """Return the derivative of the peak force [N s/m] at a relative velocity l' other than 0 [m/s]."""
        # Models without a formula use a difference of order 8, with an error of about 1e-13 of force over velocity.
        v = np.asarray(relative_velocity, dtype=np.float64)
        step = _STEP * v
        rise = sum(w * (self.peak_force(v + k * step) - self.peak_force(v - k * step)) for k, w in _STENCIL)
        return float_or_array(np.asarray(rise) / step)


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticImpact(ImpactModel):
    """Impact on a contact force F = k d^n of the depth d, with the peak k^(1/(n+1)) ((n+1)/2 mu v^2)^(n/(n+1)).

    It follows from 1/2 mu v^2 = k d^(n+1) / (n+1): all energy is in the contact at the largest depth.

    Args:
        robot_mass: the physical reflected mass of the robot [kg].
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
        stiffness: k > 0 [N/m^n].
        exponent: n >= 1; 1 for a spring, 3/2 for a sphere by Hertz's law.

    Examples:
        >>> ElasticImpact(robot_mass=1.0, stiffness=1e4, exponent=1.0).peak_force(-0.1)
        10.0
    """

    stiffness: float
    exponent: float

    def __post_init__(self) -> None:
        ImpactModel.__post_init__(self)
        positive(self.stiffness, "stiffness", "N/m" if self.exponent == 1 else "N/m^n")
        if not positive(self.exponent, "exponent") >= 1:
            raise InvalidInputError(f"exponent: found {self.exponent:g}, which must be at least 1")

    @property
    def speed_exponent(self) -> float:
        """The power 2 n / (n+1) of the speed with which the peak force grows."""
        return 2 * self.exponent / (self.exponent + 1)

    def peak_force(self, relative_velocity: ArrayLike) -> Any:
        """Return k^(1/(n+1)) ((n+1)/2 mu v^2)^(n/(n+1)) [N]."""
        n, power = self.exponent, self.speed_exponent
        factor = self.stiffness ** (1 / (n + 1)) * ((n + 1) / 2 * self.reduced_mass) ** (power / 2)
        return float_or_array(factor * np.abs(relative_velocity) ** power)

    def peak_force_slope(self, relative_velocity: ArrayLike) -> Any:
        """Return the derivative of the peak force [N s/m], 2 n / (n+1) F / v."""
        force = np.asarray(self.peak_force(relative_velocity))
        return float_or_array(self.speed_exponent * force / np.asarray(relative_velocity))


@dataclass(frozen=True, slots=True, kw_only=True)
class SpringImpact(ElasticImpact):
    """Impact on a linear contact stiffness: F = |v| sqrt(mu k), from 1/2 mu v^2 = 1/2 F^2 / k.

    Args:
        robot_mass: the physical reflected mass of the robot [kg].
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
        stiffness: contact stiffness k > 0 [N/m].

    Examples:
        >>> SpringImpact(robot_mass=1.0, stiffness=1e4).peak_force(-0.1)
        10.0
    """

    exponent: float = field(default=1.0, init=False, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzImpact(ElasticImpact):
    """Impact of a sphere by Hertz's law F = 4/3 E* sqrt(R) d^(3/2) (K. L. Johnson, Contact Mechanics, 1985, 11.4).

    With k_h = 4/3 E* sqrt(R): F = k_h^(2/5) (5/4 mu v^2)^(3/5).

    Args:
        robot_mass: the physical reflected mass of the robot [kg].
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
        effective_modulus: E* > 0 [Pa], 1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2.
        radius: effective radius R > 0 [m], 1/R = 1/R_1 + 1/R_2.

    Attributes:
        stiffness: k_h [N/m^(3/2)].

    Examples:
        >>> round(HertzImpact(robot_mass=1.0, effective_modulus=1e7, radius=0.01).peak_force(-0.1), 3)
        20.329
    """

    effective_modulus: float
    radius: float
    stiffness: float = field(init=False, repr=False)
    exponent: float = field(default=1.5, init=False, repr=False)

    def __post_init__(self) -> None:
        check_types(self)
        modulus = positive(self.effective_modulus, "effective_modulus", "Pa")
        object.__setattr__(self, "stiffness", 4 / 3 * modulus * math.sqrt(positive(self.radius, "radius", "m")))
        ElasticImpact.__post_init__(self)


def impact_rows(impact: ImpactModel | None) -> Iterator[tuple[Cell, ...]]:
    """Yield table rows with the physical properties of an impact; none without an impact model."""
    if impact is not None:
        yield "physical mass of the robot", Measured(impact.robot_mass, "kg")
        yield "mass of the obstacle", Measured(impact.obstacle_mass, "kg")


_STATE_FIELDS: Final = tuple(name for name in ContactState.names() if name != "distance")  # the distance is always 0

QUANTITY_UNITS: Final[dict[str, str]] = {
    name: unit_of(name) for name in (*_STATE_FIELDS, "drive_force", "impact_force", "gain")
}
"""SI unit of every quantity: the fields of ContactState, two that need the robot's physical mass, and the gain."""


@check_arguments
def quantity_of(name: str, state: ContactState, impact: ImpactModel | None = None) -> Any:
    """Read a quantity from the state at contact.

    Args:
        name: a key of QUANTITY_UNITS. `drive_force` is the physical mass times the largest acceleration;
            `impact_force` is the peak force of the impact at the relative velocity of contact, `gain` the law's
            number, such as D_p [N s], that led to the state.
        state: the state at contact.
        impact: the physical properties, needed for `drive_force` and `impact_force`.

    Returns:
        The quantity in SI, of the shape of the state.

    Raises:
        InvalidInputError: the quantity is unknown, or it needs physical properties and there is no impact model.
    """
    if name not in QUANTITY_UNITS:
        raise InvalidInputError(f"quantity: found {name!r}, expected one of {', '.join(QUANTITY_UNITS)}")
    if name in _STATE_FIELDS:
        return getattr(state, name)
    if name == "gain":
        return state.columns.column("gain")
    if impact is None:
        raise InvalidInputError(
            f"{name}: needs the physical properties of robot and obstacle; pass an impact model with the robot's "
            "reflected mass, which is not the virtual mass of the admittance"
        )
    if name == "drive_force":
        return impact.robot_mass * np.asarray(state.largest_acceleration)
    return impact.peak_force(state.relative_velocity)


CONSTRAINT_NAMES: Final[dict[str, str]] = {
    "excursion": "largest_excursion",
    "travel": "largest_travel",
    "relative_velocity": "relative_velocity",
    "time": "time",
    "speed": "largest_speed",
    "acceleration": "largest_acceleration",
    "virtual_force": "largest_virtual_force",
    "drive_force": "drive_force",
    "impact_force": "impact_force",
    "gain": "gain",
}
"""Short name of each constraint, as in a scenario file, with the quantity that it limits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraint:
    """A limit |quantity| <= limit.

    Args:
        name: a key of CONSTRAINT_NAMES: `excursion` (|x - x_d| over the whole motion), `travel` (|x - x(0)| over the
            whole motion), `relative_velocity` (at contact), `time` (of contact), `speed`, `acceleration`,
            `virtual_force` (of the plant, over the whole motion), `drive_force` (physical mass times largest
            acceleration), `impact_force` (peak force of the impact), `gain` (magnitude of the law's number, such as
            |D_p|, as `GainLimit.allowed`).
        limit: the largest allowed magnitude > 0, in SI.

    Examples:
        >>> Constraint(name="excursion", limit=0.2).unit
        'm'
    """

    name: str
    limit: float

    def __post_init__(self) -> None:
        check_types(self)
        if self.name not in CONSTRAINT_NAMES:
            raise InvalidInputError(f"constraint: found {self.name!r}, expected one of {', '.join(CONSTRAINT_NAMES)}")
        if not finite(self.limit, f"constraint {self.name}", self.unit) > 0:
            raise InvalidInputError(f"constraint {self.name}: found {self.limit:g} {self.unit}, which must be positive")

    @property
    def quantity(self) -> str:
        """The quantity that is limited."""
        return CONSTRAINT_NAMES[self.name]

    @property
    def unit(self) -> str:
        """The SI unit of the limit."""
        return QUANTITY_UNITS[self.quantity]

    def magnitude(self, state: ContactState, impact: ImpactModel | None = None) -> Any:
        """Return |quantity| at a contact in SI, of the shape of the state; forces need an impact model."""
        return np.abs(quantity_of(self.quantity, state, impact))


def each_once(constraints: Iterable[Constraint]) -> None:
    """Raise an error if a constraint name occurs twice."""
    names = [constraint.name for constraint in constraints]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f"constraint {name}: found twice, expected once; remove one of the two")
