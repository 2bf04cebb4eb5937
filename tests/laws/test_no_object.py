"""Readings without an object: whatever a driver reports then, it is no contact, and no noise is measured over it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from test_recordings import low_floor, page_of

from pretouch._core.errors import InvalidInputError
from pretouch.recording import Recording, read_recording, replay
from pretouch.recording.no_object import classify_distances, frozen_values, idle_codes
from pretouch.recording.noise import noise_of, spread_of_course

UNKNOWN = (np.nan, np.nan)
NOISE = 4.3e-3


def visits(idle: float, noise: float = NOISE, nearest: float = 0.1, step: float = 0.0, seed: int = 1) -> np.ndarray:
    """Return distances at 50 Hz of an object that comes four times to `nearest`, and leaves the beam there."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, 40, 0.02)
    distance = np.full(len(time), np.nan)
    for start in (5.0, 15.0, 25.0, 33.0):
        near = (time >= start) & (time < start + 4)
        distance[near] = np.maximum(0.45 - 0.25 * (time[near] - start), nearest)
    distance += noise * rng.standard_normal(len(time))
    distance = np.round(distance / step) * step if step else distance
    return np.where(np.isnan(distance), idle, distance).astype(np.float32).astype(float)


@pytest.mark.parametrize(
    ("idle", "limits", "reason"),
    [
        (np.inf, UNKNOWN, "infinite"),
        (-1.0, UNKNOWN, "negative"),
        (-1.0, (0.02, 4.0), "negative"),
        (4.0, (0.02, 4.0), "range"),
        (9.0, (0.02, 4.0), "range"),
        (8.190, UNKNOWN, "part"),
        (8.191, (0.02, 40.0), "part"),
        (0.0, UNKNOWN, "repeated"),
        (0.0, (0.02, 4.0), "repeated"),
        (2.55, UNKNOWN, "repeated"),
    ],
)
def test_an_idle_value_is_no_object_and_has_no_noise(idle: float, limits: tuple[float, float], reason: str) -> None:
    """The noise of 800 readings by fourth differences: 4 * 1.2 / sqrt(800) = 17 %."""
    values = visits(idle)
    distances = classify_distances(values, limits)
    (taken,) = distances.no_object
    assert (taken.reason, taken.count) == (reason, 1200)
    assert (distances.impossible, distances.failed) == (0, 0)
    assert np.isposinf(distances.values).sum() == 1200
    assert spread_of_course(distances.values, np.ones(len(values), bool)) == pytest.approx(NOISE, rel=0.17)


@pytest.mark.parametrize(("idle", "bounds", "known"), [(-1.0, (0.02, 4.0), True), (0.0, UNKNOWN, False)])
def test_a_range_without_an_object_is_no_contact_for_the_law(
    idle: float, bounds: tuple[float, float], known: bool
) -> None:
    """The law detects the four visits from 165 mm on, and nothing else; the exported controller knows -1, but not 0."""
    named = {"source": "b", "topic": "/range", "message_type": "", "kind": "distance", "bounds": bounds}
    stamps = np.arange(2000) * 20_000_000
    result = replay(low_floor(), Recording(stamps=stamps, values=visits(idle), **named))
    assert len(result.detections) == 4
    assert [detection.start for detection in result.detections] == pytest.approx([6.1, 16.1, 26.1, 34.1], abs=0.3)
    assert result.counts["detected without an object"] == (0 if known else 1200)
    page = page_of(result)
    assert any(warning.startswith("PT610") for warning in page.warnings) != known
    assert any("1,200 readings" in text and "no object" in text for text in page.findings)


def test_true_events_are_the_values_as_recorded() -> None:
    """A topic of ranges that is 1 during contact, and 0 otherwise: neither value is "no object" there."""
    time = np.arange(2000) * 20_000_000
    values = visits(-1.0)
    named = {"source": "b", "message_type": "", "kind": "distance", "stamps": time}
    contact = Recording(topic="/contact", values=((values > 0) & (values < 0.12)).astype(float), **named)
    result = replay(low_floor(), Recording(topic="/range", values=values, **named), truth=contact)
    assert (len(result.events), len(result.missed), len(result.false_triggers)) == (4, 0, 0)


def test_a_contact_at_distance_0_is_no_idle_value() -> None:
    """An object that comes to rest at 0, and goes away again; without an object, the distance is infinite."""
    time = np.arange(0, 20, 0.02)
    distance = np.maximum(0.3 * np.abs(np.sin(time / 3)) - 0.05, 0.0)
    for idle in (distance, np.where(distance > 0.2, np.inf, distance)):
        distances = classify_distances(idle, UNKNOWN)
        assert not [taken for taken in distances.no_object if taken.reason != "infinite"]
        assert (distances.values == idle).all()
        assert np.isnan(distances.unclear)


def test_an_object_that_leaves_at_contact_is_unclear() -> None:
    """An object that comes slowly to 0, and is taken away: the value counts as a distance, with a remark."""
    distance = np.maximum(0.4 - 0.2 * (np.arange(0, 50, 0.02) % 5), 0.0)
    distance[distance > 0] += 1e-3 * np.random.default_rng(1).standard_normal((distance > 0).sum())
    distances = classify_distances(distance, UNKNOWN)
    assert distances.no_object == ()
    assert (distances.values == distance).all()
    assert distances.unclear == 0


def test_noise_around_contact_is_no_idle_value_and_single_jumps_below_0_are_invalid() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(0, 20, 0.02)
    distance = 0.1 * np.abs(np.sin(time / 2)) + 2e-3 * rng.standard_normal(len(time))
    assert (distance < 0).sum() > 5
    assert (classify_distances(distance, UNKNOWN).values == distance).all()
    distance[500] = -0.7
    distances = classify_distances(distance, UNKNOWN)
    assert distances.impossible == 1
    assert np.isnan(distances.values[500])
    assert np.isneginf(classify_distances(distance, (0.0, 1.0)).values).sum() == (distance < 0).sum() - 1


def test_a_failed_measurement_is_no_reading() -> None:
    values = visits(np.inf)
    values[[100, 700]] = 65.535
    distances = classify_distances(values, UNKNOWN)
    assert distances.failed == 2
    assert np.isnan(distances.values[[100, 700]]).all()


def test_an_object_at_rest_before_a_sensor_without_noise_stays_an_object() -> None:
    """Its distance repeats exactly, too, but no reading jumps to it."""
    time = np.arange(0, 20, 0.02)
    distance = np.interp(time, [0, 5, 7, 12, 14, 20], [0.3, 0.3, 0.1, 0.1, 0.3, 0.3])
    assert frozen_values(distance) == (0.1, 0.3) or frozen_values(distance) == (0.3, 0.1)
    assert classify_distances(distance, UNKNOWN).no_object == ()


def test_repeated_values_of_a_slower_sensor_are_not_frozen() -> None:
    rng = np.random.default_rng(3)
    assert frozen_values(np.repeat(rng.standard_normal(300), 16)) == ()
    assert frozen_values(np.round(rng.standard_normal(5000))) == ()
    assert frozen_values(np.zeros(0)) == frozen_values(np.full(50, np.nan)) == ()


def outputs(noise: float = 6.0, relative: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """Return sensor outputs at 250 Hz of an object that comes and goes, and whether its signal is large.

    30 counts are subtracted, so that the output is negative without an object.
    """
    rng = np.random.default_rng(4)
    time = np.arange(0, 60, 4e-3)
    signal = 2e4 * np.exp(-60 * (0.02 + 0.06 * (1 - np.sin(time)))) - 30
    return signal + np.hypot(noise, relative * signal) * rng.standard_normal(len(time)), np.sin(time) > 0.2


def counts(deviation: float, idle: float, seed: int, seconds: float = 2.0, lowest: float = 0.0) -> list[np.ndarray]:
    """Return readings at 200 Hz, rounded to counts, before and while an object passes; and whether it is detected."""
    time = np.arange(0, seconds + 3, 5e-3)
    signal = np.where(time < seconds, 0, 500 * np.exp(-(((time - seconds - 1.5) / 0.5) ** 2)))
    noise = deviation * np.random.default_rng(seed).standard_normal(len(time))
    return [np.round(np.maximum(idle + signal + noise, lowest)), signal > 5, (signal > 0.05) & (signal <= 5)]


def is_limited(deviation: float, idle: float, seed: int, seconds: float = 2.0, lowest: float = 0.0) -> bool:
    readings, there, near = counts(deviation, idle, seed, seconds, lowest)
    return noise_of(readings, np.ones(len(readings), bool), there, near, idle, approaches=near).limited


@pytest.mark.parametrize("seconds", [1, 2, 10])
@pytest.mark.parametrize("deviation", [0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 3.0])
def test_rounded_noise_is_no_limit(deviation: float, seconds: float) -> None:
    """The most frequent count repeats by chance, with the mean at a count or between two."""
    for idle in (61.0, 61.2, 61.5):
        assert not any(is_limited(deviation, idle, seed, seconds) for seed in range(10))


@pytest.mark.parametrize("deviation", [1.5, 3.0, 6.0])
def test_a_limit_within_the_noise_is_one(deviation: float) -> None:
    """The sensor cannot give less than 61 counts, and its mean without this limit is 1 to 4 deviations below."""
    for below in (1.0, 2.0, 4.0):
        assert all(is_limited(deviation, 61 - below * deviation, seed, lowest=61) for seed in range(10))


def test_rounded_noise_is_measured_without_an_object() -> None:
    """It was called a limit, and its noise that of an object. Rounding adds 1/12 to the variance."""
    rng = np.random.default_rng(3)
    readings, there, _ = counts(0.7, 61.0, 17)
    named = {"source": "b", "topic": "/adc", "message_type": "", "kind": "reading"}
    readings[there] += np.round(5 * rng.standard_normal(there.sum()))
    result = replay(low_floor(), Recording(stamps=np.arange(len(readings)) * 5_000_000, values=readings, **named))
    assert not result.noise.limited
    assert result.noise.noise == pytest.approx(np.sqrt(0.7**2 + 1 / 12), rel=0.15)
    assert "lowest" not in tomllib.loads(result.chain)["chain"]
    assert not any("while an object was there" in text for text in page_of(result).findings)


def test_a_value_among_the_readings_of_an_object_is_frozen() -> None:
    """Readings pass it on both sides, but they are not rarer farther away, as rounded noise would be."""
    course = np.round(61 + 300 * np.sin(np.arange(6000) / 300))
    values = np.where(np.arange(6000) % 1500 < 700, 61.0, course)
    assert frozen_values(values) == (61.0,)


def test_a_code_below_all_outputs_is_no_offset() -> None:
    readings, there = outputs()
    readings[~there] = -1000.0
    (code,) = idle_codes(readings)
    assert (code.value, code.count) == (-1000.0, (~there).sum())
    flags = np.ones(len(readings), bool)
    noise = noise_of(readings, flags, there, ~flags, 0.0, approaches=~flags, codes=(code.value,))
    assert noise.offset is None
    assert noise.noise == pytest.approx(6, rel=0.2)  # measured with an object
    assert noise.relative_noise == pytest.approx(0.01, rel=0.1)


def test_an_output_that_is_limited_without_an_object_has_the_noise_of_an_object() -> None:
    """Numbers without a sign have no noise at 0. Each of 8 levels has 800 readings: 4 * 1.2 / sqrt(800) = 17 %."""
    readings, there = outputs()
    readings = np.maximum(readings, 0.0)
    assert idle_codes(readings) == ()
    flags = np.ones(len(readings), bool)
    noise = noise_of(readings, flags, there, ~flags, 0.0, approaches=~flags)
    assert (noise.offset, noise.limited) == (0.0, True)
    assert noise.noise == pytest.approx(6.0, rel=0.2)
    assert noise.relative_noise == pytest.approx(0.01, rel=0.2)


def test_a_code_for_no_object_shows_no_offset() -> None:
    """All other readings are those of an object; the farthest of them were taken as readings without one."""
    rng = np.random.default_rng(4)
    time = np.arange(2000) * 10_000_000
    distance = 5e-3 + 0.4 * np.abs(np.sin(np.arange(2000) / 160))
    counts = np.round(150 + 9000 * (0.03 / (distance + 0.03)) ** 3 + 6 * rng.standard_normal(2000))
    values = np.where(distance < 0.15, counts, -1.0)
    named = {"source": "b", "topic": "/adc", "message_type": "", "kind": "reading"}
    result = replay(low_floor(), Recording(stamps=time, values=values, **named))
    assert result.recording.no_object[0].value == -1
    assert result.noise.offset is None
    assert result.noise.drift is None
    assert result.noise.noise == pytest.approx(6, rel=0.4)
    page = page_of(result)
    assert not any(warning.startswith("PT608") for warning in page.warnings)
    assert any("the offset is not measured" in text for text in page.findings)
    assert "not measured; from the scenario" in next(line for line in result.chain.splitlines() if "offset" in line)


def test_a_code_is_shown_in_the_unit_of_the_recording(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    distance = 5 + 400 * np.abs(np.sin(np.arange(2000) / 160)) + rng.standard_normal(2000)
    rows = [f"{10 * i},{round(d) if d < 150 else -1}" for i, d in enumerate(distance)]
    (tmp_path / "log.csv").write_text("time [ms],range [mm]\n" + "\n".join(rows) + "\n")
    recording = read_recording(tmp_path / "log.csv")
    assert (recording.kind, recording.unit) == ("distance", "mm")
    assert recording.value_in_words(-1e-3) == "-1 mm"
    result = replay(low_floor(), recording)
    assert result.recording.no_object[0].value == -1e-3
    assert any(" of -1 mm, because no distance is negative" in text for text in page_of(result).findings)


def test_the_offset_of_a_recording_is_set_in_the_sensor_chain() -> None:
    """If only the controller had it, a verification would simulate the sensor with the old offset."""
    readings, _ = outputs()
    named = {"source": "b", "topic": "/adc", "message_type": "", "kind": "reading"}
    stamps = np.arange(len(readings)) * 4_000_000
    result = replay(low_floor(), Recording(stamps=stamps, values=readings + 60, **named))
    (warning,) = (text for text in page_of(result).warnings if text.startswith("PT608"))
    assert "copy the section [chain]" in warning
    assert tomllib.loads(result.chain)["chain"]["offset"] == pytest.approx(result.noise.offset)


def test_repeated_values_are_no_rate_of_the_sensor() -> None:
    readings, _ = outputs()
    values = np.repeat(readings[::4], 4)  # 62.5 Hz, published at 250 Hz
    named = {"source": "b", "topic": "/adc", "message_type": "", "kind": "reading"}
    result = replay(low_floor(), Recording(stamps=np.arange(len(values)) * 4_000_000, values=values, **named))
    assert result.timing.value_rate == pytest.approx(62.5)
    assert "62.5 Hz of new values" in result.headline
    assert tomllib.loads(result.chain)["chain"]["rate"] == "62.5 Hz"
    slower = [text for text in page_of(result).warnings if text.startswith("PT606")]
    assert (len(slower), "62.5 Hz instead of" in "".join(slower)) == (1, True)


@pytest.mark.parametrize("idle", [-1, 0])
def test_a_range_without_a_unit_is_refused_also_if_its_idle_value_is_small(idle: int, tmp_path: Path) -> None:
    """It was read as counts, and no object was detected."""
    distance = 5 + 400 * np.abs(np.sin(np.arange(1000) / 160))
    rows = [f"{10 * i},{round(value) if value < 150 else idle}" for i, value in enumerate(distance)]
    path = tmp_path / "r.csv"
    path.write_text("\n".join(["time_ms,range", *rows]) + "\n")
    with pytest.raises(InvalidInputError, match="no unit"):
        read_recording(path)
    assert read_recording(path, "range [counts]").kind == "reading"
    assert read_recording(path, "range [mm]").kind == "distance"
