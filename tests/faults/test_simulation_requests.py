"""Requests to the loop that make no sense: what was found, what must hold."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from typing import Any

import pytest

import pretouch as pt
from loop_samples import BareLaw
from refusals import refused

ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SCENARIO = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
QUICK_PLANT = pt.simulation.ImpedancePlant(mass=4.0, stiffness=4e3, damping=250.0)


def simulate(**changed: Any) -> pt.simulation.SimulationResult:
    return pt.simulation.simulate_loop(SCENARIO, SENSOR, BareLaw(-0.7, 1e-3), **changed)


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (lambda: pt.SensorChain(rate=0.0), {"argument": "rate", "value": 0.0}),
        (lambda: pt.SensorChain(rate=100.0, exposure=0.02), {"argument": "exposure", "value": 0.02, "limit": 0.01}),
        (lambda: pt.SensorChain(rate=100.0, delay=-1e-3), {"argument": "delay", "value": -0.001}),
        (lambda: pt.SensorChain(rate=100.0, jitter=0.003), {"argument": "jitter", "value": 0.003}),
        (lambda: pt.SensorChain(rate=100.0, dropout=1.0), {"argument": "dropout", "value": 1.0}),
        (lambda: pt.SensorChain(rate=100.0, lowest=1.0, highest=1.0), {"argument": "highest", "value": 1.0}),
        (lambda: pt.SensorChain(rate=100.0, noise=math.nan), {"argument": "noise"}),
        (lambda: pt.SensorChain(rate=100.0, highest=math.nan), {"argument": "highest"}),
        (lambda: pt.SensorChain(rate=[100.0, 200.0]), {"argument": "rate"}),
        (lambda: pt.SensorChain(rate=100.0, distance_noise=0.001), {"argument": "distance_noise, distance_resolution"}),
        (lambda: pt.simulation.sensor_part("VCNL9999"), {"argument": "name", "value": "VCNL9999"}),
        (
            lambda: pt.simulation.ImpedancePlant(mass=0.0, stiffness=1.0, damping=1.0),
            {"argument": "mass", "value": 0.0},
        ),
        (
            lambda: pt.simulation.ImpedancePlant(mass=1.0, stiffness=1.0, damping=1.0, bandwidth=-1.0),
            {"argument": "bandwidth", "value": -1.0},
        ),
        (lambda: pt.simulation.PositionPlant(mass=1.0, bandwidth=math.inf), {"argument": "bandwidth"}),
        (
            lambda: pt.simulation.HuntCrossley(stiffness=1e5, exponent=0.5),
            {"argument": "exponent", "value": 0.5},
        ),
        (
            lambda: pt.simulation.HuntCrossley(stiffness=1e5, obstacle_mass=0.0),
            {"argument": "obstacle_mass", "value": 0.0},
        ),
        (lambda: pt.simulation.SpringDamper(stiffness=1e5, damping=-1.0), {"argument": "damping", "value": -1.0}),
        (
            lambda: pt.simulation.LoopTiming(rate=100.0, exposure=0.004, delay=0.001),
            {"argument": "delay", "value": 0.001},
        ),
        (
            lambda: pt.simulation.LoopTiming(rate=100.0, exposure=0.02, delay=0.1),
            {"argument": "exposure", "value": 0.02, "limit": 0.01},
        ),
        (
            lambda: pt.simulation.LoopTiming(rate=100.0, sections=[(1.0, 0.0)]),
            {"argument": "sections", "value": (1.0, 0.0)},
        ),
        (lambda: simulate(runs=0), {"argument": "runs", "value": 0, "limit": (1, 1_000_000)}),
        (
            lambda: simulate(runs=10**12),
            {"argument": "runs", "value": 1000000000000},
        ),
        (lambda: simulate(seed=-1), {"argument": "seed", "value": -1}),
        (
            lambda: simulate(horizon=5e9),
            {"argument": "loop horizon"},
        ),
        (
            lambda: simulate(horizon=10.0, chain=pt.SensorChain(rate=1e9)),
            {"argument": "loop horizon"},
        ),
        (
            lambda: simulate(horizon=10.0, plant=pt.simulation.PositionPlant(mass=1.0, bandwidth=1e5)),
            {"argument": "loop horizon"},
        ),
        (
            lambda: simulate(plant=QUICK_PLANT, contact=pt.simulation.SpringDamper(stiffness=1e30)),
            {"argument": "loop follow_time"},
        ),
        (
            lambda: simulate(chain=pt.SensorChain(rate=1e5, delay=1e3)),
            {"argument": "chain delay", "limit": 1000000},
        ),
        (lambda: simulate(horizon=0.0), {"argument": "horizon", "value": 0.0}),
        (lambda: simulate(contact=pt.simulation.SpringDamper(stiffness=1e5)), {"argument": "contact"}),
        (lambda: simulate().trace(3), {"argument": "index", "value": 3}),
        (lambda: simulate(runs=4).trace(), {"argument": "index"}),
        (
            lambda: pt.simulation.lowest_rate(SENSOR, ADMITTANCE, 0.5, distance=0.0),
            {"argument": "gain", "value": 0.5},
        ),
        (
            lambda: pt.simulation.gain_limit(SENSOR, ADMITTANCE, pt.simulation.LoopTiming(rate=15.0), distance=-1.0),
            {"argument": "distance", "value": -1.0},
        ),
        (
            lambda: pt.simulation.gain_limit(
                SENSOR, ADMITTANCE, pt.simulation.LoopTiming(rate=15.0), distance=0.0
            ).bounds(margin=1.0),
            {"argument": "margin", "value": 1.0},
        ),
        (
            lambda: pt.simulation.gain_limit(
                SENSOR, ADMITTANCE, pt.simulation.LoopTiming(rate=15.0), distance=0.0
            ).bounds(weakest=-1.0),
            {"argument": "weakest", "value": -1.0, "limit": (0.0, -0.28575155765088217)},
        ),
        (
            lambda: pt.simulation.largest_damping(
                pt.Admittance(mass=[1.0, 2.0], damping=10.0, stiffness=25.0), pt.simulation.LoopTiming(rate=15.0)
            ),
            {"argument": "admittance"},
        ),
    ],
)
def test_a_request_that_makes_no_sense_says_why(make: Callable[[], object], fields: dict[str, Any]) -> None:
    with refused(**fields):
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
