"""Average the readings of a recording at known distances of the object."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.units import read_quantity
from pretouch._core.values import Value

from .distance_pairs import match_distances
from .recording import Recording

FEWEST: Final = 8
"""Readings that a known distance needs."""

_MOST_HOLDS: Final = 40  # different distances, above which the object moves
_BINS: Final = 12  # of the distances of a moving object
_BATCHES: Final = 8  # parts of the readings at a distance, in the order of time; within a part, readings depend
_PICOMETERS: Final = 12  # digits of a distance in m that are compared
_CLIPPED: Final = 0.01  # share of readings at the limit of the sensor
_SAME: Final = 4.0  # standard errors by which the halves of a hold may differ
_DITHERED: Final = 0.5  # of the resolution: with more noise, rounding errors average out
_STEADY: Final = 0.03  # of the signal: a smaller change during a hold does not matter
_PART: Final = re.compile(r"\s*(?P<start>.*?)\s*(?:-|\bto\b)\s*(?P<end>.*?)\s*:\s*(?P<place>.+?)\s*", re.DOTALL)
_NONE: Final = ("none", "empty", "no object", "inf")
_BARE: Final = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?", re.IGNORECASE)
_RANGE: Final = re.compile(r"\s*(?:-|\bto\b)\s*")


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownDistance(Value):
    """Mean reading at a known distance of the object.

    Args:
        distance: the distance, counted as in the calibration [m]; infinite without an object.
        signal: the mean signal xi there according to the calibration; 0 without an object, NaN beyond the curve.
        reading: the mean reading.
        error: its standard error, from parts of the readings.
        count: number of readings.
        change: mean reading of the second half minus that of the first half; 0 for a moving object.
        change_error: standard error of this change.
        clipped: whether readings are at the limit of the sensor.
        span: half the range of the distances, which is 0 for an object that is held [m].
        spread: standard deviation of a reading; NaN for a moving object.
    """

    distance: float
    signal: float
    reading: float
    error: float
    count: int
    change: float
    change_error: float
    clipped: bool
    span: float = 0.0
    spread: float = math.nan

    def is_steady(self, offset: float) -> bool:
        """Return True if the readings do not change while the object is held.

        Args:
            offset: the reading without an object; a change by less than 3 % of the signal above it does not matter.
        """
        return abs(self.change) <= max(_SAME * self.change_error, _STEADY * abs(self.reading - offset))


def read_known_distances(text: str, recording: Recording) -> Recording:
    """Read where the object was during a recording.

    Args:
        text: parts of the recording, such as "0-5 s: none, 8-12 s: 10 mm, 14-30 s: 60 to 5 mm". The last one is an
            object that moves with constant speed. Times count from the first reading.
        recording: the readings.

    Returns:
        The distance at each reading [m]: infinite without an object, NaN if it is unknown.

    Raises:
        InvalidInputError: a part cannot be read, or contains no reading.
    """
    time = recording.time
    distance = np.full(len(time), np.nan)
    for part in filter(str.strip, re.split(r"[,;](?=\s*[\d.]+[^:,;]*:)", text)):
        found = _PART.fullmatch(part)
        if found is None:
            raise InvalidInputError(
                f'--distances: cannot read {part.strip()!r}, expected times and a distance, such as "8-12 s: 10 mm" '
                'or "0-5 s: none"'
            )
        start, end = _ends(found["start"], found["end"], "s")
        inside = (time >= start) & (time <= end)
        if not start < end or not inside.any():
            raise InvalidInputError(
                f"--distances: found no reading from {start:g} s to {end:g} s; the recording lasts {time.max():.4g} s"
            )
        place = found["place"]
        if place.lower() in _NONE:
            distance[inside] = np.inf
            continue
        first, *rest = _RANGE.split(place)
        read_length((rest or [first])[0], name="--distances")
        near, far = _ends(first, rest[0], "m") if rest else (read_length(place, name="--distances"),) * 2
        if not 0 <= min(near, far) <= max(near, far) < math.inf:
            raise InvalidInputError(f"--distances: found {place}, expected a distance of 0 mm or more, or none")
        distance[inside] = near + (far - near) * (time[inside] - start) / (end - start)
    return Recording(
        source=recording.source,
        topic="known distances",
        message_type="known distances",
        stamps=recording.stamps,
        values=distance,
        kind="distance",
        clock=recording.clock,
        unit="mm",
    )


def read_length(text: str, *, name: str) -> float:
    """Read a length that must have a unit, because a number alone would count as meters.

    Args:
        text: the length, such as "5 mm".
        name: name of the option in messages.

    Returns:
        The length [m].

    Raises:
        InvalidInputError: the length has no unit, or cannot be read.
    """
    value = read_quantity(text, "m", name=name)
    if value and _BARE.fullmatch(text.strip()):
        raise InvalidInputError(
            f'{name}: found {text.strip()} without a unit, expected one, such as "{text.strip()} mm"'
        )
    return value


def _ends(first: str, last: str, unit: str) -> tuple[float, float]:
    """Read the ends of a range. The unit of the last one applies to both if the first one has none."""
    end = read_quantity(last, unit, name="--distances")
    bare = re.fullmatch(r"[\d.]+", first)
    suffix = last.lstrip("+.0123456789 ")
    return read_quantity(f"{first} {suffix}" if bare else first, unit, name="--distances"), end


def known_distances(
    recording: Recording,
    distances: Recording,
    signal: Callable[[FloatArray], FloatArray],
    *,
    shift: float,
    limit: float,
    resolution: float = 0.0,
) -> tuple[tuple[KnownDistance, ...], tuple[tuple[float, int], ...]]:
    """Average the readings at each known distance.

    An object with more than 40 different distances moves: its readings are averaged in 12 intervals of the distance.

    Args:
        recording: the readings.
        distances: the distances at the same time.
        signal: the curve of the calibration, which returns the signal at distances [m].
        shift: by how much the readings of a moving object lag the distances [s].
        limit: reading from which the sensor is clipped.
        resolution: step of the readings; 0 if they have none.

    Returns:
        The mean readings, by increasing distance; those without an object come last. And the distances with too few
        readings, with their numbers of readings.
    """
    moving = len(np.unique(distances.values[np.isfinite(distances.values)])) > _MOST_HOLDS
    if np.array_equal(recording.stamps, distances.stamps) and not (moving and shift):
        at = distances.values
        kept = (at >= 0) & np.isfinite(recording.values)
    else:
        other = distances.seconds_after(int(recording.stamps[0]))
        lag = shift if moving else 0.0
        at, kept = match_distances(recording.time, recording.values, other, distances.values, lag)
    held = np.asarray(np.where(kept, at, np.nan).round(_PICOMETERS), dtype=np.float64)
    near = np.isfinite(held)
    places = np.unique(held[near])
    groups: list[BoolArray] = [held == place for place in places]
    if moving:
        edges = np.quantile(held[near], np.linspace(0, 1, _BINS + 1))
        place = np.clip(np.searchsorted(edges, held, side="right") - 1, 0, _BINS - 1)
        groups = [near & (place == i) for i in range(_BINS)]
    groups.append(np.isposinf(held))
    averages = tuple(
        _average(held[group], recording.values[group], signal, limit, resolution, moving=moving)
        for group in groups
        if group.sum() >= FEWEST
    )
    few = ((float(held[group][0]), int(group.sum())) for group in groups if 0 < group.sum() < FEWEST)
    return averages, () if moving else tuple(few)


def _average(
    distance: FloatArray,
    values: FloatArray,
    signal: Callable[[FloatArray], FloatArray],
    limit: float,
    resolution: float,
    *,
    moving: bool,
) -> KnownDistance:
    empty = bool(np.isposinf(distance[0]))
    moving = moving and not empty
    parts = np.array_split(values, min(_BATCHES, len(values) // 2))
    means = np.array([part.mean() for part in parts])
    spread = float(values.std(ddof=1))
    single = spread / math.sqrt(len(values))
    if spread < _DITHERED * resolution:  # rounding errors of readings that are equal do not average out
        single = math.hypot(single, resolution / math.sqrt(12))
    between = float(means.std(ddof=1)) / math.sqrt(len(means))
    half = len(values) // 2
    return KnownDistance(
        distance=math.inf if empty else float(distance.mean()),
        signal=0.0 if empty else float(signal(distance).mean()),
        reading=float(values.mean()),
        error=single if moving else max(single, between),  # the means of the parts also differ by the motion
        count=len(values),
        change=0.0 if moving else float(values[half:].mean() - values[:half].mean()),
        change_error=2 * single,
        clipped=bool((values >= limit).mean() > _CLIPPED),
        span=float(np.ptp(distance)) / 2 if moving else 0.0,
        spread=math.nan if moving else spread,
    )
