"""What is said of a simulated encounter: its sentence, its warnings, and how its numbers are written."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.units import format_quantity
from pretouch.motion import ContactStatus

from .encounter_comparison import LoopContact, QuantityComparison

if TYPE_CHECKING:
    from .encounter import SimulatedEncounter

__all__ = [
    "contact_end_in_words",
    "detection_in_words",
    "difference_in_words",
    "encounter_headline",
    "encounter_warnings",
    "ending_in_words",
    "time_in_words",
]

_LATE: Final = 0.1  # of the change of ln xi until contact, from which a detection is called late
_PUSH: Final = 1.05  # times the impact force, from which a push that follows is another thing
_SAME: Final = 5e-5  # relative: what four digits do not tell apart
_PASSING: Final = 0.01  # of the approach: readings that are late for less are no news
_NONE: Final = "-"


def encounter_headline(encounter: SimulatedEncounter) -> str:
    """Return what the run came to beside the prediction, in one sentence or two."""
    run, predicted = encounter.run, encounter.prediction
    text = _loop_clause(encounter)
    if predicted.reached.all():
        text += f"; predicted {_speed(predicted.end.relative_velocity)} after {time_in_words(predicted.end.time)}"
        text += f" ({_against(encounter)})" if run.touched else ""
    else:
        nearest = format_quantity(float(predicted.closest_distance), "m", 3)
        text += f"; predicted: {ending_in_words(predicted.status)}, {nearest} at the nearest"
    free = encounter.unmitigated
    text += "; without mitigation "
    text += f"{_speed(free.relative_velocity)}." if free.touched else "no contact."
    return text + _force_sentence(encounter)


def _loop_clause(encounter: SimulatedEncounter) -> str:
    run = encounter.run
    if run.touched:
        return f"Contact on the loop at {_speed(run.relative_velocity)} after {time_in_words(run.time)}"
    if run.status == ContactStatus.UNRESOLVED:
        return f"The loop runs away: its numbers leave all bounds after {time_in_words(run.end_time)}"
    nearest = format_quantity(run.closest_distance, "m", 3)
    return f"No contact on the loop within {format_quantity(run.end_time, 's', 3)}, {nearest} at the nearest"


def _against(encounter: SimulatedEncounter) -> str:
    """Say how much harder and earlier the contact is than predicted."""
    speed, time = encounter.comparison("relative_velocity"), encounter.comparison("time")
    share, late = speed.relative_difference, time.difference
    parts = []
    if share is not None:
        parts.append("as hard" if abs(share) < _SAME else f"{_percent(share)} {'harder' if share > 0 else 'softer'}")
    if late is not None and time.predicted is not None:
        same = abs(late) < _SAME * time.predicted
        shown = format_quantity(abs(late), "s", 2 if abs(late) < 0.1 else 3)
        parts.append("at the same time" if same else f"{shown} {'later' if late > 0 else 'earlier'}")
    return ", ".join(parts)


def _force_sentence(encounter: SimulatedEncounter) -> str:
    run, free = encounter.run, encounter.unmitigated
    if not (encounter.has_contact_force and run.touched):
        return ""
    text = f" Impact force {_force(run.impact_force)}"
    if free.touched:
        text += f" instead of {_force(free.impact_force)} without mitigation"
    if _grows_after_impact(encounter):
        text += f", later up to {_force(run.peak_force)}"
    return text + (f", {run.contacts} contacts." if run.contacts > 1 else ".")


def _grows_after_impact(encounter: SimulatedEncounter) -> bool:
    run = encounter.run
    return bool(encounter.has_contact_force and run.touched and run.peak_force > _PUSH * run.impact_force)


def _force(newton: float) -> str:
    return format_quantity(newton, "N", 3 if newton < 1000 else 4)


def encounter_warnings(encounter: SimulatedEncounter) -> Iterator[str]:
    """Yield what should be read beside the numbers, in order of weight."""
    run, seen = encounter.run, encounter.detection
    if seen is None:
        yield "The law never saw the object, so it made no force: look at its floor, its offset and the sensor's range."
    elif seen.missed_share is not None and seen.missed_share > _LATE:
        yield (
            f"Late detection: {detection_in_words(encounter)} The prediction lets the law act from "
            f"{format_quantity(seen.start_distance, 'm')} on."
        )
    approach = run.time if run.touched else run.end_time
    for flag in encounter.flags:
        if flag.is_trouble and flag.approach_duration > (_PASSING * approach if flag.name == "stale" else 0.0):
            yield (
                f"During the approach the law reported {flag.name} ({flag.meaning}): from "
                f"{time_in_words(flag.since)} on, for {time_in_words(flag.approach_duration)} in all."
            )
    if run.contacts > 1:
        hardest = max(encounter.contacts, key=lambda contact: -contact.relative_velocity)
        which = f"the one after {time_in_words(hardest.time)}, at {_speed(hardest.relative_velocity)},"
        which = "the first" if hardest is encounter.contacts[0] else which
        told = len(encounter.contacts)
        beyond = f"; the first {told} are told apart" if run.contacts > told else ""
        yield f"The bodies meet {run.contacts} times; {which} is the fastest{beyond}."
    if _grows_after_impact(encounter):
        yield (
            f"After the impact the contact force grows to {_force(run.peak_force)}: a push or another "
            "contact, not the first impact, is the strongest."
        )


def detection_in_words(encounter: SimulatedEncounter) -> str:
    """Say when and how far away the law first saw the object, in one sentence."""
    seen = encounter.detection
    if seen is None:
        return "The law never saw the object."
    if seen.time == 0:
        return f"the law saw the object from the start, at {format_quantity(seen.distance, 'm')}."
    text = (
        f"the law first saw the object after {time_in_words(seen.time)}, at {format_quantity(seen.distance, 'm')} of "
    )
    text += f"{format_quantity(seen.start_distance, 'm')}"
    if seen.missed_share is not None:
        text += f"; {100 * seen.missed_share:.2g} % of the change of ln xi until contact had passed by then"
    return text + "."


def ending_in_words(status: Any) -> str:
    """Say how a run or a prediction ended, as `never in contact`."""
    return ContactStatus(status).label.replace("-", " ")


def contact_end_in_words(contact: LoopContact) -> str:
    """Say at which relative velocity a contact ends, or that it lasts."""
    if contact.rebound_velocity is None:
        return "in contact at the end" if contact.duration is not None else _NONE
    return format_quantity(contact.rebound_velocity, "m/s")


def difference_in_words(row: QuantityComparison) -> str:
    """Write the difference of loop and prediction, in the unit of the quantity and as a share of its magnitude."""
    share = row.relative_difference
    if row.difference is None:
        return _NONE
    if not row.difference or (share is not None and abs(share) < _SAME):
        return "none"
    text = format_quantity(row.difference, row.unit, 3)
    text = text if text.startswith("-") else f"+{text}"
    return text if share is None else f"{text} ({_signed(share)})"


def _speed(velocity: float) -> str:
    return format_quantity(abs(float(velocity)), "m/s", 3)


def time_in_words(seconds: float) -> str:
    """Write a time in three digits."""
    return format_quantity(float(seconds), "s", 3)


def _percent(share: float) -> str:
    size = abs(100 * share)
    return f"{size:.0f} %" if size >= 99.5 else f"{size:.2g} %"


def _signed(share: float) -> str:
    return f"{'+' if share > 0 else '-'}{_percent(share)}"
