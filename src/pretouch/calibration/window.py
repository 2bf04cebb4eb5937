"""Find the range of distances in which a sensor is usable."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.errors import CalibrationDataError, InvalidInputError
from pretouch._core.numbers import BoolArray, finite, nonnegative, positive
from pretouch._core.units import format_quantity, supported_digits, to_si

from .averaging import (
    MAD_TO_SIGMA,
    AveragedCurve,
    ReadingNoise,
    average,
    condense,
    count_copies_once,
    leave_out_empty_outliers,
    reading_noise,
    resolution,
)
from .data import Calibration
from .result import OffsetEstimate, UsableWindow

_RISEN: Final = 2.0  # ratio of rise to later fall from which on the output counts as rising
_SURE: Final = 5.0  # standard deviations of a significant rise
_SMALL: Final = 0.01  # share of the output's range below which a rise is ignored
_PART: Final = 0.05  # share of the output's range from which on a fall and a rise make a valley
_SHARE: Final = 0.2  # share of the rise: outputs less far above the lowest output may already belong to the rise


def is_rising(curve: AveragedCurve, noise: ReadingNoise) -> bool:
    """Return True if the sensor output rises with distance instead of falling.

    Toward a near-field peak the output rises, too, but then it falls farther.
    """
    steady = curve.steady
    peak = int(np.argmax(steady))
    risen, fallen = float(steady[peak] - steady[0]), float(steady[peak] - steady[-1])
    beyond_middle = curve.distance[peak] > 0.5 * (curve.distance[0] + curve.distance[-1])
    if risen <= _SURE * _error(curve, noise) or risen <= 0.3 * float(np.ptp(steady)):
        return False
    return risen > _RISEN * fallen or (risen > fallen and bool(beyond_middle))


def valley(curve: AveragedCurve, noise: ReadingNoise) -> int | None:
    """Return the index of the lowest output if the output falls before it and rises again behind it.

    Both changes must be significant, and a large part of the range of the output.

    Returns:
        The index; None for an output that rises or falls only.
    """
    steady = curve.steady
    lowest = int(np.argmin(steady))
    fallen, risen = (float(part.max() - steady[lowest]) for part in (steady[: lowest + 1], steady[lowest:]))
    least = max(_SURE * _error(curve, noise), _PART * float(np.ptp(steady)))
    return lowest if min(fallen, risen) > least else None


def end_of_falling(curve: AveragedCurve, noise: ReadingNoise) -> int:
    """Return the number of calibration points before the output rises again.

    All points count if the output never rises. Points that may already include a part of the rise are excluded as well.
    """
    steady = curve.steady
    steady[-1] = max(steady[-1], np.median(curve.output[-3:]))  # a single low reading at the end is no trend
    lowest = int(np.argmin(steady))
    later = steady[lowest + 1 :]
    if len(later) < 2:
        return len(steady)
    ahead = np.convolve(later, np.ones(2) / 2, mode="valid")
    rise = float(ahead.max() - steady[lowest])
    if rise <= max(_SURE * _error(curve, noise), _SMALL * float(np.ptp(steady))):
        return len(steady)
    return int(np.argmax(steady <= steady[lowest] + _SHARE * rise)) + 1


def _error(curve: AveragedCurve, noise: ReadingNoise) -> float:
    """Return the standard deviation of the averaged readings. It is estimated where the output is flat."""
    if noise.sigma is not None:
        error = noise.sigma / np.sqrt(float(np.median(curve.count)))
        return float(np.hypot(error, noise.resolution / np.sqrt(12.0)))
    bend = np.abs(np.diff(curve.output, 2))
    flat = np.sort(bend)[: max(len(bend) // 2, 1)]
    return (
        float(MAD_TO_SIGMA * np.median(flat) / np.sqrt(6.0) * 2 + noise.resolution / np.sqrt(12.0))
        if len(bend)
        else 0.0
    )


_FEWEST_BEYOND: Final = 6  # distances beyond a flat start needed to judge whether the output is still flattened there
_FEWEST_REPEATED: Final = 3  # readings at each distance of a flat start
_EQUAL: Final = 4.0  # standard errors within which averaged outputs are equal
_AHEAD: Final = 3  # distances beyond a flat start whose line is extrapolated to it
_CORNER: Final = 10.0  # standard errors of the step from this line to the flat start
_CONVERTER_BITS: Final = (8, 10, 12, 14, 16)
_CLIPPED_SHARE: Final = 0.99  # share of full scale; converters and amplifiers clip a little below full scale


@dataclass(frozen=True, slots=True, kw_only=True)
class NearEnd:
    """Smallest usable distance of a sensor.

    It has the reason for this limit and the saturation level. `flat` is true if the output has no slope there, as at a
    detected peak.
    """

    index: int
    reason: str
    saturation: float | None
    flat: bool = False


def find_window(
    calibration: Calibration,
    offset: OffsetEstimate | float | tuple[float, float],
    *,
    noise: float | None = None,
    saturation: float | str | None = "auto",
    near_field_peak: float | str | None = "auto",
    floor_sigmas: float = 3.0,
) -> UsableWindow:
    """Find the range of distances in which a sensor is usable.

    The window starts beyond the last clipped distance, at the near-field peak or farther. The window ends before the
    first distance at which the averaged output is less than `floor_sigmas` standard errors above the offset, unless the
    output at the next distance is above this level again.

    Args:
        calibration: the readings.
        offset: output with no object, or that output and its standard error.
        noise: standard deviation of one reading, in the unit of the outputs; by default, estimated from the readings.
        saturation: output at and above which readings are clipped; "auto" to detect it, None if nothing clips.
        near_field_peak: distance of the peak [m], or text such as "5 mm"; "auto" to detect it, None for no peak.
        floor_sigmas: minimum signal above the offset, in standard errors.

    Returns:
        The window, with the reasons for both ends.

    Raises:
        InvalidInputError: a number is out of its range, or `noise` is None and too few readings are repeated.
        CalibrationDataError: every distance is clipped.

    Examples:
        >>> measured = Calibration(distances=[0.0, 0.01, 0.02, 0.03], outputs=[1023, 800, 200, 52], unit="counts")
        >>> window = find_window(measured, (50.0, 1.0), noise=4.0)
        >>> window.l_min, window.l_max
        (0.01, 0.02)
    """
    positive(floor_sigmas, "floor_sigmas")
    offset_estimate = offset if isinstance(offset, OffsetEstimate) else declared_offset(offset)
    calibration = condense(count_copies_once(leave_out_empty_outliers(calibration)[0]))
    curve = average(calibration)
    estimated = reading_noise(calibration, curve)
    sigma = estimated.sigma if noise is None else float(nonnegative(noise, "noise"))
    if sigma is None:
        raise InvalidInputError(
            "noise: found None, but too few readings are repeated or without an object to estimate the noise; give the "
            "standard deviation of one reading"
        )
    near = find_near_end(calibration, curve, estimated, saturation, near_field_peak)
    if near.index == len(curve.distance):
        raise CalibrationDataError(
            f"saturation: the readings are clipped at every distance, because {near.reason}. Measure at larger "
            "distances, lower the gain of the sensor, or set saturation=None"
        )
    return window_of(calibration, curve, near, offset=offset_estimate, sigma=sigma, floor_sigmas=floor_sigmas)


def declared_offset(offset: float | tuple[float, float]) -> OffsetEstimate:
    """Convert a declared sensor offset to an `OffsetEstimate`.

    The user may declare the offset with or without its standard error.

    Returns:
        The offset.
    """
    value, error = offset if isinstance(offset, (tuple, list)) else (offset, 0.0)
    value, error = float(finite(value, "offset")), float(nonnegative(error, "standard error of the offset"))
    reach = 1.959964 * error
    return OffsetEstimate(value=value, standard_error=error, low=value - reach, high=value + reach, kind="declared")


def find_near_end(
    calibration: Calibration,
    curve: AveragedCurve,
    noise: ReadingNoise,
    saturation: float | str | None,
    near_field_peak: float | str | None,
) -> NearEnd:
    """Find the smallest usable distance of a sensor.

    If all readings are clipped, the index is the number of distances. Readings that the averages leave out as outliers
    do not show that the output clips.

    Returns:
        The near end of the window.
    """
    if curve.bad_readings:
        kept = np.delete(np.arange(len(calibration.outputs)), curve.bad_readings)
        calibration = replace(calibration, distances=calibration.distances[kept], outputs=calibration.outputs[kept])
    level, source = _saturation(calibration, curve, noise, saturation)
    saturated = calibration.outputs >= (np.inf if level is None else level)
    index = _end_of_clipping(np.isin(curve.distance, calibration.distances[saturated]))
    reason = "first measured distance"
    if index:
        last = format_quantity(float(curve.distance[index - 1]), "m")
        clipped = 0.0 if level is None else level
        output = f"{clipped:.{supported_digits(clipped, least=6)}g} {calibration.unit}".rstrip()
        reason = f"the output clips at {output} up to {last} ({source})"
    if index == len(curve.distance):
        return NearEnd(index=index, reason=reason, saturation=level)
    peak, source_of_peak = _peak(curve, index, near_field_peak)
    flat = peak > index and source_of_peak == "detected"
    if peak > index:
        index = peak
        reason = f"the output peaks at {format_quantity(float(curve.distance[peak]), 'm')} ({source_of_peak})"
    return NearEnd(index=index, reason=reason, saturation=level, flat=flat)


def _end_of_clipping(clipped: BoolArray) -> int:
    """Return the index of the first distance beyond the clipped readings.

    Isolated clipped distances count only at index 0.
    """
    supported = [
        i for i in np.flatnonzero(clipped) if i == 0 or clipped[i - 1] or (i + 1 < len(clipped) and clipped[i + 1])
    ]
    return int(supported[-1]) + 1 if supported else 0


def _saturation(
    calibration: Calibration, curve: AveragedCurve, noise: ReadingNoise, option: float | str | None
) -> tuple[float | None, str]:
    """Return the output at which a sensor clips. Also return how this level was found."""
    if option is None:
        return None, ""
    if not isinstance(option, str):
        return float(finite(option, "saturation", calibration.unit)), "declared"
    if option != "auto":
        raise InvalidInputError(f"saturation: found {option!r}, expected a number, None or 'auto'")
    top = float(calibration.outputs.max())
    if calibration.unit == "counts":
        for bits in _CONVERTER_BITS:
            full = 2**bits - 1
            if _CLIPPED_SHARE * full <= top <= full:
                clipped = calibration.outputs[calibration.outputs >= _CLIPPED_SHARE * full]
                return float(clipped.min()), f"within 1 % of the full scale of a {bits}-bit converter"
    step = resolution(calibration)
    plateau = curve.distance[np.isclose(curve.output, top, rtol=1e-9, atol=0.0)]
    fine = step < 0.02 * float(np.ptp(calibration.outputs))  # with a coarse converter, equal readings are common
    if len(plateau) >= 2 and fine:
        return top, f"the same highest output at {len(plateau)} distances"
    if count := _flat_start(curve, noise):
        clipped = calibration.outputs[calibration.distances <= curve.distance[count - 1]]
        return float(clipped.min()), f"the same highest output within the noise at {count} distances"
    return None, ""


def _flat_start(curve: AveragedCurve, noise: ReadingNoise) -> int:
    """Return the number of nearest distances at which the output clips at a level with noise; 0 without clipping.

    There the averaged outputs are equal within the noise of repeats. The output bends sharply where the clipping ends:
    it is steepest in one of the next two steps, and the line through the next readings leads far above the clipping
    level. At a round peak, and under a soft ceiling, the output becomes steeper over several steps.
    """
    if noise.sigma is None or len(curve.distance) < _FEWEST_BEYOND + 2:
        return 0
    signal = np.maximum(curve.output - curve.output.min(), 0.0)
    spread = np.hypot(np.hypot(noise.sigma, noise.jitter * signal), noise.resolution / np.sqrt(12.0))
    error = spread / np.sqrt(curve.count)
    count = 0
    for end in range(2, len(curve.distance) - _FEWEST_BEYOND + 1):
        if curve.count[:end].min() < _FEWEST_REPEATED or np.ptp(curve.output[:end]) > _EQUAL * error[:end].max():
            break
        count = end
    if not count:
        return 0
    secants = -np.diff(curve.output) / np.diff(curve.distance)
    ahead = slice(count, count + _AHEAD)
    line = np.polyfit(curve.distance[ahead], curve.output[ahead], 1)
    level, uncertain = float(curve.output[:count].mean()), float(error[: count + _AHEAD].max())
    above = float(np.polyval(line, curve.distance[count - 1])) - level
    is_sharp = int(np.argmax(secants)) in (count - 1, count)
    return count if is_sharp and above > _CORNER * uncertain else 0


def _peak(curve: AveragedCurve, start: int, option: float | str | None) -> tuple[int, str]:
    """Find the distance with the maximum sensor output. Return its index, and how the maximum was found."""
    if option is None:
        return start, ""
    if option != "auto":
        distance = to_si(option, "m", name="near_field_peak")
        index = int(np.searchsorted(curve.distance, distance * (1 - 1e-12)))
        if index >= len(curve.distance) or not math.isfinite(distance):
            raise InvalidInputError(
                f"near_field_peak: found {distance:g} m, expected at most the last measured distance of "
                f"{curve.distance[-1]:g} m"
            )
        return index, "declared"
    part = curve.part(slice(start, None))
    near = max(int(np.argmax(part.steady)) - 1, 0)
    return start + near + int(np.argmax(part.output[near : near + 3])), "detected"


def window_of(
    calibration: Calibration,
    curve: AveragedCurve,
    near: NearEnd,
    *,
    offset: OffsetEstimate,
    sigma: float,
    floor_sigmas: float,
    left_out: tuple[int, ...] = (),
    last: tuple[int, str] | None = None,
) -> UsableWindow:
    """Find the usable range of a sensor.

    Points `left_out` are skipped; `last` is the index after the last point that may be used, and the reason.

    Returns:
        The window.
    """
    stop, reason = last or (len(curve.distance), "last measured distance")
    indices = [i for i in range(near.index, stop) if i not in left_out]
    error = np.hypot(sigma / np.sqrt(curve.count), offset.standard_error)
    above = [bool(curve.output[i] - offset.value > floor_sigmas * error[i]) for i in indices]
    # a single low reading between two good ones does not end the window
    end = next((k for k in range(len(above)) if not any(above[k : k + 2])), len(above))
    used = [i for i, holds in zip(indices[:end], above[:end], strict=True) if holds]
    floor = offset.value + floor_sigmas * float(np.median(error))
    if end < len(indices):
        beyond = format_quantity(float(curve.distance[indices[end]]), "m")
        signal = floor - offset.value
        values = ((offset.value, supported_digits(offset.value, signal)), (signal, supported_digits(signal, least=3)))
        base, least = (f"{value:.{digits}g} {calibration.unit}".rstrip() for value, digits in values)
        reason = (
            f"from the distance {beyond} on, the output is less than {least}, or {floor_sigmas:g} standard errors, "
            f"above the offset of {base}"
        )
        if last is not None:
            reason += f"; {last[1]}"
    return UsableWindow(
        distances=tuple(float(curve.distance[i]) for i in used),
        start_reason=near.reason,
        end_reason=reason,
        saturation=near.saturation,
        floor=floor,
    )
