"""Calls of every verb, and the bits of what they return: `python repeated_calls.py ORDER CORES`, a process of its own.

ORDER is "early" or "late": as a fresh process, or after much else, backwards, has been asked for. A line per call.
"""

from __future__ import annotations

import hashlib
import json
import struct
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
from pretouch.motion import parallel
from verification_samples import short_rest

LINE = pt.ExponentialFirstOrder(scale=0.458, rate=-61.0)
POWER = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
MITTAG_LEFFLER = pt.MittagLeffler(scale=1.0, rate=-80.0, order=0.8)
TABLE = pt.Table(distances=(0.0, 0.01, 0.025, 0.05), outputs=(0.46, 0.25, 0.1, 0.02))
F_1 = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
F_2 = pt.time_objective(time_scale=1.0, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)
DRAWN = {
    "obstacle.velocity": pt.uncertainty.Uniform(low=-0.5, high=-0.1),
    "obstacle.position": pt.uncertainty.Uniform(low=0.03, high=0.045),
}
EXAMPLES = Path(__file__).parents[1] / "examples"


def scene(velocity: Any = -0.3, damping: Any = 10.0, own_speed: float = 0.0) -> pt.Scenario:
    return pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=damping, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.0422, velocity=velocity),
        plant=pt.Plant(velocity=own_speed),
    )


def loop() -> pt.ClosedLoop:
    law = Controller(
        period=1e-3,
        conditioning=Conditioning(floor=1e-3, sensor_period=4e-3),
        law=VirtualDamper(gain=0.0),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    chain = pt.SensorChain(rate=250.0, exposure=170e-6, delay=120e-6, noise=1e-3, random_phase=True)
    return pt.ClosedLoop(law=law, chain=chain)


def contact(sensor: pt.sensors.SensorModel, gain: Any, scenario: pt.Scenario | None = None) -> dict[str, Any]:
    found = pt.find_contact(scenario or scene(), sensor, gain)
    names = [name for name in pt.motion.ContactState.names() if name != "distance"]
    own = {name: getattr(found.end, name) for name in names}
    slopes = {by: found.gradients.of("relative_velocity", by) for by in found.gradients.inputs}
    return {"status": found.status, "residual": found.impulse_residual, **own, **slopes}


def design(sensor: pt.sensors.SensorModel, **options: Any) -> dict[str, Any]:
    found = pt.design(pt.Task(scene(), sensor, F_1, bounds=BOUNDS, **options))
    curve = found.trade_off
    return {**found.to_dict(), "curve": [curve.gain, curve.objective], "sensitivities": str(found.sensitivities)}


def designs(scenario: pt.Scenario, sensor: pt.sensors.SensorModel) -> dict[str, Any]:
    found = pt.design(pt.Task(scenario, sensor, F_1, bounds=BOUNDS))
    return {"gain": found.gain, "objective": found.objective, "slope": found.gradient("obstacle.velocity")}


def robust(sensor: pt.sensors.SensorModel, **own: Any) -> dict[str, Any]:
    limit = pt.designs.Required(constraint=pt.Constraint(name="relative_velocity", limit=0.15), probability=0.9)
    found = pt.robust(
        pt.Task(
            scene(),
            sensor,
            F_1,
            bounds=BOUNDS,
            uncertainty=DRAWN | own,
            constraints=[limit],
            robust=pt.designs.RobustOptions(samples=64, validation=64),
        )
    )
    return {**found.to_dict(), "outcomes": found.outcomes(found.gain).objective}


def fitted() -> dict[str, Any]:
    data = pt.read_calibration(EXAMPLES / "sensor.csv")
    return {"fit": str(pt.calibration.fit_sensor(data, "inverse-power")), "ranking": pt.fit(data).to_dict()}


def motion(sensor: pt.sensors.SensorModel) -> list[Any]:
    found = pt.solve_motion(scene(), sensor, -0.7)
    return [found.time, found.position, found.virtual_force]


def run() -> dict[str, Any]:
    found = loop().run(scene(np.linspace(-0.5, -0.1, 40)), POWER, -0.7)
    return {"time": found.time, "speed": found.relative_velocity, "trace": found.trace(3).reading}


def verified(**own: Any) -> dict[str, Any]:
    task = pt.Task(
        scene(),
        POWER,
        F_1,
        loop=loop(),
        bounds=BOUNDS,
        verify=pt.designs.VerifyOptions(runs=20),
        uncertainty=DRAWN | own,
    )
    with short_rest():
        return pt.verify(task, changes=False).to_dict()


def swept() -> Any:
    axes = {"obstacle.velocity": MANY[:500], "gain": np.array([-0.7, -0.2])}
    return pt.sweep(pt.Task(scene(), LINE), axes, results=["time", "largest_speed"])["time"].to_numpy()


MANY = np.linspace(-1.0, -0.05, 3000)
CALLS: dict[str, Callable[[], Any]] = {
    "contact, closed form": lambda: contact(LINE, -0.7),
    "contacts, closed form, a few": lambda: contact(LINE, [-0.7, -0.5, 0.1]),
    "design, closed form": lambda: design(LINE),
    "design, closed form, limited": lambda: design(LINE, constraints=[pt.Constraint(name="excursion", limit=0.1)]),
    "designs, a few": lambda: designs(scene(np.array([-0.3, -0.2])), LINE),
    "contacts, closed form, many": lambda: contact(LINE, -0.7, scene(MANY)),
    "contacts, closed form, swinging": lambda: contact(LINE, 0.1, scene(MANY, 2.0, 0.01)),
    "contact, any curve": lambda: contact(POWER, -0.7),
    "contacts, any curve, many": lambda: contact(MITTAG_LEFFLER, np.tile([-0.7, -0.4, -0.1], 1000), scene(MANY)),
    "contacts, a table": lambda: contact(TABLE, -0.7, scene(MANY[::10])),
    "motion, closed form": lambda: motion(LINE),
    "motion, any curve": lambda: motion(MITTAG_LEFFLER),
    "design, any curve": lambda: design(POWER),
    "designs, many": lambda: designs(scene(MANY[:300], np.linspace(10.0, 12.0, 300)), POWER),
    "designs, a family": lambda: designs(scene(MANY), LINE),
    "admittance": lambda: pt.design(
        pt.Task(scene(), LINE, F_2, bounds=BOUNDS, natural_frequency=(2.0, 10.0), damping_ratio=(1.0, 2.0))
    ).to_dict(),
    "front": lambda: pt.pareto(pt.Task(scene(), POWER, bounds=BOUNDS)).to_dict(),
    "robust": lambda: robust(POWER, **{"sensor.exponent": pt.uncertainty.Normal(mean=3.32, deviation=0.1)}),
    "robust, many curves": lambda: robust(
        MITTAG_LEFFLER, **{"sensor.order": pt.uncertainty.Uniform(low=0.75, high=0.85)}
    ),
    "robust, closed form": lambda: robust(LINE),
    "sweep": swept,
    "fit and ranking": fitted,
    "loop": run,
    "design on the loop": lambda: pt.design(pt.Task(scene(), POWER, F_1, bounds=BOUNDS, evaluate=loop())).to_dict(),
    "verdict": verified,
    "verdict, many curves": lambda: verified(**{"sensor.exponent": pt.uncertainty.Normal(mean=3.32, deviation=0.1)}),
    "a file": lambda: pt.design(pt.load_scenario(EXAMPLES / "tradeoff.toml")).to_dict(),
}


def feed(digest: Any, value: Any) -> None:
    """Add the bits of every number of a value, and its texts."""
    if isinstance(value, Mapping):
        for key in value:
            feed(digest, str(key))
            feed(digest, value[key])
    elif isinstance(value, np.ndarray):
        digest.update(repr((value.shape, value.dtype.str)).encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, (list, tuple)):
        for one in value:
            feed(digest, one)
    elif isinstance(value, float):
        digest.update(struct.pack("<d", value))
    elif value is None or isinstance(value, (str, int, np.generic)):
        digest.update(repr(value).encode())
    else:
        raise TypeError(f"no bits of {type(value)}")


def bits(call: Callable[[], Any]) -> str:
    digest = hashlib.sha256()
    feed(digest, call())
    return digest.hexdigest()


def main(order: str, cores: int) -> None:
    parallel._cores = lambda: cores  # type: ignore[assignment]
    if order == "late":
        for name in reversed(CALLS):
            CALLS[name]()
        for velocity in (-0.2, -0.4):
            contact(LINE, MANY, scene(velocity))
            contact(POWER, MANY, scene(velocity))
    sys.stdout.write(json.dumps({name: bits(call) for name, call in CALLS.items()}))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
