"""What fresh, independent samples say of a gain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .measures import Required
from .problem import RobustProblem

__all__ = ["LimitOutcome", "LossOfNominal", "Validation", "WorstEncounter", "least_probability", "validate"]

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


def least_probability(held: int, count: int, confidence: float) -> float:
    """Return the one-sided lower bound of a probability after so many successes (Clopper and Pearson, 1934)."""
    from scipy.special import betaincinv  # noqa: PLC0415 - SciPy, only when something is validated

    return 0.0 if held == 0 else float(betaincinv(held, count - held + 1, 1 - confidence))


def _limit(required: Required, ratio: FloatArray, confidence: float) -> LimitOutcome:
    held = int((ratio <= 1 + _ROUNDING).sum())
    return LimitOutcome(
        required=required,
        held=held / len(ratio),
        low=least_probability(held, len(ratio), confidence),
        magnitude=float(required.share(ratio)) * required.constraint.limit,
    )
