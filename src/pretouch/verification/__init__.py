"""Verify a controller gain by simulating the sampled control loop.

The verification also suggests improvements of the loop.
"""

from pretouch.designs.options import VerifyOptions

from .calibration_check import CalibrationCheck
from .candidates import Candidate, CandidateComparison, compare
from .effect import Effect, SensorSpeed, VerdictStatus
from .encounter import SimulatedEncounter
from .gain_search import LoopCurve
from .improvement import LoopChange, Loss
from .result import Comparison, LimitCheck, Reached, RunSpread, Verdict
from .stability import StabilityCheck
from .verdict import simulate, verify

__all__ = [
    "CalibrationCheck",
    "Candidate",
    "CandidateComparison",
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
    "VerifyOptions",
    "compare",
    "simulate",
    "verify",
]
