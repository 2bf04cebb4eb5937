"""The knee of a front: where giving up a little of one quantity gains most of the others."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray

from ..search import refine
from ..search.local import descend
from ..search.trials import Trials

__all__ = ["find_knee"]

_LEAST: Final = 1e-3  # depth below which a front counts as straight


# In coordinates in which the front reaches from 0 to 1 in every quantity, the knee is the point that lies deepest below
# the plane through the front's ends, sum p = 1 (Das 1999, On characterizing the "knee" of the Pareto curve based on
# normal-boundary intersection; for three quantities we take the plane through the ends of the axes). As the least sum
# of all points, it is on the front whatever the front's shape.
def find_knee(
    trials: Trials, at: FloatArray, values: FloatArray, scanned: FloatArray, scanned_values: FloatArray
) -> tuple[FloatArray, float] | None:
    """Return coordinates and depth of the knee, of the extent of the front."""
    # None for a front that is straight, bulges outward, or does not trade at all.
    low, extent = values.min(axis=0), np.ptp(values, axis=0)
    if len(values) < 3 or not (extent > 0).all():
        return None
    best = at[int(((values - low) / extent).sum(axis=1).argmin())]
    if trials.freedom.size == 1:
        minima = refine(
            lambda u: ((trials.values(u[:, None]) - low) / extent).sum(axis=1),
            scanned[:, 0],
            ((scanned_values - low) / extent).sum(axis=1),
        )
        found = np.array([minima[0].coordinate]) if minima else best
    else:
        searched = descend(trials, best, 1 / extent)
        found = best if searched is None else searched
    both = np.stack([best, found])
    sums = ((trials.values(both) - low) / extent).sum(axis=1)
    depth = float((1 - sums.min()) / np.sqrt(values.shape[1]))
    return (both[int(sums.argmin())], depth) if depth > _LEAST else None
