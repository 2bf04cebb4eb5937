"""Solve many small nonlinear least-squares problems by the compiled Levenberg-Marquardt method.

A calibration needs thousands of fits of three or four parameters: for each possible offset, each excluded distance,
each possible start of the window, and each end of an interval. The compiled core takes one call for all of them.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.native import INTEGER, POINTER, address, shaped
from pretouch._core.numbers import FloatArray, IntArray

from .curve_residuals import INDEX, CurveResiduals, FitOfCore, Residuals, minimize, room

_DOUBLINGS: Final = 5  # a profile that has not risen at 2^5 times the half width of the linear interval is unbounded
_ATTEMPTS: Final = 12  # iterations for the end of an interval
_HUGE: Final = 1e150  # replaces residuals that are not finite
_Callback: Final = ctypes.CFUNCTYPE(None, POINTER, POINTER, INTEGER, POINTER)


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
    problems: IntArray | None = None,
    tolerance: float = 1e-10,
    most: int = 60,
) -> Fits:
    """Solve many least-squares problems at once.

    Each problem has parameter bounds and its own start point. Bounds have the shape (p,) or (b, p); each row of `start`
    is the start of one problem, whose index is in `problems`, by default its place. A problem has converged when its
    cost changes by a smaller share than `tolerance`, or its parameters by less than that. All problems end after `most`
    steps. Starts are clipped to the bounds. Residuals that are not `CurveResiduals` are differentiated by finite
    differences.

    Returns:
        The solutions.
    """
    count, size = start.shape
    low, high = (np.ascontiguousarray(np.broadcast_to(b, start.shape)) for b in bounds)
    x = np.clip(start, low, high)
    if not count:
        return Fits(x=x, residuals=np.empty((0, 0)), jacobian=np.empty((0, 0, size)), costs=np.empty(0))
    which = np.arange(count) if problems is None else np.ascontiguousarray(problems)
    errors: list[BaseException] = []
    if isinstance(residuals, CurveResiduals):
        width, (fit, kept) = residuals.width, residuals.in_core()
    else:
        width = residuals(x[:1], which[:1]).shape[1]
        kept = [callback := _callback(residuals, size, width, errors)]
        fit = FitOfCore(size, width, ctypes.cast(callback, POINTER))
    rows, jacobian, costs = np.empty((count, width)), np.empty((count, width, size)), np.empty(count)
    workspace, numbers = np.empty(room(ctypes.byref(fit))), (low, high)
    minimize(
        ctypes.byref(fit),
        shaped(which, (count,), INDEX),
        count,
        *(address(array) for array in numbers),
        size,
        tolerance,
        most,
        *(address(array) for array in (x, rows, jacobian, costs, workspace)),
    )
    del kept  # the arrays and the function that the core has used
    if errors:
        raise errors[0]
    return Fits(x=x, residuals=rows, jacobian=jacobian, costs=costs)


def _callback(residuals: Residuals, size: int, width: int, errors: list[BaseException]) -> Any:
    """Return a C function that calls a Python function of residuals.

    An exception cannot pass through C. It is added to `errors`, and all later residuals are zero, which ends the fits.
    """

    def array(address: int, *shape: int, kind: Any = ctypes.c_double) -> Any:
        return np.frombuffer((kind * int(np.prod(shape))).from_address(address), dtype=kind).reshape(shape)

    def call(x: int, problem: int, count: int, rows: int) -> None:
        result = array(rows, count, width)
        result[:] = 0.0
        if errors:
            return
        try:
            result[:] = residuals(array(x, count, size), array(problem, count, kind=ctypes.c_int64))
        except BaseException as error:
            errors.append(error)

    return _Callback(call)


def _finite(values: FloatArray) -> FloatArray:
    return np.where(np.isfinite(values), np.clip(values, -_HUGE, _HUGE), _HUGE)


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

        pulls = np.column_stack([which[active], stiffness[active], goals])
        pulled = _pulled(residuals, coordinates, pulls)
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


def _pulled(residuals: Residuals, coordinates: Callable[[FloatArray], FloatArray], pulls: FloatArray) -> Residuals:
    """Return the residuals of one problem with a spring for each row of `pulls`.

    A row has the number of the coordinate, the stiffness and the target.
    """
    if isinstance(residuals, CurveResiduals):
        return residuals.pulled(pulls)

    def pulled(u: FloatArray, number: IntArray) -> FloatArray:
        which, stiffness, goals = pulls[number].T
        at = coordinates(u)[np.arange(len(u)), which.astype(np.int64)]
        return np.column_stack([residuals(u, np.zeros(len(u), dtype=np.int64)), stiffness * (at - goals)])

    return pulled


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
