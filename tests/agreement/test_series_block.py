"""The block kernel compared with the guaranteed path, on random encounters: all proved contacts are right.

The claim is a relative error of 1e-9 in the time of contact. The kernel leaves an encounter open if its own error
estimate exceeds 1e-10, and the guaranteed path is accurate to rounding. A proved time with an error of 1e-9 would
therefore mean that the estimate is wrong by a factor of ten.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from pretouch.motion.curve import EDGE, LOW, MIDDLE, SWITCH, TERMS, TOP, curve_pieces, curve_windows, shared_curve
from pretouch.motion.kernels import CONTACT, OPEN, contact_times, solve_series
from pretouch.sensors import ExponentialSecondOrder, InversePower, MittagLeffler, SensorModel, Table

SENSORS: dict[str, SensorModel] = {
    "inverse-power": InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "exponential-2": ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
    "mittag-leffler": MittagLeffler(scale=1.0, rate=-80.0, order=0.8),
    "table": Table(
        distances=(0.0, 0.005, 0.012, 0.02, 0.03, 0.045, 0.06),
        outputs=(0.46, 0.31, 0.205, 0.13, 0.083, 0.041, 0.022),
    ),
}
FARTHEST = 0.055
TOP_OF_CURVE = 0.06
COUNT = 5_000
HORIZON = 20.0
CLAIM = 1e-9
SLOPE_TOLERANCE = 1e-13


def wide(count: int, seed: int) -> list[np.ndarray]:
    """All nine inputs over wide ranges: damped and not, moving plants, accelerated, missing the sensor, moving away."""
    rng = np.random.default_rng(seed)
    mass = 10 ** rng.uniform(-1, 1, count)
    omega = 10 ** rng.uniform(-0.5, 1.5, count)
    damping = 2 * mass * omega * 10 ** rng.uniform(-2, 0.8, count) * (rng.random(count) < 0.9)
    stiffness = mass * omega**2 * (rng.random(count) < 0.9)
    x0 = rng.uniform(-0.02, 0.02, count) * (rng.random(count) < 0.7)
    u0 = rng.uniform(-0.3, 0.3, count) * (rng.random(count) < 0.7)
    p = x0 + rng.uniform(0.001, FARTHEST, count)
    v = np.where(rng.random(count) < 0.95, -(10 ** rng.uniform(-2, 0.5, count)), rng.uniform(0, 0.1, count))
    a = rng.uniform(-3, 3, count) * (rng.random(count) < 0.5)
    gain = np.where(rng.random(count) < 0.9, -(10 ** rng.uniform(-3, 0.7, count)), 10 ** rng.uniform(-3, -1, count))
    return [mass, damping, stiffness, x0, u0, p, v, a, gain]


def letter(count: int, seed: int) -> list[np.ndarray]:
    """The letter's admittance and distance, over velocities and gains."""
    rng = np.random.default_rng(seed)
    one = [np.array([value]) for value in (1.0, 10.0, 25.0, 0.0, 0.0, 0.0422)]
    return [*one, rng.uniform(-1, -0.05, count), np.zeros(1), rng.uniform(-2, -0.05, count)]


def solve(inputs: list[np.ndarray], windows: np.ndarray, horizon: float = HORIZON) -> tuple[np.ndarray, np.ndarray]:
    count = max(len(values) for values in inputs)
    out, status = np.empty((6, count)), np.empty(count, dtype=np.int8)
    contact_times(tuple(inputs), shared_curve(windows), horizon, out, status)
    return out, status


def guaranteed(inputs: list[np.ndarray], sensor: SensorModel) -> tuple[np.ndarray, np.ndarray]:
    mass, damping, stiffness, x0, u0, p, v, a, gain = np.broadcast_arrays(*inputs)
    zero = np.zeros_like(mass)
    values = np.ascontiguousarray(np.column_stack([mass, damping, stiffness, x0, u0, p, v, a, zero, zero]))
    rows, status = np.empty((len(mass), 15)), np.empty(len(mass), dtype=np.int64)
    pieces = curve_pieces(sensor, 0.0, TOP_OF_CURVE)
    solve_series(values, np.ascontiguousarray(gain), pieces, (HORIZON, True, True), rows, status)
    return rows, status


@lru_cache
def table(name: str) -> np.ndarray:
    return curve_windows(SENSORS[name], 0.0, TOP_OF_CURVE)


@pytest.mark.parametrize("name", SENSORS)
def test_a_proved_contact_is_the_first_contact_of_the_guaranteed_path(name: str) -> None:
    inputs = wide(COUNT, seed=20261121)
    out, status = solve(inputs, table(name))
    rows, expected = guaranteed(inputs, SENSORS[name])
    proved = status == CONTACT
    assert set(np.unique(status)) <= {CONTACT, OPEN}
    assert (expected[proved] == 0).all(), "proved where the guaranteed path finds no contact"
    assert np.abs(out[0] / rows[:, 0] - 1)[proved].max() < CLAIM
    assert np.isnan(out[:, ~proved]).all()
    # What depends on time is off by its rate times the error in time; x~'' may turn within M / (D + D_p g), so that a
    # speed is compared with all the speeds that it adds up from, and ten times the claim is granted.
    slip = CLAIM * rows[:, 0] * np.abs(rows[:, 3])
    assert (np.abs(out[1] - rows[:, 2]) <= slip + 1e-12)[proved].all()
    fast = np.abs(rows[:, 3]) + np.abs(rows[:, 5]) + np.abs(inputs[6]) + np.abs(inputs[7]) * rows[:, 0]
    assert (np.abs(out[2] - rows[:, 3]) <= 10 * CLAIM * fast)[proved].all()
    assert (np.abs(out[4] - rows[:, 5]) <= 10 * CLAIM * fast)[proved].all()
    share = proved[expected == 0].mean()  # the others turn, recede at first, or are stiff
    assert share > 0.7, f"only {share:.3f} of the contacts are proved"


@pytest.mark.parametrize("name", SENSORS)
def test_the_balance_of_momentum_holds_with_the_integral_of_the_displacement(name: str) -> None:
    inputs = wide(COUNT, seed=7)
    out, status = solve(inputs, table(name))
    mass, damping, stiffness, x0, u0, p, v, _, gain = inputs
    _, x, u, _, _, area = out
    terms = np.array(
        [
            mass * (u - u0),
            damping * (x - x0),
            stiffness * area,
            -gain * (SENSORS[name].log_output(0.0) - SENSORS[name].log_output(p - x0)),
        ]
    )
    residual = np.abs(terms.sum(axis=0)) / (np.abs(terms).max(axis=0) + mass * np.abs(v))
    assert residual[status == CONTACT].max() < 1e-10  # the kernel's own limit, of which the time is the worst part


@pytest.mark.parametrize("name", SENSORS)
def test_the_letters_work_is_proved(name: str) -> None:
    inputs = letter(20_000, seed=3)
    out, status = solve(inputs, table(name), 600.0)
    assert (status == CONTACT).mean() >= 0.999
    some = [values if len(values) == 1 else values[:1000] for values in inputs]
    rows, expected = guaranteed(some, SENSORS[name])
    proved = (status[:1000] == CONTACT) & (rows[:, 0] < HORIZON) & (expected == 0)
    assert proved.mean() > 0.99
    assert np.abs(out[0, :1000] / rows[:, 0] - 1)[proved].max() < CLAIM


def test_numbers_that_are_none_are_never_a_contact() -> None:
    for which in range(9):
        for culprit in (np.nan, np.inf, -np.inf):
            inputs = [np.repeat(values, 12) if len(values) == 1 else values for values in letter(12, seed=4)]
            good, _ = solve(inputs, table("inverse-power"))
            inputs[which] = inputs[which].copy()
            inputs[which][5] = culprit
            out, status = solve(inputs, table("inverse-power"))
            others = np.arange(12) != 5
            assert status[5] == OPEN
            assert np.isnan(out[:, 5]).all()
            assert (status[others] == CONTACT).all()
            np.testing.assert_array_equal(out[:, others], good[:, others])


@pytest.mark.parametrize("change", [{0: 0.0}, {0: -1.0}, {6: 0.5}, {5: 0.0}, {5: -0.01}, {5: 0.5}, {1: 1e9}])
def test_what_is_no_approach_within_the_curve_is_left_open(change: dict[int, float]) -> None:
    inputs = letter(1, seed=5)
    for which, value in change.items():
        inputs[which] = np.array([value])
    assert solve(inputs, table("inverse-power"))[1].tolist() == [OPEN]


def test_a_contact_after_the_horizon_is_left_open() -> None:
    inputs = letter(1000, seed=6)
    times = solve(inputs, table("inverse-power"))[0][0]
    _, status = solve(inputs, table("inverse-power"), float(np.median(times)))
    np.testing.assert_array_equal(status == CONTACT, times <= np.median(times))


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5, 7, 8, 9, 16, 43])
def test_any_number_of_encounters_is_solved_as_each_of_them_alone(count: int) -> None:
    inputs = wide(count, seed=8)
    out, status = solve(inputs, table("table"))
    assert out.shape == (6, count)
    for i in range(count):
        alone, alone_status = solve([values[i : i + 1] for values in inputs], table("table"))
        assert alone_status[0] == status[i]
        np.testing.assert_array_equal(alone[:, 0], out[:, i])


@pytest.mark.parametrize("name", SENSORS)
def test_the_order_of_the_encounters_does_not_matter(name: str) -> None:
    inputs = wide(1000, seed=9)
    order = np.random.default_rng(1).permutation(1000)
    out, status = solve(inputs, table(name))
    shuffled, shuffled_status = solve([values[order] for values in inputs], table(name))
    np.testing.assert_array_equal(shuffled_status, status[order])
    np.testing.assert_array_equal(shuffled, out[:, order])


def test_an_input_of_length_one_holds_for_all() -> None:
    inputs = letter(50, seed=10)
    out, status = solve(inputs, table("mittag-leffler"))
    repeated = [np.repeat(values, 50) if len(values) == 1 else values for values in inputs]
    again, again_status = solve(repeated, table("mittag-leffler"))
    np.testing.assert_array_equal(again, out)
    np.testing.assert_array_equal(again_status, status)


@pytest.mark.parametrize("name", SENSORS)
def test_windows_meet_the_slope_wherever_a_step_may_read_them(name: str) -> None:
    windows = table(name)
    assert windows[0, LOW] == 0.0
    assert windows[-1, TOP] == TOP_OF_CURVE
    assert (windows[1:, LOW] <= windows[:-1, TOP]).all()
    assert (windows[1:, SWITCH] <= windows[:-1, TOP] + 1e-6 * TOP_OF_CURVE).all()
    for row in windows:
        assert row[LOW] - row[EDGE] <= 1e-6 * (row[TOP] - row[LOW])
        distance = np.linspace(row[LOW], row[TOP], 101)
        expected = SENSORS[name].log_slope(distance)
        z = distance - row[MIDDLE]
        terms = row[TERMS:]
        found = terms[0] / z if len(terms) == 1 else sum(j * terms[j] * z ** (j - 1) for j in range(1, len(terms)))
        # four times the tolerance: between the probes, and for the rounding of ten terms
        assert np.abs(found - expected).max() <= 4 * SLOPE_TOLERANCE * np.abs(expected).max()


def test_a_curve_that_ends_before_the_surface_has_no_contact() -> None:
    sensor = SENSORS["inverse-power"]
    windows = curve_windows(sensor, 0.01, TOP_OF_CURVE)
    assert (solve(letter(20, seed=11), windows)[1] == OPEN).all()


def test_what_the_kernel_would_misread_is_refused() -> None:
    inputs, (windows, starts, curve_of) = letter(20, seed=14), shared_curve(table("table"))
    out, status = np.empty((6, 20)), np.empty(20, dtype=np.int8)
    good = (tuple(inputs), (windows, starts, curve_of), HORIZON, out, status)
    contact_times(*good)
    wrong_curves = [
        (windows[:, :-1].copy(), starts, curve_of),  # a degree that is none
        (windows, starts + 1, curve_of),
        (windows, starts, curve_of + 1),
        (windows, starts, np.repeat(curve_of, 19)),
        (windows, starts, np.repeat(curve_of + 1, 20)),
        (windows, starts[::-1].copy(), np.repeat(curve_of, 20)),
    ]
    for curves in wrong_curves:
        with pytest.raises(ValueError, match="curve"):
            contact_times(tuple(inputs), curves, HORIZON, out, status)
    for few, found in (
        (inputs[:8], "9 input columns, .* received 8"),
        ([*inputs[:8], inputs[8][:19]], "1 or 20 numbers"),
    ):
        with pytest.raises(TypeError, match=found):
            contact_times(tuple(few), *good[1:])
    with pytest.raises(TypeError, match="shape"):
        contact_times(*good[:3], np.empty((5, 20)), status)
    with pytest.raises(TypeError, match="int8"):
        contact_times(*good[:4], status.astype(np.int64))
    with pytest.raises(TypeError, match="contiguous"):
        contact_times(*good[:3], np.empty((20, 6)).T, status)


STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # central, of order 8


def differences(inputs: list[np.ndarray], sensor: SensorModel, which: int, step: np.ndarray) -> np.ndarray:
    """Derivatives of time, x~ and l' at contact by one input, from the guaranteed path."""
    total = np.zeros((3, len(step)))
    for k, weight in STENCIL:
        for sign in (1, -1):
            moved = [values + sign * k * step if i == which else values for i, values in enumerate(inputs)]
            rows, status = guaranteed(moved, sensor)
            found = np.where(status == 0, rows[:, [0, 2, 5]].T, np.nan)
            total += sign * weight * found / step
    return total


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("name", SENSORS)
def test_gradients_agree_with_differences_of_the_guaranteed_path(name: str) -> None:
    count = 60
    near = [np.repeat(values, count) if len(values) == 1 else values for values in letter(count, seed=12)]
    inputs = [np.concatenate(pair) for pair in zip(near, wide(2 * count, seed=13), strict=True)]
    out, status = solve(inputs, table(name))
    again, gradients = np.empty((6, 3 * count)), np.empty((3, 9, 3 * count))
    again_status = np.empty(3 * count, dtype=np.int8)
    contact_times(tuple(inputs), shared_curve(table(name)), HORIZON, again, again_status, gradients=gradients)
    settled = again_status == CONTACT
    assert (status[settled] == CONTACT).all()
    assert settled.sum() > 0.95 * (status == CONTACT).sum(), "what is very stiff has a contact but no gradient here"
    np.testing.assert_allclose(
        again[0, settled], out[0, settled], rtol=CLAIM
    )  # by shorter steps where the responses ask for them
    assert np.isnan(gradients[:, :, ~settled]).all()
    proved = np.flatnonzero(settled)
    inputs, gradients = [values[proved] for values in inputs], gradients[:, :, proved]
    mass, damping, stiffness, x0, u0, p, v, a, gain = inputs
    distance, speed = p - x0, np.abs(v - u0)
    rate = speed / distance
    scales = [mass, damping + mass * rate, stiffness + mass * rate**2, distance, speed, distance, speed]
    scales += [np.abs(a) + speed * rate, np.abs(gain) + mass * speed / 50]
    size = np.stack([out[0, proved], distance, speed])
    checked = 0
    for which, scale in enumerate(scales):
        coarse = differences(inputs, SENSORS[name], which, 4e-3 * scale) * scale
        fine = differences(inputs, SENSORS[name], which, 2e-3 * scale) * scale
        found = gradients[:, which] * scale
        allowed = 1e-8 * (size + np.abs(found))
        with np.errstate(invalid="ignore"):
            trusted = np.abs(coarse - fine) < allowed / 4  # elsewhere the difference itself is not that good
        assert (np.abs(found - fine) <= allowed)[trusted].all(), which
        checked += trusted.mean() / 9
    assert checked > 0.8
