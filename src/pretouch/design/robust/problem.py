"""A robust design problem over encounters that may happen, and what fresh ones say of a gain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.motion import DAMPER, ContactResult
from pretouch.uncertainty import Ensemble, make_ensemble

from ..certificate import least_objective, premises_hold, touches_later
from ..objectives import appraise
from ..problem import Criterion, GainProblem, along, merit, ratio
from ..search import GainAxis, Landscape
from ..task import Task
from .measures import Expected, Measure, Required, least_probability, limits_of

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
        names = ("method", "horizon", "law", "evaluate")
        how = {**{name: getattr(task, name) for name in names}, **options}
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

    def has_slopes(self, which: int = -1) -> bool:
        """Tell whether `slope` knows the objective (-1), or a constraint, by every input."""
        return self.is_differentiable and self.criterion(which).has_gradients

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
        if several.evaluator is not None or several.law != DAMPER or several.method == "uniform-motion":
            return False  # the proof speaks of L(1) with L(2) from the given state in continuous time
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


_ROUNDING: Final = 1e-12  # of a limit


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitOutcome(Value):
    """One constraint at the chosen gain, on fresh samples.

    Args:
        required: the constraint and the probability with which it must hold.
        held: the share of the fresh samples in which it does.
        low: lower end of the exact (Clopper-Pearson) interval of the probability that it holds, one-sided.
        magnitude: |quantity| that is not exceeded with the required probability (in all samples, where that is 1), SI.
    """

    required: Required
    held: float
    low: float
    magnitude: float

    def to_dict(self) -> dict[str, Any]:
        """Return the outcome as one JSON object, in SI."""
        c = self.required.constraint
        known = {"name": c.name, "limit": c.limit, "unit": c.unit, "probability": self.required.probability}
        return {**known, "held": self.held, "held_at_least": self.low, "magnitude": self.magnitude}


@dataclass(frozen=True, slots=True, kw_only=True)
class LossOfNominal(Value):
    """What is lost by the nominal gain, on fresh samples that meet both gains.

    Args:
        relative: by how much its measure exceeds that of the robust gain, as a share of the latter; negative where the
            nominal gain does better.
        standard_error: of that, from the differences sample by sample; NaN where it is not known.
    """

    relative: float
    standard_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation(Value):
    """What independent samples that the design has not seen say of its gain.

    Args:
        samples: how many.
        confidence: of the intervals.
        value: the measure of the objective.
        low: lower end of its confidence interval.
        high: upper end.
        nominal: the measure at the gain that is optimal where nothing is uncertain; None where there is none.
        loss: of the nominal gain against the robust one; None where either measure is not finite.
        nominal_breaks: the constraints that the nominal gain does not hold as often as they must.
        limits: each constraint.
        reached: the share that ends in contact.
    """

    samples: int
    confidence: float
    value: float
    low: float
    high: float
    nominal: float | None
    loss: LossOfNominal | None
    nominal_breaks: tuple[str, ...]
    limits: tuple[LimitOutcome, ...]
    reached: float

    def may_hold(self, outcome: LimitOutcome) -> bool:
        """Tell whether the samples leave it open that a constraint holds as often as it must."""
        missed = self.samples - round(outcome.held * self.samples)
        return 1 - least_probability(missed, self.samples, self.confidence) >= outcome.required.probability

    def says_of(self, outcome: LimitOutcome) -> str:
        """Say what the samples show of a constraint."""
        if outcome.held < outcome.required.probability:
            return "missed, within chance" if self.may_hold(outcome) else "missed"
        if outcome.low >= outcome.required.probability:
            return "shown"
        return "held in every sample" if outcome.held == 1 else "held, not shown"

    def to_dict(self) -> dict[str, Any]:
        """Return the validation as one JSON object, in SI."""
        names = ("samples", "confidence", "value", "low", "high", "nominal", "nominal_breaks", "reached")
        known = {name: getattr(self, name) for name in names}
        return {**known, "loss_of_nominal": self.loss, "constraints": self.limits}


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstEncounter(Value):
    """The worst encounter of all that are possible, and why none is worse.

    Args:
        inputs: its inputs by name, in SI.
        value: the objective there.
        bound: what no possible encounter exceeds, as far as the search of all boxes certifies it.
        lower: what no gain can get below, since these encounters alone ask for it.
        boxes: how many boxes of inputs were told apart to find that out.
        monotone: inputs in which the objective only grows or only falls over all of the box, with the sign.
        encounters: the encounters that decide, as rows of inputs in the order of `inputs`.
    """

    inputs: dict[str, float]
    value: float
    bound: float
    lower: float
    boxes: int
    monotone: dict[str, int]
    encounters: tuple[tuple[float, ...], ...]


def validate(problem: RobustProblem, gain: float, nominal: float | None) -> Validation:
    """Appraise a gain [N s], and a nominal one beside it, on fresh encounters that its design has not seen."""
    confidence = problem.task.confidence
    objective, ratios = problem.values(gain)
    value, low, high = problem.measure.estimate(objective, confidence)
    beside, loss = None, None
    broken: tuple[str, ...] = ()
    if nominal is not None:
        other, others = problem.values(nominal)
        shares = zip(problem.limits, others, strict=True)
        broken = tuple(r.constraint.name for r, ratio in shares if r.share(ratio) > 1 + _ROUNDING)
        beside = float(problem.measure.of(other))
        with np.errstate(invalid="ignore"):  # without contact in both
            change, error = problem.measure.difference(objective, other)
        if np.isfinite(change) and value > 0:
            loss = LossOfNominal(relative=change / value, standard_error=error / value)
    return Validation(
        samples=len(objective),
        confidence=confidence,
        value=value,
        low=low,
        high=high,
        nominal=beside,
        loss=loss,
        nominal_breaks=broken,
        limits=tuple(_limit(r, ratio, confidence) for r, ratio in zip(problem.limits, ratios, strict=True)),
        reached=float(np.isfinite(objective).mean()),
    )


def _limit(required: Required, ratio: FloatArray, confidence: float) -> LimitOutcome:
    held = int((ratio <= 1 + _ROUNDING).sum())
    return LimitOutcome(
        required=required,
        held=held / len(ratio),
        low=least_probability(held, len(ratio), confidence),
        magnitude=float(required.share(ratio)) * required.constraint.limit,
    )
