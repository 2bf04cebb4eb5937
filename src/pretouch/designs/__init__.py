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
from .front.pareto import pareto
from .front.physical_bound import PhysicalBound, find_physical_bound
from .front.result import FrontPoint, FrontStatus, ParetoFront
from .gain import GainDesign, design_gain
from .impact import ElasticImpact, HertzImpact, ImpactModel, SpringImpact
from .objectives import OBSTACLE_SPEED, Objective, Term, excursion_objective, time_objective
from .options import ParetoOptions, RobustOptions, VerifyOptions
from .quantities import CONSTRAINT_NAMES, QUANTITY_UNITS, ContactQuantity, quantity_of
from .robust.measures import ConditionalValueAtRisk, Expected, Measure, Quantile, WorstCase
from .robust.required import Required
from .robust.result import RobustDesign
from .task import Task
from .verb import design

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
    "ConditionalValueAtRisk",
    "Constraint",
    "ConstraintOutcome",
    "ContactQuantity",
    "DesignStatus",
    "DragDesign",
    "DragEffect",
    "ElasticImpact",
    "Evaluator",
    "Expected",
    "FrontPoint",
    "FrontStatus",
    "GainDesign",
    "HertzImpact",
    "IdealDesign",
    "ImpactModel",
    "Measure",
    "Objective",
    "ParetoFront",
    "ParetoOptions",
    "PhysicalBound",
    "Quantile",
    "Required",
    "RobustDesign",
    "RobustOptions",
    "Sensitivity",
    "SpringImpact",
    "Task",
    "Term",
    "TradeOff",
    "VerifyOptions",
    "WorstCase",
    "design",
    "design_admittance",
    "design_drag",
    "design_gain",
    "excursion_objective",
    "find_physical_bound",
    "pareto",
    "quantity_of",
    "time_objective",
]
