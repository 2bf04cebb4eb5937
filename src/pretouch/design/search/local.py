"""Local search from a given point with SciPy's sequential quadratic programming, and what says that it has arrived."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.numbers import FloatArray

from .scan import HELD
from .trials import Trials

_FAR: Final = 1e3  # what stands for a row without contact, beside rows of about 1
_ITERATIONS: Final = 120
_CLOSE: Final = 1e-6  # of a limit or a bound: active
_NEAR: Final = 1e-9  # of the range: where a bound so near is as good, it is meant; the solver stops a rounding before
_SAME: Final = 1e-12  # of a value, to which encounters are known
_INSIDE: Final = 1e-10  # of a limit, by which the search stays below it: what an SQP step leaves


Ask: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From coordinates to rows and derivatives, each row over its scale."""


def _remembered(trials: Trials, scale: FloatArray) -> Ask:
    """Return what asks for rows and derivatives and remembers the last point: a solver asks for each in turn."""
    last: dict[bytes, tuple[FloatArray, FloatArray]] = {}

    def ask(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        key = at.tobytes()
        if key not in last:
            last.clear()
            rows, slopes = trials.differentiate(np.clip(at, 0.0, 1.0))
            last[key] = np.where(np.isfinite(rows), rows / scale, _FAR), slopes / scale[:, None]
        return last[key]

    return ask


def descend(trials: Trials, start: FloatArray, weights: FloatArray) -> FloatArray | None:
    """Minimize a weighted sum of the measures within limits and bounds, from a start; None if it ends at no point."""
    count, ratios = len(trials.measures), len(trials.constraints)
    ask = _remembered(trials, np.ones(count + ratios))
    first = float(weights @ ask(start)[0][:count]) or 1.0
    found = _minimize(
        lambda z: float(weights @ ask(z)[0][:count]) / first,
        lambda z: weights @ ask(z)[1][:count] / first,
        start,
        (lambda z: 1 - _INSIDE - ask(z)[0][count:], lambda z: -ask(z)[1][count:]) if ratios else None,
        [(0.0, 1.0)] * len(start),
    )
    return _settled(trials, np.clip(found, 0.0, 1.0), lambda z: float(weights @ trials.values(z[None])[0]))


def advance(
    trials: Trials, start: FloatArray, origin: FloatArray, scale: FloatArray
) -> tuple[FloatArray, float] | None:
    """Return the front's point on a ray from an origin in the plane of quantities, and its t; None if there is none."""
    # the least t with quantities <= origin + t scale (Pascoletti and Serafini 1984), from coordinates to start with
    count = len(trials.measures)
    ask = _remembered(trials, np.concatenate([scale, np.ones(len(trials.constraints))]))
    goal = origin / scale

    def room(z: FloatArray) -> FloatArray:
        rows = ask(z[:-1])[0]
        return np.concatenate([z[-1] + goal - rows[:count], 1 - _INSIDE - rows[count:]])

    def room_slope(z: FloatArray) -> FloatArray:
        slopes = -ask(z[:-1])[1]
        return np.column_stack([slopes, np.where(np.arange(len(slopes)) < count, 1.0, 0.0)])

    t = float((ask(start)[0][:count] - goal).max())
    up = np.append(np.zeros(len(start)), 1.0)
    found = _minimize(
        lambda z: float(z[-1]),
        lambda _: up,
        np.append(start, t),
        (room, room_slope),
        [*[(0.0, 1.0)] * len(start), (None, None)],
    )

    def missed(z: FloatArray) -> float:
        return float((trials.values(z[None])[0] / scale - goal).max())

    at = _settled(trials, np.clip(found[:-1], 0.0, 1.0), missed)
    return None if at is None else (at, missed(at))


def _minimize(value: Any, slope: Any, start: FloatArray, room: Any, bounds: Any) -> FloatArray:
    """Minimize within bounds and, where there is some, with room that stays positive, both with their derivatives."""
    from scipy.optimize import minimize  # noqa: PLC0415 - `import pretouch` stays quick

    limits = [] if room is None else [{"type": "ineq", "fun": room[0], "jac": room[1]}]
    options: Any = {"maxiter": _ITERATIONS, "ftol": 1e-14}
    found = minimize(value, start, jac=slope, method="SLSQP", bounds=bounds, constraints=limits, options=options)
    return np.asarray(found.x, dtype=np.float64)


def _settled(trials: Trials, at: FloatArray, value: Callable[[FloatArray], float]) -> FloatArray | None:
    """Return a point if it is feasible, on the bounds that it is near if that is as good."""
    there = np.where(at <= _NEAR, 0.0, np.where(at >= 1 - _NEAR, 1.0, at))
    kept, bound = _kept(trials, at), _kept(trials, there)
    if kept is None or bound is None or np.array_equal(at, there):
        return bound if kept is None else kept
    own = value(kept)
    return bound if value(bound) <= own + _SAME * abs(own) else kept


def _kept(trials: Trials, at: FloatArray) -> FloatArray | None:
    """Return a point if it is feasible."""
    return at if np.isfinite(at).all() and np.isfinite(trials.values(at[None])).all() else None


def kkt_residual(trials: Trials, at: FloatArray, weights: FloatArray) -> tuple[float, tuple[str, ...], FloatArray]:
    """Tell how well a point meets the first-order conditions (Karush, Kuhn and Tucker) of a weighted sum.

    Multipliers are those, not negative, that come nearest to balancing the gradient; the search had no part in them.

    Returns:
        What remains of the gradient by coordinates in [0, 1], over the value; the names of active limits and bounds
        (`natural_frequency: lower bound`); and their multipliers, over the value.
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
    left = gradient + np.array(normals).T @ multipliers
    return float(np.abs(left).max()), tuple(names), np.asarray(multipliers)
