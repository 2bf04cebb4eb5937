"""Define the optimization problem of a robust design.

It evaluates each gain over many sampled encounters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.motion import DAMPER, ContactResult, ContactState
from pretouch.uncertainty import Ensemble, make_ensemble

from ..custom_objectives import appraise
from ..later_contact import least_objective, never_touches, premises_hold, touches_later
from ..problem import Criterion, GainProblem, along, merit, peaks_of, ratio
from ..search import GainAxis, Landscape
from ..task import Task
from .measures import Expected, Measure
from .required import Required, limits_of

_BLOCK: Final = 1 << 19  # encounters that are solved together, so that their states fit into the cache
_BLOCK_OF_EVALUATOR: Final = 1 << 16  # the same with `evaluate`
_STRIDE: Final = 0.5  # step in u between gains in the search for the end of the axis


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustProblem(GainProblem):
    """A search problem with many random encounters per gain.

    Args:
        ensemble: the encounters.
    """

    ensemble: Ensemble

    @classmethod
    def over(cls, task: Task, axis: GainAxis, values: Mapping[str, Any], **options: Any) -> RobustProblem:
        """Make the search problem for sampled values of uncertain inputs. The options are those of `make_ensemble`."""
        names = ("method", "horizon", "law", "evaluate")
        settings = {**{name: getattr(task, name) for name in names}, **options}
        # A simulated loop finds out itself from where its controller detects the object.
        starts = task.from_detection(values) if settings["evaluate"] is None else values
        return cls(task=task, axis=axis, ensemble=make_ensemble(task.scenario, task.sensor, starts, **settings))

    @property
    def measure(self) -> Measure:
        """The risk measure of the design, such as the mean.

        It combines the objectives of all encounters.
        """
        return self.task.robust.measure or Expected()

    @property
    def limits(self) -> tuple[Required, ...]:
        """The constraints with their required probabilities."""
        return limits_of(self.task.constraints)

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Compute the risk measure and the constraints for several gains.

        The gains are values of the search variable.

        Returns:
            The risk measure, and the ratio |quantity| / limit of each constraint.
        """
        gains = self.axis.gain(coordinate)
        if self._never_touches:
            return Landscape(
                objective=np.full(gains.shape, np.inf), ratios=np.full((len(self.limits), *gains.shape), np.inf)
            )
        block = _BLOCK if self.ensemble.evaluator is None else _BLOCK_OF_EVALUATOR
        step = max(1, block // len(self.ensemble))
        parts = [self._measured(*self._evaluate(gains[i : i + step])[:2]) for i in range(0, len(gains), step)]
        return Landscape(
            objective=np.concatenate([part.objective for part in parts]),
            ratios=np.concatenate([part.ratios for part in parts], axis=1),
        )

    def values(self, gain: float) -> tuple[FloatArray, FloatArray]:
        """Return objective and constraint ratios of every encounter.

        All encounters have the same gain. The ratios are |quantity| / limit. Objectives have the shape (n,) and ratios
        (k, n); both are infinite without contact.
        """
        objective, ratios, _ = self._evaluate(np.array([gain]))
        return objective[0], ratios[:, 0]

    def criterion(self, which: int) -> Criterion:
        """Return the search criterion of the objective or a limit.

        Index -1 is the objective. Other indices are limits, with the ratio |quantity| / limit.
        """
        if which < 0:
            return merit(self.task.goal, self.ensemble.speed, self.task.impact)
        return ratio(self.limits[which].constraint, self.task.impact)

    def has_slopes(self, which: int = -1) -> bool:
        """Return True if a search criterion has exact derivatives.

        Index -1 is the objective. Other indices are constraints.
        """
        return self.is_differentiable and self.criterion(which).has_gradients

    def slope(self, result: ContactResult, name: str, which: int = -1) -> FloatArray:
        """Differentiate a search criterion with respect to an input.

        Index -1 is the objective. Other indices are ratios |quantity| / limit.

        Returns:
            The derivative in each encounter.
        """
        of = along(partial(self.ensemble.slope, result), name, self.ensemble.scenario.obstacle.velocity)
        return self.criterion(which).slope(result.end, of)

    def lowest_needed(self) -> float:
        """Find the strongest gain that can be optimal.

        Gains are evaluated from the weakest to the strongest. Part of the measure can only grow with the gain; the
        search ends when this part exceeds the best measure so far.

        Returns:
            Its value of the search variable.
        """
        low, high = self.axis.span
        if not self._touch_later():
            return low
        best = np.inf
        count = int(np.ceil((high - low) / _STRIDE)) + 1
        for u in np.linspace(high, low, count)[1:]:
            gain = self.axis.gain(np.array([u]))
            objective, ratios, state = self._evaluate(gain)
            best = min(best, float(self._measured(objective, ratios).merit[0]))
            if gain[0] > 0:  # the proof does not apply to gains that drive the plant toward the object
                continue
            if float(self.measure.of(least_objective(self.task.goal, state, self.ensemble.speed))[0]) > best:
                return float(u)
        return low

    @property
    def _never_touches(self) -> bool:
        """True if every encounter provably ends without contact at all searched gains."""
        ensemble = self.ensemble
        if not self._has_theorems or (self.axis.gain(np.array(self.axis.span)) > 0).any():
            return False
        return bool(premises_hold(ensemble.scenario, receding=True).all()) and all(
            never_touches(*ensemble.at(i)).all() for i in range(len(ensemble))
        )

    @property
    def _has_theorems(self) -> bool:
        """Return True for L(1) with L(2) in continuous time, where theorems on later and missing contacts hold."""
        ensemble = self.ensemble
        return ensemble.evaluator is None and ensemble.law == DAMPER and ensemble.method != "uniform-motion"

    def _touch_later(self) -> bool:
        """Return True if stronger gains provably delay contact in every encounter."""
        ensemble = self.ensemble
        if not self._has_theorems:
            return False
        if ensemble.likeness is not None:
            return bool(touches_later(ensemble.scenario, ensemble.likeness.sensor).all())
        if ensemble.many is not None:
            return bool(premises_hold(ensemble.scenario).all()) and ensemble.many.falls(ensemble.scenario)
        return all(bool(touches_later(*ensemble.at(i)).all()) for i in range(len(ensemble)))

    def _measured(self, objective: FloatArray, ratios: FloatArray) -> Landscape:
        """Return risk measure and constraints at the required probabilities from those of every encounter."""
        quantiles = [limit.share(ratio) for limit, ratio in zip(self.limits, ratios, strict=True)]
        return Landscape(
            objective=np.asarray(self.measure.of(objective)),
            ratios=np.reshape(quantiles, (len(quantiles), len(objective))),
        )

    def _evaluate(self, gains: FloatArray) -> tuple[FloatArray, FloatArray, ContactState]:
        """Evaluate objective and constraints of every encounter, and the states at their ends."""
        result = self.ensemble.contacts(gains[:, None], peaks=peaks_of(self.task))
        reached, state, speed = result.reached, result.end, self.ensemble.speed
        objective = appraise(self.task.goal, state, reached, speed, self.task.impact)
        ratios = [
            np.where(reached, limit.constraint.magnitude(state, self.task.impact) / limit.constraint.limit, np.inf)
            for limit in self.limits
        ]
        return objective, np.reshape(ratios, (len(ratios), *objective.shape)), state
