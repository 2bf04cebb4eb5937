"""Find the intervals of a scan that may contain feasible coordinates between infeasible ones."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

from .landscape import HELD, Landscape

_EDGE: Final = 1e-3  # share of the axis: largest interval in which feasibility may change
_NARROW: Final = 1 / 8  # the same as a share of the feasible range next to it
_FIRST: Final = -1.0  # priority of an edge: below every ratio, so that a band is resolved before another one is sought


def doubtful_bands(u: FloatArray, landscape: Landscape, finest: float, rounding: float) -> FloatArray:
    """Rate each interval of a scan by the smallest violation that it may contain.

    An interval between two infeasible coordinates may contain feasible ones if no ratio certainly exceeds its limit in
    it (`least_between`). An interval from an infeasible coordinate to one without contact may contain them too, because
    ratios such as the contact speed can fall to 0 at the edge of contact. Both matter only if the objective may be
    better there than at every feasible coordinate. An edge between feasible and infeasible coordinates is resolved to
    1e-3 of the axis, and to an eighth of a narrow feasible range.

    Args:
        u: the coordinates, ascending, shape (n,).
        landscape: objective and constraints at the coordinates.
        finest: the smallest width of an interval that is halved to look for feasible coordinates.
        rounding: the smallest width of an interval that is halved to resolve an edge.

    Returns:
        The estimated smallest value of the worst ratio in each interval, shape (n - 1,); -1 for an edge that is too
        wide; infinite for an interval that need not be halved.
    """
    wide, count = np.diff(u), len(u)
    worst = landscape.violation
    objective = landscape.objective.reshape(-1, count)
    feasible, reached = worst <= HELD, np.isfinite(worst) & np.isfinite(objective).all(axis=0)
    doubt = np.full(count - 1, np.inf)
    touching = reached[:-1] != reached[1:]
    if len(landscape.ratios):
        both = reached[:-1] & reached[1:] & ~feasible[:-1] & ~feasible[1:]
        least = least_between(u, landscape.ratios).max(axis=0)
        at_contact = touching & ~feasible[:-1] & ~feasible[1:]
        seen = (both & (least <= HELD) | at_contact) & (wide > finest)
        if feasible.any() and len(objective) == 1:
            seen &= _least_objective(u, objective[0], touching) <= objective[0][feasible].min()
        doubt[seen] = np.where(both, least, np.minimum(worst[:-1], worst[1:]))[seen]
    apart = _EDGE * (u[-1] - u[0])
    allowed = np.minimum(apart, np.maximum(rounding, _NARROW * _next_to(u, feasible)))
    changes = (feasible[:-1] != feasible[1:]) & (wide > allowed) | touching & (wide > apart)
    doubt[changes] = _FIRST
    return doubt


def least_between(u: FloatArray, rows: FloatArray) -> FloatArray:
    """Estimate the smallest value of functions between neighboring coordinates.

    Let d be the width of an interval, times the larger change of slope at its two ends. Inside, the function leaves the
    range of its end values by at most d / 2, also at a corner. If its end values differ by more than d, it is monotone.
    These are estimates from the neighbors, and no proof.

    Args:
        u: the coordinates, ascending, shape (n,).
        rows: values of the functions, shape (..., n); not finite where they are undefined.

    Returns:
        The estimates, shape (..., n - 1).
    """
    wide = np.diff(u)
    with np.errstate(invalid="ignore", over="ignore"):
        step = np.diff(rows, axis=-1)
        turn = np.abs(np.diff(step / wide, axis=-1))
        turn = np.where(np.isfinite(turn), turn, 0.0)
        none = np.zeros((*turn.shape[:-1], 1))
        bend = wide * np.maximum(np.concatenate([none, turn], axis=-1), np.concatenate([turn, none], axis=-1))
        low = np.minimum(rows[..., :-1], rows[..., 1:])
        return np.asarray(np.where(np.abs(step) > bend, low, low - 0.5 * bend))


def lowest_doubts(doubt: FloatArray, room: int) -> BoolArray:
    """Select the intervals with the lowest estimates, at most as many as there is room for."""
    selected = np.zeros(len(doubt), dtype=bool)
    order: IntArray = np.argsort(doubt, kind="stable")[: max(room, 0)]
    selected[order] = True
    return np.asarray(selected & np.isfinite(doubt))


def _least_objective(u: FloatArray, objective: FloatArray, touching: BoolArray) -> FloatArray:
    """Estimate the smallest objective in each interval, also toward an edge of contact."""
    least = least_between(u, objective)
    with np.errstate(invalid="ignore"):
        step = np.abs(np.diff(objective) / np.diff(u))
    step = np.where(np.isfinite(step), step, 0.0)
    slope = np.maximum(np.append(0.0, step[:-1]), np.append(step[1:], 0.0))
    return np.asarray(np.where(touching, least - 2 * slope * np.diff(u), least))


def _next_to(u: FloatArray, feasible: BoolArray) -> FloatArray:
    """Return the width of the feasible range at either end of each interval; infinite without one."""
    padded = np.concatenate([[False], feasible, [False]])
    first = np.flatnonzero(padded[1:-1] & ~padded[:-2])
    last = np.flatnonzero(padded[1:-1] & ~padded[2:])
    width = np.full(len(u), np.inf)
    width[feasible] = np.repeat(u[last] - u[first], last - first + 1)
    return np.asarray(np.minimum(width[:-1], width[1:]))
