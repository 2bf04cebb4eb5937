"""Summarize one simulated encounter of robot and object: contacts, time of detection and flags."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray, finite_or_none
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.control import Status
from pretouch.designs.impact import ImpactModel
from pretouch.motion import ContactResult, ContactStatus, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import LoopTrace, SimulationResult

from .effect import UNSEEN, higher_in_words, is_harder, percent

_AT_CONTACT: Final = ("time", "relative_velocity", "position")
_LARGEST: Final = ("largest_excursion", "largest_virtual_force")
_RUN: Final = (
    *("time", "position", "velocity", "displacement", "relative_velocity", "closest_distance", "largest_excursion"),
    *("largest_travel", "largest_speed", "largest_virtual_force", "peak_force", "impact_force", "impulse"),
    *("rebound_velocity", "detection_time", "end_time", "contacts", "flags"),
)
_OF_CONTACT: Final = ("impact_force", "peak_force", "impulse", "rebound_velocity")


@dataclass(frozen=True, slots=True)
class QuantityComparison(Value):
    """Simulated and predicted values of one quantity, with and without impact mitigation.

    Values are None if they are not available.
    """

    name: str  # its name in SimulationResult and ContactState
    label: str  # its name in words
    unit: str  # its SI unit
    loop: float | None  # value on the loop with the gain
    predicted: float | None  # value of the continuous solution with the gain
    loop_unmitigated: float | None  # value on the loop with gain 0
    predicted_unmitigated: float | None  # value of the continuous solution with gain 0

    @property
    def values(self) -> tuple[float | None, ...]:
        """The four compared values of a quantity.

        First the simulated and the predicted value with the gain, then both without mitigation.
        """
        return self.loop, self.predicted, self.loop_unmitigated, self.predicted_unmitigated

    @property
    def is_empty(self) -> bool:
        """True if none of the four compared values is available."""
        return all(value is None for value in self.values)

    @property
    def difference(self) -> float | None:
        """The simulated value minus the predicted value, in SI units."""
        return None if self.loop is None or self.predicted is None else self.loop - self.predicted

    @property
    def relative_difference(self) -> float | None:
        """Relative difference between simulated and predicted magnitude.

        None if one of the values is unknown, or if the prediction is 0.
        """
        if self.loop is None or not self.predicted:
            return None
        return abs(self.loop) / abs(self.predicted) - 1

    @property
    def difference_in_words(self) -> str:
        """Difference between simulation and prediction as text.

        The text has unit and percentage. It is empty if the difference is unknown.
        """
        share = self.relative_difference
        if self.difference is None:
            return ""
        if not self.difference or (share is not None and abs(share) < UNSEEN):
            return "none"
        text = format_quantity(self.difference, self.unit, 3)
        text = text if text.startswith("-") else f"+{text}"
        return text if share is None else f"{text} ({'+' if share > 0 else '-'}{percent(share)})"

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as one JSON object in SI units."""
        return {**asdict(self), "difference": self.difference, "relative_difference": self.relative_difference}


@dataclass(frozen=True, slots=True)
class LoopContact(Value):
    """One contact in a simulated run.

    Quantities that need a contact model are None without one.
    """

    time: float  # time of the touch [s]
    relative_velocity: float  # l' at the touch [m/s]
    peak_force: float | None  # largest contact force [N]
    impulse: float | None  # impulse of the contact force [N s]
    rebound_velocity: float | None  # l' at the end of the contact [m/s]; None if the run ends before
    duration: float | None  # duration of the contact, or until the end of the run [s]


@dataclass(frozen=True, slots=True)
class ReportedFlag(Value):
    """A status flag reported by the controller during a run."""

    name: str  # such as `force-limited`
    meaning: str  # its meaning in words
    since: float  # time of the first report [s]
    duration: float  # total duration [s], in whole controller periods
    approach_duration: float  # duration before the first contact [s]

    @property
    def has_meaning(self) -> bool:
        """True if the meaning of the flag is known."""
        return self.meaning != _OWN

    @property
    def status(self) -> Status | None:
        """The flag; None for a user-defined one."""
        return Status[self.name.upper().replace("-", "_")] if self.has_meaning else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection(Value):
    """Time and distance at which the controller first detected the object.

    The prediction assumes detection at the start.
    """

    time: float  # time of the first detection [s]
    distance: float  # distance at the first detection [m]
    start_distance: float  # distance at the start [m]
    # Share, 0 to 1, of the change of ln xi from start to contact that happened before detection, so that the controller
    # could not respond to it; None if the curve is flat.
    missed_share: float | None
    time_left: float | None  # time from detection to contact [s]; None without contact

    @property
    def sentence(self) -> str:
        """A sentence on the first detection of the object."""
        if self.time == 0:
            return f"The object was detected at the start, at {format_quantity(self.distance, 'm')}."
        text = f"The object was first detected after {format_quantity(self.time, 's', 3)}, at "
        text += f"{format_quantity(self.distance, 'm')} (start: {format_quantity(self.start_distance, 'm')})"
        if self.missed_share is None:
            return f"{text}."
        missed = f"{100 * self.missed_share:.2g} % of the change of the sensor signal ln xi"
        return (
            f"{text}. {missed} happened before detection. This part of the change had no effect on the virtual force."
        )


_OWN: Final = "a user-defined flag"


def compare_contacts(
    runs: tuple[SimulationResult, SimulationResult],
    predictions: tuple[ContactResult | None, ContactResult | None],
    impact: ImpactModel | None,
    has_force: bool,
) -> tuple[QuantityComparison, ...]:
    """Compare the simulated and predicted contact quantities, with and without impact mitigation."""
    ends = [None if p is None or not p.reached.all() else p.end for p in predictions]

    def row(name: str, loop: Iterable[float], predicted: Iterable[float]) -> QuantityComparison:
        (own, free), (foreseen, foreseen_free) = map(finite_or_none, loop), map(finite_or_none, predicted)
        return QuantityComparison(name, words_for(name), unit_of(name), own, foreseen, free, foreseen_free)

    def solved(name: str) -> QuantityComparison:
        predicted = (math.nan if end is None else getattr(end, name) for end in ends)
        return row(name, (getattr(r, name) for r in runs), predicted)

    def of_contact(name: str) -> QuantityComparison:
        model = impact if name == "impact_force" else None  # an elastic impact is predicted
        elastic = (math.nan if model is None or e is None else model.peak_force(e.relative_velocity) for e in ends)
        return row(name, (getattr(r, name) if r.touched else math.nan for r in runs), elastic)

    rows = [solved(name) for name in _AT_CONTACT]
    if not all(r.touched for r in runs) or any(p is not None and not p.reached.all() for p in predictions):
        nearest = (0.0 if r.touched else r.closest_distance for r in runs)
        rows.append(
            row("closest_distance", nearest, (math.nan if p is None else p.closest_distance for p in predictions))
        )
    rows += [solved(name) for name in _LARGEST]
    return (*rows, *(of_contact(name) for name in _OF_CONTACT if has_force))


def contacts_of(run: SimulationResult, has_force: bool) -> tuple[LoopContact, ...]:
    """Return the contacts of a single simulated run, at most 32 contacts."""
    contacts = []
    for row in run.contact_list[~np.isnan(run.contact_list[:, 0])]:
        time, velocity, *rest = map(finite_or_none, row)
        contacts.append(LoopContact(time or 0.0, velocity or 0.0, *(rest if has_force else (None,) * 4)))
    return tuple(contacts)


def flags_of(trace: LoopTrace, period: float, contact_time: float) -> tuple[ReportedFlag, ...]:
    """Return the status flags of a run in chronological order.

    `period` is the controller period [s]; `contact_time` may be NaN.
    """
    flags = trace.flags.astype(np.int64)
    before = ~(trace.time >= contact_time)
    sentences = []
    for bit in (1 << k for k in range(int(np.bitwise_or.reduce(flags)).bit_length())):
        on = (flags & bit) != 0
        if not on.any():
            continue
        status = (
            Status(bit) if bit in list(Status) else None
        )  # a flag that `Status` does not define is named by its number
        name = f"flag-{bit}" if status is None else str(status.name).lower().replace("_", "-")
        meaning = _OWN if status is None else status.meaning
        since, lasts = float(trace.time[on.argmax()]), (float(part.sum() * period) for part in (on, on & before))
        sentences.append(ReportedFlag(name, meaning, since, *lasts))
    return tuple(sorted(sentences, key=lambda flag: flag.since))


def detection_of(run: SimulationResult, trace: LoopTrace, sensor: SensorModel, scenario: Scenario) -> Detection | None:
    """Find the first detection of the object in a run.

    Returns:
        The detection; None if the object was not detected.
    """
    if math.isnan(run.detection_time):
        return None
    distance = float(trace.distance[int(np.abs(trace.time - run.detection_time).argmin())])
    missed = float(missed_share(sensor, np.float64(scenario.distance), np.float64(distance)))
    return Detection(
        time=run.detection_time,
        distance=distance,
        start_distance=float(scenario.distance),
        missed_share=finite_or_none(missed),
        time_left=run.time - run.detection_time if run.touched else None,
    )


def missed_share(sensor: SensorModel, start: Any, distance: Any) -> FloatArray:
    """Return the share of the change of ln xi from a start to contact that happens before a detection, 0 to 1.

    It is NaN for a flat curve.
    """
    low, high = sensor.valid_range
    first, detected, touch = (np.asarray(sensor.log_output(np.clip(d, low, high))) for d in (start, distance, 0.0))
    whole = touch - first
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(whole != 0, np.clip((detected - first) / whole, 0.0, 1.0), np.nan))


def run_as_dict(run: SimulationResult) -> dict[str, Any]:
    """Return the final quantities of a simulated run.

    The values are in SI units; `status` says how the run ended.
    """
    return {"status": ContactStatus(run.status).label, **{name: getattr(run, name) for name in _RUN}}


def headline_of(
    run: SimulationResult,
    free: SimulationResult,
    predicted: ContactResult,
    compared: tuple[QuantityComparison, QuantityComparison],
    grows: bool | None,
) -> str:
    """Return a summary of a simulated contact in words.

    The contact is compared with the prediction and with contact without mitigation.
    """
    text = _loop_clause(run, free)
    if predicted.reached.all():
        text += f"; predicted {_speed(predicted.end.relative_velocity)}"
        text += "" if run.touched else f" after {_time(predicted.end.time)}"
        # A comparison with a prediction that is harder, too, would reassure.
        text += f" ({_against(*compared)})" if run.touched and not is_harder(run, free) else ""
    else:
        nearest = format_quantity(float(predicted.closest_distance), "m", 3)
        text += f"; predicted: {ending_in_words(predicted.status)}, closest distance {nearest}"
    text += "." if is_harder(run, free) else f"; without mitigation {_speed_or_none(free)}."
    # `grows` is None without a contact model
    return text + (_force_sentence(run, free, grows) if grows is not None and run.touched else "")


def _loop_clause(run: SimulationResult, free: SimulationResult) -> str:
    if is_harder(run, free):
        speed = _speed(run.relative_velocity)
        return (
            f"Contact is harder than without mitigation: the contact speed on the simulated loop is {speed} "
            f"instead of {_speed_or_none(free)}"
        )
    if run.touched:
        return f"Contact on the loop at {_speed(run.relative_velocity)}"
    if run.status == ContactStatus.UNRESOLVED:
        return f"The simulated loop diverges: its values exceed all bounds after {_time(run.end_time)}"
    nearest = format_quantity(run.closest_distance, "m", 3)
    ended = f"The run on the simulated loop ends after {_time(run.end_time)} without contact"
    return f"{ended}; the smallest distance is {nearest}"


def _speed_or_none(run: SimulationResult) -> str:
    return _speed(run.relative_velocity) if run.touched else "no contact"


def _against(speed: QuantityComparison, time: QuantityComparison) -> str:
    """Compare contact speed and time with the prediction, as text."""
    share, late = speed.relative_difference, time.difference
    parts = []
    if share is not None:
        parts.append("the same speed" if abs(share) < UNSEEN else higher_in_words(share))
    if late is not None and time.predicted is not None:
        same = abs(late) < UNSEEN * time.predicted
        shown = format_quantity(abs(late), "s", 2 if abs(late) < 0.1 else 3)
        parts.append("the same time" if same else f"{shown} {'later' if late > 0 else 'earlier'}")
    return f"{' and '.join(parts)} on the loop"


def _force_sentence(run: SimulationResult, free: SimulationResult, grows: bool) -> str:
    """Return a sentence on the contact force with and without impact mitigation."""
    text = f" Impact force {_force(run.impact_force)}"
    text += f" instead of {_force(free.impact_force)} without mitigation" if free.touched else ""
    text += f", later up to {_force(run.peak_force)}" if grows else ""
    return text + (f", {run.contacts} contacts." if run.contacts > 1 else ".")


def ending_in_words(status: Any) -> str:
    """Describe how an encounter ended, such as `never in contact`."""
    return ContactStatus(status).words


def _speed(velocity: float) -> str:
    return format_quantity(abs(float(velocity)), "m/s", 3)


def _time(seconds: float) -> str:
    return format_quantity(float(seconds), "s", 3)


def _force(newton: float) -> str:
    return format_quantity(newton, "N", 3 if newton < 1000 else 4)
