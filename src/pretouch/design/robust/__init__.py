"""Gains that hold when inputs are not known exactly."""

from .design import design_robust_gain
from .measures import ConditionalValueAtRisk, Expected, Measure, Quantile, Required, WorstCase
from .result import RobustDesign

__all__ = [
    "ConditionalValueAtRisk",
    "Expected",
    "Measure",
    "Quantile",
    "Required",
    "RobustDesign",
    "WorstCase",
    "design_robust_gain",
]
