"""The running median: what is far off in one reading or a few never reaches the low-pass.

The readings are kept twice, by arrival and in order, both in tuples of fixed length. A new one takes the place of the
oldest in the ordered tuple by one rule for each of its places, so no step of the loop sorts or allocates anything.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

from pretouch._core.errors import InvalidInputError

__all__ = ["LONGEST_WINDOW", "MedianState", "advance_median", "fill_median", "median_length"]

LONGEST_WINDOW = 16
Readings: TypeAlias = tuple[float, ...]


class MedianState(NamedTuple):
    """The last readings, 16 places each: by arrival, newest first, and in order, what is not in the window as inf."""

    arrived: Readings
    ordered: Readings


def median_length(length: object) -> int:
    """Check the length of a window: 1 (no median) to 16 readings."""
    if not isinstance(length, int) or isinstance(length, bool) or not 1 <= length <= LONGEST_WINDOW:
        raise InvalidInputError(
            f"median_window: found {length!r}, expected a whole number of readings from 1 (no median) "
            f"to {LONGEST_WINDOW}"
        )
    return length


def fill_median(length: int, value: float) -> MedianState:
    """Start a window in which every reading was `value`."""
    places = _fill(0, length, value) + _fill(4, length, value) + _fill(8, length, value) + _fill(12, length, value)
    return MedianState(places, places)


def advance_median(length: int, state: MedianState, value: float) -> tuple[MedianState, float]:
    """Take in a reading and return the median of the last `length`: of an even number the mean of the middle two."""
    if length == 1:
        return state, value
    s, old = state.ordered, state.arrived[length - 1]
    t = _remove(s[0:5], old) + _remove(s[4:9], old) + _remove(s[8:13], old)
    t = t + _remove((s[12], s[13], s[14], s[15], math.inf), old)
    ordered = _insert((-math.inf, t[0], t[1], t[2], t[3]), value) + _insert(t[3:8], value)
    ordered = ordered + _insert(t[7:12], value) + _insert(t[11:16], value)
    arrived = (value, *state.arrived[:-1])
    return MedianState(arrived, ordered), (ordered[(length - 1) // 2] + ordered[length // 2]) / 2


def _fill(first: int, length: int, value: float) -> Readings:
    return (
        value if first < length else math.inf,
        value if first + 1 < length else math.inf,
        value if first + 2 < length else math.inf,
        value if first + 3 < length else math.inf,
    )


def _remove(s: Readings, old: float) -> Readings:
    """Four places of the ordered window without `old`: from it on, each takes the value of the next place."""
    a, b, c, d, e = s
    return (a if a < old else b, b if b < old else c, c if c < old else d, d if d < old else e)


def _insert(t: Readings, new: float) -> Readings:
    """Four places with `new` among them: each keeps its value, takes that of the place before, or the new one."""
    a, b, c, d, e = t
    return (min(max(new, a), b), min(max(new, b), c), min(max(new, c), d), min(max(new, d), e))
