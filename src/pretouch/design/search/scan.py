"""The coordinate of the gain and the scan along it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, IntArray, finite
from pretouch._core.units import pretty_unit
from pretouch._core.values import Value
from pretouch.motion import LawNumber

_ROUNDING = 16 * np.finfo(np.float64).eps  # of u: its inverse function is good to 4 units by whichever processor

_AT_END = 1e-9  # of the range of u


@dataclass(frozen=True, slots=True, kw_only=True)
class GainAxis:
    """The coordinate u = asinh(D_p / s) in which gains are searched: logarithmic far from zero, linear through it.

    Args:
        low: lower bound of the gain [N s].
        high: upper bound of the gain [N s].
    """

    low: float
    high: float

    @classmethod
    def between(cls, bounds: Sequence[float], number: LawNumber | None = None) -> GainAxis:
        """Make the axis between two bounds, and refuse no interval, and none of a law's numbers that mitigate."""
        unit = "N*s" if number is None else number.unit
        low, high = bounds
        low, high = finite(low, "bounds", unit), finite(high, "bounds", unit)
        if not low < high:
            raise InvalidInputError(f"bounds: found [{low:g}, {high:g}] {unit}, expected the smaller gain first")
        if number is not None and max(number.sign * low, number.sign * high) <= 0:
            shown = pretty_unit(unit)
            raise InvalidInputError(
                f"bounds: {low:g} to {high:g} {shown} make the robot chase the object; mitigating {number.name}s are "
                f"{number.mitigating}. Did you mean {0.0 - high:g} to {0.0 - low:g} {shown}?"
            )
        return cls(low=low, high=high)

    @property
    def scale(self) -> float:
        """The gain s [N s] around which the axis goes over from linear to logarithmic."""
        small, large = sorted((abs(self.low), abs(self.high)))
        return small if self.low * self.high > 0 else 1e-3 * large

    @property
    def ends(self) -> tuple[float, float]:
        """Both bounds [N s], the lower one first."""
        return self.low, self.high

    @property
    def span(self) -> tuple[float, float]:
        """The coordinates of both bounds."""
        low, high = self.coordinate(np.array(self.ends))
        return float(low), float(high)

    def coordinate(self, gain: FloatArray | float) -> FloatArray:
        """Return u of a gain [N s]."""
        return np.asarray(np.arcsinh(np.asarray(gain) / self.scale))

    def gain(self, coordinate: FloatArray | float) -> FloatArray:
        """Return the gain [N s] at u: a bound itself where u is that bound's to rounding, never one outside."""
        gain = np.clip(self.scale * np.sinh(coordinate), self.low, self.high)
        for bound, end in zip(self.ends, self.span, strict=True):
            gain = np.where(np.abs(coordinate - end) <= _ROUNDING * max(1.0, abs(end)), bound, gain)
        return gain

    def is_end(self, coordinate: FloatArray | float) -> BoolArray:
        """Tell which u are those of a bound, to 1e-9 of the range."""
        low, high = self.span
        return np.asarray(np.minimum(np.abs(coordinate - low), np.abs(coordinate - high)) <= _AT_END * (high - low))

    def stretch(self, gain: float) -> float:
        """Return d D_p / du [N s] at a gain."""
        return math.hypot(gain, self.scale)


HELD: Final = 1 - 1e-11
"""Of a limit: so that the encounter at the chosen gain, solved again, holds it, too."""

_JUMP: Final = 1e-6  # of the axis: what an interval so narrow does not predict, jumps
_EDGE: Final = 1e-3  # of the axis: how narrow the interval is in which feasibility changes


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How hard a search along an axis tries.

    Args:
        first: how many coordinates a scan begins with.
        largest: how many it ends with at most, where a function with jumps never lets neighbors predict each other.
        resolved: the error of predicting a value from its neighbors, of itself, from which a scan goes on.
        share: of the range of the values, by which a value is enlarged for that: near zero, nothing predicts itself.
        relevant: times the lowest value: an interval that is higher at both ends is not halved for its error, and a
            minimum that is higher is not refined.
        most: how many local minima are refined, the lowest first: a smooth function has a few, one with jumps hundreds.
        finest: of u, where narrowing ends if the function is not smooth.
        smooth: whether it may be, so that a polynomial is tried.
    """

    first: int = 65
    largest: int = 2049
    resolved: float = 1e-3
    share: float = 0.0
    relevant: float = math.inf
    most: int = 16
    finest: float = 1e-14
    smooth: bool = True

    def counts(self, lowest: float) -> float:
        """Return up to where values matter; everywhere, for an infinite factor of whatever is lowest."""
        return math.inf if math.isinf(self.relevant) else self.relevant * lowest


EXACT: Final = Effort()
"""For a function that is known to rounding."""

SAMPLED: Final = Effort(resolved=3e-3, largest=257, relevant=2.0, most=4, finest=1e-3)
"""For a measure over samples or runs that somebody else solves, the same for every coordinate (common random numbers).

It has jumps, so that neighbors never predict each other, and what is twice the lowest need not be known; a thousandth
of the gain is far below what another set of samples changes.
"""

RUNS: Final = Effort(first=33, largest=33, most=1, finest=1e-3, smooth=False)
"""For the mean over runs of a loop where each gain takes ten milliseconds: the best of 33, zoomed in on.

Ripples of a loop that samples are told apart by the zoom, and no polynomial meets them; a scan that halves intervals
until they are resolved would try three times as many.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Landscape(Value):
    """What coordinates lead to.

    Args:
        objective: the objective, shape (n,), or several, shape (k, n); infinite where there is no contact.
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

    def joined(self, other: Landscape, order: IntArray) -> Landscape:
        """Return both, one after the other, in another order."""
        return Landscape(
            objective=np.concatenate([self.objective, other.objective], axis=-1)[..., order],
            ratios=np.concatenate([self.ratios, other.ratios], axis=1)[:, order],
        )


Evaluate = Callable[[FloatArray], Landscape]
"""From coordinates to what they lead to; the same coordinate gives the same, noise being common random numbers."""


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


def scan(evaluate: Evaluate, low: float, high: float, effort: Effort = EXACT) -> Scan:
    """Scan an axis and halve its intervals until neighbors predict each other.

    An interval is halved while the cubic through four neighbors misses an objective in its middle by more than
    `resolved`, or while feasibility changes over it and it is wider than 1e-3 of the axis. At a jump that ends where it
    is narrower than 1e-6 of the axis; where there are many jumps, when there are as many coordinates as may be.

    Args:
        evaluate: from coordinates to a Landscape.
        low: start of the axis.
        high: its end.
        effort: how hard to try.

    Returns:
        The scan.
    """
    u = np.linspace(low, high, effort.first)
    found = evaluate(u)
    doubtful = np.ones(len(u) - 1, dtype=bool)
    resolution = np.inf
    while doubtful.any() and len(u) + int(doubtful.sum()) <= effort.largest:
        middle = 0.5 * (u[:-1] + u[1:])[doubtful]
        new = evaluate(middle)
        error = _missed(predict(u, found.objective, np.flatnonzero(doubtful)), new.objective, found, effort.share)
        resolution = float(error.max(initial=0.0))
        lower_ends = np.minimum(found.objective[..., :-1], found.objective[..., 1:])[..., doubtful]
        near = lower_ends <= effort.counts(float(found.merit.min()))
        rough = ((error > effort.resolved) & near).reshape(-1, len(middle)).any(axis=0)
        order = np.argsort(np.concatenate([u, middle]), kind="stable")
        u, found = np.concatenate([u, middle])[order], found.joined(new, order)
        marks = np.concatenate([np.zeros(len(u) - len(middle), dtype=bool), rough])[order]
        apart = np.diff(u)
        kinds = np.atleast_2d(found.feasible) + 2 * np.atleast_2d(found.reached)
        changes = (np.diff(kinds) != 0).any(axis=0)
        doubtful = (marks[:-1] | marks[1:]) & (apart > _JUMP * (high - low)) | changes & (apart > _EDGE * (high - low))
    return Scan(coordinate=u, landscape=found, resolution=resolution)


def _missed(predicted: FloatArray, new: FloatArray, found: Landscape, share: float) -> FloatArray:
    """Return by how much a prediction misses, in proportion; 0 where there is none."""
    size = np.abs(new)
    if share:
        known = found.objective[..., found.reached.reshape(-1, found.objective.shape[-1]).all(axis=0)]
        size = size + share * (np.ptp(known, axis=-1, keepdims=True) if known.size else 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.abs(predicted - new) / size
    return np.where(np.isfinite(error), error, 0.0)


def predict(u: FloatArray, f: FloatArray, intervals: IntArray) -> FloatArray:
    """Predict f, shape (..., n), in the middle of intervals by the cubic through the four nodes nearest to each."""
    nodes = np.clip(intervals - 1, 0, len(u) - 4)[:, None] + np.arange(4)
    x = u[nodes]
    away = 0.5 * (u[intervals] + u[intervals + 1])[:, None] - x
    apart = (x[:, :, None] - x[:, None] + np.eye(4)).prod(axis=2)
    weights = away.prod(axis=1, keepdims=True) / away / apart  # Lagrange's; no middle of an interval is a node
    with np.errstate(invalid="ignore"):
        return np.asarray((weights * f[..., nodes]).sum(axis=-1))
