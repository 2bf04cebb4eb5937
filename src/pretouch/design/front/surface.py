"""The front where more than the gain is free: found everywhere on a grid, then followed exactly."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray

from ..search.local import advance, descend
from ..search.trials import Trials
from .domination import FoundFront, extent_of, non_dominated, shortfall

__all__ = ["find_front"]

_GAINS: Final = 49
_TESTS: Final = 2048  # encounters
_ROUNDS: Final = 3
_SPACING: Final = 0.03  # between neighbors of the front, of its extent; with three quantities, see _POINTS
_GAP: Final = 2.5  # times that: what neither points nor searches between them have closed
_POINTS: Final = {2: 40, 3: 90}
_MISSED: Final = 2e-3  # of the extent: a test encounter that the front misses by more is searched from
_PULL: Final = 1e-3  # of the other quantities, where one alone is minimized: of equally good encounters the better


# A grid over all that is free says where the front runs. From points spread along it, each search goes toward less of
# every quantity at once, as far as encounters reach; gaps are filled by searches that begin between neighbors. At last
# the front is put to the test by encounters that had no part in finding it; those that it misses are searched from,
# too.
def find_front(trials: Trials) -> FoundFront:
    """Find the front of all that is free, in pieces between which nothing was found; empty if nothing is feasible."""
    grid = trials.freedom.lattice(_GAINS)
    grid_values = trials.values(grid)
    best = np.flatnonzero(non_dominated(grid_values))
    tests = trials.freedom.spread(_TESTS)
    tests_values = trials.values(tests)
    every, every_values = np.concatenate([grid, tests]), np.concatenate([grid_values, tests_values])
    if not len(best):
        return FoundFront.of(grid[:0], grid_values[:0], [], every, every_values)
    extent = extent_of(grid_values[best])
    found = _FrontPoints(trials, extent)
    for k in range(grid_values.shape[1]):
        weights = np.full(grid_values.shape[1], _PULL) / extent
        weights[k] = 1 / extent[k]
        found.add(descend(trials, grid[best[np.argmin(grid_values[best] @ weights)]], weights))
    for i in _spread(grid_values[best] / extent, _POINTS[grid_values.shape[1]]):
        found.search(grid[best[i]], grid_values[best[i]])
    found.fill()
    for _ in range(_ROUNDS):
        missed = shortfall(every_values / extent, found.values / extent)
        worst = np.argsort(-missed)[: 2 * trials.freedom.size]
        worst = worst[missed[worst] > _MISSED]
        for i in worst:
            found.search(every[i], every_values[i])
        if not len(worst):
            break
        found.fill()
    return FoundFront.of(found.at, found.values, found.pieces(), every, every_values)


class _FrontPoints:
    """The points found so far; none dominates another."""

    def __init__(self, trials: Trials, extent: FloatArray) -> None:
        self.trials = trials
        self.extent = extent
        self.at = np.empty((0, trials.freedom.size))
        self.values = np.empty((0, len(extent)))

    def add(self, at: FloatArray | None) -> None:
        """Take a point in; points that it dominates go."""
        if at is None:
            return
        values = self.trials.values(at[None])
        if not np.isfinite(values).all():
            return
        at_all, values_all = np.concatenate([self.at, at[None]]), np.concatenate([self.values, values])
        best = np.flatnonzero(non_dominated(values_all))
        best = best[np.argsort(values_all[best, 0], kind="stable")]
        self.at, self.values = at_all[best], values_all[best]

    def search(self, start: FloatArray, origin: FloatArray) -> None:
        """Search from a start along the ray through a point of the plane; take the start itself where that fails."""
        found = advance(self.trials, start, origin, self.extent)
        self.add(start if found is None else found[0])

    def fill(self) -> None:
        """Search between neighbors that lie far apart; with three quantities points have no neighbors in a row."""
        if self.values.shape[1] != 2:
            return
        for _ in range(_ROUNDS):
            gap = (np.abs(np.diff(self.values, axis=0)) / self.extent).max(axis=1)
            wide = np.flatnonzero(gap > _SPACING)
            pairs = [(0.5 * (self.at[i] + self.at[i + 1]), 0.5 * (self.values[i] + self.values[i + 1])) for i in wide]
            for start, origin in pairs:
                self.search(start, origin)
            if not pairs:
                return

    def pieces(self) -> IntArray:
        """Number the stretches of the front between which no search has found anything."""
        if self.values.shape[1] != 2:
            return np.zeros(len(self.values), dtype=np.int64)
        gap = (np.abs(np.diff(self.values, axis=0)) / self.extent).max(axis=1)
        return np.concatenate([[0], np.cumsum(gap > _GAP * _SPACING)]).astype(np.int64)


def _spread(points: FloatArray, count: int) -> list[int]:
    """Choose points that lie far apart, each the farthest from those before; the first is the lowest of all."""
    chosen = [int(points.sum(axis=1).argmin())]
    apart = np.abs(points - points[chosen[0]]).max(axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, np.abs(points - points[chosen[-1]]).max(axis=1))
    return chosen
