"""Compute the motion of robot and obstacle until contact."""

from .bodies import Obstacle, Plant, Reference, Stretch
from .contact import ContactResult, ContactState, Motion
from .custom_law import CustomLaw
from .evaluator import find_contact, solve_motion
from .gradients import ContactGradients
from .laws import DAMPER, DRAG, ContinuousLaw, LawNumber
from .layout import ContactStatus
from .request import METHODS
from .scenario import Admittance, Scenario

__all__ = [
    "DAMPER",
    "DRAG",
    "METHODS",
    "Admittance",
    "ContactGradients",
    "ContactResult",
    "ContactState",
    "ContactStatus",
    "ContinuousLaw",
    "CustomLaw",
    "LawNumber",
    "Motion",
    "Obstacle",
    "Plant",
    "Reference",
    "Scenario",
    "Stretch",
    "find_contact",
    "solve_motion",
]
