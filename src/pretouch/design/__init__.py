"""Find the gain that minimizes an objective within constraints.

Each design comes with evidence of its optimality.
"""

from pretouch.motion.evaluator import Evaluator

from .admittance import design_admittance
from .admittance_result import AdmittanceCertificate, AdmittanceDesign, AdmittanceMap, AdmittanceMinimum
from .certificate import Certificate, ConstraintOutcome, DesignStatus, IdealDesign, Sensitivity, TradeOff
from .constraints import Constraint
from .drag import DragDesign, DragEffect, design_drag
from .front.bound_comparison import BoundComparison
from .front.pareto import pareto_front
from .front.physical_bound import PhysicalBound, find_physical_bound
from .front.result import FrontPoint, FrontStatus, ParetoFront
from .gain import GainDesign, design_gain
from .impact import ElasticImpact, HertzImpact, ImpactModel, SpringImpact
from .objectives import OBSTACLE_SPEED, Objective, Term, excursion_objective, time_objective
from .options import ParetoOptions
from .quantities import CONSTRAINT_NAMES, QUANTITY_UNITS, ContactQuantity, quantity_of
from .task import Task

__all__ = [
    "CONSTRAINT_NAMES",
    "OBSTACLE_SPEED",
    "QUANTITY_UNITS",
    "AdmittanceCertificate",
    "AdmittanceDesign",
    "AdmittanceMap",
    "AdmittanceMinimum",
    "BoundComparison",
    "Certificate",
    "Constraint",
    "ConstraintOutcome",
    "ContactQuantity",
    "DesignStatus",
    "DragDesign",
    "DragEffect",
    "ElasticImpact",
    "Evaluator",
    "FrontPoint",
    "FrontStatus",
    "GainDesign",
    "HertzImpact",
    "IdealDesign",
    "ImpactModel",
    "Objective",
    "ParetoFront",
    "ParetoOptions",
    "PhysicalBound",
    "Sensitivity",
    "SpringImpact",
    "Task",
    "Term",
    "TradeOff",
    "design_admittance",
    "design_drag",
    "design_gain",
    "excursion_objective",
    "find_physical_bound",
    "pareto_front",
    "quantity_of",
    "time_objective",
]
