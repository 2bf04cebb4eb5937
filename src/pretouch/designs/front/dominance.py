"""Find Pareto-optimal points among many points, and estimate the error of a Pareto front."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

_FLAT: Final = 1e-12  # a quantity that varies less than this along the front, relative to its magnitude, is constant


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundFront:
    """Points of a Pareto front, with all evaluated encounters."""

    at: FloatArray  # coordinates of the points, shape (n, size)
    values: FloatArray  # quantities of the points, shape (n, k)
    piece: IntArray  # index of the connected piece of each point
    scanned: FloatArray  # coordinates of all encounters of the scan, shape (m, size)
    scanned_values: FloatArray  # their quantities, infinite if not feasible
    approximation_error: (
        float  # largest amount by which an encounter beats the front in every quantity, as a share of the extent
    )

    @classmethod
    def of(
        cls,
        at: FloatArray,
        values: FloatArray,
        piece: Any,
        scanned: tuple[FloatArray, FloatArray],
        between: FloatArray,
    ) -> FoundFront:
        """Make a Pareto front, and estimate its error.

        Returns:
            The front, whose error is relative to the other evaluated encounters.
        """
        approximation_error = np.inf
        if len(at):
            extent, others = extent_of(values), np.concatenate([scanned[1], between])
            approximation_error = max(float(shortfall(others / extent, values / extent).max()), 0.0)
        numbers = np.asarray(piece, dtype=np.int64)
        return cls(
            at=at,
            values=values,
            piece=numbers,
            scanned=scanned[0],
            scanned_values=scanned[1],
            approximation_error=approximation_error,
        )


def extent_of(values: FloatArray) -> FloatArray:
    """Return the range of each quantity along a Pareto front.

    For a constant quantity, return its magnitude.
    """
    if not len(values):
        return np.ones(values.shape[1])
    extent, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
    return np.asarray(np.where(extent > _FLAT * size, extent, np.where(size > 0, size, 1.0)))


def non_dominated(values: FloatArray) -> BoolArray:
    """Return which points are Pareto-optimal.

    Of several equal points only the first counts. Points have the shape (n, 2) or (n, 3). Infinite points do not count.
    Of equal points, the first one is returned.
    """
    n, k = values.shape
    best = np.zeros(n, dtype=bool)
    order = np.lexsort((np.arange(n), *values.T[::-1]))
    order = order[np.isfinite(values[order]).all(axis=1)]
    if k == 2:
        second = values[order, 1]
        lowest = np.minimum.accumulate(np.concatenate([[np.inf], second]))[:-1]
        best[order[second < lowest]] = True
        return best
    stairs_y: list[float] = []  # ascending: points so far that are not dominated in the last two quantities
    stairs_z: list[float] = []  # descending
    for i in order:
        y, z = float(values[i, 1]), float(values[i, 2])
        at = bisect_left(stairs_y, y)
        before = at if at < len(stairs_y) and stairs_y[at] == y else at - 1
        if before >= 0 and stairs_z[before] <= z:
            continue
        best[i] = True
        end = at
        while end < len(stairs_y) and stairs_z[end] >= z:
            end += 1
        stairs_y[at:end], stairs_z[at:end] = [y], [z]
    return best


def shortfall(points: FloatArray, front: FloatArray) -> FloatArray:
    """Return the smallest shift with which a Pareto front dominates each point.

    This is the additive epsilon indicator of each point. It is not positive if the front dominates the point (Zitzler
    et al. 2003), and -inf for points that are infinite.
    """
    epsilon = np.full(len(points), -np.inf)
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    for start in range(0, len(finite), 1024):
        block = finite[start : start + 1024]
        shift: Any = front[None] - points[block, None]
        epsilon[block] = shift.max(axis=2).min(axis=1)
    return epsilon
