"""Whether a designed gain holds on the loop as it will really run: predicted beside simulated, and what to change."""

from .appraisal import Effect
from .best_gain import LoopCurve
from .calibration_check import CalibrationCheck
from .checks import Comparison, LimitCheck, Reached, RunSpread, VerdictStatus
from .encounter import SimulatedEncounter
from .improvement import LoopChange, Loss
from .result import Verdict
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
    "SimulatedEncounter",
    "StabilityCheck",
    "Verdict",
    "VerdictStatus",
    "simulate_encounter",
    "verify_gain",
]
