"""Pair sensor readings with recorded distances for a calibration.

The distances come from another topic. The command `pretouch fit` reads the resulting calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value

_MOST_ROWS: Final = 20_000
_LONGEST_GAP: Final = 5.0  # typical periods of the distance topic, over which distances are interpolated
_FEWEST: Final = 10  # pairs
_NARROW: Final = 1e-3  # m, range of distances below which there is nothing to fit


@dataclass(frozen=True, slots=True, kw_only=True)
class DistancePairs(Value):
    """Sensor readings and the object distances at the same times.

    Args:
        distance: distances [m]; infinite without an object.
        reading: readings.
        time: times of the readings [s].
        shift: latency of the sensor that was removed before pairing [s]; 0 if it is unknown.
        largest_speed: 95 % quantile of the speed of the object during the readings [m/s].
    """

    distance: FloatArray
    reading: FloatArray
    time: FloatArray
    shift: float
    largest_speed: float

    def as_csv(self) -> str:
        """Return the readings and distances as a CSV calibration table.

        The table has at most 20,000 rows. Of more readings, every n-th is kept.
        """
        every = -(-len(self.distance) // _MOST_ROWS)
        rows = [
            f"{'inf' if np.isinf(d) else f'{1e3 * d:.6g}'},{y!r}"
            for d, y in zip(self.distance[::every].tolist(), self.reading[::every].tolist(), strict=True)
        ]
        return "\n".join(["distance [mm],output", *rows]) + "\n"


def pair_distances(
    time: FloatArray, readings: FloatArray, other_time: FloatArray, distance: FloatArray, shift: float
) -> DistancePairs:
    """Interpolate recorded distances at the times of the sensor readings.

    Args:
        time: times of the readings [s].
        readings: the readings; those that are not finite are left out.
        other_time: times of the distances [s], from the same clock.
        distance: distances [m]; plus infinity means no object, and NaN or negative values are left out.
        shift: by how much the readings lag the distances [s].

    Returns:
        The pairs.

    Raises:
        InvalidInputError: there are too few pairs, or the distance hardly changes.
    """
    between, kept, speed, known = _interpolated(time, readings, other_time, distance, shift)
    finite = between[kept & np.isfinite(between)]
    if not known.any():
        clock, at = np.sort(other_time[distance >= 0]), time - shift
        raise InvalidInputError(
            f"reference: no reading of the sensor lies between distances of the reference. The readings range from "
            f"{at.min():.6g} s to {at.max():.6g} s, and the distances from {clock[0]:.6g} s to {clock[-1]:.6g} s. Use "
            "the receive times of both topics with --clock receive, or name a topic that was recorded at the same time"
        )
    if len(finite) < _FEWEST:
        raise InvalidInputError(
            f"reference: the number of readings with a distance is {len(finite)}, but a calibration needs at least "
            f"{_FEWEST} readings. Move the object toward the sensor while recording"
        )
    if np.ptp(finite) < _NARROW:
        low, high = f"{1e3 * finite.min():.4g} mm", f"{1e3 * finite.max():.4g} mm"
        raise InvalidInputError(
            f"reference: the distances range only from {low} to {high}, but a calibration needs a range of at least "
            f"{1e3 * _NARROW:g} mm. Move the object toward the sensor while recording"
        )
    return DistancePairs(
        distance=between[kept],
        reading=readings[kept],
        time=time[kept],
        shift=shift,
        largest_speed=float(np.quantile(speed[kept & np.isfinite(between)], 0.95)),
    )


def match_distances(
    time: FloatArray, readings: FloatArray, other_time: FloatArray, distance: FloatArray, shift: float
) -> tuple[FloatArray, BoolArray]:
    """Interpolate recorded distances at the times of the sensor readings, like `pair_distances`, but of any range.

    Args:
        time: times of the readings [s].
        readings: the readings.
        other_time: times of the distances [s].
        distance: distances [m].
        shift: by how much the readings lag the distances [s].

    Returns:
        The distance at each reading, and which of them are known.
    """
    between, kept, _, _ = _interpolated(time, readings, other_time, distance, shift)
    return between, kept


def _interpolated(
    time: FloatArray, readings: FloatArray, other_time: FloatArray, distance: FloatArray, shift: float
) -> tuple[FloatArray, BoolArray, FloatArray, BoolArray]:
    """Return the distances at the readings, which are usable, the speeds, and which lie between two distances."""
    order = np.argsort(other_time, kind="stable")
    usable = order[distance[order] >= 0]  # a reference may become negative during contact
    clock, length = other_time[usable], distance[usable]
    if len(clock) < 2:
        raise InvalidInputError("reference: the distance topic has fewer than two usable distances")
    at = time - shift
    after = np.clip(np.searchsorted(clock, at, side="right"), 1, len(clock) - 1)
    width = clock[after] - clock[after - 1]
    steps = np.diff(clock)
    longest = _LONGEST_GAP * float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    known = (at >= clock[0]) & (at <= clock[-1]) & (width <= longest) & (width > 0)
    first, last = length[after - 1], length[after]
    both = np.isfinite(first) & np.isfinite(last)
    none = np.isposinf(first) & np.isposinf(last)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(width > 0, (at - clock[after - 1]) / width, 0.0)
        between = np.where(both, first + share * (last - first), np.inf)
        speed = np.where(both, np.abs(last - first) / width, 0.0)
    return between, known & np.isfinite(readings) & (both | none), speed, known
