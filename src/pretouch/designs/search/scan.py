"""Evaluate a function along one axis with an adaptive step size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value

from .bands import doubtful_bands, lowest_doubts
from .landscape import Evaluate, Landscape

_JUMP: Final = 1e-6  # share of the axis: a change over an interval this narrow is a jump


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """Settings of a search over one variable.

    Args:
        first: number of coordinates of the first scan.
        largest: largest number of coordinates, which a function with jumps may reach.
        resolved: relative error of interpolation above which an interval is halved.
        share: share of the range of values that is added to a value in this relative error, for values near zero.
        relevant: factor on the lowest value: intervals with higher values at both ends are not halved for their error,
            and higher minima are not refined.
        most: largest number of local minima that are refined, lowest first: a smooth function has a few, a function
            with jumps has hundreds.
        nodes: number of coordinates of each round of a refinement.
        finest: smallest relative width in u at which refinement ends if the function is not smooth.
        smooth: whether the function may be smooth; then a polynomial is tried.
        bands: largest number of further coordinates that look for feasible ones if the first scan has none.
    """

    first: int = 65
    largest: int = 2049
    resolved: float = 1e-3
    share: float = 0.0
    relevant: float = math.inf
    most: int = 16
    nodes: int = 17
    finest: float = 1e-14
    smooth: bool = True
    bands: int = 1024

    def counts(self, lowest: float) -> float:
        """Return the function value above which refinement is unnecessary."""
        return math.inf if math.isinf(self.relevant) else self.relevant * lowest


EXACT: Final = Effort()
"""Settings for a function that is exact up to rounding."""

MEASURED: Final = Effort(first=33, nodes=9, finest=1e-11)
"""Settings for a measure over samples that are solved exactly, at some milliseconds per gain.

A measure over different encounters varies less than the objective of one: half as many first gains suffice, and the
scan still halves every interval in which interpolation is not accurate. Rounds of 9 gains narrow a bracket with a fifth
fewer gains than rounds of 17. They end at 1e-11, below the accepted error of a
contact time.
"""

SAMPLED: Final = Effort(resolved=3e-3, largest=257, relevant=2.0, most=4, finest=1e-3, bands=64)
"""Settings for a measure over samples or runs of an evaluator, with common random numbers for all coordinates.

Such a measure has jumps, so that interpolation does not converge. Values above twice the lowest are not resolved. A
thousandth of the gain is far below the change by another set of samples.
"""

RUNS: Final = Effort(first=33, largest=33, most=1, nodes=5, finest=1e-3, smooth=False, bands=24)
"""Settings for the mean over runs of a loop with about ten milliseconds per gain: refine the best of 33 gains.

The refinement resolves the ripples of a sampled loop, which no polynomial fits. An adaptive scan that resolves them
would need three times as many gains. Nine coordinates per round reach the same resolution as 17 with two thirds of the

"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan(Value):
    """Objective and constraints over the whole range of the search variable.

    Args:
        coordinate: u, ascending, shape (n,).
        landscape: objective and constraints of each gain.
        resolution: largest error of interpolating an objective from its neighbors, relative to the objective.
    """

    coordinate: FloatArray
    landscape: Landscape
    resolution: float

    @property
    def least_violation(self) -> float | None:
        """The coordinate with the smallest constraint violation.

        None if no coordinate results in contact.
        """
        worst = self.landscape.violation
        best = int(np.argmin(worst))
        return float(self.coordinate[best]) if np.isfinite(worst[best]) else None


def scan(evaluate: Evaluate, low: float, high: float, effort: Effort = EXACT, start: Scan | None = None) -> Scan:
    """Evaluate a function on an adaptive grid.

    The grid is refined until interpolation is accurate. An interval is halved in three cases:

    - The cubic through four neighbors misses an objective in its middle by more than `resolved`.
    - Feasibility changes over it, and it is wide compared with the axis or with the feasible range next to it.
    - It may contain feasible coordinates, although both ends are infeasible (`bands`).

    Halving ends at intervals of 1e-6 of the axis, and at the largest number of coordinates, `largest`. If the first
    scan has no feasible coordinate, `bands` more are allowed.

    Args:
        evaluate: a function that maps coordinates to a Landscape.
        low: start of the axis.
        high: end of the axis.
        effort: settings of the search.
        start: a scan to continue instead of a new one; its objective is not refined further.

    Returns:
        The scan.
    """
    if start is None:
        u = np.linspace(low, high, effort.first)
        start = Scan(coordinate=u, landscape=evaluate(u), resolution=np.inf)
        rough = np.ones(len(u) - 1, dtype=bool)
        most = effort.largest + (0 if start.landscape.feasible.any() else effort.bands)
    else:
        rough = np.zeros(len(start.coordinate) - 1, dtype=bool)
        most = max(effort.largest, len(start.coordinate)) + effort.bands
    u, landscape, resolution = start.coordinate, start.landscape, start.resolution
    finest = max(_JUMP * (high - low), effort.finest)
    while True:
        doubt = doubtful_bands(u, landscape, finest, effort.finest * max(1.0, abs(low), abs(high)))
        rough &= np.diff(u) > _JUMP * (high - low)
        doubtful = rough | np.isfinite(doubt)
        if len(u) + int(doubtful.sum()) > (effort.largest if rough.any() else most):
            doubtful = lowest_doubts(doubt, most - len(u))
        if not doubtful.any():
            return Scan(coordinate=u, landscape=landscape, resolution=resolution)
        middle = 0.5 * (u[:-1] + u[1:])[doubtful]
        new = evaluate(middle)
        error = _relative_error(
            predict(u, landscape.objective, np.flatnonzero(doubtful)), new.objective, landscape, effort.share
        )
        if (rough & doubtful).any():
            resolution = float(error[..., rough[doubtful]].max(initial=0.0))
        lower_ends = np.minimum(landscape.objective[..., :-1], landscape.objective[..., 1:])[..., doubtful]
        near = lower_ends <= effort.counts(float(landscape.merit.min()))
        halved = ((error > effort.resolved) & near).reshape(-1, len(middle)).any(axis=0)
        order = np.argsort(np.concatenate([u, middle]), kind="stable")
        u, landscape = np.concatenate([u, middle])[order], landscape.joined(new, order)
        marks = np.concatenate([np.zeros(len(u) - len(middle), dtype=bool), halved])[order]
        rough = marks[:-1] | marks[1:]


def _relative_error(predicted: FloatArray, new: FloatArray, landscape: Landscape, share: float) -> FloatArray:
    """Return the relative error of predicted values. It is 0 if the error is not finite."""
    size = np.abs(new)
    if share:
        values = landscape.objective[..., landscape.reached.reshape(-1, landscape.objective.shape[-1]).all(axis=0)]
        size = size + share * (np.ptp(values, axis=-1, keepdims=True) if values.size else 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.abs(predicted - new) / size
    return np.where(np.isfinite(error), error, 0.0)


def predict(u: FloatArray, f: FloatArray, intervals: IntArray) -> FloatArray:
    """Interpolate a function in the middle of intervals.

    Returns:
        The values, from the cubic polynomial through the four nearest points.
    """
    nodes = np.clip(intervals - 1, 0, len(u) - 4)[:, None] + np.arange(4)
    x = u[nodes]
    away = 0.5 * (u[intervals] + u[intervals + 1])[:, None] - x
    apart = (x[:, :, None] - x[:, None] + np.eye(4)).prod(axis=2)
    weights = away.prod(axis=1, keepdims=True) / away / apart  # Lagrange weights; no middle of an interval is a node
    with np.errstate(invalid="ignore"):
        return np.asarray((weights * f[..., nodes]).sum(axis=-1))
