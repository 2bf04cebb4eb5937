"""Find drifts of a sensor over a recording: of its offset, and of its signal at equal distances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value

_BLOCKS: Final = 20  # parts of the recording; readings within a part may depend on each other
_FEWEST_BLOCKS: Final = 10
_FEWEST: Final = 5  # readings in a part
_CERTAIN: Final = 5.0  # standard errors; by Student's distribution with 8 degrees of freedom, 0.001 by chance
_BINS: Final = 12  # distances at which readings of different times are compared
_LIMIT: Final = 1.959963984540054  # standard deviations of a 95 % interval
_LEAST_SPREAD: Final = 0.1  # of the duration: spread of the times at equal distances


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift(Value):
    """Significant change of a quantity over a recording.

    Args:
        change: the change from the first to the last reading.
        low: lower end of its 95 % confidence interval.
        high: upper end.
        start: the quantity at the first reading; 0 if only the change is known.
        rate: the change per second.
    """

    change: float
    low: float
    high: float
    start: float
    rate: float


def trend_of(time: FloatArray, values: FloatArray) -> Drift | None:
    """Fit a line to the medians of values in equal parts of the time.

    Args:
        time: times of the values [s], at least one.
        values: finite values.

    Returns:
        The change from the first to the last time; None if it is not significant, or if there are too few values.
    """
    order = np.argsort(time, kind="stable")
    parts = np.split(order, np.searchsorted(_blocks(time)[order], np.arange(1, _BLOCKS)))
    parts = [part for part in parts if len(part) >= _FEWEST]
    if len(parts) < _FEWEST_BLOCKS:
        return None
    middle = np.array([time[part].mean() for part in parts])
    median = np.array([np.median(values[part]) for part in parts])
    spread = middle - middle.mean()
    rate = float(spread @ median / (spread @ spread))
    rest = median - median.mean() - rate * spread
    error = float(np.sqrt(rest @ rest / (len(rest) - 2) / (spread @ spread)))
    start = float(median.mean() + rate * (time.min() - middle.mean()))
    return _significant(rate, error, float(np.ptp(time)), start)


def drift_at_equal_distances(time: FloatArray, signal: FloatArray, distance: FloatArray) -> Drift | None:
    """Find a drift of a signal that also depends on the distance.

    Signals of different times are compared at nearly equal distances: in each of 12 intervals of the distance, a line
    over the distance is removed from the signals and from the times. What remains of the signals is fitted to what
    remains of the times. The error follows from the parts of the recording, within which readings depend on each other.

    Args:
        time: times of the signals [s].
        signal: the signals, such as ln xi.
        distance: distances at these times [m].

    Returns:
        The change over the recording; None if it is not significant, or if each distance was reached only once.
    """
    if len(time) < _FEWEST * _BINS:
        return None
    rest_time, rest_signal = np.zeros(len(time)), np.zeros(len(time))
    for part in np.array_split(np.argsort(distance, kind="stable"), _BINS):
        design = np.column_stack([np.ones(len(part)), distance[part] - distance[part].mean()])
        for values, rest in ((time, rest_time), (signal, rest_signal)):
            coefficients, *_ = np.linalg.lstsq(design, values[part] - values[part].mean(), rcond=None)
            rest[part] = values[part] - values[part].mean() - design @ coefficients
    duration, information = float(np.ptp(time)), float(rest_time @ rest_time)
    block = _blocks(time)
    if len(np.unique(block)) < _FEWEST_BLOCKS or information < len(time) * (_LEAST_SPREAD * duration) ** 2:
        return None
    rate = float(rest_time @ rest_signal) / information
    scores = np.bincount(block, rest_time * (rest_signal - rate * rest_time), _BLOCKS)
    return _significant(rate, float(np.sqrt(scores @ scores)) / information, duration, 0.0)


def _blocks(time: FloatArray) -> IntArray:
    """Return the part of the recording of each time."""
    share = (time - time.min()) / max(float(np.ptp(time)), np.finfo(float).tiny)
    return np.asarray(np.minimum((_BLOCKS * share).astype(np.int64), _BLOCKS - 1))


def _significant(rate: float, error: float, duration: float, start: float) -> Drift | None:
    if not abs(rate) > _CERTAIN * error:
        return None
    low, high = (duration * (rate + side * _LIMIT * error) for side in (-1, 1))
    return Drift(change=duration * rate, low=low, high=high, start=start, rate=rate)
