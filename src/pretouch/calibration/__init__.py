"""Fit sensor curves to readings at known distances.

A calibration also decides whether the sensor is usable.
"""

from .data import Calibration, Provenance
from .file_reading import read_calibration, read_calibrations
from .model_fit import fit_sensor
from .ranking import fit
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
    "fit",
    "fit_sensor",
    "read_calibration",
    "read_calibrations",
]
