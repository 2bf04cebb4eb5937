"""The force of an elastic contact in closed form: what a prediction can say of a contact that the loop simulates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import positive
from pretouch.design import ImpactModel
from pretouch.simulation import ContactModel, PlantModel

__all__ = ["ElasticImpact", "elastic_impact"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticImpact(ImpactModel):
    """Impact on F = k d^n without loss: 1/2 mu v^2 = k d^(n+1) / (n+1) gives the depth d, and so the force k d^n.

    Args:
        robot_mass: the physical reflected mass of the robot at the contact point [kg].
        obstacle_mass: mass of the obstacle [kg]; infinite where it is driven.
        stiffness: k > 0 [N/m^n].
        exponent: n >= 1; 1 for a spring, 3/2 for a sphere after Hertz.

    Examples:
        >>> ElasticImpact(robot_mass=1.0, stiffness=1e4, exponent=1.0).peak_force(-0.1)
        10.0
    """

    stiffness: float
    exponent: float

    def __post_init__(self) -> None:
        ImpactModel.__post_init__(self)
        positive(self.stiffness, "stiffness", "N/m^n")
        if not positive(self.exponent, "exponent") >= 1:
            raise InvalidInputError(f"exponent: found {self.exponent:g}, which must be at least 1")

    def peak_force(self, relative_velocity: ArrayLike) -> Any:
        """Return k ((n + 1) mu v^2 / (2 k))^(n / (n + 1)) [N]."""
        n, k = self.exponent, self.stiffness
        energy = 0.5 * (n + 1) * self.reduced_mass * np.square(relative_velocity)
        force = k * (energy / k) ** (n / (n + 1))
        return float(force) if np.ndim(force) == 0 else force

    def peak_force_slope(self, relative_velocity: ArrayLike) -> Any:
        """Return the derivative of the peak force [N s/m], 2 n / (n + 1) F / v."""
        share = 2 * self.exponent / (self.exponent + 1)
        slope = share * np.asarray(self.peak_force(relative_velocity)) / np.asarray(relative_velocity)
        return float(slope) if np.ndim(slope) == 0 else slope


def elastic_impact(contact: ContactModel | None, plant: PlantModel) -> ElasticImpact | None:
    """Take the loss from a contact: the impact of the robot's physical mass on its stiffness.

    Args:
        contact: the contact force of a loop, None where it has none.
        plant: the robot, whose mass meets it.

    Returns:
        The impact; None where no mass meets a contact.
    """
    mass = plant.coefficients()[0]
    if contact is None or mass == 0:
        return None
    stiffness, _, exponent, _, inverse = contact.numbers()
    obstacle = 1 / inverse if inverse else float("inf")
    return ElasticImpact(robot_mass=mass, obstacle_mass=obstacle, stiffness=stiffness, exponent=exponent)
