"""A task with the coordinate of its gain, the views of it that a search needs, and what every answer to it holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.described import Described
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.motion import Scenario, find_contact
from pretouch.motion.contact import ContactResult
from pretouch.motion.evaluator import NoisyEvaluator, with_noise_after
from pretouch.motion.inputs import map_fields
from pretouch.sensors import SensorModel

from .criteria import Criterion, merit
from .impact import ImpactModel
from .objectives import Objective
from .own_objective import appraise
from .search import HELD, GainAxis, Landscape
from .task import Task

__all__ = ["Answer", "GainProblem"]


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
        """Whether its encounters have gradients: those of a user's function and of the uniform motion have none."""
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
        return find_contact(scenario, task.sensor, gain, method=task.method, horizon=task.horizon)

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
        """The gains between which the answer was sought [N s]."""
        return self.problem.axis.ends

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
