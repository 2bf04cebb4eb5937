"""What `verify_gain` returns: whether a gain holds on a loop, what it rests on, and what would help."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Final

from pretouch._core.described import Described
from pretouch._core.json_text import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.design import GainDesign, Objective, Task
from pretouch.motion import ContactResult, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.uncertainty import Uncertainty

from .appraisal import Effect
from .calibration_check import CalibrationCheck
from .checks import Comparison, LimitCheck, Reached, VerdictStatus
from .improvement import LoopChange, Loss
from .stability import StabilityCheck

__all__ = ["Verdict"]

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
        gain: D_p that was verified [N s]; None where there is none.
        reasons: why the status is not `holds`, the gravest first.
        design: the ideal design: continuous time, perfect sensor, nominal encounter.
        predicted: the nominal encounter at the gain in continuous time; None without a gain.
        reached: which runs came to a contact; None without a gain, as all that follows.
        effect: what the gain does to the speed at contact beside no mitigation; None where it does not mitigate, or no
            run comes to a contact both ways.
        comparisons: each quantity, predicted and simulated, with and without mitigation.
        limits: each limit.
        stability: the margin to instability; None where it is not known.
        stability_text: the same in words, or why it is not known.
        calibration_check: the gain on other sensors that the readings of the calibration allow; None where no
            calibration was given, its readings are too few to tell, or the fitted curve comes to no contact.
        loss: what the gain costs beside the best one for this loop; None without changes.
        changes: what was tried, the most helpful first.
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
    calibration_check: CalibrationCheck | None = None
    loss: Loss | None = None
    changes: tuple[LoopChange, ...] = ()
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

    @classmethod
    def of(cls, task: Task, compared: int, **found: Any) -> Verdict:
        """Return what was found beside what was asked, with how many runs changes were compared by."""
        same = ("runs", "confidence", "scenario", "sensor", "loop", "uncertainty")
        given = {name: getattr(task, name) for name in same}
        return cls(**given, seed=task.loop.seed, definition=task.goal, compared_runs=compared, **found)

    @property
    def best_change(self) -> LoopChange | None:
        """The one change that helps most; None where nothing helps by more than chance."""
        return next((change for change in self.changes if change.helps), None)

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        if self.gain is None:
            return f"There is no gain to verify: {self.design.headline.removesuffix('.')}."
        text = f"D_p = {format_quantity(self.gain, 'N*s')} {_HOLDS[self.status]}"
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
        """Return one of the comparisons.

        Args:
            name: the quantity.

        Returns:
            The comparison; None where there is none of it.
        """
        return next((c for c in self.comparisons if c.name == name), None)

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as one JSON object: numbers in SI, None where there is none."""
        design, best = self.design, self.best_change
        first = ("status", "headline", "gain", "reasons", "runs", "compared_runs", "seed", "confidence")
        found = ("predicted", "reached", "effect", "comparisons", "limits", "stability", "stability_text")
        more = ("calibration_check", "loss", "changes", "assumptions", "warnings")
        told: dict[str, Any] = plain(
            {
                **{name: getattr(self, name) for name in (*first, *found, *more)},
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
        return f"<Verdict: {self.status.value}, D_p = {self.gain:.4g} N s, {self.runs} runs, {margin}>"


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
