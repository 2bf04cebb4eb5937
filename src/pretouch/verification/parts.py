"""The parts of a verdict: each a value with its units."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from pretouch._core.numbers import FloatArray
from pretouch.design.robust import Required
from pretouch.simulation import GainLimit

__all__ = [
    "Change",
    "Comparison",
    "LimitCheck",
    "LoopCurve",
    "Loss",
    "Reached",
    "Spread",
    "StabilityCheck",
    "VerdictStatus",
]


class VerdictStatus(StrEnum):
    """What a verdict comes to. `meaning` says it in a sentence."""

    HOLDS = "holds"
    HOLDS_NARROWLY = "holds-narrowly"
    DOES_NOT_HOLD = "does-not-hold"
    NO_GAIN = "no-gain"

    @property
    def meaning(self) -> str:
        """One sentence for a person."""
        return {
            VerdictStatus.HOLDS: "Every limit held as often as it must, contact came where it was predicted, and the "
            "gain can at least double until the loop is unstable.",
            VerdictStatus.HOLDS_NARROWLY: "Nothing was missed in these runs, but something is near, or not shown.",
            VerdictStatus.DOES_NOT_HOLD: "A limit was missed, contact did not come, or the loop is unstable.",
            VerdictStatus.NO_GAIN: "There is no gain to verify.",
        }[self]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
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
class Comparison:
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
    simulated: Spread | None
    unmitigated: Spread | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitCheck:
    """One limit on the loop.

    Args:
        required: the constraint and the probability with which it must hold; 1 where it must in every run.
        predicted: |quantity| of the nominal encounter in continuous time, SI; None without contact.
        held: the share of the runs in which it holds; None where the quantity is not simulated.
        low: lower end of the exact (Clopper-Pearson) interval of the probability that it holds, one-sided; None then.
        value: |quantity| that is not exceeded with the required probability, SI; None then, and where runs that count
            end without contact.
        margin: limit - value, SI; negative where it is missed.
        source: where the quantity comes from, in words.
    """

    required: Required
    predicted: float | None
    held: float | None
    low: float | None
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
        """Whether it held in as many runs as it must; False where it is not simulated."""
        return self.held is not None and self.held >= self.required.probability - 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Reached:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityCheck:
    """How far the loop is from oscillating, linearized at each distance that the encounter passes.

    Args:
        limit: the strongest stable gain at each distance.
        margin: how many times the gain can grow until the loop is unstable; below 1 it is.
        rate: readings per second of the loop [Hz].
        lowest_rate: the rate of the sensor at which the gain is just stable [Hz]; infinite where none is high enough.
        lowest_rate_with_margin: the rate at which the gain could double [Hz]; infinite where none is high enough.
    """

    limit: GainLimit
    margin: float
    rate: float
    lowest_rate: float
    lowest_rate_with_margin: float

    @property
    def strongest(self) -> float:
        """The strongest gain that is stable at every distance [N s]."""
        return self.limit.strongest

    @property
    def critical_distance(self) -> float:
        """The distance that allows the least [m]."""
        return self.limit.critical_distance

    @property
    def frequency(self) -> float:
        """At which the loop oscillates at its limit [Hz]; NaN where there is none."""
        return self.limit.damping.frequency


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class LoopCurve:
    """The gains that were tried on the loop.

    Args:
        gain: D_p [N s], ascending, shape (n,).
        objective: its mean over the runs; infinite where a run ends without contact.
        standing: the least share of runs in which a limit holds beside the share required, at most 1.
        share: the share of runs in which all limits hold at once.
        runs: how many runs of each.
    """

    gain: FloatArray
    objective: FloatArray
    standing: FloatArray
    share: FloatArray
    runs: int

    def __repr__(self) -> str:
        return f"<LoopCurve: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g} N s, {self.runs} runs>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """What the gain costs beside the best one for this loop.

    Args:
        predicted: the objective of the nominal encounter in continuous time; None without contact.
        objective: its mean over the runs; None where it is not simulated or a run ends without contact.
        standard_error: of that mean.
        loop_gain: the best gain on the loop that keeps the limits [N s]; None where none within the bounds does.
        loop_objective: the mean objective with that gain, over the same runs.
        loss: mean of objective - objective with the loop gain, run by run.
        loss_error: standard error of that mean.
        curve: the gains that were tried.
    """

    predicted: float | None
    objective: float | None
    standard_error: float | None
    loop_gain: float | None
    loop_objective: float | None
    loss: float | None
    loss_error: float | None
    curve: LoopCurve


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One change of the loop or the gain, as it was simulated.

    Args:
        name: short name, such as `sensor-rate`.
        sentence: what to do, with numbers.
        gain: D_p with which it was run [N s].
        objective: the mean objective with it; None where it is not simulated or a run ends without contact.
        improvement: by how much the objective falls, as a share of what it was; None where either is not known.
        improvement_error: standard error of that.
        standing: the least share of runs in which a limit holds beside the share required, with it; at most 1.
        held: the share of runs with it in which the limit holds that was missed most; None where none was missed.
        margin: to instability with it; None where that is not known.
        helps: whether it gains more than chance can.
    """

    name: str
    sentence: str
    gain: float
    objective: float | None
    improvement: float | None
    improvement_error: float | None
    standing: float
    held: float | None
    margin: float | None
    helps: bool
