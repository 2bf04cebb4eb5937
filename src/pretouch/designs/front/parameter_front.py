"""Compute the Pareto front over several free parameters.

Local searches start from the points of a grid.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray

from ..search.local import advance, descend, least_violations
from ..search.trials import Trials
from .dominance import FoundFront, extent_of, non_dominated, shortfall

_GAINS: Final = 49
_TESTS: Final = 2048  # number of test encounters
_ROUNDS: Final = 3
_SPACING: Final = 0.03  # distance between neighbors on the front, as a share of its extent, with two quantities
_GAP: Final = 2.5  # a distance above this multiple of the spacing separates two pieces
_POINTS: Final = {2: 40, 3: 90}  # number of starting points, by the number of quantities
_MISSED: Final = 2e-3  # a test encounter that beats the front by more than this share of its extent starts a search
_NEIGHBORS: Final = 6  # neighbors of a point that are mixed with it, with three quantities
_MIXTURES: Final = 60  # mixtures per point
_MOVED: Final = 24  # number of worst mixtures that are moved onto the front
_PULL: Final = 1e-3  # weight of the other quantities while one is minimized: it decides between equal minima


# A grid over all free parameters locates the front. Searches start at points spread along it; each reduces all
# quantities together. Searches that start between neighbors fill the gaps. Finally the front is tested on independent
# encounters; those that are better than the front become further starting points.
def find_front(trials: Trials) -> FoundFront:
    """Find the Pareto front over all free parameters.

    Returns:
        The front; empty if no search point is feasible.
    """
    grid = trials.freedom.lattice(_GAINS)
    landscape = trials.landscape(grid)
    if not landscape.feasible.any():  # all feasible points may lie between those of the grid
        grid = np.concatenate([grid, least_violations(trials, grid, landscape.violation)])
        landscape = trials.landscape(grid)
    grid_values = landscape.merit.T
    best = np.flatnonzero(non_dominated(grid_values))
    tests = trials.freedom.spread(_TESTS)
    tests_values = trials.values(tests)
    every, every_values = np.concatenate([grid, tests]), np.concatenate([grid_values, tests_values])
    if not len(best):
        return FoundFront.of(grid[:0], grid_values[:0], [], (every, every_values), every_values[:0])
    extent = extent_of(grid_values[best])
    front = _FrontPoints(trials, extent)
    for k in range(grid_values.shape[1]):
        weights = np.full(grid_values.shape[1], _PULL) / extent
        weights[k] = 1 / extent[k]
        front.add(descend(trials, grid[best[np.argmin(grid_values[best] @ weights)]], weights))
    for i in _spread(grid_values[best] / extent, _POINTS[grid_values.shape[1]]):
        front.search(grid[best[i]], grid_values[best[i]])
    front.fill()
    for _ in range(_ROUNDS):
        missed = shortfall(every_values / extent, front.values / extent)
        worst = np.argsort(-missed)[: 2 * trials.freedom.size]
        worst = worst[missed[worst] > _MISSED]
        for i in worst:
            front.search(every[i], every_values[i])
        if not len(worst):
            break
        front.fill()
    return FoundFront.of(front.at, front.values, front.pieces(), (every, every_values), front.between())


class _FrontPoints:
    """The current points of a Pareto front during its search. No point dominates another point."""

    def __init__(self, trials: Trials, extent: FloatArray) -> None:
        self.trials = trials
        self.extent = extent
        self.at = np.empty((0, trials.freedom.size))
        self.values = np.empty((0, len(extent)))

    def add(self, point: tuple[FloatArray, FloatArray] | None) -> None:
        """Add a point to the Pareto front unless it is dominated.

        Remove the points that the new point dominates.
        """
        if point is None:
            return
        at, values = point
        at_all, values_all = np.concatenate([self.at, at[None]]), np.concatenate([self.values, values[None]])
        best = np.flatnonzero(non_dominated(values_all))
        best = best[np.argsort(values_all[best, 0], kind="stable")]
        self.at, self.values = at_all[best], values_all[best]

    def search(self, start: FloatArray, origin: FloatArray) -> None:
        """Move a point to the Pareto front by local search.

        If the search fails, add the starting point.
        """
        point = advance(self.trials, start, origin, self.extent)
        if point is None and np.isfinite(values := self.trials.values(start[None])).all():
            point = start, values[0]
        self.add(point)

    def fill(self) -> None:
        """Fill wide gaps of a Pareto front of two quantities."""
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

    def between(self) -> FloatArray:
        """Search for more points between the Pareto points.

        Returns:
            The quantities of these points.
        """
        return self._between_two() if self.values.shape[1] == 2 else self._between_many()

    def _between_two(self) -> FloatArray:
        # The additive epsilon of two neighbors is largest on the ray through their nadir corner, which has the larger
        # value of each quantity. So the search along this ray finds the worst encounter between them.
        bounds = (np.abs(np.diff(self.values, axis=0)) / self.extent).min(axis=1)
        values, most = [self.values[:0]], 0.0
        for i in np.argsort(bounds)[::-1]:
            if bounds[i] <= most:  # no encounter between these two can have a larger epsilon
                break
            start, corner = self.at[i : i + 2].mean(axis=0), self.values[i : i + 2].max(axis=0)
            if (point := advance(self.trials, start, corner, self.extent)) is not None:
                values.append(point[1][None])
                most = max(most, self._missed(values[-1])[0])
        return np.concatenate(values)

    def _between_many(self) -> FloatArray:
        # Mixtures of neighbors lie near the front; those with the largest epsilon are moved onto it.
        shares = self.values / self.extent
        near = np.argsort(np.abs(shares[:, None] - shares[None]).max(axis=2), axis=1, kind="stable")[
            :, : _NEIGHBORS + 1
        ]
        rng = np.random.default_rng(0)
        weights = rng.dirichlet(np.full(near.shape[1], 1 / 3), (_MIXTURES, len(near)))
        mixed = np.einsum("mni,nid->mnd", weights, self.at[near]).reshape(-1, self.at.shape[1])
        values = self.trials.values(mixed)
        worst = np.argsort(-self._missed(values), kind="stable")[:_MOVED]
        moved = [advance(self.trials, mixed[i], values[i], self.extent) for i in worst]
        return np.concatenate([values, *(point[1][None] for point in moved if point is not None)])

    def _missed(self, values: FloatArray) -> FloatArray:
        return shortfall(values / self.extent, self.values / self.extent)

    def pieces(self) -> IntArray:
        """Return the index of the front segment of each Pareto point.

        Wide gaps separate the segments.
        """
        if self.values.shape[1] != 2:
            return np.zeros(len(self.values), dtype=np.int64)
        gap = (np.abs(np.diff(self.values, axis=0)) / self.extent).max(axis=1)
        return np.concatenate([[0], np.cumsum(gap > _GAP * _SPACING)]).astype(np.int64)


def _spread(points: FloatArray, count: int) -> list[int]:
    """Choose a few points that lie far apart.

    Returns:
        The indices of these points.
    """
    chosen = [int(points.sum(axis=1).argmin())]
    apart = np.abs(points - points[chosen[0]]).max(axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, np.abs(points - points[chosen[-1]]).max(axis=1))
    return chosen
