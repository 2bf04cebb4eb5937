"""Times of two topics are compared only on one clock, and the result says which clock that is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_recordings import low_floor, page_of, visits

from pretouch.errors import InvalidInputError
from pretouch.recording import Recording, replay
from pretouch.recording.clocks import Transport, compare_clocks
from pretouch.recording.reading import read_recordings

START = 10**18


def transport(topic: str, delay: float, *, drift: float = 0.0, rate: float = 100.0, bursts: bool = False) -> Transport:
    """Return times of 60 s; the recorder writes late in bursts if wanted."""
    rng = np.random.default_rng(len(topic))
    stamps = np.arange(0, 60, 1 / rate)
    received = stamps * (1 + drift) + delay + 1e-3 * rng.exponential(size=len(stamps))
    if bursts:
        received += np.where(stamps % 7 < 1, 0.3, 0.0)
    return Transport(topic, *(START + np.round(1e9 * time).astype(np.int64) for time in (received, stamps)))


@pytest.mark.parametrize(
    ("delay", "drift", "large"),
    [(0.0, 0.0, False), (0.03, 0.0, False), (1.5, 0.0, True), (-37.0, 0.0, True), (0.0, 500e-6, True)],
)
@pytest.mark.parametrize("bursts", [False, True])
def test_offset_and_drift_of_two_clocks(delay: float, drift: float, large: bool, bursts: bool) -> None:
    one, other = transport("/a", 0.002), transport("/bcd", 0.004 + delay, drift=drift, rate=40.0, bursts=bursts)
    difference = compare_clocks(other, one)
    # the drift is 0 at the start and adds 15 ms in the middle; the fastest of 100 messages needs 10 us more than 2 ms
    assert difference.offset == pytest.approx(0.002 + delay + 30 * drift, abs=2e-3)
    assert difference.is_large == large
    assert difference.rate == pytest.approx(drift, abs=20e-6)


def test_topics_without_a_common_time_are_compared_by_their_medians() -> None:
    one = Transport("/a", np.array([START]), np.array([START - 5_000_000]))
    other = Transport("/b", np.array([START + 10**9]), np.array([START + 10**9 - 2_000_000_000]))
    assert compare_clocks(one, other).offset == pytest.approx(-1.995)


@pytest.fixture
def recorded():
    pytest.importorskip("rosbags", reason="needs the extra ros")
    import recorded

    return recorded


def bag_of(recorded, folder: Path, stamp_offset: float, *, from_boot: bool = False) -> Path:
    """Write a bag with distances of the visits, whose stamps differ from those of the contacts."""
    _, distance, contact = visits(rate=100.0)
    types = recorded.store()
    time = distance.time
    own = time + 12.0 if from_boot else time + 1e9 + stamp_offset
    ranges = recorded.range_messages(types, time, distance.values, delay_ns=3_000_000, stamp_time=own)
    truth = recorded.range_messages(types, time, contact.values, delay_ns=1_000_000)
    topics = {"/range": (recorded.RANGE, ranges), "/contact": (recorded.RANGE, truth)}
    return recorded.write_bag(folder / "bag", topics, types=types)


@pytest.mark.parametrize(("offset", "from_boot"), [(37.0, False), (1.5, False), (-0.4, False), (0.0, True)])
def test_contacts_on_another_clock_are_compared_by_receive_times(recorded, tmp_path, offset, from_boot) -> None:
    bag = bag_of(recorded, tmp_path, offset, from_boot=from_boot)
    sensor, contact = read_recordings(bag, ("/range", "/contact.range"))
    assert {sensor.clock, contact.clock} == {"receive"}
    assert any("two clocks" in note for note in sensor.notes)
    result = replay(low_floor(), sensor, truth=contact)
    assert (len(result.detections), len(result.false_triggers), len(result.missed)) == (4, 0, 0)
    assert not any(warning.startswith("PT611") for warning in page_of(result).warnings)


def test_the_header_clock_is_used_if_it_is_asked_for_and_the_warning_comes_first(recorded, tmp_path) -> None:
    sensor, contact = read_recordings(bag_of(recorded, tmp_path, 1.5), ("/range", "/contact.range"), clock="header")
    result = replay(low_floor(), sensor, truth=contact)
    assert result.clocks[0].offset == pytest.approx(-1.498, abs=1e-3)
    assert page_of(result).warnings[0].startswith("PT611")


def test_stamps_of_one_clock_are_used(recorded, tmp_path) -> None:
    sensor, contact = read_recordings(bag_of(recorded, tmp_path, 0.0), ("/range", "/contact.range"))
    assert {sensor.clock, contact.clock} == {"header"}


def test_true_events_of_another_time_are_refused() -> None:
    readings, _, contact = visits()
    later = replace(contact, stamps=contact.stamps + 40 * 10**9)
    with pytest.raises(InvalidInputError, match="--clock receive"):
        replay(low_floor(), readings, truth=later)


def test_detections_before_the_true_events_are_recorded_are_unknown() -> None:
    readings, _, contact = visits()
    result = replay(low_floor(), readings, truth=contact.part(slice(len(contact.stamps) // 2, None)))
    assert [detection.judgment for detection in result.detections] == ["unknown", "unknown", "right", "right"]


def test_the_lag_says_which_clock_it_rests_on() -> None:
    """By the receive times, the lag has the additional 30 ms of the sensor's messages."""
    readings, distance, _ = visits(lag=0.012)
    taken = {"clock": "header", "transport": np.full(len(readings.stamps), 0.032)}
    other = {"clock": "header", "transport": np.full(len(readings.stamps), 0.002)}
    result = replay(low_floor(), replace(readings, **taken), reference=replace(distance, **other))
    assert result.clocks[0].offset == pytest.approx(0.030, abs=1e-6)
    (text,) = [text for text in page_of(result).findings if "rests on" in text]
    assert f"it is {1e3 * (result.latency.value + 0.030):.1f}" in text
    received = replay(low_floor(), replace(readings, clock="receive"), reference=distance)
    assert any("receive times" in str(label) for label, _ in page_of(received).key_figures)


def test_no_pairs_say_that_the_times_do_not_overlap() -> None:
    readings, distance, _ = visits()
    result = replay(low_floor(), readings, reference=replace(distance, stamps=distance.stamps + 37 * 10**9))
    with pytest.raises(InvalidInputError, match="range from"):
        result.pairs()


def test_a_sensor_of_2_hz_has_one_detection_per_object() -> None:
    time = np.arange(0, 60, 0.5)
    near = (time % 20 > 5) & (time % 20 < 12)
    values = np.where(near, 2000.0, 150.0) + 20 * np.random.default_rng(1).standard_normal(len(time))
    named = {"source": "b", "topic": "t", "message_type": ""}
    result = replay(low_floor(), Recording(stamps=np.round(1e9 * time).astype(np.int64), values=values, **named))
    assert len(result.detections) == 3
    assert [d.end - d.start for d in result.detections] == pytest.approx([6.5] * 3, abs=0.6)
    assert any("counts the sensor as lost" in warning for warning in page_of(result).warnings)
