"""Global search over one gain: a scan that refines itself until it resolves the curve, then a zoom per minimum."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

__all__ = ["HELD", "RESOLVED", "SCANNED", "GainAxis", "Landscape", "Minimum", "Scan", "refine", "scan"]

HELD = 1 - 1e-11
"""Of a limit: so that the encounter at the chosen gain, solved again, holds it, too."""

SCANNED = 65
"""How many gains a scan begins with."""

_LARGEST = 2049
RESOLVED = 1e-3
"""The error of predicting an objective from its neighbors, of itself, from which a scan goes on."""

_ZOOM = 17
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
        for bound in (self.low, self.high):
            gain = np.where(np.abs(gain - bound) <= 1e-14 * abs(bound), bound, gain)
        return gain

    def stretch(self, gain: float) -> float:
        """Return d D_p / du [N s] at a gain."""
        return math.hypot(gain, self.scale)


@dataclass(frozen=True, slots=True, kw_only=True)
class Landscape:
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
class Scan:
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
class Minimum:
    """A local minimum that was found and refined.

    Args:
        coordinate: its u.
        value: the function there.
        bracket: the scanned u on its two sides.
        edge: whether it sits where the function ends (an edge of feasibility or of the axis).
    """

    coordinate: float
    value: float
    bracket: tuple[float, float]
    edge: bool


def scan(evaluate: Evaluate, low: float, high: float) -> Scan:
    """Scan an axis and halve its intervals until neighbors predict each other.

    An interval is halved while the cubic through four neighbors misses the objective in its middle by more than
    1e-3, or while feasibility changes over it and it is wider than 1e-3 of the axis.

    Args:
        evaluate: from coordinates to a Landscape.
        low: start of the axis.
        high: its end.

    Returns:
        The scan.
    """
    u = np.linspace(low, high, SCANNED)
    found = evaluate(u)
    doubtful = np.ones(SCANNED - 1, dtype=bool)
    resolution = np.inf
    while doubtful.any() and len(u) + int(doubtful.sum()) <= _LARGEST:
        middle = 0.5 * (u[:-1] + u[1:])[doubtful]
        new = evaluate(middle)
        predicted = _predict(u, found.objective, np.flatnonzero(doubtful).astype(np.int64))
        with np.errstate(invalid="ignore"):
            error = np.abs(predicted - new.objective) / np.abs(new.objective)
        error = np.where(np.isfinite(error), error, 0.0)
        resolution = float(error.max(initial=0.0))
        rough = error > RESOLVED
        order = np.argsort(np.concatenate([u, middle]), kind="stable")
        u = np.concatenate([u, middle])[order]
        found = Landscape(
            objective=np.concatenate([found.objective, new.objective])[order],
            ratios=np.concatenate([found.ratios, new.ratios], axis=1)[:, order],
        )
        marks = np.concatenate([np.zeros(len(u) - len(middle), dtype=bool), rough])[order]
        changes = (found.feasible[1:] != found.feasible[:-1]) | (found.reached[1:] != found.reached[:-1])
        wide = np.diff(u) > 1e-3 * (high - low)
        doubtful = marks[:-1] | marks[1:] | (changes & wide)
    return Scan(coordinate=u, landscape=found, resolution=resolution)


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


def refine(function: Callable[[FloatArray], FloatArray], u: FloatArray, values: FloatArray) -> list[Minimum]:
    """Refine every local minimum of a scanned function.

    Args:
        function: from coordinates to values; infinite where the function does not exist.
        u: the scanned coordinates, ascending.
        values: the function there.

    Returns:
        The minima, best first; empty where the function exists nowhere.
    """
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = np.isfinite(values) & (values <= padded[:-2]) & (values < padded[2:])
    minima = []
    for i in map(int, np.flatnonzero(lowest)):
        left, right = float(u[max(i - 1, 0)]), float(u[min(i + 1, len(u) - 1)])
        at, value, edge = _zoom(function, left, right)
        minima.append(Minimum(coordinate=at, value=value, bracket=(left, right), edge=edge))
    return sorted(minima, key=lambda m: m.value)


def _zoom(function: Callable[[FloatArray], FloatArray], low: float, high: float) -> tuple[float, float, bool]:
    """Narrow a bracket around its lowest value; where the function is smooth there, polish by a polynomial."""
    left, right = low, high
    for _ in range(24):
        u = np.linspace(left, right, _ZOOM)
        values = function(u)
        i = int(np.argmin(values))
        at_end = u[i] in {low, high}
        if np.isfinite(values).all() and _NARROWEST * max(1.0, abs(left)) < right - left < 0.1:
            polished = None if at_end else _polish(function, left, right)
            if polished is not None:
                return *polished, False
            if at_end and right - left < 1e-3 * (high - low):
                break
        left, right = float(u[max(i - 1, 0)]), float(u[min(i + 1, _ZOOM - 1)])
        if right - left < 1e-14 * max(1.0, abs(left)):
            break
    return float(u[i]), float(values[i]), True


def _polish(function: Callable[[FloatArray], FloatArray], left: float, right: float) -> tuple[float, float] | None:
    """Minimize the interpolating polynomial over a narrow bracket; None where the function has a corner there."""
    nodes = np.cos((np.arange(_ZOOM) + 0.5) * np.pi / _ZOOM)
    u = 0.5 * (left + right) + 0.5 * (right - left) * nodes
    values = function(u)
    fit = np.polynomial.Chebyshev.fit(u, values, 8, domain=[left, right])
    if np.abs(fit(u) - values).max() > 1e-7 * np.ptp(values):
        return None
    roots = fit.deriv().roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    inside = real[(real >= left) & (real <= right)]
    if not len(inside):
        return None
    values = function(inside)
    best = int(np.argmin(values))
    return float(inside[best]), float(values[best])
