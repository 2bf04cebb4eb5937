"""The local minima of a scanned function: each is zoomed in on and, where it is smooth, polished by a polynomial."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.chebyshev import chebyshev_basis, chebyshev_sum
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value

from .scan import EXACT, Effort, Evaluate, Scan, scan

__all__ = ["NODES", "Minimum", "interpolate", "minimize_polynomials", "refine", "search_axis"]

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
