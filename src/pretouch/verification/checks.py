"""Predicted beside simulated: each quantity, each limit, and which runs came to a contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.design import ImpactModel, Task, quantity_of
from pretouch.design.robust import Required
from pretouch.design.robust.design import limits_of
from pretouch.design.robust.validation import least_probability
from pretouch.motion import ContactResult
from pretouch.simulation import ClosedLoop, SimulationResult

from .appraisal import LoopOutcomes
from .request import foreseen_impact

__all__ = [
    "Comparison",
    "LimitCheck",
    "Reached",
    "RunSpread",
    "VerdictStatus",
    "check_limits",
    "check_reached",
    "compare_quantities",
]

_COMPARED: Final = ("relative_velocity", "time", "largest_excursion", "largest_virtual_force", "largest_speed")
_SAME: Final = 1e-9  # of a force: the peak of a contact is then that of its impact


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


def compare_quantities(
    task: Task,
    runs: tuple[SimulationResult, SimulationResult],
    foreseen: tuple[ContactResult, ContactResult],
) -> tuple[Comparison, ...]:
    """Return magnitudes of the runs beside those predicted for the nominal encounter, with the gain and D_p = 0."""
    contact, impact = task.loop.contact, foreseen_impact(task)
    names = [*_COMPARED, *(["impact_force"] if contact is not None else [])]
    if contact is not None and any(np.any(r.peak_force > (1 + _SAME) * r.impact_force) for r in runs):
        names.append("peak_force")
    found = []
    for name in names:
        told = name != "peak_force"
        predicted = [_magnitude(name, r, impact) if told else None for r in foreseen]
        simulated = [_spread_of(np.abs(np.asarray(getattr(r, name))), r.touched) for r in runs]
        found.append(
            Comparison(
                name=name,
                label=words_for(name),
                unit=unit_of(name),
                predicted=predicted[0],
                predicted_unmitigated=predicted[1],
                simulated=simulated[0],
                unmitigated=simulated[1],
            )
        )
    return tuple(found)


def _spread_of(values: FloatArray, counted: BoolArray) -> RunSpread | None:
    """Summarize a quantity over the runs that count; None where none does."""
    some = values[counted]
    if not len(some):
        return None
    low, median, high = (float(q) for q in np.quantile(some, [0.05, 0.5, 0.95]))
    error = float(np.std(some, ddof=1)) / math.sqrt(len(some)) if len(some) > 1 else math.nan
    return RunSpread(
        mean=float(some.mean()),
        standard_error=error,
        low=low,
        median=median,
        high=high,
        worst=float(some.max()),
        runs=len(some),
    )


def check_limits(task: Task, outcomes: LoopOutcomes, predicted: ContactResult, gain: float) -> tuple[LimitCheck, ...]:
    """Return how often each limit holds in the runs with a gain [N s], beside the nominal encounter as predicted."""
    found, impact = [], foreseen_impact(task)
    for required, ratio in zip(limits_of(task), outcomes.ratios, strict=True):
        constraint = required.constraint
        count = int((ratio <= 1 + 1e-12).sum())
        reached = float(required.share(ratio)) * constraint.limit
        value = reached if math.isfinite(reached) else None
        own = constraint.quantity == "gain"
        found.append(
            LimitCheck(
                required=required,
                predicted=abs(gain) if own else _magnitude(constraint.quantity, predicted, impact),
                held=count / len(ratio),
                low=least_probability(count, len(ratio), task.confidence),
                value=value,
                margin=None if value is None else constraint.limit - value,
                source=_source_of(constraint.quantity, task.loop),
            )
        )
    return tuple(found)


def _source_of(name: str, loop: ClosedLoop) -> str:
    """Say where a quantity of a run comes from, such as `simulated contact force`."""
    if name == "impact_force":
        return "impact model at the simulated speed of contact" if loop.contact is None else "simulated contact force"
    return "robot mass times largest simulated acceleration" if name == "drive_force" else "simulated"


def check_reached(result: SimulationResult, predicted: BoolArray, confidence: float) -> Reached:
    """Return which runs came to a contact beside those that do in continuous time, with a bound of some confidence."""
    expected, came = int(predicted.sum()), int(result.touched[predicted].sum())
    return Reached(
        predicted=float(predicted.mean()),
        simulated=float(result.touched.mean()),
        missing=expected - came,
        low=least_probability(came, expected, confidence) if expected else None,
    )


def _magnitude(name: str, result: ContactResult, impact: ImpactModel | None) -> float | None:
    if not result.reached.all():
        return None
    value: Any = quantity_of(name, result.end, impact)
    return abs(float(value)) if math.isfinite(float(value)) else None
