"""Define the result of verifying a gain.

The result has a verdict on the gain, and statistics over all simulated runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from pretouch._core.display import Described
from pretouch._core.files import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.vocabulary import Entry
from pretouch.designs import GainDesign, Objective
from pretouch.designs.robust.required import Required
from pretouch.motion import ContactResult, ContinuousLaw, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.uncertainty import Uncertainty

from .at_rest import RestMotion
from .breakage import Breakage
from .calibration_check import CalibrationCheck
from .effect import Effect, SensorSpeed, VerdictStatus
from .improvement import LoopChange, Loss
from .settings import Setting
from .stability import StabilityCheck


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSpread(Value):
    """Statistics of a quantity over the runs with contact.

    Args:
        mean: the mean.
        standard_error: standard error of the mean; NaN for a single run.
        low: 5 % quantile.
        median: median.
        high: 95 % quantile.
        worst: maximum.
        runs: number of runs.
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
    """Predicted and simulated values of one contact quantity.

    Both are with and without impact mitigation. Values are magnitudes in SI units.

    Args:
        name: the quantity.
        label: its name in reports.
        unit: its SI unit.
        predicted: value for the nominal encounter in continuous time with a perfect sensor; None if not predicted.
        predicted_unmitigated: the predicted value with gain 0.
        simulated: spread over the runs on the loop; None if no run ends in contact.
        unmitigated: spread over the runs with gain 0 and the same noise.
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
    """How often the simulated runs meet one limit.

    Args:
        required: the constraint and the probability with which it must be met; 1 for every run.
        limited: words, symbol and unit of the limited quantity.
        predicted: |quantity| of the nominal encounter in continuous time, SI; None without contact.
        held: share of the runs that meet the limit.
        low: one-sided lower confidence bound (Clopper-Pearson) of the probability that the limit is met.
        value: quantile of |quantity| at the required probability, SI; None if too many runs end without contact.
        margin: limit - value, SI; negative if the limit is missed; None if `value` is None.
        source: how the quantity is computed, in words.
    """

    required: Required
    limited: Entry
    predicted: float | None
    held: float
    low: float
    value: float | None
    margin: float | None
    source: str

    @property
    def name(self) -> str:
        """Short name of the limited quantity, as in a scenario file."""
        return self.required.constraint.name

    @property
    def limit(self) -> float:
        """The largest allowed magnitude of the quantity, in SI units."""
        return self.required.constraint.limit

    @property
    def unit(self) -> str:
        """The SI unit of the limit."""
        return self.limited.unit

    @property
    def is_met(self) -> bool:
        """True if enough simulated runs meet the limit.

        Enough means at least the required share.
        """
        return self.held >= self.required.probability - 1e-12

    @property
    def label(self) -> str:
        """Plain-language name of the limited quantity."""
        return self.limited.words

    @property
    def statement(self) -> str:
        """The limit as text, such as `largest excursion <= 0.1 m`."""
        return f"{self.label} <= {self.limit:g} {self.unit.replace('*', ' ')}"

    def to_dict(self) -> dict[str, Any]:
        """Return the limit check as one JSON object in SI units."""
        names = ("name", "label", "limit", "unit", "is_met", "predicted", "held", "value", "margin", "source")
        values = {name: getattr(self, name) for name in names}
        return {**values, "probability": self.required.probability, "held_at_least": self.low}


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproachCheck(Value):
    """Result of the runs that begin where the controller detects the object.

    Args:
        start: distance at the start of the encounter [m].
        distance: detection distance [m], at which these runs begin.
        cures: how to make both distances agree.
        limits: how often these runs meet each limit.
        is_harder: whether contact is harder than without mitigation.
    """

    start: float
    distance: float
    cures: str
    limits: tuple[LimitCheck, ...]
    is_harder: bool

    @property
    def missed(self) -> tuple[LimitCheck, ...]:
        """The limits that these runs miss."""
        return tuple(check for check in self.limits if not check.is_met)

    @property
    def is_met(self) -> bool:
        """True if these runs meet every limit, and contact is no harder than without mitigation."""
        return not self.missed and not self.is_harder

    @property
    def place(self) -> str:
        """Where these runs begin, in words."""
        return f"from {format_quantity(self.distance, 'm')}, where the floor detects the object"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reached(Value):
    """How many simulated runs end in contact, compared with the prediction.

    Args:
        predicted: share of the drawn encounters with a contact in continuous time with a perfect sensor.
        simulated: share of the runs with a contact.
        missing: number of runs without the predicted contact.
        late: number of these runs whose contact is predicted near the horizon of the loop or after it.
        low: lower confidence bound of the probability that a predicted contact happens; None if none is predicted.
        latest: time of the latest predicted contact [s]; 0 if none is predicted.
    """

    predicted: float
    simulated: float
    missing: int
    low: float | None
    late: int = 0
    latest: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice(Value):
    """What to do next, and the verdict that results from it.

    Args:
        kind: `approach` (the object must approach), `design` (no gain meets the requirements), `detection` (the
            controller never detects the object), `start` (the encounter starts elsewhere than the controller detects
            the object), `calibration` (a better one), `horizon` (a longer one), `floor` (another one, so that noise
            does not move the robot), `runs` (more runs, whose result is open), `change` (another gain or loop),
            `limit` (no simulated change keeps the limits, so one is relaxed), `readings` (repeated readings,
            because the noise of the sensor is a guess), `gain` (a weaker one, or one of the other sign), `sensor` (a
            faster one) or `none` (no simulated change helps).
        sentence: what to do, with numbers and with the verdict that results from it.
        settings: the same as keys of a scenario file and their new values, such as
            `{"controller.gain": "-0.86 N*s"}`; None removes a key.
        status: the status of the verdict with these settings, which was simulated; None if it was not.
        fresh_runs: number of fresh runs that confirm this status: their encounters and noise were not used to find
            the settings.
    """

    kind: str
    sentence: str
    settings: Mapping[str, Setting] = field(default_factory=dict)
    status: VerdictStatus | None = None
    fresh_runs: int = 0


_HOLDS: Final = {
    VerdictStatus.HOLDS: "Holds",
    VerdictStatus.HOLDS_NARROWLY: "Holds narrowly",
    VerdictStatus.DOES_NOT_HOLD: "Does not hold",
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Verdict(Described, Value):
    """Result of `verify`: whether a gain meets its requirements.

    The requirements are checked on the sampled loop. The result also says which changes would help.

    Args:
        status: holds, holds-narrowly, does-not-hold or no-gain.
        gain: the verified number of the law, such as D_p [N s]; None if there is none.
        reasons: why the status is not `holds`, most serious first.
        design: the ideal design: continuous time, perfect sensor, nominal encounter.
        predicted: the nominal encounter at the gain in continuous time; None without a gain.
        reached: how many runs end in contact; None without a gain, as are the following fields.
        effect: effect of the gain on the speed at contact, compared with no mitigation; None if no run ends in
            contact.
        comparisons: each quantity, predicted and simulated, with and without mitigation.
        limits: each limit.
        approach: the same limits in runs that begin where the controller detects the object; None if the encounter
            starts there.
        stability: gain margin and sensor rates; None if they are not known.
        no_stability_text: why the stability is not known, in words.
        sensor_speed: comparison with an infinitely fast sensor; None for a law without a sensor rate, or without
            contact.
        at_rest: how far noise alone moves a robot at rest near an object; None if it is below 1 mm.
        breakage: what the robot does if the sensor fails; None for a law that is not one of pretouch.
        noiseless_effect: the effect without noise, in the encounters on which changes are compared.
        speed_tolerance: share by which contact may be faster than predicted and than with an infinitely fast sensor.
        calibration_check: results on other sensors that are compatible with the readings of the calibration; None
            without a calibration, with too few readings, or if the fitted curve leads to no contact.
        loss: cost of the gain compared with the best one for this loop; None without changes.
        changes: the changes that were tried, most helpful first.
        advice: what to do next so that the verdict holds, and how certain this is; None if nothing is advised.
        unchanged: the unchanged loop over the runs on which changes are compared. A second entry, if there are more
            runs, is over all runs, on which another gain is compared. Empty without changes.
        assumptions: assumptions of the verdict.
        warnings: sentences to read before relying on the verdict.
        runs: number of runs.
        compared_runs: number of runs on which changes are compared.
        needed_rate: if only the required gain margin leaves no gain, the sensor rate at which the optimum without it
            has this margin [Hz]; infinite if no rate is high enough; else None.
        seed: seed of encounters and noise.
        confidence: confidence level of the bounds.
        scenario: the nominal encounter.
        sensor: the sensor curve.
        definition: the objective.
        loop: the loop.
        uncertainty: distributions of uncertain inputs.
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
    approach: ApproachCheck | None = None
    stability: StabilityCheck | None = None
    no_stability_text: str = ""
    sensor_speed: SensorSpeed | None = None
    at_rest: RestMotion | None = None
    breakage: Breakage | None = None
    noiseless_effect: Effect | None = None
    speed_tolerance: float = 0.1
    calibration_check: CalibrationCheck | None = None
    loss: Loss | None = None
    changes: tuple[LoopChange, ...] = ()
    advice: Advice | None = None
    unchanged: tuple[LoopChange, ...] = ()
    assumptions: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    runs: int
    compared_runs: int
    needed_rate: float | None = None
    seed: int
    confidence: float
    scenario: Scenario
    sensor: SensorModel
    definition: Objective
    loop: ClosedLoop
    uncertainty: Uncertainty
    mitigated: SimulationResult | None = None
    unmitigated: SimulationResult | None = None

    @property
    def law(self) -> ContinuousLaw:
        """The continuous-time control law that the controller approximates."""
        return self.design.problem.task.law

    @property
    def stability_text(self) -> str:
        """The stability in words, or why it is not known."""
        return self.no_stability_text if self.stability is None else self.stability.text

    @property
    def best_change(self) -> LoopChange | None:
        """The most helpful change of the loop or gain.

        None if no change helps significantly.
        """
        return next((change for change in self.changes if change.helps), None)

    @property
    def headline(self) -> str:
        """A sentence that says whether the gain meets the requirements, and why."""
        if self.gain is None:
            headline = self.design.headline
            return f"There is no gain to verify: {headline[:1].lower()}{headline[1:]}"
        status = _HOLDS[self.status]
        if self.status is VerdictStatus.HOLDS and self.breakage is not None and self.breakage.harder:
            status = "Holds while the sensor works"
        if self.reasons:
            others = len(self.reasons) - 1
            more = f" ({others} more reason{'s' if others > 1 else ''} below)" if others else ""
            return f"{status}: {self.reasons[0]}{more}."
        limits = "; every limit is met as often as required" if self.limits else ""
        return f"{status}: {_speed(self.comparison('relative_velocity'))}{limits}."

    def comparison(self, name: str) -> Comparison | None:
        """Return simulated and predicted values of one quantity.

        None if the quantity was not compared.
        """
        return next((c for c in self.comparisons if c.name == name), None)

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as one JSON object in SI units.

        Missing numbers are None.
        """
        names = (
            *("status", "headline", "gain", "reasons", "runs", "compared_runs", "needed_rate", "seed", "confidence"),
            *("predicted", "reached", "effect", "comparisons", "limits", "stability", "stability_text"),
            *("approach", "sensor_speed", "at_rest", "breakage", "noiseless_effect", "speed_tolerance"),
            *("calibration_check", "loss", "changes", "advice", "unchanged", "assumptions", "warnings"),
        )
        design, best = self.design, self.best_change
        document: dict[str, Any] = plain(
            {
                **{name: getattr(self, name) for name in names},
                "objective_name": self.definition.name,
                "design": {"status": design.status, "gain": design.gain, "objective": design.objective},
                "best_change": None if best is None else best.name,
            }
        )
        return document

    def __repr__(self) -> str:
        if self.gain is None or self.stability is None or not math.isfinite(self.stability.margin):
            return f"<Verdict: {self.status.value}>"
        margin = f"gain margin {self.stability.margin:.3g}"
        return f"<Verdict: {self.status.value}, {self.law.number.equals(self.gain)}, {self.runs} runs, {margin}>"


def _speed(compared: Comparison | None) -> str:
    """Return text on the mean contact speed with and without impact mitigation."""
    free = None if compared is None or compared.unmitigated is None else compared.unmitigated.mean
    without = "" if free is None else format_quantity(free, "m/s", 3)
    if compared is None or compared.simulated is None:
        if not without:
            return "no run ends in contact"
        return f"no run ends in contact; without mitigation, the mean contact speed is {without}"
    speed = f"contact at {format_quantity(compared.simulated.mean, 'm/s', 3)} on average"
    return f"{speed} instead of {without} without mitigation" if without else speed
