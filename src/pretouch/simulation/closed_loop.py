"""A loop without its encounter and its gain: what is chosen once for a robot, and every encounter is run on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Protocol, runtime_checkable

from pretouch.motion import Scenario
from pretouch.sensors import SensorModel

from .chain import SensorChain
from .contact import ContactModel
from .loop import SampledLaw, simulate
from .plant import IdealPlant, PlantModel
from .result import SimulationResult

__all__ = ["ClosedLoop", "TunableLaw"]

_HORIZON: Final = 10.0
_FOLLOW: Final = 0.2


@runtime_checkable
class TunableLaw(SampledLaw, Protocol):
    """A law with one gain to be chosen: `pretouch.control.Controller` is one."""

    def with_gain(self, gain: float) -> SampledLaw:
        """Return the same law with another gain [N s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedLoop:
    """A sampled loop, all but the encounter and the gain: sensor chain, law, robot and contact.

    Args:
        law: the controller; its gain is replaced by whichever is tried.
        chain: what lies between xi and the law's readings.
        plant: the robot; ideal by default.
        contact: the contact force, for a plant with a mass.
        seed: of the noise; every gain is tried with the same random numbers.
        horizon: how long to wait for contact [s].
        follow: how long to go on after the first contact [s].

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> loop = ClosedLoop(
        ...     law=Controller(
        ...         period=1e-3,
        ...         conditioning=Conditioning(floor=1e-3, sensor_period=4e-3),
        ...         law=VirtualDamper(gain=0.0),
        ...         admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     ),
        ...     chain=SensorChain(rate=250.0, exposure=170e-6, delay=120e-6),
        ... )
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> round(loop.run(scenario, sensor, -0.7).relative_velocity, 3)  # -0.0815 in continuous time
        -0.082
    """

    law: TunableLaw
    chain: SensorChain
    plant: PlantModel = field(default_factory=IdealPlant)
    contact: ContactModel | None = None
    seed: int = 0
    horizon: float = _HORIZON
    follow: float = _FOLLOW

    def run(self, scenario: Scenario, sensor: SensorModel, gain: float, *, runs: int | None = None) -> SimulationResult:
        """Run encounters with one gain.

        Args:
            scenario: the encounter, or an array of them.
            sensor: the sensor curve.
            gain: D_p [N s].
            runs: repeat every encounter so often, each with noise of its own.

        Returns:
            What `simulate` returns.
        """
        return simulate(
            scenario,
            sensor,
            self.law.with_gain(gain),
            chain=self.chain,
            plant=self.plant,
            contact=self.contact,
            runs=runs,
            seed=self.seed,
            horizon=self.horizon,
            follow=self.follow,
        )
