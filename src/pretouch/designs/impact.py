"""Compute the peak impact force from the relative velocity."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.blocks import Cell, Measured
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, quantity
from pretouch._core.numbers import float_or_array, positive

_STEP = 0.02  # step of the difference, relative to the velocity
_STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # central difference of order 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactModel(ABC):
    """Base class of impact models for robot and obstacle.

    A model describes a lossless normal impact between two free bodies. Losses would only make the peak force smaller.

    The peak force is no upper bound if a force drives the bodies together during the impact, such as the robot's drive.

    Args:
        robot_mass: the *physical* reflected mass of the robot at the contact point [kg], not the virtual M_a.
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
    """

    robot_mass: float = quantity("kg", sign="positive", example='"4 kg"')
    obstacle_mass: float = quantity("kg", math.inf, sign="positive", infinite=True, example='"inf"')

    def __post_init__(self) -> None:
        check_declared(self)

    @property
    def reduced_mass(self) -> float:
        """The reduced mass of robot and obstacle [kg].

        It is 1 / (1/m_robot + 1/m_obstacle).
        """
        return 1 / (1 / self.robot_mass + 1 / self.obstacle_mass)

    @abstractmethod
    def peak_force(self, relative_velocity: ArrayLike) -> Any:
        """Return the peak impact force at a relative velocity.

        The force is in N, the relative velocity in m/s.
        """

    def peak_force_slope(self, relative_velocity: ArrayLike) -> Any:
        """Differentiate the peak force with respect to the relative velocity.

        The relative velocity l' [m/s] must not be zero. Models without a formula use a difference of order 8, with an
        error of about 1e-13 of force over velocity.

        Returns:
            The derivative [N s/m].
        """
        v = np.asarray(relative_velocity, dtype=np.float64)
        step = _STEP * v
        rise = sum(w * (self.peak_force(v + k * step) - self.peak_force(v - k * step)) for k, w in _STENCIL)
        return float_or_array(np.asarray(rise) / step)


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticImpact(ImpactModel):
    """Impact with an elastic contact force.

    The contact force is k d^n at the penetration depth d.

    The peak force is k^(1/(n+1)) ((n+1)/2 mu v^2)^(n/(n+1)) at a speed v, with the reduced mass mu.
    It follows from 1/2 mu v^2 = k d^(n+1) / (n+1): at the largest depth, the contact has stored all energy.

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
            raise InvalidInputError(f"exponent: found {self.exponent:g}, which must be at least 1", value=self.exponent)

    @property
    def speed_exponent(self) -> float:
        """Exponent of the impact speed in the formula of the peak force.

        It is 2 n / (n+1) for a contact force with exponent n.
        """
        return 2 * self.exponent / (self.exponent + 1)

    def peak_force(self, relative_velocity: ArrayLike) -> Any:
        """Return the peak force [N] of the elastic impact."""
        n, power = self.exponent, self.speed_exponent
        factor = self.stiffness ** (1 / (n + 1)) * ((n + 1) / 2 * self.reduced_mass) ** (power / 2)
        return float_or_array(factor * np.abs(relative_velocity) ** power)

    def peak_force_slope(self, relative_velocity: ArrayLike) -> Any:
        """Differentiate the peak force with respect to the relative velocity.

        Returns:
            The derivative [N s/m].
        """
        force = np.asarray(self.peak_force(relative_velocity))
        return float_or_array(self.speed_exponent * force / np.asarray(relative_velocity))


@dataclass(frozen=True, slots=True, kw_only=True)
class SpringImpact(ElasticImpact):
    """Impact with a contact force that is proportional to the penetration depth.

    The peak force is F = |v| sqrt(mu k) at a speed v, from 1/2 mu v^2 = 1/2 F^2 / k with the reduced mass mu.

    Args:
        robot_mass: the physical reflected mass of the robot [kg].
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
        stiffness: contact stiffness k > 0 [N/m].

    Examples:
        >>> SpringImpact(robot_mass=1.0, stiffness=1e4).peak_force(-0.1)
        10.0
    """

    stiffness: float = quantity("N/m", sign="positive", example='"10 kN/m"')
    exponent: float = field(default=1.0, init=False, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzImpact(ElasticImpact):
    """Impact of a sphere with a Hertzian contact force.

    See K. L. Johnson, Contact Mechanics, 1985, 11.4. The force at depth d is F = 4/3 E* sqrt(R) d^(3/2).

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

    effective_modulus: float = quantity("Pa", sign="positive", example='"10 MPa"')
    radius: float = quantity("m", sign="positive", example='"10 mm"')
    stiffness: float = field(init=False, repr=False)
    exponent: float = field(default=1.5, init=False, repr=False)

    def __post_init__(self) -> None:
        check_declared(self)
        object.__setattr__(self, "stiffness", 4 / 3 * self.effective_modulus * math.sqrt(self.radius))
        ElasticImpact.__post_init__(self)


def impact_rows(impact: ImpactModel | None) -> Iterator[tuple[Cell, ...]]:
    """Yield table rows with the masses of robot and obstacle.

    There are no rows without an impact model.
    """
    if impact is not None:
        yield "physical mass of the robot", Measured(impact.robot_mass, "kg")
        yield "mass of the obstacle", Measured(impact.obstacle_mass, "kg")
