"""A drift of a sensor over a recording is reported, and a motion is no drift."""

from __future__ import annotations

import re

import numpy as np
import pytest
from test_recordings import LOOP, low_floor, page_of

import pretouch as pt
from pretouch.recording import Recording, replay
from pretouch.recording.drift import drift_at_equal_distances, trend_of

DURATION, RATE = 40.0, 100.0


def recordings(warm_up: float = 0.0, offset: float = 0.0, seed: int = 1) -> tuple[Recording, Recording]:
    """Return readings and distances of an object that comes eight times, each time to another distance.

    The signal changes linearly by the share `warm_up`, and the offset by `offset` counts.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0, DURATION, 1 / RATE)
    nearest = rng.uniform(0.01, 0.04, 8)[np.minimum((time / 5).astype(int), 7)]
    distance = nearest + 0.3 * np.abs(np.cos(np.pi * time / 5)) ** 3
    signal = 0.533 * (distance + 0.0419) ** -3.32 * (1 + warm_up * time / DURATION)
    noise = np.hypot(15, 0.005 * signal) * rng.standard_normal(len(time))
    named = {"source": "b", "message_type": "", "stamps": np.round(1e9 * time).astype(np.int64)}
    return (
        Recording(topic="reading", values=150 + offset * time / DURATION + signal + noise, **named),
        Recording(topic="distance", values=distance, kind="distance", **named),
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_sensor_that_warms_up_is_reported_and_one_that_does_not_is_not(seed: int) -> None:
    readings, distance = recordings(warm_up=-0.13, seed=seed)
    drift = replay(low_floor(), readings, reference=distance).drift
    assert np.expm1(drift.change) == pytest.approx(-0.13, rel=0.2)  # the ends of the 95 % interval are 15 % away
    readings, distance = recordings(seed=seed)
    result = replay(low_floor(), readings, reference=distance)
    assert result.drift is None
    assert not [text for text in page_of(result).warnings if text.startswith("PT612")]


def test_a_drift_of_the_offset_is_reported_and_a_part_of_the_chain(tmp_path) -> None:
    rng = np.random.default_rng(2)
    time = np.arange(0, DURATION, 1 / RATE)
    values = 150 + 30 * time / DURATION + 20 * rng.standard_normal(len(time))
    named = {"source": "b", "topic": "t", "message_type": "", "stamps": np.round(1e9 * time).astype(np.int64)}
    result = replay(low_floor(), Recording(values=values, **named))
    assert result.noise.drift.low < 30 < result.noise.drift.high
    assert [text[:5] for text in page_of(result).warnings if "drift" in text] == ["PT612"]
    text = re.sub(r"\[chain\]\n.*?(?=\[controller\])", lambda _: result.chain + "\n", LOOP.read_text(), flags=re.DOTALL)
    (tmp_path / "measured.toml").write_text(text)
    assert pt.load_scenario(tmp_path / "measured.toml").loop.chain.drift == pytest.approx(30 / DURATION, rel=0.2)


def test_noise_alone_has_a_trend_as_rarely_as_declared() -> None:
    """By chance, a trend of 20 parts is significant in 1e-4 of the cases, and in none of 300 with probability 0.97."""
    time = np.arange(2000.0)
    noise = np.random.default_rng(3).standard_normal((300, 2000))
    assert sum(trend_of(time, values) is not None for values in noise) <= 1


def test_distances_that_are_reached_once_show_no_drift() -> None:
    """A single slow approach: drift and distance cannot be separated."""
    time = np.arange(0, 40, 0.01)
    distance = 0.3 - 0.006 * time
    assert drift_at_equal_distances(time, -60 * distance - 0.01 * time, distance) is None
