"""Simulate encounters of robot and object with a sampled control loop."""

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
def simulate_loop(
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
    follow_time: float = FOLLOW,
) -> SimulationResult:
    """Simulate encounters of robot and object with a sampled control loop.

    The controller turns sensor readings into a motion of the robot. Obstacle, plant and reference start as in the
    scenario; its admittance is ignored, because the law has its own. Contact is the first zero of the distance. Within
    a step the distance is a cubic through both ends. A smallest distance that cannot be distinguished from zero (within
    1e-12 of the terms it is computed from) is a contact.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve, which gives xi for each distance.
        law: the controller, used only through the interface `SampledLaw`.
        chain: the sensor chain between xi and the law's readings; by default at the law's rate, without noise and
            delay.
        plant: the robot; by default ideal, so that a run ends at contact.
        contact: the contact force, for a plant with a mass; refused for an ideal plant.
        runs: number of repetitions of every encounter with independent noise, the first axis of the results.
        seed: seed of the noise. The i-th run of a seed draws the same numbers whatever else is changed (common random
            numbers).
        horizon: longest time to wait for contact [s].
        follow_time: time to continue after the first contact [s], with rebounds and further contacts.

    Returns:
        How each run ended, its contacts and its largest values; `trace` returns the time series of one run.

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
        >>> round(simulate_loop(scenario, sensor, law).relative_velocity, 3)  # -0.0815 in continuous time
        -0.082
    """
    chain, plant = chain or SensorChain(rate=1 / law.period), plant or IdealPlant()
    tunable = cast("TunableLaw", law)  # never called with another gain, so any SampledLaw works
    loop = ClosedLoop(
        law=tunable, chain=chain, plant=plant, contact=contact, seed=seed, horizon=horizon, follow_time=follow_time
    )
    return result_of(loop.encounters(scenario, (sensor,), None, runs))
