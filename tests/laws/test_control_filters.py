"""Running median, low-pass and admittance agree with textbooks and SciPy for any input.

The tests use the plain Python law; the C law equals it bit for bit (tests/faults/test_control_samples.py).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.ndimage import median_filter
from scipy.signal import butter, sosfilt, sosfilt_zi

from plain_law.filters import advance_low_pass, advance_median, fill_low_pass, fill_median
from plain_law.motion import advance_admittance
from pretouch.control import Conditioning, VirtualAdmittance
from pretouch.control.components import (
    LONGEST_AVERAGE,
    LONGEST_WINDOW,
    design_low_pass,
    design_moving_average,
    discretize,
)
from properties import examples
from refusals import refused

readings = st.lists(st.one_of(st.floats(-1e6, 1e6), st.sampled_from([0.0, 1.0, 2.0])), min_size=1, max_size=60)


@examples(150)
@given(length=st.integers(1, LONGEST_WINDOW), first=st.floats(-10, 10), values=readings)
def test_the_median_is_that_of_the_last_readings(length: int, first: float, values: list[float]) -> None:
    """Bit by bit: no number is made but the mean of two."""
    state, history = fill_median(length, first), [first] * LONGEST_WINDOW
    for value in values:
        history.append(value)
        state, found = advance_median(state, value)
        assert found == np.median(history[-length:])


@pytest.mark.parametrize("length", [1, 3, 5, 11, 15])
def test_the_median_is_the_filter_of_scipy_with_its_window_behind(length: int) -> None:
    values = np.random.default_rng(length).normal(size=400)
    state, found = fill_median(length, values[0]), []
    for value in values.tolist():
        state, middle = advance_median(state, value)
        found.append(middle)
    expected = median_filter(values, size=length, mode="nearest", origin=length // 2)
    assert found == expected.tolist()


@pytest.mark.parametrize("window", range(1, LONGEST_AVERAGE + 1))
def test_the_moving_average_is_the_mean_of_the_last_readings_and_starts_settled(window: int) -> None:
    values = 3.0 + np.random.default_rng(window).normal(size=500)
    sections = design_moving_average(window)
    states, found = fill_low_pass(sections, float(values[0])), []
    for value in values.tolist():
        states, out = advance_low_pass(sections, states, value)
        found.append(out)
    padded = np.concatenate([np.full(window - 1, values[0]), values])
    # no section amplifies by more than 1 / (1 - cos 40 deg), and there are four
    np.testing.assert_allclose(found, np.convolve(padded, np.full(window, 1 / window), "valid"), rtol=0, atol=1e-13)


@pytest.mark.parametrize("window", [0, 10, 2.0, True, -3])
def test_a_moving_average_that_does_not_fit_is_refused(window: Any) -> None:
    with refused("moving_average", value=window):
        design_moving_average(window)


def test_a_moving_average_and_a_low_pass_share_the_sections_of_the_law() -> None:
    both = Conditioning(floor=1.0, moving_average=4, low_pass_order=4, cutoff=50.0)
    assert len(both.sections(1000.0)) == 4
    with refused(value=5):
        Conditioning(floor=1.0, moving_average=5, low_pass_order=5, cutoff=50.0).sections(1000.0)


@pytest.mark.parametrize("order", range(9))
@pytest.mark.parametrize("cutoff", [20.0, 500.0, 4500.0])
def test_the_low_pass_is_that_of_scipy_and_starts_settled(order: int, cutoff: float) -> None:
    values = 3.0 + np.random.default_rng(order).normal(size=2000).cumsum() / 10
    sections = design_low_pass(order, cutoff, 10_000.0)
    states, found = fill_low_pass(sections, float(values[0])), []
    for value in values.tolist():
        states, out = advance_low_pass(sections, states, value)
        found.append(out)
    expected = values
    if order:
        sos = butter(order, cutoff, fs=10_000.0, output="sos")
        expected, _ = sosfilt(sos, values, zi=sosfilt_zi(sos) * values[0])
    # the same sums; the settled start divides by 1 + a_1 + a_2 = (2 pi cutoff / rate)^2 >= 1e-4 and loses as much
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(values).max())
    assert found[0] == pytest.approx(values[0], rel=1e-11)


@pytest.mark.parametrize(
    ("order", "cutoff", "fields"),
    [
        (9, 1.0, {"argument": "low_pass_order", "value": 9}),
        (True, 1.0, {"argument": "low_pass_order", "value": True}),
        (2.0, 1.0, {"argument": "low_pass_order", "value": 2.0}),
        (5, None, {"argument": "cutoff"}),
        (5, 60.0, {"argument": "cutoff", "value": 60.0}),
    ],
)
def test_a_low_pass_that_cannot_be_designed_is_refused(
    order: object, cutoff: float | None, fields: dict[str, Any]
) -> None:
    with refused(**fields):
        design_low_pass(order, cutoff, 100.0)


def _by_expm(mass: float, damping: float, stiffness: float, period: float) -> np.ndarray:
    whole = np.array([[0.0, 1.0, 0.0], [-stiffness / mass, -damping / mass, 1 / mass], [0.0, 0.0, 0.0]])
    return expm(whole * period)[:2]


@pytest.mark.slow
@examples(400)
@given(
    mass=st.floats(0.05, 20),
    damping=st.one_of(st.just(0.0), st.floats(1e-6, 300)),
    stiffness=st.one_of(st.just(0.0), st.floats(1e-6, 3000)),
    period=st.floats(1e-5, 0.1),
)
@example(mass=1.0, damping=10.0, stiffness=25.0, period=1e-4)
@example(mass=1.0, damping=10.0, stiffness=25.0, period=0.1)
@example(mass=1.0, damping=80.0, stiffness=1600.0, period=0.1)
@example(mass=1.0, damping=0.0, stiffness=0.0, period=0.1)
def test_the_admittance_is_discretized_exactly(mass: float, damping: float, stiffness: float, period: float) -> None:
    """Beside the matrix exponential of SciPy, for every damping, also without stiffness."""
    n = discretize(VirtualAdmittance(mass=mass, damping=damping, stiffness=stiffness), period)
    expected = _by_expm(mass, damping, stiffness, period)
    found = [
        [n.position_from_position, n.position_from_velocity, n.position_from_force],
        [n.velocity_from_position, n.velocity_from_velocity, n.velocity_from_force],
    ]
    # expm is good to some 1e-16 of its largest entries; in units of T and M T they are all of order one
    scale = np.array([[1.0, period, period**2 / mass], [1 / period, 1.0, period / mass]])
    size = max(1.0, np.abs(expected / scale).max(), damping / mass * period, stiffness / mass * period**2)
    assert np.abs((found - expected) / scale).max() < 2e-14 * size


@pytest.mark.parametrize("ratio", [0.3, 1.0, 1.0 + 1e-9, 4.0])
def test_many_short_periods_are_one_long_one(ratio: float) -> None:
    """Exact means that the period does not matter, as long as the force stays."""
    made = VirtualAdmittance(mass=2.0, damping=2 * ratio * 10.0, stiffness=50.0)
    long, short = discretize(made, 0.5), discretize(made, 0.5 / 256)
    position, velocity = 0.1, -0.2
    for _ in range(256):
        position, velocity = advance_admittance(short, position, velocity, 3.0)
    assert (position, velocity) == pytest.approx(advance_admittance(long, 0.1, -0.2, 3.0), abs=256 * 2e-16)
