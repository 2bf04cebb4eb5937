"""The verdict on a calibration says whether its readings determine the contact speed, and nothing else."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar

import numpy as np
import pytest

import pretouch as pt
from made_sensors import make_sparse_sensor
from pretouch._core.warning_codes import split_code
from pretouch.calibration import Calibration, CalibrationReport, fit, fit_sensor
from pretouch.calibration.averaging import AveragedCurve, falling_means
from pretouch.calibration.contact_check import mount, reference_check
from pretouch.calibration.page import calibration_page
from pretouch.sensors import SensorModel
from pretouch.sensors.model import parameter
from pretouch.uncertainty import reservations_of

TRUTH = pt.InversePower(scale=3150 * 0.03**2, distance_offset=0.03, exponent=2.0)
NOISE = np.array([3.0, -6.0, 2.0, 4.0, -2.0, 1.0, -1.0, 2.0, -3.0])


def codes(texts: tuple[str, ...]) -> list[str | None]:
    return [split_code(text)[0] for text in texts]


def read_once(empty: bool = True) -> Calibration:
    """Return one reading at each of nine distances."""
    distances = np.linspace(0.0, 0.08, 9)
    outputs = np.round(150 + np.asarray(TRUTH.output(distances)) + NOISE)
    return Calibration(
        distances=distances, outputs=outputs, unit="counts", no_object=[150.0, 151.0, 149.0] if empty else []
    )


def test_readings_that_determine_the_contact_speed_are_usable_although_they_could_be_better() -> None:
    report = fit(read_once())
    assert report.verdict == "usable"
    assert codes(report.notes) == ["PT102"]
    assert not report.contradictions
    assert report.to_dict()["notes"] == list(report.notes)


def test_the_same_weakness_is_a_reservation_if_the_readings_do_not_determine_the_contact_speed() -> None:
    """Eleven readings under a soft ceiling; contact on the true curve is twice as hard as predicted."""
    made = make_sparse_sensor(np.random.default_rng([22, 68]), "soft")
    report = fit(made.calibration)
    assert report.verdict == "usable with reservations"
    assert {"PT101", "PT102", "PT118"} <= set(codes(report.reasons))
    assert not report.notes
    text = next(text for text in report.reasons if text.startswith("PT118"))
    low, high = (float(v) for v in text.partition("lead to ")[2].partition(" times")[0].split(" to "))
    assert low < 0.85 or high > 1.15


@cache
def sparse_sensors() -> tuple[tuple[CalibrationReport, Any], ...]:
    """Return reports and true sensors of 16 that were read once at 6 to 18 distances."""
    found = []
    for number in range(16):
        made = make_sparse_sensor(np.random.default_rng([7, number]), ("soft", "tanh")[number % 2])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found.append((fit(made.calibration), made))
    return tuple(found)


@pytest.mark.slow
def test_most_sensors_read_once_are_usable_and_their_reference_speed_is_true() -> None:
    """The true curve, mounted as the drawn curves are, gives the contact speed that `usable` promises."""
    plain, right = 0, 0
    for report, made in sparse_sensors():
        assert report.best is not None
        assert report.offset is not None
        if report.verdict != "usable":
            continue
        plain += 1
        low, high = report.window.l_min, report.window.l_max
        places = np.linspace(low, high, 400)
        outputs = np.maximum.accumulate((made.mean(places) - report.offset.value)[::-1])[::-1]
        outputs = outputs - 1e-9 * np.arange(len(outputs))
        if outputs[-1] <= 0:
            continue
        true = pt.Table(distances=tuple(places), outputs=tuple(outputs))
        fitted = report.best.sensor
        speeds = []
        for sensor in (fitted, true):
            mounted = pt.Recessed(sensor=sensor, recess=low) if low > 0 else sensor
            scenario = pt.Scenario(
                admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
                obstacle=pt.Obstacle(position=high - low, velocity=-0.3),
            )
            fall = float(fitted.log_output(low) - fitted.log_output(high))
            speeds.append(-float(pt.find_contact(scenario, mounted, -0.3 / fall).end.relative_velocity))
        right += abs(speeds[1] / speeds[0] - 1) <= 0.15
    assert plain >= 0.5 * len(sparse_sensors())
    assert right >= 0.9 * plain


def test_the_reference_speed_does_not_depend_on_the_length_scale() -> None:
    """The same readings at distances ten times as large lead to the same ratios."""
    small = fit(read_once())
    large = fit(replace(read_once(), distances=tuple(10 * d for d in read_once().distances)))
    checks = []
    for report in (small, large):
        assert report.best is not None
        assert report.offset is not None
        assert report.curves is not None
        window = report.window
        check = reference_check(
            report.curves, report.offset.value, report.best.sensor, nearest=window.l_min, farthest=window.l_max
        )
        assert check is not None
        checks.append(check)
    assert checks[0].predicted == pytest.approx(checks[1].predicted, rel=1e-3)
    assert checks[0].predicted <= 0.1 * 1.001
    assert checks[0].share_outside == checks[1].share_outside


@dataclass(frozen=True, slots=True, kw_only=True)
class Shoulder(SensorModel):
    """A curve that is flat near contact, 1 / (1 + (l / w)^4), unlike every built-in one."""

    scale: float = parameter("A", "", 1.0, sign="positive", of_output="")
    width: float = parameter("w", "m", sign="positive")

    name: ClassVar[str] = "shoulder"

    def _log_output(self, distance: Any) -> Any:
        return np.log(self.scale) - np.log1p((distance / self.width) ** 4)

    def _log_slope(self, distance: Any) -> Any:
        return -4 * distance**3 / self.width**4 / (1 + (distance / self.width) ** 4)

    @classmethod
    def fit_start(cls, slope: float, curvature: float, middle: float) -> dict[str, float]:  # noqa: ARG003
        return {"width": middle}


def with_shoulder() -> Calibration:
    distances, rng = np.linspace(0.005, 0.06, 28), np.random.default_rng(1)
    outputs = 100 + 2000 / (1 + (distances / 0.03) ** 4) + rng.normal(0, 2, len(distances))
    return Calibration(distances=distances, outputs=outputs, unit="counts", no_object=100 + rng.normal(0, 2, 10))


def test_a_named_curve_from_outside_counts_among_the_possible_ones() -> None:
    """A flat start is saturation for the built-in families, and the shape of a curve that is flat there."""
    saturated = fit(with_shoulder())
    assert (saturated.best.model, saturated.window.l_min > 0.01) == ("table", True)
    assert "The output flattens" in saturated.reasons[0]
    report = fit(with_shoulder(), models=("shoulder",))
    assert report.window.l_min == 0.005
    assert report.verdict == "usable"
    assert fit_sensor(with_shoulder(), "shoulder").parameters["width"].value == pytest.approx(0.03, rel=0.01)


def test_without_saturation_no_reading_is_left_out_as_flattened() -> None:
    for models in (None, ("shoulder",)):
        assert fit(with_shoulder(), models=models, saturation=None).window.l_min == 0.005


def test_a_curve_from_outside_that_raises_does_not_stop_the_others() -> None:
    class Broken(Shoulder):
        name: ClassVar[str] = "broken"

        def _log_output(self, distance: Any) -> Any:  # noqa: ARG002
            raise RuntimeError

    report = fit(read_once(), models=("inverse-power", "broken"))
    assert report.best is not None
    assert report.best.model == "inverse-power"
    assert "RuntimeError" in report.not_fitted["broken"]


def test_the_table_is_advised_only_where_it_exists() -> None:
    """The curve of another shape, also with an output that rises by no more than the deviations of the readings."""
    distances = np.linspace(0.005, 0.06, 56)
    steep = 100 + 2000 / (1 + (distances / 0.03) ** 4)
    for rise, models in (
        (0.0, ("exponential-1", "table")),
        (3.0, ("exponential-1", "table")),
        (0.0, ("exponential-1",)),
    ):
        outputs = steep.copy()
        outputs[40] += rise * (outputs[39] - outputs[40])
        report = fit(
            Calibration(distances=distances, outputs=outputs, unit="counts", no_object=[100.0] * 5),
            models=models,
            saturation=None,
        )
        text = next(text for text in report.reasons if text.startswith("PT108"))
        exists = any(fit.model == "table" for fit in report.fits)
        assert ("use the table model" in text) == exists == ("table" in models)


def test_a_table_falls_where_the_readings_rise_by_noise_and_there_is_none_where_they_rise_by_more() -> None:
    curve = AveragedCurve(distance=np.arange(6.0), output=np.array([9.0, 7, 7.5, 5, 3, 3]), count=np.array([1] * 6))
    falling = falling_means(curve, np.full(6, 0.2))
    assert falling is not None
    np.testing.assert_allclose(falling.output, [9, 7.25, 5, 3])
    np.testing.assert_allclose(falling.distance, [0, 1.5, 3, 5])  # the ends stay
    assert falling.count.tolist() == [1, 2, 1, 2]
    assert falling_means(curve, np.full(6, 0.05)) is None  # 0.25 is 5 standard errors
    assert falling_means(replace(curve, output=curve.output - np.arange(6)), np.zeros(6)) is not None


def test_results_repeat_first_that_the_readings_deviate_from_the_curve() -> None:
    distances = np.linspace(0.005, 0.06, 56)
    outputs = 100 + 2000 / (1 + (distances / 0.03) ** 4)
    report = fit(
        Calibration(distances=distances, outputs=outputs, unit="counts", no_object=[100.0] * 5),
        models=("exponential-1",),
        saturation=None,
    )
    assert {"PT108"} <= set(codes(report.contradictions))
    assert report.best is not None
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.055, velocity=-0.3),
    )
    task = pt.Task(
        scenario,
        pt.Recessed(sensor=report.best.sensor, recess=0.005),
        pt.excursion_objective(position_scale=0.5, velocity_scale=0.3),
        bounds=(-20.0, -1e-3),
    )
    headline = reservations_of(report, pt.design(task)).headline
    assert headline is not None
    assert all(text in headline for text in report.contradictions)


def test_a_drawn_curve_over_the_whole_range_is_not_cut() -> None:
    report = fit(read_once())
    assert report.curves is not None
    assert report.best is not None
    curve = report.curves.draw(1, 1)[0]
    low, high = curve.sensor.valid_range
    assert mount(curve, report.best.sensor, curve.offset, high).log_outputs == pytest.approx(
        np.asarray(curve.sensor.log_output(np.array(curve.sensor.distances))), abs=1e-12
    )
    assert low == 0.0


def test_a_prediction_outside_of_the_allowed_range_is_opposed_to_it() -> None:
    report = fit(read_once())
    assert report.best is not None
    assert report.offset is not None
    assert report.curves is not None
    check = reference_check(report.curves, report.offset.value, report.best.sensor, nearest=0.0, farthest=0.08)
    assert check is not None
    assert check.spread is None
    around = replace(check, allowed_low=0.5 * check.predicted, allowed_high=1.1 * check.predicted)
    above = replace(check, allowed_low=1.05 * check.predicted, allowed_high=1.3 * check.predicted)
    assert around.spread is not None
    assert above.spread is not None
    assert around.spread.startswith("The readings also allow")
    assert above.spread.startswith("But nearly all other sensor curves")


def with_low_nearest(*, repeats: int) -> Calibration:
    """Return nine readings, the nearest 20 % too low, and right repeats of it."""
    calibration = read_once()
    outputs = np.array(calibration.outputs)
    right = outputs[0]
    outputs[0] -= 0.2 * (right - 150)
    again = right + np.array([4.0, -3.0, 1.0, -5.0, 2.0])[:repeats]
    return replace(
        calibration,
        distances=np.append(calibration.distances, np.zeros(repeats)),
        outputs=np.append(outputs, again),
    )


def test_a_low_nearest_reading_may_be_wrong_and_five_repeats_show_it() -> None:
    """One low reading looks like a ceiling; next to five others it is an outlier."""
    once = fit(with_low_nearest(repeats=0))
    assert once.window.l_min > 0
    assert "PT117" in codes((*once.reasons, *once.notes))
    repeated = fit(with_low_nearest(repeats=5))
    assert repeated.window.l_min == 0
    assert any("differs from other readings at the same distance" in text for text in repeated.left_out)
    assert "PT117" not in codes((*repeated.reasons, *repeated.notes))


DISTANCES = np.array([0.0, 2.0, 5.0, 8.0, 12.0, 17.0, 25.0, 35.0, 50.0, 70.0]) * 1e-3


def repeated(distances: Any = DISTANCES, written: Any = None, empty_at: float | None = None) -> Calibration:
    """Return readings at `distances` that are written as other distances; the empty scene may have a distance, too."""
    rng = np.random.default_rng(11)
    outputs = (
        0.1 + 3.2 * (0.03 / (0.03 + distances[:, None])) ** 2.5 + rng.normal(0, 0.002, (len(distances), 4))
    ).ravel()
    empty = 0.1 + rng.normal(0, 0.002, 5)
    at = np.repeat(distances if written is None else written, 4)
    if empty_at is None:
        return Calibration(distances=at, outputs=outputs, unit="V", no_object=empty)
    return Calibration(distances=np.append(at, np.full(5, empty_at)), outputs=np.append(outputs, empty), unit="V")


@pytest.mark.parametrize(
    ("calibration", "named"),
    [
        (repeated(empty_at=0.255), "255 mm"),
        (repeated(DISTANCES[1:], empty_at=0.0), "0 mm"),
        (repeated(written=np.append(DISTANCES[:-1], 0.7)), "700 mm"),
        (repeated(written=DISTANCES / 1000), "0.07 mm"),
    ],
)
def test_a_distance_that_cannot_be_right_is_named_first(calibration: Calibration, named: str) -> None:
    report = fit(calibration, ("inverse-power", "exponential-1", "table"))
    assert report.verdict == "usable with reservations"
    code, text = split_code(report.reasons[0])
    assert code == "PT114"
    assert named in text
    assert report.contradictions[0] == report.reasons[0]


def test_a_far_distance_that_disagrees_with_every_curve_is_left_out() -> None:
    models = ("inverse-power", "exponential-1", "table")
    typed, right = fit(repeated(written=np.append(DISTANCES[:-1], 0.7)), models), fit(repeated(), models)
    assert typed.best is not None
    assert right.best is not None
    assert typed.window.l_max == DISTANCES[-2]
    assert typed.best.sensor.log_slope(0.03) == pytest.approx(right.best.sensor.log_slope(0.03), rel=0.02)
    assert "4 readings at 700 mm" in typed.left_out[-1]
    assert "so it is left out" in split_code(typed.reasons[0])[1]


@pytest.mark.parametrize("farthest", [0.18, 0.255])
def test_a_far_distance_that_agrees_with_the_curve_is_believed(farthest: float) -> None:
    """The signal there is 25 and 12 mV, and the standard error of a mean is 1 mV."""
    calibration = repeated(np.append(DISTANCES, farthest))
    assert fit(calibration, ("inverse-power", "exponential-1")).verdict == "usable"
    assert "PT114" not in codes(fit(replace(calibration, no_object=[]), ("inverse-power",)).reasons)


def test_the_first_sentence_says_that_the_slope_is_unknown() -> None:
    few = Calibration(distances=[0.0, 2e-3, 4e-3, 8e-3], outputs=[3.0, 2.0, 1.0, 0.5], unit="V", no_object=[0.1])
    known, unknown = fit(repeated()), fit(few)
    assert known.best is not None
    assert unknown.best is not None
    assert known.best.middle_slope.is_within(3.0)
    assert "do not determine" not in calibration_page(known).headline
    assert not unknown.best.middle_slope.is_within(3.0)
    assert "do not determine the slope" in calibration_page(unknown).headline


def no_signal(outputs: Any, unit: str, empty: Any = ()) -> str:
    report = fit(Calibration(distances=DISTANCES, outputs=outputs, unit=unit, no_object=list(empty)))
    assert report.verdict == "no usable signal"
    return report.reasons[0]


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "s"), (1e6, "us")])
def test_an_echo_time_is_a_distance_and_a_decay_time_is_not(factor: float, unit: str) -> None:
    echo = no_signal(factor * (3e-4 + 2 * DISTANCES / 343), unit)
    assert split_code(echo)[0] == "PT113"
    assert "5.83 us per mm, like an echo at the speed of sound" in echo
    assert "inverse" not in echo
    decay = no_signal(factor * 1e-5 * (1 + DISTANCES / 0.03) ** 2.5, unit)
    assert "inverse, 1 / reading" in decay


@pytest.mark.parametrize("bits", [8, 16, 32])
def test_an_overflow_of_signed_integers_is_named(bits: int) -> None:
    counts = np.round(0.75 * 2**bits * (0.03 / (0.03 + DISTANCES)) ** 1.5)
    text = no_signal(np.where(counts >= 2 ** (bits - 1), counts - 2**bits, counts), "counts")
    assert split_code(text)[0] == "PT113"
    assert f"{bits}-bit" in text
    assert f"add {2**bits} " in text


@pytest.mark.parametrize("empty", [(979.0, 998.0, 982.0, 987.0), (0.1, 1.2, 2.3, 3.1)])
def test_readings_without_an_object_that_contradict_the_others_are_named(empty: tuple[float, ...]) -> None:
    """The first kind has another decimal mark, and the second kind is rows whose distance is missing."""
    text = no_signal(0.1 + 3.2 * (0.03 / (0.03 + DISTANCES)) ** 2.5, "V", empty)
    assert split_code(text)[0] == "PT110"
    assert "finer steps" not in text
    assert f"{max(empty):g} V" in text


def finger(seed: int, wrong: int | None = None, *, empty: bool = False, factor: float = 1.12) -> Calibration:
    """Return one reading at each of twelve distances, with 1 % of noise; that of one distance is wrong."""
    distances = np.array([2.0, 3, 4, 6, 8, 10, 14, 19, 26, 35, 47, 60]) / 1e3
    rng = np.random.default_rng([9, seed])
    outputs = (40 + 0.9 / (distances + 0.006) ** 2) * (1 + 0.01 * rng.standard_normal(12))
    if wrong is not None:
        outputs[wrong] *= factor
    no_object = np.array([40.5]) if empty else np.empty(0)
    return Calibration(distances=distances, outputs=outputs.round(1), unit="counts", no_object=no_object)


@pytest.mark.parametrize("empty", [False, True])
@pytest.mark.parametrize(("wrong", "factor"), [(4, 1.12), (6, 1.12), (7, 0.88)])
def test_a_single_wrong_reading_is_named_although_every_distance_was_read_once(
    wrong: int, factor: float, *, empty: bool
) -> None:
    """A family that describes none of the readings says nothing about one of them."""
    calibration = finger(1, wrong, empty=empty, factor=factor)
    report = fit(calibration)
    assert len(report.left_out) == 1
    assert f"at {1e3 * calibration.distances[wrong]:.0f} mm" in report.left_out[0]
    assert report.window.l_max == pytest.approx(0.06)


@pytest.mark.slow(keep=2)
@pytest.mark.parametrize("seed", range(12))
def test_no_reading_of_a_sensor_read_once_is_named_needlessly(seed: int) -> None:
    assert fit(finger(seed, empty=bool(seed % 2))).left_out == ()
