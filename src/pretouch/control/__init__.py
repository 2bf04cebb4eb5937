"""The controller of the letter's Fig. 1 as a sampled law: readings in, a reference for the robot's controller out.

It knows no sensor model and no motion model, and imports nothing but `_core`: what a robot runs is what is here. `Law`
is what stands in a controller, and `observe`, `push_by_drag` and `drive` are what one of a user's own is made of.
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
from .structures import Observation, Output, Push, Sample, Status

__all__ = [
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
