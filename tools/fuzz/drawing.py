"""Random curves of every family and encounters of every regime, from a generator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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

FAMILIES = ("inverse-power", "exponential-1", "exponential-2", "mittag-leffler", "table", "custom", "recessed")
REGIMES = (
    *("over-damped", "under-damped", "near-critical", "critical", "no damping", "no stiffness", "neither"),
    *("accelerated", "receding", "touching", "turning", "tracking", "moving reference", "already near"),
    *("at the obstacle", "thrown", "no gain", "tiny gain", "strong gain", "positive gain", "everything"),
)


@dataclass(frozen=True)
class Custom:
    """ln xi = -a l - b tanh(l / c), so that a find can be printed."""

    slope: float
    depth: float
    width: float

    def output(self, distance: np.ndarray) -> np.ndarray:
        return -self.slope * distance - self.depth * np.tanh(distance / self.width)

    def log_slope(self, distance: np.ndarray) -> np.ndarray:
        return -self.slope - self.depth / self.width / np.cosh(np.minimum(distance / self.width, 300.0)) ** 2


def draw_sensor(rng: np.random.Generator, family: str) -> SensorModel:
    """Draw a curve of a family."""
    if family == "recessed":
        bare = draw_sensor(rng, rng.choice(FAMILIES[:-1]))
        low, high = bare.valid_range
        share = rng.choice([0.0, 1e-17, 1e-9, rng.uniform(0, 0.9)], p=[0.1, 0.1, 0.1, 0.7])
        return Recessed(sensor=bare, recess=low + share * min(high - low, 0.02))
    rate = -(10 ** rng.uniform(0.7, 2.5))
    if family == "inverse-power":
        return InversePower(
            scale=10 ** rng.uniform(-6, 2), distance_offset=10 ** rng.uniform(-3.3, -0.7), exponent=rng.uniform(0.3, 8)
        )
    if family == "exponential-1":
        return ExponentialFirstOrder(scale=1.0, rate=rate)
    if family == "exponential-2":
        return ExponentialSecondOrder(scale=1.0, rate=rate, curvature=rng.choice([-1, 1]) * 10 ** rng.uniform(-3, 3.3))
    if family == "mittag-leffler":
        order = rng.choice([1.0, 1 - 10 ** rng.uniform(-12, -2), rng.uniform(0.1, 1)], p=[0.1, 0.1, 0.8])
        return MittagLeffler(scale=1.0, rate=rate, order=order)
    if family == "table":
        count = rng.integers(1, 7)
        width, fall = rng.uniform(1e-3, 0.03, count), 10 ** rng.uniform(-3, 0.5, count)
        start = rng.choice([0.0, rng.uniform(0, 0.01)])
        return Table(
            distances=tuple(start + np.concatenate([[0.0], np.cumsum(width)])),
            outputs=tuple(np.exp(-np.concatenate([[0.0], np.cumsum(fall)]))),
        )
    curve = Custom(rng.uniform(1, 100), rng.uniform(0, 4), rng.uniform(0.005, 0.1))
    return CustomSensor(
        log_output_function=curve.output,
        log_slope_function=curve.log_slope,
        maximum_distance=rng.choice([np.inf, rng.uniform(0.1, 1.0)]),
    )


def draw_encounters(
    rng: np.random.Generator, sensor: SensorModel, count: int
) -> tuple[Scenario, np.ndarray, np.ndarray]:
    """Draw encounters of a curve; return them, their gains and the names of their regimes."""
    regime = rng.choice(REGIMES, count)

    def among(*names: str) -> np.ndarray:
        return np.isin(regime, names)

    def some(where: np.ndarray, values: np.ndarray, others: np.ndarray | float) -> np.ndarray:
        return np.where(where, values, others)

    low, high = sensor.valid_range
    farthest = min(low + (high - low) * (1 - 1e-9), low + 10 ** rng.uniform(-2, 0), 1.0)
    nearest = max(low, 0.0)
    share = some(among("already near"), 10 ** rng.uniform(-9, -2, count), rng.uniform(0.02, 1, count))
    distance = nearest + share * (farthest - nearest)
    whole = among("everything")
    mass, omega = 10 ** rng.uniform(-0.8, 1, count), 10 ** rng.uniform(-0.3, 1.5, count)
    ratio = some(among("over-damped"), 10 ** rng.uniform(0, 1.5, count), 10 ** rng.uniform(-0.5, 0.6, count))
    ratio = some(among("under-damped"), 10 ** rng.uniform(-3, 0, count), ratio)
    near = 1 + rng.choice([-1, 1], count) * 10 ** rng.uniform(-15, -2, count)
    ratio = some(among("near-critical"), near, ratio)
    ratio = some(among("critical"), 1.0, ratio)
    ratio = some(among("at the obstacle") & (rng.random(count) < 0.5), rng.choice([1.0, 2.0, 0.3, 0.99], count), ratio)
    ratio = some(among("no damping", "neither"), 0.0, ratio)
    stiffness = mass * omega**2
    damping = 2 * ratio * omega * mass
    stiffness = some(among("no stiffness", "neither"), 0.0, stiffness)
    scale = distance * 10 ** rng.uniform(-0.5, 1.5, count)  # of speeds: contact within a second or so
    v = -scale
    a = some(among("accelerated") | whole, rng.normal(0, 1, count) * 3 * scale, 0.0)
    v = some(among("receding"), scale * 10 ** rng.uniform(-3, 0, count), v)
    v = some(whole, v * rng.normal(0.5, 1, count), v)
    still = among("tracking", "at the obstacle", "thrown")
    v = some(still, 0.0, v)
    # l = l_0 + v t + a t^2 / 2 comes to a margin, or to it exactly; with a gain or a moving plant it does about that
    turns = among("touching", "turning")
    margin = rng.choice([0.0, 1.0, -1.0], count) * 10 ** rng.uniform(-13, -1, count)
    a = some(turns, v**2 / (2 * distance) * (1 - some(among("turning"), margin, 0.0)), a)
    simple = among("touching") & (rng.random(count) < 0.5)  # numbers without rounding
    quarter = 2.0 ** np.floor(np.log2(distance))
    simple &= quarter > nearest
    distance = some(simple, quarter, distance)
    v, a = some(simple, -2 * distance, v), some(simple, 2 * distance, a)
    plant_velocity = some(whole, rng.normal(0, 1, count) * scale, 0.0)
    plant_velocity = some(among("thrown"), scale * 10 ** rng.uniform(-1, 1, count), plant_velocity)
    plant_position = some(whole | among("moving reference"), rng.normal(0, 0.1, count), 0.0)
    offset = some(among("tracking"), distance * rng.uniform(0.5, 2.5, count), 0.0)
    offset = some(whole, rng.normal(0, 0.1, count), offset)
    drift = some(whole | among("moving reference"), rng.normal(0, 1, count) * scale, 0.0)
    pull = some(whole, rng.normal(0, 1, count) * scale, 0.0)
    reference = plant_position + offset
    obstacle = plant_position + distance
    there = among("at the obstacle", "thrown")
    tiny = rng.choice([0.0, 1e-17, -1e-17, 1e-9, -1e-9, 1e-3, -1e-3], count, p=[0.6, 0.1, 0.1, 0.05, 0.05, 0.05, 0.05])
    reference = some(there, obstacle * (1 + tiny), reference)
    strength = 10 ** rng.uniform(-2.5, 0.5, count)
    strength = some(among("tiny gain"), 10 ** rng.uniform(-15, -4, count), strength)
    strength = some(among("strong gain"), 10 ** rng.uniform(0.5, 2, count), strength)
    strength = some(among("positive gain"), -(10 ** rng.uniform(-4, -1, count)), strength)
    strength = some(among("no gain", "touching") | (rng.random(count) < 0.03), 0.0, strength)
    strength = some(
        among("touching", "turning") & (rng.random(count) < 0.3), 10 ** rng.uniform(-4, -1, count), strength
    )
    gain = -strength / np.maximum(np.abs(np.asarray(sensor.log_slope(np.full(count, nearest)))), 1.0) * 60
    scenario = Scenario(
        admittance=Admittance(mass=mass, damping=damping, stiffness=stiffness),
        obstacle=Obstacle(position=obstacle, velocity=v + plant_velocity * whole, acceleration=a),
        plant=Plant(position=plant_position, velocity=plant_velocity),
        reference=Reference(position=reference, velocity=drift, acceleration=pull),
    )
    return scenario, gain, regime
