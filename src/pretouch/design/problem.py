"""A design problem as a value, and the views of it that a search needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.motion import ContactResult, Scenario, find_contact
from pretouch.motion.evaluator import Evaluator, NoisyEvaluator, with_noise_after
from pretouch.motion.inputs import map_fields
from pretouch.sensors import SensorModel

from .constraints import Constraint, each_once
from .criteria import Criterion, merit
from .impact import ImpactModel
from .objectives import Objective
from .own_objective import appraise
from .search import HELD, GainAxis, Landscape

__all__ = ["Encounters", "Evaluator", "GainProblem"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounters(Value):
    """Encounters, how they are solved, and what they must keep.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve.
        constraints: limits that the encounter must keep.
        impact: physical properties, where given.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].
        evaluator: solves encounters in the place of `find_contact`, where given.
    """

    scenario: Scenario
    sensor: SensorModel
    constraints: tuple[Constraint, ...]
    impact: ImpactModel | None
    method: str
    horizon: float
    evaluator: Evaluator | None

    def __post_init__(self) -> None:
        if self.constraints:
            each_once(self.constraints)

    @property
    def is_differentiable(self) -> bool:
        """Whether its encounters have gradients: those of a user's function and of the uniform motion have none."""
        return self.evaluator is None and self.method != "uniform-motion"

    def solve(self, scenario: Scenario, gain: Any) -> ContactResult:
        """Solve other encounters as these are solved."""
        if self.evaluator is not None:
            return self.evaluator(scenario, self.sensor, gain)
        return find_contact(scenario, self.sensor, gain, method=self.method, horizon=self.horizon)

    def run(self, gain: Any) -> ContactResult:
        """Solve the encounters with one gain or several."""
        return self.solve(self.scenario, gain)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainProblem(Encounters):
    """One design problem, or an array of them that share all but their encounters.

    Args:
        objective: what is minimized.
        axis: the coordinate of the gain, with its bounds.
    """

    objective: Objective
    axis: GainAxis

    @property
    def merit(self) -> Criterion:
        """The objective with its derivatives."""
        return merit(self.objective, abs(self.scenario.obstacle.velocity), self.impact)

    @property
    def is_noisy(self) -> bool:
        """Whether each of its encounters meets noise of its own, which belongs to its place among all of them."""
        return isinstance(self.evaluator, NoisyEvaluator)

    def at(self, index: tuple[int, ...]) -> GainProblem:
        """Return the problem of one encounter of an array, with the noise that it meets there.

        Args:
            index: one integer per axis.

        Returns:
            The problem.
        """
        shape, evaluator = self.scenario.shape, self.evaluator
        if evaluator is not None:
            evaluator = with_noise_after(evaluator, int(np.ravel_multi_index(index, shape, mode="wrap")))
        one = map_fields(self.scenario, lambda value: float(np.broadcast_to(value, shape)[index]))
        return replace(self, scenario=one, evaluator=evaluator)

    def within_gain_limit(self) -> GainProblem:
        """Return the problem whose bounds keep what its constraints say of the gain, without these constraints.

        An optimum inside such bounds is that of the problem itself. Where nothing is left between them, or a bound
        alone would be left, the problem is returned as it is.
        """
        limits = [c.limit for c in self.constraints if c.quantity == "gain"]
        if not limits:
            return self
        most = HELD * min(limits)
        low, high = max(self.axis.low, -most), min(self.axis.high, most)
        if not low < high:
            return self
        others = tuple(c for c in self.constraints if c.quantity != "gain")
        return replace(self, constraints=others, axis=GainAxis(low=low, high=high))

    def column(self, which: IntArray) -> GainProblem:
        """Return the problem of some encounters of an array, as a column with which a row of gains broadcasts.

        Args:
            which: their places in the flat array, shape (m,).

        Returns:
            The problem, each field of its scenario a number or of shape (m, 1).
        """
        shape = self.scenario.shape

        def taken(value: Any) -> Any:
            return value if np.ndim(value) == 0 else np.broadcast_to(value, shape).reshape(-1)[which][:, None]

        return replace(self, scenario=map_fields(self.scenario, taken))

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Appraise gains by their coordinates."""
        result = self.run(self.axis.gain(coordinate))
        reached, speed = result.reached, abs(self.scenario.obstacle.velocity)
        ratios = [c.magnitude(result.end, self.impact) / c.limit for c in self.constraints]
        return Landscape(
            objective=appraise(self.objective, result.end, reached, speed, self.impact),
            ratios=np.where(reached, np.reshape(ratios, (len(ratios), *np.shape(reached))), np.inf),
        )
