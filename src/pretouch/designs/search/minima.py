"""Refine the local minima of a function that was evaluated on a grid."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .jumps import Jump, away_from, find_jump
from .landscape import HELD, Evaluate
from .polynomials import FIT, NODES, minimize_polynomials
from .scan import EXACT, Effort, Scan, scan

_LOOP_ROUNDING: Final = 1e-12  # relative rounding error of an objective from some hundred steps of a loop
_ROUNDED: Final = 1e-5  # largest allowed error by rounding, relative to the range; a corner has 100 times that error
_NARROWEST: Final = 1e-9  # smallest interval in which a polynomial exceeds rounding
_WIDEST: Final = 0.1  # largest interval of u for a polynomial

_EXACT: Final = 1e-9  # largest `finest` of a function without jumps, whose edges of feasibility are zeros
_STEPS: Final = 200  # largest number of steps to an edge
_MET: Final = 1e-12  # a ratio this close to its limit is at the edge
_FITTED: Final = 1 / 16  # half width of the part of a bracket that a polynomial fits, relative to the bracket
_ROUGH: Final = 0.05  # largest fourth difference, relative to the range, of values that a polynomial may fit

_MOST_JUMPS: Final = 8

OnAxis: TypeAlias = Callable[[FloatArray], FloatArray]
"""Function that maps coordinates to values; infinite where it is undefined."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Minimum(Value):
    """A refined local minimum of a function of one variable.

    Args:
        coordinate: the coordinate u of the minimum.
        value: value of the function.
        bracket: the scanned coordinates on both sides of the minimum.
        edge: whether the function is not smooth at the minimum: at an edge of feasibility, at an end of the axis, at a
            corner or at a jump.
        jump: the jump from which this minimum keeps a distance, and next to which a lower one lies; None without one.
    """

    coordinate: float
    value: float
    bracket: tuple[float, float]
    edge: bool
    jump: Jump | None = None


def search_axis(
    evaluate: Evaluate,
    low: float,
    high: float,
    effort: Effort = EXACT,
    start: Scan | None = None,
    *,
    reserve: Callable[[float], float] | None = None,
) -> tuple[Scan, list[Minimum]]:
    """Find the local minima of a function of one variable within its limits.

    Objective and constraints are evaluated at many values of the variable. The search is global if the scan resolves
    the function. If no scanned coordinate is feasible, the smallest violation is refined: to a feasible coordinate,
    around which the scan continues, or to its minimum, which then belongs to the scan.

    Args:
        evaluate: a function that maps coordinates to a Landscape.
        low: start of the axis.
        high: end of the axis.
        effort: settings of the search.
        start: a scan to continue; a new one by default.
        reserve: the distance from jumps that the best minimum keeps, as a function of its coordinate; none by default.

    Returns:
        The scan, and the feasible minima, best first.
    """
    scanned = scan_feasible(evaluate, low, high, effort, start)
    excess = (lambda u: evaluate(u).violation - HELD) if effort.finest <= _EXACT else None
    minima = refine(lambda u: evaluate(u).merit, scanned.coordinate, scanned.landscape.merit, effort, excess=excess)
    return scanned, minima if reserve is None else _keep_reserve(evaluate, scanned, minima, effort, reserve)


def _keep_reserve(
    evaluate: Evaluate, scanned: Scan, minima: list[Minimum], effort: Effort, reserve: Callable[[float], float]
) -> list[Minimum]:
    """Replace the best minimum by the best one that keeps a distance from all jumps.

    Returns:
        The minima, best first. The best one has the jump next to the lowest minimum; it is not avoided if nothing
        feasible keeps the distance.
    """
    first, jumps = minima, list[Jump]()
    ends = float(scanned.coordinate[0]), float(scanned.coordinate[-1])
    while minima and len(jumps) < _MOST_JUMPS:
        at = minima[0].coordinate
        jump = find_jump(evaluate, at, reserve(at), ends, effort.nodes)
        if jump is None:
            break
        jumps.append(jump)
        merit = away_from(evaluate, jumps)
        borders = [end for one in jumps for end in one.ends if ends[0] <= end <= ends[1]]
        u = np.union1d(scanned.coordinate, borders)
        minima = refine(merit, u, merit(u), effort)
    if not jumps:
        return minima
    if not minima:
        return [replace(first[0], jump=replace(jumps[0], avoided=False)), *first[1:]]
    return [replace(minima[0], jump=jumps[0]), *minima[1:]]


def scan_feasible(
    evaluate: Evaluate, low: float, high: float, effort: Effort = EXACT, start: Scan | None = None
) -> Scan:
    """Scan an axis, and refine the smallest violation if no scanned coordinate is feasible.

    Args:
        evaluate: a function that maps coordinates to a Landscape, whose objective may have several rows.
        low: start of the axis.
        high: end of the axis.
        effort: settings of the search.
        start: a scan to continue; a new one by default.

    Returns:
        The scan; it contains the coordinate with the smallest violation.
    """
    scanned = scan(evaluate, low, high, effort, start)
    if scanned.landscape.feasible.any() or scanned.least_violation is None:
        return scanned
    once = replace(effort, most=1)
    near = refine(lambda u: evaluate(u).violation, scanned.coordinate, scanned.landscape.violation, once, HELD)[0]
    scanned = _insert(scanned, near.coordinate, evaluate)
    return scan(evaluate, low, high, effort, scanned) if scanned.landscape.feasible.any() else scanned


def _insert(scanned: Scan, coordinate: float, evaluate: Evaluate) -> Scan:
    """Add a coordinate to a scan."""
    if coordinate in scanned.coordinate:
        return scanned
    u = np.append(scanned.coordinate, coordinate)
    order = np.argsort(u, kind="stable")
    more = evaluate(u[-1:])
    return replace(scanned, coordinate=u[order], landscape=scanned.landscape.joined(more, order))


def refine(
    function: OnAxis,
    u: FloatArray,
    values: FloatArray,
    effort: Effort = EXACT,
    enough: float = -math.inf,
    *,
    excess: OnAxis | None = None,
) -> list[Minimum]:
    """Refine the local minima of a function of one variable.

    Args:
        function: a function that maps coordinates to values; infinite where it is undefined.
        u: the scanned coordinates, ascending.
        values: values of the function.
        effort: settings of the search.
        enough: a value at which the refinement of a minimum ends.
        excess: a function that is positive where `function` is undefined; its zeros are the edges of the bracket.

    Returns:
        The minima, best first; minima beyond `effort.most` keep their scanned values. Empty if the function is
        undefined everywhere. No value is above the scanned one.
    """
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = np.flatnonzero(np.isfinite(values) & (values <= padded[:-2]) & (values < padded[2:]))
    minima = []
    for rank, i in enumerate(map(int, lowest[np.argsort(values[lowest], kind="stable")])):
        before, after = max(i - 1, 0), min(i + 1, len(u) - 1)
        at, value, edge = float(u[i]), float(values[i]), True
        if rank < effort.most and value <= effort.counts(float(values[lowest].min())):
            left, right = (
                float(u[k])
                if excess is None or np.isfinite(values[k])
                else _edge(excess, at, float(u[k]), effort.finest)
                for k in (before, after)
            )
            refined = _zoom(function, left, right, effort, enough)
            if refined[1] <= value or not refined[2]:
                at, value, edge = refined
        bracket = float(u[before]), float(u[after])
        minima.append(Minimum(coordinate=at, value=value, bracket=bracket, edge=edge))
    return sorted(minima, key=lambda m: m.value)


def _edge(excess: OnAxis, inside: float, outside: float, finest: float) -> float:
    """Return the last coordinate without excess between one without excess and another one.

    The secant method halves the value at an end that stays (Illinois); each third step is a bisection.
    """
    near, far = map(float, excess(np.array([inside, outside])))
    weights, last = [near, far], None
    for step in range(_STEPS):
        if near >= -_MET or abs(outside - inside) <= finest * max(1.0, abs(inside)):
            break
        secant = step % 3 < 2 and math.isfinite(weights[1])
        share = weights[0] / (weights[0] - weights[1]) if secant else 0.5
        at = inside + share * (outside - inside)
        value = float(excess(np.array([at]))[0])
        end = int(value > 0)
        weights[end] = value
        if end == last:
            weights[1 - end] *= 0.5
        last = end
        if end:
            outside = at
        else:
            inside, near = at, value
    return inside


def _zoom(function: OnAxis, low: float, high: float, effort: Effort, enough: float) -> tuple[float, float, bool]:
    """Narrow the bracket of a local minimum."""
    left, right = low, high
    best = (low, math.inf)
    for _ in range(24):
        u = np.linspace(left, right, effort.nodes)
        values = function(u)
        i = int(np.argmin(values))
        if values[i] <= best[1]:
            best = float(u[i]), float(values[i])
        if best[1] <= enough:
            break
        at_end = u[i] in {low, high}
        smooth = effort.smooth and bool(np.isfinite(values).all())
        if smooth and at_end and right - left < min(1e-3 * (high - low), _WIDEST):
            break
        half = _FITTED * (right - left)
        if smooth and not at_end and _NARROWEST * max(1.0, abs(left)) < 2 * half < _WIDEST and _is_smooth(values):
            middle = min(max(_bottom(u, values), low + half), high - half)
            polished = _polish(function, middle - half, middle + half)
            if polished is not None:
                return *polished, False
        left, right = float(u[max(i - 1, 0)]), float(u[min(i + 1, effort.nodes - 1)])
        if right - left < effort.finest * max(1.0, abs(left)):
            break
    return *best, True


def _is_smooth(values: FloatArray) -> bool:
    """Return True if a polynomial may fit equidistant values: their fourth differences are small."""
    return bool(np.abs(np.diff(values, n=4)).max() <= _ROUGH * np.ptp(values)) if len(values) > 4 else True


def _bottom(u: FloatArray, values: FloatArray) -> float:
    """Return the coordinate of the lowest point of the parabola through the lowest value and its neighbors."""
    i = min(max(int(np.argmin(values)), 1), len(u) - 2)
    step, bend = float(values[i + 1] - values[i - 1]), float(values[i - 1] - 2 * values[i] + values[i + 1])
    share = min(max(-0.5 * step / bend, -1.0), 1.0) if bend > 0 else 0.0
    return float(u[i] + share * (u[i + 1] - u[i]))


def _polish(function: OnAxis, left: float, right: float) -> tuple[float, float] | None:
    """Minimize a polynomial fitted over a narrow bracket."""
    middle, half = 0.5 * (left + right), 0.5 * (right - left)
    values = function(middle + half * NODES)
    span = float(np.ptp(values))
    if not 0 < span < np.inf:
        return None
    rounding = min(_LOOP_ROUNDING * float(np.abs(values).max()) / span, _ROUNDED)
    z, settled = minimize_polynomials(values[None], max(FIT, rounding), steps=64)
    if not settled[0]:
        return None
    at = middle + half * float(z[0])
    return at, float(function(np.array([at]))[0])
