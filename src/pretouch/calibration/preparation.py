"""What happens before any model is fitted: near end, offset, noise, outliers, window; and whether there is a signal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, positive
from pretouch._core.units import format_quantity

from .averaging import AveragedCurve, ReadingNoise, average, reading_noise
from .condensing import condense
from .data import Calibration
from .offset import Baseline, estimate_baseline
from .result import OffsetEstimate, UsableWindow
from .window import NearEnd, declared_offset, find_near_end, window_of

__all__ = ["FEWEST_POINTS", "OffsetChoice", "Prepared", "prepare"]

OffsetChoice: TypeAlias = "str | float | tuple[float, float]"

FEWEST_POINTS = 3  # two parameters and one point to judge them by
_FEWEST_DISTANCES = 4  # the inverse power on a known offset, and one to judge it by
_FALL_LEVEL = 0.05
_CLEAR_FALL = 6.0  # standard deviations from the first to the last reading that need no rank test


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """A calibration made ready for models.

    `informed_by` counts the distances that offset and noise were estimated from, inside the window and beyond it;
    `no_signal` says why there is nothing to fit, and is empty where there is.
    """

    calibration: Calibration
    window: UsableWindow
    baseline: Baseline | None
    used: AveragedCurve
    informed_by: int
    reaches_last: bool
    outliers: tuple[int, ...]
    outlier_distances: tuple[float, ...]
    free_offset: OffsetEstimate | None
    no_signal: tuple[str, ...]


def prepare(
    calibration: Calibration,
    *,
    offset: OffsetChoice,
    saturation: float | str | None,
    near_field_peak: float | str | None,
    floor_sigmas: float,
) -> Prepared:
    """Find near end, offset, noise, outliers and window of a calibration.

    Args:
        calibration: the readings.
        offset: "auto", "fit", "zero", a number, or a number and its standard error.
        saturation: output from which readings are clipped, "auto", or None.
        near_field_peak: distance of the peak [m], text with a unit, "auto", or None.
        floor_sigmas: how many standard errors the signal must stand above the offset.

    Returns:
        Everything that the models have in common.
    """
    positive(floor_sigmas, "floor_sigmas")
    calibration = condense(calibration)
    curve = average(calibration)
    known = reading_noise(calibration, curve)
    near = find_near_end(calibration, curve, saturation=saturation, near_field_peak=near_field_peak)
    given = _given_offset(calibration, offset, known)
    tail = curve.part(np.arange(len(curve.distance)) >= near.index)
    needed = _FEWEST_DISTANCES + (given is None)
    if len(tail.distance) < needed:
        return _nothing(calibration, curve, near, given, _too_few(near, len(tail.distance), needed))
    if not np.ptp(tail.output) > 0:
        stuck = f"The output is {tail.output[0]:g} {calibration.unit}".rstrip()
        return _nothing(calibration, curve, near, given, f"{stuck} at every distance: check power and wiring.")
    baseline = estimate_baseline(tail, known, given)
    if (
        given is not None and given.standard_error < 0
    ):  # one or two no-object readings: their noise is that of the other readings
        baseline = replace(baseline, offset=_with_noise(calibration, baseline))
    free = None
    if given is not None and len(tail.distance) >= _FEWEST_DISTANCES + 2:
        free = estimate_baseline(tail, known, None).offset
    out = tuple(near.index + i for i in baseline.outliers)
    window = window_of(
        calibration,
        curve,
        near,
        offset=baseline.offset,
        sigma=baseline.noise.output,
        floor_sigmas=floor_sigmas,
        outliers=out,
    )
    used = curve.part(np.isin(curve.distance, window.distances))
    at = tuple(float(curve.distance[i]) for i in out)
    readings = np.flatnonzero(np.isin(calibration.distances, at))
    return Prepared(
        calibration=calibration,
        window=window,
        baseline=baseline,
        used=used,
        informed_by=len(tail.distance) - len(out),
        reaches_last=bool(window.distances) and window.distances[-1] == float(curve.distance[-1]),
        outliers=tuple(sorted({*curve.bad_readings, *(int(i) for i in readings)})),
        outlier_distances=at,
        free_offset=free,
        no_signal=_why_no_signal(tail, window, baseline, calibration.unit),
    )


def _given_offset(calibration: Calibration, offset: OffsetChoice, known: ReadingNoise) -> OffsetEstimate | None:
    """Return the offset where it is measured or declared; None where it has to be fitted."""
    if isinstance(offset, str):
        if offset == "zero":
            return declared_offset(0.0)
        if offset == "fit" or (offset == "auto" and not len(calibration.no_object)):
            return None
        if offset == "auto":
            return _measured_offset(calibration.no_object, known)
        raise InvalidInputError(
            f"offset: found {offset!r}, expected 'auto', 'fit', 'zero', a number, or a number and its standard error"
        )
    if isinstance(offset, (tuple, list)) and len(offset) != 2:
        raise InvalidInputError(f"offset: found {offset!r}, expected a number, or a number and its standard error")
    return declared_offset(offset)


def _measured_offset(readings: FloatArray, known: ReadingNoise) -> OffsetEstimate:
    """Average no-object readings without those far off the rest; a negative error marks one not known yet."""
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only for fits

    kept = readings
    if len(readings) >= 5:
        deviation = np.abs(readings - np.median(readings))
        limit = 6 * max(1.4826 * float(np.median(deviation)), known.resolution)
        kept = readings[deviation <= limit] if limit > 0 else readings
    value, count = float(np.mean(kept)), len(kept)
    error, reach = -1.0, 0.0
    if known.sigma is not None:
        error = known.sigma / np.sqrt(count)
        reach = float(stdtrit(max(known.freedom, 1.0), 0.975)) * error
    return OffsetEstimate(
        value=value, standard_error=float(error), low=value - reach, high=value + reach, kind="measured"
    )


def _with_noise(calibration: Calibration, baseline: Baseline) -> OffsetEstimate:
    error = baseline.noise.output / np.sqrt(len(calibration.no_object))
    value = baseline.offset.value
    return replace(
        baseline.offset, standard_error=float(error), low=float(value - 2.6 * error), high=float(value + 2.6 * error)
    )


def _too_few(near: NearEnd, left: int, needed: int) -> str:
    """Say that there are too few distances to say anything."""
    return (
        f"Only {left} distinct distance{'s' if left != 1 else ''} to use ({near.reason}), and at least {needed} are "
        "needed: measure at 8 or more, out to where the output no longer changes, and record readings with no object."
    )


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
        baseline=None,
        used=curve.part(np.zeros(len(curve.distance), dtype=bool)),
        informed_by=0,
        reaches_last=False,
        outliers=curve.bad_readings,
        outlier_distances=(),
        free_offset=None,
        no_signal=(reason,),
    )


def _why_no_signal(tail: AveragedCurve, window: UsableWindow, baseline: Baseline, unit: str) -> tuple[str, ...]:
    """Say why there is no usable signal; nothing where there is."""
    reasons = []
    count = len(window.distances)
    kept = np.delete(tail.output, list(baseline.outliers))
    chance = chance_of_falling(kept[: 2 * count])  # a long plateau says nothing of the window
    near, far = kept[0] - baseline.offset.value, kept[-1] - baseline.offset.value
    scatter = np.hypot(baseline.noise.output, baseline.noise.relative * max(near, far))
    if count >= FEWEST_POINTS and chance > _FALL_LEVEL and near - far < _CLEAR_FALL * scatter:
        reasons.append(
            f"The output does not fall with distance more than chance allows (rank test, p = {chance:.2g}): check that "
            "the sensor is powered, faces the object, and that the object is in its range."
        )
    if count < FEWEST_POINTS:
        far = format_quantity(window.distances[-1], "m") if count else "none"
        reasons.append(
            f"Only {count} distinct distance{'s' if count != 1 else ''} (last: {far}) stand{'s' if count == 1 else ''} "
            f"above the floor of {window.floor:.4g} {unit}".rstrip()
            + f" (offset {baseline.offset.value:.4g} ± {baseline.offset.standard_error:.2g}, noise of a reading "
            f"{baseline.noise.output:.2g}), and a curve needs {FEWEST_POINTS}: measure in finer steps near the sensor, "
            "repeat readings, and record the output with no object."
        )
    return tuple(reasons)


def chance_of_falling(output: FloatArray) -> float:
    """Return the chance that a random order falls as much as this one (Kendall's test, exact; ties count half).

    Args:
        output: averaged outputs in order of distance.

    Returns:
        The one-sided p-value.
    """
    n = len(output)
    pairs = [float(output[j] - output[i]) for i in range(n) for j in range(i + 1, n)]
    rising = sum(p > 0 for p in pairs) + (sum(p == 0 for p in pairs) + 1) // 2
    ways = np.ones(1)
    for size in range(2, n + 1):  # orders of `size` numbers by their count of rising pairs
        ways = np.convolve(ways, np.ones(size)) / size
    return float(min(1.0, ways[: rising + 1].sum()))
