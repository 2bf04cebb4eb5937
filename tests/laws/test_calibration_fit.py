"""Fits recover what made the readings, say how well they know it, and do not depend on units."""

import math
import warnings

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from pretouch.calibration import Calibration, fit, fit_sensor
from pretouch.calibration.averaging import count_copies_once, leave_out_empty_outliers
from pretouch.calibration.result import uncertainty_in_words
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, MittagLeffler

# Table I of the letter; the Mittag-Leffler curve falls as much over the same distance
SENSORS = {
    "inverse-power": InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "exponential-1": ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "exponential-2": ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
    "mittag-leffler": MittagLeffler(scale=0.5, rate=-80.0, order=0.9),
}
PEDESTAL, OUTPUT_NOISE, JITTER = 0.2, 0.0015, 0.01


def exact(model, *, points=20, last=0.0422, pedestal=0.0):
    distance = np.linspace(0.0, last, points)
    return Calibration(distances=distance, outputs=SENSORS[model].output(distance) + pedestal, unit="V")


def noisy(model, seed, *, points=15, last=0.05, no_object=6, repeats=1):
    """Readings as the fit assumes them: relative jitter per distance, output noise per reading."""
    rng = np.random.default_rng(seed)
    distance = np.linspace(0.0, last, points)
    xi = SENSORS[model].output(distance) * (1 + JITTER * rng.standard_normal(points))
    outputs = PEDESTAL + np.repeat(xi, repeats) + OUTPUT_NOISE * rng.standard_normal(points * repeats)
    return Calibration(
        distances=np.repeat(distance, repeats),
        outputs=outputs,
        unit="V",
        no_object=PEDESTAL + OUTPUT_NOISE * rng.standard_normal(no_object),
    )


@pytest.mark.slow(keep=3)
@pytest.mark.parametrize("model", SENSORS)
@pytest.mark.parametrize("offset", ["zero", 0.0, (0.0, 0.0)])
def test_exact_readings_give_their_parameters_back(model, offset):
    fit = fit_sensor(exact(model), model, offset=offset)
    for name, value in SENSORS[model].parameters.items():
        # 1e-16 of rounding in ln xi, times a condition number of at most 1e6 for three parameters on 20 points
        assert fit.parameters[name].value == pytest.approx(value, rel=1e-9)
    assert fit.rmse_log_output < 1e-12


@pytest.mark.parametrize(("rate", "points", "last"), [(-100.0, 18, 0.285), (-60.0, 12, 0.3), (-130.0, 25, 0.2)])
def test_exact_readings_over_many_decades_are_a_signal_of_their_curve(rate, points, last):
    """A noise estimate of 1e-8 of the output made later fits stop early: 0.17 V of noise, and no usable signal."""
    distance = np.linspace(0.0, last, points)
    report = fit(Calibration(distances=distance, outputs=7.04 * np.exp(rate * distance), unit="V"))
    assert report.verdict in {"usable", "usable with reservations"}
    assert report.noise.output < 1e-4 * 7.04
    assert report.best.model == "exponential-1"
    found = report.best.parameters["rate"]
    assert abs(found.value - rate) < max(3 * found.standard_error, 1e-6 * abs(rate))  # 1e-6: the smallest noise


@pytest.mark.parametrize("pedestal", [0.0, 0.3])
def test_exact_power_readings_give_the_offset_back_too(pedestal):
    fit = fit_sensor(exact("inverse-power", pedestal=pedestal), "inverse-power")
    assert fit.offset.kind == "fitted"
    assert fit.offset.value == pytest.approx(pedestal, abs=1e-9)
    for name, value in SENSORS["inverse-power"].parameters.items():
        assert fit.parameters[name].value == pytest.approx(value, rel=1e-6)


def test_a_wrong_model_is_fitted_on_the_logarithm():
    measured = exact("inverse-power")
    fit = fit_sensor(measured, "exponential-1", offset="zero")
    slope, level = np.polyfit(measured.distances, np.log(measured.outputs), 1)
    # exact readings are weighed as logarithms but for (sigma / (sigma_rel xi))^2 <= (0.45 / 400 / 0.048)^2 = 6e-4
    assert fit.parameters["rate"].value == pytest.approx(slope, rel=2e-3)
    assert math.log(fit.parameters["scale"].value) == pytest.approx(level, abs=5e-3)


@pytest.mark.parametrize("model", SENSORS)
def test_noisy_readings_give_their_parameters_within_their_errors(model):
    fit = fit_sensor(noisy(model, 3), model)
    for name, value in SENSORS[model].parameters.items():
        estimate = fit.parameters[name]
        # 95 % intervals of 11 and more degrees of freedom are 2.2 standard errors wide; twice that is 1 in 1e4 or less
        low = estimate.value - 2 * (estimate.value - estimate.low)
        high = estimate.value + 2 * (estimate.high - estimate.value)
        assert low <= value <= high
        assert estimate.low < estimate.value < estimate.high


def binomial_below(hits, trials, chance):
    return sum(math.comb(trials, k) * chance**k * (1 - chance) ** (trials - k) for k in range(hits + 1))


@pytest.mark.slow
@pytest.mark.parametrize(("model", "name"), [("inverse-power", "exponent"), ("exponential-1", "rate")])
def test_intervals_hold_the_truth_as_often_as_they_say(model, name):
    trials, truth = 16, SENSORS[model].parameters[name]
    held, deviations = 0, []
    for seed in range(trials):
        estimate = fit_sensor(noisy(model, 1000 + seed), model).parameters[name]
        held += estimate.low <= truth <= estimate.high
        deviations.append((estimate.value - truth) / estimate.standard_error)
    # seeded, so it passes always or never; the bound is what a coverage of 0.95 undercuts once in 10,000 times
    bound = next(h for h in range(trials + 1) if binomial_below(h, trials, 0.95) > 1e-4)
    assert held >= bound
    # and the intervals are not merely wide: chi^2 of 16 deviations lies in [0.22, 2.6] x 16 but for 1 in 1e3; the
    # standard error itself is known to 20 % from 12 degrees of freedom, which widens that to [0.19, 3.1]
    assert 0.19 < np.mean(np.square(deviations)) < 3.1


@pytest.mark.parametrize("points", [11, 12])
def test_the_slope_of_a_table_is_known_as_well_as_it_scatters(points):
    """The middle of the window is a point of the table, or lies between two: there its interpolant scatters more.

    SciPy's interpolant through 4,000 curves that the noise makes is the other way; the fit knows the noise to 10 %.
    """
    distance, repeats, noise = 0.004 * np.arange(points), 6, 0.002
    rng = np.random.default_rng(2)
    readings = np.repeat(SENSORS["exponential-1"].output(distance), repeats)
    outputs = readings + noise * rng.standard_normal(len(readings))
    measured = Calibration(distances=np.repeat(distance, repeats), outputs=outputs, unit="V")
    fit = fit_sensor(measured, "table", offset="zero")
    assert len(fit.distances) == points
    means = outputs.reshape(-1, repeats).mean(axis=1)[:, None]
    curves = np.log(means + noise / math.sqrt(repeats) * rng.standard_normal((points, 4000)))
    slopes = PchipInterpolator(distance, curves)((distance[0] + distance[-1]) / 2, 1)
    slope = fit.middle_slope
    assert slope.standard_error == pytest.approx(np.std(slopes), rel=0.25)
    assert slope.low <= -61.0 <= slope.high
    assert not slope.low <= -61.0 / 2 <= slope.high
    assert (slope.high - slope.low) / slope.standard_error == pytest.approx(2 * 1.96)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("model", SENSORS)
@pytest.mark.parametrize("factor", [1e-3, 7.3])
def test_the_scale_of_the_output_changes_no_shape(model, factor):
    measured = noisy(model, 5)
    scaled = Calibration(
        distances=measured.distances, outputs=factor * measured.outputs, no_object=factor * measured.no_object
    )
    fits = [fit_sensor(m, model) for m in (measured, scaled)]
    for name, estimate in fits[0].parameters.items():
        if name != "scale":
            # least squares stops at 1e-13 of its sum, so at about 3e-7 of the width of the interval
            width = estimate.high - estimate.low if math.isfinite(estimate.high - estimate.low) else estimate.value
            assert fits[1].parameters[name].value == pytest.approx(estimate.value, abs=1e-4 * abs(width))
    assert fits[1].window.distances == fits[0].window.distances


def test_more_readings_give_smaller_errors():
    few, many = (fit_sensor(noisy("inverse-power", 8, points=n), "inverse-power") for n in (12, 96))
    # 8 times the points: sqrt(8) = 2.8; half of that allows for the scatter of the noise estimate of 9 points
    assert few.middle_slope.standard_error > 1.4 * many.middle_slope.standard_error


def test_a_pedestal_left_in_weakens_the_slope_and_r_squared_hides_it():
    distance = np.repeat(np.arange(0.0, 0.081, 0.005), 3)
    rng = np.random.default_rng(2)
    outputs = 0.3 + SENSORS["inverse-power"].output(distance) + 0.001 * rng.standard_normal(distance.size)
    measured = Calibration(distances=distance, outputs=outputs, unit="V", no_object=[0.3, 0.301, 0.299])
    truth = SENSORS["inverse-power"].log_slope(0.04)
    honest = fit_sensor(measured, "inverse-power").sensor.log_slope(0.04)
    naive = fit_sensor(measured, "inverse-power", offset="zero")
    # the slope of ln(o + xi) is g xi / (o + xi): at 40 mm xi = 0.056 V, so it is 6.4 times too small
    weakening = truth / naive.sensor.log_slope(0.04)
    assert 4 < weakening < 24
    assert naive.r_squared > 0.95
    assert honest == pytest.approx(truth, rel=0.05)  # xi is known to 1 % there, over steps of 0.2 in ln xi
    report = fit(measured, offset="zero")
    assert report.verdict == "usable with reservations"
    assert any("subtracts too little" in reason for reason in report.reasons)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(("index", "wrong"), [(5, 0.0), (11, 0.35), (7, 0.9)])
def test_a_single_bad_reading_moves_nothing(index, wrong):
    measured = noisy("inverse-power", 12, points=20)
    outputs = measured.outputs.copy()
    outputs[index] = wrong
    spoiled = Calibration(distances=measured.distances, outputs=outputs, unit="V", no_object=measured.no_object)
    clean, robust = (fit_sensor(m, "inverse-power") for m in (measured, spoiled))
    assert robust.outliers == (index,)
    # leaving one of 20 points out moves an estimate by about 1/sqrt(20) of its error, three times that is rare
    assert abs(robust.middle_slope.value - clean.middle_slope.value) < 0.7 * clean.middle_slope.standard_error


def test_a_bad_reading_among_repeats_is_left_out_alone():
    measured = noisy("inverse-power", 13, repeats=5)
    outputs = measured.outputs.copy()
    outputs[22] = 0.0
    fit = fit_sensor(Calibration(distances=measured.distances, outputs=outputs, unit="V"), "inverse-power")
    assert fit.outliers == (22,)
    assert measured.distances[22] in fit.distances


def counts(no_object, repeats=3):
    distance = np.repeat(np.linspace(0.0, 0.08, 9), repeats)
    outputs = np.round(150 + 3150 * (0.03 / (distance + 0.03)) ** 2 + np.resize([3, -5, 2, 4, -2], len(distance)))
    return Calibration(distances=distance, outputs=outputs, unit="counts", no_object=no_object)


EMPTY = (150.0, 151.0, 149.0, 152.0, 148.0, 150.0, 151.0, 149.0)


@pytest.mark.parametrize("glitch", [0.0, 4000.0, 65535.0])
def test_a_glitch_without_an_object_changes_nothing_and_is_reported(glitch):
    clean, spoiled = fit(counts(EMPTY), ("inverse-power",)), fit(counts((*EMPTY, glitch)), ("inverse-power",))
    assert (spoiled.verdict, spoiled.window) == (clean.verdict, clean.window)
    assert (spoiled.offset, spoiled.noise, spoiled.notes) == (clean.offset, clean.noise, clean.notes)
    assert [text for text in spoiled.left_out if text not in clean.left_out] == [
        f"1 reading without an object that deviates from the others: {glitch:.0f} counts."
    ]


@pytest.mark.parametrize("glitch", [0.0, 900.0, 65535.0, 2.0**24 - 1])
@pytest.mark.parametrize("empty", [EMPTY[:3], EMPTY[:2], (150.0,) * 6, EMPTY])
def test_a_glitch_among_few_readings_without_an_object_is_found(empty, glitch):
    cleaned, outliers = leave_out_empty_outliers(counts((*empty, glitch)))
    assert (tuple(cleaned.no_object), tuple(outliers)) == (empty, (glitch,))


@pytest.mark.parametrize(
    ("index", "sentence"),
    [
        (8, "1 reading of 0 counts at 80 mm, beyond all other readings: no signal there."),
        (5, "1 reading of 0 counts at 50 mm, although all other readings are clearly above 0 (dropout)."),
    ],
)
def test_a_single_reading_of_zero_is_not_compared_with_others_at_its_distance(index, sentence):
    measured = counts((), repeats=1)
    outputs = np.where(np.arange(9) == index, 0.0, measured.outputs)
    report = fit(Calibration(distances=measured.distances, outputs=outputs, unit="counts"), ("inverse-power",))
    assert sentence in report.left_out
    assert "other readings at the same distance" not in str(report)


def test_one_output_among_zeros_is_no_signal():
    distance = np.array([19, 31, 43, 45, 54, 78, 83, 92, 95, 98, 99]) / 1e3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        report = fit(Calibration(distances=distance, outputs=1.06e-9 * (distance == 0.045), unit="V"))
    assert (report.verdict, report.best) == ("no usable signal", None)


@pytest.mark.parametrize("repeats", [1, 3])
@pytest.mark.parametrize("count", [3, 4, 5, 6, 10, 30])
def test_normal_readings_without_an_object_stay(count, repeats):
    """False alarms in at most 1 % of the files: more than 9 of 300 occur once in 800 such tests."""
    rng = np.random.default_rng(count)
    files = (counts(150 + 3 * rng.standard_normal(count), repeats) for _ in range(300))
    assert sum(len(leave_out_empty_outliers(measured)[1]) > 0 for measured in files) <= 9


@pytest.mark.parametrize(
    ("size", "level", "unit"), [(2000.0, 3186950.0, "Hz"), (9e6, 3e7, "counts"), (0.002, 2.5, "V")]
)
def test_the_digits_of_an_offset_show_its_interval(size, level, unit):
    """A small signal on a large offset, as of a counter of pulses: four digits cannot show the signal."""
    distance = np.repeat(np.linspace(0.0, 0.08, 9), 3)
    noise = size * 1e-3 * np.random.default_rng(1).standard_normal(35)
    outputs = level + size * (0.03 / (distance + 0.03)) ** 2 + noise[:27]
    measured = Calibration(distances=distance, outputs=outputs, unit=unit, no_object=level + noise[27:])
    report = fit(measured, ("inverse-power",))
    text, (low, high) = str(report), report.offset.interval_in_words("").split(" to ")
    assert low != high
    assert report.offset.in_words("").split(" ")[0] not in {low, high}
    # both ends are shown to 5 % of the interval or better
    assert max(abs(float(low) - report.offset.low), abs(float(high) - report.offset.high)) < 0.05 * (
        report.offset.high - report.offset.low
    )
    assert "e+0" not in text


@pytest.mark.parametrize(
    ("uncertainty", "text"),
    [(0.123, "12 %"), (0.999, "99.9 %"), (1.5, "a factor of 2.5"), (79.0, "a factor of 80")],
)
def test_a_large_uncertainty_is_a_factor(uncertainty, text):
    assert uncertainty_in_words(uncertainty) == text
    assert uncertainty_in_words(3e7) == "more than a factor of 1000"


def test_the_report_says_that_exponent_and_offset_run_away():
    fit = fit_sensor(noisy("exponential-1", 4), "inverse-power")
    assert math.isinf(fit.parameters["exponent"].high)
    assert math.isinf(fit.parameters["distance_offset"].high)
    assert "can grow together" in fit.unidentifiable[0]
    # the slope stays known: within its own interval, widened twice, and finite as a sensor
    half = fit.middle_slope.high - fit.middle_slope.low
    assert abs(fit.middle_slope.value + 61.0) < half
    assert np.isfinite(fit.sensor.log_output(np.linspace(*fit.sensor.valid_range, 9))).all()


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("model", SENSORS)
def test_the_model_that_made_the_readings_ranks_first_or_beside_the_first(model):
    measured = noisy(model, 21, points=40)
    report = fit(measured)
    scores = {fit.model: fit.aicc for fit in report.fits if fit.aicc is not None}
    # a model with one parameter more than the true one beats it by 10 (chi^2_1 > 12) once in 2,000 times
    assert scores[model] < min(scores.values()) + 10
    assert [f.aicc for f in report.fits if f.aicc is not None] == sorted(scores.values())


@pytest.mark.parametrize("model", ["inverse-power", "exponential-2"])
def test_with_four_distances_the_model_that_predicts_the_left_out_reading_is_best(model):
    """AICc exists only for the model with two parameters then, so it cannot compare the models."""
    distance = np.array([0.005, 0.02, 0.035, 0.05])
    outputs = SENSORS[model].output(distance) * 1e5 + 60.0
    report = fit(Calibration(distances=distance, outputs=outputs, no_object=[59.9, 60.0, 60.1]))
    assert report.best.model == model
    assert report.best.aicc is None
    assert report.verdict == "usable with reservations"
    errors = [fit.cross_validation for fit in report.fits if fit.model != "table"]
    assert errors == sorted(errors)


def test_a_saturated_sensor_is_not_called_broken():
    outputs, distance = np.full(6, 300.0), np.linspace(0.01, 0.06, 6)
    saturated = fit(Calibration(distances=distance, outputs=outputs, no_object=[59.0, 60.0, 61.0]))
    assert "300 at every distance, but 60 without an object: the sensor is saturated" in " ".join(saturated.reasons)
    broken = fit(Calibration(distances=distance, outputs=outputs, no_object=[300.0, 300.0, 300.0]))
    assert "300 at every distance: check power and wiring" in " ".join(broken.reasons)


def test_all_models_of_a_ranking_share_window_offset_and_noise():
    report = fit(noisy("inverse-power", 30))
    assert len({fit.window for fit in report.fits}) == 1
    assert len({fit.offset for fit in report.fits}) == 1
    assert len({fit.noise for fit in report.fits}) == 1
    alone = fit_sensor(noisy("inverse-power", 30), report.fits[0].model)
    assert alone.to_dict() == report.fits[0].to_dict()


def test_the_sensor_of_a_fit_holds_on_the_window_only():
    fit = fit_sensor(noisy("inverse-power", 31), "inverse-power")
    assert fit.sensor.valid_range == (fit.window.l_min, fit.window.l_max)


def test_a_reservation_names_readings_taken_once():
    once, thrice = (fit(noisy("exponential-1", 6, repeats=n, no_object=2)) for n in (1, 3))
    assert any("read once" in reason for reason in once.notes)
    assert not any("read once" in reason for reason in (*thrice.reasons, *thrice.notes))


def test_a_model_needs_one_distance_more_than_it_has_parameters():
    distance = np.linspace(0.0, 0.05, 6)
    outputs = np.repeat(2 * np.exp(-60 * distance), 3) + np.tile([-0.01, 0.0, 0.01], 6)
    readings = Calibration(distances=np.repeat(distance, 3), outputs=outputs, unit="V", no_object=[-0.01, 0.0, 0.01])
    report = fit(readings, floor_sigmas=60)  # the floor of 0.35 V leaves the outputs 2, 1.1 and 0.6 V
    assert [fit.model for fit in report.fits] == ["exponential-1", "table"]
    assert "4 or more distances" in report.not_fitted["inverse-power"]


def copied(measured, times):
    """The same readings several times, as in a file in which each row was pasted again."""
    return Calibration(
        distances=np.tile(measured.distances, times),
        outputs=np.tile(measured.outputs, times),
        unit=measured.unit,
        no_object=np.tile(measured.no_object, times),
    )


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(("repeats", "times", "no_object"), [(1, 2, 0), (3, 5, 0), (1, 5, 6), (3, 2, 6)])
def test_copies_of_readings_change_no_fit_and_are_reported(repeats, times, no_object):
    measured = noisy("inverse-power", 8, repeats=repeats, no_object=no_object)
    once, again = fit(measured), fit(copied(measured, times))
    assert again.to_dict()["models"] == once.to_dict()["models"]
    assert again.noise == once.noise
    assert again.offset == once.offset
    readings = 15 * repeats + no_object
    warning = f"PT115: {(times - 1) * readings} of {times * readings} readings repeat another reading exactly"
    assert any(reason.startswith(warning) for reason in (*again.reasons, *again.notes))
    assert not any("PT115" in reason for reason in (*once.reasons, *once.notes))
    assert not any(
        "PT102" in reason for reason in (*again.reasons, *again.notes)
    )  # each distance was read several times


def test_equal_repeats_of_a_coarse_sensor_are_no_more_certain_than_single_readings():
    distance = np.linspace(0.0, 0.05, 15)
    coarse = np.round((PEDESTAL + SENSORS["inverse-power"].output(distance)) / 0.01) * 0.01
    once = fit(Calibration(distances=distance, outputs=coarse))
    repeated = fit(Calibration(distances=np.repeat(distance, 4), outputs=np.repeat(coarse, 4)))
    assert any("PT115" in reason for reason in (*repeated.reasons, *repeated.notes))
    assert repeated.noise.output >= 0.01 / math.sqrt(12) * (1 - 1e-9)
    assert repeated.slope.uncertainty.max() == once.slope.uncertainty.max()


def test_repeats_that_differ_anywhere_are_no_copies():
    distance, outputs = np.repeat([0.0, 0.01, 0.02, 0.03], 3), np.array([9.0, 9, 9, 5, 5, 5, 3, 3, 3, 2, 2, 1])
    readings = Calibration(distances=distance, outputs=outputs)
    assert count_copies_once(readings) is readings
    two = Calibration(distances=[0.0, 0.0, 0.01, 0.01, 0.02], outputs=[9.0, 9.0, 5.0, 5.0, 3.0])
    assert count_copies_once(two) is two  # equal by chance at two distances


def test_distances_beyond_ten_meters_are_doubted():
    measured = noisy("inverse-power", 8)
    large = Calibration(distances=1000 * measured.distances, outputs=measured.outputs, no_object=measured.no_object)
    doubt = "PT114: The distances reach 50 m, which is too far for a proximity sensor: for millimeters, use the "
    assert any(reason.startswith(doubt) for reason in fit(large).reasons)
    rising = Calibration(distances=1000 * measured.distances, outputs=-measured.outputs)
    assert any(reason.startswith(doubt) for reason in fit(rising).reasons)
    assert not any("PT114" in reason for reason in fit(measured).reasons)


def test_the_influence_of_a_reading_is_the_change_of_the_slope_without_it() -> None:
    """SciPy fits ln xi without each point, with the weights of the report."""
    distance = np.linspace(0.0, 0.05, 9)
    noise = 0.01 * np.random.default_rng(5).standard_normal(9)
    output = 20_000.0 * (1 + distance / 0.0419) ** -3.32 * np.exp(noise)
    report = fit(Calibration(distances=distance, outputs=output, no_object=np.zeros(5)))
    found = next(each for each in report.fits if each.model == "inverse-power")

    weight = output / found.noise.of_means(np.ones(9, dtype=int), output)

    def slope(kept: np.ndarray) -> float:
        def rest(p: np.ndarray) -> np.ndarray:
            modeled = p[0] - np.exp(p[2]) * np.log(distance[kept] + np.exp(p[1]))
            return (modeled - np.log(output[kept])) * weight[kept]

        start = [np.log(20_000.0) + 3.32 * np.log(0.0419), np.log(0.0419), np.log(3.32)]
        p = least_squares(rest, start, xtol=1e-14, ftol=1e-14).x
        return float(-np.exp(p[2]) / np.exp(p[1]))

    everything = np.arange(9)
    changes = [slope(np.delete(everything, i)) / slope(everything) - 1 for i in everything]
    # these weights are of the measured signal, which differs from that of the curve by 1 %
    assert found.influences == pytest.approx(changes, abs=1e-2 * max(map(abs, changes)))
    assert int(np.argmax(np.abs(found.influences))) == 0


def test_the_largest_uncertainty_of_the_slope_covers_the_interval_of_the_fitted_offset():
    """Seven readings, and none of the empty scene: the interval at mid-range was wider than the largest uncertainty."""
    distance = 1e-3 * np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0])
    report = fit(Calibration(distances=distance, outputs=[4.532, 4.120, 3.435, 2.460, 1.387, 0.566, 0.163], unit="V"))
    middle, slope = report.best.middle_slope, report.slope
    assert report.offset.kind == "fitted"
    reach = math.log(1 + slope.largest_anywhere)
    assert max(math.log(middle.low / middle.value), math.log(middle.value / middle.high)) < reach
    assert "the 95 % interval of the fitted offset" in str(report)
    # at each end of this interval, a new fit, which also estimates the noise anew, lies within the uncertainty
    for end in (report.offset.low, report.offset.high):
        other = fit(report.calibration, ("inverse-power",), offset=float(end)).best.sensor
        inside = slope.distances[slope.distances <= other.valid_range[1]]
        change = np.log(np.asarray(other.log_slope(inside)) / slope.slope[: len(inside)])
        assert (np.abs(change) <= 1.05 * np.log1p(slope.uncertainty[: len(inside)]) + 0.02).all()
