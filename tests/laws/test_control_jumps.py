"""A jump of the readings that no object can make causes no impulse, however long it lasts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control_samples import controller, rows_of, run_rows
from pretouch.control import Status, VirtualDrag
from properties import examples

FORCE, STATUS = 3, 5
RATE, GAIN, PERIOD = 100.0, -0.7, 1e-3
FILTERS = {"none": {}, "median": {"median_window": 5}, "low-pass": {"low_pass_order": 2, "cutoff": 60.0}}


def impulse(found: np.ndarray) -> float:
    return float(found[:, FORCE].sum() * PERIOD)


@examples(60)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.sampled_from([0.05, 0.3, 3.0]),
    ratio=st.integers(1, 4),
    rate=st.floats(1.0, 1e3),
    fade=st.booleans(),
)
def test_no_sequence_of_readings_makes_more_than_one_plausible_change_per_sensor_period(
    seed: int, size: float, ratio: int, rate: float, fade: bool
) -> None:
    """The impulse of a reading is at most |D_p| largest_rate T_s; delivered over T_s, no force exceeds |D_p| rate.

    If a reading is late, the force of the last one continues over half of `fade_time` on average, here T_s. The next
    reading may take that back.
    """
    rng = np.random.default_rng(seed)
    levels = np.exp(np.cumsum(rng.choice([0.0, 1.0, 30.0], 500) * size * rng.normal(size=500)).clip(-9, 9))
    levels[rng.random(500) < 0.1] = 0.0
    rows = np.repeat(rows_of(levels), ratio, axis=0)
    rows[:, 1] = (np.arange(len(rows)) % ratio == 0) & np.repeat(rng.random(500) < 0.8, ratio)
    more = {} if fade else {"fade_time": 0.0}
    found = run_rows(controller(GAIN, sensor_period=ratio * PERIOD, largest_rate=rate, **more), rows)
    assert np.abs(found[:, FORCE]).max() <= abs(GAIN) * rate * (2 if fade else 1) * (1 + 1e-9)


@pytest.mark.parametrize("filters", FILTERS)
@pytest.mark.parametrize("ratio", [1, 4])
@pytest.mark.parametrize("drop", [False, True])
def test_a_lasting_jump_never_makes_an_impulse(filters: str, ratio: int, drop: bool) -> None:
    """From any level to any other: at rest before and after, the jump is the only change, and it is not believed."""
    largest = RATE * ratio * PERIOD
    for jump in (1.01 * largest, math.log(2.0), 2.0, 5.0):
        levels = np.where(np.arange(200) < 60, 0.1, 0.1 * math.exp(-jump if drop else jump))
        rows = np.repeat(rows_of(levels), ratio, axis=0)
        rows[:, 1] = np.arange(len(rows)) % ratio == 0
        made = controller(GAIN, sensor_period=ratio * PERIOD, largest_rate=RATE, **FILTERS[filters])
        found = run_rows(made, rows)
        status = found[:, STATUS].astype(int)
        assert np.abs(found[:, FORCE]).max() <= 1e-9  # the settled filter is good to rounding
        assert (status & Status.IMPLAUSIBLE).any()
        assert (status & Status.LOST).any(), "a reading that stays implausible is a lost sensor"
        assert not status[-1] & Status.IMPLAUSIBLE, "and the law starts anew at the other level"


@pytest.mark.parametrize("missing", range(12))
def test_missing_readings_before_a_break_do_not_make_it_plausible(missing: int) -> None:
    rows = rows_of(0.1 * np.exp(6e-3 * np.arange(200)))
    rows[100:, 0] = 0.0
    rows[100 - missing : 100, 1] = 0.0
    found = run_rows(controller(GAIN, largest_rate=RATE, timeout=0.02), rows)
    assert found[:, FORCE].max() <= 0.0
    assert (found[125:, FORCE] == 0.0).all()


def test_a_cable_that_makes_contact_now_and_then_never_pulls() -> None:
    """Whatever the order of good and broken readings, all changes between good ones are rises."""
    rng = np.random.default_rng(4)
    for share in (0.1, 0.5, 0.9):
        for length in (1, 3, 15, 40):
            rows = rows_of(0.02 * np.exp(6e-3 * np.arange(600)))
            rows[np.repeat(rng.random(600 // length + 1) < share, length)[:600], 0] = 0.0
            found = run_rows(controller(GAIN, largest_rate=RATE), rows)
            assert found[:, FORCE].max() <= 0.0


@pytest.mark.parametrize("reading", [0.0, 1e3])
@pytest.mark.parametrize("at", [50, 100, 150])
def test_a_single_glitch_is_bridged_with_the_exact_impulse(reading: float, at: int) -> None:
    logs = math.log(0.1) + 6e-3 * np.arange(200)
    rows = rows_of(np.exp(logs))
    rows[at, 0] = reading
    found = run_rows(controller(GAIN, largest_rate=RATE), rows)
    assert impulse(found) == pytest.approx(GAIN * (logs[-1] - logs[0]), rel=1e-9)
    assert found[:, FORCE].max() <= 0.0


def test_a_reading_close_to_the_filtered_signal_is_plausible() -> None:
    """After an extreme of the noise that was itself just plausible, the readings around the mean are no jump."""
    rows = rows_of(np.full(200, 0.1))
    rows[100, 0] = 0.1 * math.exp(0.99 * RATE * PERIOD)
    rows[101:, 0] = 0.1 * math.exp(-0.5 * RATE * PERIOD)
    bare = run_rows(controller(GAIN, largest_rate=RATE), rows)[:, STATUS].astype(int)
    filtered = run_rows(controller(GAIN, largest_rate=RATE, median_window=3), rows)[:, STATUS].astype(int)
    assert (bare & Status.IMPLAUSIBLE).any()
    assert not (filtered & Status.IMPLAUSIBLE).any()


@pytest.mark.parametrize("end", [0.0, 0.2, 0.05, 4.9])
def test_with_the_drag_a_jump_makes_no_impulse_either(end: float) -> None:
    law = VirtualDrag(drag=0.0144, noise=1e-3, relative_noise=3e-3)
    rows = rows_of(np.where(np.arange(300) < 100, 0.1, end))
    found = run_rows(controller(law=law, largest_rate=RATE), rows)
    assert (found[:, FORCE] == 0.0).all()


def test_after_a_jump_the_law_follows_the_object_from_its_new_level() -> None:
    """A brighter surface turns up during an approach: only the readings until the timeout are without mitigation."""
    rows = rows_of(0.02 * np.exp(6e-3 * np.arange(300)))
    rows[100:, 0] *= 2.0
    found = run_rows(controller(GAIN, largest_rate=RATE, timeout=5e-3), rows)
    np.testing.assert_allclose(found[107:, FORCE], GAIN * 6.0, rtol=1e-9)
    assert found[:, FORCE].max() <= 0.0
