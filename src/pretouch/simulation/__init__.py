"""Simulate the sampled control loop, and compute its stability limits."""

from .chain import LoopTiming, SensorChain, chain_of_fit, timing_of
from .closed_loop import ClosedLoop
from .disturbance import Disturbance
from .loop import simulate_loop
from .parts import PARTS, SensorPart, sensor_part
from .result import LoopTrace, SimulationResult
from .robot import ContactModel, HuntCrossley, IdealPlant, ImpedancePlant, PlantModel, PositionPlant, SpringDamper
from .speed import SpeedLimit, speed_limit
from .stability import DampingLimit, GainLimit, gain_limit, largest_damping, lowest_rate
from .state_space import LinearPlant, StateSpace, StateSpacePlant

__all__ = [
    "PARTS",
    "ClosedLoop",
    "ContactModel",
    "DampingLimit",
    "Disturbance",
    "GainLimit",
    "HuntCrossley",
    "IdealPlant",
    "ImpedancePlant",
    "LinearPlant",
    "LoopTiming",
    "LoopTrace",
    "PlantModel",
    "PositionPlant",
    "SensorChain",
    "SensorPart",
    "SimulationResult",
    "SpeedLimit",
    "SpringDamper",
    "StateSpace",
    "StateSpacePlant",
    "chain_of_fit",
    "gain_limit",
    "largest_damping",
    "lowest_rate",
    "sensor_part",
    "simulate_loop",
    "speed_limit",
    "timing_of",
]
