"""Nonlinear least squares by SciPy, and the profile of any function of the parameters along its minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from pretouch._core.numbers import FloatArray

__all__ = ["Residuals", "Solution", "gradient", "interval", "minimize"]

_DOUBLINGS = 5  # a profile that has not risen at 60 times the width of the linear interval has no end

Residuals: TypeAlias = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """A minimum: where it is, the residuals there, their Jacobian, and their sum of squares."""

    x: FloatArray
    residuals: FloatArray
    jacobian: FloatArray

    @property
    def cost(self) -> float:
        """The sum of squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters at unit variance of the residuals; large, not infinite, where singular."""
        _, s, vt = np.linalg.svd(self.jacobian, full_matrices=False)
        s = np.maximum(s, max(1e-12 * float(s[0]), 1e-60))
        return np.asarray((vt.T / s**2) @ vt)


def minimize(
    residuals: Residuals,
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    *,
    tolerance: float = 1e-12,
    robust: float | None = None,
    evaluations: int = 300,
) -> Solution:
    """Minimize a sum of squares within bounds.

    Args:
        residuals: from the parameters to the residuals.
        start: where to begin; moved inside the bounds.
        bounds: the lower and upper bounds.
        tolerance: relative change of cost and parameters at which to stop.
        evaluations: after how many of the residuals to stop.
        robust: residual beyond which the loss grows only linearly (soft L1); None for plain squares.

    Returns:
        The minimum, with the plain residuals there.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415 - SciPy is loaded only for fits

    low, high = bounds
    margin = 1e-9 * np.minimum(np.where(np.isfinite(high - low), high - low, 1.0), 1.0)
    found = least_squares(
        residuals,
        np.clip(start, low + margin, high - margin),
        bounds=(low, high),
        x_scale="jac",
        loss="linear" if robust is None else "soft_l1",
        f_scale=robust or 1.0,
        ftol=tolerance,
        xtol=tolerance,
        gtol=1e-15,
        max_nfev=evaluations,
    )
    return Solution(x=found.x, residuals=np.asarray(found.fun), jacobian=np.asarray(found.jac))


def gradient(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Differentiate a vector function by central differences, shape (outputs, parameters)."""
    columns = []
    for i, value in enumerate(x):
        step = 1e-6 * max(1.0, abs(float(value)))
        shift = np.zeros_like(x)
        shift[i] = step
        columns.append((function(x + shift) - function(x - shift)) / (2 * step))
    return np.stack(columns, axis=-1)


def interval(
    residuals: Residuals,
    best: Solution,
    bounds: tuple[FloatArray, FloatArray],
    coordinate: Callable[[FloatArray], float],
    rise: float,
) -> tuple[float, float, bool, bool]:
    """Find where the profile of a coordinate has risen by `rise` above the minimum.

    The sum of squares plus a stiff spring that pulls the coordinate to a target is minimized over all parameters:
    its minimum lies on the profile exactly, at the coordinate where it ends up, so no form of the model in which
    that coordinate is a parameter is needed.

    Args:
        residuals: from the parameters to the residuals.
        best: the minimum.
        bounds: of the parameters.
        coordinate: the function whose interval is wanted.
        rise: increase of the sum of squares at the ends of the interval.

    Returns:
        Lower and upper end, and whether each was reached; where not, the end is the last value that the bounds let
        the coordinate take.
    """
    slope = gradient(lambda x: np.array([coordinate(x)]), best.x)[0]
    scale = float(np.sqrt(max(rise * (slope @ best.covariance @ slope), 1e-300)))
    ends = [_end(residuals, best, bounds, coordinate, rise=rise, step=sign * scale) for sign in (-1.0, 1.0)]
    return ends[0][0], ends[1][0], ends[0][1], ends[1][1]


def _end(
    residuals: Residuals,
    best: Solution,
    bounds: tuple[FloatArray, FloatArray],
    coordinate: Callable[[FloatArray], float],
    *,
    rise: float,
    step: float,
) -> tuple[float, bool]:
    """Follow the profile to one side: double the step until it has risen enough, then close in by secants."""
    stiffness = 100 * np.sqrt(rise) / abs(step)  # it gives way by 1e-4 of the step
    ahead = best.covariance @ gradient(lambda u: np.array([coordinate(u)]), best.x)[0] * rise / step**2
    center = coordinate(best.x)
    inner, outer = (center, 0.0), (center, 0.0)
    x, target = best.x, center + step
    for attempt in range(12):

        def pulled(u: FloatArray, goal: float = target) -> FloatArray:
            return np.append(residuals(u), stiffness * (coordinate(u) - goal))

        start = _better(pulled, x, np.clip(x + ahead * (target - coordinate(x)), *bounds))
        found = minimize(pulled, start, bounds, tolerance=1e-7, evaluations=40)
        value = coordinate(found.x)
        height = float(np.sqrt(max(float(found.residuals[:-1] @ found.residuals[:-1]) - best.cost, 0.0)))
        if height < np.sqrt(rise):
            if abs(value - inner[0]) < 0.05 * abs(target - inner[0]):  # the bounds hold it back
                return value, False
            inner, x = (value, height), found.x
        else:
            outer = (value, height)
        if abs(height - np.sqrt(rise)) < 0.01 * np.sqrt(rise):
            return value, True
        if outer[1] > 0:
            share = (np.sqrt(rise) - inner[1]) / max(outer[1] - inner[1], 1e-300)
            target = inner[0] + float(np.clip(share, 0.05, 0.95)) * (outer[0] - inner[0])
        else:
            if attempt == _DOUBLINGS:
                return value, False
            target = value + step * 2.0**attempt
    return (outer[0], True) if outer[1] > 0 else (inner[0], False)


def _better(residuals: Residuals, first: FloatArray, second: FloatArray) -> FloatArray:
    """Return that of two points with the smaller sum of squares."""
    with np.errstate(all="ignore"):
        costs = [float(np.sum(residuals(x) ** 2)) for x in (first, second)]
    return second if costs[1] < costs[0] else first
