"""What a verdict finds of the gain that it is about: each a value with its units."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Final

from pretouch._core.values import Value
from pretouch._core.vocabulary import words_for
from pretouch.design.robust import Required
from pretouch.simulation import GainLimit

__all__ = [
    "Comparison",
    "Effect",
    "LimitCheck",
    "Reached",
    "Spread",
    "StabilityCheck",
    "VerdictStatus",
]

_ERRORS: Final = 2.0  # standard errors: one in twenty differences is larger by chance, and half of these harder
_ROUNDING: Final = 1e-9  # of a speed: without noise, runs that do the same differ by less


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
            VerdictStatus.DOES_NOT_HOLD: "A limit was missed, contact did not come or is harder than without "
            "mitigation, the loop is unstable, or the calibration is not good enough.",
            VerdictStatus.NO_GAIN: "There is no gain to verify.",
        }[self]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread(Value):
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
    simulated: Spread | None
    unmitigated: Spread | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect(Value):
    """What mitigation does to the speed at contact, over the runs that come to a contact both with and without it.

    Args:
        speed: mean |l'| with mitigation [m/s].
        unmitigated: mean |l'| with D_p = 0 [m/s].
        difference: mean of the one less the other, run by run [m/s].
        standard_error: of that mean; NaN for a single run.
        runs: how many.

    Examples:
        >>> Effect(speed=0.39, unmitigated=0.3, difference=0.09, standard_error=0.01, runs=20).is_harder
        True
    """

    speed: float
    unmitigated: float
    difference: float
    standard_error: float
    runs: int

    @property
    def is_harder(self) -> bool:
        """Whether contact is harder with mitigation, by more than two standard errors and rounding."""
        return self.difference > self._chance

    @property
    def is_softer(self) -> bool:
        """Whether contact is softer with mitigation, by more than two standard errors and rounding."""
        return -self.difference > self._chance

    def to_dict(self) -> dict[str, Any]:
        """Return the effect as one JSON object, in SI."""
        return {**asdict(self), "is_harder": self.is_harder}

    @property
    def _chance(self) -> float:
        chance = _ERRORS * self.standard_error if math.isfinite(self.standard_error) else 0.0
        return max(chance, _ROUNDING * self.unmitigated)


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


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityCheck(Value):
    """How far the loop is from oscillating, linearized at each distance that the encounter passes.

    Args:
        limit: the strongest stable gain at each distance.
        margin: how many times the gain can grow until the loop is unstable; below 1 it is.
        rate: readings per second of the loop [Hz].
        lowest_rate: the rate of the sensor from which on the gain is stable at every rate [Hz]; infinite where none is
            high enough. It can be above `rate` with a margin above 1: then rates between the two are unstable.
        lowest_rate_with_margin: the rate from which on the gain could double [Hz]; infinite where none is high enough.
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

    def to_dict(self) -> dict[str, Any]:
        """Return the check as one JSON object, in SI."""
        own = (
            "margin",
            "strongest",
            "critical_distance",
            "frequency",
            "rate",
            "lowest_rate",
            "lowest_rate_with_margin",
        )
        return {**{name: getattr(self, name) for name in own}, "distance": self.limit.distance, "gain": self.limit.gain}
