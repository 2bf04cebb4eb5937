"""Requests to the loop that make no sense: what was found, what must hold."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from typing import Any

import pytest

import pretouch as pt
from loop_samples import BareLaw

ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SCENARIO = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
QUICK_PLANT = pt.simulation.ImpedancePlant(mass=4.0, stiffness=4e3, damping=250.0)


def simulate(**changed: Any) -> pt.simulation.SimulationResult:
    return pt.simulation.simulate_loop(SCENARIO, SENSOR, BareLaw(-0.7, 1e-3), **changed)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pt.SensorChain(rate=0.0), "rate: found 0 Hz, which must be positive"),
        (lambda: pt.SensorChain(rate=100.0, exposure=0.02), "expected at most the period of 0.01 s"),
        (lambda: pt.SensorChain(rate=100.0, delay=-1e-3), "delay: found -0.001 s, which must not be negative"),
        (lambda: pt.SensorChain(rate=100.0, jitter=0.003), "at most a quarter of the sensor's period"),
        (lambda: pt.SensorChain(rate=100.0, dropout=1.0), "below 1"),
        (lambda: pt.SensorChain(rate=100.0, lowest=1.0, highest=1.0), "expected more than the lower clipping limit"),
        (lambda: pt.SensorChain(rate=100.0, noise=math.nan), "noise: found nan"),
        (lambda: pt.SensorChain(rate=100.0, highest=math.nan), "highest: found nan"),
        (lambda: pt.SensorChain(rate=[100.0, 200.0]), "rate: found an array"),
        (lambda: pt.SensorChain(rate=100.0, distance_noise=0.001), "measures_distance"),
        (lambda: pt.simulation.sensor_part("VCNL9999"), "expected one of RPR-220, VCNL4010"),
        (lambda: pt.simulation.ImpedancePlant(mass=0.0, stiffness=1.0, damping=1.0), "mass: found 0 kg"),
        (
            lambda: pt.simulation.ImpedancePlant(mass=1.0, stiffness=1.0, damping=1.0, bandwidth=-1.0),
            "bandwidth: found -1 Hz",
        ),
        (lambda: pt.simulation.PositionPlant(mass=1.0, bandwidth=math.inf), "bandwidth: found inf"),
        (
            lambda: pt.simulation.HuntCrossley(stiffness=1e5, exponent=0.5),
            "exponent: found 0.5, which must be at least 1",
        ),
        (lambda: pt.simulation.HuntCrossley(stiffness=1e5, obstacle_mass=0.0), "obstacle_mass: found 0 kg"),
        (lambda: pt.simulation.SpringDamper(stiffness=1e5, damping=-1.0), "damping: found -1"),
        (
            lambda: pt.simulation.LoopTiming(rate=100.0, exposure=0.004, delay=0.001),
            "expected at least half of the exposure",
        ),
        (lambda: pt.simulation.LoopTiming(rate=100.0, exposure=0.02, delay=0.1), "expected at most the period"),
        (
            lambda: pt.simulation.LoopTiming(rate=100.0, sections=[(1.0, 0.0)]),
            "sections: found the filter coefficients",
        ),
        (lambda: simulate(runs=0), "runs: found 0, expected a whole number from 1"),
        (
            lambda: simulate(runs=10**12),
            "runs: found 1,000,000,000,000 runs, which would need 1,728,000 GB",
        ),
        (lambda: simulate(seed=-1), "seed: found -1"),
        (
            lambda: simulate(horizon=5e9),
            "loop horizon: found a simulated time of 5e+09 s, expected at most 2e+04 s. This time takes 5e+12 steps of "
            "a controller with a period of 1 ms. At most",
        ),
        (
            lambda: simulate(horizon=10.0, chain=pt.SensorChain(rate=1e9)),
            "loop horizon: found a simulated time of 10 s, expected at most 20 ms. This time takes 1e+10 steps of a "
            "sensor with 1e+09 readings per second. At most",
        ),
        (
            lambda: simulate(horizon=10.0, plant=pt.simulation.PositionPlant(mass=1.0, bandwidth=1e5)),
            "steps of a robot integrated in steps of",
        ),
        (
            lambda: simulate(plant=QUICK_PLANT, contact=pt.simulation.SpringDamper(stiffness=1e30)),
            "steps of a contact integrated in steps of",
        ),
        (
            lambda: simulate(chain=pt.SensorChain(rate=1e5, delay=1e3)),
            "chain delay: up to 1e+08 sensor readings would wait for delivery",
        ),
        (lambda: simulate(horizon=0.0), "horizon: found 0 s"),
        (lambda: simulate(contact=pt.simulation.SpringDamper(stiffness=1e5)), "an ideal plant has no mass"),
        (lambda: simulate().trace(3), "index: found 3"),
        (lambda: simulate(runs=4).trace(), "selects several runs"),
        (
            lambda: pt.simulation.lowest_rate(SENSOR, ADMITTANCE, 0.5, distance=0.0),
            "gain: found 0.5 N s, which does not mitigate the impact",
        ),
        (
            lambda: pt.simulation.gain_limit(SENSOR, ADMITTANCE, pt.simulation.LoopTiming(rate=15.0), distance=-1.0),
            "distance: found -1 m",
        ),
        (
            lambda: pt.simulation.gain_limit(
                SENSOR, ADMITTANCE, pt.simulation.LoopTiming(rate=15.0), distance=0.0
            ).bounds(margin=1.0),
            "margin: found 1, which must exceed 1",
        ),
        (
            lambda: pt.simulation.gain_limit(
                SENSOR, ADMITTANCE, pt.simulation.LoopTiming(rate=15.0), distance=0.0
            ).bounds(weakest=-1.0),
            "A faster sensor allows a stronger gain",
        ),
        (
            lambda: pt.simulation.largest_damping(
                pt.Admittance(mass=[1.0, 2.0], damping=10.0, stiffness=25.0), pt.simulation.LoopTiming(rate=15.0)
            ),
            "admittance: found an array",
        ),
    ],
)
def test_a_request_that_makes_no_sense_says_why(make: Callable[[], object], message: str) -> None:
    with pytest.raises(
        pt.errors.InvalidInputError, match=message.replace(".", r"\.").replace("^", r"\^").replace("+", r"\+")
    ):
        make()


def test_a_run_without_contact_is_a_result() -> None:
    run = simulate(horizon=0.05)
    assert run.status is pt.motion.ContactStatus.HORIZON
    assert not run.touched
    assert math.isnan(run.time)
    assert 0 < run.closest_distance < 0.0422
    assert run.end_time == pytest.approx(0.05)


def test_results_cannot_be_changed() -> None:
    run = simulate(runs=3)
    with pytest.raises(ValueError, match="read-only"):
        run.time[0] = 1.0
    with pytest.raises(AttributeError, match="cannot assign"):
        run.time = 1.0
    with pytest.raises(AttributeError, match="no 'nonsense'"):
        run.nonsense  # noqa: B018


def test_a_trace_takes_the_memory_of_the_run_and_not_of_the_horizon() -> None:
    """A run of 0.45 s at 1 kHz: 450 rows of 12 numbers; those of the horizon would be 10^7."""
    run = simulate(horizon=1e4)
    run.trace()  # compiled by now
    tracemalloc.start()
    trace = run.trace()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 400 < len(trace.time) < 500
    assert peak < 10e6
