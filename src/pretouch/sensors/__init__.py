"""Sensor curves: ln xi(l) and its slope g(l), the only two things that the rest of pretouch asks of a sensor."""

from .conformance import LawCheck, SensorConformance, check_sensor
from .exponential import ExponentialFirstOrder, ExponentialSecondOrder
from .family import Family
from .inverse_power import InversePower
from .known import known_curves
from .made import CustomSensor, PiecewiseCubic, Recessed, Table
from .mittag_leffler import MittagLeffler, mittag_leffler
from .model import SensorModel, parameter

__all__ = [
    "CustomSensor",
    "ExponentialFirstOrder",
    "ExponentialSecondOrder",
    "Family",
    "InversePower",
    "LawCheck",
    "MittagLeffler",
    "PiecewiseCubic",
    "Recessed",
    "SensorConformance",
    "SensorModel",
    "Table",
    "check_sensor",
    "known_curves",
    "mittag_leffler",
    "parameter",
]
