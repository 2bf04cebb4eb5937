"""Prepare a calibration for fitting: usable window, outliers, offset, noise, and whether there is a signal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, positive
from pretouch._core.units import format_quantity

from .averaging import MAD_TO_SIGMA, AveragedCurve, ReadingNoise, average, condense, reading_noise
from .ceilings import CeilingFits, fit_under_ceilings
from .data import Calibration
from .family_fits import bad_distances, find_noise
from .headers import is_length
from .possible_curves import Courses, find_courses
from .result import NoiseEstimate, OffsetEstimate, UsableWindow
from .window import NearEnd, declared_offset, end_of_falling, find_near_end, is_rising, window_of
from .witness import Witness, witness_of

OffsetChoice: TypeAlias = "str | float | tuple[float, float]"

FEWEST_POINTS = 3  # two parameters and one point to judge them by
_FEWEST_DISTANCES = 4  # the inverse power on a known offset, and one to judge it by
_FALL_LEVEL = 0.05
_CLEAR_FALL = 6.0  # standard deviations from the first to the last reading that need no rank test


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """A calibration made ready for models.

    `informed_by` counts the distances that the noise was estimated from; `free` are the curves that the readings ask
    for where an offset is given; `witness` is what the readings say without any fit; `no_signal` says why there is
    nothing to fit, and is empty where there is.
    """

    calibration: Calibration
    window: UsableWindow
    used: AveragedCurve
    offset: OffsetEstimate | None = None
    noise: NoiseEstimate | None = None
    courses: Courses | None = None
    informed_by: int = 0
    reaches_last: bool = False
    flattens: bool = False
    outliers: tuple[int, ...] = ()
    outlier_distances: tuple[float, ...] = ()
    free: Courses | None = None
    witness: Witness | None = None
    no_signal: tuple[str, ...] = ()


def prepare(
    calibration: Calibration,
    offset: OffsetChoice,
    saturation: float | str | None,
    near_field_peak: float | str | None,
    floor_sigmas: float,
) -> Prepared:
    """Find all that models have in common, from what `fit_sensor` takes: both ends, bad readings, offset and noise."""
    positive(floor_sigmas, "floor_sigmas")
    calibration = condense(calibration)
    curve = average(calibration)
    known = reading_noise(calibration, curve)
    given = _given_offset(calibration, offset, known)
    if is_length(calibration.unit):
        nothing = NearEnd(index=0, reason="", saturation=None)
        return _nothing(calibration, curve, nothing, given, _reports_distance(calibration))
    if near_field_peak == "auto" and is_rising(curve, known):
        return _nothing(calibration, curve, NearEnd(index=0, reason="", saturation=None), given, _rising(calibration))
    near = find_near_end(calibration, curve, saturation, near_field_peak)
    needed = _FEWEST_DISTANCES + (given is None)
    left = len(curve.distance) - near.index
    if left < needed:
        few = (
            f"Only {left} distinct distance{'s' if left != 1 else ''} to use ({near.reason}), and at least {needed} "
            "are needed: measure at 8 or more, out to where the output no longer changes, and record readings with "
            "no object."
        )
        return _nothing(calibration, curve, near, given, few)
    if not np.ptp(curve.output[near.index :]) > 0:
        stuck = f"The output is {curve.output[near.index]:g} {calibration.unit}".rstrip()
        return _nothing(calibration, curve, near, given, f"{stuck} at every distance: check power and wiring.")
    end = near.index + end_of_falling(curve.part(slice(near.index, None)), known)
    if end - near.index < needed:
        end = len(curve.distance)
    return _prepared(calibration, curve, known, given, near=near, end=end, floor_sigmas=floor_sigmas)


def _prepared(
    calibration: Calibration,
    curve: AveragedCurve,
    known: ReadingNoise,
    given: OffsetEstimate | None,
    *,
    near: NearEnd,
    end: int,
    floor_sigmas: float,
) -> Prepared:
    """Go on where the ends of falling are known."""
    place = np.arange(len(curve.distance))
    good = (place >= near.index) & (place < end)
    ceilings = fit_under_ceilings(curve.part(good), known, given)
    steep, flattens = _steep_end(curve, known, given, near=near, good=good, ceilings=ceilings)
    out = tuple(steep.index + i for i in bad_distances(curve.part(slice(steep.index, end)), known, given))
    good &= ~np.isin(place, out)
    if out and good.sum() >= _FEWEST_DISTANCES:  # a bad reading may have looked like a ceiling
        ceilings = fit_under_ceilings(curve.part(good), known, given)
        steep, flattens = _steep_end(curve, known, given, near=near, good=good, ceilings=ceilings)
    near = steep
    good &= place >= near.index
    tail = curve.part(good)
    noise, given, free = _level(calibration, tail, known, given)
    found = given if given is not None or free is None else free.offset("fitted")
    if found is None:  # there are points enough where none is given
        raise AssertionError
    if found.kind == "fitted":  # no family is quite the sensor's: the interval holds what either kind of fit allows
        low, high = ceilings.offset_interval()
        found = replace(found, low=min(found.low, low), high=max(found.high, high))
    last = None
    if end < len(curve.distance):
        at = format_quantity(float(curve.distance[end - 1]), "m")
        last = (end, f"from {at} on the output rises again: a second reflection, or a wall; left out")
    window = window_of(
        calibration, curve, near, offset=found, sigma=noise.output, floor_sigmas=floor_sigmas, left_out=out, last=last
    )
    used = curve.part(np.isin(curve.distance, window.distances))
    courses = None
    if len(used.distance) >= FEWEST_POINTS:
        courses = free if given is None else find_courses(used, noise, found, informed_by=len(tail.distance))
    at_bad = tuple(float(curve.distance[i]) for i in out)
    readings = np.flatnonzero(np.isin(calibration.distances, at_bad))
    return Prepared(
        calibration=calibration,
        window=window,
        used=used,
        offset=found,
        noise=noise,
        courses=courses,
        informed_by=len(tail.distance),
        reaches_last=bool(window.distances) and window.distances[-1] == float(curve.distance[-1]),
        flattens=flattens,
        outliers=tuple(sorted({*curve.bad_readings, *(int(i) for i in readings)})),
        outlier_distances=at_bad,
        free=None if given is None else free,
        witness=witness_of(curve, found, noise, ceilings, window.l_max) if window.distances else None,
        no_signal=_why_no_signal(tail, window, found, noise, calibration.unit),
    )


def _level(
    calibration: Calibration, tail: AveragedCurve, known: ReadingNoise, given: OffsetEstimate | None
) -> tuple[NoiseEstimate, OffsetEstimate | None, Courses | None]:
    """Find the noise of the falling part, a given offset's own error, and the courses with a free offset."""
    noise = find_noise(tail, known, given)
    if given is None:
        return noise, None, find_courses(tail, noise, None)
    if given.standard_error < 0:  # one or two readings: their noise is that of the others
        error, value = float(noise.output / np.sqrt(len(calibration.no_object))), given.value
        given = replace(given, standard_error=error, low=value - 2.6 * error, high=value + 2.6 * error)
    free = None
    if len(tail.distance) >= _FEWEST_DISTANCES + 2:  # what a wrong offset makes is no misfit
        free = find_courses(tail, find_noise(tail, known, None), None, also=given.value)
    return noise, given, free


def _steep_end(
    curve: AveragedCurve,
    known: ReadingNoise,
    given: OffsetEstimate | None,
    *,
    near: NearEnd,
    good: BoolArray,
    ceilings: CeilingFits,
) -> tuple[NearEnd, bool]:
    """Move the near end to the first reading that is as steep as an ideal curve, if the output flattens."""
    part, place = curve.part(good), np.flatnonzero(good)
    first = ceilings.first_steep(part.distance)
    if first and given is not None and given.kind == "declared":  # an offset that is wrong bends a curve, too
        first = min(first, fit_under_ceilings(part, known, None).first_steep(part.distance))
    first = min(first, max(len(place) - _FEWEST_DISTANCES - (given is None), 0))
    if not first:
        return near, False
    at = format_quantity(float(part.distance[first]), "m")
    reason = f"nearer than {at} the output flattens toward a ceiling: the sensor cannot tell distances there"
    if near.flat:
        reason = f"{near.reason}, and has too little slope up to {at}"
    return NearEnd(index=int(place[first]), reason=reason, saturation=near.saturation), True


def _reports_distance(calibration: Calibration) -> str:
    """Say what to do with a sensor that measures the distance itself."""
    return (
        f"The output is a distance in {calibration.unit}: this sensor reports a distance, not a signal that falls with "
        "it. Give the curve of the law by hand, and set chain.reports_distance = true; nothing is fitted."
    )


def _rising(calibration: Calibration) -> str:
    """Say what to do with an output that rises with distance."""
    top = float(max([calibration.outputs.max(), *calibration.no_object]))
    return (
        "The output rises with distance, and a proximity signal falls: for a sensor that reports a distance, give "
        "its curve by hand and set chain.reports_distance = true; for electronics that invert, write the output with "
        f"the other sign, such as {top:g} {calibration.unit}".rstrip()
        + " minus the reading."
    )


def _given_offset(calibration: Calibration, offset: OffsetChoice, known: ReadingNoise) -> OffsetEstimate | None:
    """Return the offset where it is measured or declared; None where it has to be fitted."""
    if offset == "fit" or (offset == "auto" and not len(calibration.no_object)):
        return None
    if offset == "auto":
        return _measured_offset(calibration.no_object, known)
    expected = "a number, or a number and its standard error"
    if isinstance(offset, str) and offset != "zero":
        raise InvalidInputError(f"offset: found {offset!r}, expected 'auto', 'fit', 'zero', {expected}")
    if isinstance(offset, (tuple, list)) and len(offset) != 2:
        raise InvalidInputError(f"offset: found {offset!r}, expected {expected}")
    return declared_offset(0.0 if isinstance(offset, str) else offset)


def _measured_offset(readings: FloatArray, known: ReadingNoise) -> OffsetEstimate:
    """Average no-object readings without those far off the rest; a negative error marks one not known yet."""
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only for fits

    kept = readings
    if len(readings) >= 5:
        deviation = np.abs(readings - np.median(readings))
        limit = 6 * max(MAD_TO_SIGMA * float(np.median(deviation)), known.resolution)
        kept = readings[deviation <= limit] if limit > 0 else readings
    value = float(np.mean(kept))
    if known.sigma is None:
        return OffsetEstimate(value=value, standard_error=-1.0, low=value, high=value, kind="measured")
    error = float(known.sigma / np.sqrt(len(kept)))
    reach = float(stdtrit(max(known.freedom, 1.0), 0.975)) * error
    return OffsetEstimate(value=value, standard_error=error, low=value - reach, high=value + reach, kind="measured")


def _nothing(
    calibration: Calibration, curve: AveragedCurve, near: NearEnd, given: OffsetEstimate | None, reason: str
) -> Prepared:
    """Return the preparation of a calibration in which there is nothing to fit."""
    window = UsableWindow(
        distances=(),
        start_reason=near.reason,
        end_reason=reason,
        saturation=near.saturation,
        floor=given.value if given is not None else float(curve.output.min()),
    )
    return Prepared(
        calibration=calibration,
        window=window,
        used=curve.part(slice(0)),
        outliers=curve.bad_readings,
        no_signal=(reason,),
    )


def _why_no_signal(
    tail: AveragedCurve, window: UsableWindow, offset: OffsetEstimate, noise: NoiseEstimate, unit: str
) -> tuple[str, ...]:
    """Say why there is no usable signal; nothing where there is."""
    reasons = []
    count = len(window.distances)
    chance = chance_of_falling(tail.output[: 2 * count])  # a long plateau says nothing of the window
    near, far = tail.output[0] - offset.value, tail.output[-1] - offset.value
    error = float(np.hypot(*noise.of_means(tail.count[[0, -1]], np.maximum([near, far], 0.0))))
    if count >= FEWEST_POINTS and chance > _FALL_LEVEL and near - far < _CLEAR_FALL * error:
        reasons.append(
            f"The output does not fall with distance more than chance allows (rank test, p = {chance:.2g}): check that "
            "the sensor is powered, faces the object, and that the object is in its range."
        )
    if count < FEWEST_POINTS:
        far = format_quantity(window.distances[-1], "m") if count else "none"
        reasons.append(
            f"Only {count} distinct distance{'s' if count != 1 else ''} (last: {far}) stand{'s' if count == 1 else ''} "
            f"above the floor of {window.floor:.4g} {unit}".rstrip()
            + f" (offset {offset.value:.4g} ± {offset.standard_error:.2g}, noise of a reading "
            f"{noise.output:.2g}), and a curve needs {FEWEST_POINTS}: measure in finer steps near the sensor, "
            "repeat readings, and record the output with no object."
        )
    return tuple(reasons)


def chance_of_falling(output: FloatArray) -> float:
    """Return the chance that a random order falls as much as this one (Kendall's test, exact; ties count half)."""
    n = len(output)
    pairs = [float(output[j] - output[i]) for i in range(n) for j in range(i + 1, n)]
    rising = sum(p > 0 for p in pairs) + (sum(p == 0 for p in pairs) + 1) // 2
    ways = np.ones(1)
    for size in range(2, n + 1):  # orders of `size` numbers by their count of rising pairs
        ways = np.convolve(ways, np.ones(size)) / size
    return float(min(1.0, ways[: rising + 1].sum()))
