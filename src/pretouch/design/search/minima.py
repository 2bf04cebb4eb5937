"""Refinement of the local minima of a scanned function.

@@BOX
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, chebyshev_basis, chebyshev_sum
from pretouch._core.values import Value

from .scan import EXACT, Effort, Evaluate, Scan, scan

_COUNT: Final = 17
_FIT: Final = 1e-7  # largest error of a polynomial at the nodes, relative to the range of values
_LOOP_ROUNDING: Final = 1e-12  # relative rounding error of an objective from some hundred steps of a loop
_ROUNDED: Final = 1e-5  # largest allowed error by rounding, relative to the range; a corner has 100 times that error
_NARROWEST: Final = 1e-9  # smallest interval in which a polynomial exceeds rounding
_WIDEST: Final = 0.1  # largest interval of u for a polynomial
_SMOOTH: Final = chebyshev_basis(_COUNT, 8)  # few terms, for a derivative with little rounding error
_TO_MISS: Final = (_SMOOTH.values @ _SMOOTH.to_terms - np.eye(_COUNT)).T
_ENDS: Final = np.concatenate([[1.0], _SMOOTH.nodes, [-1.0]])
_ORDERS: Final = np.arange(8.0)[:, None]
_THROUGH: Final = chebyshev_basis(_COUNT)  # all terms, for the value
NODES: Final = _SMOOTH.nodes
"""Nodes in [-1, 1] at which a bracket is sampled for its polynomial."""

OnAxis: TypeAlias = Callable[[FloatArray], FloatArray]
"""From coordinates to values; infinite where the function is undefined."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Minimum(Value):
    """A refined local minimum.

    Args:
        coordinate: its u.
        value: value of the function.
        bracket: the scanned u on its two sides.
        edge: whether the function is not smooth there: at an edge of feasibility, at an end of the axis, at a corner
            or at a jump.
    """

    coordinate: float
    value: float
    bracket: tuple[float, float]
    edge: bool


def search_axis(evaluate: Evaluate, low: float, high: float, effort: Effort = EXACT) -> tuple[Scan, list[Minimum]]:
    """Scan an axis and refine the minima of the merit; the search is global as far as the scan resolves the function.

    Args:
        evaluate: from coordinates to a Landscape.
        low: start of the axis.
        high: end of the axis.
        effort: settings of the search.

    Returns:
        The scan, and the feasible minima, best first.
    """
    scanned = scan(evaluate, low, high, effort)
    return scanned, refine(lambda u: evaluate(u).merit, scanned.coordinate, scanned.landscape.merit, effort)


def refine(function: OnAxis, u: FloatArray, values: FloatArray, effort: Effort = EXACT) -> list[Minimum]:
    """Refine the local minima of a scanned function.

    Args:
        function: from coordinates to values; infinite where the function is undefined.
        u: the scanned coordinates, ascending.
        values: values of the function.
        effort: settings of the search.

    Returns:
        The minima, best first; minima beyond `effort.most` keep their scanned values. Empty if the function is
        undefined everywhere. No value is above the scanned one.
    """
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = np.flatnonzero(np.isfinite(values) & (values <= padded[:-2]) & (values < padded[2:]))
    minima = []
    for rank, i in enumerate(map(int, lowest[np.argsort(values[lowest], kind="stable")])):
        left, right = float(u[max(i - 1, 0)]), float(u[min(i + 1, len(u) - 1)])
        at, value, edge = float(u[i]), float(values[i]), True
        if rank < effort.most and value <= effort.counts(float(values[lowest].min())):
            refined = _zoom(function, left, right, effort)
            if refined[1] <= value or not refined[2]:
                at, value, edge = refined
        minima.append(Minimum(coordinate=at, value=value, bracket=(left, right), edge=edge))
    return sorted(minima, key=lambda m: m.value)


def _zoom(function: OnAxis, low: float, high: float, effort: Effort) -> tuple[float, float, bool]:
    """Narrow a bracket around its lowest value; if the function is smooth, finish with a polynomial."""
    left, right = low, high
    best = (low, math.inf)
    for _ in range(24):
        u = np.linspace(left, right, _COUNT)
        values = function(u)
        i = int(np.argmin(values))
        if values[i] <= best[1]:
            best = float(u[i]), float(values[i])
        at_end = u[i] in {low, high}
        if effort.smooth and np.isfinite(values).all() and _NARROWEST * max(1.0, abs(left)) < right - left < _WIDEST:
            polished = None if at_end else _polish(function, left, right)
            if polished is not None:
                return *polished, False
            if at_end and right - left < 1e-3 * (high - low):
                break
        left, right = float(u[max(i - 1, 0)]), float(u[min(i + 1, _COUNT - 1)])
        if right - left < effort.finest * max(1.0, abs(left)):
            break
    return *best, True


def _polish(function: OnAxis, left: float, right: float) -> tuple[float, float] | None:
    """Minimize the fitted polynomial over a narrow bracket; None if the function has a corner in it."""
    middle, half = 0.5 * (left + right), 0.5 * (right - left)
    values = function(middle + half * NODES)
    span = float(np.ptp(values))
    if not 0 < span < np.inf:
        return None
    rounding = min(_LOOP_ROUNDING * float(np.abs(values).max()) / span, _ROUNDED)
    z, settled = minimize_polynomials(values[None], max(_FIT, rounding), steps=64)
    if not settled[0]:
        return None
    at = middle + half * float(z[0])
    return at, float(function(np.array([at]))[0])


def minimize_polynomials(values: FloatArray, fit: float = _FIT, *, steps: int = 8) -> tuple[FloatArray, BoolArray]:
    """Return minima in [-1, 1] of functions sampled at NODES, shape (m, 17), by polynomials, and which are certain."""
    # Newton's method solves df/dz = 0 between the neighbors of the lowest node. Bisection replaces steps that leave this
    # interval, as at minima flatter than a parabola. A polynomial must fit the values to `fit` of their range.
    lowest = np.argmin(values, axis=1)
    z, low, high = NODES[lowest], _ENDS[lowest + 2], _ENDS[lowest]
    settled: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
    values = np.where(settled[:, None], values, 0.0)
    values = values - values.min(axis=1, keepdims=True)  # exact, and it reduces the rounding error of the sums
    allowed = fit * np.ptp(values, axis=1)
    settled &= np.abs(values @ _TO_MISS).max(axis=1) <= allowed
    if not settled.any():
        return z, settled
    terms, slopes, bends = (to @ values.T for to in (_SMOOTH.to_terms, _SMOOTH.to_slope, _SMOOTH.to_bend))
    first = chebyshev_sum(terms, z)
    with np.errstate(all="ignore"):
        for _ in range(steps):
            powers = np.cos(_ORDERS * np.arccos(z))  # the Chebyshev polynomials at z
            slope = (slopes * powers).sum(axis=0)
            falls = slope < 0
            low, high = np.where(falls, z, low), np.where(falls, high, z)
            at = z - slope / (bends * powers[:-1]).sum(axis=0)
            at = np.where((at >= low) & (at <= high), at, 0.5 * (low + high))
            step, z = np.abs(at - z), at
            if (step < 1e-13).all():
                break
    return z, settled & (step < 1e-10) & (np.abs(z) < 1) & (chebyshev_sum(terms, z) <= first + allowed)


def interpolate(values: FloatArray, z: FloatArray) -> FloatArray:
    """Interpolate functions sampled at NODES, shape (m, 17), at one place each, by polynomials through all nodes."""
    with np.errstate(invalid="ignore"):  # a function that is undefined at some node is NaN
        return chebyshev_sum(_THROUGH.to_terms @ values.T, z)


_BEYOND: Final = 0.5  # the observed range of a gradient is extended by this share of its change on each side
_MOST: Final = 200_000  # largest number of boxes
_AT_ONCE: Final = 4096
_NOISE: Final = 1e-9  # a gradient times the box width must exceed this share of the largest value to have a sign

Function: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From points, shape (n, d), to values, shape (n,), and gradients, shape (n, d)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedMaximum:
    """The largest value of a function on a box, with an upper bound; infinite if the function is infinite somewhere."""

    point: FloatArray  # location of the maximum, shape (d,)
    value: float
    bound: float  # upper bound of the function on the box
    boxes: int  # number of boxes that were evaluated
    signs: tuple[int, ...]  # 1 or -1 for each coordinate in which the function grows or falls on the whole box, else 0


def maximize_on_box(function: Function, low: FloatArray, high: FloatArray, *, tolerance: float) -> CertifiedMaximum:
    """Find the largest value of a function between two corners, with an upper bound to the relative tolerance."""
    d = len(low)
    upper = np.array(list(product((False, True), repeat=d))).reshape(-1, d)
    waiting = [(low[None].astype(np.float64), high[None].astype(np.float64))]
    best, where, boxes = -np.inf, low, 0
    whole: tuple[int, ...] = (0,) * d
    bound = -np.inf  # upper bound of all dropped boxes
    while waiting and boxes < _MOST:
        lows, highs = waiting.pop()
        if len(lows) > _AT_ONCE:
            waiting.append((lows[_AT_ONCE:], highs[_AT_ONCE:]))
            lows, highs = lows[:_AT_ONCE], highs[:_AT_ONCE]
        middle, half = 0.5 * (lows + highs), 0.5 * (highs - lows)
        corners = np.where(upper, highs[:, None], lows[:, None])
        points = np.concatenate([middle[:, None], corners], axis=1)
        values, slopes = function(points.reshape(-1, d))
        values, slopes = values.reshape(points.shape[:2]), slopes.reshape(points.shape)
        at = np.unravel_index(np.argmax(values), values.shape)
        if values[at] > best:
            best, where = float(values[at]), points[at]
        if not np.isfinite(best) or not np.isfinite(slopes).all():
            return CertifiedMaximum(point=where, value=best, bound=np.inf, boxes=boxes + len(lows), signs=whole)
        least, most, change = _range_of(slopes)
        noise = _NOISE * abs(best)
        grows, falls = least * half > noise, most * half < -noise
        flat = half == 0
        if boxes == 0:
            whole = tuple(int(g) - int(f) for g, f in zip(grows[0], falls[0], strict=True))
        boxes += len(lows)
        settled = (grows | falls | flat).all(axis=1)  # the maximum is at a corner, which has been evaluated
        reach = values[:, 0] + ((np.abs(slopes[:, 0]) + 0.5 * (1 + _BEYOND) * change) * half).sum(axis=1)
        over = ~settled & (reach > best + tolerance * abs(best))
        bound = max(bound, float(reach[~settled & ~over].max(initial=-np.inf)))
        if over.any():
            lows, highs = np.where(grows, highs, lows)[over], np.where(falls, lows, highs)[over]
            waiting.append(_halved(lows, highs, change[over], (grows | falls)[over]))
    remaining = np.inf if waiting else -np.inf
    return CertifiedMaximum(point=where, value=best, bound=max(best, bound, remaining), boxes=boxes, signs=whole)


def _range_of(slopes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return estimated bounds of the gradients in boxes and their change, from middles and corners."""
    change = np.abs(slopes[:, 1:] - slopes[:, :1]).max(axis=1)
    beyond = _BEYOND * change
    return slopes.min(axis=1) - beyond, slopes.max(axis=1) + beyond, change


def _halved(
    lows: FloatArray, highs: FloatArray, change: FloatArray, collapsed: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Halve boxes in the coordinate that changes most; boxes that have just lost a dimension are kept whole."""
    width = highs - lows
    axis = np.argmax(change * width, axis=1)
    rows = np.arange(len(lows))
    middle = 0.5 * (lows + highs)[rows, axis]
    again = collapsed.any(axis=1) | (width[rows, axis] == 0)
    upper_of_first, lower_of_second = highs.copy(), lows.copy()
    upper_of_first[rows, axis] = np.where(again, highs[rows, axis], middle)
    lower_of_second[rows, axis] = middle
    return np.concatenate([lows, lower_of_second[~again]]), np.concatenate([upper_of_first, highs[~again]])
