"""Compute the rate, jitter and gaps of recorded readings.

Repeated values, and repeated or late time stamps, are counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value

ROBUST: Final = 1.482602218505602  # standard deviation of a normal distribution divided by its median deviation
_GAP: Final = 1.5  # periods between two readings, above which a reading is missing
_DROPPED: Final = 5.5  # periods: a longer gap is an interruption, and no sequence of single dropouts
_CONFIRMED: Final = 5  # readings after a step back of the clock that are all early: the clock was set back
_REPEATED: Final = 0.8  # share of readings in runs of the same length, above which the sensor is slower than its topic
_RESOLUTION: Final = 1e-9  # s, of stamps
_FEWEST_RUNS: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing(Value):
    """Rate, jitter and gaps of recorded readings.

    Args:
        count: number of readings.
        duration: time from the first to the last reading [s].
        rate: readings per second while none is missing [Hz]; NaN for fewer than two readings.
        mean_rate: readings per second over the whole recording [Hz].
        jitter: robust standard deviation of the time of a reading [s], from intervals without missing readings.
        gaps: number of intervals longer than 1.5 periods.
        longest_gap: longest interval between two readings [s].
        longest_gap_at: time of its start [s].
        dropout: share of missing readings in gaps of up to five periods.
        repeated_stamps: number of readings with the time of the previous one.
        late: number of readings whose time is before that of an earlier one.
        held: number of times that a value is repeated on its topic until it changes, rounded; 1 if it is not.
        value_rate: new values per second while none is missing [Hz]; the rate if no value is repeated.
    """

    count: int
    duration: float
    rate: float
    mean_rate: float
    jitter: float
    gaps: int
    longest_gap: float
    longest_gap_at: float
    dropout: float
    repeated_stamps: int
    late: int
    held: int
    value_rate: float


def timing_of(time: FloatArray, values: FloatArray) -> Timing:
    """Compute the rate, jitter and gaps of sensor readings.

    Args:
        time: time of each reading [s], in the order of arrival.
        values: the readings.

    Returns:
        The timing; rates are NaN for fewer than two different times.
    """
    late = int((time < np.maximum.accumulate(time)).sum()) if len(time) else 0
    ordered = np.sort(time)
    steps = np.diff(ordered)
    positive = steps[steps > 0]
    duration = float(ordered[-1] - ordered[0]) if len(time) else 0.0
    if not len(positive):
        nothing = dict.fromkeys(("rate", "mean_rate", "value_rate", "jitter", "longest_gap", "longest_gap_at"), np.nan)
        repeated = len(steps)
        return Timing(
            count=len(time),
            duration=duration,
            gaps=0,
            dropout=0.0,
            repeated_stamps=repeated,
            late=late,
            held=1,
            **nothing,
        )
    regular = positive[positive <= _GAP * np.median(positive)]
    period = float(regular.mean())
    gaps = steps > _GAP * period
    missing = np.round(steps[gaps & (steps < _DROPPED * period)] / period) - 1
    longest = int(steps.argmax())
    repeats = _repeats(values)
    return Timing(
        count=len(time),
        duration=duration,
        rate=1 / period,
        mean_rate=len(steps) / duration,
        jitter=_jitter(regular),
        gaps=int(gaps.sum()),
        longest_gap=float(steps[longest]),
        longest_gap_at=float(ordered[longest] - time[0]),
        dropout=float(missing.sum() / (missing.sum() + len(time))),
        repeated_stamps=int((steps == 0).sum()),
        late=late,
        held=round(repeats),
        value_rate=1 / period / repeats,
    )


def _jitter(intervals: FloatArray) -> float:
    """Return the jitter of the reading times [s]: a robust standard deviation, or 0 below 1 ns."""
    spread = ROBUST * np.median(np.abs(intervals - np.median(intervals)))
    jitter = float(spread / np.sqrt(2))  # an interval has the jitter of two readings
    return jitter if jitter >= _RESOLUTION else 0.0


def _repeats(values: FloatArray) -> float:
    """Return how many times a sensor repeats each value on average. The result is 1 if this number is not constant."""
    finite = values[np.isfinite(values)]
    changes = np.flatnonzero(np.diff(finite) != 0)
    runs = np.diff(changes)
    if len(runs) < _FEWEST_RUNS:
        return 1.0
    usual = float(np.median(runs))
    alike = runs[np.abs(runs - usual) <= 1]
    return float(alike.mean()) if usual >= 2 and alike.sum() >= _REPEATED * runs.sum() else 1.0


def stretches(time: FloatArray) -> list[slice]:
    """Split a recording where its clock was set back.

    A single reading that is late does not split a recording.

    Args:
        time: time of each reading [s], in the order of arrival.

    Returns:
        The parts, in the order of arrival.
    """
    starts = [0]
    for i in _drops(time):
        before = time[starts[-1] : i]
        after = time[i : i + _CONFIRMED]
        if len(before) and (after < before.max()).all() and len(after) == _CONFIRMED:
            starts.append(int(i))
    return [slice(a, b) for a, b in zip(starts, [*starts[1:], len(time)], strict=True)]


def _drops(time: FloatArray) -> IntArray:
    return np.flatnonzero(np.diff(time) < 0) + 1
