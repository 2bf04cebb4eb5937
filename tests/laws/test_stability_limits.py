"""How fast a sensor must be: the limits of the sampled loop, against what is known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import butter

import pretouch as pt
from pretouch import control
from pretouch.simulation.linear_loop import linear_loop
from pretouch.simulation.plant import linear_plant

MASS = pt.Admittance(mass=1.3, damping=0.0, stiffness=0.0)
LETTER = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
PLANTS = (
    pt.IdealPlant(),
    pt.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0),
    pt.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=50.0, feedforward=False),
    pt.PositionPlant(mass=2.0, bandwidth=20.0),
)
GRID = [(rate, part) for rate in (15.0, 60.0, 250.0, 1000.0) for part in (0.0, 0.3, 1.0, 2.7)]


@pytest.mark.parametrize("rate", [1.0, 15.0, 250.0, 10_000.0])
def test_a_mass_alone_is_stable_up_to_twice_mass_times_rate(rate: float) -> None:
    """By Jury's test of z^2 - (1 - b/2) z + b/2 with b = d T / M: stable for b < 2."""
    limit = pt.largest_damping(MASS, pt.LoopTiming(rate=rate))
    assert limit.damping == pytest.approx(2 * 1.3 * rate, rel=1e-9)
    assert limit.frequency == pytest.approx(rate / 4, rel=1e-6)  # z^2 + 1 = 0 there
    assert limit.is_certified


@pytest.mark.parametrize("delay", [0.002, 0.05])
def test_a_delay_alone_leaves_pi_half_of_mass_over_delay(delay: float) -> None:
    """M v' = -d v(t - tau) oscillates at d tau / M = pi/2; difference and hold delay by half a period each."""
    for parts, error in ((50, 2e-3), (200, 2e-4)):  # what is left is of the second order in T / tau
        rate = parts / delay
        limit = pt.largest_damping(MASS, pt.LoopTiming(rate=rate, delay=delay))
        assert limit.damping == pytest.approx(math.pi / 2 * 1.3 / (delay + 1 / rate), rel=error)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(("rate", "part"), GRID)
def test_eigenvalues_cross_the_unit_circle_at_the_limit_and_not_before(
    rate: float, part: float, plant: pt.IdealPlant
) -> None:
    timing = pt.LoopTiming(rate=rate, delay=part / rate)
    limit = pt.largest_damping(LETTER, timing, plant=plant)
    assert limit.is_certified
    loop = linear_loop(*linear_plant(LETTER, plant), timing)
    for share in (0.05, 0.3, 0.6, 0.9):
        assert np.abs(np.linalg.eigvals(loop.closed(share * limit.damping))).max() < 1
    values = np.linalg.eigvals(loop.closed(limit.damping))
    angle = 2 * math.pi * limit.frequency / rate
    # rounding moves an eigenvalue of a matrix that is not normal by some 1e-16 times its condition
    assert np.abs(values - np.exp(1j * angle)).min() < 1e-7


def test_a_filter_lowers_the_limit_an_average_and_a_short_push_raise_it() -> None:
    rate = 200.0
    plain = pt.largest_damping(LETTER, pt.LoopTiming(rate=rate, delay=0.0025)).damping
    averaged = pt.largest_damping(LETTER, pt.LoopTiming(rate=rate, delay=0.0025, exposure=0.005)).damping
    sections = butter(2, 60.0, fs=rate, output="sos")
    filtered = pt.largest_damping(LETTER, pt.LoopTiming(rate=rate, delay=0.0025, sections=sections)).damping
    short = pt.largest_damping(LETTER, pt.LoopTiming(rate=rate, delay=0.0025, hold=0.0005)).damping
    assert filtered < plain < short  # a short push comes earlier on average
    # an average has the phase of its middle and weakens the oscillation, by some sinc(f E) with f near 30 Hz
    assert plain < averaged < 1.1 * plain


def test_the_limit_scales_with_the_masses_and_falls_with_the_delay() -> None:
    timing = pt.LoopTiming(rate=120.0, delay=0.004)
    heavy = pt.Admittance(mass=7.0, damping=70.0, stiffness=175.0)
    assert pt.largest_damping(heavy, timing).damping == pytest.approx(7 * pt.largest_damping(LETTER, timing).damping)
    limits = [pt.largest_damping(LETTER, pt.LoopTiming(rate=120.0, delay=d)).damping for d in (0, 0.001, 0.01, 0.1)]
    assert limits == sorted(limits, reverse=True)


def test_the_gain_limit_is_the_damping_over_the_slope(letter_power: pt.InversePower) -> None:
    distance = np.linspace(0, 0.0422, 9)
    limit = pt.gain_limit(letter_power, LETTER, pt.LoopTiming(rate=60.0), distance=distance)
    assert limit.gain * letter_power.log_slope(distance) == pytest.approx(np.full(9, limit.damping.damping))
    assert limit.critical_distance == 0.0  # where the curve is steepest
    assert limit.strongest == pytest.approx(limit.damping.damping / letter_power.log_slope(0.0))


def test_the_lowest_rate_is_where_the_gain_limit_is_the_gain(letter_power: pt.InversePower) -> None:
    distance = np.linspace(0, 0.0422, 9)
    for delay in (0.0, 0.006):
        timing_at = lambda rate, delay=delay: pt.LoopTiming(rate=rate, delay=delay)  # noqa: E731
        for margin in (1.0, 2.0):
            rate = pt.lowest_rate(letter_power, LETTER, -0.75, distance=distance, timing_at=timing_at, margin=margin)
            limit = pt.gain_limit(letter_power, LETTER, timing_at(rate), distance=distance)
            assert limit.strongest == pytest.approx(-0.75 * margin, rel=1e-6)


def test_no_rate_makes_up_for_a_long_delay(letter_power: pt.InversePower) -> None:
    """d tau / M = 59 x 0.1 > pi/2, and the damping of 10 N s/m does not save it."""
    timing_at = lambda rate: pt.LoopTiming(rate=rate, delay=0.1)  # noqa: E731
    assert pt.lowest_rate(letter_power, LETTER, -0.75, distance=0.0, timing_at=timing_at) == math.inf


def test_the_limit_bounds_a_design(letter_power: pt.InversePower, letter_encounter: pt.Scenario) -> None:
    """At 15 Hz without any delay the ideal optimum of -0.746 N s is unstable; the design stays at the bound."""
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    limit = pt.gain_limit(letter_power, LETTER, pt.LoopTiming(rate=15.0), distance=np.linspace(0, 0.0422, 33))
    bounds = limit.bounds(margin=2.0)
    design = pt.design_gain(letter_encounter, letter_power, objective, bounds=bounds)
    assert design.gain == pytest.approx(limit.strongest / 2)
    fast = pt.gain_limit(letter_power, LETTER, pt.LoopTiming(rate=1000.0), distance=np.linspace(0, 0.0422, 33))
    design = pt.design_gain(letter_encounter, letter_power, objective, bounds=fast.bounds())
    assert design.gain == pytest.approx(-0.7463, abs=1e-4)


def test_a_timing_follows_from_chain_and_controller() -> None:
    controller = control.Controller(
        period=1e-3,
        conditioning=control.Conditioning(floor=1e-3, sensor_period=0.01, low_pass_order=2, cutoff=20.0),
        law=control.VirtualDamper(gain=-0.7),
        admittance=control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    timing = pt.timing_of(pt.SensorChain(rate=100.0, exposure=0.002, delay=0.0004), controller)
    assert timing.delay == pytest.approx(0.002)  # 1 ms after the middle, 0.4 ms, 0.6 ms until the step at 3 ms
    assert timing.holding == 0.01
    assert np.array(timing.sections) == pytest.approx(butter(2, 20.0, fs=100.0, output="sos"))
    loose = pt.timing_of(pt.SensorChain(rate=97.3, delay=0.0004), controller)
    assert loose.delay == pytest.approx(0.0009)  # half a step on average
