"""Judge the steps of recorded times: counters that wrap, single wrong stamps, stamps that are too coarse."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

_WRAPS: Final = (2.0**32, 2.0**32 / 1e3, 2.0**32 / 1e6, 2.0**16)
"""Counts after which a counter restarts: of 32 bits, also in a unit that is 1000 times larger, and of 16 bits."""
_NEAR: Final = 20.0  # steps before and after a restart
_SMALL: Final = 0.01  # of the count, within which these steps must be
_AROUND: Final = 5  # stamps on each side, whose median a stamp is compared with
_FAR: Final = 100.0  # steps
_LEAST: Final = 10**9  # ns from the median, below which a stamp is only late
_ALONE: Final = 86400 * 10**9  # ns between the first or last reading and all others
_SET: Final = 300 * _ALONE  # ns: a longer step is that of a clock that was set, not an interruption of the recording
_COARSE: Final = 2.0  # readings with the same stamp
_FEW: Final = 5  # times that a clock is set in one recording
_BETWEEN: Final = 0.5  # share of different values, and falling steps per rising step, of intervals


def continued(numbers: FloatArray) -> tuple[FloatArray, float | None]:
    """Continue times from a counter that restarts, such as `millis()` after 2^32 ms.

    Args:
        numbers: the times in the unit of the counter; NaN for rows without one.

    Returns:
        The times, and the count at which it restarted; None if it did not.
    """
    at = np.flatnonzero(np.isfinite(numbers))
    known = numbers[at]
    steps = np.diff(known)
    back = np.flatnonzero(steps < 0)
    if not len(back) or not (steps > 0).any():
        return numbers, None
    step = float(np.median(steps[steps > 0]))
    for count in _WRAPS:
        near = min(_NEAR * step, _SMALL * count)
        for low in (0.0, -count / 2):  # without and with a sign
            restarts = back[(known[back] > low + count - near) & (known[back + 1] < low + near)]
            if len(restarts) and (known >= low).all() and (known < low + count).all():
                changed = numbers.copy()
                changed[at] += count * np.searchsorted(restarts, np.arange(len(known)), side="left")
                return changed, count
    return numbers, None


def far_stamps(stamps: IntArray) -> BoolArray:
    """Return which stamps, a few at a time, are far from those before and after them.

    Args:
        stamps: the stamps [ns] in the order of the rows.
    """
    count = len(stamps)
    far = np.zeros(count, dtype=bool)
    if count <= 2 * _AROUND:
        return far
    steps = np.diff(stamps)
    if not (steps > 0).any():
        return far
    limit = max(_FAR * float(np.median(steps[steps > 0])), _LEAST)
    if 2 * _AROUND * int(np.abs(steps).max()) > limit:  # else no stamp is far from any in its window
        windows = np.lib.stride_tricks.sliding_window_view(stamps, 2 * _AROUND + 1)
        middle = np.median(windows - stamps[0], axis=1)
        first = np.clip(np.arange(count) - _AROUND, 0, len(middle) - 1)
        away = (stamps - stamps[0]) - middle[first]
        later = np.append(np.minimum.accumulate(stamps[::-1])[-2::-1], stamps[-1])  # the smallest stamp of later rows
        earlier = np.append(stamps[0], np.maximum.accumulate(stamps)[:-1])
        far |= (away > limit) & (stamps > later)
        far |= (away < -limit) & (stamps < earlier)
    far[0] |= steps[0] > _ALONE  # such as before a clock was set by the network
    far[-1] |= steps[-1] > _ALONE
    return far


def without_settings(stamps: IntArray) -> tuple[IntArray, IntArray]:
    """Remove the steps at which a clock was set by most of a year or more, such as by the network after it started.

    Args:
        stamps: the stamps [ns] in the order of the rows.

    Returns:
        The stamps, with a step as long as others in place of each such step, and the indices of the readings behind
        them. The times of the last part are unchanged.
    """
    steps = np.diff(stamps)
    places = np.flatnonzero(np.abs(steps) > _SET)
    others = steps[(steps > 0) & (steps <= _SET)]
    if not len(places) or not len(others) or len(places) > _FEW:
        return stamps, places[:0]
    changed = steps.copy()
    changed[places] = round(float(np.median(others)))
    return stamps[-1] - np.append(np.cumsum(changed[::-1])[::-1], 0), places + 1


def readings_per_stamp(stamps: IntArray) -> float:
    """Return how many readings typically have the same stamp.

    Args:
        stamps: the stamps [ns], at least one.
    """
    return float(np.median(np.unique(stamps, return_counts=True)[1]))


def is_coarse(stamps: IntArray) -> bool:
    """Return True if most stamps belong to several readings.

    Args:
        stamps: the stamps [ns], at least one.
    """
    return readings_per_stamp(stamps) >= _COARSE


def are_intervals(stamps: IntArray) -> bool:
    """Return True if numbers are no times but the time between readings: they scatter around one value.

    Args:
        stamps: the numbers, at least one.
    """
    middle = float(np.median(stamps))
    falling, rising = (int(np.count_nonzero(side)) for side in (np.diff(stamps) < 0, np.diff(stamps) > 0))
    scatter = stamps.min() > 0 and np.ptp(stamps) <= middle and falling > 0 and falling >= _BETWEEN * rising
    return bool(scatter) and len(np.unique(stamps)) < _BETWEEN * len(stamps)
