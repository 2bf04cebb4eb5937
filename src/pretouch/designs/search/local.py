"""Improve a design by a local search (SLSQP of SciPy), and test its optimality."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.numbers import FloatArray

from .landscape import HELD
from .trials import Trials

_STARTS: Final = 6  # most searches for the least violation
_APART: Final = 0.1  # share of the range by which their starts differ in some coordinate
_FAR: Final = 1e3  # value of a row without contact; other rows are about 1
_ITERATIONS: Final = 50
_CLOSE: Final = 1e-6  # a limit or bound within this relative distance is active
_NEAR: Final = 1e-9  # a point within this share of the range from a bound is moved to the bound if it is as good
_SAME: Final = 1e-12  # relative accuracy of encounters
_INSIDE: Final = 1e-10  # relative distance from a limit that the search keeps, because an SQP step may violate limits


Evaluation: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Function that maps coordinates to rows and their derivatives, each row divided by its scale."""


def _cached_rows(trials: Trials, scale: FloatArray) -> Evaluation:
    """Cache the last evaluation of a search point."""
    last: dict[bytes, tuple[FloatArray, FloatArray]] = {}

    def evaluate(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        key = at.tobytes()
        if key not in last:
            last.clear()
            rows, slopes = trials.differentiate(np.clip(at, 0.0, 1.0))
            last[key] = np.where(np.isfinite(rows), rows / scale, _FAR), slopes / scale[:, None]
        return last[key]

    return evaluate


def descend(trials: Trials, start: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Minimize a weighted sum of objectives within limits.

    Returns:
        The point and its objectives; None if the result is not feasible.
    """
    count, ratios = len(trials.measures), len(trials.constraints)
    rows = _cached_rows(trials, np.ones(count + ratios))
    first = float(weights @ rows(start)[0][:count]) or 1.0
    minimum = _minimize(
        lambda z: float(weights @ rows(z)[0][:count]) / first,
        lambda z: weights @ rows(z)[1][:count] / first,
        start,
        (lambda z: 1 - _INSIDE - rows(z)[0][count:], lambda z: -rows(z)[1][count:]) if ratios else None,
        [(0.0, 1.0)] * len(start),
    )
    return _to_feasible(trials, np.clip(minimum, 0.0, 1.0), lambda values: float(weights @ values))


def reduce_violation(trials: Trials, start: FloatArray) -> FloatArray:
    """Minimize the largest ratio |quantity| / limit.

    The search minimizes t subject to ratios <= t, which is smooth also where several ratios are equal.

    Returns:
        The point with the smaller violation of the start and the minimum.
    """
    count = len(trials.measures)
    rows = _cached_rows(trials, np.ones(count + len(trials.constraints)))
    up = np.append(np.zeros(len(start)), 1.0)
    minimum = _minimize(
        lambda z: float(z[-1]),
        lambda _: up,
        np.append(start, rows(start)[0][count:].max()),
        (
            lambda z: z[-1] - rows(z[:-1])[0][count:],
            lambda z: np.column_stack([-rows(z[:-1])[1][count:], np.ones(len(trials.constraints))]),
        ),
        [*[(0.0, 1.0)] * len(start), (None, None)],
    )[:-1]
    both = np.stack([start, np.clip(minimum, 0.0, 1.0) if np.isfinite(minimum).all() else start])
    return np.asarray(both[int(np.argmin(trials.landscape(both).violation))])


def least_violations(trials: Trials, points: FloatArray, violation: FloatArray) -> FloatArray:
    """Minimize the largest ratio |quantity| / limit from some points.

    Args:
        trials: the free parameters and their limits.
        points: evaluated points, shape (n, size).
        violation: the largest ratio of each.

    Returns:
        The minima, smallest violation first; empty without contact or without limits.
    """
    order = np.argsort(violation, kind="stable")
    order = order[np.isfinite(violation[order])] if trials.constraints else order[:0]
    starts: list[FloatArray] = []
    for start in points[order]:
        if len(starts) < _STARTS and all(np.abs(start - other).max() > _APART for other in starts):
            starts.append(start)
    minima = np.array([reduce_violation(trials, start) for start in starts]).reshape(-1, points.shape[1])
    return minima[np.argsort(trials.landscape(minima).violation, kind="stable")] if len(minima) else minima


def advance(
    trials: Trials, start: FloatArray, origin: FloatArray, scale: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Search along a given direction for a Pareto-optimal point.

    The search minimizes t subject to quantities <= origin + t scale (Pascoletti and Serafini 1984).

    Returns:
        The point and its quantities; None if the search fails.
    """
    count = len(trials.measures)
    rows = _cached_rows(trials, np.concatenate([scale, np.ones(len(trials.constraints))]))
    goal = origin / scale

    def slack(z: FloatArray) -> FloatArray:
        values = rows(z[:-1])[0]
        return np.concatenate([z[-1] + goal - values[:count], 1 - _INSIDE - values[count:]])

    def slack_slope(z: FloatArray) -> FloatArray:
        slopes = -rows(z[:-1])[1]
        return np.column_stack([slopes, np.where(np.arange(len(slopes)) < count, 1.0, 0.0)])

    t = float((rows(start)[0][:count] - goal).max())
    up = np.append(np.zeros(len(start)), 1.0)
    minimum = _minimize(
        lambda z: float(z[-1]),
        lambda _: up,
        np.append(start, t),
        (slack, slack_slope),
        [*[(0.0, 1.0)] * len(start), (None, None)],
    )
    return _to_feasible(trials, np.clip(minimum[:-1], 0.0, 1.0), lambda values: float((values / scale - goal).max()))


def _minimize(value: Any, slope: Any, start: FloatArray, slack: Any, bounds: Any) -> FloatArray:
    """Minimize a function within bounds and inequality constraints, using given derivatives."""
    from scipy.optimize import minimize  # noqa: PLC0415 - keeps `import pretouch` fast

    limits = [] if slack is None else [{"type": "ineq", "fun": slack[0], "jac": slack[1]}]
    options: Any = {"maxiter": _ITERATIONS, "ftol": 1e-14}
    result = minimize(value, start, jac=slope, method="SLSQP", bounds=bounds, constraints=limits, options=options)
    return np.asarray(result.x, dtype=np.float64)


def _to_feasible(
    trials: Trials, at: FloatArray, merit: Callable[[FloatArray], float]
) -> tuple[FloatArray, FloatArray] | None:
    """Move a search point to nearby bounds if this improves it."""
    if not np.isfinite(at).all():
        return None
    moved = np.where(at <= _NEAR, 0.0, np.where(at >= 1 - _NEAR, 1.0, at))
    points = np.stack([at, moved])
    values = trials.values(points)
    inner, bound = (merit(v) if np.isfinite(v).all() else np.inf for v in values)
    best = int(bound <= inner + _SAME * abs(inner)) if np.isfinite(inner) else 1
    return (points[best], values[best]) if np.isfinite(values[best]).all() else None


def kkt_residual(trials: Trials, at: FloatArray, weights: FloatArray) -> tuple[float, tuple[str, ...], FloatArray]:
    """Measure the violation of the first-order optimality conditions.

    These are the conditions of Karush, Kuhn and Tucker. The multipliers are the nonnegative least-squares solution,
    independent of the search.

    Returns:
        The largest component of the gradient of the Lagrangian in coordinates in [0, 1], relative to the value; the
        names of active limits and bounds (`natural_frequency: lower bound`); their multipliers, relative to the value.
    """
    from scipy.optimize import nnls  # noqa: PLC0415

    count = len(trials.measures)
    rows, slopes = trials.differentiate(at)
    value = float(weights @ rows[:count]) or 1.0
    gradient = weights @ slopes[:count] / value
    names, normals = [], []
    for i, constraint in enumerate(trials.constraints):
        if rows[count + i] > HELD - _CLOSE:
            names.append(constraint.name)
            normals.append(slopes[count + i])
    for j, name in enumerate(trials.freedom.names):
        for end, sign, which in ((0.0, -1.0, "lower"), (1.0, 1.0, "upper")):
            if abs(at[j] - end) <= _CLOSE:
                names.append(f"{name}: {which} bound")
                normals.append(sign * np.eye(len(at))[j])
    if not normals:
        return float(np.abs(gradient).max()), (), np.zeros(0)
    multipliers, _ = nnls(np.array(normals).T, -gradient)
    residual = gradient + np.array(normals).T @ multipliers
    return float(np.abs(residual).max()), tuple(names), np.asarray(multipliers)
