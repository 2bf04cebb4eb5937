"""Solve many small nonlinear least-squares problems at once, by the Levenberg-Marquardt method.

A calibration needs hundreds of fits of three or four parameters: one for each possible offset, each distance left out,
each possible start of the window, and each end of an interval. A general solver spends a thousand times more time on
overhead than on the arithmetic of such a fit. Vectorized over all problems, this overhead is spent only once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

Residuals: TypeAlias = Callable[[FloatArray, IntArray], FloatArray]
"""From parameters, shape (b, p), and the numbers of their problems, shape (b,), to residuals, shape (b, n)."""

_STEP: Final = 1e-6  # of a parameter, for differences
_DOUBLINGS: Final = 5  # a profile that has not risen at 60 times the width of the linear interval has no end
_ATTEMPTS: Final = 12
_STIFFEST: Final = 1e12
_HUGE: Final = 1e150  # a residual that is no number counts as this


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fits:
    """Minima of many problems: parameters x, shape (b, p), the residuals there, (b, n), and their squares' sums, (b,).

    The jacobian has their derivatives by the parameters, shape (b, n, p), zero for a parameter at its bound.
    """

    x: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    costs: FloatArray

    @property
    def covariances(self) -> FloatArray:
        """Covariances of the parameters at unit variance of the residuals, shape (b, p, p).

        Large, not infinite, where singular; zero for what is held at a bound.
        """
        _, s, vt = np.linalg.svd(self.jacobian, full_matrices=False)
        s = np.maximum(s, np.maximum(1e-12 * s[:, :1], 1e-60))
        free = (self.jacobian != 0).any(axis=1)
        found = np.einsum("bki,bk,bkj->bij", vt, 1 / s**2, vt)
        return np.asarray(np.where(free[:, :, None] & free[:, None, :], found, 0.0))


def minimize_many(
    residuals: Residuals,
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    *,
    tolerance: float = 1e-10,
    most: int = 60,
) -> Fits:
    """Minimize the sums of squares of many problems within bounds, (p,) or (b, p), each from a row of `start`."""
    # A problem is done where its cost changes by less than `tolerance` of itself, or its parameters by less than that;
    # all are after `most` steps. A start is moved inside the bounds.
    low, high = (np.broadcast_to(b, start.shape) for b in bounds)
    x = np.clip(start, low, high)
    if not len(x):
        return Fits(x=x, residuals=np.empty((0, 0)), jacobian=np.empty((0, 0, x.shape[1])), costs=np.empty(0))
    every = np.arange(len(x))
    value = _finite(residuals(x, every))
    cost = np.einsum("bn,bn->b", value, value)
    slope = _derivative(residuals, x, value, every, high)
    damping, open_ones = np.full(len(x), 1e-3), every
    for _ in range(most):
        if not len(open_ones):
            break
        at, here = x[open_ones], slope[open_ones]
        step = _step(at, here, value[open_ones], damping[open_ones], (low[open_ones], high[open_ones]))
        tried = np.clip(at + step, low[open_ones], high[open_ones])
        found = _finite(residuals(tried, open_ones))
        price = np.einsum("bn,bn->b", found, found)
        better = price < cost[open_ones]
        moved = np.abs(tried - at).max(axis=1)
        little = (np.abs(cost[open_ones] - price) <= tolerance * cost[open_ones]) & (moved < 1e-3)
        little |= moved <= tolerance
        damping[open_ones] = np.where(better, np.maximum(0.2 * damping[open_ones], 1e-9), 8 * damping[open_ones])
        gained = open_ones[better]
        x[gained], value[gained], cost[gained] = tried[better], found[better], price[better]
        if len(gained):
            slope[gained] = _derivative(residuals, x[gained], value[gained], gained, high[gained])
        open_ones = open_ones[~little & (damping[open_ones] < _STIFFEST)]
    held = _held(x, np.einsum("bnp,bn->bp", slope, value), low, high)
    return Fits(x=x, residuals=value, jacobian=np.where(held[:, None, :], 0.0, slope), costs=cost)


def _finite(values: FloatArray) -> FloatArray:
    return np.where(np.isfinite(values), np.clip(values, -_HUGE, _HUGE), _HUGE)


def _held(x: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Tell which parameters are at a bound that the cost pushes them against."""
    return np.asarray(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))


def _derivative(
    residuals: Residuals, x: FloatArray, value: FloatArray, which: IntArray, high: FloatArray
) -> FloatArray:
    """Differentiate by forward differences; backward ones at the upper bound."""
    count, size = x.shape
    moved = np.repeat(x[:, None, :], size, axis=1)
    step = _STEP * np.maximum(1.0, np.abs(x))
    step = np.where(x + step > high, -step, step)
    moved[:, np.arange(size), np.arange(size)] += step
    found = _finite(residuals(moved.reshape(count * size, size), np.repeat(which, size)))
    rows = (found.reshape(count, size, -1) - value[:, None, :]) / step[:, :, None]
    return np.asarray(np.swapaxes(rows, 1, 2))


def _step(
    x: FloatArray, slope: FloatArray, value: FloatArray, damping: FloatArray, bounds: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Solve the damped normal equations without parameters that a bound holds; no step where they overflow."""
    with np.errstate(all="ignore"):
        found = _newton_step(x, slope, value, damping, bounds)
    return np.where(np.isfinite(found), found, 0.0)


def _newton_step(
    x: FloatArray, slope: FloatArray, value: FloatArray, damping: FloatArray, bounds: tuple[FloatArray, FloatArray]
) -> FloatArray:
    size = x.shape[1]
    gradient = np.einsum("bnp,bn->bp", slope, value)
    square = np.einsum("bnp,bnq->bpq", slope, slope)
    diagonal = np.maximum(np.einsum("bpp->bp", square), 1e-30)
    held = _held(x, gradient, *bounds)
    free = ~held
    square = np.where(free[:, :, None] & free[:, None, :], square, 0.0)
    square[:, np.arange(size), np.arange(size)] += np.where(free, damping[:, None] * diagonal, 1.0)
    scale = 1 / np.sqrt(np.einsum("bpp->bp", square))
    scaled = square * scale[:, :, None] * scale[:, None, :]
    return np.asarray(np.linalg.solve(scaled, (-gradient * free * scale)[:, :, None])[:, :, 0] * scale)


def gradient(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Differentiate a vector function of parameters, shape (p,), by central differences, shape (outputs, p)."""
    columns = []
    for i, value in enumerate(x):
        step = 1e-6 * max(1.0, abs(float(value)))
        shift = np.zeros_like(x)
        shift[i] = step
        columns.append((function(x + shift) - function(x - shift)) / (2 * step))
    return np.stack(columns, axis=-1)


def intervals(
    residuals: Residuals,
    best: Fits,
    bounds: tuple[FloatArray, FloatArray],
    coordinates: Callable[[FloatArray], FloatArray],
    rise: float,
) -> list[tuple[float, float, bool, bool]]:
    """Find where the profiles of some coordinates have risen by `rise` above the minimum, all ends side by side."""
    # The sum of squares plus a stiff spring that pulls a coordinate to a target is minimized over all parameters: its
    # minimum lies on the profile exactly, at the coordinate where it ends up, so no form of the model in which that
    # coordinate is a parameter is needed. Steps are doubled until the profile has risen enough, then secants close in.
    # The residuals are those of one problem, whose number is 0, `best` is its minimum, and coordinates go from (b, p)
    # to (b, c). For each, its lower and upper end follow, and whether each was reached; where not, the end is the last
    # value that the bounds let the coordinate take.
    center = coordinates(best.x)[0]
    slope = gradient(lambda u: coordinates(u[None])[0], best.x[0])
    scale = np.sqrt(np.maximum(rise * np.einsum("cp,pq,cq->c", slope, best.covariances[0], slope), 1e-300))
    lanes = [_End(i, sign * float(scale[i]), float(center[i])) for i in range(len(center)) for sign in (-1.0, 1.0)]
    stiffness = np.array([100 * np.sqrt(rise) / abs(lane.step) for lane in lanes])  # it gives way by 1e-4 of the step
    ahead = np.array([best.covariances[0] @ slope[lane.which] * rise / lane.step**2 for lane in lanes])
    which = np.array([lane.which for lane in lanes])
    x = np.repeat(best.x, len(lanes), axis=0)
    for _ in range(_ATTEMPTS):
        open_ones = np.array([i for i, lane in enumerate(lanes) if lane.end is None], dtype=np.int64)
        if not len(open_ones):
            break
        goals = np.array([lanes[i].target for i in open_ones])

        def pulled(u: FloatArray, number: IntArray, lane: IntArray = open_ones, goal: FloatArray = goals) -> FloatArray:
            at = coordinates(u)[np.arange(len(u)), which[lane[number]]]
            spring = stiffness[lane[number]] * (at - goal[number])
            return np.column_stack([residuals(u, np.zeros(len(u), dtype=np.int64)), spring])

        here = coordinates(x[open_ones])[np.arange(len(open_ones)), which[open_ones]]
        start = np.clip(x[open_ones] + ahead[open_ones] * (goals - here)[:, None], *bounds)
        costs = [np.sum(_finite(pulled(u, np.arange(len(u)))) ** 2, axis=1) for u in (x[open_ones], start)]
        found = minimize_many(
            pulled, np.where((costs[1] < costs[0])[:, None], start, x[open_ones]), bounds, tolerance=1e-7
        )
        values = coordinates(found.x)[np.arange(len(open_ones)), which[open_ones]]
        height = np.sqrt(np.maximum(np.sum(found.residuals[:, :-1] ** 2, axis=1) - best.costs[0], 0.0) / rise)
        for i, value, level, at in zip(open_ones, values, height, found.x, strict=True):
            if lanes[i].take(float(value), float(level)):
                x[i] = at
    ends = [lane.found() for lane in lanes]
    return [(a[0], b[0], a[1], b[1]) for a, b in zip(ends[::2], ends[1::2], strict=True)]


class _End:
    """The search for one end of an interval: where it is, and where to look next."""

    def __init__(self, which: int, step: float, center: float) -> None:
        self.which, self.step, self.target = which, step, center + step
        self.end: float | None = None
        self.reached = False
        self._inner, self._outer, self._attempt = (center, 0.0), (center, 0.0), 0

    def take(self, value: float, height: float) -> bool:
        """Take the root of the profile's rise, over that wanted, at a value; tell whether to go on from there."""
        further = height < 1
        if further and abs(value - self._inner[0]) < 0.05 * abs(self.target - self._inner[0]):
            self.end = value  # the bounds hold it back
            return False
        if further:
            self._inner = (value, height)
        else:
            self._outer = (value, height)
        if abs(height - 1) < 0.01:
            self.end, self.reached = value, True
        elif self._outer[1] > 0:
            share = (1 - self._inner[1]) / max(self._outer[1] - self._inner[1], 1e-300)
            self.target = self._inner[0] + float(np.clip(share, 0.05, 0.95)) * (self._outer[0] - self._inner[0])
        elif self._attempt == _DOUBLINGS:
            self.end = value
        else:
            self.target = value + self.step * 2.0**self._attempt
        self._attempt += 1
        return further

    def found(self) -> tuple[float, bool]:
        """Return the end, and whether it was reached; what was found so far where the attempts are used up."""
        if self.end is not None:
            return self.end, self.reached
        return (self._outer[0], True) if self._outer[1] > 0 else (self._inner[0], False)
