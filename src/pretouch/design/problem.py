"""A task with the coordinate of its gain, what its encounters are appraised by, and what every answer to it holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.blocks import Described
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.motion import DAMPER, ContinuousLaw, LawNumber, Scenario
from pretouch.motion.contact import ContactResult, ContactState
from pretouch.motion.evaluator import NoisyEvaluator, with_noise_after
from pretouch.motion.scenario import map_fields
from pretouch.sensors import SensorModel

from .constraints import Constraint, ImpactModel, quantity_of
from .objectives import OBSTACLE_SPEED, Objective, appraise
from .search import HELD, GainAxis, Landscape
from .task import Task

Slope: TypeAlias = Callable[[str], Any]
"""From a quantity at contact to its derivative by some input."""

Rates: TypeAlias = list[tuple[str, Any]]

_WITH_GRADIENTS: Final = frozenset(
    ("time", "position", "velocity", "acceleration", "displacement", "relative_velocity", "virtual_force")
) | {"impact_force", "gain"}


# Every derivative of an objective or a limit, by whatever input, is this chain rule with the derivatives of the
# contact.
@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """A number of an encounter, from a result; and its derivative by each quantity that it is made of, from a state."""

    value: Callable[[ContactResult], Any]
    rates: Callable[[ContactState], Rates]
    has_gradients: bool  # of all of these: not where one needs the whole motion, or a class of the user's computes it

    def slope(self, state: ContactState, of: Slope) -> FloatArray:
        """Differentiate the number by an input, which `along` follows: in SI, of the shape of the state."""
        total = np.zeros(np.shape(state.time))
        for quantity, rate in self.rates(state):
            total = total + rate * np.asarray(of(quantity))
        return total


def along(of: Callable[[str, str], Any], by: str, velocity: Any = 0.0) -> Slope:
    """Follow one input: from a quantity to its derivative by it, the gain and the obstacle's speed among them."""
    # `of` is the derivative of a quantity by an input, as `ContactGradients` has it; `velocity` is that of the obstacle
    # at the start [m/s], for what follows its speed.

    def slope(quantity: str) -> Any:
        if quantity == "gain":
            return float(by == "gain")
        if quantity == OBSTACLE_SPEED:
            return np.sign(velocity) if by == "obstacle.velocity" else 0.0
        return of(quantity, by)

    return slope


def ratio(constraint: Constraint, impact: ImpactModel | None) -> Criterion:
    """Make the criterion |quantity| / limit."""
    return magnitude(constraint.quantity, impact, constraint.limit)


def magnitude(quantity: str, impact: ImpactModel | None, unit: float = 1.0) -> Criterion:
    """Make the criterion |quantity|, by a unit of it."""

    def rates(state: ContactState) -> Rates:
        return [_at_contact(quantity, np.sign(quantity_of(quantity, state, impact)) / unit, state, impact)]

    return Criterion(
        value=lambda result: np.abs(quantity_of(quantity, result.end, impact)) / unit,
        rates=rates,
        has_gradients=quantity in _WITH_GRADIENTS,
    )


def merit(objective: Objective, obstacle_speed: Any, impact: ImpactModel | None) -> Criterion:
    """Make the criterion that an objective is: the sum of weight (q / s)^2; s may be the obstacle's speed [m/s]."""

    def rates(state: ContactState) -> Rates:
        found = []
        for term in objective.terms:
            value, scale = quantity_of(term.quantity, state, impact), term.scale_for(obstacle_speed)
            rate = 2 * term.weight * value / np.square(scale)
            found.append(_at_contact(term.quantity, rate, state, impact))
            if term.scale == OBSTACLE_SPEED:
                found.append((OBSTACLE_SPEED, -rate * value / scale))
        return found

    own = type(objective) is not Objective  # a class of the user's may compute anything
    return Criterion(
        value=lambda result: appraise(objective, result.end, result.reached, obstacle_speed, impact),
        rates=rates,
        has_gradients=not own and all(term.quantity in _WITH_GRADIENTS for term in objective.terms),
    )


def _at_contact(quantity: str, rate: Any, state: ContactState, impact: ImpactModel | None) -> tuple[str, Any]:
    """Return a rate as one by a quantity that has gradients: an impact force follows the relative velocity."""
    if quantity != "impact_force":
        return quantity, rate
    if impact is None:
        raise ResultUnavailableError("impact_force: needs the physical properties of robot and obstacle")
    return "relative_velocity", rate * impact.peak_force_slope(state.relative_velocity)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainProblem(Value):
    """A task for a search over gains: of one encounter, or of an array of them that share all else.

    Args:
        task: the task.
        axis: the coordinate of the gain, with its bounds.
    """

    task: Task
    axis: GainAxis

    @property
    def is_differentiable(self) -> bool:
        """Whether its encounters have gradients by all inputs: under the virtual damper, but for the uniform motion."""
        return self.is_continuous and self.task.law == DAMPER

    @property
    def is_continuous(self) -> bool:
        """Whether its motions are those of a law in continuous time, from the given state."""
        return self.task.evaluate is None and self.task.method != "uniform-motion"

    @property
    def is_noisy(self) -> bool:
        """Whether each of its encounters meets noise of its own, which belongs to its place among all of them."""
        return isinstance(self.task.evaluate, NoisyEvaluator)

    @property
    def merit(self) -> Criterion:
        """The objective with its derivatives."""
        return merit(self.task.goal, abs(self.task.scenario.obstacle.velocity), self.task.impact)

    def changed(self, **changes: Any) -> GainProblem:
        """Return the problem with other values of some fields of its task."""
        return GainProblem(task=self.task.replace(**changes), axis=self.axis)

    def solve(self, scenario: Scenario, gain: Any) -> ContactResult:
        """Solve other encounters as these are solved."""
        task = self.task
        if task.evaluate is not None:
            return task.evaluate(scenario, task.sensor, gain)
        return task.law.contact(scenario, task.sensor, gain, method=task.method, horizon=task.horizon)

    def run(self, gain: Any) -> ContactResult:
        """Solve the encounters with one gain or several."""
        return self.solve(self.task.scenario, gain)

    def at(self, index: tuple[int, ...]) -> GainProblem:
        """Return the problem of one encounter of an array, with the noise that it meets there."""
        shape, evaluate = self.task.scenario.shape, self.task.evaluate
        if evaluate is not None:
            evaluate = with_noise_after(evaluate, int(np.ravel_multi_index(index, shape, mode="wrap")))
        one = map_fields(self.task.scenario, lambda value: float(np.broadcast_to(value, shape)[index]))
        return self.changed(scenario=one, evaluate=evaluate)

    def within_gain_limit(self) -> GainProblem:
        """Return the problem whose bounds keep what its constraints say of the gain, without these constraints.

        An optimum inside such bounds is that of the problem itself. Where nothing is left between them, or a bound
        alone would be left, the problem is returned as it is.
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
        """Return the problem of the encounters at flat places, each a column with which a row of gains broadcasts."""
        shape = self.task.scenario.shape

        def taken(value: Any) -> Any:
            return value if np.ndim(value) == 0 else np.broadcast_to(value, shape).reshape(-1)[which][:, None]

        return self.changed(scenario=map_fields(self.task.scenario, taken))

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Appraise gains by their coordinates."""
        task, result = self.task, self.run(self.axis.gain(coordinate))
        reached, speed = result.reached, abs(task.scenario.obstacle.velocity)
        ratios = [c.magnitude(result.end, task.impact) / c.limit for c in task.limits]
        return Landscape(
            objective=appraise(task.goal, result.end, reached, speed, task.impact),
            ratios=np.where(reached, np.reshape(ratios, (len(ratios), *np.shape(reached))), np.inf),
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class Answer(Described, Value):
    """What a verb returns: it holds what was asked.

    Args:
        problem: the task and the gains between which the answer was sought.
    """

    problem: GainProblem

    @property
    def headline(self) -> str:
        """The answer in a sentence or two; of what is no whole answer, none."""
        return ""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.headline}>"

    @property
    def bounds(self) -> tuple[float, float]:
        """The gains between which the answer was sought, in the unit of the law's number."""
        return self.problem.axis.ends

    @property
    def law(self) -> ContinuousLaw:
        """The law whose number the gain is."""
        return self.problem.task.law

    @property
    def number(self) -> LawNumber:
        """What the gain is: name, symbol and unit of the number of the law."""
        return self.law.number

    @property
    def scenario(self) -> Scenario:
        """The encounter as it was given."""
        return self.problem.task.scenario

    @property
    def sensor(self) -> SensorModel:
        """The sensor curve."""
        return self.problem.task.sensor

    @property
    def impact(self) -> ImpactModel | None:
        """The physical properties, where given."""
        return self.problem.task.impact

    @property
    def definition(self) -> Objective:
        """The definition of the objective."""
        return self.problem.task.goal

    @property
    def on_evaluator(self) -> bool:
        """Whether encounters were solved by what was given as `evaluate`, such as a ClosedLoop."""
        return self.problem.task.evaluate is not None
