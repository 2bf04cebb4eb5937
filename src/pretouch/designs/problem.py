"""Define the search problem of a gain design.

The problem evaluates the objective and the constraints for a gain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.display import Described
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.motion import DAMPER, DRAG, ContinuousLaw, LawNumber, Scenario
from pretouch.motion.contact import ContactResult, ContactState
from pretouch.motion.evaluator import NoisyEvaluator, with_noise_after
from pretouch.motion.layout import PEAKS
from pretouch.motion.scenario import map_fields
from pretouch.sensors import SensorModel

from .constraints import Constraint
from .custom_objectives import CustomObjective, appraise
from .impact import ImpactModel
from .objectives import OBSTACLE_SPEED, Objective
from .quantities import contact_value, size_of
from .search import HELD, GainAxis, Landscape
from .task import Task

Slope: TypeAlias = Callable[[str], Any]
"""Function that maps the name of a quantity at contact to the derivative of the quantity by one input."""

Rates: TypeAlias = list[tuple[str, Any]]

_WITH_GRADIENTS: Final = frozenset(
    ("time", "position", "velocity", "acceleration", "displacement", "relative_velocity", "virtual_force")
) | {"impact_force", "gain"}


# All derivatives of objectives and limits by inputs are computed by this chain rule from the derivatives of the
# contact.
@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """A search criterion, such as the objective, with its gradient.

    The gradient contains the derivatives with respect to the contact quantities.
    """

    value: Callable[[ContactResult], Any]
    rates: Callable[[ContactState], Rates]
    has_gradients: bool  # False if a quantity needs the whole motion, or if a user-defined class computes the number

    def slope(self, state: ContactState, of: Slope) -> FloatArray:
        """Differentiate the objective or a constraint with respect to one input.

        `along` makes the function `of`.

        Returns:
            The derivative in SI units.
        """
        total = np.zeros(np.shape(state.time))
        for quantity, rate in self.rates(state):
            total = total + rate * np.asarray(of(quantity))
        return total


def along(of: Callable[[str, str], Any], by: str, velocity: Any = 0.0) -> Slope:
    """Return a function for derivatives with respect to one input.

    The function differentiates any contact quantity. `of` returns the derivative of a quantity by an input, as
    `ContactGradients` does. `velocity` is the obstacle's velocity at the start [m/s]; it is needed for scales that
    equal the obstacle's speed.
    """

    def slope(quantity: str) -> Any:
        if quantity == "gain":
            return float(by == "gain")
        if quantity == OBSTACLE_SPEED:
            return np.sign(velocity) if by == "obstacle.velocity" else 0.0
        return of(quantity, by)

    return slope


def ratio(constraint: Constraint, impact: ImpactModel | None) -> Criterion:
    """Make a search criterion from a constraint.

    Returns:
        The criterion |quantity| / limit.
    """
    return magnitude(constraint.quantity, impact, constraint.limit)


def magnitude(quantity: str, impact: ImpactModel | None, unit: float = 1.0) -> Criterion:
    """Make a search criterion from a contact quantity.

    Returns:
        The magnitude of the quantity, divided by `unit`.
    """

    def rates(state: ContactState) -> Rates:
        return [_at_contact(quantity, np.sign(contact_value(quantity, state, impact)) / unit, state, impact)]

    return Criterion(
        value=lambda result: size_of(quantity, contact_value(quantity, result.end, impact)) / unit,
        rates=rates,
        has_gradients=quantity in _WITH_GRADIENTS,
    )


def merit(objective: Objective, obstacle_speed: Any, impact: ImpactModel | None) -> Criterion:
    """Make a search criterion from an objective.

    Returns:
        The objective, with its derivatives with respect to the quantities at contact.
    """

    def rates(state: ContactState) -> Rates:
        rates_by_quantity = []
        for term in objective.terms:
            value, scale = contact_value(term.quantity, state, impact), term.scale_for(obstacle_speed)
            rate = 2 * term.weight * value / np.square(scale)
            rates_by_quantity.append(_at_contact(term.quantity, rate, state, impact))
            if term.scale == OBSTACLE_SPEED:
                rates_by_quantity.append((OBSTACLE_SPEED, -rate * value / scale))
        return rates_by_quantity

    custom = type(objective) is not Objective  # a user-defined class may compute anything
    return Criterion(
        value=lambda result: appraise(objective, result.end, result.reached, obstacle_speed, impact),
        rates=rates,
        has_gradients=not custom and all(term.quantity in _WITH_GRADIENTS for term in objective.terms),
    )


def _at_contact(quantity: str, rate: Any, state: ContactState, impact: ImpactModel | None) -> tuple[str, Any]:
    """Compute derivatives of the impact force from those of the velocities."""
    if quantity != "impact_force":
        return quantity, rate
    if impact is None:
        raise ResultUnavailableError(
            "impact_force: needs the physical properties of robot and obstacle; pass an impact model"
        )
    return "relative_velocity", rate * impact.peak_force_slope(state.relative_velocity)


def peaks_of(task: Task) -> tuple[str, ...]:
    """Return the peak values, such as `largest_excursion`, that objective and limits of a task certainly need."""
    goal = None if task.objective is None else task.goal
    terms = () if goal is None or isinstance(goal, CustomObjective) else goal.terms
    needed = {c.quantity for c in task.limits} | {term.quantity for term in terms}
    if "drive_force" in needed:
        needed.add("largest_acceleration")
    return tuple(name for name in PEAKS if name in needed)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainProblem(Value):
    """The optimization problem of a gain design.

    The search variable is the transformed gain.

    Args:
        task: the task.
        axis: the search coordinate of the gain, with its bounds.
    """

    task: Task
    axis: GainAxis

    @property
    def is_differentiable(self) -> bool:
        """True if the gain problem has exact derivatives.

        Time must be continuous, the law built in, and the obstacle's acceleration constant.
        """
        is_solved = self.is_continuous and not self.task.scenario.obstacle.course
        return is_solved and self.task.law in {DAMPER, DRAG}

    @property
    def is_continuous(self) -> bool:
        """True if the complete motion equations are solved in continuous time."""
        return self.task.evaluate is None and self.task.method != "uniform-motion"

    @property
    def is_noisy(self) -> bool:
        """True if each encounter has its own random noise.

        The noise depends on the encounter's position in the array.
        """
        return isinstance(self.task.evaluate, NoisyEvaluator)

    @property
    def merit(self) -> Criterion:
        """The objective of the task, with its derivatives.

        The derivatives are with respect to the contact quantities.
        """
        return merit(self.task.goal, abs(self.task.scenario.obstacle.velocity), self.task.impact)

    def changed(self, **changes: Any) -> GainProblem:
        """Return a copy of the problem with a changed task."""
        return GainProblem(task=self.task.replace(**changes), axis=self.axis)

    def solve(self, scenario: Scenario, gain: Any) -> ContactResult:
        """Compute encounters with given gains.

        Returns:
            The encounters, computed by the task's function `evaluate`, or else in continuous time.
        """
        task = self.task
        if task.evaluate is not None:
            return task.evaluate(scenario, task.sensor, gain)
        options: dict[str, Any] = {"peaks": peaks_of(task)} if task.law == DAMPER else {}
        return task.law.contact(scenario, task.sensor, gain, method=task.method, horizon=task.horizon, **options)

    def run(self, gain: Any) -> ContactResult:
        """Compute the task's encounters with one or several gains."""
        return self.solve(self.task.scenario, gain)

    def at(self, index: tuple[int, ...]) -> GainProblem:
        """Return the problem of one encounter of an array.

        The noise is the same as in the array.
        """
        shape, evaluate = self.task.scenario.shape, self.task.evaluate
        if evaluate is not None:
            evaluate = with_noise_after(evaluate, int(np.ravel_multi_index(index, shape, mode="wrap")))
        scenario = map_fields(self.task.scenario, lambda value: float(np.broadcast_to(value, shape)[index]))
        return self.changed(scenario=scenario, evaluate=evaluate)

    def within_gain_limit(self) -> GainProblem:
        """Replace constraints on the gain by narrower bounds.

        An optimum inside the narrower bounds is an optimum of the problem itself.

        Returns:
            An equivalent problem; the problem itself if no interval remains.
        """
        limits = [c.limit for c in self.task.limits if c.quantity == "gain"]
        if not limits:
            return self
        most = HELD * min(limits)
        low, high = max(self.axis.low, -most), min(self.axis.high, most)
        if not low < high:
            return self
        others = tuple(c for c in self.task.limits if c.quantity != "gain")
        return GainProblem(task=self.task.replace(constraints=others), axis=GainAxis(low=low, high=high))

    def column(self, which: IntArray) -> GainProblem:
        """Return the gain problem of selected encounters.

        Its column arrays broadcast with a row of gains.
        """
        shape = self.task.scenario.shape

        def select(value: Any) -> Any:
            return value if np.ndim(value) == 0 else np.broadcast_to(value, shape).reshape(-1)[which][:, None]

        return self.changed(scenario=map_fields(self.task.scenario, select))

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Compute the objective and the constraints for several gains.

        The gains are values of the search variable.

        Returns:
            The objective, and the ratio |quantity| / limit of each constraint.
        """
        task, result = self.task, self.run(self.axis.gain(coordinate))
        reached, speed = result.reached, abs(task.scenario.obstacle.velocity)
        ratios = [c.magnitude(result.end, task.impact) / c.limit for c in task.limits]
        return Landscape(
            objective=appraise(task.goal, result.end, reached, speed, task.impact),
            ratios=np.where(reached, np.reshape(ratios, (len(ratios), *np.shape(reached))), np.inf),
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class Answer(Described, Value):
    """Base class of design results.

    Each result keeps the problem that was solved.

    Args:
        problem: the task and the bounds of the gain.
    """

    problem: GainProblem

    @property
    def headline(self) -> str:
        """A summary of the result in one or two sentences.

        It is empty in this base class.
        """
        return ""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.headline}>"

    @property
    def bounds(self) -> tuple[float, float]:
        """The lower and the upper bound of the gain.

        They have the unit of the gain.
        """
        return self.problem.axis.ends

    @property
    def law(self) -> ContinuousLaw:
        """The control law whose gain was designed."""
        return self.problem.task.law

    @property
    def number(self) -> LawNumber:
        """Name, symbol and unit of the gain of the control law."""
        return self.law.number

    @property
    def scenario(self) -> Scenario:
        """The encounter that the task describes."""
        return self.problem.task.scenario

    @property
    def sensor(self) -> SensorModel:
        """The sensor curve of the task."""
        return self.problem.task.sensor

    @property
    def impact(self) -> ImpactModel | None:
        """The impact model of the task.

        None if the task has no impact model.
        """
        return self.problem.task.impact

    @property
    def definition(self) -> Objective:
        """The objective that the design minimizes."""
        return self.problem.task.goal

    @property
    def on_evaluator(self) -> bool:
        """True if the task's function `evaluate` computed the encounters.

        An example of such a function is a simulated loop.
        """
        return self.problem.task.evaluate is not None
