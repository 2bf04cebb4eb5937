"""Prepare a calibration for fitting: estimate offset and noise, and exclude unusable readings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, IntArray, positive
from pretouch._core.units import format_quantity, supported_digits
from pretouch._core.warning_codes import caution
from pretouch.tables.names import is_length

from .averaging import (
    AveragedCurve,
    ReadingNoise,
    average,
    condense,
    count_copies_once,
    falling_means,
    leave_out_empty_outliers,
    max_scatter,
    reading_noise,
)
from .ceilings import ERROR, CeilingFits, SampleOptions, fit_under_ceilings
from .data import Calibration
from .family_fits import find_noise, outlier_indices
from .not_a_signal import falls_and_rises, overflowed_output, reported_distance, rising_output
from .possible_curves import PossibleCurves, fit_possible_curves
from .result import NoiseEstimate, OffsetEstimate, UsableWindow
from .window import NearEnd, declared_offset, end_of_falling, find_near_end, is_rising, window_of
from .witness import Witness, witness_of

OffsetChoice: TypeAlias = "str | float | tuple[float, float]"

_FEWEST_POINTS = 3  # two parameters and one point to judge them by
_FEWEST_DISTANCES = 4  # the inverse power with a known offset, and one point to judge it by
_FALL_LEVEL = 0.05  # significance level of the rank test
_FEW_FLATTENED = 2  # flattened distances that one wrong reading explains as well
_CLEAR = 13.0  # decrease of ln xi between neighbors, in standard errors: their slope is known within 15 % (95 %)
_FLATTENED = "the output flattens toward a ceiling at smaller distances, where {} the slope"
_SCATTERED = 0.3  # share of the range of the outputs by which readings of one empty scene cannot differ
_CLEAR_FALL = 6.0  # decrease in standard deviations, from the first to the last reading, that needs no rank test


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """Calibration that is ready for fitting.

    It contains the usable distances, offset, noise and outliers. `informed_by` is the number of distances from which
    the noise was estimated. `empty_outliers` are readings without an object that were left out [unit of the outputs].
    `free` are the curves fitted with a free offset, if an offset was measured or declared.

    `falling` has the usable readings, combined where noise lets the output rise; None if more than noise does so.
    `steep_from` is the smallest distance [m] from which on the output is not flattened, if nearer readings are used as
    well because they differ clearly; NaN otherwise.

    `witness` has curves through the readings. `no_signal` gives the reasons why nothing can be fitted, and is empty
    otherwise; `too_few` is true if there are too few distances.
    """

    calibration: Calibration
    window: UsableWindow
    used: AveragedCurve
    offset: OffsetEstimate | None = None
    noise: NoiseEstimate | None = None
    possible_curves: PossibleCurves | None = None
    informed_by: int = 0
    reaches_last: bool = False
    flattens: bool = False
    falling: AveragedCurve | None = None
    steep_from: float = math.nan
    outliers: tuple[int, ...] = ()
    outlier_distances: tuple[float, ...] = ()
    empty_outliers: tuple[float, ...] = ()
    free: PossibleCurves | None = None
    witness: Witness | None = None
    no_signal: tuple[str, ...] = ()
    too_few: bool = False


def prepare(
    calibration: Calibration,
    offset: OffsetChoice,
    saturation: float | str | None,
    near_field_peak: float | str | None,
    floor_sigmas: float,
    *,
    models: tuple[str, ...],
    uses_flattened: bool = True,
) -> Prepared:
    """Prepare a calibration for fitting sensor models.

    This finds the usable distances, outliers, offset and noise. The arguments are those of `fit_sensor`.
    `uses_flattened` says whether to use readings that flatten toward a ceiling, but differ clearly.

    Returns:
        The prepared calibration.
    """
    positive(floor_sigmas, "floor_sigmas")
    calibration, empty_outliers = leave_out_empty_outliers(calibration)
    with np.errstate(all="ignore"):  # tried parameters may overflow; such fits have an infinite cost
        prepared = _prepare(
            condense(count_copies_once(calibration)),
            offset,
            saturation,
            near_field_peak,
            floor_sigmas,
            models=models,
            uses_flattened=uses_flattened,
        )
    return replace(prepared, empty_outliers=tuple(float(v) for v in empty_outliers))


def _prepare(
    calibration: Calibration,
    offset: OffsetChoice,
    saturation: float | str | None,
    near_field_peak: float | str | None,
    floor_sigmas: float,
    *,
    models: tuple[str, ...],
    uses_flattened: bool,
) -> Prepared:
    """Prepare a calibration without copies and without outliers among the readings without an object."""
    curve = average(calibration)
    noise = reading_noise(calibration, curve)
    offset_estimate = _user_offset(calibration, offset, noise)
    no_near_end = NearEnd(index=0, reason="", saturation=None)
    other = reported_distance(calibration, curve) if is_length(calibration.unit) else ""
    other = other or overflowed_output(calibration, curve)
    if not other and near_field_peak == "auto" and is_rising(curve, noise):
        other = rising_output(calibration, curve, noise)
    if other:
        return _without_signal(calibration, curve, no_near_end, offset_estimate, other)
    near = find_near_end(calibration, curve, noise, saturation, near_field_peak)
    needed = _FEWEST_DISTANCES + (offset_estimate is None)
    count = len(curve.distance) - near.index
    if not count:
        remedy = "measure at larger distances, or lower the gain of the sensor"
        clipped = f"No distance is usable, because {near.reason}: {remedy}."
        return _without_signal(calibration, curve, near, offset_estimate, caution("PT110", clipped))
    if count < needed and (both := falls_and_rises(calibration, curve, noise)):
        return _without_signal(calibration, curve, near, offset_estimate, both)
    if count < needed:
        usable = f"{count}, because {near.reason}" if near.index else f"{count}"
        few = caution(
            "PT110" if near.flat else "PT101",  # noise has a peak anywhere
            f"The number of usable distances is {usable}, but a curve needs at least {needed}: measure at 8 or "
            "more distances, up to one from which on the output no longer changes, and record readings with no object.",
        )
        return replace(_without_signal(calibration, curve, near, offset_estimate, few), too_few=not near.flat)
    if not np.ptp(curve.output[near.index :]) > 0:
        level = float(curve.output[near.index])
        stuck = (
            f"The output is {level:.{supported_digits(level, least=6)}g} {calibration.unit}".rstrip()
            + " at every distance"
        )
        if offset_estimate is not None and level > offset_estimate.high:
            stuck += f", but {offset_estimate.value:.{offset_estimate.digits()}g} without an object"
            remedy = "the sensor is saturated; measure at larger distances, or lower the gain of the sensor"
        else:
            remedy = "check power and wiring"
        return _without_signal(calibration, curve, near, offset_estimate, f"{stuck}: {remedy}.")
    end = near.index + end_of_falling(curve.part(slice(near.index, None)), noise)
    if end - near.index < needed:
        end = len(curve.distance)
    options = SampleOptions(models=models, may_saturate=saturation is not None)
    return _prepared(
        calibration,
        curve,
        noise,
        offset_estimate,
        near=near,
        end=end,
        floor_sigmas=floor_sigmas,
        options=options,
        uses_flattened=uses_flattened,
    )


def _prepared(
    calibration: Calibration,
    curve: AveragedCurve,
    raw: ReadingNoise,
    fixed: OffsetEstimate | None,
    *,
    near: NearEnd,
    end: int,
    floor_sigmas: float,
    options: SampleOptions,
    uses_flattened: bool,
) -> Prepared:
    """Prepare the readings in the range where the output falls with distance."""
    place = np.arange(len(curve.distance))
    good = (place >= near.index) & (place < end)
    ceilings = fit_under_ceilings(curve.part(good), raw, fixed, options=options)
    steep, flattens = _steep_end(curve, raw, fixed, near=near, good=good, ceilings=ceilings, options=options)
    bad = tuple(steep.index + i for i in outlier_indices(curve.part(slice(steep.index, end)), raw, fixed))
    good &= ~np.isin(place, bad)
    if bad and good.sum() >= _FEWEST_DISTANCES:  # without the outliers, there may be no sign of a ceiling
        ceilings = fit_under_ceilings(curve.part(good), raw, fixed, options=options)
        steep, flattens = _steep_end(curve, raw, fixed, near=near, good=good, ceilings=ceilings, options=options)
    flat, near = near, steep
    before, good = good, good & (place >= near.index)
    tail = curve.part(good)
    noise, fixed, free = _level(calibration, tail, raw, fixed)
    offset = fixed if fixed is not None or free is None else free.offset("fitted")
    if offset is None:  # cannot occur, since `free` exists if the offset is not fixed
        raise AssertionError
    if offset.kind == "fitted":  # no family is exact, so the interval covers both kinds of fits
        low, high = ceilings.offset_interval()
        offset = replace(offset, low=min(offset.low, low), high=max(offset.high, high))
    steep_from = math.nan
    if uses_flattened and flattens and not flat.flat:
        index = _nearest_clear(curve, np.flatnonzero(before), near.index, offset=offset, noise=noise)
        if index < near.index:
            steep_from, near = (
                float(curve.distance[near.index]),
                replace(flat if index == flat.index else near, index=index),
            )
    last = None
    if end < len(curve.distance):
        last = (end, "the output rises again at larger distances, from a second reflection or a wall")
    window = window_of(
        calibration, curve, near, offset=offset, sigma=noise.output, floor_sigmas=floor_sigmas, left_out=bad, last=last
    )
    used = curve.part(np.isin(curve.distance, window.distances))
    curves = None
    if len(used.distance) >= _FEWEST_POINTS:
        steep_part = used.part(used.distance >= steep_from) if math.isfinite(steep_from) else used
        curves = (
            free if fixed is None else fit_possible_curves(steep_part, noise, offset, informed_by=len(tail.distance))
        )
    at_bad = tuple(float(curve.distance[i]) for i in bad)
    readings = np.flatnonzero(np.isin(calibration.distances, at_bad))
    return Prepared(
        calibration=calibration,
        window=window,
        used=used,
        offset=offset,
        noise=noise,
        possible_curves=curves,
        informed_by=len(tail.distance),
        falling=falling_means(used, noise.of_readings(used.count, used.output - offset.value)),
        steep_from=steep_from,
        reaches_last=bool(window.distances) and window.distances[-1] == float(curve.distance[-1]),
        flattens=flattens,
        outliers=tuple(sorted({*curve.bad_readings, *(int(i) for i in readings)})),
        outlier_distances=at_bad,
        free=None if fixed is None else free,
        witness=witness_of(curve, offset, noise, ceilings, window.l_max, flattens=math.isfinite(steep_from))
        if window.distances
        else None,
        no_signal=_why_no_signal(
            tail,
            window,
            offset,
            noise,
            calibration,
            rises_again=falls_and_rises(calibration, curve, raw) if last else "",
        ),
    )


def _level(
    calibration: Calibration, tail: AveragedCurve, reading_noise: ReadingNoise, offset: OffsetEstimate | None
) -> tuple[NoiseEstimate, OffsetEstimate | None, PossibleCurves | None]:
    """Return the noise of the readings and the sensor offset.

    The third result is the sensor curves with a fitted offset.
    """
    noise = find_noise(tail, reading_noise, offset)
    if offset is None:
        return noise, None, fit_possible_curves(tail, noise, None)
    if offset.standard_error < 0:  # too few no-object readings: their noise is that of the others
        error, value = float(noise.output / np.sqrt(len(calibration.no_object))), offset.value
        offset = replace(offset, standard_error=error, low=value - 2.6 * error, high=value + 2.6 * error)
    free = None
    if len(tail.distance) >= _FEWEST_DISTANCES + 2:  # a free offset, so that its error is not taken as misfit
        free = fit_possible_curves(tail, find_noise(tail, reading_noise, None), None, also=offset.value)
    return noise, offset, free


def is_explained_by_one_error(counts: IntArray) -> bool:
    """Return True if one wrong reading or distance explains why the output looks flattened.

    `counts` has the numbers of readings at each distance where it looks flattened.
    """
    return 0 < len(counts) <= _FEW_FLATTENED and bool(counts.min() == 1)


def _nearest_clear(
    curve: AveragedCurve, places: IntArray, first: int, *, offset: OffsetEstimate, noise: NoiseEstimate
) -> int:
    """Return the index of the nearest reading from which on neighbors determine the slope, although it is small.

    `first` is the index of the first reading that is not flattened, and `places` are the indices of all readings
    without outliers. Repeats at a distance share its error, so the scatter about a smooth curve counts, too.
    The flattened readings are of use only in a table, so they must fall together with the others. One or two single
    ones are not used, since one wrong reading or distance explains them as well.
    """
    if is_explained_by_one_error(curve.count[places[places < first]]):
        return first
    near = places[(places <= places[min(int(np.searchsorted(places, first)) + 1, len(places) - 1)])]
    near = near[curve.output[near] > offset.value]
    scatter = max_scatter(curve.distance[near], np.log(curve.output[near] - offset.value), unknown=ERROR)
    nearest = first
    while (nearer := places[places < nearest]).size:
        pair = np.array([nearer[-1], nearest])
        signal = curve.output[pair] - offset.value
        change = float(np.log(signal[0] / signal[1])) if (signal > 0).all() else 0.0
        common = np.where(curve.count[pair] == 1, scatter, min(scatter, noise.misfit))
        error = float(np.linalg.norm(np.hypot(noise.of_readings(curve.count[pair], signal) / signal, common)))
        if not change > _CLEAR * error:
            break
        nearest = int(nearer[-1])
    used = curve.part(places[(places >= nearest) & (curve.output[places] > offset.value)])
    falls = falling_means(used, noise.of_readings(used.count, used.output - offset.value)) is not None
    return nearest if falls else first


def _steep_end(
    curve: AveragedCurve,
    noise: ReadingNoise,
    offset: OffsetEstimate | None,
    *,
    near: NearEnd,
    good: BoolArray,
    ceilings: CeilingFits,
    options: SampleOptions,
) -> tuple[NearEnd, bool]:
    """Start the usable range at the first unsaturated reading. The second result is whether the start has moved."""
    part, place = curve.part(good), np.flatnonzero(good)
    first = ceilings.first_steep(part.distance)
    if first and offset is not None and offset.kind == "declared":  # a wrong offset also bends a curve
        first = min(first, fit_under_ceilings(part, noise, None, options=options).first_steep(part.distance))
    first = min(first, max(len(place) - _FEWEST_DISTANCES - (offset is None), 0))
    if not first:
        return near, False
    reason = _FLATTENED.format("single readings do not determine" if part.count.max() == 1 else "the noise hides")
    if near.flat:
        reason = f"{near.reason}, and has too little slope up to {format_quantity(float(part.distance[first]), 'm')}"
    return NearEnd(index=int(place[first]), reason=reason, saturation=near.saturation), True


def _user_offset(calibration: Calibration, offset: OffsetChoice, noise: ReadingNoise) -> OffsetEstimate | None:
    """Return the sensor offset measured or declared by the user. The offset is None if it must be fitted."""
    if offset == "fit" or (offset == "auto" and not len(calibration.no_object)):
        return None
    if offset == "auto":
        return _measured_offset(calibration.no_object, noise)
    expected = "a number, or a number and its standard error"
    if isinstance(offset, str) and offset != "zero":
        raise InvalidInputError(f"offset: found {offset!r}, expected 'auto', 'fit', 'zero' or {expected}")
    if isinstance(offset, (tuple, list)) and len(offset) != 2:
        raise InvalidInputError(f"offset: found {offset!r}, expected {expected}")
    return declared_offset(0.0 if isinstance(offset, str) else offset)


def _measured_offset(readings: FloatArray, noise: ReadingNoise) -> OffsetEstimate:
    """Compute the sensor offset from no-object readings.

    The offset is the mean of these readings. The standard error is -1 if the noise is not known yet.

    Returns:
        The offset.
    """
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only for fits

    value = float(np.mean(readings))
    if noise.sigma is None:
        return OffsetEstimate(value=value, standard_error=-1.0, low=value, high=value, kind="measured")
    error = float(noise.sigma / np.sqrt(len(readings)))
    reach = float(stdtrit(max(noise.freedom, 1.0), 0.975)) * error
    return OffsetEstimate(value=value, standard_error=error, low=value - reach, high=value + reach, kind="measured")


def _without_signal(
    calibration: Calibration, curve: AveragedCurve, near: NearEnd, offset: OffsetEstimate | None, reason: str
) -> Prepared:
    """Return the preparation of a calibration without usable signal. It contains the reason."""
    window = UsableWindow(
        distances=(),
        start_reason=near.reason,
        end_reason=reason,
        saturation=near.saturation,
        floor=offset.value if offset is not None else float(curve.output.min()),
    )
    return Prepared(
        calibration=calibration,
        window=window,
        used=curve.part(slice(0)),
        outliers=curve.bad_readings,
        no_signal=(reason,),
    )


def _why_no_signal(
    tail: AveragedCurve,
    window: UsableWindow,
    offset: OffsetEstimate,
    noise: NoiseEstimate,
    calibration: Calibration,
    *,
    rises_again: str,
) -> tuple[str, ...]:
    """Explain why the readings contain no usable signal.

    `rises_again` says that the output falls and rises again; it explains why there are few distances.

    Returns:
        The reasons; empty if there is a usable signal.
    """
    reasons, unit = [], calibration.unit
    count = len(window.distances)
    never = not count and len(tail.output) >= _FEWEST_POINTS and not rises_again
    # a long plateau does not inform about the window
    chance = chance_of_falling(tail.output if never else tail.output[: 2 * count])
    near, far = tail.output[0] - offset.value, tail.output[-1] - offset.value
    error = float(np.hypot(*noise.of_means(tail.count[[0, -1]], np.maximum([near, far], 0.0))))
    if (never or count >= _FEWEST_POINTS) and chance > _FALL_LEVEL and near - far < _CLEAR_FALL * error:
        reasons.append(
            caution(
                "PT110",
                f"The sensor output does not fall significantly with the distance (rank test, p = {chance:.2g}): "
                "check power, orientation and range of the sensor.",
            )
        )
    if never and reasons:  # finer steps near the sensor would not help
        return tuple(reasons)
    if count < _FEWEST_POINTS and rises_again:
        reasons.append(rises_again)
    elif count < _FEWEST_POINTS and (contradiction := _contradicting_offset(calibration, tail, offset)):
        reasons.append(contradiction)
    elif count < _FEWEST_POINTS:
        largest = f" The largest usable distance is {format_quantity(window.distances[-1], 'm')}." if count else ""
        digits = supported_digits(window.floor, abs(window.floor - offset.value))
        level, sigma = f"{window.floor:.{digits}g}", f"{noise.output:.{supported_digits(noise.output, least=2)}g}"
        floor, sigma = (f"{value} {unit}".rstrip() for value in (level, sigma))
        reasons.append(
            caution(
                "PT110",
                f"The output exceeds the noise at only {count} of {_FEWEST_POINTS} required distances: "
                "measure in finer steps near the sensor, repeat readings, and record the output with no object. "
                f"Averaged outputs above {floor} contain a signal.{largest} The offset is {offset.in_words(unit)}. The "
                f"noise of one reading is {sigma}.",
            )
        )
    return tuple(reasons)


def _contradicting_offset(calibration: Calibration, tail: AveragedCurve, offset: OffsetEstimate) -> str:
    """Return why the readings without an object contradict the others; empty if they do not.

    The output clearly falls with the distance. But the readings without an object are larger than most outputs with an
    object, or they scatter as much as the outputs at different distances.
    """
    empty, reach = calibration.no_object, float(np.ptp(tail.output))
    if offset.kind != "measured" or chance_of_falling(tail.output) > _FALL_LEVEL:
        return ""
    values = (float(empty.min()), float(empty.max()), float(tail.output[0]))
    low, high, first = (f"{v:.{supported_digits(v)}g} {calibration.unit}".rstrip() for v in values)
    if len(empty) > 1 and np.ptp(empty) > _SCATTERED * reach:
        return caution(
            "PT110",
            f"The readings without an object range from {low} to {high}, about as much as the outputs at different "
            "distances: check that they have no object, and that no distance is missing in the file.",
        )
    below = int((tail.output < offset.low).sum())
    if 2 * below <= len(tail.output):
        return ""
    nearest = format_quantity(float(tail.distance[0]), "m")
    return caution(
        "PT110",
        f"The output falls with the distance, but at {below} of {len(tail.output)} distances it is smaller than "
        f"without an object ({low} to {high}): check the decimal marks, and that these readings have no object. At "
        f"{nearest} it is {first}.",
    )


def chance_of_falling(output: FloatArray) -> float:
    """Return the p-value of Kendall's trend test.

    The test checks whether the outputs fall with distance.

    The p-value is the probability that a random order falls as much; ties count half.
    """
    n = len(output)
    pairs = [float(output[j] - output[i]) for i in range(n) for j in range(i + 1, n)]
    rising = sum(p > 0 for p in pairs) + (sum(p == 0 for p in pairs) + 1) // 2
    shares = np.ones(1)
    for size in range(2, n + 1):  # orders of `size` numbers by their count of rising pairs
        shares = np.convolve(shares, np.ones(size)) / size
    return float(min(1.0, shares[: rising + 1].sum()))
