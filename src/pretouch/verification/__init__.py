"""Whether a designed gain holds on the loop as it will really run: predicted beside simulated, and what to change."""

from .calibration_check import CalibrationCheck
from .effect import Effect, SensorSpeed, VerdictStatus
from .encounter import SimulatedEncounter
from .improvement import LoopChange, LoopCurve, Loss
from .result import Comparison, LimitCheck, Reached, RunSpread, Verdict
from .stability import StabilityCheck
from .verify import simulate_encounter, verify_gain

__all__ = [
    "CalibrationCheck",
    "Comparison",
    "Effect",
    "LimitCheck",
    "LoopChange",
    "LoopCurve",
    "Loss",
    "Reached",
    "RunSpread",
    "SensorSpeed",
    "SimulatedEncounter",
    "StabilityCheck",
    "Verdict",
    "VerdictStatus",
    "simulate_encounter",
    "verify_gain",
]
