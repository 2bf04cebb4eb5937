"""Describe uncertain inputs by probability distributions, and sample random encounters from them."""

from .correlated import CorrelatedNormal, Empirical, parameter_distribution
from .distributions import Distribution, Interval, JointDistribution, Normal, TruncatedNormal, Uniform
from .ensemble import Ensemble, Uncertainty, make_ensemble, sample_inputs
from .reservations import Reservations, reservations_apply, reservations_of

__all__ = [
    "CorrelatedNormal",
    "Distribution",
    "Empirical",
    "Ensemble",
    "Interval",
    "JointDistribution",
    "Normal",
    "Reservations",
    "TruncatedNormal",
    "Uncertainty",
    "Uniform",
    "make_ensemble",
    "parameter_distribution",
    "reservations_apply",
    "reservations_of",
    "sample_inputs",
]
