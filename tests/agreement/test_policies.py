"""The loop of benchmarks/policies against `pt.ClosedLoop`, its bounds, its Kalman filter and its search."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.policies import __main__ as policies
from benchmarks.policies import loop
from benchmarks.policies.laws import PHI, Ranging, ScaledDrag, estimate, level
from benchmarks.policies.search import minimize

COUNT = 12


def encounters(count: int = COUNT) -> loop.Encounters:
    return policies.draw_encounters(np.random.default_rng(7), count, policies.SPREAD)


def in_pretouch(one: loop.Encounters, i: int, chain: pt.SensorChain, runs: int | None = None) -> pt.SimulationResult:
    free = pt.Admittance(mass=loop.MASS, damping=0.0, stiffness=0.0)
    obstacle = pt.Obstacle(position=one.distance[i], velocity=-one.speed[i], acceleration=-one.push[i])
    sensor = replace(loop.SENSOR, scale=loop.SENSOR.scale * one.reflectance[i])
    simulated = pt.ClosedLoop(law=loop.CONTROLLER, chain=chain, seed=i)
    return simulated.run(pt.Scenario(admittance=free, obstacle=obstacle), sensor, PHI, runs=runs)


@pytest.mark.parametrize("push", [0.0, 0.5])
def test_encounters_without_noise_are_those_of_pretouch(push: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop, "NOISE", 0.0)
    monkeypatch.setattr(loop, "RELATIVE_NOISE", 0.0)
    drawn = encounters()._replace(push=np.full(COUNT, push))
    drag = policies.outcome(policies.DRAG, np.zeros(1), drawn)
    for i in range(COUNT):
        chain = replace(loop.CHAIN, noise=0.0, relative_noise=0.0, random_phase=False, phase=float(drawn.phase[i]))
        result = in_pretouch(drawn, i, chain)
        np.testing.assert_allclose(-result.relative_velocity / drawn.speed[i], drag.ratio[i], rtol=1e-9)
        np.testing.assert_allclose(result.largest_excursion, drag.excursion[i], rtol=1e-9)
        np.testing.assert_allclose(result.largest_acceleration, drag.acceleration[i], rtol=1e-9)


def test_noise_and_phase_have_the_distribution_of_pretouch() -> None:
    """Means of 400 runs differ by at most 5 standard errors, and standard deviations by the error of that of 400."""
    runs = 400
    one = encounters(runs)
    same = one._replace(speed=one.speed * 0 + 0.2, distance=one.distance * 0 + 0.04, reflectance=one.speed * 0 + 0.6)
    ours = policies.outcome(policies.DRAG, np.zeros(1), same)
    theirs = in_pretouch(same, 0, loop.CHAIN, runs=runs)
    pairs = ((ours.ratio, -theirs.relative_velocity / 0.2), (ours.excursion, theirs.largest_excursion))
    for a, b in pairs:
        assert a.std() > 0
        assert abs(a.mean() - b.mean()) < 5 * np.hypot(a.std(), b.std()) / np.sqrt(runs)
        assert abs(np.log(a.std() / b.std())) < 5 / np.sqrt(runs)


@pytest.mark.parametrize(
    ("law", "theta"),
    [
        (policies.DRAG, [0.0]),
        (policies.DRAG, [0.7]),
        (ScaledDrag(level), [0.3, 0.5]),
        (Ranging(0.5), [0.2, 1.5, 0.1, -2.0]),
    ],
)
def test_no_law_is_better_than_the_physical_bounds(law: loop.Law, theta: list[float]) -> None:
    drawn = encounters(40)
    assert policies.margin(policies.outcome(law, np.array(theta), drawn), drawn) >= 1 - 1e-9


class Informed:
    """The constant deceleration from the first reading to contact, for given encounters of one law."""

    def __init__(self, deceleration: np.ndarray) -> None:
        self.deceleration = deceleration

    def start(self, lanes: int) -> loop.Memory:
        return (np.arange(lanes),)

    def step(self, _: np.ndarray, memory: loop.Memory, __: loop.Seen) -> tuple[np.ndarray, loop.Memory]:
        return loop.MASS * loop.T * self.deceleration[memory[0]], memory


def test_the_law_that_knows_everything_reaches_the_bound() -> None:
    """From the first tick on, so the distance is the one at this tick."""
    drawn = encounters()
    tick = np.ceil((drawn.phase + loop.CHAIN.delay) / loop.CONTROLLER.period) * loop.CONTROLLER.period
    at_tick = drawn._replace(distance=drawn.distance - drawn.speed * tick)
    r = 0.15
    law = Informed(drawn.speed**2 * (1 - r**2) / (2 * at_tick.distance))
    found = policies.outcome(law, np.zeros(1), drawn)
    np.testing.assert_allclose(found.ratio, r, rtol=1e-9)
    np.testing.assert_allclose(found.excursion, at_tick.distance * (1 - r) / (1 + r), rtol=1e-9)
    known = policies.informed(found, at_tick)
    np.testing.assert_allclose(known[:2], 1.0, rtol=1e-9)
    assert policies.margin(found, at_tick) == pytest.approx(1.0, rel=1e-9)


def test_on_an_ideal_loop_a_law_that_knows_everything_needs_half_of_the_drag() -> None:
    drag = pt.designs.drag.drag_by(loop.SENSOR, loop.START, loop.MASS, ratio=loop.RATIO)
    v = 0.3
    ideal = loop.Outcome(np.array([drag.ratio]), np.array([drag.excursion]), np.array([drag.peak * v**2]))
    one = encounters(1)._replace(speed=np.array([v]), distance=np.array([loop.START]))
    known = policies.informed(ideal, one)
    assert known.excursion == pytest.approx(0.52, abs=0.01)
    assert known.acceleration == pytest.approx(0.52, abs=0.01)


def test_a_floor_alone_is_the_drag() -> None:
    drawn = encounters()
    floor = policies.outcome(Ranging(0.8), np.array([-50.0, 0.0, 0.0, -1.6]), drawn)
    drag = policies.outcome(policies.DRAG, np.log([0.8]), drawn)
    for a, b in zip(floor, drag, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def test_the_estimate_is_that_of_a_kalman_filter_in_matrices() -> None:
    """The same filter as P = A P A' + Q, K = P H'/(H P H' + R), P = (1 - K H) P, one lane at a time."""
    rng, n, t, lanes = np.random.default_rng(3), loop.SENSOR.exponent, loop.T, 3
    sway = np.array([0.1, 0.2, 0.4])
    memory: loop.Memory = ()
    means, covariances = [], []
    for index in range(30):
        xi = rng.uniform(2000, 2500, lanes) * (1 + index / 20)
        g = rng.uniform(0.0, 1e-3, lanes) * (index > 0)
        zero = np.zeros(lanes)
        memory = estimate(memory, loop.Seen(index, xi, zero, zero, zero, g, zero), sway)
        y, numbers = xi ** (-1 / n), loop.NUMBERS
        variance = (y / n) ** 2 * (numbers.variance / xi**2 + numbers.relative_variance)
        for i in range(lanes):
            if index == 0:
                scale = memory[2][i]
                means.append(np.array([y[i], 0.0, scale]))
                covariances.append(np.diag([variance[i], scale**2, (0.45 * scale / n) ** 2]))
                continue
            ahead = np.array([[1, t, g[i]], [0, 1, 0], [0, 0, 1]])
            push = sway[i] * means[i][2] * np.array([t**2 / 2, t, 0.0])
            mean, p = ahead @ means[i], ahead @ covariances[i] @ ahead.T + np.outer(push, push)
            gain = p[:, 0] / (p[0, 0] + variance[i])
            means[i], covariances[i] = mean + gain * (y[i] - mean[0]), p - np.outer(gain, p[0])
    np.testing.assert_allclose(np.array(memory[:3]).T, means, rtol=1e-9)
    upper = [c[np.triu_indices(3)] for c in covariances]
    np.testing.assert_allclose(np.array(memory[3:]).T, upper, rtol=1e-9)


def test_compared_laws_have_the_same_excursion_and_the_drag_is_equal_to_itself() -> None:
    groups = [encounters(30), encounters(30)]
    mean, _ = policies.compare(policies.DRAG, np.array([0.4]), policies.CRITERIA["mean"], groups)
    np.testing.assert_allclose(mean, 1.0, rtol=1e-3)


def test_the_search_finds_the_minimum_of_a_narrow_valley() -> None:
    """Rosenbrock's function."""

    def valley(x: np.ndarray) -> np.ndarray:
        return np.sum(100 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1 - x[:, :-1]) ** 2, axis=1)

    found = minimize(valley, np.zeros(3), 0.3, 200, np.random.default_rng(1))
    np.testing.assert_allclose(found, 1.0, atol=1e-3)
