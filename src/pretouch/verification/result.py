"""What `verify_gain` returns: whether a gain holds on a loop, quantity by quantity, limit by limit, and what helps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Final

from pretouch._core.blocks import Described
from pretouch._core.files import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.vocabulary import words_for
from pretouch.design import GainDesign, Objective
from pretouch.design.robust import Required
from pretouch.motion import ContactResult, ContinuousLaw, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.uncertainty import Uncertainty

from .calibration_check import CalibrationCheck
from .effect import Effect, SensorSpeed, VerdictStatus
from .improvement import LoopChange, Loss
from .stability import StabilityCheck


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSpread(Value):
    """How a quantity differs from run to run, over the runs that came to a contact.

    Args:
        mean: the mean.
        standard_error: of the mean; NaN for a single run.
        low: 5 % of the runs stay below.
        median: half of the runs stay below.
        high: 95 % of the runs stay below.
        worst: the largest of all.
        runs: how many.
    """

    mean: float
    standard_error: float
    low: float
    median: float
    high: float
    worst: float
    runs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison(Value):
    """One quantity, predicted and simulated, with and without mitigation; magnitudes in SI.

    Args:
        name: the quantity.
        label: what it is called in reports.
        unit: its SI unit.
        predicted: of the nominal encounter in continuous time with a perfect sensor; None where it is not told.
        predicted_unmitigated: the same with D_p = 0.
        simulated: on the loop; None where no run came to a contact.
        unmitigated: on the loop with D_p = 0 and the same noise.
    """

    name: str
    label: str
    unit: str
    predicted: float | None
    predicted_unmitigated: float | None
    simulated: RunSpread | None
    unmitigated: RunSpread | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitCheck(Value):
    """One limit on the loop.

    Args:
        required: the constraint and the probability with which it must hold; 1 where it must in every run.
        predicted: |quantity| of the nominal encounter in continuous time, SI; None without contact.
        held: the share of the runs in which it holds.
        low: lower end of the exact (Clopper-Pearson) interval of the probability that it holds, one-sided.
        value: |quantity| that is not exceeded with the required probability, SI; None where runs that count end
            without contact.
        margin: limit - value, SI; negative where it is missed; None with it.
        source: where the quantity comes from, in words.
    """

    required: Required
    predicted: float | None
    held: float
    low: float
    value: float | None
    margin: float | None
    source: str

    @property
    def name(self) -> str:
        """Short name of the constraint, as in a scenario file."""
        return self.required.constraint.name

    @property
    def limit(self) -> float:
        """The largest allowed magnitude, SI."""
        return self.required.constraint.limit

    @property
    def unit(self) -> str:
        """The SI unit of the limit."""
        return self.required.constraint.unit

    @property
    def is_met(self) -> bool:
        """Whether it held in as many runs as it must."""
        return self.held >= self.required.probability - 1e-12

    @property
    def label(self) -> str:
        """What is limited, in words."""
        return words_for(self.required.constraint.quantity)

    @property
    def statement(self) -> str:
        """The limit in words, such as `largest excursion <= 0.1 m`."""
        return f"{self.label} <= {self.limit:g} {self.unit.replace('*', ' ')}"

    def to_dict(self) -> dict[str, Any]:
        """Return the check as one JSON object, in SI."""
        names = ("name", "label", "limit", "unit", "is_met", "predicted", "held", "value", "margin", "source")
        told = {name: getattr(self, name) for name in names}
        return {**told, "probability": self.required.probability, "held_at_least": self.low}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reached(Value):
    """Which runs came to a contact.

    Args:
        predicted: the share of the drawn encounters that do in continuous time with a perfect sensor.
        simulated: the share of the runs that did.
        missing: how many runs did not although it was predicted.
        low: lower end of the exact interval of the probability that a predicted contact comes; None where none is.
    """

    predicted: float
    simulated: float
    missing: int
    low: float | None


_HOLDS: Final = {
    VerdictStatus.HOLDS: "holds on this loop",
    VerdictStatus.HOLDS_NARROWLY: "holds narrowly on this loop",
    VerdictStatus.DOES_NOT_HOLD: "does not hold on this loop",
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Verdict(Described, Value):
    """What `verify_gain` returns: whether a gain holds on a loop, and what would help.

    Args:
        status: holds, holds-narrowly, does-not-hold or no-gain.
        gain: the number of the law that was verified, D_p [N s]; None where there is none.
        reasons: why the status is not `holds`, the gravest first.
        design: the ideal design: continuous time, perfect sensor, nominal encounter.
        predicted: the nominal encounter at the gain in continuous time; None without a gain.
        reached: which runs came to a contact; None without a gain, as all that follows.
        effect: what the gain does to the speed at contact compared with no mitigation; None where no run comes to a
            contact.
        comparisons: each quantity, predicted and simulated, with and without mitigation.
        limits: each limit.
        stability: the margin to instability; None where it is not known.
        stability_text: the same in words, or why it is not known.
        sensor_speed: contact compared with what an infinitely fast sensor would give; None for a law that is told no
            rate, or without contact.
        noiseless_effect: the effect in runs without noise, on the encounters that changes are compared by.
        speed_tolerance: by which share contact may be harder than predicted, and than with an infinitely fast sensor.
        calibration_check: the gain on other sensors that the readings of the calibration allow; None where no
            calibration was given, its readings are too few to tell, or the fitted curve comes to no contact.
        loss: what the gain costs beside the best one for this loop; None without changes.
        changes: what was tried, the most helpful first.
        as_it_is: the same of the loop without a change, over the runs that changes are compared by; and over all runs,
            which another gain is compared by, where these are more; empty without changes.
        assumptions: what the verdict rests on.
        warnings: what to look at.
        runs: how many runs.
        compared_runs: of which so many are used for changes and other gains.
        seed: of encounters and noise.
        confidence: of the bounds.
        scenario: the nominal encounter.
        sensor: the sensor curve.
        definition: the objective.
        loop: the loop.
        uncertainty: what is known of inputs.
        mitigated: the runs, each of which can be traced.
        unmitigated: the same runs with D_p = 0.
    """

    status: VerdictStatus
    gain: float | None
    reasons: tuple[str, ...]
    design: GainDesign
    predicted: ContactResult | None = None
    reached: Reached | None = None
    effect: Effect | None = None
    comparisons: tuple[Comparison, ...] = ()
    limits: tuple[LimitCheck, ...] = ()
    stability: StabilityCheck | None = None
    stability_text: str = ""
    sensor_speed: SensorSpeed | None = None
    noiseless_effect: Effect | None = None
    speed_tolerance: float = 0.1
    calibration_check: CalibrationCheck | None = None
    loss: Loss | None = None
    changes: tuple[LoopChange, ...] = ()
    as_it_is: tuple[LoopChange, ...] = ()
    assumptions: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    runs: int
    compared_runs: int
    seed: int
    confidence: float
    scenario: Scenario
    sensor: SensorModel
    definition: Objective
    loop: ClosedLoop
    uncertainty: Uncertainty
    mitigated: SimulationResult | None = None
    unmitigated: SimulationResult | None = None

    page: ClassVar[str] = "pretouch.verification.page:verdict_page"

    @property
    def law(self) -> ContinuousLaw:
        """The law in continuous time that the loop samples."""
        return self.design.problem.task.law

    @property
    def best_change(self) -> LoopChange | None:
        """The one change that helps most; None where nothing helps by more than chance."""
        return next((change for change in self.changes if change.helps), None)

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        if self.gain is None:
            return f"There is no gain to verify: {self.design.headline.removesuffix('.')}."
        text = f"{self.law.number.equals(self.gain)} {_HOLDS[self.status]}"
        if self.reasons:
            text += f": {self.reasons[0]}"
            others = len(self.reasons) - 1
            text += f" ({others} more reason{'s' if others > 1 else ''} below)" if others else ""
        parts = [text, *_speed(self.comparison("relative_velocity"))]
        if self.status is VerdictStatus.HOLDS:
            if self.limits:
                parts.append(f"every limit held as often as it must in {self.runs} runs")
            if self.stability is not None and math.isfinite(self.stability.margin):
                margin = f"{self.stability.margin:.3g}"
                parts.append(f"the gain could be {margin} times as strong before the loop oscillates")
        return "; ".join(parts) + "."

    def comparison(self, name: str) -> Comparison | None:
        """Return one of the comparisons, by the name of its quantity; None where there is none of it."""
        return next((c for c in self.comparisons if c.name == name), None)

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as one JSON object: numbers in SI, None where there is none."""
        names = (
            *("status", "headline", "gain", "reasons", "runs", "compared_runs", "seed", "confidence"),
            *("predicted", "reached", "effect", "comparisons", "limits", "stability", "stability_text"),
            *("sensor_speed", "noiseless_effect", "speed_tolerance"),
            *("calibration_check", "loss", "changes", "as_it_is", "assumptions", "warnings"),
        )
        design, best = self.design, self.best_change
        told: dict[str, Any] = plain(
            {
                **{name: getattr(self, name) for name in names},
                "objective_name": self.definition.name,
                "design": {"status": design.status, "gain": design.gain, "objective": design.objective},
                "best_change": None if best is None else best.name,
            }
        )
        return told

    def __repr__(self) -> str:
        if self.gain is None or self.stability is None or not math.isfinite(self.stability.margin):
            return f"<Verdict: {self.status.value}>"
        margin = f"margin {self.stability.margin:.3g} to instability"
        return f"<Verdict: {self.status.value}, {self.law.number.equals(self.gain)}, {self.runs} runs, {margin}>"


def _speed(compared: Comparison | None) -> Iterator[str]:
    """Say how fast contact is, how that spreads, and what was predicted."""
    if compared is None or compared.simulated is None:
        return
    s, free = compared.simulated, compared.unmitigated
    mean, low, high = (format_quantity(speed, "m/s") for speed in (s.mean, s.low, s.high))
    beside = [f"{low} to {high} in 90 % of the runs"] if s.high - s.low > 1e-3 * s.mean else []
    if compared.predicted is not None:
        beside.append(f"{format_quantity(compared.predicted, 'm/s')} predicted")
    text = f"contact at {mean}" + (f" ({', '.join(beside)})" if beside else "")
    yield text + ("" if free is None else f" instead of {format_quantity(free.mean, 'm/s')} without mitigation")
