"""Search for Pareto fronts, along the curve of all gains and over several free parameters."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

from ..search import Effort, Landscape, refine, scan
from ..search.local import advance, descend
from ..search.trials import Trials

_FLAT: Final = 1e-12  # a quantity with a smaller relative variation along the front is constant


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundFront:
    """A Pareto front in coordinates of the search."""

    at: FloatArray  # coordinates of the points, shape (n, size)
    values: FloatArray  # quantities of the points, shape (n, k)
    piece: IntArray  # index of the connected piece of each point
    scanned: FloatArray  # coordinates of all encounters of the scan, shape (m, size)
    scanned_values: FloatArray  # their quantities, infinite if not feasible
    missed: float  # largest amount by which an encounter is better in every quantity, as a share of the extent

    @classmethod
    def of(
        cls,
        at: FloatArray,
        values: FloatArray,
        piece: Any,
        scanned: tuple[FloatArray, FloatArray],
        between: FloatArray,
    ) -> FoundFront:
        """Make a front and compare it with the encounters of the scan and with quantities between its points."""
        missed = np.inf
        if len(at):
            extent, others = extent_of(values), np.concatenate([scanned[1], between])
            missed = max(float(shortfall(others / extent, values / extent).max()), 0.0)
        numbers = np.asarray(piece, dtype=np.int64)
        return cls(at=at, values=values, piece=numbers, scanned=scanned[0], scanned_values=scanned[1], missed=missed)


def extent_of(values: FloatArray) -> FloatArray:
    """Return the extent of a front, shape (n, k), in each quantity; the magnitude of a constant quantity."""
    if not len(values):
        return np.ones(values.shape[1])
    extent, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
    return np.asarray(np.where(extent > _FLAT * size, extent, np.where(size > 0, size, 1.0)))


def non_dominated(values: FloatArray) -> BoolArray:
    """Return which points, (n, 2) or (n, 3), are not dominated; of equal points the first, of infinite ones none."""
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
    """Return the additive epsilon of points, (m, k): the smallest shift with which a front, (n, k), dominates each."""
    # It is not positive if the front dominates the point (Zitzler et al. 2003), and -inf for points that are infinite.
    epsilon = np.full(len(points), -np.inf)
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    for start in range(0, len(finite), 1024):
        block = finite[start : start + 1024]
        shift: Any = front[None] - points[block, None]
        epsilon[block] = shift.max(axis=2).min(axis=1)
    return epsilon


_EFFORT: Final = Effort(share=0.01)  # a quantity may pass through 0
_HALVINGS: Final = 44  # until the neighbors of an end are 1e-13 of the axis apart
_FINEST: Final = 12
_CURVE_SPACING: Final = 0.01  # distance between neighbors on the front, as a share of its extent


# The curve is scanned until it is well interpolated. The ends of the front's pieces are then found to rounding: the
# minima of the quantities, the edges of feasibility, and the points where another part of the curve becomes better.
def trace_front(evaluate: Callable[[FloatArray], FloatArray]) -> FoundFront:
    """Find the Pareto front of a curve over [0, 1]: `evaluate` returns quantities, (n, k), at coordinates, (n,)."""
    # Quantities are infinite if not feasible. The points ascend in the first quantity, or with three quantities in the
    # coordinate; pieces are separated by worse coordinates. The front is empty if nothing is feasible.
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
    connected = np.diff(piece[kept]) == 0
    between = _between(evaluate, samples.at[kept], samples.values[kept], connected)
    points = samples.at[order, None], samples.values[order], numbers
    return FoundFront.of(*points, (samples.at[:, None], samples.values), between)


_PARTS: Final = 8  # parts of an interval at whose ends the curve is compared with the points of the front
_WORST: Final = 16  # number of intervals that are refined


def _between(
    evaluate: Callable[[FloatArray], FloatArray], at: FloatArray, values: FloatArray, connected: BoolArray
) -> FloatArray:
    """Return quantities between connected neighbors, with a resolution of 1/128 where the points miss the curve most."""
    low, high = at[:-1][connected], at[1:][connected]
    if not len(low):
        return values[:0]
    shares = np.arange(1, _PARTS) / _PARTS
    first = evaluate((low[:, None] + shares * (high - low)[:, None]).ravel())
    extent = extent_of(values)
    missed = shortfall(first / extent, values / extent).reshape(len(low), -1)
    worst = np.argsort(-missed.max(axis=1), kind="stable")[:_WORST]
    place = shares[missed[worst].argmax(axis=1)]
    near = place[:, None] + np.linspace(-1, 1, 2 * _WORST + 1) / _PARTS
    again = evaluate((low[worst, None] + near * (high - low)[worst, None]).ravel())
    return np.concatenate([first, again])


class _Samples:
    """All evaluated points of the curve, in order."""

    def __init__(self, evaluate: Callable[[FloatArray], FloatArray]) -> None:
        def landscape(at: FloatArray) -> Landscape:
            return Landscape(objective=evaluate(at).T, ratios=np.empty((0, len(at))))

        scanned = scan(landscape, 0.0, 1.0, _EFFORT)
        self.evaluate = evaluate
        self.at, self.values = scanned.coordinate, scanned.landscape.objective.T

    def add(self, at: FloatArray) -> None:
        """Evaluate more points and insert them in order."""
        at = np.setdiff1d(at, self.at)
        if not len(at):
            return
        every = np.concatenate([self.at, at])
        order = np.argsort(every, kind="stable")
        self.values = np.concatenate([self.values, self.evaluate(at)])[order]
        self.at = every[order]

    def halve(self, which: BoolArray) -> bool:
        """Halve intervals; return whether there were any."""
        where = np.flatnonzero(which)
        self.add(0.5 * (self.at[where] + self.at[where + 1]))
        return len(where) > 0

    def find_ends(self) -> None:
        """Halve every interval that has exactly one end on the front, until the ends are found to rounding."""
        for _ in range(_HALVINGS):
            best = non_dominated(self.values)
            if not self.halve((best[1:] != best[:-1]) & (np.diff(self.at) > 1e-13)):
                return

    def fill(self) -> None:
        """Halve intervals of the front whose ends lie far apart in the space of quantities."""
        for _ in range(_FINEST):
            best = non_dominated(self.values)
            with np.errstate(invalid="ignore"):
                gaps = (np.abs(np.diff(self.values, axis=0)) / extent_of(self.values[best])).max(axis=1)
            if not self.halve(best[1:] & best[:-1] & (gaps > _CURVE_SPACING)):
                return


def _thinned(values: FloatArray, best: BoolArray) -> BoolArray:
    """Return the points without close neighbors; the ends of pieces and the minima of the quantities are kept."""
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


_GAINS: Final = 49
_TESTS: Final = 2048  # number of test encounters
_ROUNDS: Final = 3
_SPACING: Final = 0.03  # distance between neighbors on the front, as a share of its extent, with two quantities
_GAP: Final = 2.5  # a distance above this multiple of the spacing separates two pieces
_POINTS: Final = {2: 40, 3: 90}  # number of starting points, by the number of quantities
_MISSED: Final = 2e-3  # a test encounter that is better by more than this share of the extent is a starting point
_NEIGHBORS: Final = 6  # neighbors of a point that are mixed with it, with three quantities
_MIXTURES: Final = 60  # mixtures per point
_MOVED: Final = 24  # number of worst mixtures that are moved onto the front
_PULL: Final = 1e-3  # weight of the other quantities while one is minimized: it decides between equal minima


# A grid over all free parameters locates the front. From points spread along it, each search reduces all quantities
# together. Gaps are filled by searches that start between neighbors. Finally the front is tested on independent
# encounters; those that are better than the front become further starting points.
def find_front(trials: Trials) -> FoundFront:
    """Find the Pareto front over all free parameters, in connected pieces; empty if nothing is feasible."""
    grid = trials.freedom.lattice(_GAINS)
    grid_values = trials.values(grid)
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
    """The points of the front during the search; none dominates another."""

    def __init__(self, trials: Trials, extent: FloatArray) -> None:
        self.trials = trials
        self.extent = extent
        self.at = np.empty((0, trials.freedom.size))
        self.values = np.empty((0, len(extent)))

    def add(self, at: FloatArray | None) -> None:
        """Add a point unless it is dominated, and remove points that it dominates."""
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
        """Search from a start along the ray through a point in quantities; if it fails, add the start itself."""
        point = advance(self.trials, start, origin, self.extent)
        self.add(start if point is None else point[0])

    def fill(self) -> None:
        """Search between neighbors that lie far apart; only with two quantities, which order the points."""
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
        """Return quantities of encounters that searches find between the points of the front."""
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
                values.append(self.trials.values(point[0][None]))
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
        return np.concatenate([values, *(self.trials.values(point[0][None]) for point in moved if point is not None)])

    def _missed(self, values: FloatArray) -> FloatArray:
        return shortfall(values / self.extent, self.values / self.extent)

    def pieces(self) -> IntArray:
        """Return the index of the connected piece of each point: pieces are separated by gaps that no search fills."""
        if self.values.shape[1] != 2:
            return np.zeros(len(self.values), dtype=np.int64)
        gap = (np.abs(np.diff(self.values, axis=0)) / self.extent).max(axis=1)
        return np.concatenate([[0], np.cumsum(gap > _GAP * _SPACING)]).astype(np.int64)


def _spread(points: FloatArray, count: int) -> list[int]:
    """Choose points far apart: first the one with the lowest sum, then always the farthest from those before."""
    chosen = [int(points.sum(axis=1).argmin())]
    apart = np.abs(points - points[chosen[0]]).max(axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, np.abs(points - points[chosen[-1]]).max(axis=1))
    return chosen
