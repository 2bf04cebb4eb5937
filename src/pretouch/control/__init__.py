"""The controller of the letter's Fig. 1 as a sampled law: readings in, a reference for the robot's controller out.

It knows no sensor model and no motion model, and imports nothing but `_core`: what a robot runs is what is here.
"""

from .components import Conditioning, Limits, VirtualAdmittance
from .controller import Controller, Run
from .drag import VirtualDrag
from .laws import CompiledStep, VirtualDamper
from .structures import Observation, Output, Sample, Status

__all__ = [
    "CompiledStep",
    "Conditioning",
    "Controller",
    "Limits",
    "Observation",
    "Output",
    "Run",
    "Sample",
    "Status",
    "VirtualAdmittance",
    "VirtualDamper",
    "VirtualDrag",
]
