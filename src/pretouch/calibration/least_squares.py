"""Solve many small nonlinear least-squares problems at once by the Levenberg-Marquardt method.

A calibration needs hundreds of fits of three or four parameters: for each possible offset, each excluded distance, each
possible start of the window, and each end of an interval. A general solver spends a thousand times more time on
overhead than on the arithmetic of such a fit. Vectorized over all problems, this overhead is spent only once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

Residuals: TypeAlias = Callable[[FloatArray, IntArray], FloatArray]
"""Function of parameters, shape (b, p), and indices of their problems, shape (b,); returns residuals, shape (b, n)."""

_STEP: Final = 1e-6  # step of a parameter for finite differences
_DOUBLINGS: Final = 5  # a profile that has not risen at 2^5 times the half width of the linear interval is unbounded
_ATTEMPTS: Final = 12  # iterations for the end of an interval
_LARGEST_DAMPING: Final = 1e12  # largest damping of the normal equations; with more, no step improves the cost
_FEW: Final = 40  # problems that are evaluated together with their derivatives
_HUGE: Final = 1e150  # replaces residuals that are not finite


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fits:
    """Solutions of many least-squares problems.

    Parameters x have the shape (b, p), residuals (b, n), and costs (sums of squares) (b,).

    The jacobian has the derivatives of the residuals by the parameters, shape (b, n, p); zero for a parameter at a
    bound.
    """

    x: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    costs: FloatArray

    @property
    def covariances(self) -> FloatArray:
        """The covariances of the fit parameters.

        They hold for residuals of unit variance, and have the shape (b, p, p). They are large, not infinite, for a
        singular problem, and zero for parameters at a bound.
        """
        _, s, vt = np.linalg.svd(self.jacobian, full_matrices=False)
        s = np.maximum(s, np.maximum(1e-12 * s[:, :1], 1e-60))
        free = (self.jacobian != 0).any(axis=1)
        inverse = np.einsum("bki,bk,bkj->bij", vt, 1 / s**2, vt)
        return np.asarray(np.where(free[:, :, None] & free[:, None, :], inverse, 0.0))


def minimize_many(
    residuals: Residuals,
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    *,
    tolerance: float = 1e-10,
    most: int = 60,
) -> Fits:
    """Solve many least-squares problems at once.

    Each problem has parameter bounds and its own start point. Bounds have the shape (p,) or (b, p); each row of `start`
    is one problem. A problem has converged when its cost changes by a smaller share than `tolerance`, or its parameters
    by less than that. All problems end after `most` steps. Starts are clipped to the bounds.

    Returns:
        The solutions.
    """
    low, high = (np.broadcast_to(b, start.shape) for b in bounds)
    x = np.clip(start, low, high)
    if not len(x):
        return Fits(x=x, residuals=np.empty((0, 0)), jacobian=np.empty((0, 0, x.shape[1])), costs=np.empty(0))
    problems = np.arange(len(x))
    residual, slope = _with_derivative(residuals, x, problems, high)
    cost = np.einsum("bn,bn->b", residual, residual)
    damping, active = np.full(len(x), 1e-3), problems
    for _ in range(most):
        if not len(active):
            break
        at, here = x[active], slope[active]
        step = _step(at, here, residual[active], damping[active], (low[active], high[active]))
        new_x = np.clip(at + step, low[active], high[active])
        few = len(active) <= _FEW  # one call of the residuals costs more than some derivatives that are not used
        if few:
            new_residual, new_slope = _with_derivative(residuals, new_x, active, high[active])
        else:
            new_residual = _finite(residuals(new_x, active))
        new_cost = np.einsum("bn,bn->b", new_residual, new_residual)
        better = new_cost < cost[active]
        moved = np.abs(new_x - at).max(axis=1)
        converged = (np.abs(cost[active] - new_cost) <= tolerance * cost[active]) & (moved < 1e-3)
        converged |= moved <= tolerance
        damping[active] = np.where(better, np.maximum(0.2 * damping[active], 1e-9), 8 * damping[active])
        improved = active[better]
        x[improved], residual[improved], cost[improved] = new_x[better], new_residual[better], new_cost[better]
        if few:
            slope[improved] = new_slope[better]
        elif len(improved):
            slope[improved] = _derivative(residuals, x[improved], residual[improved], improved, high[improved])
        active = active[~converged & (damping[active] < _LARGEST_DAMPING)]
    at_bound = _at_bound(x, np.einsum("bnp,bn->bp", slope, residual), low, high)
    return Fits(x=x, residuals=residual, jacobian=np.where(at_bound[:, None, :], 0.0, slope), costs=cost)


def _finite(values: FloatArray) -> FloatArray:
    if (np.abs(values) <= _HUGE).all():
        return values
    return np.where(np.isfinite(values), np.clip(values, -_HUGE, _HUGE), _HUGE)


def _at_bound(x: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Return which fit parameters stay at a bound. For these, the cost would decrease only beyond the bound."""
    return np.asarray(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))


def _with_derivative(
    residuals: Residuals, x: FloatArray, which: IntArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return residuals and their derivatives by one call of the function of the residuals."""
    count, size = x.shape
    moved = np.repeat(x[:, None, :], size + 1, axis=1)
    step = _steps(x, high)
    moved[:, np.arange(size) + 1, np.arange(size)] += step
    rows = _finite(residuals(moved.reshape(count * (size + 1), size), np.repeat(which, size + 1)))
    rows = rows.reshape(count, size + 1, -1)
    slopes = (rows[:, 1:] - rows[:, :1]) / step[:, :, None]
    return np.ascontiguousarray(rows[:, 0]), np.ascontiguousarray(np.swapaxes(slopes, 1, 2))


def _steps(x: FloatArray, high: FloatArray) -> FloatArray:
    step = _STEP * np.maximum(1.0, np.abs(x))
    return np.where(x + step > high, -step, step)


def _derivative(
    residuals: Residuals, x: FloatArray, value: FloatArray, which: IntArray, high: FloatArray
) -> FloatArray:
    """Differentiate residuals by finite differences. The steps respect the upper bounds of the parameters."""
    count, size = x.shape
    moved = np.repeat(x[:, None, :], size, axis=1)
    step = _steps(x, high)
    moved[:, np.arange(size), np.arange(size)] += step
    moved_residuals = _finite(residuals(moved.reshape(count * size, size), np.repeat(which, size)))
    rows = (moved_residuals.reshape(count, size, -1) - value[:, None, :]) / step[:, :, None]
    return np.asarray(np.swapaxes(rows, 1, 2))


def _step(
    x: FloatArray, slope: FloatArray, value: FloatArray, damping: FloatArray, bounds: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return a Levenberg-Marquardt step of the fit parameters.

    Parameters that stay at a bound do not change.

    The step is zero if the damped normal equations overflow.
    """
    with np.errstate(all="ignore"):
        step = _newton_step(x, slope, value, damping, bounds)
    return np.where(np.isfinite(step), step, 0.0)


def _newton_step(
    x: FloatArray, slope: FloatArray, value: FloatArray, damping: FloatArray, bounds: tuple[FloatArray, FloatArray]
) -> FloatArray:
    corner = np.arange(x.shape[1])
    transposed = slope.swapaxes(1, 2)
    gradient = (transposed @ value[:, :, None])[:, :, 0]
    square = transposed @ slope
    damped = damping[:, None] * np.maximum(square[:, corner, corner], 1e-30)
    at_bound = _at_bound(x, gradient, *bounds)
    free = ~at_bound
    if at_bound.any():
        square = np.where(free[:, :, None] & free[:, None, :], square, 0.0)
        damped = np.where(free, damped, 1.0)
    square[:, corner, corner] += damped
    scale = 1 / np.sqrt(square[:, corner, corner])
    scaled = square * scale[:, :, None] * scale[:, None, :]
    return np.asarray(np.linalg.solve(scaled, (-gradient * free * scale)[:, :, None])[:, :, 0] * scale)


def gradient(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Differentiate a vector function by central differences.

    Parameters of shape (p,) give derivatives of shape (outputs, p).

    Returns:
        The derivatives.
    """
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
    """Return confidence intervals from the profile likelihood.

    They are intervals of functions of the fit parameters.

    An interval ends where the profile has risen by `rise` above the minimum. A stiff spring pulls a coordinate to a
    target: the sum of squares plus the spring's energy is minimized over all parameters. The minimum lies exactly on
    the profile, at the value of the coordinate in this minimum. So the coordinate need not be a parameter of the model.
    Steps are doubled until the profile has risen enough; then secants are used. All ends are searched at once. The
    residuals are those of one problem with the index 0, `best` is its minimum, and `coordinates` maps (b, p) to (b, c).
    The result has, for each coordinate, the lower and the upper end, and whether each end was reached. An end that was
    not reached is the last value that the bounds allow.
    """
    center = coordinates(best.x)[0]
    slope = gradient(lambda u: coordinates(u[None])[0], best.x[0])
    scale = np.sqrt(np.maximum(rise * np.einsum("cp,pq,cq->c", slope, best.covariances[0], slope), 1e-300))
    lanes = [_End(i, sign * float(scale[i]), float(center[i])) for i in range(len(center)) for sign in (-1.0, 1.0)]
    stiffness = np.array(
        [100 * np.sqrt(rise) / abs(lane.step) for lane in lanes]
    )  # the spring yields by 1e-4 of the step
    ahead = np.array([best.covariances[0] @ slope[lane.which] * rise / lane.step**2 for lane in lanes])
    which = np.array([lane.which for lane in lanes])
    x = np.repeat(best.x, len(lanes), axis=0)
    for _ in range(_ATTEMPTS):
        active = np.array([i for i, lane in enumerate(lanes) if lane.end is None], dtype=np.int64)
        if not len(active):
            break
        goals = np.array([lanes[i].target for i in active])

        def pulled(u: FloatArray, number: IntArray, lane: IntArray = active, goal: FloatArray = goals) -> FloatArray:
            at = coordinates(u)[np.arange(len(u)), which[lane[number]]]
            spring = stiffness[lane[number]] * (at - goal[number])
            return np.column_stack([residuals(u, np.zeros(len(u), dtype=np.int64)), spring])

        here = coordinates(x[active])[np.arange(len(active)), which[active]]
        start = np.clip(x[active] + ahead[active] * (goals - here)[:, None], *bounds)
        costs = [np.sum(_finite(pulled(u, np.arange(len(u)))) ** 2, axis=1) for u in (x[active], start)]
        fits = minimize_many(pulled, np.where((costs[1] < costs[0])[:, None], start, x[active]), bounds, tolerance=1e-7)
        values = coordinates(fits.x)[np.arange(len(active)), which[active]]
        height = np.sqrt(np.maximum(np.sum(fits.residuals[:, :-1] ** 2, axis=1) - best.costs[0], 0.0) / rise)
        for i, value, level, at in zip(active, values, height, fits.x, strict=True):
            if lanes[i].take(float(value), float(level)):
                x[i] = at
    ends = [lane.result() for lane in lanes]
    return [(a[0], b[0], a[1], b[1]) for a, b in zip(ends[::2], ends[1::2], strict=True)]


class _End:
    """Iterative search for the upper or lower end of a confidence interval."""

    def __init__(self, which: int, step: float, center: float) -> None:
        self.which, self.step, self.target = which, step, center + step
        self.end: float | None = None
        self.reached = False
        self._inner, self._outer, self._attempt = (center, 0.0), (center, 0.0), 0

    def take(self, value: float, height: float) -> bool:
        """Record a point of the likelihood profile.

        `height` is the square root of the profile's rise at a value, relative to the rise at the end.

        Returns:
            Whether the search continues from this point.
        """
        further = height < 1
        if further and abs(value - self._inner[0]) < 0.05 * abs(self.target - self._inner[0]):
            self.end = value  # a bound of the parameters ends the search
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

    def result(self) -> tuple[float, bool]:
        """Return the end of the confidence interval.

        The second result is True if the search has reached this end.

        After the last attempt, the end is the best value so far.
        """
        if self.end is not None:
            return self.end, self.reached
        return (self._outer[0], True) if self._outer[1] > 0 else (self._inner[0], False)
