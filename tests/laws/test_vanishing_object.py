"""An object that vanishes or appears has not moved: the law reacts to changes between two readings of one object only.

The rule is in the law, so simulated loops, replayed recordings and exported controllers share it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_recordings import low_floor

import pretouch as pt
from control_samples import controller, rows_of, run_plain, run_rows
from pretouch.control import Arrival, Status, VirtualDamper, VirtualDrag
from pretouch.recording import Recording, replay
from pretouch.recording.stepping import run_steps
from pretouch.simulation import Disturbance, simulate_loop
from properties import examples

GAIN, PERIOD, EVERY = -0.7, 1e-3, 4
LATE_OR_LOST = Status.STALE | Status.LOST


def at_rate(arrivals: list[float | None], *, every: int = EVERY, after: int = 3) -> np.ndarray:
    """Return rows with an arrival every few periods: a level of ln xi, or None for no object; then no object."""
    rows = rows_of(np.full((len(arrivals) + after) * every, 1.0), fresh=0.0)
    for k, level in enumerate([*arrivals, *[None] * after]):
        rows[k * every, 1] = Arrival.NO_OBJECT if level is None else Arrival.READING
        rows[k * every, 0] = np.nan if level is None else 1e-3 * np.exp(level)
    return rows


def law(**changed: Any) -> Any:
    return controller(GAIN, PERIOD, **({"sensor_period": EVERY * PERIOD, "timeout": 40e-3} | changed))


@given(arrivals=st.lists(st.none() | st.floats(0.0, 6.0), max_size=30), approach_only=st.booleans())
@examples(60)
def test_the_impulse_is_the_gain_times_the_changes_between_readings_of_one_object(
    arrivals: list[float | None], approach_only: bool
) -> None:
    """sum(F) T = D_p sum(change of ln xi), where neither a first reading nor a vanished object is a change.

    Rounding: 120 periods with forces up to 0.7 * 6 / 0.004 N, thus 1e-12 N s. For approaches only, changes that are
    rises of the mark add up to at most those rises.
    """
    rows = at_rate(arrivals)
    out = run_rows(law(approach_only=approach_only, release=0.0), rows)
    pairs = [(a, b) for a, b in pairwise(arrivals) if a is not None and b is not None]
    changes = [max(b - a, 0.0) if approach_only else b - a for a, b in pairs]
    assert PERIOD * out[:, 3].sum() == pytest.approx(GAIN * sum(changes), abs=1e-9)
    assert not (out[:, 5].astype(int) & LATE_OR_LOST).any()


@pytest.mark.parametrize(
    "made", [law(), law(approach_only=True), law(median_window=5), law(law=VirtualDrag(drag=0.0144, noise=1e-5))]
)
def test_late_and_refused_messages_of_no_object_cause_no_force_either(made: Any) -> None:
    """Before, the force of the vanished object returned when the next message was late."""
    rng = np.random.default_rng(4)
    seen = list(np.linspace(1.0, 3.0, 10))
    rows = at_rate(seen, after=12)
    gone = len(seen) * EVERY
    late = rng.random(len(rows) - gone) < 0.4
    late[0] = False
    rows[gone:, 1] = np.where(late, Arrival.NOTHING, rows[gone:, 1])
    rows[gone + 2 * EVERY :: 3 * EVERY, 2] = 1.0  # much too old
    out = run_rows(made, rows)
    assert np.abs(out[: gone - 1, 3]).max() > 0.1
    assert not out[gone + EVERY :, 3].any()  # after the rest of the last measured impulse
    np.testing.assert_array_equal(out, run_plain(made, rows))


def test_a_receding_object_that_vanishes_pulls_no_farther_than_it_was_seen() -> None:
    out = run_rows(law(), at_rate([3.0, 2.5, 2.0]))
    assert PERIOD * out[:, 3].sum() == pytest.approx(GAIN * -1.0, abs=1e-9)
    as_readings = run_rows(law(), at_rate([3.0, 2.5, 2.0, 0.0, 0.0, 0.0]))
    assert PERIOD * as_readings[:, 3].sum() == pytest.approx(GAIN * -3.0, abs=1e-9)  # what a motion out of range means


def test_a_flickering_object_at_rest_does_not_drive_the_robot() -> None:
    rng = np.random.default_rng(1)
    arrivals = [3.0 if seen else None for seen in rng.random(400) < 0.5]
    assert not run_rows(law(), at_rate(arrivals))[:, 3].any()


def test_the_next_object_owes_nothing_to_a_late_reading_of_the_last_one() -> None:
    """A late reading continues the force ahead of time; that is subtracted from the same object's next impulse only."""
    late = at_rate([1.0, 2.0, None, None, 1.0, 2.0])
    late[2 * EVERY, 1] = Arrival.NOTHING
    out, plain = run_rows(law(), late), run_rows(law(), at_rate([None, None, None, None, 1.0, 2.0]))
    assert out[2 * EVERY : 3 * EVERY, 3].any()
    np.testing.assert_allclose(out[4 * EVERY :, 3], plain[4 * EVERY :, 3], rtol=0, atol=1e-9)


def test_a_sensor_without_an_object_works_until_its_messages_stop() -> None:
    rows = at_rate([2.0, 2.5], after=200)
    out = run_rows(law(), rows)
    assert not (out[:, 5].astype(int) & LATE_OR_LOST).any()
    assert not (out[2 * EVERY :, 5].astype(int) & Status.DETECTING).any()
    rows[100:, 1] = Arrival.NOTHING
    flags = run_rows(law(), rows)[:, 5].astype(int)
    lost = np.flatnonzero(flags & Status.LOST)
    assert 96 + 40 <= lost[0] <= 96 + 42  # the timeout after the last message
    assert (flags[lost[0] :] & Status.LOST).all()


def test_an_old_reading_after_no_object_is_refused() -> None:
    rows = at_rate([2.0, None, 3.0])
    rows[2 * EVERY, 2] = 2 * EVERY * PERIOD  # measured with the first one, before the object vanished
    flags = run_rows(law(), rows)[:, 5].astype(int)
    assert flags[2 * EVERY] & Status.INVALID
    rows[EVERY, 2] = -1.0  # nothing says when there was no object
    assert run_rows(law(), rows)[EVERY, 5].astype(int) & Status.INVALID


@pytest.mark.parametrize("idle", [np.inf, 4.0, 9.5, -1.0, 8.190])
def test_a_replay_shows_no_motion_toward_an_object_that_vanished(idle: float) -> None:
    time = np.arange(0.0, 6.0, 0.004)
    near = np.maximum(0.12 - 0.04 * (time - 1.0), 0.03)
    values = np.where((time > 1.0) & (time < 2.5), near, idle)
    bounds = (0.02, 4.0) if idle < 8 else (0.02, 40.0)
    named = {"source": "b", "topic": "/range", "message_type": "", "kind": "distance", "bounds": bounds}
    task = low_floor()
    both_ways = replace(
        task.loop.law,
        law=VirtualDamper(gain=0.0),
        conditioning=replace(task.loop.law.conditioning, largest_rate=None),
    )
    task = task.replace(loop=replace(task.loop, law=both_ways))
    steps = replay(task, Recording(stamps=np.round(1e9 * time).astype(int), values=values, **named)).steps
    assert steps.virtual_force.min() < -0.1
    assert steps.virtual_force.max() <= 0.0
    outputs = np.where(values == idle, 150.0, 150.0 + 0.533 * (near + 0.0419) ** -3.32)
    as_motion = run_steps(task.loop.robot_law.with_value(-0.86), time, outputs)
    assert as_motion.virtual_force.max() > 10.0  # to which a fall of the output amounts


def simulated(chain: pt.SensorChain, sensor: pt.SensorModel, *, velocity: float = -0.3, start: float = 0.06) -> Any:
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=start, velocity=velocity),
    )
    return simulate_loop(scenario, sensor, controller(GAIN, PERIOD), chain=chain, horizon=0.3).trace()


POWER = {"scale": 1.3e-5, "distance_offset": 0.0419, "exponent": 3.32}


@pytest.mark.parametrize("measures_distance", [True, False])
def test_a_simulated_distance_sensor_knows_that_the_object_left(measures_distance: bool) -> None:
    """An intensity does not: without its object, it falls as if the object receded."""
    leaves = Disturbance(kind="object-leaves", time=0.05)
    chain = pt.SensorChain(rate=1000.0, measures_distance=measures_distance, disturbances=[leaves])
    force = np.array(simulated(chain, pt.InversePower(**POWER)).virtual_force)
    assert force.min() < -0.1
    assert (force.max() > 0.1) != measures_distance


@pytest.mark.parametrize("velocity", [-0.3, 0.3])
def test_the_end_of_the_curve_is_no_motion_for_a_distance_sensor(velocity: float) -> None:
    """The curve ends at 50 mm, where xi is far above the floor: no jump of the force, neither in nor out."""
    start = 0.06 if velocity < 0 else 0.03
    sensor = pt.InversePower(**POWER, maximum_distance=0.05)
    chain = pt.SensorChain(rate=1000.0, measures_distance=True)
    force = np.array(simulated(chain, sensor, velocity=velocity, start=start).virtual_force)
    whole = np.array(simulated(chain, pt.InversePower(**POWER), velocity=velocity, start=start).virtual_force)
    assert np.abs(whole).max() > 0.5
    assert np.abs(force).max() < 1.2 * np.abs(whole).max()
    blind = simulated(replace(chain, measures_distance=False), sensor, velocity=velocity, start=start)
    assert np.abs(np.array(blind.virtual_force)).max() > 100  # a jump, D_p ln(xi(50 mm) / floor) / T
