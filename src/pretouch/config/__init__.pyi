from .reading import ScenarioSource
from .scenario import FASTEST, STEEPEST, load_calibration_plan, load_document, load_scenario

__all__ = [
    "FASTEST",
    "STEEPEST",
    "ScenarioSource",
    "load_calibration_plan",
    "load_document",
    "load_scenario",
]
