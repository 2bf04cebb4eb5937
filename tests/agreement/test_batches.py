"""The fast paths agree with the guaranteed path, run by run, for batches of encounters."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from encounters import CURVES, KINDS, random_encounters
from pretouch.motion import (
    Admittance,
    ContactResult,
    Obstacle,
    Scenario,
    find_contact,
    solution,
)
from pretouch.motion.request import Request, make_request
from pretouch.motion.solution import Solution
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel
from reference_integrator import integrate_over_distance

SENSORS: dict[str, SensorModel] = {
    "exponential-1": ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "inverse-power": InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "exponential-2": ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["exponential-1", "inverse-power"])
def test_a_batch_is_what_the_guaranteed_path_gives(kind: str, name: str) -> None:
    batch = random_encounters(kind, 400, seed=11)
    found = find_contact(batch.scenario, SENSORS[name], batch.gain, horizon=20.0)
    request = make_request(batch.scenario, SENSORS[name], batch.gain, "auto", 20.0)
    sure = ContactResult(Solution(request, whole=True), request.method)
    assert (found.status == sure.status).all()
    time = np.asarray(sure.end.time)
    # contacts are promised to 1e-9 of their time; what changes by l', l'' and so on over that time follows
    assert np.allclose(found.end.time, time, rtol=1e-9, atol=0)
    for field in ("position", "velocity", "relative_velocity", "displacement"):
        mine, theirs = getattr(found.end, field), getattr(sure.end, field)
        rate = np.abs(sure.end.velocity) + np.abs(sure.end.acceleration) * (1 if field.endswith("y") else 0) + 1
        assert (
            np.abs(mine - theirs) <= 1e-8 * (np.abs(theirs) + rate * time + np.abs(sure.end.relative_velocity))
        ).all()
    assert np.array_equal(found.closest_distance, sure.closest_distance)
    assert np.array_equal(found.settling_distance, sure.settling_distance)
    check_demands(found, sure, request)


def check_demands(found: ContactResult, sure: ContactResult, request: Request) -> None:
    """The largest demands agree to 1e-9, and to the rounding of what they are differences of on either path."""
    mass, damping, stiffness, x_0, u_0, p, v, a, drift, pull = np.abs(request.part(slice(None))[0].T)
    time = np.asarray(sure.end.time)
    speed = v + u_0 + a * time + drift + pull * time
    way = x_0 + p + speed * time
    steepest = np.abs(np.asarray(request.sensor.log_slope(0.0))) * np.abs(request.gain)
    bend = a + pull + ((damping + steepest) * speed + stiffness * way) / mass
    floors = {
        "largest_excursion": way,
        "largest_travel": way,
        "largest_speed": speed,
        "largest_acceleration": bend,
        "largest_virtual_force": mass * bend * (request.gain != 0),
    }
    for name, size in floors.items():
        mine, theirs = getattr(found.end, name), getattr(sure.end, name)
        # a hundred roundings of 1e-16: these are sums over the steps of some ten terms each
        assert (np.abs(mine - theirs) <= 1e-9 * theirs + 1e-13 * size).all(), name


@pytest.mark.slow(keep=14)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CURVES)
def test_the_largest_demands_until_a_contact_need_no_whole_motion(
    name: str, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    batch = random_encounters(kind, 600, seed=12)
    request = make_request(batch.scenario, CURVES[name], batch.gain, "auto", 20.0)
    sure = ContactResult(Solution(request, whole=True), request.method)
    found = ContactResult(Solution(request), request.method)
    asked: list[int] = []
    guaranteed = solution.solve_guaranteed

    def counted(request: Request, which: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        asked.append(request.size if which is None else len(which))
        return guaranteed(request, which)

    monkeypatch.setattr(solution, "solve_guaranteed", counted)
    np.testing.assert_array_equal(found.settling_distance, sure.settling_distance)
    check_demands(found, sure, request)
    # one in thirty of a quantity at most: two peaks in one step, and what is a difference of much larger numbers
    assert sum(asked) <= 5 * request.size / 30


def test_what_ends_without_contact_has_the_demands_of_the_guaranteed_path() -> None:
    batch = random_encounters("everything", 300, seed=13)
    for name in ("exponential-1", "inverse-power"):
        found = find_contact(batch.scenario, SENSORS[name], batch.gain, horizon=20.0)
        request = make_request(batch.scenario, SENSORS[name], batch.gain, "auto", 20.0)
        sure = ContactResult(Solution(request, whole=True), request.method)
        others = ~sure.reached
        assert others.sum() > 10
        for field in ("largest_excursion", "largest_virtual_force", "closest_distance", "settling_distance"):
            mine, theirs = (getattr(r.end if "largest" in field else r, field) for r in (found, sure))
            np.testing.assert_array_equal(mine[others], theirs[others])


@pytest.mark.parametrize("kind", ["under-damped", "accelerated"])
def test_a_constant_slope_takes_the_lanes_where_the_closed_form_leaves_a_contact_open(kind: str) -> None:
    batch = random_encounters(kind, 2000, seed=14)
    request = make_request(batch.scenario, SENSORS["exponential-1"], batch.gain, "auto", 20.0)
    path = Solution(request)
    sure = ContactResult(Solution(request, whole=True), request.method)
    proved = path._proved()
    assert sure.reached[proved].all()
    assert np.abs(path.raw("time") / sure.end.time - 1)[proved].max() < 1e-9
    assert proved[sure.reached].mean() > 0.95, "what is left is stiff, or starts with two motions that balance"
    by_form = path._by_form
    assert by_form is not None
    assert (by_form[proved] != 0).mean() > 0.01, "some are the work of the lanes"
    assert (proved | (by_form != 0)).all()


def test_a_batch_certifies_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """The impulse balance of contacts that the lanes found, from the sensor's own ln xi, as of another program.

    A twentieth of them is integrated over the distance by a Runge-Kutta method that shares nothing with the lanes. And
    the balance is no ornament: with ln xi of a curve a tenth steeper than its slope, a tenth of its term is left over.
    """
    rng = np.random.default_rng(5)
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-rng.uniform(0.05, 1.0, 3000)),
    )
    for name, sensor in SENSORS.items():
        gain = -rng.uniform(0.05, 2.0, 3000)
        found = find_contact(scenario, sensor, gain)
        assert found.reached.all(), name
        assert found.impulse_residual.max() < 1e-9, name
        some = slice(None, None, 20)
        obstacle = replace(scenario.obstacle, velocity=scenario.obstacle.velocity[some])
        other = integrate_over_distance(replace(scenario, obstacle=obstacle), sensor, gain[some], 400)
        assert other["monotone"].mean() > 0.9
        for quantity in ("time", "relative_velocity"):
            mine = getattr(found.end, quantity)[some][other["monotone"]]
            np.testing.assert_allclose(mine, other[quantity][other["monotone"]], rtol=1e-8)
        log_output = type(sensor).log_output
        with monkeypatch.context() as steeper:
            steeper.setattr(type(sensor), "log_output", lambda self, x, known=log_output: 1.1 * known(self, x))
            again = find_contact(scenario, sensor, gain)
            rise = log_output(sensor, 0.0) - log_output(sensor, 0.0422)
            residual = again.impulse_residual
        # the largest term is no larger than the force's, or M |l'(0)|, D l(0), or what the spring had to balance
        most = np.abs(1.1 * gain * rise) + 1.0 * np.abs(scenario.obstacle.velocity) + 10.0 * 0.0422
        assert (residual >= 0.1 * np.abs(gain * rise) / (2 * most)).all(), name


@pytest.mark.parametrize("name", ["exponential-1", "inverse-power"])
def test_memory_is_that_of_input_and_output(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside them: one copy of the gains, which keeps a later reading true, and blocks of a fixed size."""
    monkeypatch.setattr(solution, "_KEPT", 1000)
    monkeypatch.setattr(solution, "_MOST", 10_000)
    n = 200_000
    rng = np.random.default_rng(6)
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-rng.uniform(0.05, 1.0, n)),
    )
    gain = -rng.uniform(0.05, 2.0, n)
    find_contact(scenario, SENSORS[name], gain)  # compiles
    tracemalloc.start()
    found = find_contact(scenario, SENSORS[name], gain)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    output = 9 * n
    blocks = 4 * 48 * 10_000 + 200_000
    assert found.end.time.nbytes + found.status.nbytes == output
    assert peak <= output + gain.nbytes + blocks + n, "a truth value per encounter is made on the way"
