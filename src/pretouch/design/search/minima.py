"""Extrema: refined minima, certified maximum on a box.

The largest value of a smooth function on a box, and why none is larger: branch and bound by gradients. Each box is
looked at in its middle and its corners. How much the gradient differs there, half as much again, is taken for how much
it differs anywhere in the box: the one assumption, which holds better the smaller the box. Then

- a coordinate in which the gradient keeps its sign is put at its better end, and the box loses a dimension;
- a box whose value in the middle, plus what gradient and its change can add, stays below the best value is dropped;
- what is left is halved where the gradient changes most.

A function that is monotone in every coordinate is settled by one box, exactly: at a corner.
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
_FIT: Final = 1e-7  # of the range of values: how well a polynomial must meet the nodes
_LOOP_ROUNDING: Final = 1e-12  # of an objective: what the sums of some hundred steps of a loop leave in it
_ROUNDED: Final = 1e-5  # of the range of values, at most: a corner leaves a hundred times what rounding does
_NARROWEST: Final = 1e-9  # an interval in which a polynomial says more than rounding
_WIDEST: Final = 0.1  # of u, that a polynomial may span
_SMOOTH: Final = chebyshev_basis(_COUNT, 8)  # few terms, for a derivative without the rounding of the nodes
_TO_MISS: Final = (_SMOOTH.values @ _SMOOTH.to_terms - np.eye(_COUNT)).T
_ENDS: Final = np.concatenate([[1.0], _SMOOTH.nodes, [-1.0]])
_ORDERS: Final = np.arange(8.0)[:, None]
_THROUGH: Final = chebyshev_basis(_COUNT)  # all, for the value
NODES: Final = _SMOOTH.nodes
"""Where a bracket is sampled for its polynomial, on [-1, 1]."""

OnAxis: TypeAlias = Callable[[FloatArray], FloatArray]
"""From coordinates to values; infinite where the function does not exist."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Minimum(Value):
    """A local minimum that was found and refined.

    Args:
        coordinate: its u.
        value: the function there.
        bracket: the scanned u on its two sides.
        edge: whether the function is not smooth there: it ends (an edge of feasibility or of the axis), or has a
            corner or a jump.
    """

    coordinate: float
    value: float
    bracket: tuple[float, float]
    edge: bool


def search_axis(evaluate: Evaluate, low: float, high: float, effort: Effort = EXACT) -> tuple[Scan, list[Minimum]]:
    """Scan an axis and refine the minima of the merit: global as far as the scan resolves the function.

    Args:
        evaluate: from coordinates to a Landscape.
        low: start of the axis.
        high: its end.
        effort: how hard to try.

    Returns:
        The scan, and the feasible minima, best first.
    """
    found = scan(evaluate, low, high, effort)
    return found, refine(lambda u: evaluate(u).merit, found.coordinate, found.landscape.merit, effort)


def refine(function: OnAxis, u: FloatArray, values: FloatArray, effort: Effort = EXACT) -> list[Minimum]:
    """Refine the local minima of a scanned function.

    Args:
        function: from coordinates to values; infinite where the function does not exist.
        u: the scanned coordinates, ascending.
        values: the function there.
        effort: how hard to try.

    Returns:
        The minima, best first, those that were not refined as they were scanned; empty where the function exists
        nowhere. None is above what was scanned.
    """
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = np.flatnonzero(np.isfinite(values) & (values <= padded[:-2]) & (values < padded[2:]))
    minima = []
    for rank, i in enumerate(map(int, lowest[np.argsort(values[lowest], kind="stable")])):
        left, right = float(u[max(i - 1, 0)]), float(u[min(i + 1, len(u) - 1)])
        at, value, edge = float(u[i]), float(values[i]), True
        if rank < effort.most and value <= effort.counts(float(values[lowest].min())):
            found = _zoom(function, left, right, effort)
            if found[1] <= value or not found[2]:
                at, value, edge = found
        minima.append(Minimum(coordinate=at, value=value, bracket=(left, right), edge=edge))
    return sorted(minima, key=lambda m: m.value)


def _zoom(function: OnAxis, low: float, high: float, effort: Effort) -> tuple[float, float, bool]:
    """Narrow a bracket around its lowest value; where the function is smooth there, polish by a polynomial."""
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
    """Minimize the interpolating polynomial over a narrow bracket; None where the function has a corner there."""
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
    """Return minima in [-1, 1] of functions known at NODES, shape (m, 17), by polynomials, and which are certain."""
    # Newton's steps for df/dz = 0 between the neighbors of the lowest node, and halving where they leave these: at
    # minima flatter than a parabola; a polynomial must meet the values to `fit` of their range
    lowest = np.argmin(values, axis=1)
    z, low, high = NODES[lowest], _ENDS[lowest + 2], _ENDS[lowest]
    settled: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
    values = np.where(settled[:, None], values, 0.0)
    values = values - values.min(axis=1, keepdims=True)  # exact, and what is left keeps the digits of sums
    allowed = fit * np.ptp(values, axis=1)
    settled &= np.abs(values @ _TO_MISS).max(axis=1) <= allowed
    if not settled.any():
        return z, settled
    terms, slopes, bends = (to @ values.T for to in (_SMOOTH.to_terms, _SMOOTH.to_slope, _SMOOTH.to_bend))
    first = chebyshev_sum(terms, z)
    with np.errstate(all="ignore"):
        for _ in range(steps):
            powers = np.cos(_ORDERS * np.arccos(z))  # the polynomials themselves
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
    """Return what functions known at NODES, shape (m, 17), are at one place each, by polynomials through all nodes."""
    with np.errstate(invalid="ignore"):  # a function that does not exist at some node is NaN
        return chebyshev_sum(_THROUGH.to_terms @ values.T, z)


_BEYOND: Final = 0.5  # of the observed change of a gradient: what is added to it on either side
_MOST: Final = 200_000  # boxes
_AT_ONCE: Final = 4096
_NOISE: Final = 1e-9  # of the largest value: what a gradient times the width of a box must exceed to have a sign

Function: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From points, shape (n, d), to values, shape (n,), and gradients, shape (n, d)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedMaximum:
    """The largest value on a box; where the function is infinite somewhere, that."""

    point: FloatArray  # where it is taken, shape (d,)
    value: float
    bound: float  # what no point exceeds
    boxes: int  # how many boxes were looked at
    signs: tuple[int, ...]  # 1 or -1 for each coordinate in which the function grows or falls all over the box, else 0


def maximize_on_box(function: Function, low: FloatArray, high: FloatArray, *, tolerance: float) -> CertifiedMaximum:
    """Find the largest value of a function between two corners; the bound comes as close as the relative tolerance."""
    d = len(low)
    upper = np.array(list(product((False, True), repeat=d))).reshape(-1, d)
    waiting = [(low[None].astype(np.float64), high[None].astype(np.float64))]
    best, where, boxes = -np.inf, low, 0
    whole: tuple[int, ...] = (0,) * d
    bound = -np.inf  # of what was dropped
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
        settled = (grows | falls | flat).all(axis=1)  # the best corner is one of those that were looked at
        reach = values[:, 0] + ((np.abs(slopes[:, 0]) + 0.5 * (1 + _BEYOND) * change) * half).sum(axis=1)
        over = ~settled & (reach > best + tolerance * abs(best))
        bound = max(bound, float(reach[~settled & ~over].max(initial=-np.inf)))
        if over.any():
            lows, highs = np.where(grows, highs, lows)[over], np.where(falls, lows, highs)[over]
            waiting.append(_halved(lows, highs, change[over], (grows | falls)[over]))
    left = np.inf if waiting else -np.inf
    return CertifiedMaximum(point=where, value=best, bound=max(best, bound, left), boxes=boxes, signs=whole)


def _range_of(slopes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return bounds of the gradients in boxes, and how much they change, from those at middles and corners."""
    change = np.abs(slopes[:, 1:] - slopes[:, :1]).max(axis=1)
    beyond = _BEYOND * change
    return slopes.min(axis=1) - beyond, slopes.max(axis=1) + beyond, change


def _halved(
    lows: FloatArray, highs: FloatArray, change: FloatArray, collapsed: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Halve boxes in the coordinate that changes most; those that have lost a dimension are looked at again first."""
    width = highs - lows
    axis = np.argmax(change * width, axis=1)
    rows = np.arange(len(lows))
    middle = 0.5 * (lows + highs)[rows, axis]
    again = collapsed.any(axis=1) | (width[rows, axis] == 0)
    upper_of_first, lower_of_second = highs.copy(), lows.copy()
    upper_of_first[rows, axis] = np.where(again, highs[rows, axis], middle)
    lower_of_second[rows, axis] = middle
    return np.concatenate([lows, lower_of_second[~again]]), np.concatenate([upper_of_first, highs[~again]])
