"""Which of many points are worth choosing, along the curve of all gains and over all that is free."""

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

_FLAT: Final = 1e-12  # relative: a quantity that varies less along the front is the same everywhere


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundFront:
    """A front by coordinates, whichever way it was found."""

    at: FloatArray  # coordinates of its points, shape (n, size)
    values: FloatArray  # the quantities there, shape (n, k)
    piece: IntArray  # the number of the piece that each point belongs to, from 0 on
    scanned: FloatArray  # coordinates of everything that was tried side by side, shape (m, size)
    scanned_values: FloatArray  # the quantities there, infinite where not feasible
    missed: float  # the most by which its points miss an encounter, of its extent in every quantity at once

    @classmethod
    def of(
        cls,
        at: FloatArray,
        values: FloatArray,
        piece: Any,
        scanned: tuple[FloatArray, FloatArray],
        between: FloatArray,
    ) -> FoundFront:
        """Compare a front with what was tried, and with encounters between its points, whose quantities are given."""
        missed = np.inf
        if len(at):
            extent, others = extent_of(values), np.concatenate([scanned[1], between])
            missed = max(float(shortfall(others / extent, values / extent).max()), 0.0)
        numbers = np.asarray(piece, dtype=np.int64)
        return cls(at=at, values=values, piece=numbers, scanned=scanned[0], scanned_values=scanned[1], missed=missed)


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
    alike = np.diff(piece[kept]) == 0
    between = _between(evaluate, samples.at[kept], samples.values[kept], alike)
    known = samples.at[order, None], samples.values[order], numbers
    return FoundFront.of(*known, (samples.at[:, None], samples.values), between)


_PARTS: Final = 8  # of an interval, at whose ends the curve is compared with the points of the front
_WORST: Final = 16  # intervals, which are looked at more closely


def _between(
    evaluate: Callable[[FloatArray], FloatArray], at: FloatArray, values: FloatArray, alike: BoolArray
) -> FloatArray:
    """Return the quantities between neighbors of one piece, to 1/128 of where the points miss the curve by most."""
    low, high = at[:-1][alike], at[1:][alike]
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


_GAINS: Final = 49
_TESTS: Final = 2048  # encounters
_ROUNDS: Final = 3
_SPACING: Final = 0.03  # between neighbors of the front, of its extent; with three quantities, see _POINTS
_GAP: Final = 2.5  # times that: what neither points nor searches between them have closed
_POINTS: Final = {2: 40, 3: 90}
_MISSED: Final = 2e-3  # of the extent: a test encounter that the front misses by more is searched from
_NEIGHBORS: Final = 6  # of a point of a front of three quantities, between which the front is looked at
_MIXTURES: Final = 60  # of them
_MOVED: Final = 24  # of all mixtures, those that are missed most, are moved onto the front
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
        return FoundFront.of(grid[:0], grid_values[:0], [], (every, every_values), every_values[:0])
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
    return FoundFront.of(found.at, found.values, found.pieces(), (every, every_values), found.between())


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

    def between(self) -> FloatArray:
        """Return the quantities of encounters between neighbors that the front's points miss, as searches find them."""
        return self._between_two() if self.values.shape[1] == 2 else self._between_many()

    def _between_two(self) -> FloatArray:
        # The corner from which both neighbors lie equally far, each in the quantity that it has more of, is where the
        # least shift with which one of them dominates is largest: the ray through it meets the worst in between.
        bounds = (np.abs(np.diff(self.values, axis=0)) / self.extent).min(axis=1)
        found, most = [self.values[:0]], 0.0
        for i in np.argsort(bounds)[::-1]:
            if bounds[i] <= most:  # no encounter between these two is missed by more
                break
            start, corner = self.at[i : i + 2].mean(axis=0), self.values[i : i + 2].max(axis=0)
            if (one := advance(self.trials, start, corner, self.extent)) is not None:
                found.append(self.trials.values(one[0][None]))
                most = max(most, self._missed(found[-1])[0])
        return np.concatenate(found)

    def _between_many(self) -> FloatArray:
        # Mixtures of neighbors lie near the front; those that are missed most are moved onto it.
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
        return np.concatenate([values, *(self.trials.values(one[0][None]) for one in moved if one is not None)])

    def _missed(self, values: FloatArray) -> FloatArray:
        return shortfall(values / self.extent, self.values / self.extent)

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
