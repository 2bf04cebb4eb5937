"""What a run of the loop is asked, and in words: numbers beside the predicted ones, contacts, flags, what it saw."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import finite_or_none
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.control import Status
from pretouch.design.impact import ImpactModel
from pretouch.motion import ContactResult, ContactStatus, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import LoopTrace, SimulationResult

_SAME: Final = 5e-5  # relative: what four digits do not tell apart
_LATE: Final = 0.1  # of the change of ln xi until contact, from which a detection is called late
_PASSING: Final = 0.01  # of the approach: readings that are late for less are no news
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
    """One quantity of an encounter, on the loop and as predicted, with the gain and without; None where it has none."""

    name: str  # as SimulationResult and ContactState call it
    label: str  # words for it
    unit: str  # its SI unit
    loop: float | None  # on the loop with the gain
    predicted: float | None  # by the continuous solution with the gain
    loop_unmitigated: float | None  # on the loop with gain 0
    predicted_unmitigated: float | None  # by the continuous solution with gain 0

    @property
    def values(self) -> tuple[float | None, ...]:
        """The four numbers: loop and prediction with the gain, then both without."""
        return self.loop, self.predicted, self.loop_unmitigated, self.predicted_unmitigated

    @property
    def is_empty(self) -> bool:
        """Whether none of the four is there."""
        return all(value is None for value in self.values)

    @property
    def difference(self) -> float | None:
        """The number of the loop less the predicted one, in SI."""
        return None if self.loop is None or self.predicted is None else self.loop - self.predicted

    @property
    def relative_difference(self) -> float | None:
        """By what share the magnitude on the loop exceeds the predicted one; None beside nothing."""
        if self.loop is None or not self.predicted:
            return None
        return abs(self.loop) / abs(self.predicted) - 1

    @property
    def difference_in_words(self) -> str:
        """The difference in the unit of the quantity, and as a share of its magnitude; empty where it is not known."""
        share = self.relative_difference
        if self.difference is None:
            return ""
        if not self.difference or (share is not None and abs(share) < _SAME):
            return "none"
        text = format_quantity(self.difference, self.unit, 3)
        text = text if text.startswith("-") else f"+{text}"
        return text if share is None else f"{text} ({'+' if share > 0 else '-'}{percent(share)})"

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as one JSON object, in SI."""
        return {**asdict(self), "difference": self.difference, "relative_difference": self.relative_difference}


@dataclass(frozen=True, slots=True)
class LoopContact(Value):
    """One contact of a run; None for what a run without a contact model does not tell."""

    time: float  # of the touch [s]
    relative_velocity: float  # l' there [m/s]
    peak_force: float | None  # largest contact force [N]
    impulse: float | None  # of the contact force [N s]
    rebound_velocity: float | None  # l' at its end [m/s]; None where the bodies still touch when the run ends
    duration: float | None  # how long it lasts, or has lasted when the run ends [s]


@dataclass(frozen=True, slots=True)
class ReportedFlag(Value):
    """A flag that the law reported in a run."""

    name: str  # such as `force-limited`
    meaning: str  # what it says
    since: float  # when it was reported first [s]
    duration: float  # for how long in all [s], in whole periods of the law
    approach_duration: float  # for how long of that before the first contact [s]

    @property
    def is_trouble(self) -> bool:
        """Whether it speaks of readings, forces or motions that are not what they should be."""
        return self.meaning not in _NO_TROUBLE


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection(Value):
    """When the law first saw the object. The prediction lets it act from the start on."""

    time: float  # when the law first reported an object [s]
    distance: float  # how far it was then [m]
    start_distance: float  # how far it was at the start [m]
    # of the change of ln xi from the start to contact, what had passed by then, 0 to 1: what the law cannot have
    # answered; None where the curve does not change
    missed_share: float | None
    time_left: float | None  # from then until contact [s]; None without contact

    @property
    def sentence(self) -> str:
        """When and how far away the law first saw the object, in one sentence."""
        if self.time == 0:
            return f"The law saw the object from the start, at {format_quantity(self.distance, 'm')}."
        text = f"The law first saw the object after {format_quantity(self.time, 's', 3)}, at "
        text += f"{format_quantity(self.distance, 'm')} of {format_quantity(self.start_distance, 'm')}"
        if self.missed_share is not None:
            text += f"; {100 * self.missed_share:.2g} % of the change of ln xi until contact had passed by then"
        return f"{text}."


_MEANINGS: Final[dict[Status, str]] = {
    Status.DETECTING: "an object is seen",
    Status.STALE: "a reading was due, and none came that can be used",
    Status.SATURATED: "readings of a saturated sensor, not used",
    Status.INVALID: "readings that are no finite number, too late or out of order, not used",
    Status.IMPLAUSIBLE: "readings that changed faster than any approach, not used",
    Status.LOST: "no usable reading for longer than the timeout",
    Status.FORCE_LIMITED: "the virtual force was cut off at its limit",
    Status.MOTION_LIMITED: "excursion, speed or acceleration were held at a limit",
    Status.IN_CONTACT: "the contact force exceeds its threshold",
    Status.INPUT_FAULT: "contact force or reference were no finite numbers",
}
_OWN: Final = "a flag of the law's own"
_NO_TROUBLE: Final = frozenset({_MEANINGS[Status.DETECTING], _MEANINGS[Status.IN_CONTACT], _OWN})


def percent(share: float) -> str:
    """Return the size of a share in percent, in two digits or whole ones."""
    size = abs(100 * share)
    return f"{size:.0f} %" if size >= 99.5 else f"{size:.2g} %"


def compare_contacts(
    runs: tuple[SimulationResult, SimulationResult],
    predictions: tuple[ContactResult | None, ContactResult | None],
    impact: ImpactModel | None,
    has_force: bool,
) -> tuple[QuantityComparison, ...]:
    """Return the numbers of runs and predictions side by side, with the gain and without, of a contact with a force."""
    ends = [None if p is None or not p.reached.all() else p.end for p in predictions]

    def row(name: str, loop: Iterable[float], predicted: Iterable[float]) -> QuantityComparison:
        (own, free), (foreseen, foreseen_free) = map(finite_or_none, loop), map(finite_or_none, predicted)
        return QuantityComparison(name, words_for(name), unit_of(name), own, foreseen, free, foreseen_free)

    def solved(name: str) -> QuantityComparison:
        predicted = (math.nan if end is None else getattr(end, name) for end in ends)
        return row(name, (getattr(r, name) for r in runs), predicted)

    def of_contact(name: str) -> QuantityComparison:
        known = impact if name == "impact_force" else None  # an elastic impact is predicted
        elastic = (math.nan if known is None or e is None else known.peak_force(e.relative_velocity) for e in ends)
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
    """Read the contacts of a single run, of which it tells 32 apart."""
    found = []
    for row in run.contact_list[~np.isnan(run.contact_list[:, 0])]:
        time, velocity, *rest = map(finite_or_none, row)
        found.append(LoopContact(time or 0.0, velocity or 0.0, *(rest if has_force else (None,) * 4)))
    return tuple(found)


def flags_of(trace: LoopTrace, period: float, contact_time: float) -> tuple[ReportedFlag, ...]:
    """Return the flags that a law of a period [s] reported, before and after the contact [s, or NaN], as they came."""
    flags = trace.flags.astype(np.int64)
    before = ~(trace.time >= contact_time)
    found = []
    for bit in (1 << k for k in range(int(np.bitwise_or.reduce(flags)).bit_length())):
        on = (flags & bit) != 0
        if not on.any():
            continue
        known = Status(bit) if bit in _MEANINGS else None  # one that `Status` does not know goes by its number
        name = f"flag-{bit}" if known is None else str(known.name).lower().replace("_", "-")
        meaning = _OWN if known is None else _MEANINGS[known]
        since, lasts = float(trace.time[on.argmax()]), (float(part.sum() * period) for part in (on, on & before))
        found.append(ReportedFlag(name, meaning, since, *lasts))
    return tuple(sorted(found, key=lambda flag: flag.since))


def detection_of(run: SimulationResult, trace: LoopTrace, sensor: SensorModel, scenario: Scenario) -> Detection | None:
    """Tell when and how far away the law first saw the object; None where it never did."""
    if math.isnan(run.detection_time):
        return None
    distance = float(trace.distance[int(np.abs(trace.time - run.detection_time).argmin())])
    low, high = sensor.valid_range
    inside = (min(max(d, low), high) for d in (float(scenario.distance), distance, 0.0))
    start, seen, touch = (float(sensor.log_output(d)) for d in inside)
    whole = touch - start
    return Detection(
        time=run.detection_time,
        distance=distance,
        start_distance=float(scenario.distance),
        missed_share=min(max((seen - start) / whole, 0.0), 1.0) if whole else None,
        time_left=run.time - run.detection_time if run.touched else None,
    )


def run_as_dict(run: SimulationResult) -> dict[str, Any]:
    """Return the numbers of a run, in SI, and how it ended."""
    return {"status": ContactStatus(run.status).label, **{name: getattr(run, name) for name in _RUN}}


def headline_of(
    run: SimulationResult,
    free: SimulationResult,
    predicted: ContactResult | None,
    compared: tuple[QuantityComparison, QuantityComparison],
    grows: bool | None,
) -> str:
    """Say what a run came to beside its prediction, by speed and time, and beside that without mitigation."""
    text = _loop_clause(run)
    if predicted is None:
        text += "; not predicted, since the obstacle has a course"
    elif predicted.reached.all():
        text += f"; predicted {_speed(predicted.end.relative_velocity)} after {_time(predicted.end.time)}"
        text += f" ({_against(*compared)})" if run.touched else ""
    else:
        nearest = format_quantity(float(predicted.closest_distance), "m", 3)
        text += f"; predicted: {ending_in_words(predicted.status)}, {nearest} at the nearest"
    text += f"; without mitigation {_speed(free.relative_velocity) if free.touched else 'no contact'}."
    # the contact force may grow after the impact; None where there is none
    return text + (_force_sentence(run, free, grows) if grows is not None and run.touched else "")


def _loop_clause(run: SimulationResult) -> str:
    if run.touched:
        return f"Contact on the loop at {_speed(run.relative_velocity)} after {_time(run.time)}"
    if run.status == ContactStatus.UNRESOLVED:
        return f"The loop runs away: its numbers leave all bounds after {_time(run.end_time)}"
    nearest = format_quantity(run.closest_distance, "m", 3)
    return f"No contact on the loop within {_time(run.end_time)}, {nearest} at the nearest"


def _against(speed: QuantityComparison, time: QuantityComparison) -> str:
    """Say how much harder and earlier the contact is than predicted."""
    share, late = speed.relative_difference, time.difference
    parts = []
    if share is not None:
        parts.append("as hard" if abs(share) < _SAME else f"{percent(share)} {'harder' if share > 0 else 'softer'}")
    if late is not None and time.predicted is not None:
        same = abs(late) < _SAME * time.predicted
        shown = format_quantity(abs(late), "s", 2 if abs(late) < 0.1 else 3)
        parts.append("at the same time" if same else f"{shown} {'later' if late > 0 else 'earlier'}")
    return ", ".join(parts)


def _force_sentence(run: SimulationResult, free: SimulationResult, grows: bool) -> str:
    """Say what the contact force comes to, which may grow after the impact, beside that without mitigation."""
    text = f" Impact force {_force(run.impact_force)}"
    text += f" instead of {_force(free.impact_force)} without mitigation" if free.touched else ""
    text += f", later up to {_force(run.peak_force)}" if grows else ""
    return text + (f", {run.contacts} contacts." if run.contacts > 1 else ".")


def cautions_in_words(
    run: SimulationResult,
    seen: Detection | None,
    flags: tuple[ReportedFlag, ...],
    contacts: tuple[LoopContact, ...],
    grows: bool,
) -> Iterator[str]:
    """Yield what a user should read beside the numbers of a run, in order of weight."""
    if seen is None:
        yield "The law never saw the object, so it made no force: look at its floor, its offset and the sensor's range."
    elif seen.missed_share is not None and seen.missed_share > _LATE:
        yield (
            f"Late detection: {seen.sentence[0].lower()}{seen.sentence[1:]} A prediction lets the law act from "
            f"{format_quantity(seen.start_distance, 'm')} on."
        )
    approach = run.time if run.touched else run.end_time
    for flag in flags:
        if flag.is_trouble and flag.approach_duration > (_PASSING * approach if flag.name == "stale" else 0.0):
            yield (
                f"During the approach the law reported {flag.name} ({flag.meaning}): from {_time(flag.since)} on, for "
                f"{_time(flag.approach_duration)} in all."
            )
    if run.contacts > 1:
        hardest = max(contacts, key=lambda contact: -contact.relative_velocity)
        which = f"the one after {_time(hardest.time)}, at {_speed(hardest.relative_velocity)},"
        which = "the first" if hardest is contacts[0] else which
        told = len(contacts)
        beyond = f"; the first {told} are told apart" if run.contacts > told else ""
        yield f"The bodies meet {run.contacts} times; {which} is the fastest{beyond}."
    if grows:
        yield (
            f"After the impact the contact force grows to {_force(run.peak_force)}: a push or another contact, not the "
            "first impact, is the strongest."
        )


def ending_in_words(status: Any) -> str:
    """Return how a run or a prediction ended, as `never in contact`."""
    return ContactStatus(status).label.replace("-", " ")


def _speed(velocity: float) -> str:
    return format_quantity(abs(float(velocity)), "m/s", 3)


def _time(seconds: float) -> str:
    return format_quantity(float(seconds), "s", 3)


def _force(newton: float) -> str:
    return format_quantity(newton, "N", 3 if newton < 1000 else 4)
