"""Define the curves of sensor output versus distance.

Each curve has two functions: the log output ln xi and its slope g.
"""

from .conformance import LawCheck, SensorConformance, check_sensor
from .custom import CustomSensor
from .exponential import ExponentialFirstOrder, ExponentialSecondOrder
from .family import Family
from .inverse_power import InversePower
from .mittag_leffler import MittagLeffler, mittag_leffler
from .model import SensorModel, parameter
from .recessed import Recessed
from .registry import sensor_curves
from .table import PiecewiseCubic, Table

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
    "mittag_leffler",
    "parameter",
    "sensor_curves",
]
