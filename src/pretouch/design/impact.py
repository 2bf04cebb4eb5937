"""The impact force where the physical properties are known, Section VI.B of the letter."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.numbers import float_or_array, positive

__all__ = ["HertzImpact", "ImpactModel", "SpringImpact"]

_STEP = 0.02  # of a velocity
_STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # central, of order 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactModel(ABC):
    """A lossless normal impact of two free bodies: no loss makes the peak force larger.

    It is no bound where something drives the bodies on during the impact: a robot's drive, or a push of the obstacle.

    Args:
        robot_mass: the *physical* reflected mass of the robot at the contact point [kg], not the virtual M_a.
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
    """

    robot_mass: float
    obstacle_mass: float = math.inf

    def __post_init__(self) -> None:
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
        """Return the derivative of the peak force [N s/m]: by a difference of order 8, where a model has none.

        Args:
            relative_velocity: l' [m/s], not 0.

        Returns:
            The derivative, of the same shape; good to some 1e-13 of force over velocity.
        """
        v = np.asarray(relative_velocity, dtype=np.float64)
        step = _STEP * v
        rise = sum(w * (self.peak_force(v + k * step) - self.peak_force(v - k * step)) for k, w in _STENCIL)
        return float_or_array(np.asarray(rise) / step)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpringImpact(ImpactModel):
    """Impact on a linear contact stiffness: F = |v| sqrt(mu k), from 1/2 mu v^2 = 1/2 F^2 / k.

    Args:
        robot_mass: the physical reflected mass of the robot [kg].
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
        stiffness: contact stiffness k > 0 [N/m].

    Examples:
        >>> SpringImpact(robot_mass=1.0, stiffness=1e4).peak_force(-0.1)
        10.0
    """

    stiffness: float

    def __post_init__(self) -> None:
        ImpactModel.__post_init__(self)
        positive(self.stiffness, "stiffness", "N/m")

    def peak_force(self, relative_velocity: ArrayLike) -> Any:
        """Return |v| sqrt(mu k) [N]."""
        return float_or_array(np.abs(relative_velocity) * math.sqrt(self.reduced_mass * self.stiffness))

    def peak_force_slope(self, relative_velocity: ArrayLike) -> Any:
        """Return the derivative of the peak force [N s/m], sqrt(mu k) with the sign of v."""
        return float_or_array(np.sign(relative_velocity) * math.sqrt(self.reduced_mass * self.stiffness))


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzImpact(ImpactModel):
    """Impact of a sphere by Hertz's law F = 4/3 E* sqrt(R) d^(3/2) (K. L. Johnson, Contact Mechanics, 1985, 11.4).

    From 1/2 mu v^2 = 2/5 k_h d^(5/2) with k_h = 4/3 E* sqrt(R): F = k_h^(2/5) (5/4 mu v^2)^(3/5).

    Args:
        robot_mass: the physical reflected mass of the robot [kg].
        obstacle_mass: mass of the obstacle [kg]; infinite for a wall.
        effective_modulus: E* > 0 [Pa], 1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2.
        radius: effective radius R > 0 [m], 1/R = 1/R_1 + 1/R_2.

    Examples:
        >>> round(HertzImpact(robot_mass=1.0, effective_modulus=1e7, radius=0.01).peak_force(-0.1), 3)
        20.329
    """

    effective_modulus: float
    radius: float

    def __post_init__(self) -> None:
        ImpactModel.__post_init__(self)
        positive(self.effective_modulus, "effective_modulus", "Pa")
        positive(self.radius, "radius", "m")

    def peak_force(self, relative_velocity: ArrayLike) -> Any:
        """Return k_h^(2/5) (5/4 mu v^2)^(3/5) [N]."""
        stiffness = 4 / 3 * self.effective_modulus * math.sqrt(self.radius)
        energy = 1.25 * self.reduced_mass * np.square(relative_velocity)
        return float_or_array(stiffness**0.4 * energy**0.6)

    def peak_force_slope(self, relative_velocity: ArrayLike) -> Any:
        """Return the derivative of the peak force [N s/m], 6/5 F / v."""
        return float_or_array(1.2 * np.asarray(self.peak_force(relative_velocity)) / np.asarray(relative_velocity))
