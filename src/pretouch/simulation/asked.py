"""What the runs of a loop are made of, as a value."""

from __future__ import annotations

from dataclasses import dataclass

from pretouch._core.numbers import IntArray
from pretouch._core.values import Value
from pretouch.motion import Scenario
from pretouch.sensors import SensorModel

from .chain import SensorChain
from .contact import ContactModel
from .law import SampledLaw
from .plant import PlantModel

__all__ = ["Loop"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop(Value):
    """All that the runs of a loop are made of, so that any of them can be run again.

    Args:
        scenario: the encounter, or an array of them.
        sensors: the sensor curves.
        sensor_of: which of them each encounter meets, of the shape of the runs.
        laws: the controllers, with one period and one step.
        law_of: which of them runs each encounter, of the shape of the runs.
        noise_of: which run's noise each encounter meets, of the shape of the runs.
        chain: what lies between xi and the law's readings.
        plant: the robot.
        contact: the contact force, where given.
        horizon: how long to wait for contact [s].
        follow: how long to go on after the first contact [s].
        seed: of the noise.
        shape: of the runs.
    """

    scenario: Scenario
    sensors: tuple[SensorModel, ...]
    sensor_of: IntArray
    laws: tuple[SampledLaw, ...]
    law_of: IntArray
    noise_of: IntArray
    chain: SensorChain
    plant: PlantModel
    contact: ContactModel | None
    horizon: float
    follow: float
    seed: int
    shape: tuple[int, ...]
