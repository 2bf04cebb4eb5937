"""What a robust design comes to: the gain, what it promises, and what fresh samples say to that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.values import Value
from pretouch.motion import Scenario
from pretouch.sensors import SensorModel
from pretouch.uncertainty import Uncertainty

from ..certificate import DesignStatus
from ..impact import ImpactModel
from ..objectives import Objective
from .evidence import Outcomes, RobustEvidence, RobustTradeOff
from .importance import InputImportance
from .measures import Measure, Required

__all__ = ["LimitOutcome", "LossOfNominal", "Price", "RobustDesign", "Validation", "WorstEncounter"]


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
    limits: tuple[LimitOutcome, ...]
    reached: float


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


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Price(Value):
    """What one input, known exactly, would gain: the robust gain beside the one made for each value of the input.

    Args:
        name: the input.
        unit: its SI unit.
        value: its values, shape (n,).
        best_gain: the gain that is optimal for each [N s]; NaN where there is none.
        best: the objective there.
        robust: the objective of the robust gain; NaN where it does not end in contact.
        low: the input's 1 % quantile, or the smallest value that is possible.
        high: its 99 % quantile, or the largest.
    """

    name: str
    unit: str
    value: FloatArray
    best_gain: FloatArray
    best: FloatArray
    robust: FloatArray
    low: float
    high: float

    @property
    def loss(self) -> FloatArray:
        """By how much the robust gain is worse than the best, as a share of the best objective."""
        return self.robust / self.best - 1

    def __repr__(self) -> str:
        most = np.max(self.loss, initial=0.0, where=np.isfinite(self.loss))
        return f"<Price: {self.name} from {self.low:g} to {self.high:g} {self.unit}, loss up to {most:.3g}>"


@dataclass(frozen=True, kw_only=True, repr=False)
class RobustDesign(Value):
    """What `design_robust_gain` returns.

    Args:
        status: optimal, infeasible (a constraint cannot be met) or no-contact.
        gain: D_p [N s]; None unless optimal.
        value: the measure of the objective that was minimized; None unless optimal.
        measure: its definition.
        nominal_gain: the gain that is optimal where every input has its given value, always in continuous time: the
            ideal design [N s]; None where there is none.
        validation: what fresh samples say; None unless optimal.
        worst: the worst encounter, for a worst case; else None.
        local_minima: the local minima of the measure, as (gain, value), best first.
        scanned: how many gains were appraised to find them.
        strongest: the gain beyond which none is needed: none stronger can be the optimum [N s].
        samples: how many encounters the measure was taken over.
        seed: of the samples.
        bounds: the gains between which the optimum was sought [N s].
        scenario: the encounter as given.
        sensor: the sensor as given.
        uncertainty: what is known of the inputs.
        definition: the objective.
        limits: the constraints.
        impact: the physical properties, where given.
        ranking: what `importance` calls.
        pricing: what `price` calls.
        evidence: what the parts below are computed from.
    """

    status: DesignStatus
    gain: float | None
    value: float | None
    measure: Measure
    nominal_gain: float | None
    validation: Validation | None
    worst: WorstEncounter | None
    local_minima: tuple[tuple[float, float], ...]
    scanned: int
    strongest: float
    samples: int
    seed: int
    bounds: tuple[float, float]
    scenario: Scenario
    sensor: SensorModel
    uncertainty: Uncertainty
    definition: Objective
    limits: tuple[Required, ...]
    impact: ImpactModel | None
    ranking: Callable[[float], tuple[InputImportance, ...]] = field(repr=False, compare=False)
    pricing: Callable[..., Price] = field(repr=False, compare=False)
    evidence: RobustEvidence = field(repr=False)

    @property
    def loss_of_nominal(self) -> LossOfNominal | None:
        """What the nominal gain, that of the ideal design, loses on fresh samples; None where it is not known."""
        return None if self.validation is None else self.validation.loss

    @property
    def on_evaluator(self) -> bool:
        """Whether encounters were solved by what was given as `evaluate`, such as a ClosedLoop."""
        return self.evidence.problem.ensemble.evaluator is not None

    @cached_property
    def method(self) -> str:
        """How the encounters were solved, as in ContactResult."""
        ensemble = self.evidence.problem.ensemble
        if self.on_evaluator:
            return ensemble.contacts(0.0 if self.gain is None else self.gain).method
        constant = self.sensor.constant_log_slope is not None
        return ensemble.method if ensemble.method != "auto" else "closed-form" if constant else "integration"

    @cached_property
    def trade_off(self) -> RobustTradeOff:
        """The measure over the gain, on the samples of the design, as far as the robust and the nominal gain."""
        return self.evidence.trade_off(*(g for g in (self.gain, self.nominal_gain) if g is not None))

    @property
    def nearest_gain(self) -> float | None:
        """Where infeasible, the gain that exceeds the limits least [N s]; else None."""
        return self.evidence.nearest_gain() if self.status is DesignStatus.INFEASIBLE else None

    def outcomes(self, gain: float | None = None) -> Outcomes:
        """Tell what a gain leads to in each of the fresh encounters.

        Args:
            gain: D_p [N s]; the robust gain where none is given.

        Returns:
            The outcomes, one per fresh sample.

        Raises:
            ResultUnavailableError: no gain is given, and there is no robust one.
        """
        chosen = self.gain if gain is None else float(finite(gain, "gain", "N*s"))
        if chosen is None:
            raise ResultUnavailableError("outcomes: there is no robust gain; see the status, or give a gain")
        return self.evidence.outcomes(chosen)

    def price(self, name: str, *, count: int = 101, gain: float | None = None) -> Price:
        """Tell what knowing one input exactly would have gained, as a curve over that input.

        Args:
            name: an uncertain input, such as `obstacle.velocity`.
            count: at how many values.
            gain: another gain D_p than the robust one [N s], such as the nominal gain.

        Returns:
            The curve; the other inputs have their given values, those that were estimated together with it follow.
        """
        return self.pricing(name, count) if gain is None else self.pricing(name, count, gain=gain)

    @cached_property
    def importance(self) -> tuple[InputImportance, ...]:
        """Which uncertain input the objective varies with most at the robust gain: what is worth measuring better.

        Sobol indices from as many samples as the design was made with, and the same to first order from gradients, the
        largest first; empty where there is no robust gain.
        """
        return () if self.gain is None else self.ranking(self.gain)

    def to_dict(self) -> dict[str, Any]:
        """Return the design as one JSON object: numbers in SI, None where there is none."""
        return robust_as_dict(self)

    def __repr__(self) -> str:
        if self.gain is None:
            return f"<RobustDesign: {self.status.value}>"
        return f"<RobustDesign: D_p = {self.gain:.4g} N s, {self.measure.label} {self.value:.4g}>"

    def __str__(self) -> str:
        return robust_as_text(self)


from .summary import robust_as_dict, robust_as_text  # noqa: E402 - it describes the classes above
