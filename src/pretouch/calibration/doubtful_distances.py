"""Recognize distances that cannot be right, such as a wrong unit or a code for no object, and say what to do."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.units import format_quantity, supported_digits
from pretouch._core.warning_codes import caution

from .averaging import AveragedCurve, average, reading_noise
from .data import Calibration
from .family_fits import find_noise, fit_free, is_isolated, is_outlier, quick_families
from .preparation import Prepared
from .result import OffsetEstimate

_FARTHEST: Final = 10.0  # distance [m] that no proximity sensor reaches
_SHORTEST: Final = 3e-4  # largest distance [m] of a range that is too short for a robot
_FEWEST: Final = 6  # other distances needed for this test
_FAR_BETTER: Final = 12.0  # twice the ln of the ratio of likelihoods that is clear evidence
_FREEDOM: Final = 3.0  # degrees of freedom of the prior of the error
_EMPTY: Final = 0.05  # share of the range of the outputs up to which an output is that of the empty scene
_DROP: Final = 0.5  # share of the range of the outputs by which an output at distance 0 must be lower than the next


def distance_reservations(calibration: Calibration) -> tuple[str, ...]:
    """Return a warning about distances that are all implausibly large or small.

    Such distances must have a wrong unit.
    """
    farthest = float(calibration.distances.max())
    if farthest > _FARTHEST:
        return (
            caution(
                "PT114",
                f"The distances reach {farthest:.4g} m, which is too far for a proximity sensor: for millimeters, "
                "use the header `distance [mm]`.",
            ),
        )
    if 0 < farthest < _SHORTEST:
        return (
            caution(
                "PT114",
                f"The distances reach only {format_quantity(farthest, 'm')}, which is too short for a proximity "
                "sensor on a robot: for meters, use the header `distance [m]`.",
            ),
        )
    return ()


class DoubtfulDistance(NamedTuple):
    """A single distance that may be a code for no object, or a typing error.

    `distance` is in m, `text` is the warning, and `is_wrong` says that the fit is better without its readings.
    """

    distance: float
    text: str
    is_wrong: bool


def doubtful_distances(prepared: Prepared) -> tuple[DoubtfulDistance, ...]:
    """Return single distances that may be a code for no object, or a typing error.

    Some sensors and programs record a fixed distance, such as 0 or 255, if they detect no object.
    """
    return tuple(found for found in (_zero(prepared), _isolated(prepared)) if found is not None)


def without_distance(calibration: Calibration, distance: float) -> Calibration:
    """Return a calibration without the readings at one distance [m]."""
    kept = calibration.distances != distance
    return replace(calibration, distances=calibration.distances[kept], outputs=calibration.outputs[kept])


def _zero(prepared: Prepared) -> DoubtfulDistance | None:
    """Return the distance 0 if its output is that of the empty scene.

    Its readings remain: they are no part of the range in which the output falls, so they hardly change the slope.
    """
    calibration = prepared.calibration
    curve = average(calibration)
    if len(curve.distance) < _FEWEST or curve.distance[0] != 0:
        return None
    reach, nearest, others = float(np.ptp(curve.output)), float(curve.output[0]), curve.output[1:]
    empty = float(np.median(calibration.no_object)) if len(calibration.no_object) else float(others[-1])
    if nearest > empty + _EMPTY * reach or others[0] - nearest < _DROP * reach:
        return None
    scene = "as without an object" if len(calibration.no_object) else "no more than at the largest distance"
    text = caution(
        "PT114",
        f"At the distance 0 mm, the output is only {_level(calibration, nearest)}, {scene}: if 0 is a code for no "
        "object, write inf as the distance of these readings. Otherwise the sensor does not see an object at contact.",
    )
    return DoubtfulDistance(0.0, text, is_wrong=False)


def _isolated(prepared: Prepared) -> DoubtfulDistance | None:
    """Return a far larger distance than all others if its output does not belong to the curve.

    If it disagrees with every curve, the fit is better without it: a typing error bends all curves.
    If it may have been taken without an object, it remains, because the offset then follows from it.
    """
    calibration, used, offset = prepared.calibration, prepared.used, prepared.offset
    if offset is None or not is_isolated(used):
        return None
    output = _level(calibration, float(used.output[-1]))
    before, last = (format_quantity(float(d), "m") for d in used.distance[-2:])
    if offset.kind == "fitted" and _is_rather_empty(calibration, used):
        finding, is_wrong = (
            "agrees far better with the curve through the others if it was taken without an object",
            False,
        )
    elif _disagrees(calibration, used, None if offset.kind == "fitted" else offset):
        finding, is_wrong = "disagrees with every curve through the other readings, so it is left out", True
    else:
        return None
    text = caution(
        "PT114",
        f"The output of {output} at the largest distance {last} {finding}: if this distance is a code for no object, "
        f"write inf instead; if it is a typing error, correct it; if it is right, measure between {before} and {last}.",
    )
    return DoubtfulDistance(float(used.distance[-1]), text, is_wrong)


def _is_rather_empty(calibration: Calibration, used: AveragedCurve) -> bool:
    """Compare two explanations of the output at the largest distance by their likelihood.

    If it was taken without an object, it is the offset of the curve through the other readings. Otherwise the curve
    passes through all readings with a free offset. Both have equally many parameters and readings.

    Returns:
        Whether the explanation without an object is far better.
    """
    others, level = used.part(slice(-1)), float(used.output[-1])
    raw, families = reading_noise(calibration, average(calibration)), quick_families(used)
    known = OffsetEstimate(value=level, standard_error=0.0, low=level, high=level, kind="measured")
    noise = find_noise(others, raw, known, families)
    empty = min(float(fit_free(others, family, noise, level).costs[0]) for family in families)
    present = min(float(fit_free(used, family, noise, None).costs[0]) for family in families)
    return len(used.distance) * math.log((_FREEDOM + present) / (_FREEDOM + empty)) > _FAR_BETTER


def _disagrees(calibration: Calibration, used: AveragedCurve, offset: OffsetEstimate | None) -> bool:
    """Return True if the last output deviates from each curve that describes the other readings."""
    raw = reading_noise(calibration, average(calibration))
    return is_outlier(used, len(used.distance) - 1, raw, offset, quick_families(used))


def _level(calibration: Calibration, output: float) -> str:
    return f"{output:.{supported_digits(output)}g} {calibration.unit}".rstrip()
