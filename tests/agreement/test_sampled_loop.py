"""The sampled loop compared with the continuous solution, the letter's table, its linear limit and SciPy."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from loop_samples import BareLaw, grows, simulated_limit
from pretouch import control
from refusals import refused

LETTER = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
VIRTUAL = control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)


def controller(gain: float, period: float, **conditioning: Any) -> control.Controller:
    return control.Controller(
        period=period,
        conditioning=control.Conditioning(floor=1e-9, **conditioning),
        law=control.VirtualDamper(gain=gain),
        admittance=VIRTUAL,
    )


def bare(gain: float, period: float, sensor_period: float) -> BareLaw:
    return BareLaw(gain, period, hold=sensor_period)


def full(gain: float, period: float, sensor_period: float) -> control.Controller:
    return controller(gain, period, sensor_period=sensor_period)


def limit_of(law: Any, chain: pt.SensorChain, guess: float, plant: Any = None, period: float | None = None) -> float:
    """The damping at which an oscillation neither grows nor decays; g = -1/m, so that the damping is -D_p."""
    sensor = pt.ExponentialFirstOrder(scale=1.0, rate=-1.0)
    scenario = pt.Scenario(admittance=LETTER, obstacle=pt.Obstacle(position=1.0), plant=pt.Plant(position=1e-4))
    step = chain.period / 20 if period is None else period

    def run(damping: float) -> float:
        horizon = 400 * chain.period
        return grows(
            pt.simulation.simulate_loop(
                scenario, sensor, law(-damping, step, chain.period), chain=chain, plant=plant, horizon=horizon
            )
        )

    return simulated_limit(run, guess)


@pytest.mark.slow
@pytest.mark.parametrize("law", [bare, full])
@pytest.mark.parametrize("rate", [15.0, 50.0, 1000.0])
@pytest.mark.parametrize("part", [0.0, 0.5, 2.5])
def test_the_stability_limit_is_that_of_the_simulation(law: Any, rate: float, part: float) -> None:
    """The goal is 5 %; the bisection ends at 0.14 %, and within 400 periods growth below 0.5 % of it goes unseen."""
    predicted = pt.simulation.largest_damping(LETTER, pt.simulation.LoopTiming(rate=rate, delay=part / rate)).damping
    found = limit_of(law, pt.SensorChain(rate=rate, delay=part / rate), predicted)
    assert found == pytest.approx(predicted, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    "plant",
    [
        pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=50.0),
        pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, feedforward=False),
        pt.simulation.PositionPlant(mass=2.0, bandwidth=20.0),
    ],
)
def test_the_limit_holds_with_a_robot_that_lags(plant: Any) -> None:
    predicted = pt.simulation.largest_damping(
        LETTER, pt.simulation.LoopTiming(rate=50.0, delay=0.01), plant=plant
    ).damping
    found = limit_of(bare, pt.SensorChain(rate=50.0, delay=0.01), predicted, plant)
    assert found == pytest.approx(predicted, rel=0.01)
    assert predicted < pt.simulation.largest_damping(LETTER, pt.simulation.LoopTiming(rate=50.0, delay=0.01)).damping


def test_the_limit_holds_with_exposure_and_filter() -> None:
    chain = pt.SensorChain(rate=100.0, exposure=0.008, delay=0.002)
    law = lambda gain, period, sensor_period: controller(  # noqa: E731
        gain, period, sensor_period=sensor_period, low_pass_order=3, cutoff=20.0
    )
    timing = pt.simulation.timing_of(chain, law(-1.0, 0.001, 0.01))
    predicted = pt.simulation.largest_damping(LETTER, timing).damping
    assert limit_of(law, chain, predicted, period=0.001) == pytest.approx(predicted, rel=0.01)


@pytest.mark.parametrize(
    ("rate", "step_rate", "printed"), [(250.0, 1000.0, -4.36), (250.0, 250.0, -2.64), (100.0, 100.0, -1.13)]
)
def test_where_the_phase_is_not_known_the_limit_is_that_of_the_worst_phase(
    rate: float, step_rate: float, printed: float, letter_power: pt.InversePower
) -> None:
    """A whole ratio keeps the wait of a run: each phase has a limit of its own, which the simulation has as well."""
    period, part = 1 / step_rate, pt.simulation.sensor_part("VCNL4010").chain
    chain = pt.SensorChain(rate=rate, exposure=part.exposure, delay=part.delay)
    law = lambda gain, _, sensor_period: full(gain, period, sensor_period)  # noqa: E731
    timed = law(-1.0, period, chain.period)
    free = replace(chain, random_phase=True)
    worst = pt.simulation.gain_limit(letter_power, LETTER, pt.simulation.timing_of(free, timed), distance=0.0)
    assert worst.strongest == pytest.approx(printed, abs=0.01)
    limits = []
    for wait in np.array([0.999, 0.75, 0.5, 0.25, 0.0]) * period:
        own = replace(chain, phase=float(-(chain.exposure + chain.delay + wait) % period))
        predicted = pt.simulation.largest_damping(LETTER, pt.simulation.timing_of(own, timed)).damping
        limits.append(limit_of(law, own, predicted, period=period))
        assert limits[-1] == pytest.approx(predicted, rel=0.01)
    assert limits == sorted(limits)
    assert min(limits) == pytest.approx(worst.damping.damping, rel=0.01)


@pytest.mark.parametrize(("rate", "step_rate"), [(400.0, 1000.0), (300.0, 1000.0), (240.0, 1000.0), (600.0, 250.0)])
def test_where_the_ratio_is_not_whole_no_phase_is_worse_than_the_limit(rate: float, step_rate: float) -> None:
    """The mean wait counts, at its worst, or of a faster sensor the longest: 2 to 20 % on the careful side."""
    period, chain = 1 / step_rate, pt.SensorChain(rate=rate, exposure=170e-6, delay=120e-6)
    law = lambda gain, _, sensor_period: full(gain, period, max(sensor_period, period))  # noqa: E731
    timing = pt.simulation.timing_of(replace(chain, random_phase=True), law(-1.0, period, chain.period))
    worst = pt.simulation.largest_damping(LETTER, timing).damping
    phases = np.arange(6) / 6 * chain.period
    found = [limit_of(law, replace(chain, phase=float(phase)), 1.1 * worst, period=period) for phase in phases]
    assert worst < min(found) < 1.2 * worst


def test_the_limit_holds_with_the_filters_of_the_letter() -> None:
    """Without the median, which is a pure delay only for signals that rise: an oscillation does not."""
    chain = pt.SensorChain(rate=10_000.0)
    law = lambda gain, period, _: controller(gain, period, low_pass_order=5, cutoff=500.0)  # noqa: E731
    predicted = pt.simulation.largest_damping(LETTER, pt.simulation.timing_of(chain, law(-1.0, 1e-4, 1e-4))).damping
    assert predicted == pytest.approx(1360, rel=0.1)  # some pi/2 over the group delay of 1.03 ms and a period
    assert limit_of(law, chain, predicted, period=1e-4) == pytest.approx(predicted, rel=0.02)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("distance", [0.005, 0.02, 0.04])
def test_the_limit_of_a_curve_is_that_of_its_slope_there(distance: float, letter_power: pt.InversePower) -> None:
    """A motion of a micrometer is linear: the curvature of ln xi changes g by 1e-5 over it."""
    rate = 60.0
    limit = pt.simulation.gain_limit(
        letter_power, LETTER, pt.simulation.LoopTiming(rate=rate, delay=0.008), distance=distance
    )
    scenario = pt.Scenario(admittance=LETTER, obstacle=pt.Obstacle(position=distance), plant=pt.Plant(position=1e-9))
    chain = pt.SensorChain(rate=rate, delay=0.008)

    def run(gain: float) -> float:
        law = bare(-gain, 1 / rate / 25, 1 / rate)
        return grows(pt.simulation.simulate_loop(scenario, letter_power, law, chain=chain, horizon=300 / rate))

    assert simulated_limit(run, -limit.strongest) == pytest.approx(-limit.strongest, rel=0.01)


@pytest.mark.parametrize("law", [bare, full])
def test_the_impulse_of_the_force_is_exact_at_any_period(
    law: Any, letter_power: pt.InversePower, letter_encounter: pt.Scenario
) -> None:
    """Sum of F_p T = D_p (ln xi_n - ln xi_0): a quotient of differences over xi would lose 6.6 % at 10 ms."""
    for period in (1e-3, 1e-2):
        trace = pt.simulation.simulate_loop(letter_encounter, letter_power, law(-0.7, period, period)).trace()
        change = math.log(trace.reading[-1] / trace.reading[0])
        assert trace.virtual_force.sum() * period == pytest.approx(-0.7 * change, rel=1e-12)


def test_an_array_of_encounters_is_each_of_them(letter_power: pt.InversePower) -> None:
    speed, position = np.array([[-0.1], [-0.3], [-0.5]]), np.array([0.0, 0.002])
    many = pt.Scenario(
        admittance=LETTER,
        obstacle=pt.Obstacle(position=0.0422, velocity=speed),
        plant=pt.Plant(position=position),
    )
    plant, contact = (
        pt.simulation.PositionPlant(mass=1.0, bandwidth=30.0),
        pt.simulation.SpringDamper(stiffness=1e5, damping=50.0),
    )
    found = pt.simulation.simulate_loop(many, letter_power, full(-0.7, 1e-3, 1e-3), plant=plant, contact=contact)
    assert found.shape == (3, 2)
    for i, j in np.ndindex(3, 2):
        one = pt.Scenario(
            admittance=LETTER,
            obstacle=pt.Obstacle(position=0.0422, velocity=float(speed[i, 0])),
            plant=pt.Plant(position=float(position[j])),
        )
        alone = pt.simulation.simulate_loop(one, letter_power, full(-0.7, 1e-3, 1e-3), plant=plant, contact=contact)
        for name in ("time", "relative_velocity", "peak_force", "largest_excursion"):
            # the table of ln xi reaches four times as far as the farthest start, so its nodes differ: 1e-12 in ln xi
            assert getattr(found, name)[i, j] == pytest.approx(getattr(alone, name), rel=1e-9)
        assert found.trace((i, j)).distance[0] == pytest.approx(0.0422 - position[j])


@pytest.mark.parametrize("law", [bare, full])
@pytest.mark.parametrize("name", ["letter_power", "letter_first_order", "letter_second_order"])
def test_the_loop_converges_to_the_continuous_motion_with_the_first_order(
    law: Any, name: str, letter_encounter: pt.Scenario, request: pytest.FixtureRequest
) -> None:
    """Difference and hold delay the force by T, an error of the first order: it halves with T.

    Over a step the force is held, and l' departs from its course over many steps by (dF_p/dt) s (1 - s) T^2 / (2 M) at
    the part s of the step, wherever contact comes; F_p = D_p g l'.
    """
    sensor = request.getfixturevalue(name)
    exact = pt.find_contact(letter_encounter, sensor, -0.7).contact
    bend = float(sensor.log_slope(1e-6) - sensor.log_slope(0.0)) / 1e-6
    force_rate = -0.7 * (bend * exact.relative_velocity**2 - float(sensor.log_slope(0.0)) * exact.acceleration)
    periods = np.array([2e-3, 1e-3, 5e-4, 2.5e-4])
    runs = [pt.simulation.simulate_loop(letter_encounter, sensor, law(-0.7, t, t)) for t in periods]
    for quantity in ("time", "position", "relative_velocity"):
        errors = np.array([getattr(run, quantity) - getattr(exact, quantity) for run in runs])
        if quantity == "relative_velocity":  # of which the first term nearly vanishes for one of the curves
            s = np.array([run.time / t % 1 for run, t in zip(runs, periods, strict=True)])
            errors += force_rate * s * (1 - s) * periods**2 / 2  # M = 1 kg
        else:
            assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(np.ones(3), abs=0.05), quantity
        # e = a T + b T^2 + ...: what is left where the first term is taken out falls by 4 when T is halved
        left = 2 * errors[1:] - errors[:-1]
        assert np.log2(left[:-1] / left[1:]) == pytest.approx(np.full(2, 2.0), abs=0.2), quantity


def test_the_filters_of_the_letter_at_10_khz_reproduce_table_2(
    letter_power: pt.InversePower, letter_encounter: pt.Scenario
) -> None:
    """Median and low-pass delay by 1.5 ms. What that makes at a plant speed of 0.1 to 0.22 m/s bounds x."""
    objective = lambda c: (c.position / 0.5) ** 2 + (c.relative_velocity / 0.3) ** 2  # noqa: E731
    for gain in (-0.1, -0.6, -0.7, -0.8, -0.9, -1.0, -10.0):
        exact = pt.find_contact(letter_encounter, letter_power, gain).contact
        law = controller(gain, 1e-4, median_window=10, low_pass_order=5, cutoff=500.0)
        run = pt.simulation.simulate_loop(letter_encounter, letter_power, law)
        assert run.time == pytest.approx(exact.time, rel=0.01)
        assert run.relative_velocity == pytest.approx(exact.relative_velocity, rel=0.01)
        assert objective(run) == pytest.approx(objective(exact), rel=0.01)
        delay = 9 / 2 * 1e-4 + 1.03e-3 + 1e-4  # of the median, the low-pass, difference and hold
        assert abs(run.position - exact.position) < 1.1 * delay * abs(exact.velocity)
        if gain != -0.1:  # there, 0.17 mm of 11.2 mm are 1.5 %
            assert run.position == pytest.approx(exact.position, rel=0.01)


def test_a_plant_that_follows_closely_comes_to_the_ideal_contact(
    letter_power: pt.InversePower, letter_encounter: pt.Scenario
) -> None:
    ideal = pt.simulation.simulate_loop(letter_encounter, letter_power, bare(-0.7, 1e-4, 1e-4))
    stiff = pt.simulation.ImpedancePlant(mass=1.0, stiffness=1e6, damping=2e3)
    close = pt.simulation.simulate_loop(letter_encounter, letter_power, bare(-0.7, 1e-4, 1e-4), plant=stiff)
    # with feedforward the error stems from reference steps alone, M a / K ~ 1e-5 m
    assert close.time == pytest.approx(ideal.time, rel=1e-3)
    assert close.relative_velocity == pytest.approx(ideal.relative_velocity, rel=2e-3)


def test_ten_thousand_runs_are_the_runs_one_by_one(
    letter_power: pt.InversePower, letter_encounter: pt.Scenario
) -> None:
    chain = pt.SensorChain(rate=1000.0, exposure=2e-4, delay=3e-4, noise=1e-3, relative_noise=1e-3, jitter=1e-5)
    many = pt.simulation.simulate_loop(
        letter_encounter, letter_power, controller(-0.7, 1e-3), chain=chain, runs=10_000, seed=7
    )
    few = pt.simulation.simulate_loop(
        letter_encounter, letter_power, controller(-0.7, 1e-3), chain=chain, runs=3, seed=7
    )
    assert np.array_equal(many.time[:3], few.time)
    assert many.touched.all()
    assert len(np.unique(many.relative_velocity)) == 10_000
    trace = many.trace(4321)
    assert trace.time[-1] <= many.time[4321] <= trace.time[-1] + 1e-3
    # noise of 1 mV moves the mean by its square only, and the mean of 10^4 runs is known to a hundredth of its spread
    quiet = pt.simulation.simulate_loop(
        letter_encounter, letter_power, controller(-0.7, 1e-3), chain=pt.SensorChain(rate=1000.0)
    )
    assert math.isclose(many.relative_velocity.mean(), quiet.relative_velocity, rel_tol=0.01)


def test_encounters_with_a_sensor_each_are_those_of_each_sensor_alone() -> None:
    """To the last bit, with the noise of the same runs, whatever starts and gains they have."""
    speeds = np.linspace(-0.5, -0.1, 12)
    exponents = np.random.default_rng(2).permutation(np.linspace(3.0, 3.6, 12))
    sensors = [pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=float(n)) for n in exponents]
    scenario = pt.Scenario(admittance=LETTER, obstacle=pt.Obstacle(position=0.0422, velocity=speeds))
    loop = pt.ClosedLoop(
        law=controller(0.0, 1e-3), chain=pt.SensorChain(rate=250.0, noise=1e-3, random_phase=True), first_run=5
    )
    gains = np.array([[-0.7], [-0.3]])
    runs, found = loop.run_each(scenario, sensors, -0.7), loop.with_each(scenario, sensors, gains)
    trace = runs.trace(7)
    for i, (sensor, speed) in enumerate(zip(sensors, speeds, strict=True)):
        one = pt.Scenario(admittance=LETTER, obstacle=pt.Obstacle(position=0.0422, velocity=float(speed)))
        alone = loop.after(i).run(one, sensor, -0.7)
        assert (runs.time[i], runs.relative_velocity[i]) == (alone.time, alone.relative_velocity)
        other = loop.after(i)(one, sensor, gains[:, 0])
        np.testing.assert_array_equal(found.end.relative_velocity[:, i], other.end.relative_velocity)
        if i == 7:
            np.testing.assert_array_equal(trace.reading, alone.trace().reading)
    with refused("gain"):
        loop.run_each(scenario, sensors[:-1], [[-0.7, -0.3]])
