"""Pre-contact motion: the encounter, its solution for any sensor curve, and the contact that it ends in."""

from .admittance import Admittance
from .contact import ContactResult, ContactState, ContactStatus
from .gradients import ContactGradients
from .request import METHODS
from .scenario import Obstacle, Plant, Reference, Scenario
from .solve import Motion, find_contact, solve_motion

__all__ = [
    "METHODS",
    "Admittance",
    "ContactGradients",
    "ContactResult",
    "ContactState",
    "ContactStatus",
    "Motion",
    "Obstacle",
    "Plant",
    "Reference",
    "Scenario",
    "find_contact",
    "solve_motion",
]
