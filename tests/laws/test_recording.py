"""Laws of a recording: settling, missing distances, and when the slope is known well enough."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.calibration import Calibration
from pretouch.config import load_calibration_plan, load_scenario
from pretouch.designs import Task
from pretouch.recording.record_judgment import RecordGoal, judge_recording
from pretouch.recording.record_missing import missing_distances
from pretouch.recording.record_settling import Stay, drifts, robust_spread
from pretouch.verification.calibration_check import check_calibration

RATE = 200.0  # readings per second


def stay_of(outputs: np.ndarray, wanted: int = 20, dwell: float = 1.0) -> tuple[Stay, list[int]]:
    stay = Stay(wanted, dwell)
    counted = [i for i, y in enumerate(outputs) if stay.add(i / RATE, float(y))]
    return stay, counted


@pytest.mark.slow
def test_noise_alone_counts_as_drift_as_rarely_as_declared() -> None:
    random = np.random.default_rng(1)
    trials = 6000
    for count in (6, 10, 100):
        alarms = sum(drifts(random.standard_normal(count)) for _ in range(trials))
        # 0.001 of the trials: a Poisson number with mean 6, below 22 with probability 1 - 5e-7
        assert 0 < alarms < 22, count
    assert not drifts(np.full(50, 7.0))


def test_a_converter_that_toggles_by_one_count_is_steady() -> None:
    assert not drifts(np.array([5.0] * 9 + [6.0]))
    assert drifts(np.linspace(5, 9, 40).round())


def test_readings_count_only_after_the_output_has_settled() -> None:
    """After a step of 1000 counts with a time constant of 0.3 s, the counted mean is off by less than its noise."""
    random = np.random.default_rng(2)
    t = np.arange(0, 12, 1 / RATE)
    outputs = 500 + 1000 * np.exp(-t / 0.3) + 4 * random.standard_normal(len(t))
    stay, counted = stay_of(outputs)
    assert stay.is_done
    assert stay.has_settled
    assert len(counted) == 20
    # a drift that is not significant over a window of 0.5 s is below 4 times the error of its 20 blocks, here about
    # 3 counts; what remains after it is less
    assert abs(float(np.mean(stay.counted)) - 500) < 3 + 5 * 4 / math.sqrt(20)
    assert np.diff(counted).min() >= 0.9 * RATE / 20  # spread over the dwell of 1 s


def test_an_output_that_never_settles_is_recorded_with_a_mark() -> None:
    stay, counted = stay_of(np.arange(0, 15 * RATE) * 1.0)
    assert stay.is_done
    assert not stay.has_settled
    assert stay.has_drifted
    assert counted[0] >= 10 * RATE


def test_slow_sensors_need_no_more_time_than_their_readings() -> None:
    stay = Stay(5, 0.0)
    for i in range(6 + 4):
        stay.add(i * 0.5, 100.0)
    assert stay.is_done


def test_the_spread_is_a_standard_deviation_that_outliers_do_not_change() -> None:
    values = np.random.default_rng(3).normal(50.0, 2.0, 10_000)
    values[:100] = 1e6
    # the median absolute deviation has a relative standard error of 1.17 / sqrt(N); 1 % of outliers add 1.3 %
    assert robust_spread(values) == pytest.approx(2.0, rel=5 * 0.0117 + 0.013)


# --- missing distances


@given(
    slope=st.floats(20.0, 200.0),
    places=st.lists(st.floats(0.0, 1.0), min_size=2, max_size=6, unique=True),
)
def test_with_the_missing_distances_the_signal_falls_in_steps_to_a_twentieth(slope: float, places: list[float]) -> None:
    """Distances that are named are recorded until none is missing: then the recipe of the docs holds."""

    def curve(distance: np.ndarray) -> np.ndarray:
        return np.exp(-slope * distance)

    distances = np.unique(np.round(np.array(places) * 2.5 / slope, 4))
    if len(distances) < 2:
        return
    for _ in range(30):
        missing = missing_distances(distances, curve(distances), 1e-4)
        if not missing.all:
            break
        distances = np.unique(np.concatenate([distances, missing.all]))
    assert missing.all == ()
    falls = slope * np.diff(distances)
    assert distances[0] == 0
    assert falls.max() <= 1.6 * -math.log(0.8) + 1e-9
    assert falls.sum() >= math.log(20)
    assert len(distances) < 60


def test_beyond_the_noise_floor_nothing_is_missing() -> None:
    distances = np.array([0.0, 0.004, 0.008, 0.012, 0.2])
    signals = np.exp(-60 * distances)
    assert missing_distances(distances, signals, 0.45).ends == ()
    assert missing_distances(distances[:4], signals[:4], 0.3).all != ()


def test_the_range_of_a_scenario_is_reached_exactly() -> None:
    distances = np.array([0.002, 0.004])
    missing = missing_distances(distances, np.exp(-60 * distances), 1e-6, nearest=0.001, farthest=0.009)
    assert missing.ends[0] == 0.001
    assert missing.ends[-1] == 0.009
    assert missing_distances(distances, np.exp(-60 * distances), 1e-6, nearest=0.002, limit=0.004).ends == ()


# --- judgment


def readings(distances: np.ndarray, noise: float, repeats: int = 10, empty: int = 10) -> Calibration:
    random = np.random.default_rng(4)
    place = np.repeat(distances, repeats)
    outputs = 600 + 9000 * (1 + place / 0.03) ** -3.0 + noise * random.standard_normal(len(place))
    dark = 600 + noise * random.standard_normal(empty)
    return Calibration(distances=place, outputs=outputs, no_object=dark, unit="counts")


FULL = np.array([0, 3, 7, 12, 18, 26, 36, 52]) * 1e-3


def test_a_good_calibration_is_enough_and_parts_of_it_are_not() -> None:
    assert judge_recording(readings(FULL, 6.0), RecordGoal()).is_enough
    assert not judge_recording(None, RecordGoal()).is_enough
    for count in range(1, len(FULL)):
        judgment = judge_recording(readings(FULL[:count], 6.0), RecordGoal())
        assert not judgment.is_enough
        assert judgment.missing.ends[0] > FULL[count - 1]


def test_noise_beyond_the_goal_is_not_enough() -> None:
    noisy = judge_recording(readings(FULL, 150.0, repeats=5), RecordGoal(accuracy=0.05))
    assert not noisy.is_enough
    strict = judge_recording(readings(FULL, 6.0), RecordGoal(accuracy=1e-4))
    assert not strict.is_enough
    assert strict.uncertainty is not None
    assert 1e-4 < strict.uncertainty < 0.05


LOOP = (Path(__file__).parents[2] / "examples/loop.toml").read_text(encoding="utf-8")
LOOP = LOOP.replace(
    'floor = "1900 counts"', 'floor = "100 counts"'
)  # so low that even a poor sensor detects the object


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "empty", "enough"), [(6.0, 20, True), (160.0, 3, False)], ids=["good", "bad"])
def test_the_loop_of_a_scenario_has_the_last_word(noise: float, empty: int, enough: bool, tmp_path: Path) -> None:
    """The goal allows any uncertainty of g, so that only the check of `pretouch verify` can object."""
    measured = readings(FULL, noise, empty=empty)
    rows = [f"{1000 * d:g},{y:.0f}" for d, y in zip(measured.distances, measured.outputs, strict=True)]
    rows += [f"inf,{y:.0f}" for y in measured.no_object]
    (tmp_path / "sensor.csv").write_text("\n".join(["distance [mm],output [counts]", *rows]))
    sensor = LOOP[LOOP.index("[sensor]") : LOOP.index("[admittance]")]
    scenario = tmp_path / "loop.toml"
    scenario.write_text(LOOP.replace(sensor, '[sensor]\ncalibration = "sensor.csv"\n'))
    plan = load_calibration_plan(scenario)
    assert (plan.path, plan.nearest, plan.farthest) == (tmp_path / "sensor.csv", 0.0, 0.0422)

    def load() -> Task:
        """Read the scenario, with a gain for which the contact speed is just at its limit."""
        return load_scenario(scenario).replace(gain=-0.34)

    goal = RecordGoal(accuracy=0.9, nearest=plan.nearest, farthest=plan.farthest, load=load)
    judgment = judge_recording(load().calibration.calibration, goal)
    assert judgment.is_enough is enough, judgment.reason
    task = load()
    assert task.calibration.verdict == "usable"  # so that the fit has no objection
    check = check_calibration(task, task.calibration, -0.34)
    assert check.is_good_enough is enough
    assert enough or judgment.reason == check.text


def test_a_distance_sensor_is_never_enough() -> None:
    near = readings(FULL, 6.0)
    rising = Calibration(distances=near.distances, outputs=10_000 - near.outputs, no_object=10_000 - near.no_object)
    assert not judge_recording(rising, RecordGoal()).is_enough
