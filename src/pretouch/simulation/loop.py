"""Simulate encounters in the sampled loop: sensor chain, law at its own rate, plant and contact."""

from __future__ import annotations

from typing import cast

from pretouch._core.arguments import check_arguments
from pretouch.motion import Scenario
from pretouch.sensors import SensorModel

from .chain import SensorChain
from .closed_loop import ClosedLoop
from .law import SampledLaw, TunableLaw
from .result import FOLLOW, HORIZON, SimulationResult, result_of
from .robot import ContactModel, IdealPlant, PlantModel


@check_arguments
def simulate(
    scenario: Scenario,
    sensor: SensorModel,
    law: SampledLaw,
    *,
    chain: SensorChain | None = None,
    plant: PlantModel | None = None,
    contact: ContactModel | None = None,
    runs: int | None = None,
    seed: int = 0,
    horizon: float = HORIZON,
    follow: float = FOLLOW,
) -> SimulationResult:
    """Run encounters of the sampled loop: L(1) with L(2) as a controller computes them from readings.

    Obstacle, plant and reference start as the scenario says; its admittance is not read, for the law has its own.
    Contact is the first zero of the distance, within a step, too, where it is a cubic through both ends; a smallest
    distance that is not told from zero, within 1e-12 of the terms it is the difference of, is a touch.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve, by which xi follows from the distance.
        law: the controller; the loop does not know which one it is.
        chain: what lies between xi and the law's readings; without noise and delay, at the law's rate, by default.
        plant: the robot; ideal by default, which ends a run at contact.
        contact: the contact force, for a plant with a mass: beside an ideal plant it is refused.
        runs: repeat every encounter so often, each with noise of its own: a first axis of the results.
        seed: of the noise. The i-th run of a seed draws the same numbers whatever else is changed: common random
            numbers.
        horizon: how long to wait for contact [s].
        follow: how long to go on after the first contact [s], over rebounds and further contacts.

    Returns:
        How each run ended, its contacts and its largest values; `trace` has the whole course of one of them.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> law = Controller(
        ...     period=1e-3,
        ...     conditioning=Conditioning(floor=1e-3),
        ...     law=VirtualDamper(gain=-0.7),
        ...     admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ... )
        >>> round(simulate(scenario, sensor, law).relative_velocity, 3)  # -0.0815 in continuous time
        -0.082
    """
    chain, plant = chain or SensorChain(rate=1 / law.period), plant or IdealPlant()
    own = cast("TunableLaw", law)  # its gain is what it has
    loop = ClosedLoop(law=own, chain=chain, plant=plant, contact=contact, seed=seed, horizon=horizon, follow=follow)
    return result_of(loop.encounters(scenario, (sensor,), None, runs))
