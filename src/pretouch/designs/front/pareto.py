"""Compute a Pareto front, and find its knee."""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite
from pretouch.motion import ContactResult, Scenario

from ..gain import GainDesign
from ..options import Choice
from ..problem import GainProblem, magnitude
from ..relaxation import Relaxation, relax_on_axis, relax_trials
from ..search import Landscape, refine, scan_feasible
from ..search.freedom import make_freedom
from ..search.local import descend, least_violations
from ..search.trials import Trials
from ..task import Task, with_file_location
from .bound_comparison import compare_with_bound
from .curve_front import trace_front
from .dominance import FoundFront, extent_of, shortfall
from .parameter_front import find_front
from .physical_bound import PhysicalBound, find_physical_bound, why_no_bound
from .result import FrontPoint, FrontStatus, ParetoFront

_LEAST: Final = 1e-3  # depth below which a front counts as straight


# Each quantity is scaled to reach from 0 to 1 along the front. The knee is the point with the largest distance below
# the plane through the front's ends, sum p = 1 (Das 1999, On characterizing the "knee" of the Pareto curve based on
# normal-boundary intersection; for three quantities we take the plane through the ends of the axes). It minimizes the
# sum of the scaled quantities, so it lies on the front for every shape of the front.
def find_knee(
    trials: Trials, at: FloatArray, values: FloatArray, scanned: FloatArray, scanned_values: FloatArray
) -> tuple[FloatArray, float] | None:
    """Find the knee of a Pareto front.

    The result is None for a front that is straight, bulges outward, or has no trade-off.

    Returns:
        The coordinates of the knee, and its depth below the plane through the ends; None without a knee.
    """
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
        refined = np.array([minima[0].coordinate]) if minima else best
    else:
        minimum = descend(trials, best, 1 / extent)
        refined = best if minimum is None else minimum[0]
    both = np.stack([best, refined])
    sums = ((trials.values(both) - low) / extent).sum(axis=1)
    depth = float((1 - sums.min()) / np.sqrt(values.shape[1]))
    return (both[int(sums.argmin())], depth) if depth > _LEAST else None


_ROUNDING: Final = 1e-9  # relative amount by which the choice may exceed a limit; another method may have designed it


@check_arguments
@with_file_location
def pareto(task: Task) -> ParetoFront:
    """Find the Pareto front of two or three contact quantities.

    The gain D_p and the free admittance parameters vary.

    No point of the front is dominated: no other point is as good in every quantity and better in one. If only the gain
    is free, the curve of all gains is scanned, and the ends of the front are found to rounding. Otherwise the front is
    located on a grid and refined by SciPy's SLSQP. Each point is compared with the physical bound, which holds for
    every controller (`PhysicalBound`).

    Args:
        task: one encounter, the bounds and the quantities (`pareto`); optionally bounds of natural frequency and
            damping ratio, constraints, impact, the user's choice (`pareto`), method, horizon and `evaluate`. With an
            objective and without a choice, the optimal gain of the unchanged admittance is marked.

    Returns:
        The front; infeasible and no-contact are statuses, not errors.

    Examples:
        >>> from pretouch.designs import ParetoOptions
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     ExponentialFirstOrder(scale=0.458, rate=-61.0),
        ...     bounds=(-10.0, -0.01),
        ...     pareto=ParetoOptions(choice=-0.8),
        ... )
        >>> front = pareto(task)
        >>> round(front.knee.gain, 3), round(front.knee.values["relative_velocity"], 4)
        (-0.865, 0.0944)
        >>> abs(front.choice.distance_to_front) < 0.01
        True
    """
    names = tuple(task.pareto.quantities)
    free = task.natural_frequency, task.damping_ratio
    freedom = make_freedom(task.scenario, task.stable_bounds(), *free, law=task.law)
    problem, choice = GainProblem(task=task, axis=freedom.axis), task.pareto.choice
    if choice is None and task.objective is not None:
        choice = GainDesign.of(problem)
    measures = tuple(magnitude(name, task.impact) for name in names)
    trials = Trials(freedom=freedom, encounters=problem, measures=measures)
    front = find_front(trials) if freedom.size > 1 else trace_front(lambda u: trials.landscape(u[:, None]))
    return _assemble(trials, names, front, choice)


def _assemble(trials: Trials, names: tuple[str, ...], front: FoundFront, choice: float | Choice | None) -> ParetoFront:
    freedom = trials.freedom
    points = _FrontPointMaker(trials, names, front)
    reached = np.isfinite(front.scanned_values).all(axis=1)
    feasible = len(front.at) > 0
    contact = feasible or trials.rows(front.scanned)[1].any()
    relaxations = () if feasible or not contact else _relaxations(trials, front.scanned)
    result = trials.run(front.at) if feasible else None
    knee = find_knee(trials, front.at, front.values, front.scanned, front.scanned_values) if feasible else None
    gain, (frequency, ratio) = freedom.gain(front.at), freedom.admittance(front.at)
    return ParetoFront(
        problem=trials.encounters,
        status=FrontStatus.FOUND if feasible else FrontStatus.INFEASIBLE if contact else FrontStatus.NO_CONTACT,
        quantities=names,
        free=freedom.names,
        gain=gain,
        natural_frequency=frequency,
        damping_ratio=ratio,
        values=front.values,
        piece=front.piece,
        knee=None if knee is None else points.point("knee", *freedom.choice(knee[0]), depth=knee[1]),
        choice=None if choice is None else points.chosen(choice),
        ends=points.ends(front.at),
        comparison=None if result is None else compare_with_bound(trials, freedom.scenarios(front.at), gain, result),
        bound=_bound(trials),
        no_bound=_why_no_bound(trials),
        scanned=front.scanned_values[reached],
        evaluated=len(front.scanned) + len(front.at),
        relaxations=relaxations,
        approximation_error=front.approximation_error,
        natural_frequency_bounds=freedom.natural_frequency,
        damping_ratio_bounds=freedom.damping_ratio,
        result=result,
    )


def _relaxations(trials: Trials, scanned: FloatArray) -> tuple[Relaxation, ...]:
    """Find the limits that must be raised so that the front has points."""
    freedom, problem = trials.freedom, trials.encounters
    if freedom.size > 1:
        minima = least_violations(trials, scanned, trials.landscape(scanned).violation)
        return relax_trials(trials, minima[0]) if len(minima) else ()
    low, high = freedom.axis.span

    def landscape(u: FloatArray) -> Landscape:
        return trials.landscape((u[:, None] - low) / (high - low))

    number = problem.task.law.number
    return relax_on_axis(
        landscape, freedom.axis, scan_feasible(landscape, low, high), trials.constraints, number=number
    )


def _why_no_bound(trials: Trials) -> str:
    if not trials.encounters.is_continuous:
        return "it applies only to motions in continuous time, L(1), that start from the given state"
    return why_no_bound(trials.freedom.scenario)


def _bound(trials: Trials) -> PhysicalBound | None:
    """Return the physical bound for the limits of the task. The limits are those of acceleration and speed."""
    limits = {c.name: c.limit for c in trials.constraints}
    if _why_no_bound(trials) or "acceleration" not in limits:
        return None
    return find_physical_bound(
        trials.freedom.scenario,
        acceleration_limit=limits["acceleration"],
        speed_limit=limits.get("speed", np.inf),
    )


class _FrontPointMaker:
    """Factory for the marked points of a Pareto plot, such as the knee."""

    def __init__(self, trials: Trials, names: tuple[str, ...], front: FoundFront) -> None:
        self.trials, self.names, self.front = trials, names, front.values
        self.extent = extent_of(front.values)

    def ends(self, at: FloatArray) -> tuple[FrontPoint, ...]:
        """Return the end points of the Pareto front.

        Each has the smallest value of one quantity.
        """
        if not len(at):
            return ()
        least = [self.trials.freedom.choice(at[i]) for i in np.argmin(self.front, axis=0)]
        points = [self.point(f"least {name}", *choice) for name, choice in zip(self.names, least, strict=True)]
        return tuple(p for p in points if p is not None)

    def chosen(self, choice: float | Choice) -> FrontPoint | None:
        """Return the user's chosen design as a point of the plot.

        Returns:
            The point; None if the choice has no gain or does not result in contact.

        Raises:
            InvalidInputError: the choice is an array of designs.
        """
        if isinstance(choice, (int, float)):
            unit = self.trials.encounters.task.law.number.unit
            return self.point("choice", self.trials.freedom.scenario, float(finite(choice, "choice", unit)))
        if choice.gain is None:
            return None
        if np.ndim(choice.gain):
            raise InvalidInputError("choice: found an array of designs, expected one; select it with .at(index)")
        scenario = dataclasses.replace(self.trials.freedom.scenario, admittance=choice.scenario.admittance)
        return self.point("choice", scenario, float(choice.gain))

    def point(self, name: str, scenario: Scenario, gain: float, depth: float | None = None) -> FrontPoint | None:
        """Compute one encounter as a point of the Pareto plot.

        Returns:
            The point; None if the encounter ends without contact.
        """
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
            distance_to_front=float(behind),
            feasible=bool((rows[0, len(self.names) :] <= 1 + _ROUNDING).all()),
            depth=depth,
            bound=compare_with_bound(trials, scenario, np.asarray(gain), result),
            result=result,
        )
