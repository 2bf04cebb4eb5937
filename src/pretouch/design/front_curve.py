"""The front where only the gain is free: the curve of all gains in the plane of quantities, and what of it is best.

The curve is scanned until neighbors predict each other; where a quantity is least along it, where limits begin to hold
and where another stretch of the curve becomes better, the ends of the front's pieces are found to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

from .domination import non_dominated
from .search import refine

__all__ = ["CurveFront", "trace_front"]

_SCANNED: Final = 65
_LARGEST: Final = 2049
_RESOLVED: Final = 1e-3  # error of predicting a quantity from its neighbors, of itself or of 1 % of its range
_HALVINGS: Final = 44  # until neighbors on two sides of an end are 1e-13 of the axis apart
_FINEST: Final = 12
_SPACING: Final = 0.01  # between neighbors of the front, of its extent


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveFront:
    """The front of a curve.

    Args:
        at: coordinates of its points, ascending, shape (n,).
        values: the quantities there, shape (n, k).
        piece: the number of the piece that each point belongs to; pieces are separated by gains that are worse.
        scanned: every coordinate that was tried, ascending.
        scanned_values: the quantities there, infinite where not feasible.
    """

    at: FloatArray
    values: FloatArray
    piece: IntArray
    scanned: FloatArray
    scanned_values: FloatArray


class _Samples:
    """All points of the curve that are known, in order."""

    def __init__(self, evaluate: Callable[[FloatArray], FloatArray], at: FloatArray) -> None:
        self.evaluate = evaluate
        self.at = at
        self.values = evaluate(at)

    def add(self, at: FloatArray) -> None:
        """Evaluate more points, and put them in their places."""
        at = np.setdiff1d(at, self.at)
        if not len(at):
            return
        every = np.concatenate([self.at, at])
        order = np.argsort(every, kind="stable")
        self.values = np.concatenate([self.values, self.evaluate(at)])[order]
        self.at = every[order]


def trace_front(evaluate: Callable[[FloatArray], FloatArray]) -> CurveFront:
    """Find the front of a curve over [0, 1].

    Args:
        evaluate: from coordinates, shape (n,), to quantities, shape (n, k), infinite where not feasible.

    Returns:
        The front; empty where nothing is feasible.
    """
    samples = _Samples(evaluate, np.linspace(0.0, 1.0, _SCANNED))
    _resolve(samples)
    for k in range(samples.values.shape[1]):
        lowest = refine(lambda u, k=k: evaluate(u)[:, k], samples.at, samples.values[:, k])  # type: ignore[misc]
        samples.add(np.array([m.coordinate for m in lowest]))
    if np.isfinite(samples.values).all(axis=1).any():
        _find_ends(samples)
        _fill(samples)
    best = non_dominated(samples.values)
    piece = np.cumsum(np.concatenate([[True], best[1:] & ~best[:-1]]))
    kept = _thinned(samples, best)
    return CurveFront(
        at=samples.at[kept],
        values=samples.values[kept],
        piece=piece[kept],
        scanned=samples.at,
        scanned_values=samples.values,
    )


def _thinned(samples: _Samples, best: BoolArray) -> BoolArray:
    """Leave out points that lie close to the one before; the ends of pieces and the least of each quantity stay."""
    kept = best.copy()
    padded = np.concatenate([[False], best, [False]])
    inner: BoolArray = padded[:-2] & padded[2:]
    needed = np.flatnonzero(best & ~inner)
    if best.any():
        needed = np.append(needed, np.flatnonzero(best)[np.argmin(samples.values[best], axis=0)])
    extent = np.ptp(samples.values[best], axis=0) if best.any() else 1.0
    extent = np.where(extent > 0, extent, 1.0)
    last: FloatArray | None = None
    for i in np.flatnonzero(best):
        near = last is not None and np.abs((samples.values[i] - last) / extent).max() < _SPACING / 4
        if near and i not in needed:
            kept[i] = False
        else:
            last = samples.values[i]
    return kept


def _resolve(samples: _Samples) -> None:
    """Halve intervals until the cubic through four neighbors predicts what is between them, and around edges."""
    doubtful = np.ones(len(samples.at) - 1, dtype=bool)
    while doubtful.any() and len(samples.at) + int(doubtful.sum()) <= _LARGEST:
        where = np.flatnonzero(doubtful)
        middle = 0.5 * (samples.at[where] + samples.at[where + 1])
        predicted = _predict(samples, where)
        samples.add(middle)
        place = np.searchsorted(samples.at, middle)
        found = samples.values[place]
        known = samples.values[np.isfinite(samples.values).all(axis=1)]
        extent = np.ptp(known, axis=0) if len(known) else 1.0
        with np.errstate(invalid="ignore"):
            error = np.abs(predicted - found) / (np.abs(found) + 0.01 * extent)
        rough = (np.where(np.isfinite(error), error, 0.0) > _RESOLVED).any(axis=1)
        doubtful = np.zeros(len(samples.at) - 1, dtype=bool)
        doubtful[place[rough] - 1] = True
        doubtful[place[rough]] = True
        there: BoolArray = np.asarray(np.isfinite(samples.values).all(axis=1))
        doubtful |= (there[1:] != there[:-1]) & (np.diff(samples.at) > 1e-3)


def _predict(samples: _Samples, where: IntArray) -> FloatArray:
    """Predict the quantities in the middle of intervals by the cubics through the four nodes nearest to each."""
    first = np.clip(where - 1, 0, len(samples.at) - 4).astype(np.int64)
    nodes = first[:, None] + np.arange(4)
    x, y = samples.at[nodes], samples.values[nodes]
    at = 0.5 * (x[np.arange(len(x)), where - first] + x[np.arange(len(x)), where - first + 1])
    total = np.zeros((len(at), y.shape[2]))
    for i in range(4):
        weight = np.ones(len(at))
        for j in range(4):
            if j != i:
                weight = weight * (at - x[:, j]) / (x[:, i] - x[:, j])
        with np.errstate(invalid="ignore"):
            total = total + weight[:, None] * y[:, i]
    return total


def _find_ends(samples: _Samples) -> None:
    """Halve every interval at one side of which the curve belongs to the front, until that is decided to rounding."""
    for _ in range(_HALVINGS):
        best = non_dominated(samples.values)
        ends = np.flatnonzero((best[1:] != best[:-1]) & (np.diff(samples.at) > 1e-13))
        if not len(ends):
            return
        samples.add(0.5 * (samples.at[ends] + samples.at[ends + 1]))


def _fill(samples: _Samples) -> None:
    """Halve intervals of the front whose ends lie far apart in the plane of quantities."""
    for _ in range(_FINEST):
        best = non_dominated(samples.values)
        wide = best[1:] & best[:-1] & (_gaps(samples, best) > _SPACING)
        if not wide.any():
            return
        where = np.flatnonzero(wide)
        samples.add(0.5 * (samples.at[where] + samples.at[where + 1]))


def _gaps(samples: _Samples, best: BoolArray) -> FloatArray:
    """Return how far neighbors lie apart in the plane, of the extent of the front in each quantity."""
    extent = np.ptp(samples.values[best], axis=0)
    extent = np.where(extent > 0, extent, 1.0)
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(np.diff(samples.values, axis=0)) / extent).max(axis=1))
