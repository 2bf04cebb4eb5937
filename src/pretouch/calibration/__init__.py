"""Fit sensor curves to readings at known distances.

A calibration also decides whether the sensor is usable.
"""

from .data import Calibration, Provenance
from .file_reading import read_calibration, read_calibrations
from .fit import fit_sensor
from .ranking import rank_models
from .result import CalibrationReport, Estimate, NoiseEstimate, OffsetEstimate, SensorFit, UsableWindow
from .window import find_window

__all__ = [
    "Calibration",
    "CalibrationReport",
    "Estimate",
    "NoiseEstimate",
    "OffsetEstimate",
    "Provenance",
    "SensorFit",
    "UsableWindow",
    "find_window",
    "fit_sensor",
    "rank_models",
    "read_calibration",
    "read_calibrations",
]
