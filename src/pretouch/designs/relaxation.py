"""Find the limits that must be raised, and to what values, so that an infeasible task becomes feasible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, Context, Decimal
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.motion import LawNumber

from .constraints import Constraint
from .problem import GainProblem, ratio
from .search import HELD, Effort, GainAxis, Landscape, Scan, search_axis
from .search.landscape import Evaluate
from .search.local import descend, reduce_violation
from .search.scan import EXACT
from .search.trials import Trials

DIGITS: Final = 3
"""Significant digits of a raised limit."""

_FINEST: Final = 1e-6  # width in u at which the search for a raised limit ends
_ONE: Final = np.ones(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class RaisedLimit(Value):
    """A limit and the value that it must be raised to.

    Args:
        name: name of the constraint, as in a scenario file.
        unit: its SI unit.
        limit: the limit of the task.
        raised: the smallest value that suffices, rounded up to three significant digits.
        source: what in a robot model sets the limit; empty for a limit of the user.
    """

    name: str
    unit: str
    limit: float
    raised: float
    source: str = ""

    def __str__(self) -> str:
        limit, raised = (format_quantity(value, self.unit, 4) for value in (self.limit, self.raised))
        return f"{self.name} from {limit} to {raised}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Relaxation(Value):
    """Limits that must be raised together so that a gain meets all limits of the task.

    Args:
        limits: the raised limits; all other limits are kept.
        gain: a gain that meets all limits then: the law's number, such as D_p [N s].
    """

    limits: tuple[RaisedLimit, ...]
    gain: float


def round_up(value: float, digits: int = DIGITS) -> float:
    """Round a positive number up to a number of significant digits.

    Returns:
        The smallest number with so many digits that is not below the value.

    Examples:
        >>> round_up(0.0612001), round_up(16.0)
        (0.0613, 16.0)
    """
    return float(Context(prec=digits, rounding=ROUND_CEILING).create_decimal(Decimal(repr(float(value)))))


def relax_on_axis(
    evaluate: Evaluate,
    axis: GainAxis,
    scanned: Scan,
    constraints: Sequence[Constraint],
    *,
    number: LawNumber,
    effort: Effort = EXACT,
) -> tuple[Relaxation, ...]:
    """Find the smallest change of each limit that makes a task feasible.

    For each limit alone, its quantity is minimized over all gains that meet the other limits. If no limit alone
    suffices, the limits that the least violation exceeds must be raised together.

    Args:
        evaluate: a function that maps coordinates to the objective and the ratios |quantity| / limit.
        axis: the search variable of the gain.
        scanned: the scan of the task, which has no feasible coordinate.
        constraints: the limits, in the order of the ratios.
        number: the law's number, for the units of the limits.
        effort: settings of the search.

    Returns:
        The relaxations, the smallest relative change first; empty without contact or without limits.
    """
    nearest = scanned.least_violation
    if nearest is None or not constraints:
        return ()
    found, coarse = [], replace(effort, finest=max(effort.finest, _FINEST), most=2)  # the values are rounded up
    for i, constraint in enumerate(constraints):

        def alone(landscape: Landscape, i: int = i) -> Landscape:
            value = np.where(np.isfinite(landscape.violation), landscape.ratios[i], np.inf)
            return Landscape(objective=value, ratios=np.delete(landscape.ratios, i, axis=0))

        start = replace(scanned, landscape=alone(scanned.landscape))
        _, minima = search_axis(lambda u, alone=alone: alone(evaluate(u)), *axis.span, coarse, start)  # type: ignore[misc]
        if minima:
            gain = float(axis.gain(minima[0].coordinate))
            found.append(_relaxation((constraint,), (minima[0].value,), gain, number))
    if not found:
        ratios = evaluate(np.array([nearest])).ratios[:, 0]
        found.append(_together(constraints, ratios, float(axis.gain(nearest)), number))
    return _ordered(found)


def relax_trials(trials: Trials, nearest: FloatArray) -> tuple[Relaxation, ...]:
    """Find the smallest change of each limit, over several free parameters.

    Args:
        trials: gains and admittances, their limits and encounters.
        nearest: the point with the smallest violation, from which local searches start.

    Returns:
        The relaxations, the smallest relative change first.
    """
    problem, number = trials.encounters, trials.encounters.task.law.number
    found = []
    for i, constraint in enumerate(trials.constraints):
        others = tuple(c for j, c in enumerate(trials.constraints) if j != i)
        free = GainProblem(task=problem.task.replace(constraints=others), axis=problem.axis)
        measure = ratio(constraint, problem.task.impact)
        alone = Trials(freedom=trials.freedom, encounters=free, measures=(measure,))
        start = reduce_violation(alone, nearest) if others else nearest
        points = [start, *(p[0] for p in [descend(alone, start, _ONE)] if p is not None)]
        values = alone.values(np.stack(points))[:, 0]
        best = int(np.argmin(values))
        if np.isfinite(values[best]):
            found.append(_relaxation((constraint,), (values[best],), trials.freedom.choice(points[best])[1], number))
    if not found and trials.constraints:
        ratios = trials.landscape(nearest[None]).ratios[:, 0]
        found.append(_together(trials.constraints, ratios, trials.freedom.choice(nearest)[1], number))
    return _ordered(found)


def relaxations_in_words(relaxations: Sequence[Relaxation]) -> Iterator[str]:
    """Yield each relaxation as a request, such as `raise the limit of excursion from 60 mm to 61.2 mm`."""
    for relaxation in relaxations:
        stated = [str(limit) for limit in relaxation.limits if not limit.source]
        parts = [f"raise the limit{'s' if len(stated) > 1 else ''} of {' and of '.join(stated)}"] if stated else []
        own = [limit for limit in relaxation.limits if limit.source]
        if own:
            parts.append(f"change the robot model or its posture so that it allows {' and '.join(map(_of_robot, own))}")
        yield " and ".join(parts)


def _of_robot(limit: RaisedLimit) -> str:
    """Describe a raised limit of a robot model, such as `3 m/s² of acceleration instead of 1 m/s² (limit: ...)`."""
    before, raised = (format_quantity(value, limit.unit, 4) for value in (limit.limit, limit.raised))
    return f"{raised} of {limit.name} instead of {before} (limit: {limit.source})"


def _relaxation(
    constraints: Sequence[Constraint], ratios: Sequence[float], gain: float, number: LawNumber
) -> Relaxation:
    limits = (
        RaisedLimit(
            name=c.name,
            unit=number.entry(c.quantity).unit,
            limit=c.limit,
            raised=round_up(float(r) / HELD * c.limit),
            source=c.source,
        )
        for c, r in zip(constraints, ratios, strict=True)
    )
    return Relaxation(limits=tuple(limits), gain=gain)


def _together(constraints: Sequence[Constraint], ratios: FloatArray, gain: float, number: LawNumber) -> Relaxation:
    exceeded = [i for i, r in enumerate(ratios.tolist()) if r > HELD]
    return _relaxation([constraints[i] for i in exceeded], [float(ratios[i]) for i in exceeded], gain, number)


def _ordered(found: list[Relaxation]) -> tuple[Relaxation, ...]:
    return tuple(sorted(found, key=lambda one: max(limit.raised / limit.limit for limit in one.limits)))
