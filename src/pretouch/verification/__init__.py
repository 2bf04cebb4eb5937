"""Whether a designed gain holds on the loop as it will really run: predicted beside simulated, and what to change."""

from .calibration_check import CalibrationCheck
from .encounter import SimulatedEncounter, simulate_encounter
from .parts import Comparison, Effect, LimitCheck, Reached, Spread, StabilityCheck, VerdictStatus
from .proposals import Change, LoopCurve, Loss
from .result import Verdict
from .verify import verify_gain

__all__ = [
    "CalibrationCheck",
    "Change",
    "Comparison",
    "Effect",
    "LimitCheck",
    "LoopCurve",
    "Loss",
    "Reached",
    "SimulatedEncounter",
    "Spread",
    "StabilityCheck",
    "Verdict",
    "VerdictStatus",
    "simulate_encounter",
    "verify_gain",
]
