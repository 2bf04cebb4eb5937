"""What a recording says about its sensor, on recordings whose truth is known: timing, noise, latency, detections."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from pretouch.calibration import fit_sensor, read_calibration
from pretouch.errors import InvalidInputError
from pretouch.recording import Recording, replay
from pretouch.recording.detections import RecordedDetection, events_in, judge
from pretouch.recording.distance_pairs import pair_distances
from pretouch.recording.latency import estimate_latency
from pretouch.recording.noise import noise_of, spread_of_course
from pretouch.recording.timing import stretches, timing_of
from pretouch.report.pages import page_of

LOOP = Path(__file__).parents[2] / "examples/loop.toml"


# --- timing


def test_rate_jitter_dropouts_and_gaps_of_a_known_recording() -> None:
    """The jitter's robust estimate from n intervals has a relative error of about 1.2 / sqrt(n): 4 sigma are 6 %."""
    rng = np.random.default_rng(1)
    index = np.arange(8000)
    kept = rng.random(len(index)) > 0.03
    kept[4000:4060] = False
    time = (index / 60 + 4e-4 * rng.standard_normal(len(index)))[kept]
    timing = timing_of(time, rng.standard_normal(len(time)))
    assert timing.rate == pytest.approx(60, rel=2e-3)
    assert timing.mean_rate == pytest.approx((len(time) - 1) / (time[-1] - time[0]), rel=1e-9)
    assert timing.jitter == pytest.approx(4e-4, rel=0.06)
    assert timing.longest_gap == pytest.approx(61 / 60, rel=0.05)
    assert timing.longest_gap_at == pytest.approx(3999 / 60, abs=0.1)
    assert timing.dropout == pytest.approx(0.03, abs=4 * np.sqrt(0.03 / 8000) + 60 / 8000)
    assert (timing.held, timing.late, timing.repeated_stamps) == (1, 0, 0)


def test_repeated_and_late_stamps_are_counted() -> None:
    time = np.array([0.0, 0.01, 0.01, 0.02, 0.015, 0.03])
    timing = timing_of(time, np.arange(6.0))
    assert (timing.repeated_stamps, timing.late, timing.count) == (1, 1, 6)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_without_two_times_there_is_no_rate(count: int) -> None:
    timing = timing_of(np.zeros(count), np.zeros(count))
    assert np.isnan(timing.rate)
    assert timing.duration == 0


def test_values_that_are_only_repeated_show_the_true_rate() -> None:
    rng = np.random.default_rng(2)
    values = np.repeat(rng.standard_normal(200), 16)
    timing = timing_of(np.arange(len(values)) * 1e-3, values)
    assert (timing.held, timing.value_rate) == (16, pytest.approx(1000 / 16))
    third = np.repeat(rng.standard_normal(200), rng.permutation(np.repeat([3, 4], [140, 60])))  # 3.3 times
    timing = timing_of(np.arange(len(third)) * 1e-2, third)
    assert (timing.held, timing.value_rate) == (3, pytest.approx(100 / 3.3, rel=0.02))
    assert timing_of(np.arange(200) * 1e-3, rng.standard_normal(200)).held == 1
    assert timing_of(np.arange(200) * 1e-3, np.round(rng.standard_normal(200))).held == 1  # coarse, but not repeated


def test_a_clock_that_is_set_back_splits_a_recording_and_a_late_reading_does_not() -> None:
    time = np.concatenate([np.arange(100) * 0.01, 0.3 + np.arange(50) * 0.01])
    assert stretches(time) == [slice(0, 100), slice(100, 150)]
    late = np.arange(100) * 0.01
    late[50] = 0.2
    assert stretches(late) == [slice(0, 100)]


# --- noise


@pytest.mark.parametrize("resolution", [0.0, 1.0, 20.0])
def test_noise_offset_and_resolution(resolution: float) -> None:
    """Of n = 6000 differences: relative error of the robust noise below 4 * 1.2 / sqrt(6000) = 6 %."""
    rng = np.random.default_rng(3)
    values = 150.0 + 27.0 * rng.standard_normal(6000)
    true = np.hypot(27.0, resolution / np.sqrt(12))
    values = np.round(values / resolution) * resolution if resolution else values
    never = np.zeros(6000, bool)
    noise = noise_of(values, ~never, never, never, 150.0, approaches=never)
    assert noise.noise == pytest.approx(true, rel=0.06)
    assert noise.wander == pytest.approx(true, rel=0.06)
    assert noise.offset == pytest.approx(150.0, abs=max(3.0, resolution / 2))
    assert noise.resolution == resolution
    assert noise.quiet == 6000
    assert noise.relative_noise is None


def test_a_drifting_offset_is_no_noise() -> None:
    rng = np.random.default_rng(4)
    values = np.linspace(0, 500, 4000) + 2.0 * rng.standard_normal(4000)
    never = np.zeros(4000, bool)
    noise = noise_of(values, ~never, never, never, 0.0, approaches=never)
    assert noise.noise == pytest.approx(2.0, rel=0.08)
    assert noise.wander > 100


def test_relative_noise_of_a_moving_object() -> None:
    """An object that comes and goes at 0.1 m/s; the fourth difference removes its motion to (g v T)^4 = 6e-7."""
    rng = np.random.default_rng(5)
    time = np.arange(20_000) * 4e-3
    distance = 0.03 + 0.02 * np.sin(time)
    xi = 2e4 * np.exp(-60 * distance)
    values = 100 + xi + np.hypot(3.0, 0.01 * xi) * rng.standard_normal(len(time))
    quiet = np.zeros(len(time), bool)
    quiet[:4000] = True
    values[:4000] = 100 + 3.0 * rng.standard_normal(4000)
    regular = np.ones(len(time), bool)
    noise = noise_of(values, regular, ~quiet, ~regular, 100.0, approaches=~regular)
    assert noise.noise == pytest.approx(3.0, rel=0.08)
    assert noise.relative_noise == pytest.approx(0.01, rel=0.1)


def test_readings_that_stay_at_their_limit_are_clipped() -> None:
    rng = np.random.default_rng(6)
    values = np.minimum(900 + 100 * rng.standard_normal(500), 1023.0)
    values[100:120] = 1023.0
    flags = np.ones(500, bool)
    assert noise_of(values, flags, ~flags, ~flags, 0.0, approaches=~flags).clipped
    assert not noise_of(rng.standard_normal(500), flags, ~flags, ~flags, 0.0, approaches=~flags).clipped


def test_noise_of_distances_along_their_course() -> None:
    rng = np.random.default_rng(7)
    time = np.arange(5000) * 0.01
    distance = 0.2 + 0.1 * np.sin(time) + 1e-3 * rng.standard_normal(5000)
    assert spread_of_course(distance, np.ones(5000, bool)) == pytest.approx(1e-3, rel=0.08)
    assert spread_of_course(distance[:10], np.ones(10, bool)) is None


# --- latency


def motion(rng: np.random.Generator, span: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a smooth random motion on a grid of 1 ms."""
    grid = np.arange(-1, span + 1, 1e-3)
    kernel = np.exp(-0.5 * (np.arange(-400, 401) / 100) ** 2)
    course = np.convolve(rng.standard_normal(len(grid)), kernel, "same")
    return grid, course / course.std()


def lagged(rng: np.random.Generator, lag: float, span: float = 12.0) -> tuple[np.ndarray, ...]:
    grid, course = motion(rng, span)
    own = np.cumsum(0.010 * rng.uniform(0.8, 1.2, int(span / 0.010)))
    other = np.cumsum(0.004 * rng.uniform(0.5, 1.5, int(span / 0.004)))
    signal = 1 - 2 * np.interp(own - lag, grid, course) + 0.2 * rng.standard_normal(len(own))
    return own, signal, other, np.interp(other, grid, course) + 0.05 * rng.standard_normal(len(other))


def test_the_interval_of_a_latency_contains_the_truth() -> None:
    """30 runs with irregular sampling at two rates: a 95 % interval misses more than 6 of 30 with probability 0.1 %."""
    rng = np.random.default_rng(8)
    missed, errors = 0, []
    for _ in range(30):
        true = rng.uniform(-0.02, 0.06)
        latency = estimate_latency(*lagged(rng, true))
        assert latency.value is not None, latency.reason
        assert latency.low < latency.value < latency.high
        missed += not latency.low <= true <= latency.high
        errors.append(latency.value - true)
    assert missed <= 6
    assert np.std(errors) < 1e-3  # a tenth of the slower period
    assert abs(np.mean(errors)) < 4 * np.std(errors) / np.sqrt(30)


def test_without_noise_the_latency_is_exact() -> None:
    """Linear interpolation of the course between 1 ms grid points and samples leaves microseconds."""
    grid, course = motion(np.random.default_rng(9), 10.0)
    own, other = np.arange(0.5, 9.5, 0.01), np.arange(0, 10, 0.002)
    latency = estimate_latency(own, np.interp(own - 0.0234, grid, course), other, np.interp(other, grid, course))
    assert latency.value == pytest.approx(0.0234, abs=5e-5)
    assert latency.correlation > 0.999


def test_a_weak_correlation_has_no_latency() -> None:
    rng = np.random.default_rng(10)
    own, signal, other, course = lagged(rng, 0.02)
    latency = estimate_latency(own, signal + 8 * rng.standard_normal(len(own)), other, course)
    assert latency.value is None
    assert latency.correlation < 0.7
    unrelated = estimate_latency(own, lagged(rng, 0.0)[1][: len(own)], other, course)
    assert unrelated.value is None


def test_a_periodic_motion_is_ambiguous() -> None:
    time = np.arange(0, 20, 0.01)
    rng = np.random.default_rng(11)
    signal = np.sin(2 * np.pi * 4 * time) + 0.05 * rng.standard_normal(len(time))
    latency = estimate_latency(time, signal, time, np.sin(2 * np.pi * 4 * (time + 0.02)))
    assert latency.value is None
    assert "equally" in latency.reason


@pytest.mark.parametrize("values", [np.zeros(500), np.full(500, np.nan), np.arange(3.0)])
def test_no_motion_or_too_few_readings_have_no_latency(values: np.ndarray) -> None:
    time = np.arange(len(values)) * 0.01
    other = np.arange(0, 5, 0.01)
    assert estimate_latency(time, values, other, np.sin(other**1.5)).value is None


# --- detections


def test_detections_are_compared_with_true_events() -> None:
    found = [(1.0, 2.0, 5.0, 1.0), (3.0, 3.1, 5.0, 1.0), (6.0, 6.5, 5.0, 1.0), (9.1, 9.4, 5.0, 1.0)]
    events = [(1.8, 1.8), (7.0, 7.2), (9.0, 9.2), (12.0, 12.0)]
    detections, judged = judge(found, events, 1.0)
    assert [d.judgment for d in detections] == ["right", "false", "right", "right"]
    assert judged[0].lead == pytest.approx(0.8)
    assert judged[1].lead == pytest.approx(1.0)
    assert judged[2].is_late
    assert judged[2].lead == pytest.approx(-0.1)
    assert judged[3].is_missed
    unknown, none = judge(found, None, 1.0)
    assert {d.judgment for d in unknown} == {"unknown"}
    assert none == ()
    assert isinstance(unknown[0], RecordedDetection)


def test_events_are_the_periods_above_the_threshold() -> None:
    time, values = np.arange(8) * 0.5, np.array([0, 0, 1, 1, 0, np.nan, 3, 3.0])
    assert events_in(time, values, 0.5) == [(1.0, 2.0), (3.0, 3.5)]
    assert events_in(time, values, 5) == []


def low_floor() -> pt.Task:
    """Return the task of examples/loop.toml with a floor of 100 counts, which detects objects from 165 mm on."""
    task = pt.load_scenario(LOOP)
    sensing = replace(task.loop.law.conditioning, floor=100.0)
    return task.replace(gain=-0.86, loop=replace(task.loop, law=replace(task.loop.law, conditioning=sensing)))


def visits(lag: float = 0.0, noise: float = 20.0, seed: int = 12, rate: float = 250.0) -> tuple[Recording, ...]:
    """Return readings, distances and contacts of an object that touches the sensor of examples/loop.toml four times."""
    rng = np.random.default_rng(seed)
    starts, speeds = np.array([1.0, 5.2, 8.7, 13.1]), np.array([0.3, 0.35, 0.25, 0.4])

    def distance_at(time: np.ndarray) -> np.ndarray:
        distance = np.full(len(time), 0.5)
        for start, speed in zip(starts, speeds, strict=True):
            leaving = 0.5 * (time - start - 0.5 / speed - 0.2)
            distance = np.minimum(distance, np.maximum(np.maximum(0.5 - speed * (time - start), leaving), 0.0))
        return distance

    time = np.arange(0, 17, 1 / rate)
    signal = 0.533 * (distance_at(time - lag) + 0.0419) ** -3.32
    readings = np.round(150 + signal + np.hypot(noise, 0.002 * signal) * rng.standard_normal(len(time)))
    stamps = np.round(1e9 * time).astype(np.int64)
    named = {"source": "visits", "message_type": "", "stamps": stamps}
    true = distance_at(time)
    return (
        Recording(topic="reading", values=readings, **named),
        Recording(topic="distance", values=np.where(true < 0.45, true, np.inf), kind="distance", **named),
        Recording(topic="contact", values=(true <= 0).astype(float), **named),
    )


def test_a_replay_finds_every_contact_and_nothing_else() -> None:
    task = low_floor()
    readings, distance, contact = visits()
    result = replay(task, readings, reference=distance, truth=contact)
    assert len(result.detections) == 4
    assert not result.false_triggers
    assert not result.missed
    assert result.is_good
    leads = [event.lead for event in result.events]
    # the floor of 100 counts is at 165 mm, 0.41 to 0.66 s before contact; noise may detect a little earlier
    assert 0.35 < min(leads) < max(leads) < 0.9
    assert result.counts["replaced"] == 0


def test_an_object_below_a_high_floor_is_no_empty_scene() -> None:
    readings, *_ = visits()
    empty = 150.0 + 0.533 * (0.5 + 0.0419) ** -3.32  # the object waits at 0.5 m
    for task in (low_floor(), pt.load_scenario(LOOP).replace(gain=-0.86)):
        # standard error of the median of 2,300 readings: 1.25 * 20 / sqrt(2300) = 0.5
        assert replay(task, readings).noise.offset == pytest.approx(empty, abs=2.5)


def test_a_detection_that_never_ends_is_a_warning() -> None:
    """With the wrong sign, readings are large without an object, so that one detection precedes every contact."""
    task = low_floor()
    readings, _, contact = visits()
    good, inverted = (
        replay(task, replace(readings, values=values), truth=contact)
        for values in (readings.values, 30_000.0 - readings.values)
    )
    assert not any(text.startswith("PT609") for text in page_of(good).warnings)
    assert page_of(inverted).warnings[0].startswith("PT609: An object is detected in 100 % of the recording: check")


def test_contacts_without_a_detection_are_missed_and_others_are_false() -> None:
    task = low_floor()
    readings, *_ = visits()
    result = replay(task, readings, contacts=[1.0 + 0.5 / 0.3 + 0.01, 9.0])
    assert (len(result.false_triggers), len(result.missed)) == (3, 1)
    assert not result.is_good
    with pytest.raises(InvalidInputError, match="contacts"):
        replay(task, readings, contacts=[99.0])


def test_the_chain_of_a_recording_is_that_of_its_sensor_and_loads(tmp_path: Path) -> None:
    """The section replaces that of the example; latency within its interval, noise within 6 %, offset within 10 counts.

    The object at rest at 0.5 m adds 4.6 counts to the offset of 150.
    """
    task = low_floor()
    readings, distance, _ = visits(lag=0.012, noise=33.0, rate=170.0)
    result = replay(task, readings, reference=distance)
    assert result.latency.low < 0.012 < result.latency.high
    assert any("lag at least 1" in text and "a latency of 0.1" in text for text in page_of(result).warnings)
    text = re.sub(r"\[chain\]\n.*?(?=\[controller\])", lambda _: result.chain + "\n", LOOP.read_text(), flags=re.DOTALL)
    assert text.count("[chain]") == 1
    (tmp_path / "measured.toml").write_text(text)
    chain = pt.load_scenario(tmp_path / "measured.toml").loop.chain
    assert chain.rate == pytest.approx(170.0, rel=1e-4)
    assert chain.noise == pytest.approx(33.0, rel=0.06)
    assert chain.offset + chain.crosstalk == pytest.approx(154.6, abs=5)
    assert chain.latency == pytest.approx(result.latency.value, rel=1e-4)
    assert chain.relative_noise == pytest.approx(0.002, abs=0.002)
    assert chain.resolution == 1.0
    assert chain.dropout == 0


def test_the_chain_of_a_sensor_that_measures_distances_loads(tmp_path: Path) -> None:
    rng = np.random.default_rng(13)
    time = np.arange(0, 12, 0.02)
    distance = 0.4 - 0.3 * np.abs(np.sin(time)) + 1e-3 * rng.standard_normal(len(time))
    distance[distance > 0.38] = np.inf
    distance[300:310] = np.nan
    stamps = np.round(1e9 * time).astype(np.int64)
    named = {"source": "b", "topic": "/range", "message_type": "", "kind": "distance", "clock": "header"}
    recording = Recording(stamps=stamps, values=distance, transport=np.full(len(time), 4e-3), **named)
    result = replay(low_floor(), recording)
    assert len(result.detections) == 4
    text = re.sub(r"\[chain\]\n.*?(?=\[controller\])", lambda _: result.chain + "\n", LOOP.read_text(), flags=re.DOTALL)
    (tmp_path / "measured.toml").write_text(text)
    chain = pt.load_scenario(tmp_path / "measured.toml").loop.chain
    assert chain.measures_distance
    assert chain.distance_noise == pytest.approx(1e-3, rel=0.25)  # 4 * 1.2 / sqrt(400)
    assert (chain.rate, chain.delay, chain.jitter) == (50.0, 4e-3, 0.0)


def test_the_pairs_of_a_recording_calibrate_the_sensor(tmp_path: Path) -> None:
    task = low_floor()
    readings, distance, _ = visits(lag=0.012)
    pairs = replay(task, readings, reference=distance).pairs()
    assert pairs.shift == pytest.approx(0.012, abs=2e-3)
    (tmp_path / "pairs.csv").write_text(pairs.as_csv())
    fit = fit_sensor(read_calibration(tmp_path / "pairs.csv"), "inverse-power")
    values = fit.sensor.log_output(np.array([0.0499, 0.0501]))
    slope = float(values[1] - values[0]) / 2e-4
    assert slope == pytest.approx(-3.32 / (0.05 + 0.0419), rel=0.03)


def test_pairs_need_distances_that_change() -> None:
    time = np.arange(100) * 0.01
    with pytest.raises(InvalidInputError, match="calibration"):
        pair_distances(time, time, time, np.full(100, 0.1), 0.0)
    with pytest.raises(InvalidInputError, match="fewer"):
        pair_distances(time, time, time, np.full(100, np.nan), 0.0)


def test_distances_below_0_are_no_calibration() -> None:
    """A reference may become negative during contact; `pretouch fit` refuses such a table."""
    time = np.arange(100) * 0.01
    pairs = pair_distances(time, time, time, 0.5 - time, 0.0)
    assert len(pairs.distance) > 45
    assert (pairs.distance >= 0).all()


def test_a_gap_of_the_distances_is_not_bridged() -> None:
    clock = np.concatenate([np.arange(0, 1, 0.01), np.arange(3, 4, 0.01)])
    time = np.arange(0, 4, 0.01)
    pairs = pair_distances(time, time, clock, 0.1 * clock, 0.0)
    assert not ((pairs.reading > 1.01) & (pairs.reading < 2.99)).any()
    assert pairs.distance == pytest.approx(0.1 * pairs.reading)
    assert pairs.largest_speed == pytest.approx(0.1)


def test_a_driver_that_publishes_each_value_five_times_has_the_rate_and_the_noise_of_its_sensor() -> None:
    """Of 1,700 values of 100 Hz: noise within 4 * 1.2 / sqrt(1700) = 12 %."""
    readings, distance, _ = visits(lag=0.012, noise=33.0, rate=100.0)
    time = (readings.time[:, None] + 2e-3 * np.arange(5)).ravel()
    repeated = replace(readings, stamps=np.round(1e9 * time).astype(np.int64), values=np.repeat(readings.values, 5))
    result = replay(low_floor(), repeated, reference=distance)
    assert result.noise.noise == pytest.approx(33.0, rel=0.12)
    assert 'rate = "100.0 Hz"' in result.chain
    once = replay(low_floor(), readings, reference=distance).latency
    assert result.latency.value == pytest.approx(once.value, abs=1e-4)


def test_a_sensor_without_readings_between_objects_has_no_longer_lag() -> None:
    """An object leaves suddenly: the smoothed reference must not say so before the last reading of the sensor."""
    rng = np.random.default_rng(3)
    own, other = np.arange(0, 40, 0.04), np.arange(0, 40, 0.005)

    def course(time: np.ndarray) -> np.ndarray:
        phase = time % 8
        return np.where(phase < 5, np.minimum(phase, 2.0) + 0.3 * np.sin(5 * time) * (phase > 2), 0.0)

    signal = course(own - 0.05) + 0.05 * rng.standard_normal(len(own))
    signal[course(own - 0.05) <= 0.15] = np.nan
    latency = estimate_latency(own, signal, other, course(other))
    assert latency.value == pytest.approx(0.05, abs=8e-3)  # four standard errors; it was 35 ms too long
