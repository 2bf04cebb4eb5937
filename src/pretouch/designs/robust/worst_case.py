"""Find the gain with the smallest worst-case objective.

Each uncertain input lies within an interval.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.uncertainty import Distribution, Interval, sample_inputs

from ..relaxation import Relaxation, relax_on_axis
from ..search import GainAxis, Minimum, Scan, search_axis
from ..search.box_maximum import CertifiedMaximum, Function, maximize_on_box
from ..task import Task
from .problem import RobustProblem

_MOST_INPUTS: Final = 8
_INSIDE: Final = 64  # initial points inside the box
_ROUNDS: Final = 30
_SAME: Final = 1e-9  # two objectives within this relative difference are equal
_TOLERANCE: Final = 1e-7  # relative tolerance of the certified maximum
_DECIDING: Final = 1e-7  # encounters within this relative difference of the worst one are reported as deciding
_RAISES: Final = 6  # most searches for one relaxation
_NARROW: Final = 1e-6  # m: smallest range of positions
_STEP: Final = 1e-4  # step of differences that replace a gradient, as a share of an input's range


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstEncounter(Value):
    """The worst possible encounter with one gain.

    Args:
        inputs: the inputs of the encounter by name, in SI.
        value: its objective.
        bound: upper bound of the objective of all possible encounters, certified by the search over boxes.
        lower: no gain has a smaller worst case than this bound, which follows from `encounters` alone, except next to a
            jump from which the gain keeps a distance.
        boxes: number of boxes of inputs in the search.
        monotone: inputs in which the objective only grows (1) or only falls (-1) over the whole box.
        encounters: the encounters that decide the gain, as rows of inputs in the order of `inputs`.
    """

    inputs: dict[str, float]
    value: float
    bound: float
    lower: float
    boxes: int
    monotone: dict[str, int]
    encounters: tuple[tuple[float, ...], ...]


def box_of(task: Task) -> dict[str, tuple[float, float]]:
    """Return the range of each uncertain input.

    Encounters that start undetected run as those that start where the controller of the loop detects the object.

    Raises:
        InvalidInputError: an input is unbounded, or there are too many inputs.
    """
    uncertainty = task.uncertainty
    if len(uncertainty) > _MOST_INPUTS:
        raise InvalidInputError(
            f"uncertainty: found {len(uncertainty)} uncertain inputs for a worst case, expected at most "
            f"{_MOST_INPUTS} inputs. The search evaluates 2^n combinations of n inputs",
            limit=_MOST_INPUTS,
        )
    box = {}
    for name, distribution in uncertainty.items():
        support = distribution.support if isinstance(distribution, Distribution) else (-np.inf, np.inf)
        if not np.isfinite(support).all():
            raise InvalidInputError(
                f"uncertainty {name}: found {type(distribution).__name__}, which has no bounds, expected a bounded "
                "distribution for a worst case. Use an Interval, or a TruncatedNormal with two bounds"
            )
        box[name] = support
    name = "obstacle.position"
    if name in box:
        _, plant = box.get("plant.position", (float(task.scenario.plant.position),) * 2)
        (low, high), farthest = box[name], plant + task.farthest_start
        box[name] = min(low, farthest - _NARROW), min(high, farthest)
    return box


# The algorithm is that of Blankenship and Falk (J. Optim. Theory Appl. 19 (1976) 261). It minimizes the largest
# objective over a finite set of encounters: the corners of the box of inputs, its middle and points inside. At the
# optimal gain, it finds and certifies the worst encounter of the whole box (`search.box_maximum`). If that encounter is
# worse than the set, it joins the set, and the gain is optimized again. So the last minimum is a lower bound for all
# gains, and the certified maximum is an upper bound for the optimal gain. Their difference is the optimality gap.
def search_worst_case(task: Task, axis: GainAxis) -> tuple[RobustProblem, Scan, list[Minimum], WorstEncounter | None]:
    """Find the gain with the smallest worst-case objective.

    The last problem, its scan and its minima are returned as well.

    Returns:
        The problem, the scan, its minima, and the encounter in which the worst case occurs.
    """
    box = box_of(task)
    low, high = (np.array(ends) for ends in zip(*box.values(), strict=True))
    points = _first_points(box)
    for _ in range(_ROUNDS):
        problem = RobustProblem.over(task, axis, dict(zip(box, points.T, strict=True)))
        scanned, minima = search_axis(problem.landscape, problem.lowest_needed(), axis.span[1], reserve=axis.reserve)
        if not minima:
            return problem, scanned, minima, None
        gain, lower = float(problem.axis.gain(minima[0].coordinate)), minima[0].value
        maxima = [
            maximize_on_box(_function(problem, box, gain, which), low, high, tolerance=_TOLERANCE)
            for which in range(-1, len(problem.limits))
        ]
        allowed = (lower, *(1.0 for _ in problem.limits))
        worse = [m.point for m, most in zip(maxima, allowed, strict=True) if m.value > most * (1 + _SAME)]
        if not worse:
            break
        points = np.concatenate([points, worse])
    return problem, scanned, minima, _worst(maxima[0], lower, tuple(box), problem, gain)


def confirm_relaxations(problem: RobustProblem, relaxations: Sequence[Relaxation]) -> tuple[Relaxation, ...]:
    """Raise limits further until a gain meets them for all values of the inputs.

    A relaxation is computed from a finite set of encounters. With the raised limits, another encounter may be the worst
    one.

    Returns:
        The relaxations with which the search finds a gain.
    """
    confirmed = []
    for relaxation in relaxations:
        tried: Relaxation | None = relaxation
        for _ in range(_RAISES):
            if tried is None:
                break
            raised = {limit.name: limit.raised for limit in tried.limits}
            limits = tuple(
                replace(r, constraint=replace(r.constraint, limit=raised.get(r.constraint.name, r.constraint.limit)))
                for r in problem.limits
            )
            again, scanned, minima, _ = search_worst_case(problem.task.replace(constraints=limits), problem.axis)
            if minima:
                gain = float(problem.axis.gain(minima[0].coordinate))
                confirmed.append(replace(tried, gain=gain))
                break
            more = relax_on_axis(
                again.landscape, again.axis, scanned, [r.constraint for r in limits], number=problem.task.law.number
            )
            tried = _raised_further(tried, more)
    return tuple(confirmed)


def _raised_further(relaxation: Relaxation, more: Sequence[Relaxation]) -> Relaxation | None:
    """Return a relaxation of the same limits with higher values; None if these limits do not suffice."""
    for one in more:
        higher = {limit.name: limit.raised for limit in one.limits}
        if set(higher) <= {limit.name for limit in relaxation.limits}:
            limits = (replace(limit, raised=higher.get(limit.name, limit.raised)) for limit in relaxation.limits)
            return replace(relaxation, limits=tuple(limits))
    return None


def _first_points(box: Mapping[str, tuple[float, float]]) -> FloatArray:
    """Return corners, middle and inner points of the input ranges, where the worst-case search starts."""
    corners = np.array(list(product(*box.values())))
    middle = np.array([[0.5 * (low + high) for low, high in box.values()]])
    inside = sample_inputs({name: Interval(low=low, high=high) for name, (low, high) in box.items()}, _INSIDE)
    return np.concatenate([corners, middle, np.stack([inside[name] for name in box], axis=1)])


def _function(problem: RobustProblem, box: Mapping[str, tuple[float, float]], gain: float, which: int) -> Function:
    """Return the objective or a constraint as a function of the inputs. The function also returns the gradient."""
    names = tuple(box)
    low, high = (np.array(ends) for ends in zip(*box.values(), strict=True))

    def at(points: FloatArray) -> RobustProblem:
        return RobustProblem.over(problem.task, problem.axis, dict(zip(names, points.T, strict=True)))

    def value(points: FloatArray) -> FloatArray:
        objective, ratios = at(points).values(gain)
        return objective if which < 0 else ratios[which]

    def both(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        values = value(points)
        if not np.isfinite(values).all():
            return values, np.full(points.shape, np.nan)
        if problem.has_slopes(which):
            inner = at(points)
            result = inner.ensemble.contacts(gain)
            return values, np.stack([inner.slope(result, name, which) for name in names], axis=1)
        slopes = []
        for j, step in enumerate(_STEP * (high - low)):
            ahead, behind = points.copy(), points.copy()
            ahead[:, j] = np.minimum(points[:, j] + step, high[j])
            behind[:, j] = np.maximum(points[:, j] - step, low[j])
            slopes.append((value(ahead) - value(behind)) / (ahead[:, j] - behind[:, j]))
        return values, np.stack(slopes, axis=1)

    return both


def _worst(
    maximum: CertifiedMaximum, lower: float, names: tuple[str, ...], problem: RobustProblem, gain: float
) -> WorstEncounter:
    """Return the worst encounter with one gain."""
    values = problem.values(gain)[0]
    points = np.stack([problem.ensemble.values[name] for name in names], axis=1)
    deciding = np.unique(points[values >= lower * (1 - _DECIDING)], axis=0)
    return WorstEncounter(
        inputs=dict(zip(names, maximum.point.tolist(), strict=True)),
        value=maximum.value,
        bound=maximum.bound,
        lower=min(lower, maximum.bound),  # equal bounds may differ by rounding, since they are computed differently
        boxes=maximum.boxes,
        monotone={name: sign for name, sign in zip(names, maximum.signs, strict=True) if sign},
        encounters=tuple(map(tuple, deciding.tolist())),
    )
