"""The largest demands of the fast paths compared with the guaranteed path, including peaks between two samples."""

from __future__ import annotations

import numpy as np
import pytest
from test_linear_block import HORIZON, SLOPE, letter, scattered
from test_linear_block import KINDS as LINEAR_KINDS

from encounters import CURVES, random_encounters
from pretouch.motion import find_contact, solve_motion
from pretouch.motion.curve import curve_windows, line_windows, shared_curve
from pretouch.motion.kernels import contact_times, find_contacts, solve_linear
from pretouch.motion.layout import PEAKS
from pretouch.sensors import SensorModel

COUNT = 6000


def linear_rows(inputs: list[np.ndarray], drift: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """The demands of the guaranteed path, shape (5, n)."""
    values = np.ascontiguousarray(np.column_stack([*inputs[:8], drift, pull]))
    rows, status = np.empty((len(drift), 15)), np.empty(len(drift), dtype=np.int64)
    solve_linear(values, SLOPE, np.ascontiguousarray(inputs[8]), (HORIZON, 0.0, np.inf), rows, status=status)
    return rows[:, 7:12].T


def references(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocities and accelerations of a reference that often rests."""
    rng = np.random.default_rng(seed)
    return (
        np.where(rng.random(count) < 0.5, rng.uniform(-1, 1, count), 0.0),
        np.where(rng.random(count) < 0.3, rng.uniform(-1, 1, count), 0.0),
    )


def sizes(inputs: list[np.ndarray], drift: np.ndarray, pull: np.ndarray, time: np.ndarray) -> np.ndarray:
    """What the demands are differences of, shape (5, n)."""
    mass, damping, stiffness, x0, u0, p, v, a, gain = np.abs(inputs)
    speed = v + u0 + a * time + np.abs(drift) + np.abs(pull) * time
    way = x0 + p + speed * time
    bend = a + np.abs(pull) + ((damping + np.abs(SLOPE) * gain) * speed + stiffness * way) / mass
    return np.stack([way, way, speed, bend, mass * bend])


@pytest.mark.parametrize("kind", ["letter", *LINEAR_KINDS])
def test_the_closed_form_finds_the_largest_demands_of_the_guaranteed_path(kind: str) -> None:
    inputs = [np.array(x) for x in np.broadcast_arrays(*letter(COUNT))]
    if kind != "letter":
        inputs = scattered(COUNT, 21, kind)
    drift, pull = references(COUNT, 22)
    time, status, found = np.empty(COUNT), np.empty(COUNT, dtype=np.int8), np.empty((5, COUNT))
    find_contacts([*inputs, drift, pull], SLOPE, HORIZON, time, status, peaks=found)
    proved = status == 0
    assert np.isnan(found[:, ~proved]).all()
    expected, size = linear_rows(inputs, drift, pull), sizes(inputs, drift, pull, time)
    still = {1: (drift == 0) & (pull == 0), 2: pull == 0}
    for row, name in enumerate(PEAKS):
        settled = proved & still.get(row, np.ones(COUNT, dtype=bool))
        np.testing.assert_array_equal(np.isnan(found[row]), ~settled)
        error = np.abs(found[row] - expected[row])
        # the end of the motion is known to 2e-11; a travel of the guaranteed path is a difference of two places
        assert (error <= 1e-10 * expected[row] + 1e-15 * size[row])[settled].all(), name


def test_all_demands_of_the_letter_are_settled() -> None:
    inputs = [np.array(x) for x in np.broadcast_arrays(*letter(500))]
    zero = np.zeros(500)
    time, status, found = np.empty(500), np.empty(500, dtype=np.int8), np.empty((5, 500))
    find_contacts([*inputs, zero, zero], SLOPE, HORIZON, time, status, peaks=found)
    assert (status == 0).all()
    expected = linear_rows(inputs, zero, zero)
    for row, name in enumerate(PEAKS):
        # as above: the end of the motion is known to 2e-11, and a demand at most to five times that
        np.testing.assert_allclose(found[row], expected[row], rtol=1e-10, err_msg=name)


@pytest.mark.parametrize("name", CURVES)
def test_no_sample_of_a_motion_exceeds_the_largest_demands(name: str) -> None:
    batch = random_encounters("everything", 400, seed=31)
    found = find_contact(batch.scenario, CURVES[name], batch.gain, horizon=20.0)
    motion = solve_motion(batch.scenario, CURVES[name], batch.gain, horizon=20.0, samples=801)
    reached = found.reached
    demands = {
        "largest_excursion": motion.displacement,
        "largest_travel": motion.position - motion.position[..., :1],
        "largest_speed": motion.velocity,
        "largest_acceleration": motion.acceleration,
        "largest_virtual_force": motion.virtual_force,
    }
    for field, samples in demands.items():
        largest, sampled = getattr(found.end, field)[reached], np.abs(samples).max(axis=-1)[reached]
        # samples of a trace are good to 1e-9 of the largest terms that they add up from
        assert (sampled <= largest * (1 + 1e-8) + 1e-9).all(), field
        # a peak stays within (1/800 of the motion)^2 of the nearest sample unless the motion is stiff
        assert np.median(np.abs(sampled - largest)[largest > 0] / largest[largest > 0]) < 1e-4, field


def test_demands_do_not_depend_on_what_the_other_lanes_hold() -> None:
    sensor: SensorModel = CURVES["table"]
    batch = random_encounters("everything", 37, seed=32)
    columns = [np.array(np.broadcast_to(c, 37)) for c in batch.scenario.relative_columns()]
    windows = curve_windows(sensor, 0.0, 0.06)

    def solve(which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c, n = [x[which] for x in columns], len(which)
        out, peaks, status = np.empty((6, n)), np.empty((5, n)), np.empty(n, dtype=np.int8)
        inputs = (*c[:8], batch.gain[which], *c[8:])
        contact_times(inputs, shared_curve(windows), 20.0, out, status, peaks=peaks)
        return peaks, status

    whole, status = solve(np.arange(37))
    assert (status == 0).sum() > 10
    assert np.isnan(whole[:, status != 0]).all()
    order = np.random.default_rng(1).permutation(37)
    np.testing.assert_array_equal(solve(order)[0], whole[:, order])
    for i in range(37):
        np.testing.assert_array_equal(solve(np.array([i]))[0][:, 0], whole[:, i])


@pytest.mark.parametrize("name", ["line", "inverse-power", "table"])
@pytest.mark.parametrize("wanted", [*((name,) for name in PEAKS), PEAKS[::-2]])
def test_each_demand_is_the_same_without_the_others(name: str, wanted: tuple[str, ...]) -> None:
    batch = random_encounters("everything", 50, seed=33)
    columns = [np.array(np.broadcast_to(c, 50)) for c in batch.scenario.relative_columns()]
    inputs = (*columns[:8], batch.gain, *columns[8:])
    curve = shared_curve(line_windows(-60.0, 0.06) if name == "line" else curve_windows(CURVES[name], 0.0, 0.06))

    def solve(names: tuple[str, ...]) -> dict[str, np.ndarray]:
        out, peaks, status = np.empty((6, 50)), np.full((len(names), 50), -1.0), np.empty(50, dtype=np.int8)
        contact_times(inputs, curve, 20.0, out, status, peaks=peaks, wanted=names)
        assert (status == 0).sum() > 20
        return dict(zip(names, peaks, strict=True))

    every = solve(PEAKS)
    for peak, values in solve(wanted).items():
        np.testing.assert_array_equal(values, every[peak])
