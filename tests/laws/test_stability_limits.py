"""How fast a sensor must be: the limits of the sampled loop, against what is known in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, freqz_sos

import pretouch as pt
from lifted_loop import lifted_radius
from pretouch import control
from pretouch.simulation.linear_loop import linear_loop, zero_between
from pretouch.simulation.robot import linear_plant
from refusals import refused

MASS = pt.Admittance(mass=1.3, damping=0.0, stiffness=0.0)
LETTER = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
PLANTS = (
    pt.simulation.IdealPlant(),
    pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0),
    pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=50.0, feedforward=False),
    pt.simulation.PositionPlant(mass=2.0, bandwidth=20.0),
)
GRID = [(rate, part) for rate in (15.0, 60.0, 250.0, 1000.0) for part in (0.0, 0.3, 1.0, 2.7)]


@pytest.mark.parametrize("rate", [1.0, 15.0, 250.0, 10_000.0])
def test_a_mass_alone_is_stable_up_to_twice_mass_times_rate(rate: float) -> None:
    """By Jury's test of z^2 - (1 - b/2) z + b/2 with b = d T / M: stable for b < 2."""
    limit = pt.simulation.largest_damping(MASS, pt.simulation.LoopTiming(rate=rate))
    assert limit.damping == pytest.approx(2 * 1.3 * rate, rel=1e-9)
    assert limit.frequency == pytest.approx(rate / 4, rel=1e-6)  # z^2 + 1 = 0 there
    assert limit.is_certified


@pytest.mark.parametrize("delay", range(7))
@pytest.mark.parametrize("hold", range(1, 6))
def test_a_mass_behind_whole_periods_of_delay_and_hold(delay: int, hold: int) -> None:
    """1 + d T / (2 q M) (z + 1)(1 - z^-q) z^-p / (z - 1)^2 = 0 for p periods of delay and q of hold.

    On the unit circle its phase is -pi/2 - omega T (p + (q + 1)/2), which is -pi at omega T = pi / (2 p + q + 1).
    """
    rate = 100.0
    limit = pt.simulation.largest_damping(
        MASS, pt.simulation.LoopTiming(rate=rate, delay=delay / rate, hold=hold / rate)
    )
    w = math.pi / (2 * delay + hold + 1)
    expected = 2 * hold * 1.3 * rate * math.tan(w / 2) * math.sin(w / 2) / math.sin(hold * w / 2)
    assert limit.damping == pytest.approx(expected, rel=1e-9)  # rounding of the root, some 1e-14 / w
    assert limit.frequency == pytest.approx(w * rate / (2 * math.pi), rel=1e-9)
    assert limit.is_certified


RNG = np.random.default_rng(20)
PARTS = [
    (8 / 3, 2 / 3),
    *((p / q, h / q) for q in (2, 3, 5, 7) for p, h in ((0, 1), (1, 2), (q, q - 1), (3 * q + 1, q))),
]
PARTS += [tuple(pair) for pair in RNG.uniform((0.0, 0.05), (5.0, 3.0), (8, 2))]


@pytest.mark.slow(keep=4)
@pytest.mark.parametrize(
    ("rate", "delay", "hold"),
    [*((100.0, *parts) for parts in PARTS), (0.2, 1.3, 0.9), (2e4, 2.0, 1.0), (2e4, 3.4, 0.3)],
)
@pytest.mark.parametrize(("damping", "stiffness"), [(0.0, 0.0), (0.0, 0.04), (0.5, 0.0), (0.5, 0.04)])
def test_the_loop_put_together_anew_is_stable_below_the_limit_and_not_above(
    damping: float, stiffness: float, rate: float, delay: float, hold: float
) -> None:
    """Damping and stiffness in units of M / T and M / T^2; eigenvalues of matrices of this size are good to 1e-10."""
    admittance = pt.Admittance(mass=1.3, damping=1.3 * rate * damping, stiffness=1.3 * rate**2 * stiffness)
    exposure = min(2 * delay, 1.0) / 2
    timing = pt.simulation.LoopTiming(rate=rate, delay=delay / rate, hold=hold / rate, exposure=exposure / rate)
    limit = pt.simulation.largest_damping(admittance, timing)
    assert limit.is_certified
    if limit.damping == 0:
        assert lifted_radius(admittance, timing, 1e-6 * 1.3 * rate) > 1
        return
    for share in (1e-3, 0.1, 0.5, 0.9, 0.999):
        assert lifted_radius(admittance, timing, share * limit.damping) < 1 + 1e-10
    assert lifted_radius(admittance, timing, 1.001 * limit.damping) > 1


@pytest.mark.parametrize("delay", [0.0, 1.0, 2.0, 2.5, 3.9, 4.2, 6.0, 9.0, 11.9, 12.1, 14.5])
def test_a_spring_without_damping_must_be_pushed_in_time(delay: float) -> None:
    """A weak force -d x'(t - theta) takes energy from x = cos(omega t) in proportion to cos(omega theta).

    Difference and hold delay by half a period each, exactly: both are symmetric. Beyond a quarter of the oscillation
    any force of a reading feeds it, beyond three quarters it damps again.
    """
    rate, turn = 100.0, 0.3  # omega T
    spring = pt.Admittance(mass=2.0, damping=0.0, stiffness=2.0 * (turn * rate) ** 2)
    limit = pt.simulation.largest_damping(spring, pt.simulation.LoopTiming(rate=rate, delay=delay / rate))
    assert (limit.damping > 0) == (math.cos(turn * (delay + 1)) > 0)
    assert limit.is_certified
    if limit.damping == 0:
        assert limit.frequency == pytest.approx(turn * rate / (2 * math.pi), rel=1e-12)


def test_a_robot_that_is_unstable_by_itself_has_a_limit_of_zero(letter_power: pt.InversePower) -> None:
    """Routh: m s^2 + (D s + K) / (1 + s / b) is stable for D b > K; feedforward is outside of that loop."""
    plant = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=3.0)
    assert 180.0 * 2 * math.pi * 3.0 < 4000.0
    limit = pt.simulation.gain_limit(
        letter_power, LETTER, pt.simulation.LoopTiming(rate=250.0), distance=[0.0, 0.02], plant=plant
    )
    assert limit.damping.damping == 0
    assert limit.damping.is_certified
    assert limit.strongest == 0
    with refused("weakest", value=-0.001, limit=(0.0, -0.0)):
        limit.bounds()
    assert pt.simulation.lowest_rate(letter_power, LETTER, -0.1, distance=0.0, plant=plant) == math.inf


@pytest.mark.slow
def test_a_spring_behind_hundreds_of_periods_of_delay_has_the_smallest_of_its_many_limits() -> None:
    """The force turns by a hundred radians over the resonance, and each turn has a limit; the smallest one counts."""
    admittance = pt.Admittance(mass=1.3, damping=6.8, stiffness=1777.0)
    timing = pt.simulation.LoopTiming(rate=78.0, delay=3.28)
    limit = pt.simulation.largest_damping(admittance, timing).damping
    assert lifted_radius(admittance, timing, 0.9 * limit) < 1
    assert lifted_radius(admittance, timing, 1.01 * limit) > 1


@pytest.mark.parametrize("rate", [1e5, 1e7, 1e9])
def test_a_delay_of_thousands_of_periods_costs_no_more_than_a_short_one(rate: float) -> None:
    """What is left of the delay-differential limit is of the second order in T / tau = 1 / (0.02 rate)."""
    limit = pt.simulation.largest_damping(MASS, pt.simulation.LoopTiming(rate=rate, delay=0.02))
    assert limit.damping == pytest.approx(math.pi / 2 * 1.3 / (0.02 + 1 / rate), rel=(50 / rate) ** 2 + 1e-9)
    assert limit.is_certified  # by the one eigenvalue that crosses: the matrix would have 400 million rows
    spring = pt.Admittance(mass=1.3, damping=0.0, stiffness=30.0)
    assert (
        0
        < pt.simulation.largest_damping(spring, pt.simulation.LoopTiming(rate=rate, delay=0.02)).damping
        < limit.damping
    )


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.002, 0.05])
def test_a_delay_alone_leaves_pi_half_of_mass_over_delay(delay: float) -> None:
    """M v' = -d v(t - tau) oscillates at d tau / M = pi/2; difference and hold delay by half a period each."""
    for parts, error in ((50, 2e-3), (200, 2e-4)):  # what is left is of the second order in T / tau
        rate = parts / delay
        limit = pt.simulation.largest_damping(MASS, pt.simulation.LoopTiming(rate=rate, delay=delay))
        assert limit.damping == pytest.approx(math.pi / 2 * 1.3 / (delay + 1 / rate), rel=error)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(("rate", "part"), GRID)
def test_eigenvalues_cross_the_unit_circle_at_the_limit_and_not_before(
    rate: float, part: float, plant: pt.simulation.IdealPlant
) -> None:
    timing = pt.simulation.LoopTiming(rate=rate, delay=part / rate)
    limit = pt.simulation.largest_damping(LETTER, timing, plant=plant)
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
    plain = pt.simulation.largest_damping(LETTER, pt.simulation.LoopTiming(rate=rate, delay=0.0025)).damping
    averaged = pt.simulation.largest_damping(
        LETTER, pt.simulation.LoopTiming(rate=rate, delay=0.0025, exposure=0.005)
    ).damping
    sections = butter(2, 60.0, fs=rate, output="sos")
    filtered = pt.simulation.largest_damping(
        LETTER, pt.simulation.LoopTiming(rate=rate, delay=0.0025, sections=sections)
    ).damping
    short = pt.simulation.largest_damping(
        LETTER, pt.simulation.LoopTiming(rate=rate, delay=0.0025, hold=0.0005)
    ).damping
    assert filtered < plain < short  # a short push comes earlier on average
    # an average has the phase of its middle and weakens the oscillation, by some sinc(f E) with f near 30 Hz
    assert plain < averaged < 1.1 * plain


def test_the_limit_scales_with_the_masses_and_falls_with_the_delay() -> None:
    timing = pt.simulation.LoopTiming(rate=120.0, delay=0.004)
    heavy = pt.Admittance(mass=7.0, damping=70.0, stiffness=175.0)
    assert pt.simulation.largest_damping(heavy, timing).damping == pytest.approx(
        7 * pt.simulation.largest_damping(LETTER, timing).damping
    )
    limits = [
        pt.simulation.largest_damping(LETTER, pt.simulation.LoopTiming(rate=120.0, delay=d)).damping
        for d in (0, 0.001, 0.01, 0.1)
    ]
    assert limits == sorted(limits, reverse=True)


def test_the_gain_limit_is_the_damping_over_the_slope(letter_power: pt.InversePower) -> None:
    distance = np.linspace(0, 0.0422, 9)
    limit = pt.simulation.gain_limit(letter_power, LETTER, pt.simulation.LoopTiming(rate=60.0), distance=distance)
    assert limit.gain * letter_power.log_slope(distance) == pytest.approx(np.full(9, limit.damping.damping))
    assert limit.critical_distance == 0.0  # where the curve is steepest
    assert limit.strongest == pytest.approx(limit.damping.damping / letter_power.log_slope(0.0))


def test_the_lowest_rate_is_where_the_gain_limit_is_the_gain(letter_power: pt.InversePower) -> None:
    distance = np.linspace(0, 0.0422, 9)
    for delay in (0.0, 0.006):
        timing_at = lambda rate, delay=delay: pt.simulation.LoopTiming(rate=rate, delay=delay)  # noqa: E731
        for margin in (1.0, 2.0):
            rate = pt.simulation.lowest_rate(
                letter_power, LETTER, -0.75, distance=distance, timing_at=timing_at, margin=margin
            )
            limit = pt.simulation.gain_limit(letter_power, LETTER, timing_at(rate), distance=distance)
            assert limit.strongest == pytest.approx(-0.75 * margin, rel=1e-6)


@pytest.mark.parametrize("gain", [-0.3, -0.4086, -0.5])
def test_above_the_lowest_rate_every_rate_is_stable(letter_power: pt.InversePower, gain: float) -> None:
    """The limit has minima over the rate: at 1.5 and 6.0 Hz for this loop, where -0.1484 and -0.4085 N s are the limit.

    So a gain a little stronger than the second is unstable from 5.8 to 6.1 Hz, and stable again below.
    """
    strongest = lambda rate: pt.simulation.gain_limit(  # noqa: E731
        letter_power, LETTER, pt.simulation.LoopTiming(rate=rate, delay=5e-4), distance=0.0
    )
    timing_at = lambda rate: pt.simulation.LoopTiming(rate=rate, delay=5e-4)  # noqa: E731
    lowest = pt.simulation.lowest_rate(letter_power, LETTER, gain, distance=0.0, timing_at=timing_at)
    assert strongest(lowest * (1 - 1e-6)).strongest > gain  # the limit changes by some of itself per octave
    rates = lowest * np.geomspace(1 + 1e-6, 30.0, 40)
    assert max(strongest(float(rate)).strongest for rate in rates) < gain


def test_no_rate_makes_up_for_a_strong_gain_and_a_delay(letter_power: pt.InversePower) -> None:
    """At the fastest rate that is looked at, 4 MHz, the delay is 200,000 periods long."""
    timing_at = lambda rate: pt.simulation.LoopTiming(rate=rate, delay=0.05)  # noqa: E731
    assert pt.simulation.lowest_rate(letter_power, LETTER, -1e3, distance=0.0, timing_at=timing_at) == math.inf


def test_no_rate_makes_up_for_a_long_delay(letter_power: pt.InversePower) -> None:
    """d tau / M = 59 x 0.1 > pi/2, and the damping of 10 N s/m does not save it."""
    timing_at = lambda rate: pt.simulation.LoopTiming(rate=rate, delay=0.1)  # noqa: E731
    assert pt.simulation.lowest_rate(letter_power, LETTER, -0.75, distance=0.0, timing_at=timing_at) == math.inf


def test_the_limit_bounds_a_design(letter_power: pt.InversePower, letter_encounter: pt.Scenario) -> None:
    """At 15 Hz without any delay the ideal optimum of -0.746 N s is unstable; the design stays at the bound."""
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    limit = pt.simulation.gain_limit(
        letter_power, LETTER, pt.simulation.LoopTiming(rate=15.0), distance=np.linspace(0, 0.0422, 33)
    )
    bounds = limit.bounds(margin=2.0)
    design = pt.design(pt.Task(letter_encounter, letter_power, objective, bounds=bounds))
    assert design.gain == pytest.approx(limit.strongest / 2)
    fast = pt.simulation.gain_limit(
        letter_power, LETTER, pt.simulation.LoopTiming(rate=1000.0), distance=np.linspace(0, 0.0422, 33)
    )
    design = pt.design(pt.Task(letter_encounter, letter_power, objective, bounds=fast.bounds()))
    assert design.gain == pytest.approx(-0.7463, abs=1e-4)


@pytest.mark.parametrize(
    ("function", "ends", "zero", "calls"),
    [
        (lambda x: 3 * x - 1, (0.0, 1.0), 1 / 3, 2),
        (lambda x: x**3 - 2, (0.0, 2.0), 2 ** (1 / 3), 7),
        (lambda x: math.exp(x) - 3, (-2.0, 5.0), math.log(3), 9),
        (lambda x: math.atan(x - 0.3), (-10.0, 4.0), 0.3, 8),
        (lambda x: math.tanh(40 * (x - 0.71)), (0.0, 1.0), 0.71, 11),
        (lambda x: 1.0 if x > 0.3 else -1.0, (0.0, 1.0), 0.3, 45),
    ],
)
def test_a_zero_is_found_in_few_calls(function: Callable, ends: tuple[float, float], zero: float, calls: int) -> None:
    """Inverse interpolation gains a half more digits with every call; halving 1e-13 of the interval takes 43 to 47."""
    asked = []

    def counted(x: float) -> float:
        asked.append(x)
        return float(function(x))

    found = zero_between(counted, *((end, function(end)) for end in ends), tolerance=1e-13)  # type: ignore[arg-type]
    assert found == pytest.approx(zero, abs=1.1e-13)
    assert len(asked) <= calls


def test_a_timing_follows_from_chain_and_controller() -> None:
    controller = control.Controller(
        period=1e-3,
        conditioning=control.Conditioning(floor=1e-3, sensor_period=0.01, low_pass_order=2, cutoff=20.0),
        law=control.VirtualDamper(gain=-0.7),
        admittance=control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    timing = pt.simulation.timing_of(pt.SensorChain(rate=100.0, exposure=0.002, delay=0.0004), controller)
    assert timing.delay == pytest.approx(0.002)  # 1 ms after the middle, 0.4 ms, 0.6 ms until the step at 3 ms
    assert timing.holding == 0.01
    assert np.array(timing.sections) == pytest.approx(butter(2, 20.0, fs=100.0, output="sos"))
    loose = pt.simulation.timing_of(pt.SensorChain(rate=97.3, delay=0.0004), controller)
    # 10.28 steps per reading: after 18 readings the wait is the same again, and its mean is 1/36 of a step off the half
    assert loose.delay == pytest.approx(0.0004 + 0.5e-3 * (1 + 1 / 18))
    assert loose.delay_range == pytest.approx(1e-3 / 18)
    # a whole ratio keeps the wait of a run, which is anything up to a step where no phase is given
    free = pt.simulation.timing_of(pt.SensorChain(rate=100.0, delay=0.0004, random_phase=True), controller)
    assert (free.delay, free.delay_range) == pytest.approx((0.0014, 0.001))
    any_ratio = pt.simulation.timing_of(pt.SensorChain(rate=97.3, delay=0.0004), controller, worst_ratio=True)
    assert (any_ratio.delay, any_ratio.delay_range) == pytest.approx((0.0014, 0.001))


@pytest.mark.parametrize("window", range(2, 10))
def test_a_moving_average_has_the_response_of_its_formula(window: int, letter_power: pt.InversePower) -> None:
    """It delays by (N - 1) / 2 readings, and weakens, so that a delay alone bounds the gain from below."""
    controller = control.Controller(
        period=1e-3,
        conditioning=control.Conditioning(floor=1e-3, sensor_period=0.004, moving_average=window),
        law=control.VirtualDamper(gain=-0.7),
        admittance=control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    timing = pt.simulation.timing_of(pt.SensorChain(rate=250.0), controller)
    turn = np.linspace(0.05, 3.0, 40)
    _, response = freqz_sos(np.array(timing.sections), worN=turn)
    weight = np.sin(window * turn / 2) / (window * np.sin(turn / 2))
    np.testing.assert_allclose(response, weight * np.exp(-0.5j * (window - 1) * turn), atol=1e-14)
    admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
    late = replace(timing, sections=(), delay=timing.delay + (window - 1) / 2 / 250)
    exact, bound = (
        pt.simulation.gain_limit(letter_power, admittance, t, distance=0.0).strongest for t in (timing, late)
    )
    assert exact < bound < 0  # the delay alone allows less


def test_a_controller_that_is_slower_than_its_sensor_takes_the_newest_reading() -> None:
    """At half of the rate it is the loop of the controller's rate, whose readings wait for one of theirs at most."""
    controller = control.Controller(
        period=0.01,
        conditioning=control.Conditioning(floor=1e-3, median_window=3),
        law=control.VirtualDamper(gain=-0.7),
        admittance=control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    timing = pt.simulation.timing_of(pt.SensorChain(rate=200.0, delay=0.001, phase=0.001), controller)
    assert timing.rate == 100.0
    assert timing.delay == pytest.approx(0.001 + 0.003 + 0.01)  # 3 ms until the step at 5 or 10 ms, a median
    free = pt.simulation.timing_of(pt.SensorChain(rate=200.0, delay=0.001, random_phase=True), controller)
    assert (free.delay, free.delay_range) == pytest.approx((0.001 + 0.005 + 0.01, 0.005))


def test_the_worst_delay_of_a_range_may_be_the_shortest_or_between() -> None:
    """Beside a spring that is hardly damped, as a later push may damp again; 400 drawn loops are within 3 %."""
    period = 0.0766
    for stiffness, damping, delay, wait in ((51.7, 0.0, 2.0 * period, 0.1 * period), (89.5, 8.0, 0.006, 0.004)):
        spring = pt.Admittance(mass=1.0, damping=damping, stiffness=stiffness**2)
        rate = 1 / period if damping == 0 else 140.0
        limits = [
            pt.simulation.largest_damping(
                spring, pt.simulation.LoopTiming(rate=rate, delay=delay + part * wait)
            ).damping
            for part in np.linspace(0, 1, 33)
        ]
        timing = pt.simulation.LoopTiming(rate=rate, delay=delay + wait, delay_range=wait)
        found = pt.simulation.largest_damping(spring, timing)
        assert min(limits) < 0.999 * limits[-1] or damping
        assert found.damping == pytest.approx(min(limits), rel=0.03)
        assert delay * (1 - 1e-12) <= found.delay <= delay + wait
        assert found.is_certified


def test_a_range_of_delays_leaves_no_force_before_its_reading() -> None:
    with refused("delay_range", value=0.02, limit=0.01):
        pt.simulation.LoopTiming(rate=100.0, delay=0.01, delay_range=0.02)
    with refused("delay"):
        pt.simulation.LoopTiming(rate=100.0, delay=0.01, exposure=0.004, delay_range=0.009)


@pytest.mark.parametrize(("gain", "rate"), [(-1e4, 305e3), (-1e6, math.inf)])
def test_rates_are_sought_up_to_a_megahertz(gain: float, rate: float) -> None:
    """|D_p g| / (2 M) of a mass without delay; what is held for a millisecond has a thousand parts at a megahertz."""
    sensor = pt.ExponentialFirstOrder(scale=1.0, rate=-61.0)
    mass = pt.Admittance(mass=1.0, damping=0.0, stiffness=0.0)
    assert pt.simulation.lowest_rate(sensor, mass, gain, distance=0.0) == pytest.approx(
        rate, rel=1e-6
    )  # the root is sought to 1e-9
    held = pt.simulation.lowest_rate(
        sensor, mass, -1e6, distance=0.0, timing_at=lambda r: pt.simulation.LoopTiming(rate=r, hold=1e-3)
    )
    assert held == math.inf
