"""A robust design problem as a value: encounters that may happen, and how gains are appraised over them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.motion import ContactResult
from pretouch.uncertainty import Ensemble, make_ensemble

from ..bound import least_objective, premises_hold, touches_later
from ..criteria import Criterion, along, merit, ratio
from ..own_objective import appraise
from ..problem import GainProblem
from ..search import GainAxis, Landscape
from ..task import Task
from .measures import Expected, Measure, Required, limits_of

__all__ = ["RobustProblem"]

_BLOCK: Final = 1 << 19  # encounters that are solved at once: their states stay small beside the cache
_BLOCK_OF_OTHERS: Final = 1 << 16  # the same, where somebody else solves them
_STRIDE: Final = 0.5  # of u between gains that look for the end of the axis


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustProblem(GainProblem):
    """A task whose gains are appraised over many encounters.

    Args:
        ensemble: the encounters.
    """

    ensemble: Ensemble

    @classmethod
    def over(cls, task: Task, axis: GainAxis, values: Mapping[str, Any], **options: Any) -> RobustProblem:
        """Pose a task over encounters with these values of uncertain inputs; options are those of make_ensemble."""
        how = {"method": task.method, "horizon": task.horizon, "evaluate": task.evaluate, **options}
        return cls(task=task, axis=axis, ensemble=make_ensemble(task.scenario, task.sensor, values, **how))

    @property
    def measure(self) -> Measure:
        """What is made of the objectives of all encounters."""
        return Expected() if self.task.measure is None else self.task.measure

    @property
    def limits(self) -> tuple[Required, ...]:
        """The constraints, each with the probability with which it must hold."""
        return limits_of(self.task.constraints)

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Appraise gains by their coordinates, shape (m,)."""
        gains = self.axis.gain(coordinate)
        parts = list(self._parts(gains))
        return Landscape(
            objective=np.concatenate([objective for objective, _, _ in parts]),
            ratios=np.concatenate([ratios for _, ratios, _ in parts], axis=1),
        )

    def values(self, gain: float) -> tuple[FloatArray, FloatArray]:
        """Return objectives, shape (n,), and |quantity| / limit, shape (k, n), at a gain; infinite without contact."""
        objective, ratios, _ = self._raw(np.array([gain]))
        return objective[0], ratios[:, 0]

    def criterion(self, which: int) -> Criterion:
        """Return the objective (-1), or |quantity| / limit of a constraint."""
        if which < 0:
            return merit(self.task.goal, self.ensemble.speed, self.task.impact)
        return ratio(self.limits[which].constraint, self.task.impact)

    def slope(self, result: ContactResult, name: str, which: int = -1) -> FloatArray:
        """Differentiate the objective (-1), or |quantity| / limit of a constraint, by an input: in SI, shape (n,)."""
        of = along(partial(self.ensemble.slope, result), name, self.ensemble.scenario.obstacle.velocity)
        return self.criterion(which).slope(result.end, of)

    def lowest_needed(self) -> float:
        """Return the coordinate beyond which no stronger gain can be the optimum, or that of the strongest gain.

        Gains are appraised from the weakest on; where the part of the measure that only grows exceeds the best
        measure found, the axis ends.
        """
        low, high = self.axis.span
        if not self._touch_later():
            return low
        best = np.inf
        count = int(np.ceil((high - low) / _STRIDE)) + 1
        for u in np.linspace(high, low, count)[1:]:
            gain = self.axis.gain(np.array([u]))
            objective, ratios, least = next(self._parts(gain))
            found = Landscape(objective=objective, ratios=ratios)
            best = min(best, float(found.merit[0]))
            if gain[0] <= 0 and float(least[0]) > best:  # nothing is known of gains that drive toward the object
                return float(u)
        return low

    def _touch_later(self) -> bool:
        """Tell whether in every encounter a stronger mitigating gain is known to touch later."""
        several = self.ensemble
        if several.evaluator is not None or several.method == "uniform-motion":
            return False  # the proof speaks of L(1) from the given state in continuous time
        if several.likeness is not None:
            return bool(touches_later(several.scenario, several.likeness.sensor).all())
        if several.many is not None:
            return bool(premises_hold(several.scenario).all()) and several.many.falls(several.scenario)
        return all(bool(touches_later(*several.at(i)).all()) for i in range(len(several)))

    def _parts(self, gains: FloatArray) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
        """Yield measure, ratios and the least measure of stronger gains, for gains in blocks."""
        block = _BLOCK if self.ensemble.evaluator is None else _BLOCK_OF_OTHERS
        step = max(1, block // len(self.ensemble))
        for start in range(0, len(gains), step):
            objective, ratios, least = self._raw(gains[start : start + step])
            held = [limit.share(ratio) for limit, ratio in zip(self.limits, ratios, strict=True)]
            yield (
                np.asarray(self.measure.of(objective)),
                np.reshape(held, (len(held), objective.shape[0])),
                np.asarray(self.measure.of(least)),
            )

    def _raw(self, gains: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return objective and its least part, shape (m, n), and the ratios, shape (k, m, n)."""
        result = self.ensemble.contacts(gains[:, None])
        reached, state, speed = result.reached, result.end, self.ensemble.speed
        objective = appraise(self.task.goal, state, reached, speed, self.task.impact)
        ratios = [
            np.where(reached, limit.constraint.magnitude(state, self.task.impact) / limit.constraint.limit, np.inf)
            for limit in self.limits
        ]
        least = least_objective(self.task.goal, state, speed)
        return objective, np.reshape(ratios, (len(ratios), *objective.shape)), least
