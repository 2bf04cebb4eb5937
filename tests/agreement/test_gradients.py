"""Gradients of contacts compared with differences of the guaranteed path and with high-precision arithmetic.

A central difference of order 8 with a step h relative to the scale of an input has a truncation error of about
(h / R)^8, with R of order 1, and a rounding error of 1e-13 / 2e-3 from the guaranteed path. It is used if two steps
agree within a quarter of the tolerance. Otherwise (near the end of the sensor's range or near a touch) nothing is
compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf

from encounters import CURVES, KINDS, Encounters, random_encounters
from gradient_scales import scales_of, sizes_of
from pretouch._core.fields import declared
from pretouch.motion import Admittance, ContactStatus, Obstacle, Plant, Reference, Scenario, find_contact
from pretouch.motion.gradient_rows import GradientRows
from pretouch.motion.layout import RELATIVE_INPUTS
from pretouch.motion.request import make_request
from pretouch.motion.solution import Solution
from pretouch.sensors import ExponentialFirstOrder, Recessed, SensorModel

CENTRAL = (np.array([1, -1, 2, -2, 3, -3, 4, -4]), np.array([224, -224, -56, 56, 32 / 3, -32 / 3, -1, 1]) / 280)
FORWARD = (np.arange(9), np.array([-761 / 280, 8, -14, 56 / 3, -35 / 2, 56 / 5, -14 / 3, 8 / 7, -1 / 8]))
WANTED = 1e-8
COUNT = 5


def changed_scenario(scenario: Scenario, name: str, change: Any) -> Scenario:
    part, field = name.split(".")
    body = getattr(scenario, part)
    columns = {f.name: np.broadcast_to(getattr(body, f.name), scenario.shape)[..., None] for f in declared(type(body))}
    columns[field] = columns[field] + change
    parts = {}
    for other in ("admittance", "obstacle", "plant", "reference"):
        given = getattr(scenario, other)
        values = {
            f.name: np.broadcast_to(getattr(given, f.name), scenario.shape)[..., None] for f in declared(type(given))
        }
        parts[other] = replace(given, **(columns if other == part else values))
    return replace(scenario, **parts)


def changed_sensor(sensor: SensorModel, name: str, change: float) -> SensorModel:
    if isinstance(sensor, Recessed) and name != "recess":
        return replace(sensor, sensor=changed_sensor(sensor.sensor, name, change))
    return replace(sensor, **{name: getattr(sensor, name) + change})


def at_contact(scenario: Scenario, sensor: SensorModel, gain: Any, names: tuple[str, ...]) -> np.ndarray:
    """Quantities by the guaranteed path, one by one; NaN without contact."""
    solution = Solution(make_request(scenario, sensor, gain, "auto", 600.0), whole=True)
    reached = np.asarray(solution.column("status")) == ContactStatus.CONTACT
    return np.array([np.where(reached, solution.column(name), np.nan) for name in names])


def differences(e: Encounters, sensor: SensorModel, name: str, step: np.ndarray, quantities: tuple[str, ...]) -> Any:
    offsets, weights = CENTRAL
    if name in {"admittance.damping", "admittance.stiffness"}:
        least = getattr(e.scenario.admittance, name[11:]) - 4 * step
        offsets, weights = CENTRAL if (least > 0).all() else FORWARD  # neither may be negative
    if name.startswith("sensor."):
        h = float(step.flat[0])
        found = [
            at_contact(e.scenario, changed_sensor(sensor, name[7:], float(k) * h), e.gain, quantities) for k in offsets
        ]
        return np.tensordot(weights, found, axes=1) / h
    moves = step[:, None] * offsets
    if name == "gain":
        scenario, gain = changed_scenario(e.scenario, "plant.position", np.zeros(1)), e.gain[:, None] + moves
    else:
        scenario, gain = changed_scenario(e.scenario, name, moves), e.gain[:, None]
    return at_contact(scenario, sensor, gain, quantities) @ weights / step


@pytest.mark.slow(keep=7)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("curve", CURVES)
def test_every_derivative_is_that_of_the_guaranteed_path(curve: str, kind: str) -> None:
    sensor, e = CURVES[curve], random_encounters(kind, COUNT, seed=20261121)
    result = find_contact(e.scenario, sensor, e.gain)
    gradients = result.gradients
    time = np.asarray(result.end.time)
    sizes, scales = sizes_of(e, sensor, time), scales_of(e, sensor, time)
    checked = []
    for name in gradients.inputs:
        coarse, fine = (
            differences(e, sensor, name, h * scales[name], gradients.quantities) * scales[name] for h in (4e-3, 2e-3)
        )
        for q, quantity in enumerate(gradients.quantities):
            found = gradients.of(quantity, name) * scales[name]
            assert np.array_equal(np.isnan(found), ~result.reached)
            allowed = WANTED * (sizes[quantity] + np.abs(found))
            with np.errstate(invalid="ignore"):
                trusted = np.abs(coarse[q] - fine[q]) < allowed / 4
            assert (np.abs(found - fine[q]) <= allowed)[trusted].all(), (name, quantity, found, fine[q])
            checked.append(trusted[result.reached].mean() if result.reached.any() else 1.0)
    assert np.mean(checked) > 0.8


def exact_contact(q: list[Any], near: Any) -> list[Any]:
    """L(10)-(13) with a moving reference, by exponentials that may be complex, in many digits."""
    mass, damping, stiffness, x_o, v_o, a_o, x, u, x_d, v_d, a_d, gain, slope = q
    p, v, a, x_0, u_0 = x_o - x_d, v_o - v_d, a_o - a_d, x - x_d, u - v_d
    coupling = slope * gain
    sigma, root = (
        (damping + coupling) / (2 * mass),
        mp.sqrt(mp.mpc((damping + coupling) ** 2 / (4 * mass**2) - stiffness / mass)),
    )
    first, second = -sigma + root, -sigma - root
    rate = coupling * a / stiffness  # of the particular motion
    base = (coupling * v - (damping + coupling) * rate) / stiffness
    c_2 = (u_0 - rate - first * (x_0 - base)) / (second - first)
    c_1 = x_0 - base - c_2

    def shift(t: Any, order: int) -> Any:
        free = c_1 * first**order * mp.exp(first * t) + c_2 * second**order * mp.exp(second * t)
        return mp.re(free) + (base + rate * t, rate, 0)[order]

    t = mp.findroot(lambda t: p + v * t + a * t * t / 2 - shift(t, 0), near)
    speed = v + a * t - shift(t, 1)
    position = shift(t, 0) + x_d + v_d * t + a_d * t * t / 2
    return [
        *(t, position, shift(t, 1) + v_d + a_d * t, shift(t, 2) + a_d),
        *(shift(t, 0), speed, gain * slope * speed),
    ]


@pytest.mark.parametrize(
    ("damping", "acceleration", "moving"), [(10.0, 0.0, 0.0), (60.0, 0.0, 0.0), (2.0, 0.4, 1.0), (0.5, -0.7, -1.0)]
)
def test_a_constant_slope_has_the_derivatives_of_many_digits(
    damping: float, acceleration: float, moving: float
) -> None:
    """Over-damped by the closed form; accelerated ones, under-damped by their gain of -0.02, by the other ways."""
    gain = -0.7 if moving == 0 else -0.02
    numbers = [1.2, damping, 25.0, 0.05, -0.3, acceleration, 0.001, 0.02 * moving, 0.003 * moving]
    numbers += [0.01 * moving, -0.1 * moving, gain, -61.0]
    scenario = Scenario(
        admittance=Admittance(mass=numbers[0], damping=numbers[1], stiffness=numbers[2]),
        obstacle=Obstacle(position=numbers[3], velocity=numbers[4], acceleration=numbers[5]),
        plant=Plant(position=numbers[6], velocity=numbers[7]),
        reference=Reference(position=numbers[8], velocity=numbers[9], acceleration=numbers[10]),
    )
    sensor = ExponentialFirstOrder(scale=1.0, rate=-61.0)
    inputs = ["admittance.mass", "admittance.damping", "admittance.stiffness", "obstacle.position"]
    inputs += ["obstacle.velocity", "obstacle.acceleration", "plant.position", "plant.velocity", "reference.position"]
    inputs += ["reference.velocity", "reference.acceleration", "gain", "sensor.rate"]
    result = find_contact(scenario, sensor, gain)
    with mp.workdps(60):
        q = [mpf(x) for x in numbers]
        near = exact_contact(q, mpf(result.contact.time))[0]
        for i, name in enumerate(inputs):
            step = mpf(10) ** -20
            ends = []
            for sign in (1, -1):
                moved = list(q)
                moved[i] += sign * step
                ends.append(exact_contact(moved, near))
            for k, quantity in enumerate(result.gradients.quantities):
                expected = float((ends[0][k] - ends[1][k]) / (2 * step))
                # some hundred roundings, of terms that are a hundred times larger than their sum at most
                assert result.gradients.of(quantity, name) == pytest.approx(expected, rel=1e-11, abs=1e-12), name


@dataclass(frozen=True)
class Ways:
    """PageTable of derivatives by each way, and where it holds."""

    followed: np.ndarray
    others: dict[str, tuple[np.ndarray, np.ndarray]]
    scale: np.ndarray
    size: np.ndarray


def rows_by_every_way(kind: str, sensor: SensorModel, count: int) -> Ways:
    e = random_encounters(kind, count, seed=11)
    solution = Solution(make_request(e.scenario, sensor, e.gain, "auto", 600.0))
    rows, everything = GradientRows(solution), list(range(len(RELATIVE_INPUTS)))
    reached = solution.status == ContactStatus.CONTACT
    where = np.flatnonzero(reached)
    followed = np.full((2, 9, count), np.nan)
    followed[:, :, where] = rows._by_guaranteed_path(where, everything)
    others = {}
    ways: dict[str, Callable[..., Any]] = {"lanes": rows._in_lanes}
    if sensor.constant_log_slope is not None:
        ways["closed form"] = rows._linear
    for name, way in ways.items():
        found = np.full((2, 9, count), np.nan)
        left = way(everything, reached, found)
        others[name] = (found, reached & ~left)
    time = solution.raw("time")
    named = scales_of(e, sensor, time)
    names = ["admittance.mass", "admittance.damping", "admittance.stiffness", "plant.position", "plant.velocity"]
    names += ["obstacle.position", "obstacle.velocity", "obstacle.acceleration", "gain"]
    speed = np.maximum(np.abs(e.scenario.relative_velocity), e.scenario.distance / time)
    return Ways(followed, others, np.array([named[n] for n in names]), np.stack([time, speed])[:, None])


@pytest.mark.parametrize("kind", ["letter", "free", "everything"])
@pytest.mark.parametrize("curve", ["inverse-power", "exponential-1", "table"])
def test_all_ways_give_the_same(curve: str, kind: str) -> None:
    """The guaranteed path, through every turn, against those that leave some open or have a closed form."""
    ways = rows_by_every_way(kind, CURVES[curve], 200)
    taken = np.isfinite(ways.followed).all(axis=(0, 1))  # what is too stiff to be followed is not compared
    assert taken.sum() >= 0.95 * max(done.sum() for _, done in ways.others.values())
    for name, (found, possible) in ways.others.items():
        done = possible & taken
        change = np.abs(found - ways.followed) * ways.scale
        error = (change / (ways.size + np.abs(ways.followed) * ways.scale))[:, :, done]
        if name == "lanes":
            # l is known to 1e-15 of its start, l' to 500 time constants more, and steps leave 1e-10 of a response
            assert error.max(initial=0.0) < WANTED
        else:
            assert error.max(initial=0.0) < 1e-10, name
