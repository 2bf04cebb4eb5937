"""A design problem as a value, and the two views of it that the search needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.motion import ContactResult, Scenario, find_contact
from pretouch.sensors import SensorModel

from .constraints import Constraint
from .impact import ImpactModel
from .objectives import Objective
from .search import GainAxis, Landscape

__all__ = ["Evaluator", "Problem"]

Evaluator: TypeAlias = Callable[[Scenario, SensorModel, Any], ContactResult]


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One design problem, or an array of them that share all but their encounters.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve.
        objective: what is minimized.
        constraints: limits that the encounter must keep.
        impact: physical properties, where given.
        axis: the coordinate of the gain, with its bounds.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].
        evaluator: solves encounters in the place of `find_contact`, where given.
    """

    scenario: Scenario
    sensor: SensorModel
    objective: Objective
    constraints: tuple[Constraint, ...]
    impact: ImpactModel | None
    axis: GainAxis
    method: str
    horizon: float
    evaluator: Evaluator | None

    @property
    def is_differentiable(self) -> bool:
        """Whether its encounters have gradients: those of a user's function and of the uniform motion have none."""
        return self.evaluator is None and self.method != "uniform-motion"

    def evaluate(self, scenario: Scenario, sensor: SensorModel, gain: Any) -> ContactResult:
        """Solve any encounter as this problem solves its own."""
        if self.evaluator is not None:
            return self.evaluator(scenario, sensor, gain)
        return find_contact(scenario, sensor, gain, method=self.method, horizon=self.horizon)

    def run(self, gain: Any) -> ContactResult:
        """Solve the encounter with one gain or several."""
        return self.evaluate(self.scenario, self.sensor, gain)

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Appraise gains by their coordinates."""
        result = self.run(self.axis.gain(coordinate))
        reached = result.reached
        speed = abs(self.scenario.obstacle.velocity)
        value = self.objective.value(result.end, speed, self.impact)
        ratios = [c.magnitude(result.end, self.impact) / c.limit for c in self.constraints]
        return Landscape(
            objective=np.where(reached, value, np.inf),
            ratios=np.where(reached, np.reshape(ratios, (len(ratios), *np.shape(reached))), np.inf),
        )
