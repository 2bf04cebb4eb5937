"""The force of an elastic contact in closed form: what a prediction can say of a contact that the loop simulates."""

from __future__ import annotations

from pretouch.design import ElasticImpact
from pretouch.simulation import ContactModel, PlantModel

__all__ = ["elastic_impact"]


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
