"""Which of many points are worth choosing: none other is as good in every quantity and better in one."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

__all__ = ["FoundFront", "extent_of", "non_dominated", "shortfall"]

_FLAT: Final = 1e-12  # relative: a quantity that varies less along the front is the same everywhere


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundFront:
    """A front by coordinates, whichever way it was found."""

    at: FloatArray  # coordinates of its points, shape (n, size)
    values: FloatArray  # the quantities there, shape (n, k)
    piece: IntArray  # the number of the piece that each point belongs to, from 0 on
    scanned: FloatArray  # coordinates of everything that was tried side by side, shape (m, size)
    scanned_values: FloatArray  # the quantities there, infinite where not feasible
    missed: float  # the most by which the front misses what was tried, of its extent in every quantity at once

    @classmethod
    def of(
        cls, at: FloatArray, values: FloatArray, piece: Any, scanned: FloatArray, scanned_values: FloatArray
    ) -> FoundFront:
        """Put a front beside what was tried."""
        missed = np.inf
        if len(at):
            extent = extent_of(values)
            missed = max(float(shortfall(scanned_values / extent, values / extent).max()), 0.0)
        numbers = np.asarray(piece, dtype=np.int64)
        return cls(at=at, values=values, piece=numbers, scanned=scanned, scanned_values=scanned_values, missed=missed)


def extent_of(values: FloatArray) -> FloatArray:
    """Return the extent of a front, shape (n, k), in each quantity; where it has none, the quantity itself."""
    if not len(values):
        return np.ones(values.shape[1])
    extent, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
    return np.asarray(np.where(extent > _FLAT * size, extent, np.where(size > 0, size, 1.0)))


def non_dominated(values: FloatArray) -> BoolArray:
    """Tell which points, (n, 2) or (n, 3), no other dominates; of equal ones the first, of infinite ones none."""
    n, k = values.shape
    kept = np.zeros(n, dtype=bool)
    order = np.lexsort((np.arange(n), *values.T[::-1]))
    order = order[np.isfinite(values[order]).all(axis=1)]
    if k == 2:
        second = values[order, 1]
        lowest = np.minimum.accumulate(np.concatenate([[np.inf], second]))[:-1]
        kept[order[second < lowest]] = True
        return kept
    stairs_y: list[float] = []  # ascending; of the points so far, those that none dominates in the last two
    stairs_z: list[float] = []  # descending
    for i in order:
        y, z = float(values[i, 1]), float(values[i, 2])
        at = bisect_left(stairs_y, y)
        before = at if at < len(stairs_y) and stairs_y[at] == y else at - 1
        if before >= 0 and stairs_z[before] <= z:
            continue
        kept[i] = True
        end = at
        while end < len(stairs_y) and stairs_z[end] >= z:
            end += 1
        stairs_y[at:end], stairs_z[at:end] = [y], [z]
    return kept


def shortfall(points: FloatArray, front: FloatArray) -> FloatArray:
    """Return by how much a front, shape (n, k), misses points, (m, k): the least shift with which it dominates each."""
    # Not positive where it dominates the point (Zitzler et al. 2003, additive epsilon); infinite points are missed by
    # nothing.
    missed = np.full(len(points), -np.inf)
    there = np.flatnonzero(np.isfinite(points).all(axis=1))
    for start in range(0, len(there), 1024):
        some = there[start : start + 1024]
        apart: Any = front[None] - points[some, None]
        missed[some] = apart.max(axis=2).min(axis=1)
    return missed
