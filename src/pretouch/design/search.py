"""Global search over one gain: a scan that refines itself until it resolves the curve, then a zoom per minimum."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value

__all__ = ["HELD", "LARGEST_SCAN", "RESOLVED", "SCANNED", "GainAxis", "Landscape", "Minimum", "Scan", "refine", "scan"]

HELD = 1 - 1e-11
"""Of a limit: so that the encounter at the chosen gain, solved again, holds it, too."""

SCANNED = 65
"""How many gains a scan begins with."""

LARGEST_SCAN = 2049
"""How many gains a scan ends with at most, where a function with jumps never lets neighbors predict each other."""

RESOLVED = 1e-3
"""The error of predicting an objective from its neighbors, of itself, from which a scan goes on."""

_ROUNDING = 16 * np.finfo(np.float64).eps  # of u: its inverse function is good to 4 units by whichever processor
_ZOOM = 17
_MOST = 16  # local minima that are refined, the lowest ones: a smooth function has a few, one with jumps has hundreds
_LEVEL = 1e-14  # of the values: a coefficient of the polynomial that is nothing
_LOOP_ROUNDING = 1e-12  # of an objective: what the sums of some hundred steps of a loop leave in it
_FINEST = 1e-14  # of u: rounding
_JUMP = 1e-6  # of the axis: what an interval so narrow does not predict, jumps
_NARROWEST = 1e-9  # an interval in which a polynomial says more than rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class GainAxis:
    """The coordinate u = asinh(D_p / s) in which gains are searched: logarithmic far from zero, linear through it.

    Args:
        low: lower bound of the gain [N s].
        high: upper bound of the gain [N s].
    """

    low: float
    high: float

    @property
    def scale(self) -> float:
        """The gain s [N s] around which the axis goes over from linear to logarithmic."""
        small, large = sorted((abs(self.low), abs(self.high)))
        return small if self.low * self.high > 0 else 1e-3 * large

    @property
    def ends(self) -> tuple[float, float]:
        """Both bounds [N s], the lower one first."""
        return self.low, self.high

    def coordinate(self, gain: FloatArray | float) -> FloatArray:
        """Return u of a gain [N s]."""
        return np.asarray(np.arcsinh(np.asarray(gain) / self.scale))

    def gain(self, coordinate: FloatArray | float) -> FloatArray:
        """Return the gain [N s] at u: a bound itself where u is that bound's to rounding, never one outside."""
        gain = np.clip(self.scale * np.sinh(coordinate), self.low, self.high)
        for bound, end in zip(self.ends, self.coordinate(np.array(self.ends)), strict=True):
            gain = np.where(np.abs(coordinate - end) <= _ROUNDING * max(1.0, abs(end)), bound, gain)
        return gain

    def stretch(self, gain: float) -> float:
        """Return d D_p / du [N s] at a gain."""
        return math.hypot(gain, self.scale)


@dataclass(frozen=True, slots=True, kw_only=True)
class Landscape(Value):
    """What a set of gains leads to.

    Args:
        objective: the objective; infinite where there is no contact.
        ratios: |quantity| / limit of each constraint, shape (constraints, n); infinite where there is no contact.
    """

    objective: FloatArray
    ratios: FloatArray

    @property
    def reached(self) -> BoolArray:
        """Where the encounter ends in contact."""
        return np.isfinite(self.objective)

    @property
    def worst_ratio(self) -> FloatArray:
        """The largest ratio of any constraint; 0 where there is none."""
        worst = self.ratios.max(axis=0) if len(self.ratios) else np.zeros_like(self.objective)
        return np.where(self.reached, worst, np.inf)

    @property
    def feasible(self) -> BoolArray:
        """Where the encounter ends in contact and every constraint holds."""
        return self.reached & (self.worst_ratio <= HELD)

    @property
    def merit(self) -> FloatArray:
        """The objective where feasible, infinite elsewhere."""
        return np.where(self.feasible, self.objective, np.inf)


Evaluate = Callable[[FloatArray], Landscape]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan(Value):
    """A scan of the whole axis.

    Args:
        coordinate: u, ascending, shape (n,).
        landscape: what each gain leads to.
        resolution: largest error of predicting an objective from its neighbors, relative to the objective.
    """

    coordinate: FloatArray
    landscape: Landscape
    resolution: float


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


def scan(
    evaluate: Evaluate,
    low: float,
    high: float,
    *,
    resolved: float = RESOLVED,
    largest: int = LARGEST_SCAN,
    relevant: float = math.inf,
) -> Scan:
    """Scan an axis and halve its intervals until neighbors predict each other.

    An interval is halved while the cubic through four neighbors misses the objective in its middle by more than
    `resolved`, or while feasibility changes over it and it is wider than 1e-3 of the axis. At a jump that ends where it
    is narrower than 1e-6 of the axis; where there are many jumps, when there are as many gains as may be.

    Args:
        evaluate: from coordinates to a Landscape.
        low: start of the axis.
        high: its end.
        resolved: the error of predicting an objective from its neighbors, of itself, from which the scan goes on.
        largest: how many coordinates to end with at most.
        relevant: times the lowest objective: where it is higher on both sides, an interval is not halved for it.

    Returns:
        The scan.
    """
    u = np.linspace(low, high, SCANNED)
    found = evaluate(u)
    doubtful = np.ones(SCANNED - 1, dtype=bool)
    resolution = np.inf
    while doubtful.any() and len(u) + int(doubtful.sum()) <= largest:
        middle = 0.5 * (u[:-1] + u[1:])[doubtful]
        new = evaluate(middle)
        predicted = _predict(u, found.objective, np.flatnonzero(doubtful).astype(np.int64))
        with np.errstate(invalid="ignore"):
            error = np.abs(predicted - new.objective) / np.abs(new.objective)
        error = np.where(np.isfinite(error), error, 0.0)
        resolution = float(error.max(initial=0.0))
        lower_ends = np.minimum(found.objective[:-1], found.objective[1:])[doubtful]
        rough = (error > resolved) & (lower_ends <= _times(relevant, float(found.merit.min())))
        order = np.argsort(np.concatenate([u, middle]), kind="stable")
        u = np.concatenate([u, middle])[order]
        found = Landscape(
            objective=np.concatenate([found.objective, new.objective])[order],
            ratios=np.concatenate([found.ratios, new.ratios], axis=1)[:, order],
        )
        marks = np.concatenate([np.zeros(len(u) - len(middle), dtype=bool), rough])[order]
        apart = np.diff(u)
        changes = (found.feasible[1:] != found.feasible[:-1]) | (found.reached[1:] != found.reached[:-1])
        doubtful = (marks[:-1] | marks[1:]) & (apart > _JUMP * (high - low)) | changes & (apart > 1e-3 * (high - low))
    return Scan(coordinate=u, landscape=found, resolution=resolution)


def _times(relevant: float, lowest: float) -> float:
    """Return up to where values matter; everywhere, for an infinite factor of whatever is lowest."""
    return math.inf if math.isinf(relevant) else relevant * lowest


def _predict(u: FloatArray, f: FloatArray, intervals: IntArray) -> FloatArray:
    """Predict f in the middle of intervals by the cubic through the four nodes nearest to each."""
    first = np.clip(intervals - 1, 0, len(u) - 4)
    nodes = first[:, None] + np.arange(4)
    x, y = u[nodes], f[nodes]
    at = 0.5 * (u[intervals] + u[intervals + 1])
    total = np.zeros(len(at))
    for i in range(4):
        weight = np.ones(len(at))
        for j in range(4):
            if j != i:
                weight = weight * (at - x[:, j]) / (x[:, i] - x[:, j])
        with np.errstate(invalid="ignore"):
            total = total + weight * y[:, i]
    return total


def refine(
    function: Callable[[FloatArray], FloatArray],
    u: FloatArray,
    values: FloatArray,
    *,
    most: int = _MOST,
    finest: float = _FINEST,
    relevant: float = math.inf,
) -> list[Minimum]:
    """Refine the local minima of a scanned function.

    Args:
        function: from coordinates to values; infinite where the function does not exist.
        u: the scanned coordinates, ascending.
        values: the function there.
        most: how many are refined, the lowest first; the others are returned as they were scanned.
        finest: of u, where narrowing ends if the function is not smooth.
        relevant: times the lowest value: minima above it are not refined.

    Returns:
        The minima, best first; empty where the function exists nowhere. None is above what was scanned.
    """
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = np.flatnonzero(np.isfinite(values) & (values <= padded[:-2]) & (values < padded[2:]))
    minima = []
    for rank, i in enumerate(map(int, lowest[np.argsort(values[lowest], kind="stable")])):
        left, right = float(u[max(i - 1, 0)]), float(u[min(i + 1, len(u) - 1)])
        at, value, edge = float(u[i]), float(values[i]), True
        if rank < most and values[i] <= _times(relevant, float(values[lowest].min())):
            found = _zoom(function, left, right, finest)
            if found[1] <= value or not found[2]:
                at, value, edge = found
        minima.append(Minimum(coordinate=at, value=value, bracket=(left, right), edge=edge))
    return sorted(minima, key=lambda m: m.value)


def _zoom(
    function: Callable[[FloatArray], FloatArray], low: float, high: float, finest: float
) -> tuple[float, float, bool]:
    """Narrow a bracket around its lowest value; where the function is smooth there, polish by a polynomial."""
    left, right = low, high
    best = (low, math.inf)
    for _ in range(24):
        u = np.linspace(left, right, _ZOOM)
        values = function(u)
        i = int(np.argmin(values))
        if values[i] <= best[1]:
            best = float(u[i]), float(values[i])
        at_end = u[i] in {low, high}
        if np.isfinite(values).all() and _NARROWEST * max(1.0, abs(left)) < right - left < 0.1:
            polished = None if at_end else _polish(function, left, right)
            if polished is not None:
                return *polished, False
            if at_end and right - left < 1e-3 * (high - low):
                break
        left, right = float(u[max(i - 1, 0)]), float(u[min(i + 1, _ZOOM - 1)])
        if right - left < finest * max(1.0, abs(left)):
            break
    return *best, True


def _polish(function: Callable[[FloatArray], FloatArray], left: float, right: float) -> tuple[float, float] | None:
    """Minimize the interpolating polynomial over a narrow bracket; None where the function has a corner there."""
    nodes = np.cos((np.arange(_ZOOM) + 0.5) * np.pi / _ZOOM)
    u = 0.5 * (left + right) + 0.5 * (right - left) * nodes
    values = function(u)
    span = float(np.ptp(values))
    if not 0 < span < np.inf:
        return None
    shares = (values - values.min()) / span
    fit = np.polynomial.Chebyshev.fit(u, shares, 8, domain=[left, right])
    rounding = min(_LOOP_ROUNDING * float(np.abs(values).max()) / span, 1e-5)  # a corner leaves a hundred times that
    if np.abs(fit(u) - shares).max() > max(1e-7, rounding):
        return None
    roots = fit.deriv().trim(_LEVEL).roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    inside = real[(real >= left) & (real <= right)]
    if not len(inside):
        return None
    values = function(inside)
    best = int(np.argmin(values))
    return float(inside[best]), float(values[best])
