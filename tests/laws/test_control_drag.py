"""Laws of the sampled virtual drag: one fraction of every speed, no response to noise or to receding objects."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pretouch as pt
from control_samples import controller, rows_of, run_rows
from pretouch.control import Controller, VirtualDrag
from pretouch.simulation import ClosedLoop
from properties import examples
from refusals import refused

POSITION, VELOCITY, FORCE = 0, 1, 3
SHARE, START, MASS = 0.15, 0.0422, 1.0
SENSOR = pt.InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)
PHI = MASS * math.log(1 / SHARE) / (3.32**2 * (1 / 0.0419 - 1 / (0.0419 + START)))  # M ln(1/rho) / int g^2 dl
ADMITTANCE = pt.Admittance(mass=MASS, damping=10.0, stiffness=25.0)
QUIET = VirtualDrag(drag=PHI, noise=0.0, smoothing_time=2e-3)
PART = VirtualDrag(drag=PHI, noise=20.0, relative_noise=3e-3, resolution=4.0, own_advance=-0.746)


def encounter(speed: float) -> pt.Scenario:
    return pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=START, velocity=speed))


def drags(law: VirtualDrag, period: float = 1e-3, **changed: Any) -> Controller:
    return controller(period=period, **({"law": law, "floor": 100.0} | changed))


def noisy(count: int, level: float, seed: int) -> np.ndarray:
    """Readings of an object at rest, as the part of `PART` gives them, on a pedestal of nothing."""
    xi = level * (1 + 3e-3 * np.random.default_rng(seed).normal(size=count))
    return np.round((xi + 20.0 * np.random.default_rng(seed + 1).normal(size=count)) / 4.0) * 4.0


@pytest.mark.parametrize("speed", [0.05, 0.1, 0.3, 1.0])
def test_every_approach_keeps_the_same_share_of_its_speed(speed: float) -> None:
    """At 1 kHz without noise: a delay of 1.2 periods and a lag of 2 ms make it up to 5 % less at 1 m/s."""
    chain = pt.SensorChain(rate=1000.0, delay=2e-4, random_phase=True)
    found = pt.simulation.simulate_loop(encounter(-speed), SENSOR, drags(QUIET), chain=chain, runs=20, seed=4)
    share = -np.asarray(found.relative_velocity) / speed
    assert (found.status == pt.motion.ContactStatus.CONTACT).all()
    assert 0.95 * SHARE <= share.mean() <= 1.005 * SHARE
    # E = int (exp(Q) - 1) dl = 59.6 mm at any speed; the same lag of l lets the drag act up to 2.2 ms x v later
    assert found.largest_excursion.mean() == pytest.approx(0.0596, abs=1e-3 + 4e-3 * speed)


def test_the_faster_the_loop_the_nearer_the_share_is_that_of_continuous_time() -> None:
    errors = []
    for rate in (1000.0, 2000.0, 4000.0):
        law = VirtualDrag(drag=PHI, noise=0.0, smoothing_time=2.0 / rate)
        chain = pt.SensorChain(rate=rate, delay=0.2 / rate)
        found = pt.simulation.simulate_loop(encounter(-0.3), SENSOR, drags(law, 1 / rate), chain=chain)
        errors.append(abs(-found.relative_velocity / 0.3 / SHARE - 1))
    assert errors[2] < 0.6 * errors[1] < 0.4 * errors[0], errors
    assert errors[2] < 0.01


def test_the_admittance_has_no_say_in_the_share() -> None:
    """Its pull is held off whole: what is left of it is of second order in T, at 4 kHz below 5e-4 of the share."""
    chain, found = pt.SensorChain(rate=4000.0, delay=1e-4), []
    law = VirtualDrag(drag=PHI, noise=0.0, smoothing_time=1e-3)
    for stiffness, damping in ((0.0, 0.0), (25.0, 10.0), (0.0, 10.0), (400.0, 40.0)):
        own = {"mass": MASS, "damping": damping, "stiffness": stiffness}
        scenario = pt.Scenario(admittance=pt.Admittance(**own), obstacle=pt.Obstacle(position=START, velocity=-0.3))
        made = drags(law, 2.5e-4, admittance=pt.control.VirtualAdmittance(**own))
        found.append(-pt.simulation.simulate_loop(scenario, SENSOR, made, chain=chain).relative_velocity / 0.3)
    assert found == pytest.approx([SHARE] * 4, rel=6e-3)
    assert found == pytest.approx([found[0]] * 4, rel=5e-4)


@pytest.mark.parametrize("place", [-0.009, -0.021])
def test_a_plant_that_comes_home_onto_a_stopped_object_is_braked(place: float) -> None:
    """The drag alone holds nothing off while the plant advances; the letter's damper brakes it to a fifth."""
    chain = pt.SensorChain(rate=250.0, delay=2e-3, noise=20.0, relative_noise=3e-3, resolution=4.0, random_phase=True)
    scenario = pt.Scenario(
        admittance=ADMITTANCE, obstacle=pt.Obstacle(position=place, velocity=0.0), plant=pt.Plant(position=-0.05)
    )
    braked, bare = (
        pt.simulation.simulate_loop(
            scenario, SENSOR, drags(law, sensor_period=4e-3), chain=chain, runs=20, seed=1, horizon=10.0
        )
        for law in (PART, replace(PART, own_advance=0.0))
    )
    assert (braked.status == pt.motion.ContactStatus.CONTACT).all()
    assert braked.relative_velocity.mean() > 0.25 * bare.relative_velocity.mean()


@pytest.mark.parametrize("level", [120.0, 250.0, 600.0])
def test_in_declared_noise_nothing_moves(level: float) -> None:
    """60 s at 250 Hz, from the detection limit on: 15,000 readings and none that counts."""
    for seed in range(10):
        made = drags(PART, 4e-3)
        found = run_rows(made, rows_of(noisy(15_000, level, 100 * seed + int(level))))
        assert (found[:, POSITION] == 0.0).all()
        assert (found[:, FORCE] == 0.0).all()


@pytest.mark.parametrize("speed", [0.1, 0.3])
def test_nothing_follows_an_object_that_recedes(speed: float) -> None:
    time = np.arange(500) * 4e-3
    xi = np.asarray(SENSOR.output(0.03 + speed * time))
    rng = np.random.default_rng(9)
    found = run_rows(drags(PART, 4e-3), rows_of(xi * (1 + 3e-3 * rng.normal(size=500)) + 20.0 * rng.normal(size=500)))
    assert (found[:, POSITION] == 0.0).all()


@examples(60)
@given(logs=st.lists(st.floats(0.1, 8.0), min_size=2, max_size=40), drop=st.sets(st.integers(0, 39)))
def test_it_only_ever_pushes_back(logs: list[float], drop: set[int]) -> None:
    rows = rows_of(100.0 * np.exp(logs))
    rows[:, 1] = [k not in drop for k in range(len(rows))]
    found = run_rows(drags(VirtualDrag(drag=0.0144, noise=0.0)), rows)
    assert (found[:, FORCE] <= 0.0).all()


@examples(60)
@given(logs=st.lists(st.floats(0.1, 8.0), min_size=2, max_size=40))
def test_without_its_coefficient_there_is_no_force(logs: list[float]) -> None:
    found = run_rows(drags(VirtualDrag(drag=0.0, noise=0.0)), rows_of(100.0 * np.exp(logs)))
    assert (found[:, :2] == 0.0).all()
    assert (found[:, FORCE] == 0.0).all()


def test_a_reading_that_fails_to_come_changes_no_rate() -> None:
    """A steady approach, s' = 6/s: half of the readings tell the same rate, and the impulse is that of all of them."""
    rate, count = 6.0, 600
    logs = math.log(1000.0) + rate * 1e-3 * np.arange(count)
    made = drags(QUIET, timeout=0.05, admittance=pt.control.VirtualAdmittance(mass=1.0, damping=0.0, stiffness=0.0))
    come = np.random.default_rng(5).random(count) < 0.5
    come[[0, -1]] = True
    whole, half = (run_rows(made, rows_of(np.exp(logs), fresh=fresh)) for fresh in (1.0, come))
    # M = 1 kg and nothing else: the speed is the impulse; from reading 100 on the rate is learned to exp(-50)
    steps = slice(100, count, 50)
    gained = [np.diff(found[steps, VELOCITY]) for found in (whole, half)]
    np.testing.assert_allclose(gained[0], -PHI * rate**2 * 0.05, rtol=1e-6)
    np.testing.assert_allclose(gained[1].sum(), gained[0].sum(), rtol=0.02)  # a few readings of 450 under way


@pytest.mark.parametrize("dropout", [0.0, 0.05])
def test_on_a_noisy_loop_contact_is_as_the_study_found_it(dropout: float) -> None:
    """Sensor at 250 Hz, 2 ms late, on a pedestal; 0.15 x 0.3 m/s is 45 mm/s: 45.6 mm/s on average over reflectances.

    Readings that fail to come change that by less than the runs are apart: a rate over a wrong time would double.
    """
    chain = pt.SensorChain(
        **{"rate": 250.0, "delay": 2e-3, "noise": 20.0, "relative_noise": 3e-3, "resolution": 4.0},
        **{"offset": 50.0, "random_phase": True, "dropout": dropout},
    )
    plant = pt.simulation.ImpedancePlant(mass=1.0, stiffness=4000.0, damping=126.0, bandwidth=80.0)
    made, speeds, ways = drags(PART, sensor_period=4e-3), [], []
    for number, share in enumerate(np.geomspace(0.5, 2.0, 8)):
        sensor = pt.InversePower(scale=0.533 * share, distance_offset=0.0419, exponent=3.32)
        found = pt.simulation.simulate_loop(
            encounter(-0.3), sensor, made, chain=chain, plant=plant, runs=25, seed=number
        )
        speeds.append(-found.relative_velocity)
        ways.append(found.largest_excursion)
    assert 0.044 < np.mean(speeds) < 0.047
    assert np.quantile(speeds, 0.95) < 0.051
    assert np.mean(ways) < 0.054


@pytest.mark.parametrize("smoothing", [2e-3, 7e-3])
def test_level_and_rate_are_those_of_double_smoothing(smoothing: float) -> None:
    """Of readings at equal times; and noise of 1 has there the deviations that dead zone and floor are counted in."""
    made = drags(VirtualDrag(drag=1e-9, noise=1.0, smoothing_time=smoothing, dead_zone=1.0, still_rate=1.0))
    numbers, rng = made.parameters().law, np.random.default_rng(2)
    share = 1 - math.exp(-1e-3 / smoothing)
    logs = 5.0 + rng.normal(size=20_000)
    run, once, twice, found = made.begin(), logs[0], logs[0], []
    for log in logs:
        once += share * (log - once)
        twice += share * (once - twice)
        run.step(100.0 * math.exp(log))
        law = run.state.law
        found.append((law.level, law.rate, 2 * once - twice, share / (1 - share) * (once - twice) / 1e-3))
    level, rate, brown_level, brown_rate = np.array(found).T
    np.testing.assert_allclose(level, brown_level, atol=1e-11)
    np.testing.assert_allclose(rate, brown_rate, atol=1e-8)
    # a deviation of correlated numbers, some 20,000/14 of them independent: good to 2 % each, here three times that
    assert level.std() == pytest.approx(numbers.width, rel=0.06)
    assert rate.std() == pytest.approx(numbers.still, rel=0.06)


def test_its_own_advance_is_braked_and_not_beyond_rest() -> None:
    """A plant that comes home onto an object: the brake takes speed, and never turns it."""
    rows = rows_of(1000.0 * np.exp(6e-3 * np.arange(300)))
    speeds = {}
    for own in (0.0, -0.7, -100.0):
        made = drags(VirtualDrag(drag=0.0, noise=0.0, smoothing_time=0.0, own_advance=own))
        run = made.begin(position=-0.05, velocity=0.05)
        speeds[own] = np.array([run.step(row[0]).velocity for row in rows])
    assert (speeds[-0.7][10:100] < speeds[0.0][10:100]).all()
    # a period's impulse is at most M x~', so what is left of the pull within it alone turns the plant
    assert speeds[-100.0].min() > -1e-3


def test_a_known_acceleration_is_fed_forward_while_the_object_approaches() -> None:
    rows = rows_of(np.r_[np.full(50, 1000.0), 1000.0 * np.exp(6e-3 * np.arange(50)), np.full(100, 1350.0)])
    found = run_rows(drags(VirtualDrag(drag=0.0, noise=0.0, smoothing_time=0.0, known_acceleration=-2.0)), rows)
    assert (found[:51, FORCE] == 0.0).all()
    assert (found[51:100, FORCE] <= -2.0).all()
    assert (found[130:, FORCE] == 0.0).all(), "over 20 ms after the last rise"
    with refused("known_acceleration", value=9.81):
        VirtualDrag(drag=0.01, noise=0.0, known_acceleration=9.81)


def test_a_loop_tries_values_of_its_coefficient() -> None:
    """`ClosedLoop` asks for another value of a law's one number, whichever it is."""
    chain = pt.SensorChain(rate=1000.0, delay=2e-4)
    loop = ClosedLoop(law=drags(QUIET), chain=chain)
    found = loop(encounter(-0.3), SENSOR, [0.0, PHI / 2, PHI]).contact.relative_velocity
    one = pt.simulation.simulate_loop(
        encounter(-0.3), SENSOR, drags(QUIET).with_value(PHI / 2), chain=chain
    ).relative_velocity
    assert found[1] == one
    # half of the coefficient takes half of ln(1/rho)
    assert -found / 0.3 == pytest.approx(np.array([1.0, SHARE**0.5, SHARE]), rel=0.05)


@pytest.mark.parametrize(
    ("changed", "fields"),
    [
        ({"drag": -0.1}, {"argument": "drag", "value": -0.1}),
        ({"drag": 1e7}, {"argument": "drag", "limit": 1000000.0}),
        ({"noise": -1.0}, {"argument": "noise", "value": -1.0}),
        ({"noise": math.nan}, {"argument": "noise"}),
        ({"smoothing_time": -1e-3}, {"argument": "smoothing_time", "value": -0.001}),
        ({"own_advance": 0.5}, {"argument": "own_advance", "value": 0.5}),
        ({"dead_zone": 1e7}, {"argument": "dead_zone", "limit": 1000000.0}),
        ({"drag": np.array([0.1, 0.2])}, {"argument": "drag"}),
    ],
)
def test_a_drag_that_makes_no_sense_is_refused(changed: dict[str, Any], fields: dict[str, Any]) -> None:
    with refused(**fields):
        VirtualDrag(**({"drag": 0.0144, "noise": 20.0} | changed))
