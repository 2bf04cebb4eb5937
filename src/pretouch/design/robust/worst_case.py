"""The gain whose worst encounter is the mildest: a few encounters decide, and none of the others is worse."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.uncertainty import Distribution, Interval, Uncertainty, sample_inputs

from ..search import GainAxis, Minimum, Scan, search_axis
from ..search.box_maximum import CertifiedMaximum, Function, maximize_on_box
from ..task import Task
from .problem import RobustProblem
from .validation import WorstEncounter

__all__ = ["box_of", "search_worst_case"]

_MOST_INPUTS: Final = 8
_INSIDE: Final = 64  # points inside the box to begin with
_ROUNDS: Final = 30
_SAME: Final = 1e-9  # of the objective: two worst encounters that are equally bad
_TOLERANCE: Final = 1e-7  # of the objective, for a worst encounter inside the box
_ACTIVE: Final = 1e-7  # of the objective: an encounter that is as bad decides, too
_STEP: Final = 1e-4  # of an input's range, where a difference stands for a gradient


def box_of(uncertainty: Uncertainty) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of each input by name; refuse one without bounds, and too many."""
    if len(uncertainty) > _MOST_INPUTS:
        raise InvalidInputError(
            f"uncertainty: found {len(uncertainty)} inputs for a worst case, expected at most {_MOST_INPUTS}: "
            f"a box has 2^n corners"
        )
    found = {}
    for name, known in uncertainty.items():
        support = known.support if isinstance(known, Distribution) else (-np.inf, np.inf)
        if not np.isfinite(support).all():
            raise InvalidInputError(
                f"uncertainty {name}: found {type(known).__name__}, which has no bounds, for a worst case; use an "
                "Interval, or a TruncatedNormal with both bounds"
            )
        found[name] = support
    return found


# Over all corners of the box of inputs, its middle and points inside, the largest objective is minimized. At the gain
# found the worst encounter of the whole box is searched for and certified (`search.box_maximum`). If it is worse than
# those that were taken into account it joins them, and the gain is sought anew (Blankenship and Falk, J. Optim. Theory
# Appl. 19 (1976) 261). So the last minimum is what no gain gets below, the certified maximum what the gain never
# exceeds, and their difference is all that is not known.
def search_worst_case(task: Task, axis: GainAxis) -> tuple[RobustProblem, Scan, list[Minimum], WorstEncounter | None]:
    """Find the gain whose worst encounter is the mildest; return the last round and the worst encounter at the best."""
    box = box_of(task.uncertainty)
    low, high = (np.array(ends) for ends in zip(*box.values(), strict=True))
    points = _first_points(box)
    for _ in range(_ROUNDS):
        problem = RobustProblem.over(task, axis, dict(zip(box, points.T, strict=True)))
        scanned, minima = search_axis(problem.landscape, problem.lowest_needed(), problem.axis.span[1])
        if not minima:
            return problem, scanned, minima, None
        gain, decided = float(problem.axis.gain(minima[0].coordinate)), minima[0].value
        found = [
            maximize_on_box(_function(problem, box, gain, which), low, high, tolerance=_TOLERANCE)
            for which in range(-1, len(problem.limits))
        ]
        allowed = (decided, *(1.0 for _ in problem.limits))
        worse = [f.point for f, most in zip(found, allowed, strict=True) if f.value > most * (1 + _SAME)]
        if not worse:
            break
        points = np.concatenate([points, worse])
    return problem, scanned, minima, _worst(found[0], decided, tuple(box), problem, gain)


def _first_points(box: Mapping[str, tuple[float, float]]) -> FloatArray:
    """Return the corners of a box, its middle, and points inside."""
    corners = np.array(list(product(*box.values())))
    middle = np.array([[0.5 * (low + high) for low, high in box.values()]])
    inside = sample_inputs({name: Interval(low=low, high=high) for name, (low, high) in box.items()}, _INSIDE)
    return np.concatenate([corners, middle, np.stack([inside[name] for name in box], axis=1)])


def _function(problem: RobustProblem, box: Mapping[str, tuple[float, float]], gain: float, which: int) -> Function:
    """Return the objective (-1) or the ratio of a constraint as a function of the inputs, with its gradient."""
    names = tuple(box)
    low, high = (np.array(ends) for ends in zip(*box.values(), strict=True))

    def at(points: FloatArray) -> RobustProblem:
        return RobustProblem.over(problem.task, problem.axis, dict(zip(names, points.T, strict=True)))

    def value(points: FloatArray) -> FloatArray:
        objective, ratios = at(points).values(gain)
        return objective if which < 0 else ratios[which]

    def both(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        found = value(points)
        if not np.isfinite(found).all():
            return found, np.full(points.shape, np.nan)
        if problem.criterion(which).has_gradients:
            inner = at(points)
            result = inner.ensemble.contacts(gain)
            return found, np.stack([inner.slope(result, name, which) for name in names], axis=1)
        slopes = []
        for j, step in enumerate(_STEP * (high - low)):
            ahead, behind = points.copy(), points.copy()
            ahead[:, j] = np.minimum(points[:, j] + step, high[j])
            behind[:, j] = np.maximum(points[:, j] - step, low[j])
            slopes.append((value(ahead) - value(behind)) / (ahead[:, j] - behind[:, j]))
        return found, np.stack(slopes, axis=1)

    return both


def _worst(
    found: CertifiedMaximum, decided: float, names: tuple[str, ...], problem: RobustProblem, gain: float
) -> WorstEncounter:
    """Put together what is known of the worst encounter."""
    values = problem.values(gain)[0]
    points = np.stack([problem.ensemble.values[name] for name in names], axis=1)
    deciding = np.unique(points[values >= decided * (1 - _ACTIVE)], axis=0)
    return WorstEncounter(
        inputs=dict(zip(names, found.point.tolist(), strict=True)),
        value=found.value,
        bound=found.bound,
        lower=min(decided, found.bound),  # where they meet, each comes by a path of its own
        boxes=found.boxes,
        monotone={name: sign for name, sign in zip(names, found.signs, strict=True) if sign},
        encounters=tuple(map(tuple, deciding.tolist())),
    )
