"""Define the search problem of a gain design, and evaluate the objective and constraints for a gain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.blocks import Described
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.motion import DAMPER, DRAG, ContinuousLaw, LawNumber, Scenario
from pretouch.motion.contact import ContactResult, ContactState
from pretouch.motion.evaluator import NoisyEvaluator, with_noise_after
from pretouch.motion.scenario import map_fields
from pretouch.sensors import SensorModel

from .constraints import Constraint
from .custom_objectives import appraise
from .impact import ImpactModel
from .objectives import OBSTACLE_SPEED, Objective
from .quantities import quantity_of, size_of
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
    """A number that rates an encounter, such as the objective, with its gradient in the contact quantities."""

    value: Callable[[ContactResult], Any]
    rates: Callable[[ContactState], Rates]
    has_gradients: bool  # False if a quantity needs the whole motion, or if a user-defined class computes the number

    def slope(self, state: ContactState, of: Slope) -> FloatArray:
        """Return the derivative of the objective or constraint with respect to one input, in SI units."""
        # `along` makes the function `of`.
        total = np.zeros(np.shape(state.time))
        for quantity, rate in self.rates(state):
            total = total + rate * np.asarray(of(quantity))
        return total


def along(of: Callable[[str, str], Any], by: str, velocity: Any = 0.0) -> Slope:
    """Return a function that gives the derivative of any contact quantity with respect to one input."""
    # `of` returns the derivative of a quantity by an input, as `ContactGradients` does. `velocity` is the obstacle's
    # velocity at the start [m/s]; it is needed for scales that equal the obstacle's speed.

    def slope(quantity: str) -> Any:
        if quantity == "gain":
            return float(by == "gain")
        if quantity == OBSTACLE_SPEED:
            return np.sign(velocity) if by == "obstacle.velocity" else 0.0
        return of(quantity, by)

    return slope


def ratio(constraint: Constraint, impact: ImpactModel | None) -> Criterion:
    """Make a search criterion from the ratio |quantity| / limit of a constraint."""
    return magnitude(constraint.quantity, impact, constraint.limit)


def magnitude(quantity: str, impact: ImpactModel | None, unit: float = 1.0) -> Criterion:
    """Make a search criterion from the magnitude of a contact quantity, divided by a given number."""

    def rates(state: ContactState) -> Rates:
        return [_at_contact(quantity, np.sign(quantity_of(quantity, state, impact)) / unit, state, impact)]

    return Criterion(
        value=lambda result: size_of(quantity, quantity_of(quantity, result.end, impact)) / unit,
        rates=rates,
        has_gradients=quantity in _WITH_GRADIENTS,
    )


def merit(objective: Objective, obstacle_speed: Any, impact: ImpactModel | None) -> Criterion:
    """Make a search criterion from an objective, with derivatives with respect to the quantities at contact."""

    def rates(state: ContactState) -> Rates:
        rates_by_quantity = []
        for term in objective.terms:
            value, scale = quantity_of(term.quantity, state, impact), term.scale_for(obstacle_speed)
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
    """Convert derivatives with respect to the impact force to derivatives with respect to the contact velocity."""
    if quantity != "impact_force":
        return quantity, rate
    if impact is None:
        raise ResultUnavailableError(
            "impact_force: needs the physical properties of robot and obstacle; pass an impact model"
        )
    return "relative_velocity", rate * impact.peak_force_slope(state.relative_velocity)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainProblem(Value):
    """The problem of finding the optimal gain of a task, with the transformed gain as search variable.

    Args:
        task: the task.
        axis: the search coordinate of the gain, with its bounds.
    """

    task: Task
    axis: GainAxis

    @property
    def is_differentiable(self) -> bool:
        """True if exact derivatives exist: the law is built in, and the obstacle's acceleration is constant."""
        is_solved = self.is_continuous and not self.task.scenario.obstacle.course
        return is_solved and self.task.law in {DAMPER, DRAG}

    @property
    def is_continuous(self) -> bool:
        """True if the complete motion equations are solved in continuous time."""
        return self.task.evaluate is None and self.task.method != "uniform-motion"

    @property
    def is_noisy(self) -> bool:
        """True if each encounter has its own random noise, which depends on the encounter's position in the array."""
        return isinstance(self.task.evaluate, NoisyEvaluator)

    @property
    def merit(self) -> Criterion:
        """The objective of the task, with its derivatives with respect to contact quantities."""
        return merit(self.task.goal, abs(self.task.scenario.obstacle.velocity), self.task.impact)

    def changed(self, **changes: Any) -> GainProblem:
        """Return a copy of the problem in which some fields of the task have new values."""
        return GainProblem(task=self.task.replace(**changes), axis=self.axis)

    def solve(self, scenario: Scenario, gain: Any) -> ContactResult:
        """Compute encounters by the task's function `evaluate`; without this function, in continuous time."""
        task = self.task
        if task.evaluate is not None:
            return task.evaluate(scenario, task.sensor, gain)
        return task.law.contact(scenario, task.sensor, gain, method=task.method, horizon=task.horizon)

    def run(self, gain: Any) -> ContactResult:
        """Compute the task's encounters with one or several gains."""
        return self.solve(self.task.scenario, gain)

    def at(self, index: tuple[int, ...]) -> GainProblem:
        """Return the problem of one encounter of an array, with the same noise as in the array."""
        shape, evaluate = self.task.scenario.shape, self.task.evaluate
        if evaluate is not None:
            evaluate = with_noise_after(evaluate, int(np.ravel_multi_index(index, shape, mode="wrap")))
        scenario = map_fields(self.task.scenario, lambda value: float(np.broadcast_to(value, shape)[index]))
        return self.changed(scenario=scenario, evaluate=evaluate)

    def within_gain_limit(self) -> GainProblem:
        """Return an equivalent problem in which narrower bounds of the gain replace constraints on the gain.

        An optimum inside these bounds is an optimum of the problem itself. If no interval remains, the problem is
        returned unchanged.
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
        """Return the problem of selected encounters, in column arrays that NumPy broadcasts with a row of gains."""
        shape = self.task.scenario.shape

        def select(value: Any) -> Any:
            return value if np.ndim(value) == 0 else np.broadcast_to(value, shape).reshape(-1)[which][:, None]

        return self.changed(scenario=map_fields(self.task.scenario, select))

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Compute the objective and the constraints for several gains, given as values of the search variable."""
        task, result = self.task, self.run(self.axis.gain(coordinate))
        reached, speed = result.reached, abs(task.scenario.obstacle.velocity)
        ratios = [c.magnitude(result.end, task.impact) / c.limit for c in task.limits]
        return Landscape(
            objective=appraise(task.goal, result.end, reached, speed, task.impact),
            ratios=np.where(reached, np.reshape(ratios, (len(ratios), *np.shape(reached))), np.inf),
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class Answer(Described, Value):
    """Base class of design results; each result keeps the problem that was solved.

    Args:
        problem: the task and the bounds of the gain.
    """

    problem: GainProblem

    @property
    def headline(self) -> str:
        """A summary of the result in one or two sentences; empty in this base class."""
        return ""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.headline}>"

    @property
    def bounds(self) -> tuple[float, float]:
        """The lower and the upper bound of the gain, in the unit of the gain."""
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
        """The impact model with the masses of robot and obstacle; None if the task has no impact model."""
        return self.problem.task.impact

    @property
    def definition(self) -> Objective:
        """The objective that the design minimizes."""
        return self.problem.task.goal

    @property
    def on_evaluator(self) -> bool:
        """True if a function `evaluate` of the task, such as a simulated loop, computed the encounters."""
        return self.problem.task.evaluate is not None
