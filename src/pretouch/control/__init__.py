"""Implement the sampled controller of the robot.

The controller turns sensor readings into a reference motion. This package contains everything that the robot runs. It
uses no sensor model and no motion model, and imports only `_core`. A `Law` turns changes of the reading into a force. A
custom law is built from `observe`, `push_by_drag` and `drive`.
"""

from .components import Conditioning, Limits, VirtualAdmittance
from .controller import Controller, Run
from .drag import VirtualDrag
from .laws import (
    CompiledStep,
    Law,
    Parts,
    Setting,
    VirtualDamper,
    drive,
    observe,
    push_by_drag,
    start_drive,
    start_sensing,
)
from .structures import Arrival, Observation, Output, Push, Sample, Status

__all__ = [
    "Arrival",
    "CompiledStep",
    "Conditioning",
    "Controller",
    "Law",
    "Limits",
    "Observation",
    "Output",
    "Parts",
    "Push",
    "Run",
    "Sample",
    "Setting",
    "Status",
    "VirtualAdmittance",
    "VirtualDamper",
    "VirtualDrag",
    "drive",
    "observe",
    "push_by_drag",
    "start_drive",
    "start_sensing",
]
