"""The front where only the gain is free: the curve of all gains in the plane of quantities, and what of it is best."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray

from ..search import Effort, Landscape, refine, scan
from .domination import FoundFront, extent_of, non_dominated

__all__ = ["trace_front"]

_EFFORT: Final = Effort(share=0.01)  # a quantity may pass through 0
_HALVINGS: Final = 44  # until neighbors on two sides of an end are 1e-13 of the axis apart
_FINEST: Final = 12
_CURVE_SPACING: Final = 0.01  # between neighbors of the front, of its extent


# The curve is scanned until neighbors predict each other; where a quantity is least along it, where limits begin to
# hold and where another stretch of the curve becomes better, the ends of the front's pieces are found to rounding.
def trace_front(evaluate: Callable[[FloatArray], FloatArray]) -> FoundFront:
    """Find the front of a curve over [0, 1], which gives quantities, shape (n, k), of coordinates, (n,)."""
    # Quantities are infinite where not feasible. Points of the front ascend in the first of two quantities, in the
    # coordinate with three; pieces are separated by coordinates that are worse. Empty where nothing is feasible.
    samples = _Samples(evaluate)
    for k in range(samples.values.shape[1]):
        lowest = refine(lambda u, k=k: evaluate(u)[:, k], samples.at, samples.values[:, k])  # type: ignore[misc]
        samples.add(np.array([m.coordinate for m in lowest]))
    if np.isfinite(samples.values).all(axis=1).any():
        samples.find_ends()
        samples.fill()
    best = non_dominated(samples.values)
    piece = np.cumsum(np.concatenate([[True], best[1:] & ~best[:-1]]))
    kept = np.flatnonzero(_thinned(samples.values, best))
    order = kept[np.argsort(samples.values[kept, 0] if samples.values.shape[1] == 2 else kept, kind="stable")]
    numbers = np.concatenate([[0], np.cumsum(np.diff(piece[order]) != 0)])[: len(order)]
    return FoundFront.of(samples.at[order, None], samples.values[order], numbers, samples.at[:, None], samples.values)


class _Samples:
    """All points of the curve that are known, in order."""

    def __init__(self, evaluate: Callable[[FloatArray], FloatArray]) -> None:
        def landscape(at: FloatArray) -> Landscape:
            return Landscape(objective=evaluate(at).T, ratios=np.empty((0, len(at))))

        found = scan(landscape, 0.0, 1.0, _EFFORT)
        self.evaluate = evaluate
        self.at, self.values = found.coordinate, found.landscape.objective.T

    def add(self, at: FloatArray) -> None:
        """Evaluate more points, and put them in their places."""
        at = np.setdiff1d(at, self.at)
        if not len(at):
            return
        every = np.concatenate([self.at, at])
        order = np.argsort(every, kind="stable")
        self.values = np.concatenate([self.values, self.evaluate(at)])[order]
        self.at = every[order]

    def halve(self, which: BoolArray) -> bool:
        """Halve intervals; tell whether there were any."""
        where = np.flatnonzero(which)
        self.add(0.5 * (self.at[where] + self.at[where + 1]))
        return len(where) > 0

    def find_ends(self) -> None:
        """Halve every interval at one side of which the curve belongs to the front, until that is decided."""
        for _ in range(_HALVINGS):
            best = non_dominated(self.values)
            if not self.halve((best[1:] != best[:-1]) & (np.diff(self.at) > 1e-13)):
                return

    def fill(self) -> None:
        """Halve intervals of the front whose ends lie far apart in the plane of quantities."""
        for _ in range(_FINEST):
            best = non_dominated(self.values)
            with np.errstate(invalid="ignore"):
                gaps = (np.abs(np.diff(self.values, axis=0)) / extent_of(self.values[best])).max(axis=1)
            if not self.halve(best[1:] & best[:-1] & (gaps > _CURVE_SPACING)):
                return


def _thinned(values: FloatArray, best: BoolArray) -> BoolArray:
    """Leave out points that lie close to the one before; the ends of pieces and the least of each quantity stay."""
    kept, front = best.copy(), np.flatnonzero(best)
    if not len(front):
        return kept
    padded = np.concatenate([[False], best, [False]])
    inner: BoolArray = padded[:-2] & padded[2:]
    needed = {*np.flatnonzero(best & ~inner), *front[np.argmin(values[front], axis=0)]}
    shares = values / extent_of(values[front])
    last = front[0]
    for i in front[1:]:
        if i not in needed and np.abs(shares[i] - shares[last]).max() < _CURVE_SPACING / 4:
            kept[i] = False
        else:
            last = i
    return kept
