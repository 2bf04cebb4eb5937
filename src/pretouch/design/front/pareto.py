"""The trade-off between contact quantities: every choice that no other choice beats in all of them, and its knee."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite
from pretouch.motion import ContactResult, Scenario

from ..constraints import QUANTITY_UNITS
from ..gain import GainDesign
from ..problem import GainProblem, magnitude
from ..search import refine
from ..search.local import descend
from ..search.trials import Trials, make_freedom
from ..task import Choice, Task, placed
from .fronts import FoundFront, extent_of, find_front, shortfall, trace_front
from .physical_bound import PhysicalBound, compare_with_bound, find_physical_bound, why_no_bound
from .result import FrontPoint, FrontStatus, ParetoFront

_LEAST: Final = 1e-3  # depth below which a front counts as straight


# In coordinates in which the front reaches from 0 to 1 in every quantity, the knee is the point that lies deepest below
# the plane through the front's ends, sum p = 1 (Das 1999, On characterizing the "knee" of the Pareto curve based on
# normal-boundary intersection; for three quantities we take the plane through the ends of the axes). As the least sum
# of all points, it is on the front whatever the front's shape.
def find_knee(
    trials: Trials, at: FloatArray, values: FloatArray, scanned: FloatArray, scanned_values: FloatArray
) -> tuple[FloatArray, float] | None:
    """Return coordinates and depth of the knee, of the extent of the front."""
    # None for a front that is straight, bulges outward, or does not trade at all.
    low, extent = values.min(axis=0), np.ptp(values, axis=0)
    if len(values) < 3 or not (extent > 0).all():
        return None
    best = at[int(((values - low) / extent).sum(axis=1).argmin())]
    if trials.freedom.size == 1:
        minima = refine(
            lambda u: ((trials.values(u[:, None]) - low) / extent).sum(axis=1),
            scanned[:, 0],
            ((scanned_values - low) / extent).sum(axis=1),
        )
        found = np.array([minima[0].coordinate]) if minima else best
    else:
        searched = descend(trials, best, 1 / extent)
        found = best if searched is None else searched
    both = np.stack([best, found])
    sums = ((trials.values(both) - low) / extent).sum(axis=1)
    depth = float((1 - sums.min()) / np.sqrt(values.shape[1]))
    return (both[int(sums.argmin())], depth) if depth > _LEAST else None


_ROUNDING: Final = 1e-9  # of a limit: an encounter that a design put on it, solved another way, still keeps it


@check_arguments
@placed
def pareto_front(task: Task) -> ParetoFront:
    """Find the Pareto front of two or three contact quantities over the gain D_p, and the admittance where it is free.

    A point of the front is a choice that no other one equals in every quantity and beats in one. Where only the gain is
    free, the curve of all gains is scanned and the ends of the front are found to rounding; where the admittance is
    free, too, the front is found on a grid and followed with SciPy's SLSQP. Beside each point stands what no controller
    can beat (`PhysicalBound`).

    Args:
        task: one encounter, the bounds, the quantities that are traded, and where given what is free of the admittance,
            constraints, impact, the choice that is marked, method, horizon and `evaluate`. Where it has an objective
            and no choice, the gain is marked that is optimal for the admittance as it is.

    Returns:
        The front; infeasible and no-contact are statuses of it, not errors.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     ExponentialFirstOrder(scale=0.458, rate=-61.0),
        ...     bounds=(-10.0, -0.01),
        ...     choice=-0.8,
        ... )
        >>> front = pareto_front(task)
        >>> round(front.knee.gain, 3), round(front.knee.values["relative_velocity"], 4)
        (-0.865, 0.0944)
        >>> abs(front.choice.behind) < 0.01
        True
    """
    names = _quantities(task.quantities)
    free = task.natural_frequency, task.damping_ratio
    freedom = make_freedom(task.scenario, task.stable_bounds(), *free, law=task.law)
    problem, choice = GainProblem(task=task, axis=freedom.axis), task.choice
    if choice is None and task.objective is not None:
        choice = GainDesign.of(problem)
    measures = tuple(magnitude(name, task.impact) for name in names)
    trials = Trials(freedom=freedom, encounters=problem, measures=measures)
    found = find_front(trials) if freedom.size > 1 else trace_front(lambda u: trials.values(u[:, None]))
    return _assemble(trials, names, found, choice)


def _quantities(given: Sequence[str]) -> tuple[str, ...]:
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if name not in QUANTITY_UNITS:
            raise InvalidInputError(f"quantities: found {name!r}, expected some of {', '.join(QUANTITY_UNITS)}")
    if len(names) not in {2, 3} or len(set(names)) < len(names):
        raise InvalidInputError(f"quantities: found {', '.join(names) or 'none'}, expected two or three different ones")
    return names


def _assemble(trials: Trials, names: tuple[str, ...], found: FoundFront, choice: float | Choice | None) -> ParetoFront:
    freedom = trials.freedom
    maker = _Plane(trials, names, found)
    reached = np.isfinite(found.scanned_values).all(axis=1)
    known = len(found.at) > 0
    contact = known or trials.rows(found.scanned)[1].any()
    result = trials.run(found.at) if known else None
    knee = find_knee(trials, found.at, found.values, found.scanned, found.scanned_values) if known else None
    gain, (frequency, ratio) = freedom.gain(found.at), freedom.admittance(found.at)
    return ParetoFront(
        problem=trials.encounters,
        status=FrontStatus.FOUND if known else FrontStatus.INFEASIBLE if contact else FrontStatus.NO_CONTACT,
        quantities=names,
        free=freedom.names,
        gain=gain,
        natural_frequency=frequency,
        damping_ratio=ratio,
        values=found.values,
        piece=found.piece,
        knee=None if knee is None else maker.point("knee", *freedom.choice(knee[0]), depth=knee[1]),
        choice=None if choice is None else maker.chosen(choice),
        ends=maker.ends(found.at),
        comparison=None if result is None else compare_with_bound(trials, freedom.scenarios(found.at), gain, result),
        bound=_bound(trials),
        no_bound=_why_no_bound(trials),
        scanned=found.scanned_values[reached],
        tried=len(found.scanned) + len(found.at),
        missed=found.missed,
        natural_frequency_bounds=freedom.natural_frequency,
        damping_ratio_bounds=freedom.damping_ratio,
        result=result,
    )


def _why_no_bound(trials: Trials) -> str:
    if not trials.encounters.is_continuous:
        return "the motion is not that of L(1) from rest, of which the bound speaks"
    return why_no_bound(trials.freedom.scenario)


def _bound(trials: Trials) -> PhysicalBound | None:
    """Return the bound of a robot with the limits that were given."""
    limits = {c.name: c.limit for c in trials.constraints}
    if _why_no_bound(trials) or "acceleration" not in limits:
        return None
    return find_physical_bound(
        trials.freedom.scenario,
        acceleration_limit=limits["acceleration"],
        speed_limit=limits.get("speed", np.inf),
    )


class _Plane:
    """Makes points of the plane: solves single encounters and places them beside the front."""

    def __init__(self, trials: Trials, names: tuple[str, ...], found: FoundFront) -> None:
        self.trials, self.names, self.front = trials, names, found.values
        self.extent = extent_of(found.values)

    def ends(self, at: FloatArray) -> tuple[FrontPoint, ...]:
        """Return the points of the front at which each quantity is least."""
        if not len(at):
            return ()
        least = [self.trials.freedom.choice(at[i]) for i in np.argmin(self.front, axis=0)]
        points = [self.point(f"least {name}", *one) for name, one in zip(self.names, least, strict=True)]
        return tuple(p for p in points if p is not None)

    def chosen(self, choice: float | Choice) -> FrontPoint | None:
        """Return the user's choice; None where that is a design without a gain or an encounter without contact."""
        if isinstance(choice, (int, float)):
            unit = self.trials.encounters.task.law.number.unit
            return self.point("choice", self.trials.freedom.scenario, float(finite(choice, "choice", unit)))
        if choice.gain is None:
            return None
        if np.ndim(choice.gain):
            raise InvalidInputError("choice: found an array of designs, expected one; choose it with .at(index)")
        scenario = dataclasses.replace(self.trials.freedom.scenario, admittance=choice.scenario.admittance)
        return self.point("choice", scenario, float(choice.gain))

    def point(self, name: str, scenario: Scenario, gain: float, depth: float | None = None) -> FrontPoint | None:
        """Solve an encounter and place it; None where it does not end in contact."""
        trials = self.trials
        result: ContactResult = trials.encounters.solve(scenario, gain)
        if not result.reached.all():
            return None
        rows = trials.rows_of(result).reshape(1, -1)
        values = rows[0, : len(self.names)]
        behind = -shortfall(values[None] / self.extent, self.front / self.extent)[0] if len(self.front) else np.nan
        admittance = scenario.admittance
        return FrontPoint(
            name=name,
            gain=gain,
            natural_frequency=float(admittance.natural_frequency),
            damping_ratio=float(admittance.damping_ratio) if admittance.stiffness > 0 else float("nan"),
            values={n: float(v) for n, v in zip(self.names, values, strict=True)},
            behind=float(behind),
            feasible=bool((rows[0, len(self.names) :] <= 1 + _ROUNDING).all()),
            depth=depth,
            bound=compare_with_bound(trials, scenario, np.asarray(gain), result),
            result=result,
        )
