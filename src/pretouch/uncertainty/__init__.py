"""Inputs that are not known exactly: distributions as values, seeded samples of them, and the encounters they make."""

from .correlated import CorrelatedNormal, parameter_distribution
from .distributions import Distribution, Empirical, Interval, JointDistribution, Normal, TruncatedNormal, Uniform
from .ensemble import Ensemble, make_ensemble
from .reservations import Reservations, reservations_of
from .sampling import Uncertainty, sample_inputs

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
    "reservations_of",
    "sample_inputs",
]
