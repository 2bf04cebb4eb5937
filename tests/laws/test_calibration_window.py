"""The usable window: beyond clipping and peak, above the floor; and the statistics that it stands on."""

import itertools
import subprocess
import sys

import numpy as np
import pytest

from pretouch import calibration
from pretouch._core.errors import CalibrationDataError, InvalidInputError, ResultUnavailableError
from pretouch.calibration import Calibration, find_window, fit, fit_sensor
from pretouch.calibration.averaging import average, reading_noise, resolution
from pretouch.calibration.least_squares import intervals, minimize_many
from pretouch.calibration.model_fit import runs_p_value
from pretouch.calibration.preparation import chance_of_falling

STEPS = np.arange(8) * 0.01


def measured(outputs, unit="V", **options):
    return Calibration(distances=STEPS[: len(outputs)], outputs=outputs, unit=unit, **options)


def test_the_window_starts_beyond_the_full_scale_of_a_converter():
    window = find_window(measured([1020, 1020, 600, 300, 150, 75, 38, 20], "counts"), 0.0, noise=2.0)
    assert window.l_min == 0.02
    assert window.saturation == 1020
    assert "10-bit" in window.start_reason


def test_the_window_starts_beyond_a_plateau_of_equal_highest_outputs():
    window = find_window(measured([4.71, 4.71, 4.71, 2.13, 1.02, 0.61, 0.33, 0.12]), 0.0, noise=0.01)
    assert window.l_min == 0.03
    assert "3 distances" in window.start_reason


@pytest.mark.parametrize(("saturation", "first"), [(4.0, 0.01), (2.0, 0.02), (None, 0.0)])
def test_a_declared_saturation_is_believed(saturation, first):
    readings = measured([4.7, 2.1, 1.0, 0.6, 0.3, 0.15, 0.08, 0.04])
    assert find_window(readings, 0.0, noise=0.001, saturation=saturation).l_min == first


@pytest.mark.parametrize("peak", ["auto", 0.02, "20 mm"])
def test_the_window_starts_at_the_near_field_peak(peak):
    window = find_window(measured([1.0, 2.0, 3.0, 2.2, 1.1, 0.6, 0.3, 0.2]), 0.0, noise=0.01, near_field_peak=peak)
    assert window.l_min == 0.02
    assert "peaks at 20 mm" in window.start_reason


def test_one_high_reading_is_no_peak_and_one_at_full_scale_no_clipping():
    high = find_window(measured([3.0, 2.0, 1.4, 1.0, 9.0, 0.5, 0.3, 0.2]), 0.0, noise=0.01)
    clipped = find_window(measured([900, 500, 300, 200, 1023, 100, 80, 60], "counts"), 0.0, noise=1.0)
    assert high.l_min == clipped.l_min == 0.0


def test_the_window_ends_where_the_signal_sinks_into_the_noise():
    readings = measured([3.0, 2.0, 1.4, 1.2, 1.08, 1.04, 1.02, 1.01])
    window = find_window(readings, (1.0, 0.0), noise=0.02)
    assert window.l_max == 0.04  # 0.08 is 4 sigma, 0.04 is 2
    assert find_window(readings, (1.0, 0.0), noise=0.02, floor_sigmas=5.0).l_max == 0.03
    assert find_window(readings, (1.0, 0.03), noise=0.02).l_max == 0.03  # 0.08 is 2.2 of sqrt(0.02^2 + 0.03^2)
    end_reason = find_window(readings, 1.0, noise=0.01).end_reason
    assert "60 mm" in end_reason
    assert "1 V" in end_reason


@pytest.mark.slow
def test_unless_told_otherwise_every_verb_ends_the_window_at_three_sigma():
    """From one distance to the next the signal falls by 5 %: a floor of 3.3 sigma, 10 % more, ends it sooner."""
    rng = np.random.default_rng(3)
    distance = 0.01 * 1.0125 ** np.arange(200)
    outputs = 1e-6 / distance**4 + rng.normal(0.0, 1e-5, len(distance))
    readings = Calibration(distances=distance, outputs=outputs, no_object=rng.normal(0.0, 0.01, 400), unit="V")
    given = fit_sensor(readings, floor_sigmas=3.0).window
    assert fit_sensor(readings).window == given
    assert fit(readings, ["inverse-power"]).fits[0].window == given
    assert fit_sensor(readings, floor_sigmas=3.3).window != given


def test_one_low_reading_ends_no_window():
    window = find_window(measured([3.0, 2.0, 1.4, 0.9, 1.25, 1.2, 1.15, 1.1]), (1.0, 0.0), noise=0.02)
    assert window.l_max == 0.07
    assert 0.03 not in window.distances


def test_a_window_without_points_refuses_to_name_its_ends():
    window = find_window(measured([1.0, 1.0, 1.1, 1.0, 0.9, 1.0]), 1.05, noise=0.5)
    assert window.distances == ()
    with pytest.raises(ResultUnavailableError, match="no usable window"):
        _ = window.l_min


def test_requests_that_make_no_sense_are_refused():
    readings = measured([3.0, 2.0, 1.4, 1.2, 1.1])
    with pytest.raises(InvalidInputError, match="noise: found None"):
        find_window(readings, 0.0)
    with pytest.raises(InvalidInputError, match="saturation: found 'maybe'"):
        find_window(readings, 0.0, noise=0.1, saturation="maybe")
    with pytest.raises(InvalidInputError, match=r"near_field_peak: found 0\.5 m"):
        find_window(readings, 0.0, noise=0.1, near_field_peak=0.5)
    with pytest.raises(CalibrationDataError, match="every distance"):
        find_window(readings, 0.0, noise=0.1, saturation=1.0)
    with pytest.raises(InvalidInputError, match="floor_sigmas"):
        fit(readings, floor_sigmas=0.0)
    with pytest.raises(InvalidInputError, match="offset: found 'guess'"):
        fit(readings, offset="guess")
    with pytest.raises(InvalidInputError, match="expected one of exponential-1"):
        fit_sensor(readings, "cubic")


def test_noise_of_repeats_is_found_whatever_jitters_near_the_sensor():
    rng = np.random.default_rng(1)
    distance = np.repeat(np.linspace(0, 0.07, 30), 6)
    xi = 4 * np.exp(-60 * distance)
    outputs = 1 + xi * (1 + 0.05 * rng.standard_normal(180)) + 0.01 * rng.standard_normal(180)
    readings = Calibration(distances=distance, outputs=outputs)
    found = reading_noise(readings, average(readings)).sigma
    # some 60 degrees of freedom are in the far field: 1 / sqrt(120) = 9 % standard error, three of them
    assert found == pytest.approx(0.01, rel=0.3)


@pytest.mark.parametrize("step", [4.0, 0.00488])
def test_the_step_of_the_converter_is_found(step):
    rng = np.random.default_rng(2)
    assert resolution(measured(step * rng.integers(5, 255, 8))) == pytest.approx(step, rel=1e-6)
    assert resolution(measured(rng.random(8))) == 0.0


def test_the_chance_of_falling_is_that_of_all_orders():
    for fallen in itertools.permutations(range(5)):
        rising = [sum(b > a for a, b in itertools.combinations(order, 2)) for order in itertools.permutations(range(5))]
        mine = sum(b > a for a, b in itertools.combinations(fallen, 2))
        expected = sum(r <= mine for r in rising) / 120
        assert chance_of_falling(np.array(fallen, dtype=float)) == pytest.approx(expected, rel=1e-12)


def test_the_runs_test_is_that_of_all_orders_of_signs():
    orders = sorted(set(itertools.permutations([1.0] * 4 + [-1.0] * 3)))
    runs = [1 + sum(a != b for a, b in itertools.pairwise(order)) for order in orders]
    for order, count in zip(orders, runs, strict=True):
        expected = sum(r <= count for r in runs) / len(runs)
        assert runs_p_value(np.array(order)) == pytest.approx(expected, rel=1e-12)
    assert runs_p_value(np.ones(5)) is None
    rounded = np.array([1.0, 1e-16, -1e-16, 2.0, -1e-17, -1.0, -3.0])  # of a table through most of its readings
    assert runs_p_value(rounded) == runs_p_value(rounded[[0, 3, 5, 6]])


def test_the_profile_of_a_linear_problem_is_its_ellipse():
    x = np.linspace(0, 1, 9)
    y = 2 + 3 * x + 0.1 * np.sin(40 * x)
    design = np.stack([np.ones(9), x], axis=1)
    bounds = (np.full(2, -np.inf), np.full(2, np.inf))
    best = minimize_many(lambda u, _: u @ design.T - y, np.zeros((1, 2)), bounds)
    direction = np.array([[1.0, 0.5], [0.0, 1.0]])
    half = 2.0 * np.sqrt(np.diag(direction @ np.linalg.inv(design.T @ design) @ direction.T))
    found = intervals(lambda u, _: u @ design.T - y, best, bounds, lambda u: u @ direction.T, 4.0)
    for (low, high, *reached), width, middle in zip(found, half, direction @ best.x[0], strict=True):
        # the search stops within 1 % of the height, which is linear in the coordinate
        assert (high - low) / 2 == pytest.approx(width, rel=0.011)
        assert (high + low) / 2 == pytest.approx(middle, abs=0.011 * width)
        assert reached == [True, True]


def test_a_profile_that_meets_a_bound_says_so():
    bounds = (np.array([-0.5]), np.array([9.0]))
    best = minimize_many(lambda u, _: u, np.array([[1.0]]), bounds)
    [(low, high, low_reached, high_reached)] = intervals(lambda u, _: u, best, bounds, lambda u: u, 4.0)
    assert (low_reached, high_reached) == (False, True)
    assert low == pytest.approx(-0.5, abs=1e-3)
    assert high == pytest.approx(2.0, rel=0.011)


def test_many_minima_are_those_of_a_solver_that_takes_one():
    """Exponentials from starts around the truth, each held or not by a bound, against SciPy's trust-region method."""
    from scipy.optimize import least_squares

    rng = np.random.default_rng(1)
    x = np.linspace(0, 2, 12)
    truth = np.column_stack([rng.uniform(0.5, 2, 40), rng.uniform(-3, -0.2, 40)])
    y = truth[:, :1] * np.exp(truth[:, 1:] * x) + 0.02 * rng.normal(size=(40, 12))
    bounds = (np.array([0.0, -2.0]), np.array([np.inf, 0.0]))

    def residuals(u, which):
        return u[:, :1] * np.exp(u[:, 1:] * x) - y[which]

    found = minimize_many(residuals, np.tile([1.0, -1.0], (40, 1)), bounds, tolerance=1e-14)
    for i in range(40):
        other = least_squares(
            lambda u, i=i: residuals(u[None], [i])[0], [1.0, -1.0], bounds=bounds, xtol=1e-12, ftol=1e-14
        )
        # both know a minimum to the root of rounding in the cost, of the derivatives by differences of 1e-6
        assert found.costs[i] <= 2 * other.cost * (1 + 1e-9)
        assert found.x[i] == pytest.approx(other.x, abs=1e-5)


def test_the_public_names_are_sorted_and_there():
    assert calibration.__all__ == sorted(calibration.__all__)
    assert all(getattr(calibration, name).__doc__ for name in calibration.__all__)


def test_importing_calibration_loads_no_scipy():
    code = "import sys, pretouch.calibration; print(any(m.split('.')[0] == 'scipy' for m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.slow
def test_a_long_plateau_hides_no_signal():
    distance = np.arange(24) * 0.01
    outputs = np.round(50 + 900 * np.exp(-100 * distance))
    report = fit(Calibration(distances=distance, outputs=outputs, unit="counts", no_object=[50, 50, 51, 49]))
    assert report.verdict != "no usable signal"
    assert report.best.sensor.log_slope(report.window.l_min) == pytest.approx(
        -100, rel=0.1
    )  # rounding of 1 in 900 to 6


@pytest.mark.parametrize("at", [slice(0, 1), slice(None)])
def test_glitches_at_full_scale_among_good_readings_are_not_clipping(at):
    rng = np.random.default_rng(4)
    outputs = np.round(1000 + 32000 * (0.03 / (0.03 + STEPS[:, None])) ** 2.5 + 20 * rng.standard_normal((8, 5)))
    outputs[at, 2] = 65535
    empty = np.round(1000 + 20 * rng.standard_normal(6))
    readings = Calibration(
        distances=np.repeat(STEPS, 5), outputs=outputs.ravel(), no_object=[65535, *empty], unit="counts"
    )
    report = fit(readings, ["inverse-power"])
    assert report.verdict == "usable"
    assert (report.window.l_min, report.window.saturation) == (0.0, None)
    assert find_window(readings, 1000.0).l_min == 0.0
    assert report.best.outliers == tuple(5 * i + 2 for i in range(8)[at])


def noisy(clean, seed=6, sigma=0.002, repeats=4):
    noise = np.random.default_rng(seed).normal(0.0, sigma, (len(clean), repeats))
    return np.asarray(clean)[:, None] + noise


def test_clipping_with_noise_is_clipping_and_costs_no_good_readings():
    distance = np.array([0.0, 2.0, 5.0, 8.0, 12.0, 17.0, 25.0, 35.0, 50.0, 70.0]) * 1e-3
    outputs = noisy(np.minimum(0.1 + 3.2 * (0.03 / (0.03 + distance)) ** 2.5, 2.5))
    empty = noisy([0.1], repeats=5).ravel()
    readings = Calibration(distances=np.repeat(distance, 4), outputs=outputs.ravel(), unit="V", no_object=empty)
    window = fit(readings, ["inverse-power"]).window
    assert window.saturation == outputs[:2].min()
    assert window.l_min == 0.005


def test_a_round_peak_with_noise_is_no_clipping():
    distance = np.linspace(0.0, 0.06, 16)
    outputs = noisy(3.0 / (1.0 + (distance / 0.02) ** 2))
    readings = Calibration(distances=np.repeat(distance, 4), outputs=outputs.ravel(), unit="V")
    assert find_window(readings, 0.0).saturation is None
