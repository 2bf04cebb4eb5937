"""Find the optimal gains of many encounters at once.

Every encounter is scanned at the same gains. A minimum inside the bounds is refined by a polynomial through the nodes
of its bracket. An encounter without a certain result, by the criteria of the single design, is designed individually.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray

from ..certificate import DesignStatus
from ..problem import GainProblem
from .compiled import INFEASIBLE, UNCERTAIN, search_compiled
from .family import find_family
from .polynomials import NODES, interpolate, minimize_polynomials
from .scan import EXACT, predict

_BLOCK: Final = 8192  # designs that are scanned together, with 65 encounters each
_COUNTS: Final = (EXACT.first, 2 * EXACT.first - 1, 4 * EXACT.first - 3)  # gains of ever finer scans

Found: TypeAlias = tuple[DesignStatus, float | None, float | None]
"""Status, gain and objective of one design."""


def design_many(problem: GainProblem, search_one: Callable[[GainProblem], Found]) -> tuple[Any, Any, Any]:
    """Return status, optimal gain and objective for every encounter of an array.

    Gains and objectives are NaN unless optimal; `search_one` solves difficult encounters.
    """
    shape = problem.task.scenario.shape
    free = problem.within_gain_limit()
    family = find_family(free)
    if family is not None and family[2].all():
        optimal = np.broadcast_to(np.array(DesignStatus.OPTIMAL.value, dtype="<U10"), shape)
        return optimal, family[0].reshape(shape), family[1].reshape(shape)
    size = int(np.prod(shape, dtype=np.int64))
    status = np.full(size, DesignStatus.OPTIMAL.value, dtype="<U10")
    gain, objective = np.full(size, np.nan), np.full(size, np.nan)
    waiting = np.arange(size)
    for again in (False, True):
        tried = search_compiled(free.column(waiting)) if again else family
        if tried is not None:
            settled = tried[2] != UNCERTAIN
            status[waiting[tried[2] == INFEASIBLE]] = DesignStatus.INFEASIBLE.value
            gain[waiting[settled]], objective[waiting[settled]] = tried[0][settled], tried[1][settled]
            waiting = waiting[~settled]
    for start in range(0, len(waiting), _BLOCK):
        which = waiting[start : start + _BLOCK]
        for count in () if problem.is_noisy else _COUNTS:  # splitting into blocks would change each encounter's noise
            best, value, settled = _design_block(free.column(which), count)
            gain[which[settled]], objective[which[settled]] = best[settled], value[settled]
            which = which[~settled]
            if not len(which):
                break
        for i in which:
            index = tuple(int(k) for k in np.unravel_index(i, shape))
            result, best_gain, lowest = search_one(problem.at(index))
            status[i] = result.value
            if best_gain is not None and lowest is not None:
                gain[i], objective[i] = best_gain, lowest
    return status.reshape(shape), gain.reshape(shape), objective.reshape(shape)


def settle_one(problem: GainProblem) -> tuple[float, float] | None:
    """Find the optimal gain of one encounter.

    The search evaluates a fixed grid of gains.

    Returns:
        The gain and its objective; None if the result is uncertain.
    """
    gain, objective, settled = _design_block(problem, EXACT.first)
    return (float(gain[0]), float(objective[0])) if settled[0] else None


def _design_block(problem: GainProblem, count: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Find the optimal gains of many encounters."""
    u = np.linspace(*problem.axis.span, count)
    scanned = problem.landscape(u[None])
    every, merit = scanned.objective, scanned.merit
    settled = scanned.feasible.all(axis=1)  # an edge of contact or of a limit needs the adaptive scan
    with np.errstate(invalid="ignore"):
        predicted = predict(u[::2], every[:, ::2], np.arange(count // 2))
        error = np.abs(predicted / every[:, 1::2] - 1).max(axis=1)
    settled &= error <= EXACT.resolved
    best = np.argmin(merit, axis=1)
    lower, upper = np.clip(best - 1, 0, None), np.clip(best + 1, None, count - 1)
    settled &= (best > 0) & (best < count - 1) & (_count_minima(merit) == 1)
    middle, half = (u[lower] + u[upper]) / 2, (u[upper] - u[lower]) / 2
    values = problem.landscape(middle[:, None] + half[:, None] * NODES).objective
    z, polished = minimize_polynomials(values)
    return np.asarray(problem.axis.gain(middle + half * z)), interpolate(values, z), settled & polished


def _count_minima(merit: FloatArray) -> Any:
    padded = np.pad(merit, ((0, 0), (1, 1)), constant_values=np.inf)
    return ((merit <= padded[:, :-2]) & (merit < padded[:, 2:]) & np.isfinite(merit)).sum(axis=1)
