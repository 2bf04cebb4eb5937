"""No gain beats the physical bound, whatever the encounter; and the bound says what it does not speak of."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from encounters import CURVES, random_encounters
from pretouch._core.fields import declared
from pretouch.designs import PhysicalBound, Task, find_physical_bound, pareto
from pretouch.motion import Admittance, Obstacle, Plant, Reference, Scenario, find_contact, solve_motion
from pretouch.sensors import ExponentialFirstOrder, InversePower
from refusals import refused

ADMITTANCE = Admittance(mass=1.0, damping=10.0, stiffness=25.0)


@pytest.mark.parametrize("curve", ["inverse-power", "exponential-1", "exponential-2", "table", "mittag-leffler"])
@pytest.mark.parametrize("kind", ["letter", "over-damped", "under-damped", "near-critical", "free", "accelerated"])
def test_no_gain_beats_the_bound(kind: str, curve: str) -> None:
    """Random encounters, each beside the best of a robot that accelerates as much: of the time and the excursion, to
    the accuracy of contacts, 1e-9."""
    drawn = random_encounters(kind, 120, seed=11)
    motion = solve_motion(drawn.scenario, CURVES[curve], drawn.gain, samples=400)
    result = motion.result
    # the bound speaks of robots that give way: samples say which swing toward the obstacle first
    gives_way = result.reached & (motion.displacement.max(axis=-1) <= 1e-9) & (drawn.gain < 0)
    compared = 0
    for i in np.flatnonzero(gives_way):
        obstacle = {f.name: float(getattr(drawn.scenario.obstacle, f.name)[i]) for f in declared(Obstacle)}
        end = {n: float(getattr(result.end, n)[i]) for n in ("displacement", "relative_velocity", "time")}
        bound = PhysicalBound(
            distance=obstacle["position"],
            velocity=obstacle["velocity"],
            acceleration=obstacle["acceleration"],
            acceleration_limit=float(result.end.largest_acceleration[i]) * (1 + 1e-9),
        )
        speed = abs(end["relative_velocity"])
        assert speed >= bound.least_contact_speed * (1 - 1e-9)
        assert abs(end["displacement"]) >= bound.excursion(speed) * (1 - 1e-7) - 1e-12
        assert end["time"] >= bound.time(speed) * (1 - 1e-9)
        assert result.end.largest_acceleration[i] >= bound.least_acceleration(speed) * (1 - 1e-9)
        compared += 1
    assert compared > (20 if kind == "under-damped" else 60)


@pytest.mark.parametrize("ratio", [0.05, 0.4, 1.0, 3.0])
def test_no_point_of_a_front_beats_the_bound(ratio: float) -> None:
    scenario = Scenario(
        admittance=Admittance.from_natural_frequency(mass=0.5, natural_frequency=6.0, damping_ratio=ratio),
        obstacle=Obstacle(position=0.15, velocity=-0.25),
    )
    sensor = InversePower(scale=1e-4, distance_offset=0.02, exponent=2.0)
    front = pareto(Task(scenario, sensor, bounds=(-5.0, -0.001)))
    assert front.comparison is not None
    known = np.isfinite(front.comparison.ratio)
    assert (front.comparison.ratio[known] >= 1 - 1e-9).all()
    if ratio >= 1:  # proved to give way, so that the bound speaks of all
        assert known.all()


def test_a_plant_that_swings_toward_the_obstacle_first_is_left_out() -> None:
    """Nearly undamped, and pushed less and less by an obstacle that brakes, the plant swings back past its start."""
    scenario = Scenario(
        admittance=Admittance.from_natural_frequency(mass=1.0, natural_frequency=20.0, damping_ratio=0.005),
        obstacle=Obstacle(position=0.3, velocity=-0.5, acceleration=0.35),
    )
    sensor = ExponentialFirstOrder(scale=1.0, rate=-10.0)
    gains = -np.geomspace(0.01, 0.1, 7)
    motion = solve_motion(scenario, sensor, gains, samples=3000)
    assert (motion.displacement.max(axis=-1) > 1e-6).all()
    front = pareto(Task(scenario, sensor, bounds=(-0.1, -0.01)))
    assert front.comparison is not None
    assert np.isnan(front.comparison.least_excursion).all()
    assert np.isnan(front.comparison.ratio).all()


speeds = st.floats(0.05, 2.0)


@given(v=speeds, distance=st.floats(0.01, 0.5), limit=st.floats(0.1, 50.0), share=st.floats(0.0, 1.0))
def test_a_uniform_obstacle_needs_the_square_of_the_speed_over_twice_the_acceleration(
    v: float, distance: float, limit: float, share: float
) -> None:
    bound = PhysicalBound(distance=distance, velocity=-v, acceleration_limit=limit)
    least = bound.least_contact_speed
    assert least == pytest.approx(math.sqrt(max(v**2 - 2 * limit * distance, 0.0)), rel=1e-12)
    w = least + share * (v - least)
    assert bound.excursion(w) == pytest.approx((v - w) ** 2 / (2 * limit), rel=1e-6, abs=1e-12)
    assert bound.time(w) == pytest.approx((distance + bound.excursion(w)) / v, rel=1e-12)
    # the least acceleration for this speed is the one with which it is the least speed
    needed = bound.least_acceleration(w)
    if needed > 1e-6:
        weak = PhysicalBound(distance=distance, velocity=-v, acceleration_limit=needed)
        assert weak.least_contact_speed == pytest.approx(w, rel=1e-6, abs=1e-6)


@given(
    v=speeds,
    distance=st.floats(0.01, 0.5),
    a=st.floats(-5.0, 0.5),
    limit=st.floats(0.1, 50.0),
    more=st.floats(1.01, 3.0),
    share=st.floats(0.0, 1.0),
)
def test_more_acceleration_and_more_speed_left_never_need_more_excursion(
    v: float, distance: float, a: float, limit: float, more: float, share: float
) -> None:
    weak = PhysicalBound(distance=distance, velocity=-v, acceleration=a, acceleration_limit=limit)
    strong = PhysicalBound(distance=distance, velocity=-v, acceleration=a, acceleration_limit=more * limit)
    assert strong.least_contact_speed <= weak.least_contact_speed
    w = weak.least_contact_speed * (1 + 1e-6) + 2 * share * v
    assert strong.excursion(w) <= weak.excursion(w) * (1 + 1e-9)
    assert weak.excursion(1.1 * w + 1e-9) <= weak.excursion(w) * (1 + 1e-9)


def test_the_bound_takes_arrays() -> None:
    bound = PhysicalBound(distance=0.05, velocity=-0.4, acceleration_limit=np.array([[1.0], [4.0]]))
    speed = np.array([0.3, 0.2, 0.0])
    assert bound.excursion(speed).shape == (2, 3)
    assert np.isnan(bound.excursion(speed)[0, 2])  # 1 m/s^2 leaves 0.245 m/s
    assert bound.excursion(speed)[1, 2] == pytest.approx(0.02)
    assert bound.least_contact_speed.shape == (2, 1)


def test_where_nothing_needs_to_be_done_the_excursion_is_zero() -> None:
    bound = PhysicalBound(distance=0.05, velocity=-0.4, acceleration_limit=1.0)
    assert bound.excursion(0.4) == 0.0
    assert bound.excursion(1.0) == 0.0
    stops = PhysicalBound(distance=0.5, velocity=-0.4, acceleration=0.2, acceleration_limit=1.0)
    assert stops.excursion(0.0) == 0.0  # the obstacle comes to rest 0.1 m away


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({"plant": Plant(velocity=-0.1)}, {"argument": "scenario"}),
        ({"plant": Plant(position=-0.01)}, {"argument": "scenario"}),
        ({"reference": Reference(velocity=0.1)}, {"argument": "scenario"}),
        ({"obstacle": Obstacle(position=0.04, velocity=0.1)}, {"argument": "scenario"}),
        ({"obstacle": Obstacle(position=0.04, velocity=[-0.1, -0.2])}, {"argument": "scenario"}),
    ],
)
def test_encounters_that_the_bound_does_not_speak_of_are_refused(change: dict, fields: dict[str, Any]) -> None:
    given = {"admittance": ADMITTANCE, "obstacle": Obstacle(position=0.04, velocity=-0.3), **change}
    with refused(**fields):
        find_physical_bound(Scenario(**given), acceleration_limit=1.0)


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({"distance": 0.0}, {"argument": "distance", "value": 0.0}),
        ({"velocity": 0.0}, {"argument": "velocity", "value": 0.0}),
        ({"acceleration_limit": 0.0}, {"argument": "acceleration_limit", "value": 0.0}),
        ({"speed_limit": -1.0}, {"argument": "speed_limit", "value": -1.0}),
    ],
)
def test_a_bound_that_makes_no_sense_is_refused(change: dict, fields: dict[str, Any]) -> None:
    with refused(**fields):
        PhysicalBound(**{"distance": 0.1, "velocity": -0.3, "acceleration_limit": 1.0, **change})
    with refused("contact_speed", value=-0.1):
        PhysicalBound(distance=0.1, velocity=-0.3, acceleration_limit=1.0).excursion(-0.1)


def test_the_bound_of_an_encounter_is_that_of_its_obstacle(letter_encounter: Scenario) -> None:
    bound = find_physical_bound(letter_encounter, acceleration_limit=2.0, speed_limit=0.1)
    assert (bound.distance, bound.velocity, bound.acceleration) == (0.0422, -0.3, 0.0)
    assert bound.least_contact_speed == pytest.approx(0.2, rel=1e-12)
    free = find_contact(letter_encounter, ExponentialFirstOrder(scale=1.0, rate=-60.0), 0.0).end
    assert bound.excursion(abs(free.relative_velocity) * (1 + 1e-12)) == 0.0
