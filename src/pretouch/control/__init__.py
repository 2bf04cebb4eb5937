"""The controller of the letter's Fig. 1 as a sampled law: readings in, a reference for the robot's controller out.

It knows no sensor model and no motion model, and imports nothing but `_core`: what a robot runs is what is here.
"""

from .admittance import VirtualAdmittance
from .conditioning import Conditioning
from .controller import Controller
from .damper import VirtualDamper
from .limits import Limits
from .signals import Output, Sample, Status
from .steps import CompiledStep, Run
from .structures import Observation

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
]
