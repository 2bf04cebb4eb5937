"""Random encounters of every kind, from a seed: what agreement tests and benchmarks run over."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pretouch._core.fields import declared
from pretouch.motion import Admittance, Obstacle, Plant, Reference, Scenario
from pretouch.sensors import (
    CustomSensor,
    ExponentialFirstOrder,
    ExponentialSecondOrder,
    InversePower,
    MittagLeffler,
    Recessed,
    SensorModel,
    Table,
)

CURVES: dict[str, SensorModel] = {
    "inverse-power": InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "inverse-square, short range": InversePower(scale=1e-4, distance_offset=0.006, exponent=2.0),
    "exponential-1": ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "exponential-2": ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
    "mittag-leffler": MittagLeffler(scale=1.0, rate=-80.0, order=0.8),
    "table": Table(
        distances=(0.0, 0.005, 0.012, 0.02, 0.03, 0.045, 0.06),
        outputs=(0.46, 0.31, 0.205, 0.13, 0.083, 0.041, 0.022),
    ),
    "recessed": Recessed(sensor=InversePower(scale=1e-4, distance_offset=0.001, exponent=2.2), recess=0.01),
    "custom": CustomSensor(
        log_output_function=lambda d: -40 * d - 3 * np.tanh(d / 0.02),
        log_slope_function=lambda d: -40 - 3 / 0.02 / np.cosh(d / 0.02) ** 2,
        maximum_distance=2.0,
    ),
}

KINDS = ("letter", "over-damped", "under-damped", "near-critical", "free", "accelerated", "tracking", "everything")


@dataclass(frozen=True)
class Encounters:
    """A batch of random encounters and their gains."""

    kind: str
    scenario: Scenario
    gain: np.ndarray


def random_encounters(kind: str, count: int, seed: int, farthest: float = 0.055) -> Encounters:
    """Draw encounters of one kind.

    Args:
        kind: one of KINDS.
        count: how many.
        seed: of the generator.
        farthest: largest initial distance [m].
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    mass = 10 ** rng.uniform(-0.7, 0.7, count)
    omega = 10 ** rng.uniform(0, 1.2, count)
    ratio = {
        "letter": np.ones(count),
        "over-damped": rng.uniform(1.01, 8, count),
        "under-damped": rng.uniform(0.02, 0.95, count),
        "near-critical": 1 + rng.choice([-1, 1], count) * 10 ** rng.uniform(-14, -2, count),
        "free": rng.uniform(0.5, 2, count),
        "accelerated": rng.uniform(0.3, 2, count),
        "tracking": rng.uniform(0.5, 2, count),
        "everything": rng.uniform(0.0, 3, count),
    }[kind]
    distance = rng.uniform(0.01, farthest, count)
    zero = np.zeros(count)
    obstacle = {"velocity": -(10 ** rng.uniform(-1.3, 0, count)), "acceleration": zero}
    plant = {"position": zero, "velocity": zero}
    reference = {"position": zero, "velocity": zero, "acceleration": zero}
    stiffness = mass * omega**2
    if kind == "free":
        stiffness = np.where(rng.random(count) < 0.5, 0.0, 10 ** rng.uniform(-9, -2, count))
    if kind in {"accelerated", "everything"}:
        obstacle["acceleration"] = rng.uniform(-9.81, 3, count)
    if kind == "tracking":
        obstacle["velocity"] = zero
        plant["position"] = -rng.uniform(0.02, 0.15, count)
        reference["position"] = plant["position"] + distance + rng.uniform(-0.02, 0.1, count)
    if kind == "everything":
        obstacle["velocity"] = rng.uniform(-1, 0.2, count)
        plant = {"position": rng.uniform(-0.2, 0.2, count), "velocity": rng.uniform(-0.3, 0.5, count)}
        reference = {
            "position": plant["position"] + rng.uniform(-0.05, 0.05, count),
            "velocity": rng.uniform(-0.2, 0.2, count),
            "acceleration": rng.uniform(-1, 1, count),
        }
    scenario = Scenario(
        admittance=Admittance(mass=mass, damping=2 * ratio * omega * mass, stiffness=stiffness),
        obstacle=Obstacle(position=plant["position"] + distance, **obstacle),
        plant=Plant(**plant),
        reference=Reference(**reference),
    )
    gain = -(10 ** rng.uniform(-2, 0.7, count))
    gain[rng.random(count) < 0.03] = 0.0
    return Encounters(kind=kind, scenario=scenario, gain=gain)


def together(batches: Iterable[Encounters]) -> Encounters:
    """Put batches one behind the other, so that what is paid per call is paid once."""
    parts = list(batches)

    def joined(body: str) -> object:
        bodies = [(getattr(part.scenario, body), len(part.gain)) for part in parts]
        names = [field.name for field in declared(type(bodies[0][0]))]
        columns = {n: [np.broadcast_to(getattr(b, n), count) for b, count in bodies] for n in names}
        return type(bodies[0][0])(**{n: np.concatenate(column) for n, column in columns.items()})

    scenario = Scenario(**{body: joined(body) for body in ("admittance", "obstacle", "plant", "reference")})
    kind = " and ".join(part.kind for part in parts)
    return Encounters(kind=kind, scenario=scenario, gain=np.concatenate([part.gain for part in parts]))
