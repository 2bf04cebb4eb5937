"""Thousands of distances, as a motor stage records them, gathered into few."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.units import format_quantity

from .data import Calibration

__all__ = ["condense"]

_MANY: Final = 100  # distinct distances from which on they are gathered
_FEW: Final = 50  # two of them are the ends
_BLOCKS: Final = 100
_ENDS: Final = 2


def condense(calibration: Calibration) -> Calibration:
    """Gather readings at many distances into at most fifty, so that neighbors become repeats of each other."""
    # The range is cut into parts, along which the signal falls, and the distance grows, by equal steps of asinh((y -
    # y_far) / tau), which is ln xi above the scatter tau, and of l, half by half: where the curve is steep, parts are
    # narrow. The first and the last distance are parts of their own. Every reading is moved to the mean distance of its
    # part along a cubic spline through the medians of the parts; what that leaves is of fourth order in the width of a
    # part. Readings of exactly 0 (lost) and at a largest value that is met more than once (clipped) are not moved, so
    # that they are known for what they are. Their order stays.
    distance = calibration.distances
    if len(calibration.distinct_distances) <= _MANY:
        return calibration
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - SciPy is loaded only for fits

    order = np.argsort(distance, kind="stable")
    places, part = _parts(distance[order], calibration.outputs[order])
    part = part[np.argsort(order, kind="stable")]
    part[distance == distance.min()] = -1  # the ends are places of their own: they support the curve there
    part[distance == distance.max()] = len(places)
    _, part = np.unique(part, return_inverse=True)
    count = int(part.max()) + 1
    middle = np.array([distance[part == i].mean() for i in range(count)])
    median = np.array([np.median(calibration.outputs[part == i]) for i in range(count)])
    inner = slice(1, -1)  # at an end nothing is moved, and one reading is no anchor
    course = CubicSpline(middle[inner], median[inner]) if count > _ENDS + 1 else None
    moved = calibration.outputs - (course(distance) - course(middle[part]) if course else 0.0)
    at_top = calibration.outputs == calibration.outputs.max()
    kept = (calibration.outputs == 0) | (at_top & (at_top.sum() > 1))
    widths = [format_quantity(float(w), "m", 3) for w in (np.diff(places).min(), np.diff(places).max())]
    many, source = len(calibration.distinct_distances), calibration.source
    note = f"{many} distances were gathered into {count}, {widths[0]} to {widths[1]} wide, along the curve."
    return replace(
        calibration,
        distances=middle[part],
        outputs=np.where(kept, calibration.outputs, moved),
        source=None if source is None else replace(source, notes=(*source.notes, note)),
    )


def _parts(distance: FloatArray, output: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the borders of the parts, and the part of each reading, of readings in order of distance."""
    blocks = np.array_split(np.arange(len(distance)), _BLOCKS)
    at = np.array([distance[b].mean() for b in blocks])
    level = np.array([np.median(output[b]) for b in blocks])
    rest = np.median(np.abs(np.diff(output))) + 1e-3 * float(np.ptp(level)) + 1e-300
    far = float(level.min())
    course = np.arcsinh((np.minimum.accumulate(level) - far) / rest)
    fallen = (course[0] - course) / max(float(np.ptp(course)), 1e-300)
    gone = (at - distance[0]) / max(float(distance[-1] - distance[0]), 1e-300)
    way = np.maximum.accumulate(fallen + gone)
    marks = np.interp(np.linspace(0.0, way[-1], _FEW - 1)[1:-1], way, at)
    borders = np.unique(np.concatenate([[distance[0]], marks, [distance[-1]]]))
    return borders, np.clip(np.searchsorted(borders, distance, side="right") - 1, 0, len(borders) - 2)
