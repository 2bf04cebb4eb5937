"""Find the readings of a recording that mean that there is no object.

Drivers report such readings in many ways: as infinity, as a value beyond the range, as -1, or as a value that only
occurs without an object. Such a value repeats exactly, and the readings jump to it and back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final, Literal, TypeAlias

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.simulation import PARTS

Reason: TypeAlias = Literal["infinite", "range", "part", "negative", "repeated"]
Meaning: TypeAlias = Literal["distance", "no object", "too near", "no valid reading"]

ASSUMED: Final = ("part", "negative", "repeated")
"""Reasons that neither the message nor REP 117 gives."""

_FEWEST: Final = 8  # readings in a row that are exactly equal, before a value can be frozen
_LONGER: Final = 3.0  # times the longest run of any other value
_MOST_FROZEN: Final = 3  # values that are tested
_MOST_NEGATIVE: Final = 8  # different negative values that are tested
_STEPS: Final = 3  # readings before or after a run, whose steps show how fast the readings change
_LOCAL: Final = 3.0  # times the largest of these steps, above which a change is a jump
_TYPICAL: Final = 5.0  # typical steps, which are noise, above which a change is a jump
_MOSTLY: Final = 0.5  # share of jumps, above which a value is none of the distances around it
_ROUNDING: Final = 1e-6  # relative, of numbers in single precision
_BOTH_SIDES: Final = 5  # readings above and below a value, from which they can show noise around it
_WIDEST: Final = 8  # steps to both sides of a value, beyond which readings are no noise that repeats one value
_UNLIKELY: Final = 1e-3  # probability below which a rounded normal distribution is rejected


@dataclass(frozen=True, slots=True, kw_only=True)
class NoObject(Value):
    """A value of the readings that was taken as "no object".

    Args:
        value: the value, in m or in the unit of the readings; for the reason "range", the limit of the sensor.
        count: number of readings with this value.
        reason: "infinite" (REP 117), "range" (at or beyond max_range of the message), "part" (from the documentation of
            a sensor part), "negative" (no distance is negative), or "repeated" (repeats exactly, and the readings jump
            to it and back).
    """

    value: float
    count: int
    reason: Reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Distances(Value):
    """Recorded distances after values that are no distances were replaced.

    Args:
        values: distances [m]: plus infinity without an object, minus infinity if the object is too near to be measured,
            NaN without a valid reading.
        no_object: the values that were taken as "no object".
        failed: number of readings by which a part reports a failed measurement.
        impossible: number of single negative readings, which are no distances.
        too_near: number of readings below the smallest distance of the sensor.
        unclear: a smallest distance that repeats exactly, and may mean that there is no object; NaN if there is none.
    """

    values: FloatArray
    no_object: tuple[NoObject, ...]
    failed: int
    impossible: int
    too_near: int
    unclear: float


def classify_distances(values: FloatArray, bounds: tuple[float, float]) -> Distances:
    """Replace the recorded values that are no distances.

    Args:
        values: recorded distances [m].
        bounds: smallest and largest distance that the sensor can measure [m]; NaN if unknown.

    Returns:
        The distances.
    """
    _, high = bounds
    changed, taken = values.copy(), []
    infinite = np.isposinf(values)
    beyond = np.isfinite(values) & _from_maximum(values, bounds)
    changed[beyond] = np.inf
    if beyond.any():
        taken.append(NoObject(value=high, count=int(beyond.sum()), reason="range"))
    if infinite.any():
        taken.append(NoObject(value=np.inf, count=int(infinite.sum()), reason="infinite"))
    failures = _any_of(changed, _codes("failed"))
    changed[failures] = np.nan
    frozen = frozen_values(changed)
    if idle := list(_idle_distances(changed, frozen)):
        changed[np.isin(changed, [each.value for each in idle])] = np.inf
        frozen = frozen_values(changed)
    impossible = _outside_jumps(changed)
    changed[impossible] = np.nan
    unclear = _unclear_value(changed, frozen)
    near = np.isfinite(changed) & _below_minimum(changed, bounds)
    changed[near] = -np.inf
    return Distances(
        values=changed,
        no_object=(*taken, *idle),
        failed=int(failures.sum()),
        impossible=int(impossible.sum()),
        too_near=int(near.sum()),
        unclear=unclear,
    )


def distance_meaning(value: float, bounds: tuple[float, float]) -> Meaning:
    """Return what a single live reading of a distance sensor means.

    It follows the rules of `classify_distances`, except for those that need a series of readings: every negative value
    and every value that a sensor part reports without an object is taken as "no object".

    Args:
        value: the reading [m].
        bounds: smallest and largest distance that the sensor can measure [m]; NaN if unknown.
    """
    values = np.array([value])
    if np.isnan(value) or _any_of(values, _codes("failed"))[0]:
        return "no valid reading"
    if value == -np.inf:
        return "too near"
    if value < 0 or value == np.inf or _from_maximum(values, bounds)[0] or _any_of(values, _codes("no_object"))[0]:
        return "no object"
    return "too near" if _below_minimum(values, bounds)[0] else "distance"


def _from_maximum(values: FloatArray, bounds: tuple[float, float]) -> BoolArray:
    """Return the distances at or beyond the largest one that the sensor can measure."""
    low, high = bounds
    return (values >= high * (1 - _ROUNDING)) & (low < high)


def _below_minimum(values: FloatArray, bounds: tuple[float, float]) -> BoolArray:
    """Return the distances below the smallest one that the sensor can measure."""
    low, high = bounds
    return (values < low * (1 - _ROUNDING)) & (low < high)


def idle_codes(readings: FloatArray) -> tuple[NoObject, ...]:
    """Find values below all sensor outputs that a driver reports without an object.

    Such a value is no sensor output: the readings jump to it, while a sensor output falls to its offset continuously.

    Args:
        readings: sensor outputs, in any unit.

    Returns:
        The values, of which there is mostly none.
    """
    frozen = frozen_values(readings)
    lowest = readings[np.isfinite(readings)].min() if frozen else np.nan
    return tuple(_repeated(readings, [value for value in frozen if value == lowest]))


def has_codes_of_parts(values: FloatArray) -> bool:
    """Return True if readings repeat a value by which a sensor part reports no object or a failed measurement.

    Args:
        values: the readings, if they are distances [m].
    """
    codes = _any_of(values, (*_codes("no_object"), *_codes("failed")))
    return int(codes.sum()) >= _FEWEST


def are_like_distances(values: FloatArray) -> bool:
    """Return True if readings are mostly near their largest value: distances are, and outputs of a sensor are not.

    Args:
        values: the readings, in any unit.
    """
    finite = values[np.isfinite(values)]
    if np.isposinf(values).any() or not len(finite):
        return True
    return bool(np.median(finite) > (finite.min() + finite.max()) / 2)


def frozen_values(values: FloatArray) -> tuple[float, ...]:
    """Find values that repeat exactly, for much longer than any other value of the readings.

    Noise is not measured over such readings. They are often those without an object. The most frequent value of noise
    that is rounded to whole steps is none of them.

    Args:
        values: the readings.

    Returns:
        The values, at most three.
    """
    series = values[np.isfinite(values)]
    starts = np.flatnonzero(np.diff(series, prepend=np.nan) != 0)
    lengths = np.diff(starts, append=len(series))
    if not len(series) or lengths.max() < _FEWEST:
        return ()
    levels, index = np.unique(series[starts], return_inverse=True)
    longest = np.zeros(len(levels), dtype=np.int64)
    np.maximum.at(longest, index, lengths)
    order = np.argsort(-longest, kind="stable")
    for count in range(min(_MOST_FROZEN, len(levels) - 1), 0, -1):
        least, rest = longest[order[count - 1]], longest[order[count]]
        if least >= max(_FEWEST, _LONGER * rest):
            found = levels[order[:count]].tolist()
            return tuple(value for value in found if not _is_rounded_noise(series, levels, value))
    return ()


def _is_rounded_noise(series: FloatArray, levels: FloatArray, value: float) -> bool:
    """Return True if a value is the most frequent one of normal noise that is rounded to whole steps.

    A limit of the sensor has readings near it on one side only, and a code has none near it. Rounded noise has readings
    on both sides, and the readings more than one step away are as rare as the shares of both sides say. This must hold
    on one side at least, because a weak signal of an object adds readings to the other.

    Args:
        series: all finite readings.
        levels: the different values of the readings, in ascending order.
        value: the value.
    """
    place = int(np.searchsorted(levels, value))
    if not 0 < place < len(levels) - 1:
        return False
    step = min(value - levels[place - 1], levels[place + 1] - value)
    steps = (series - value) / step
    steps = steps[np.abs(steps) < _WIDEST + 0.5]
    below, above = steps[steps < -0.5], steps[steps > 0.5]
    if min(len(below), len(above)) < _BOTH_SIDES or max(len(below), len(above)) > len(steps) / 2:
        return False
    normal = NormalDist()
    # the standard deviation and the mean, in steps, follow from the shares of both sides
    low, high = normal.inv_cdf(len(below) / len(steps)), normal.inv_cdf(1 - len(above) / len(steps))
    fitted = NormalDist(-0.5 * (low + high) / (high - low), 1 / (high - low))
    sides = (
        (len(below), int((below < -1.5).sum()), fitted.cdf(-1.5) / fitted.cdf(-0.5)),
        (len(above), int((above > 1.5).sum()), fitted.cdf(-1.5 + 2 * fitted.mean) / fitted.cdf(-0.5 + 2 * fitted.mean)),
    )
    return any(probability_of_at_least(far, count, share) >= _UNLIKELY for count, far, share in sides)


def probability_of_at_least(successes: int, trials: int, probability: float) -> float:
    """Return the probability of at least so many successes in independent trials."""
    from scipy.special import bdtrc  # noqa: PLC0415 - SciPy, only when a value repeats

    return 1.0 if successes <= 0 else float(bdtrc(successes - 1, trials, min(probability, 1.0)))


def _idle_distances(values: FloatArray, frozen: tuple[float, ...]) -> Iterator[NoObject]:
    """Yield the values that a sensor reports without an object."""
    taken: list[float] = []
    for reason, candidates in _suspects(values):
        for value in candidates:
            jumps, _ = _jumps(values, values == value)
            if not len(jumps) or jumps.mean() > _MOSTLY:
                taken.append(value)
                yield NoObject(value=value, count=int((values == value).sum()), reason=reason)
    rest = np.where(np.isin(values, taken), np.nan, values) if taken else values
    frozen = frozen_values(rest) if taken else frozen
    known = rest[np.isfinite(rest)]
    ends = (known.min(), known.max()) if frozen else ()
    yield from _repeated(rest, [value for value in frozen if value in ends])


def _suspects(values: FloatArray) -> Iterator[tuple[Reason, list[float]]]:
    """Yield values that no object can cause, or that a part reports without an object."""
    yield "part", np.unique(values[_any_of(values, _codes("no_object"))]).tolist()
    negative, counts = np.unique(values[np.isfinite(values) & (values < 0)], return_counts=True)
    order = np.argsort(-counts, kind="stable")[:_MOST_NEGATIVE]
    yield "negative", negative[order][counts[order] > 1].tolist()


def _codes(name: str) -> tuple[float, ...]:
    """Return the values [m] with a special meaning of all sensor parts."""
    return tuple({value for part in PARTS.values() for value in getattr(part, name)})


def _unclear_value(values: FloatArray, frozen: tuple[float, ...]) -> float:
    """Return a smallest distance to or from which the readings jump in some runs; NaN if there is none."""
    for value in frozen:
        jumps, _ = _jumps(values, values == value)
        if value == values[np.isfinite(values)].min() and jumps.any():
            return value
    return float("nan")


def _repeated(values: FloatArray, candidates: list[float]) -> Iterator[NoObject]:
    """Yield the candidates to which the readings mostly jump, and from which they mostly jump back.

    At a contact, the readings may jump away, because the object is taken away, but they do not jump to it.
    """
    for value in candidates:
        jumps, side = _jumps(values, values == value)
        begins, ends = jumps[side > 0], jumps[side < 0]
        if len(begins) and len(ends) and min(begins.mean(), ends.mean()) > _MOSTLY:
            yield NoObject(value=value, count=int((values == value).sum()), reason="repeated")


def _outside_jumps(values: FloatArray) -> BoolArray:
    """Return the negative readings to which the readings jump: no distance is negative.

    Readings near 0 become negative by noise, without a jump.
    """
    negative = np.isfinite(values) & (values < 0)
    if not negative.any():
        return negative
    jumps, side = _jumps(values, negative)
    for run, (start, end) in enumerate(zip(*_runs(negative), strict=True), 1):
        around = jumps[np.abs(side) == run]
        negative[start:end] = len(around) > 0 and around.all()
    return negative


def _jumps(values: FloatArray, chosen: BoolArray) -> tuple[BoolArray, IntArray]:
    """Return for each begin and end of the chosen readings whether the readings jump there.

    A change is a jump if it is larger than the steps of the readings next to it, and than the noise. Ends at which
    these steps are unknown are left out.

    Returns:
        Whether there is a jump, and the number of the run from 1 on: positive at its begin, negative at its end.
    """
    starts, ends = _runs(chosen)
    usable = np.isfinite(values) & ~chosen
    with np.errstate(invalid="ignore"):
        steps = np.where(usable[1:] & usable[:-1], np.abs(np.diff(values)), np.nan)
    if not np.isfinite(steps).any():
        return np.zeros(0, dtype=bool), np.zeros(0, dtype=np.int64)
    noise = float(np.nanmedian(steps))
    none = np.full(_STEPS, np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(np.concatenate([none, steps, none]), _STEPS)
    first, last = starts > 0, ends < len(values)
    before, after = starts[first] - 1, ends[last]
    near, inner = np.concatenate([before, after]), np.concatenate([before + 1, after - 1])
    around = np.concatenate([windows[before], windows[after + _STEPS]])
    local = np.where(np.isnan(around), -1.0, around).max(axis=1, initial=-1.0)
    judged = (local >= 0) & usable[near]
    side = np.concatenate([np.flatnonzero(first) + 1, -1 - np.flatnonzero(last)])[judged]
    changes = np.abs(values[near] - values[inner])[judged]
    return changes > _LOCAL * local[judged] + _TYPICAL * noise, side


def _runs(flags: BoolArray) -> tuple[IntArray, IntArray]:
    """Return start and end index of each run of True values."""
    edges = np.diff(np.concatenate([[0], flags.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def _any_of(values: FloatArray, codes: tuple[float, ...]) -> BoolArray:
    """Return the values that equal one of the codes, except for the rounding of a number in single precision."""
    equal = values >= min(codes) * (1 - _ROUNDING)
    large = values[equal]
    equal[equal] = np.any([np.abs(large - code) <= _ROUNDING * code for code in codes], axis=0)
    return equal
