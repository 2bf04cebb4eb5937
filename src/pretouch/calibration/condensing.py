"""Thousands of distances, as a motor stage records them, gathered into few."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.units import format_quantity

from .data import Calibration

__all__ = ["condense"]

_MANY: Final = 100  # distinct distances from which on they are gathered
_FEW: Final = 50


def condense(calibration: Calibration) -> Calibration:
    """Gather readings at many distances into at most fifty, so that neighbors become repeats of each other.

    The range is cut into fifty equal parts, and every reading is moved to the mean distance of its part along a cubic
    spline through the medians of the parts. What that leaves is of fourth order in the width of a part: below 1e-5 of
    the signal for a tenth of the sensor's length 1/|g|. Readings of exactly 0 (lost) and at a largest value that
    is met more than once (clipped) are not moved, so that they are known for what they are.

    Args:
        calibration: the readings.

    Returns:
        The same readings in the same order, with their distances gathered; unchanged where there are few distances.
    """
    distance = calibration.distances
    if len(calibration.distinct_distances) <= _MANY:
        return calibration
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - SciPy is loaded only for fits

    edges = np.linspace(distance.min(), distance.max(), _FEW + 1)
    _, part = np.unique(np.clip(np.searchsorted(edges, distance, side="right") - 1, 0, _FEW - 1), return_inverse=True)
    count = int(part.max()) + 1
    middle, median = np.empty(count), np.empty(count)
    for i in range(count):
        members = part == i
        middle[i] = distance[members].mean()
        median[i] = np.median(calibration.outputs[members])
    course = CubicSpline(middle, median) if count > 1 else None
    moved = calibration.outputs - (course(distance) - course(middle[part]) if course else 0.0)
    at_top = calibration.outputs == calibration.outputs.max()
    kept = (calibration.outputs == 0) | (at_top & (at_top.sum() > 1))
    width = format_quantity(float(edges[1] - edges[0]), "m", 3)
    note = f"{len(calibration.distinct_distances)} distances were gathered into {count}, {width} apart."
    source = calibration.source
    return replace(
        calibration,
        distances=middle[part],
        outputs=np.where(kept, calibration.outputs, moved),
        source=None if source is None else replace(source, notes=(*source.notes, note)),
    )
