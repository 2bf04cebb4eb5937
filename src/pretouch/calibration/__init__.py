"""Fit a sensor curve to readings at known distances, estimate its uncertainty, and judge the sensor."""

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
