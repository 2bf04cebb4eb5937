"""Whatever the samples are, the output is finite and within limits; and each kind of bad sample has its answer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control_samples import ADMITTANCE, LIMITS, controller, rows_of, run_plain, run_rows
from pretouch._core.native import copy_of
from pretouch.control import (
    Conditioning,
    Controller,
    Limits,
    Sample,
    Status,
    VirtualAdmittance,
    VirtualDamper,
    VirtualDrag,
)
from properties import examples
from refusals import refused

POSITION, VELOCITY, ACCELERATION, FORCE, LEVEL, STATUS = range(6)
HARD = {
    "letter": {"median_window": 10, "low_pass_order": 5, "cutoff": 100.0, "saturation": 5.0, "largest_rate": 300.0},
    "bare": {},
    "slow": {"sensor_period": 7.3e-3, "fade_time": 0.02, "timeout": 0.05, "median_window": 3, "saturation": 5.0},
    "approach": {"approach_only": True, "release": 0.05, "ramp_time": 0.02, "low_pass_order": 8, "cutoff": 400.0},
    "strong": {
        "gain": -1e6,
        "contact_gain": 1.0,
        "median_window": 16,
        "moving_average": 7,
        "low_pass_order": 2,
        "cutoff": 20.0,
    },
    "pulling": {"gain": 3.0, "fade_time": 0.0, "ramp_time": 1.0, "offset": -0.3},
    "undamped": {"admittance": VirtualAdmittance(mass=0.01, damping=0.0, stiffness=0.0), "contact_gain": 1.0},
    "stiff": {"admittance": VirtualAdmittance(mass=0.001, damping=50.0, stiffness=1e6)},
    "drag": {"law": VirtualDrag(drag=0.0144, noise=1e-3, relative_noise=3e-3, own_advance=-0.7), "saturation": 5.0},
    "strong drag": {
        "law": VirtualDrag(drag=1e6, noise=0.0, smoothing_time=0.0, own_advance=-1e6, known_acceleration=-9.8),
        **{"sensor_period": 3.1e-3, "timeout": 0.05, "fade_time": 0.02, "contact_gain": 1.0},
        "admittance": VirtualAdmittance(mass=0.001, damping=50.0, stiffness=1e6),
    },
}
FREE = Limits()
EVIL = np.array(
    [math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 5.0, 1e300, -1e300, 1e-300, 5e-324, 1.7e308, 1e12, 1e-3, 0.1]
)


def _within(found: np.ndarray, limits: Limits, period: float, reference: Any = 0.0) -> None:
    """Output beside the limits; sums of numbers that are rounded at 2e-16 of up to a few thousand times the period."""
    assert np.isfinite(found).all()
    assert (np.abs(found[:, FORCE]) <= (limits.force or 1e9)).all()
    if limits.excursion is not None and limits.speed is not None and limits.acceleration is not None:
        assert (np.abs(found[:, POSITION] - reference) <= limits.excursion + 1e-15).all()
        assert (np.abs(found[:, VELOCITY]) <= limits.speed * (1 + 1e-12)).all()
        assert (np.abs(found[:, ACCELERATION]) <= limits.acceleration * (1 + 1e-12) + 1e-15 / period).all()
        moved = np.diff(found[:, POSITION])
        assert (np.abs(moved) <= limits.speed * period * (1 + 1e-12) + 1e-15).all()
    assert (found[:, LEVEL] >= 0.0).all()


def adversarial(count: int, rng: np.random.Generator) -> np.ndarray:
    """Stretches of approaches, noise, spikes, stuck and dead sensors, late, missing and impossible samples."""
    rows = np.zeros((count, 7))
    start = 0
    while start < count:
        length = min(int(rng.integers(1, 2000)), count - start)
        part = rows[start : start + length]
        t = np.arange(length)
        shape = rng.integers(8)
        level = rng.uniform(-8, 2)
        if shape == 0:
            part[:, 0] = np.exp(level + rng.normal() * 0.01 * t)
        elif shape == 1:
            part[:, 0] = np.exp(level + rng.normal(size=length) * rng.choice([1e-3, 0.1, 10.0]))
        elif shape == 2:
            part[:, 0] = rng.choice(EVIL, length)
        elif shape == 3:
            part[:, 0] = rng.choice(EVIL)
        elif shape == 4:
            part[:, 0] = np.where(t // int(rng.integers(1, 20)) % 2, 4.99, 1e-4)
        elif shape == 5:
            part[:, 0] = rng.integers(0, 2**63, length).view(np.float64)
        elif shape == 6:
            part[:, 0] = np.cumsum(rng.normal(size=length)) * 10.0 ** rng.uniform(-5, 1)
        else:
            part[:, 0] = np.round(np.exp(level + 0.002 * t), 2)
        part[:, 1] = rng.random(length) < rng.choice([0.0, 0.1, 0.5, 0.99, 1.0, 1.0])
        if rng.random() < 0.3:
            part[:, 2] = rng.choice([0.0, 1e-3, 5e-3, 0.1, -1e-3, math.nan, math.inf, 1e300], length)
        if rng.random() < 0.3:
            part[:, 3] = rng.choice([0.0, -5.0, 500.0, -1e8, 1e308, math.nan, -math.inf], length)
        if rng.random() < 0.1:
            part[:, 4] = math.nan
        start += length
    return rows


@pytest.mark.slow
def test_ten_million_adversarial_samples_give_no_output_out_of_limits() -> None:
    rng, seen = np.random.default_rng(20261121), 0
    met = 0
    for round_ in range(10):
        for number, (name, changed) in enumerate(HARD.items()):
            limits = FREE if (round_ + number) % 5 == 4 else LIMITS
            made = controller(**({"gain": -0.7, "limits": limits} | changed))
            rows = adversarial(100_000, rng)
            out = run_rows(made, rows)
            _within(out, limits, made.period)
            met |= int(np.bitwise_or.reduce(out[:, STATUS].astype(int)))
            assert np.ptp(out[:, POSITION]) > 0 or name == "pulling", "the controller does something"
            seen += len(rows)
    assert seen == 10_000_000
    assert Status(met) == ~Status.NONE, "and every flag was met"


anything = st.one_of(st.floats(), st.floats(0, 5), st.sampled_from([math.nan, math.inf, 0.0, 0.1, 0.2, 5.0]))
samples = st.lists(
    st.tuples(anything, st.booleans(), st.one_of(st.just(0.0), st.floats()), st.floats()), min_size=1, max_size=60
)


@examples(200)
@given(fed=samples, name=st.sampled_from(sorted(HARD)), free=st.booleans())
def test_any_sequence_of_samples_gives_outputs_within_limits(fed: list[Any], name: str, free: bool) -> None:
    limits = FREE if free else LIMITS
    made = controller(**({"gain": -0.7, "limits": limits} | HARD[name]))
    reading, fresh, age, force = (list(c) for c in zip(*fed, strict=True))
    _within(run_rows(made, rows_of(reading, fresh=fresh, age=age, force=force)), limits, made.period)


@pytest.mark.slow
@pytest.mark.parametrize("name", HARD)
def test_the_law_in_c_is_the_plain_law_bit_for_bit(name: str) -> None:
    """300,000 samples over all names; both take the logarithm, which no standard rounds, of one library."""
    rng = np.random.default_rng(sorted(HARD).index(name))
    for limits in (LIMITS, FREE):
        made = controller(**({"gain": -0.7, "limits": limits} | HARD[name]))
        rows = adversarial(15_000, rng)
        np.testing.assert_array_equal(run_rows(made, rows).view(np.int64), run_plain(made, rows).view(np.int64))


def test_all_ways_to_step_are_the_same() -> None:
    made = controller(limits=LIMITS, **HARD["letter"])
    rows = adversarial(5000, np.random.default_rng(5))
    found = run_rows(made, rows)
    run, parameters, state = made.begin(), made.parameters(), made.start()
    for row, expected in zip(rows.tolist(), found, strict=True):
        sample = Sample(row[0], row[1] > 0.0, *row[2:])
        before = copy_of(state)
        after, output = made.step(parameters, state, sample)
        assert state == before, "a step leaves what it is given as it was"
        assert run.step(**sample._asdict()) == output == tuple(expected)
        state = after
    assert run.state == state


def _approach(count: int = 200, rate: float = 6.0) -> np.ndarray:
    return rows_of(0.1 * np.exp(rate * 1e-3 * np.arange(count)))


def _status(found: np.ndarray, k: int) -> Status:
    return Status(int(found[k, STATUS]))


@pytest.mark.parametrize(
    ("reading", "said"),
    [(math.nan, Status.INVALID), (math.inf, Status.INVALID), (-math.inf, Status.INVALID), (6.0, Status.SATURATED)],
)
def test_a_reading_that_cannot_be_used_is_reported_and_bridged(reading: float, said: Status) -> None:
    rows = _approach()
    rows[100, 0] = reading
    found = run_rows(controller(saturation=5.0), rows)
    clean = run_rows(controller(saturation=5.0), _approach())
    assert said in _status(found, 100)
    assert Status.STALE in _status(found, 100)
    assert found[100, FORCE] == pytest.approx(clean[100, FORCE] / 2, rel=1e-9)  # fades in two sensor periods
    assert found[100:102, FORCE].sum() == pytest.approx(clean[100:102, FORCE].sum(), rel=1e-9)
    np.testing.assert_allclose(found[103:, FORCE], clean[103:, FORCE], rtol=1e-9)


@pytest.mark.parametrize("age", [-1e-3, math.nan, math.inf, 1.0])
def test_a_reading_with_an_impossible_or_late_time_is_not_used(age: float) -> None:
    rows = _approach()
    rows[100, 2] = age
    assert Status.INVALID in _status(run_rows(controller(), rows), 100)


def test_readings_out_of_order_are_not_used() -> None:
    rows = _approach()
    rows[100, 2] = 1.5e-3  # older than the one of step 99
    found = run_rows(controller(), rows)
    assert Status.INVALID in _status(found, 100)
    assert Status.INVALID not in _status(found, 101)


def test_a_jump_that_no_approach_can_make_is_not_used() -> None:
    """An object that is gone from one reading to the next would make the plant leap after it."""
    rows = _approach()
    rows[100:, 0] = 0.0
    guarded = run_rows(controller(largest_rate=100.0), rows)
    assert Status.IMPLAUSIBLE in _status(guarded, 100)
    assert guarded[100:, FORCE].max() <= 0.0
    assert [k for k in range(200) if Status.LOST in _status(guarded, k)] == [110], (
        "lost, and found again: nothing there"
    )
    assert Status.DETECTING not in _status(guarded, 111)
    bare = run_rows(controller(), rows)
    assert bare[100, FORCE] > 1000.0


def test_a_sensor_that_is_lost_lets_the_force_fade_and_the_plant_return() -> None:
    rows = _approach(5000)
    rows[200:, 1] = 0.0
    found = run_rows(controller(fade_time=0.02, timeout=0.05), rows)
    force = np.abs(found[199:222, FORCE])
    assert (np.diff(force) <= 1e-12).all()
    assert np.abs(np.diff(force)).max() <= force[0] / 20 * (1 + 1e-9)  # 20 equal steps
    assert (found[220:, FORCE] == 0.0).all()
    assert Status.STALE in _status(found, 200)
    assert Status.LOST not in _status(found, 249)
    assert Status.LOST in _status(found, 250)
    assert Status.DETECTING not in _status(found, 250)
    assert np.abs(found[199, POSITION]) > 1e-3
    assert np.abs(found[-1, POSITION]) < 1e-6


def test_a_sensor_that_comes_back_starts_anew_without_a_jump() -> None:
    rows = _approach(400)
    rows[100:200, 1] = 0.0
    rows[200:, 0] *= 3.0
    found = run_rows(controller(timeout=0.05, median_window=5), rows)
    assert found[200, FORCE] == 0.0
    assert np.abs(found[200:, FORCE]).max() <= 0.7 * 6.0 * (1 + 1e-9) + 1e-9
    bare = run_rows(controller(timeout=0.05), rows)
    # what was given ahead of the loss is forgotten with it
    np.testing.assert_allclose(bare[201:, FORCE], -0.7 * 6.0, rtol=1e-9)


def test_a_stuck_sensor_is_an_object_at_rest() -> None:
    rows = _approach(3000)
    rows[200:, 0] = rows[200, 0]
    found = run_rows(controller(), rows)
    assert (found[201:, FORCE] == 0.0).all()
    assert np.abs(found[-1, POSITION]) < 1e-4


def test_faulty_contact_forces_and_references_are_reported() -> None:
    rows = _approach()
    rows[:, 4] = 0.2
    rows[50, 3] = math.nan
    rows[60, 4] = math.inf
    rows[70, 6] = math.nan
    found = run_rows(controller(contact_gain=1.0), rows)
    for k in range(200):
        assert (Status.INPUT_FAULT in _status(found, k)) == (k in {50, 60, 70})
    assert np.abs(np.diff(found[:, POSITION])).max() < 1e-3, "the reference stays where it was"


def test_a_force_beyond_its_limit_is_dropped_not_saved_up() -> None:
    rows = _approach(300)
    rows[100:, 0] *= 20.0  # an impulse of 0.7 ln 20 = 2.1 N s, of which 20 mN s pass
    found = run_rows(controller(limits=Limits(force=20.0)), rows)
    assert Status.FORCE_LIMITED in _status(found, 100)
    assert found[100, FORCE] == -20.0
    np.testing.assert_allclose(found[101:, FORCE], -0.7 * 6.0, rtol=1e-9)


def test_what_the_limit_cut_off_is_not_held_against_later_readings() -> None:
    """Given ahead is only what was given: 20 N and less for a period, gone after a few readings of 4.2 mN s each."""
    rows = _approach(300)
    rows[100:, 0] *= 20.0
    rows[101, 1] = 0.0
    found = run_rows(controller(limits=Limits(force=20.0)), rows)
    assert found[101, FORCE] == pytest.approx(-10.0, rel=1e-9)
    np.testing.assert_allclose(found[105:, FORCE], -0.7 * 6.0, rtol=1e-9)


@pytest.mark.parametrize(
    ("changed", "fields"),
    [
        ({"floor": 0.0}, {"argument": "floor", "value": 0.0}),
        ({"floor": math.nan}, {"argument": "floor"}),
        ({"floor": 1e-25}, {"argument": "floor", "value": 1e-25, "limit": 1e-24}),
        ({"floor": np.array([1.0, 2.0])}, {"argument": "floor"}),
        ({"saturation": 1e-4}, {"argument": "saturation", "value": 0.0001}),
        ({"saturation": 1e13}, {"argument": "saturation", "value": 10000000000000.0}),
        ({"offset": 1e13}, {"argument": "offset, floor", "value": 10000000000000.0}),
        ({"median_window": 0}, {"argument": "median_window"}),
        ({"median_window": 17}, {"argument": "median_window"}),
        ({"median_window": 2.0}, {"argument": "median_window", "value": 2.0}),
        ({"sensor_period": 5e-4}, {"argument": "sensor_period", "value": 0.0005, "limit": 0.001}),
        ({"timeout": 5e-4}, {"argument": "timeout", "value": 0.0005, "limit": 0.001}),
        ({"low_pass_order": 2}, {"argument": "cutoff"}),
        ({"low_pass_order": 2, "cutoff": 500.0}, {"argument": "cutoff", "value": 500.0}),
        ({"period": 0.0}, {"argument": "period", "value": 0.0}),
        ({"gain": math.nan}, {"argument": "gain"}),
        ({"gain": -1e7}, {"argument": "gain", "value": -10000000.0}),
        ({"release": -0.1}, {"argument": "release", "value": -0.1}),
        ({"ramp_time": -0.1}, {"argument": "ramp_time", "value": -0.1}),
        ({"contact_gain": 2.0}, {"argument": "contact_gain", "value": 2.0}),
        ({"contact_threshold": 0.0}, {"argument": "contact_threshold", "value": 0.0}),
    ],
)
def test_a_controller_that_makes_no_sense_is_refused(changed: dict[str, Any], fields: dict[str, Any]) -> None:
    with refused(**fields):
        controller(**changed)


def test_an_admittance_of_arrays_is_refused() -> None:
    with refused("mass"):
        VirtualAdmittance(mass=np.array([1.0, 2.0]), damping=1.0, stiffness=1.0)
    with refused("gain"):
        VirtualDamper(gain=np.array([1.0, 2.0]))
    with refused("period"):
        Controller(
            period=np.array([1.0, 2.0]),
            conditioning=Conditioning(floor=1.0),
            law=VirtualDamper(gain=-1.0),
            admittance=ADMITTANCE,
        )
