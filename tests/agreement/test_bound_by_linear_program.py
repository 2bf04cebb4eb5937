"""The physical bound against optimal control: the best motions of linear programs, and motions followed in steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linprog

from pretouch.designs import PhysicalBound

STEPS = 60


def fastest_retreat(duration: float, excursion: float, acceleration: float, speed: float) -> float | None:
    """The largest speed away from the obstacle at `duration`, `excursion` behind the start, of any piecewise constant
    acceleration from rest that never leaves the start toward the obstacle; None where there is no such motion."""
    h = duration / STEPS
    velocity = h * np.tril(np.ones((STEPS, STEPS)))  # at the end of each step, per unit of acceleration in each
    ages = np.arange(STEPS)[:, None] - np.arange(STEPS)[None, :]
    position = np.where(ages >= 0, h**2 * (ages + 0.5), 0.0)
    limits = [position[:-1]]  # x <= 0 where a step ends
    right = [np.zeros(STEPS - 1)]
    if math.isfinite(speed):
        limits.append(-velocity)
        right.append(np.full(STEPS, speed))
    found = linprog(
        velocity[-1],  # the most negative velocity at the end
        A_ub=np.concatenate(limits),
        b_ub=np.concatenate(right),
        A_eq=position[-1:],
        b_eq=[-excursion],
        bounds=[(-acceleration, acceleration)] * STEPS,
        method="highs",
    )
    return -found.fun if found.status == 0 else None


def arrival(bound: PhysicalBound, excursion: float) -> tuple[float, float]:
    """When the obstacle is `excursion` behind the start, and how fast it is there."""
    a, v, room = bound.acceleration, bound.velocity, bound.distance + excursion
    roots = np.roots([a / 2, v, room]) if a else np.array([-room / v])
    time = min(r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 0)
    return time, -(v + a * time)


@pytest.mark.parametrize("obstacle_acceleration", [0.0, -1.5, 0.6])
@pytest.mark.parametrize("seed", range(6))
def test_no_motion_of_a_linear_program_needs_less_excursion(obstacle_acceleration: float, seed: int) -> None:
    """With steps of h, the program's best speed s lies within s^2 = 2 A (d -+ A h^2 / 8): the best start of the retreat
    lies within a step, and between the ends of a step a motion may bulge by A h^2 / 8 past the start."""
    random = np.random.default_rng(seed)
    limit = float(random.uniform(1.0, 10.0))
    bound = PhysicalBound(
        distance=float(random.uniform(0.05, 0.2)),
        velocity=-float(random.uniform(0.5, 1.0)),
        acceleration=obstacle_acceleration,
        acceleration_limit=limit,
    )
    least, highest = bound.least_contact_speed, arrival(bound, 0.0)[1]
    w = least + float(random.uniform(0.05, 0.95)) * (highest - least)
    excursion = bound.excursion(w)
    time, speed = arrival(bound, excursion)
    assert bound.time(w) == pytest.approx(time, rel=1e-9)
    best = fastest_retreat(time, excursion, limit, math.inf)
    assert best is not None
    slack = limit * (time / STEPS) ** 2 / 8
    assert math.sqrt(max(2 * limit * (excursion - slack), 0)) <= best * (1 + 1e-7)
    assert best <= math.sqrt(2 * limit * (excursion + slack)) * (1 + 1e-7)
    assert speed - math.sqrt(2 * limit * excursion) == pytest.approx(w, rel=1e-9)


@pytest.mark.parametrize("obstacle_acceleration", [0.0, -1.5, 0.6])
def test_the_least_contact_speed_is_where_the_linear_program_ends_to_have_motions(obstacle_acceleration: float) -> None:
    bound = PhysicalBound(distance=0.03, velocity=-0.8, acceleration=obstacle_acceleration, acceleration_limit=4.0)
    least = bound.least_contact_speed
    assert least > 0
    excursion = bound.excursion(least)
    assert math.isnan(bound.excursion(least - 1e-6))
    time, speed = arrival(bound, excursion)
    assert speed - 4.0 * time == pytest.approx(least, rel=1e-9)  # retreating all the way
    assert fastest_retreat(time * (1 + 1e-6), excursion, 4.0, math.inf) is not None
    farther = excursion * 1.01
    assert fastest_retreat(arrival(bound, farther)[0], farther, 4.0, math.inf) is None


@pytest.mark.parametrize("obstacle_acceleration", [0.0, -1.5, 0.6])
@pytest.mark.parametrize("speed_limit", [0.1, 0.35, 2.0])
@pytest.mark.parametrize("distance", [0.03, 0.2])
def test_with_a_largest_speed_the_bound_is_the_least_place_at_which_the_program_is_as_gentle(
    obstacle_acceleration: float, speed_limit: float, distance: float
) -> None:
    """For contact speeds over the whole range: a little before the bound's place no motion will do, a little behind it
    one does (by what a step of the program may amount to)."""
    limit = 4.0
    bound = PhysicalBound(
        distance=distance,
        velocity=-0.6,
        acceleration=obstacle_acceleration,
        acceleration_limit=limit,
        speed_limit=speed_limit,
    )
    least = bound.least_contact_speed
    highest = arrival(bound, 0.0)[1]
    if least == 0.0:
        assert np.isfinite(bound.excursion(0.0))
    else:
        assert math.isnan(bound.excursion(least - 1e-6))
    for w in least + (highest - least) * np.array([0.02, 0.3, 0.6, 0.9]):
        excursion = bound.excursion(w)
        for factor, reached in ((0.93, False), (1.0 + 1e-6, True)):
            place = factor * excursion
            time, speed = arrival(bound, place)
            slack = limit * time / STEPS  # of a speed, within a step
            best = fastest_retreat(time, place, limit, speed_limit)
            if reached:
                assert best is not None
                assert speed - best <= w + slack
            else:
                assert best is None or speed - best > w - slack


@pytest.mark.parametrize("obstacle_acceleration", [0.0, -1.5, 0.6])
def test_the_best_motion_followed_in_small_steps_arrives_with_that_speed(obstacle_acceleration: float) -> None:
    """Rest, then retreat. Steps of h = 1e-6 s are exact for constant accelerations. It begins up to h late: the
    relative speed is A h higher, which over tau < 0.2 s is 1e-6 m, and at w >= 0.05 m/s contact is 2e-5 s earlier."""
    bound = PhysicalBound(distance=0.05, velocity=-0.5, acceleration=obstacle_acceleration, acceleration_limit=3.0)
    least = max(bound.least_contact_speed, 0.05)
    for w in (1.1 * least, 0.5 * (least + 0.5)):
        excursion, end = bound.excursion(w), bound.time(w)
        begin = end - math.sqrt(2 * excursion / 3.0)
        h, t, x, u = 1e-6, 0.0, 0.0, 0.0
        while 0.05 - 0.5 * t + obstacle_acceleration * t**2 / 2 - x > 0:
            a = -3.0 if t >= begin else 0.0
            x, u, t = x + h * u + h * h * a / 2, u + h * a, t + h
        assert -x == pytest.approx(excursion, abs=2e-5)
        assert abs(-0.5 + obstacle_acceleration * t - u) == pytest.approx(w, abs=1e-4)
