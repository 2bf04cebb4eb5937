"""Design one gain for uncertain inputs, which are given as probability distributions or intervals."""

from pretouch.uncertainty import (
    CorrelatedNormal,
    Distribution,
    Empirical,
    Interval,
    JointDistribution,
    Normal,
    TruncatedNormal,
    Uniform,
    parameter_distribution,
    sample_inputs,
)

from ..options import RobustOptions
from .design import design_robust_gain
from .measures import ConditionalValueAtRisk, Expected, Measure, Quantile, WorstCase
from .required import Required
from .result import RobustDesign

__all__ = [
    "ConditionalValueAtRisk",
    "CorrelatedNormal",
    "Distribution",
    "Empirical",
    "Expected",
    "Interval",
    "JointDistribution",
    "Measure",
    "Normal",
    "Quantile",
    "Required",
    "RobustDesign",
    "RobustOptions",
    "TruncatedNormal",
    "Uniform",
    "WorstCase",
    "design_robust_gain",
    "parameter_distribution",
    "sample_inputs",
]
