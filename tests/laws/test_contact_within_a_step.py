"""The contact is the first zero of the motion within a step of the loop, even for a very short dip below zero."""

from __future__ import annotations

import math
from ctypes import byref
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.native import DOUBLE, POINTER, kernel
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0)
CONTACT = pt.simulation.SpringDamper(stiffness=3e4, damping=60.0)
ROBOTS: dict[str, dict[str, Any]] = {"ideal": {}, "with a mass": {"plant": ROBOT, "contact": CONTACT}}
EPS = 2.2e-16
COURSES = {name: kernel(name, *[DOUBLE] * 5, POINTER, result=DOUBLE) for name in ("cubic", "first_touch")}


def law(period: float, gain: float = 0.0) -> Controller:
    return Controller(
        period=period,
        conditioning=Conditioning(floor=1e-9),
        law=VirtualDamper(gain=gain),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )


def of_course(name: str, *given: float) -> tuple[float, float]:
    beside = DOUBLE()
    return float(COURSES[name](*given, byref(beside))), beside.value


def cubic(start: float, start_slope: float, end: float, end_slope: float, s: float) -> tuple[float, float]:
    """The cubic through both ends of a step, and its slope, at the part s; slopes are over the whole step."""
    return of_course("cubic", start, start_slope, end, end_slope, s)


def first_touch(start: float, start_slope: float, end: float, end_slope: float, doubt: float) -> tuple[float, float]:
    """Where it first comes to zero, or closer than `doubt`, 2 where it does not; and the least that it comes to."""
    return of_course("first_touch", start, start_slope, end, end_slope, doubt)


def towards(position: Any, velocity: Any, acceleration: Any) -> pt.Scenario:
    obstacle = pt.Obstacle(position=position, velocity=velocity, acceleration=acceleration)
    return pt.Scenario(admittance=ADMITTANCE, obstacle=obstacle)


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
@pytest.mark.parametrize("period", [0.03, 0.02, 0.001])
def test_a_dip_between_two_steps_is_a_contact(period: float, robot: dict[str, Any]) -> None:
    """l = 0.0499 - t + 5 t^2 is below 0 for 9 ms, after t = (1 - sqrt(0.002)) / 10, with l' = -sqrt(0.002)."""
    run = pt.simulation.simulate_loop(towards(0.0499, -1.0, 10.0), SENSOR, law(period), **robot)
    assert run.status is pt.motion.ContactStatus.CONTACT
    # l is rounded to EPS, the time of its zero to that over l'; Runge-Kutta's sums add some
    assert run.time == pytest.approx((1 - math.sqrt(0.002)) / 10, abs=1e3 * EPS)
    assert run.relative_velocity == pytest.approx(-math.sqrt(0.002), abs=1e4 * EPS)
    assert run.contacts == 1
    assert (run.peak_force > 0) == bool(robot)


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_what_does_not_come_to_zero_between_two_steps_is_none(robot: dict[str, Any]) -> None:
    """l = 0.0501 - t + 5 t^2 comes down to 0.1 mm at 0.1 s; without a mass the cubic is the motion, at any step."""
    for period in (0.03, 0.001):
        run = pt.simulation.simulate_loop(towards(0.0501, -1.0, 10.0), SENSOR, law(period), horizon=0.3, **robot)
        assert run.status is pt.motion.ContactStatus.HORIZON
        assert run.contacts == 0
        assert run.closest_distance == pytest.approx(1e-4, abs=1e3 * EPS)


def test_every_run_of_many_and_every_way_to_run_them_finds_the_same_contacts() -> None:
    scenes = towards(np.array([0.0499, 0.0501, 0.5, 0.0499]), -1.0, np.array([10.0, 10.0, 1.0, 9.0]))
    controller, chain = law(0.03), pt.SensorChain(rate=1 / 0.03)
    loop = pt.ClosedLoop(law=controller, chain=chain, horizon=2.0)
    many = pt.simulation.simulate_loop(scenes, SENSOR, controller, runs=3, horizon=2.0)
    alike = loop(scenes, SENSOR, 0.0)
    expected = [
        pt.motion.ContactStatus.CONTACT,
        pt.motion.ContactStatus.HORIZON,
        pt.motion.ContactStatus.CONTACT,
        pt.motion.ContactStatus.CONTACT,
    ]
    assert many.status.tolist() == [expected] * 3
    assert np.asarray(alike.status).tolist() == expected
    assert np.array_equal(many.time[1], loop.run(scenes, SENSOR, 0.0).time, equal_nan=True)
    assert np.array_equal(many.time[0][many.touched[0]], np.asarray(alike.end.time)[many.touched[0]])
    for i in (0, 3):
        one = pt.simulation.simulate_loop(towards(0.0499, -1.0, (10.0, 10.0, 1.0, 9.0)[i]), SENSOR, controller)
        assert one.time == many.time[0, i]
        assert one.relative_velocity == many.relative_velocity[0, i]


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
@pytest.mark.parametrize("period", [0.03, 1e-3, 1 / 3000, 7e-4])
@pytest.mark.parametrize(("offset", "touched"), [(0.0, True), (2e-13, True), (-2e-13, True), (2e-10, False)])
def test_a_distance_that_comes_to_zero_within_the_resolution_is_a_touch(
    offset: float, touched: bool, period: float, robot: dict[str, Any]
) -> None:
    """l = (1 - t)^2 / 2 touches at 1 s. Its terms add up to 2 m there, of which 1e-12 is not told from zero."""
    run = pt.simulation.simulate_loop(towards(0.5 + offset, -1.0, 1.0), SENSOR, law(period), horizon=3.0, **robot)
    assert run.touched == touched
    if touched:
        lead = math.sqrt(2 * 2e-12) + math.sqrt(2 * 2e-13)  # of l = resolution, at which a step may end, or of l = 0
        assert run.time == pytest.approx(1.0, abs=lead)
        assert abs(run.relative_velocity) < lead


def test_the_velocity_at_contact_is_the_slope_of_the_motion_within_the_step() -> None:
    """A plant that falls to its reference without a force, x = A (1 - (1 + 5 t) exp(-5 t)), meets walls on its way.

    A cubic through both ends of a step T with the slopes there is off by T^4 / 384 max |x''''| at most, its slope by
    sqrt(3) / 216 T^3 max |x''''|, with |x''''| <= 1875 A. A line between the velocities is off by up to T^2 / 8 |x'''|,
    with |x'''| >= 65 A where the walls are.
    """
    amplitude, period = 0.2, 0.01
    walls = amplitude * np.linspace(0.05, 0.2, 40)
    scenario = pt.Scenario(
        admittance=ADMITTANCE,
        obstacle=pt.Obstacle(position=walls),
        reference=pt.Reference(position=amplitude),
    )
    run = pt.simulation.simulate_loop(scenario, SENSOR, law(period))
    assert bool(run.touched.all())
    t = run.time
    motion = amplitude * (1 - (1 + 5 * t) * np.exp(-5 * t))
    speed = 25 * amplitude * t * np.exp(-5 * t)
    assert np.abs(motion - walls).max() <= period**4 / 384 * 1875 * amplitude + 10 * EPS
    slope_error = math.sqrt(3) / 216 * period**3 * 1875 * amplitude
    # the slope is that at the cubic's own zero, which comes earlier or later by the error of its value over the speed
    shift = period**4 / 384 * 1875 * amplitude / speed.min() * 25 * amplitude
    assert np.abs(run.relative_velocity + speed).max() <= slope_error + shift
    assert slope_error + shift < 0.1 * period**2 / 8 * 65 * amplitude


def hermite(start: Any, start_slope: float, end: float, end_slope: float, s: Any) -> Any:
    """The same cubic by its basis."""
    rest = 1 - s
    values = start * rest * rest * (1 + 2 * s) + end * s * s * (1 + 2 * rest)
    return values + start_slope * s * rest * rest - end_slope * s * s * rest


RNG = np.random.default_rng(11)
CUBICS = RNG.normal(size=(4000, 4)) * 10.0 ** RNG.integers(-3, 2, size=(4000, 4))


def test_the_first_zero_of_any_cubic_is_found() -> None:
    """Beside the roots of the polynomial: what is found is a zero, and before it the cubic is above zero."""
    missed = found = 0
    for gap, slope, end, end_slope in CUBICS:
        start = abs(gap)
        rise = end - start
        terms = [slope + end_slope - 2 * rise, 3 * rise - 2 * slope - end_slope, slope, start]
        scale = float(np.abs(terms).sum())
        roots = np.roots(terms)
        real = roots[np.abs(roots.imag) < 1e-7].real  # where two meet, each is off by the root of rounding
        inside = np.sort(real[(real > 0) & (real <= 1)])
        part, least = first_touch(start, slope, end, end_slope, 1e-12 * scale)
        along = hermite(start, slope, end, end_slope, np.linspace(0, min(part, 1.0), 301))
        if part <= 1:
            found += 1
            assert abs(hermite(start, slope, end, end_slope, part)) <= 1e-12 * scale
            assert along[:-1].min() > -1e-12 * scale
            assert np.abs(inside - part).min() < 1e-5
        else:
            missed += 1
            assert along.min() > 1e-12 * scale
            assert least == pytest.approx(along.min(), abs=scale / 300**2 * 6)  # between samples: step^2 / 8 times l''
            assert least <= along.min() + 1e-12 * scale
    assert min(found, missed) > 500


def test_a_distance_that_only_rises_from_zero_is_no_touch() -> None:
    """As that of two bodies right after they have parted."""
    assert first_touch(1e-15, 1e-3, 1e-3, 1e-3, 1e-12)[0] == 2
    assert first_touch(0.0, 1e-12, 5e-13, 1e-13, 1e-12)[0] == 2
    assert first_touch(1e-15, -1e-3, 1e-3, 1e-3, 1e-12)[0] < 1e-6  # pressed together again at once


def test_the_slope_of_a_cubic_is_that_of_its_values() -> None:
    """Differences over 2e-5 of cubics of 1: off by rounding, EPS / 1e-5, and by the third derivative's 1e-10."""
    for s in (0.1, 0.5, 0.9):
        difference = (hermite(0.3, -1.0, 0.2, 0.4, s + 1e-5) - hermite(0.3, -1.0, 0.2, 0.4, s - 1e-5)) / 2e-5
        value, slope = cubic(0.3, -1.0, 0.2, 0.4, s)
        assert value == pytest.approx(hermite(0.3, -1.0, 0.2, 0.4, s), abs=4 * EPS)
        assert slope == pytest.approx(difference, abs=1e-9)
