"""Compute the Pareto front of a design whose only free parameter is the gain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray

from ..search import Effort, Scan, refine, scan_feasible
from ..search.landscape import Evaluate
from .dominance import FoundFront, extent_of, non_dominated, shortfall

_EFFORT: Final = Effort(share=0.01)  # a quantity may pass through 0
_HALVINGS: Final = 44  # halvings of an interval until its ends are 1e-13 of the axis apart
_FINEST: Final = 12
_CURVE_SPACING: Final = 0.01  # distance between neighbors on the front, as a share of its extent


# The curve is scanned until it is well interpolated. The ends of the front's pieces are then found to rounding: the
# minima of the quantities, the edges of feasibility, and the points where another part of the curve becomes better.
def trace_front(landscape: Evaluate) -> FoundFront:
    """Find the Pareto front over one parameter, such as the gain.

    Args:
        landscape: returns quantities, shape (k, n), and constraint ratios at coordinates, shape (n,).

    Returns:
        The points, sorted by the first quantity, or for three quantities by the coordinate. Dominated coordinates
        separate the pieces. The front is empty if nothing is feasible.
    """

    def evaluate(at: FloatArray) -> FloatArray:
        return landscape(at).merit.T  # infinite if not feasible

    samples = _Samples(evaluate, scan_feasible(landscape, 0.0, 1.0, _EFFORT))
    for k in range(samples.values.shape[1]):
        lowest = refine(lambda u, k=k: evaluate(u)[:, k], samples.at, samples.values[:, k])  # type: ignore[misc]
        samples.add(np.array([m.coordinate for m in lowest]))
    if np.isfinite(samples.values).all(axis=1).any():
        samples.find_ends()
        samples.fill()
    best = non_dominated(samples.values)
    piece = np.cumsum(np.concatenate([[True], best[1:] & ~best[:-1]]))
    kept = np.flatnonzero(_thin_out(samples.values, best))
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
    """Evaluate more points between neighbors on the Pareto front."""
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
    """Evaluated points of a Pareto search, sorted by the parameter."""

    def __init__(self, evaluate: Callable[[FloatArray], FloatArray], scanned: Scan) -> None:
        self.evaluate = evaluate
        self.at, self.values = scanned.coordinate, scanned.landscape.merit.T

    def add(self, at: FloatArray) -> None:
        """Evaluate more points, and insert them in sorted order."""
        at = np.setdiff1d(at, self.at)
        if not len(at):
            return
        every = np.concatenate([self.at, at])
        order = np.argsort(every, kind="stable")
        self.values = np.concatenate([self.values, self.evaluate(at)])[order]
        self.at = every[order]

    def halve(self, which: BoolArray) -> bool:
        """Halve selected intervals of the free parameter.

        Returns:
            False if no interval is selected.
        """
        where = np.flatnonzero(which)
        self.add(0.5 * (self.at[where] + self.at[where + 1]))
        return len(where) > 0

    def find_ends(self) -> None:
        """Locate the ends of the Pareto front by bisection."""
        for _ in range(_HALVINGS):
            best = non_dominated(self.values)
            if not self.halve((best[1:] != best[:-1]) & (np.diff(self.at) > 1e-13)):
                return

    def fill(self) -> None:
        """Fill wide gaps of the Pareto front."""
        for _ in range(_FINEST):
            best = non_dominated(self.values)
            with np.errstate(invalid="ignore"):
                gaps = (np.abs(np.diff(self.values, axis=0)) / extent_of(self.values[best])).max(axis=1)
            if not self.halve(best[1:] & best[:-1] & (gaps > _CURVE_SPACING)):
                return


def _thin_out(values: FloatArray, best: BoolArray) -> BoolArray:
    """Remove Pareto points close to their neighbors."""
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
