"""Local search from a given point with SciPy's sequential quadratic programming, and what says that it has arrived."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray

from .scan import HELD
from .trials import Trials

__all__ = ["advance", "descend", "kkt_residual"]

_FAR: Final = 1e3  # what stands for a row without contact, beside rows of about 1
_ITERATIONS: Final = 120
_CLOSE: Final = 1e-6  # of a limit or a bound: active
_NEAR: Final = 1e-9  # of the range: where a bound so near is as good, it is meant; the solver stops a rounding before
_SAME: Final = 1e-12  # of a value, to which encounters are known
_INSIDE: Final = 1e-10  # of a limit, by which the search stays below it: what an SQP step leaves


@dataclass(slots=True)
class _Memory:
    """Rows and derivatives of the last point: a solver asks for each of them in turn."""

    trials: Trials
    scale: FloatArray
    at: FloatArray | None = None
    rows: FloatArray | None = None
    slopes: FloatArray | None = None

    def ask(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return rows and derivatives, each row over its scale."""
        if self.rows is None or self.slopes is None or self.at is None or not np.array_equal(at, self.at):
            at = np.clip(at, 0.0, 1.0)
            rows, slopes = self.trials.differentiate(at)
            rows = np.where(np.isfinite(rows), rows / self.scale, _FAR)
            self.at, self.rows, self.slopes = at.copy(), rows, slopes / self.scale[:, None]
        return self.rows, self.slopes


def descend(trials: Trials, start: FloatArray, weights: FloatArray) -> FloatArray | None:
    """Minimize a weighted sum of the measures within limits and bounds, from a start.

    Args:
        trials: the encounters.
        start: coordinates, shape (size,).
        weights: one per measure, positive or zero.

    Returns:
        The coordinates of a feasible point, or None where the search ends at none.
    """
    count, ratios = len(trials.measures), len(trials.constraints)
    memory = _Memory(trials, np.ones(count + ratios))
    first = float(weights @ memory.ask(start)[0][:count]) or 1.0
    limits = [
        {
            "type": "ineq",
            "fun": lambda z: 1 - _INSIDE - memory.ask(z)[0][count:],
            "jac": lambda z: -memory.ask(z)[1][count:],
        }
    ]
    found = _minimize(
        lambda z: float(weights @ memory.ask(z)[0][:count]) / first,
        lambda z: weights @ memory.ask(z)[1][:count] / first,
        start,
        limits if ratios else [],
        [(0.0, 1.0)] * len(start),
    )
    return _settled(trials, np.clip(found, 0.0, 1.0), lambda z: float(weights @ trials.values(z[None])[0]))


def advance(
    trials: Trials, start: FloatArray, origin: FloatArray, scale: FloatArray
) -> tuple[FloatArray, float] | None:
    """Go from a point of the plane of quantities toward lower ones in all alike, as far as encounters reach.

    The least t with quantities <= origin + t scale (Pascoletti and Serafini 1984): the front's point on that ray.

    Args:
        trials: the encounters.
        start: coordinates to begin from, shape (size,).
        origin: a point of the plane, shape (measures,).
        scale: how far each quantity goes along the ray, shape (measures,).

    Returns:
        The coordinates of a feasible point and its t, or None where the search ends at none.
    """
    count = len(trials.measures)
    memory = _Memory(trials, np.concatenate([scale, np.ones(len(trials.constraints))]))
    goal = origin / scale

    def room(z: FloatArray) -> FloatArray:
        rows = memory.ask(z[:-1])[0]
        return np.concatenate([z[-1] + goal - rows[:count], 1 - _INSIDE - rows[count:]])

    def room_slope(z: FloatArray) -> FloatArray:
        slopes = -memory.ask(z[:-1])[1]
        return np.column_stack([slopes, np.where(np.arange(len(slopes)) < count, 1.0, 0.0)])

    t = float((memory.ask(start)[0][:count] - goal).max())
    up = np.append(np.zeros(len(start)), 1.0)
    found = _minimize(
        lambda z: float(z[-1]),
        lambda _: up,
        np.append(start, t),
        [{"type": "ineq", "fun": room, "jac": room_slope}],
        [*[(0.0, 1.0)] * len(start), (None, None)],
    )

    def missed(z: FloatArray) -> float:
        return float((trials.values(z[None])[0] / scale - goal).max())

    at = _settled(trials, np.clip(found[:-1], 0.0, 1.0), missed)
    return None if at is None else (at, missed(at))


def _minimize(value: Any, slope: Any, start: FloatArray, constraints: Any, bounds: Any) -> FloatArray:
    from scipy.optimize import minimize  # noqa: PLC0415 - `import pretouch` stays quick

    found = minimize(
        value,
        start,
        jac=slope,
        method="SLSQP",
        bounds=bounds,
        constraints=constraints,
        options={"maxiter": _ITERATIONS, "ftol": 1e-14},
    )
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

    Args:
        trials: the encounters.
        at: coordinates, shape (size,).
        weights: one per measure.

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
