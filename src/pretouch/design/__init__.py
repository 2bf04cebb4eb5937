"""Gain design: what is minimized, what must hold, the gain that is optimal, and the evidence."""

from .constraints import CONSTRAINT_NAMES, Constraint
from .gain import Evaluator, design_gain
from .impact import HertzImpact, ImpactModel, SpringImpact
from .objectives import OBSTACLE_SPEED, Objective, Term, excursion_objective, time_objective
from .quantities import QUANTITY_UNITS, quantity_of
from .result import Certificate, ConstraintOutcome, DesignStatus, GainDesign, Sensitivity, TradeOff

__all__ = [
    "CONSTRAINT_NAMES",
    "OBSTACLE_SPEED",
    "QUANTITY_UNITS",
    "Certificate",
    "Constraint",
    "ConstraintOutcome",
    "DesignStatus",
    "Evaluator",
    "GainDesign",
    "HertzImpact",
    "ImpactModel",
    "Objective",
    "Sensitivity",
    "SpringImpact",
    "Term",
    "TradeOff",
    "design_gain",
    "excursion_objective",
    "quantity_of",
    "time_objective",
]
