"""Validate a robust gain on new random samples that the design has not used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch._core.vocabulary import Entry

from .problem import RobustProblem
from .required import Required, least_probability

_ROUNDING: Final = 1e-12  # relative amount by which a value may exceed a limit, as rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitOutcome(Value):
    """Share of new random encounters that meet one constraint.

    All encounters have the designed gain.

    Args:
        required: the constraint and the probability with which it must hold.
        limited: words, symbol and unit of the limited quantity.
        held: the share of the fresh samples in which it holds.
        low: exact (Clopper-Pearson) one-sided lower confidence bound of the probability that it holds.
        magnitude: quantile of |quantity| at the required probability (the maximum for a probability of 1), in SI.
    """

    required: Required
    limited: Entry
    held: float
    low: float
    magnitude: float

    def to_dict(self) -> dict[str, Any]:
        """Return the validation of a constraint as a JSON object.

        Numbers are in SI units.
        """
        c, p = self.required.constraint, self.required.probability
        constraint = {"name": c.name, "limit": c.limit, "unit": self.limited.unit, "probability": p}
        return {**constraint, "held": self.held, "held_at_least": self.low, "magnitude": self.magnitude}


@dataclass(frozen=True, slots=True, kw_only=True)
class LossOfNominal(Value):
    """Loss of the nominal gain compared with the robust gain.

    Both are tested in the same new random encounters.

    Args:
        relative: relative increase of the measure over that of the robust gain; negative if the nominal gain is better.
        standard_error: its standard error, from paired differences; NaN if the measure gives none.
    """

    relative: float
    standard_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation(Value):
    """Test of a robust gain in new random encounters.

    The design did not use these encounters.

    Args:
        samples: number of samples.
        confidence: confidence level of the intervals.
        value: the measure of the objective.
        low: lower end of its confidence interval.
        high: upper end of its confidence interval.
        nominal: the measure with the nominal gain, which is optimal without uncertainty; None without such a gain.
        loss: the loss of the nominal gain compared with the robust one; None if a measure is not finite.
        nominal_breaks: the constraints that the nominal gain does not meet with their required probabilities.
        limits: the outcome of each constraint.
        reached: the share of the samples that end in contact.
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
        """Return False if samples contradict the required probability."""
        missed = self.samples - round(outcome.held * self.samples)
        return 1 - least_probability(missed, self.samples, self.confidence) >= outcome.required.probability

    def state_of(self, outcome: LimitOutcome) -> str:
        """Say whether samples demonstrate the required probability of a constraint."""
        if outcome.held < outcome.required.probability:
            return "missed, within chance" if self.may_hold(outcome) else "missed"
        if outcome.low >= outcome.required.probability:
            return "demonstrated"
        return "met in every sample" if outcome.held == 1 else "met, not demonstrated"

    def to_dict(self) -> dict[str, Any]:
        """Return the validation of a gain as a JSON object.

        Numbers are in SI units.
        """
        names = ("samples", "confidence", "value", "low", "high", "nominal", "nominal_breaks", "reached")
        document = {name: getattr(self, name) for name in names}
        return {**document, "loss_of_nominal": self.loss, "constraints": self.limits}


def validate(problem: RobustProblem, gain: float, nominal: float | None) -> Validation:
    """Test robust and nominal gain in new random encounters.

    Returns:
        The validation in encounters that the design did not use.
    """
    confidence, number = problem.task.robust.confidence, problem.task.law.number
    objective, ratios = problem.values(gain)
    value, low, high = problem.measure.estimate(objective, confidence)
    nominal_value, loss = None, None
    violated: tuple[str, ...] = ()
    if nominal is not None:
        nominal_objective, nominal_ratios = problem.values(nominal)
        pairs = zip(problem.limits, nominal_ratios, strict=True)
        violated = tuple(r.constraint.name for r, ratio in pairs if r.share(ratio) > 1 + _ROUNDING)
        nominal_value = float(problem.measure.of(nominal_objective))
        with np.errstate(invalid="ignore"):  # both objectives are infinite without contact
            change, error = problem.measure.difference(objective, nominal_objective)
        if np.isfinite(change) and value > 0:
            loss = LossOfNominal(relative=change / value, standard_error=error / value)
    return Validation(
        samples=len(objective),
        confidence=confidence,
        value=value,
        low=low,
        high=high,
        nominal=nominal_value,
        loss=loss,
        nominal_breaks=violated,
        limits=tuple(
            _limit(r, number.entry(r.constraint.quantity), ratio, confidence)
            for r, ratio in zip(problem.limits, ratios, strict=True)
        ),
        reached=float(np.isfinite(objective).mean()),
    )


def _limit(required: Required, limited: Entry, ratio: FloatArray, confidence: float) -> LimitOutcome:
    count = int((ratio <= 1 + _ROUNDING).sum())
    return LimitOutcome(
        required=required,
        limited=limited.in_words(),
        held=count / len(ratio),
        low=least_probability(count, len(ratio), confidence),
        magnitude=float(required.share(ratio)) * required.constraint.limit,
    )
