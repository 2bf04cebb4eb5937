"""Find the distances at which a good calibration still needs readings.

The rule is the recipe of docs/how-to/good-calibration.md: from contact outward, the signal falls by about a fifth
from one distance to the next, until it is a twentieth of the signal at the nearest distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

_STEP: Final = -math.log(0.8)  # decrease of ln xi from one distance to the next
_LARGEST_STEP: Final = 1.6 * _STEP  # decrease from which a distance is missing in between
_FAR: Final = math.log(20.0)  # decrease of ln xi to the farthest distance
_FIRST: Final = (0.0, 0.002, 0.005, 0.010, 0.020)  # m, before the readings show how steep the curve is
_MOST: Final = 5  # distances beyond the last one that are named
_SAME: Final = 1e-6  # m, distances that differ by less are equal


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingDistances(Value):
    """Distances at which a good calibration still needs readings.

    Args:
        ends: missing distances nearer or farther than all readings [m].
        gaps: missing distances between readings [m].
    """

    ends: tuple[float, ...] = ()
    gaps: tuple[float, ...] = ()

    @property
    def all(self) -> tuple[float, ...]:
        """All missing distances [m], in increasing order."""
        return tuple(sorted({*self.ends, *self.gaps}))


def missing_distances(
    distances: FloatArray,
    signals: FloatArray,
    floor: float,
    *,
    nearest: float = 0.0,
    farthest: float | None = None,
    limit: float = math.inf,
) -> MissingDistances:
    """Return the distances at which a good calibration still needs readings.

    Args:
        distances: l of the averaged readings [m], increasing, shape (N,).
        signals: xi, the averaged outputs above the offset, shape (N,).
        floor: signal that cannot be distinguished from noise, in the unit of `signals`.
        nearest: the smallest distance that is needed [m].
        farthest: the largest distance that is needed [m]; None for a twentieth of the largest signal.
        limit: the largest distance that can be set [m].

    Returns:
        The missing distances.

    Examples:
        >>> import numpy as np
        >>> l = np.array([0.0, 0.004, 0.008, 0.020])
        >>> missing_distances(l, np.exp(-60 * l), 1e-6, farthest=0.024)
        MissingDistances(ends=(0.024,), gaps=(0.012, 0.016))
    """
    strong = signals > floor
    end = limit if farthest is None else min(farthest, limit)
    if strong.sum() < 2:
        first = [nearest + d for d in _FIRST if nearest + d < end] + ([end] if end < math.inf else [])
        return MissingDistances(ends=tuple(d for d in first if not _has(distances, d)))
    at, log = distances[strong], np.log(signals[strong])
    gaps: list[float] = []
    for near, far, fall in zip(at[:-1], at[1:], log[:-1] - log[1:], strict=True):
        if fall > _LARGEST_STEP:
            count = math.ceil(fall / (1.2 * _STEP))
            gaps += [_round(near + (far - near) * i / count, (far - near) / count) for i in range(1, count)]
    ends = [nearest] if distances[0] > nearest + _SAME else []
    if distances[-1] == at[-1]:  # otherwise the last readings show no signal any more
        lowest = math.log(floor) if farthest is not None else max(math.log(floor), log[0] - _FAR)
        ends += _outward(float(at[-1]), float(log[-1]), (log[-2] - log[-1]) / (at[-1] - at[-2]), lowest, end)
    return MissingDistances(ends=tuple(ends), gaps=tuple(d for d in dict.fromkeys(gaps) if not _has(distances, d)))


def _outward(last: float, level: float, steepness: float, lowest: float, end: float) -> list[float]:
    """Return the missing distances [m] beyond the last recorded distance."""
    places: list[float] = []
    while steepness > 0 and len(places) < _MOST and last < end - _SAME and level > lowest:
        step = _STEP / steepness
        last, level = min(_round(last + step, step), end), level - _STEP
        places.append(last)
    return places


def _has(distances: FloatArray, distance: float) -> bool:
    return bool(len(distances)) and bool(np.min(np.abs(distances - distance)) < _SAME)


def _round(distance: float, step: float) -> float:
    """Round a distance so that a person can set it."""
    unit = 1e-3 if step > 3e-3 else 1e-4
    return round(round(distance / unit) * unit, 6)
