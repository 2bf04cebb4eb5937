"""One run of the sampled loop beside what was predicted for it, and beside the same run without mitigation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from functools import cached_property
from typing import Any, ClassVar, Final

from pretouch._core.described import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.json_text import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.design.impact import ImpactModel
from pretouch.motion import ContactResult, ContactStatus, Motion, Scenario, solve_motion
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, LoopTrace, SimulationResult

from .encounter_parts import (
    SAME,
    Detection,
    LoopContact,
    QuantityComparison,
    ReportedFlag,
    compare_contacts,
    contacts_of,
    detection_of,
    flags_of,
    percent,
)

__all__ = ["SimulatedEncounter", "ending_in_words"]

_SAMPLES: Final = 400
_LATE: Final = 0.1  # of the change of ln xi until contact, from which a detection is called late
_PUSH: Final = 1.05  # times the impact force, from which a push that follows is another thing
_PASSING: Final = 0.01  # of the approach: readings that are late for less are no news
_RUN: Final = (
    *("time", "position", "velocity", "displacement", "relative_velocity", "closest_distance", "largest_excursion"),
    *("largest_travel", "largest_speed", "largest_virtual_force", "peak_force", "impact_force", "impulse"),
    *("rebound_velocity", "detection_time", "end_time", "contacts", "flags"),
)


@dataclass(frozen=True, kw_only=True, repr=False)
class SimulatedEncounter(Described, Value):
    """What `simulate_encounter` returns: the runs and predictions at once, what they come to when it is first read.

    Args:
        scenario: the encounter.
        sensor: the sensor curve.
        loop: the loop that it was run on.
        gain: D_p [N s].
        impact: the physical properties, where given.
        method: by which the encounter was predicted, as `find_contact` takes it.
        horizon: how long the prediction waits for contact [s].
        run: on the loop with the gain.
        unmitigated: on the loop with gain 0, and with the same noise.
        prediction: by the continuous solution with the gain.
        unmitigated_prediction: by the continuous solution with gain 0.
    """

    scenario: Scenario
    sensor: SensorModel
    loop: ClosedLoop
    gain: float
    impact: ImpactModel | None
    method: str
    horizon: float
    run: SimulationResult
    unmitigated: SimulationResult
    prediction: ContactResult
    unmitigated_prediction: ContactResult

    page: ClassVar[str] = "pretouch.verification.encounter_page:encounter_page"

    @cached_property
    def trace(self) -> LoopTrace:
        """The course of the run with the gain."""
        return self.run.trace()

    @cached_property
    def unmitigated_trace(self) -> LoopTrace:
        """The course of the run with gain 0."""
        return self.unmitigated.trace()

    @cached_property
    def motion(self) -> Motion:
        """The predicted motion with the gain, until contact, or for as long as the run where there is none."""
        return self._motion(self.gain, self.prediction, self.run)

    @cached_property
    def unmitigated_motion(self) -> Motion:
        """The predicted motion with gain 0, until contact, or for as long as the run where there is none."""
        return self._motion(0.0, self.unmitigated_prediction, self.unmitigated)

    def _motion(self, gain: float, prediction: ContactResult, run: SimulationResult) -> Motion:
        horizon = self.horizon if prediction.reached.all() else min(self.horizon, run.end_time)
        return solve_motion(self.scenario, self.sensor, gain, method=self.method, horizon=horizon, samples=_SAMPLES)

    @property
    def has_contact_force(self) -> bool:
        """Whether the loop has a contact model, and so goes on after the first touch."""
        return self.loop.contact is not None

    @cached_property
    def comparisons(self) -> tuple[QuantityComparison, ...]:
        """The quantities of the contact on the loop and as predicted, with the gain and without."""
        runs, predictions = (self.run, self.unmitigated), (self.prediction, self.unmitigated_prediction)
        return compare_contacts(runs, predictions, self.impact, self.has_contact_force)

    def comparison(self, name: str) -> QuantityComparison:
        """Return the comparison of one quantity.

        Args:
            name: such as `relative_velocity`.

        Returns:
            The comparison.

        Raises:
            InvalidInputError: that quantity is not compared.
        """
        for found in self.comparisons:
            if found.name == name:
                return found
        known = ", ".join(c.name for c in self.comparisons)
        raise InvalidInputError(f"name: found {name!r}, expected one of {known}")

    @cached_property
    def contacts(self) -> tuple[LoopContact, ...]:
        """The contacts of the run with the gain, a repeated contact one by one."""
        return contacts_of(self.run, self.has_contact_force)

    @cached_property
    def unmitigated_contacts(self) -> tuple[LoopContact, ...]:
        """The contacts of the run with gain 0."""
        return contacts_of(self.unmitigated, self.has_contact_force)

    @cached_property
    def flags(self) -> tuple[ReportedFlag, ...]:
        """What the law reported in the run with the gain, in the order in which it came."""
        return flags_of(self.trace, self.loop.law.period, self.run.time)

    @cached_property
    def detection(self) -> Detection | None:
        """When and how far away the law first saw the object; None where it never did."""
        return detection_of(self.run, self.trace, self.sensor, self.scenario)

    @cached_property
    def headline(self) -> str:
        """What the run came to beside the prediction, in one sentence or two."""
        predicted, free = self.prediction, self.unmitigated
        text = _loop_clause(self.run)
        if predicted.reached.all():
            text += f"; predicted {_speed(predicted.end.relative_velocity)} after {_time(predicted.end.time)}"
            text += f" ({_against(self)})" if self.run.touched else ""
        else:
            nearest = format_quantity(float(predicted.closest_distance), "m", 3)
            text += f"; predicted: {ending_in_words(predicted.status)}, {nearest} at the nearest"
        text += f"; without mitigation {_speed(free.relative_velocity) if free.touched else 'no contact'}."
        return text + _force_sentence(self)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that a user should read beside the numbers, in order of weight."""
        return tuple(_warnings(self))

    @property
    def grows_after_impact(self) -> bool:
        """Whether a push after the impact, or another contact, is stronger than the impact itself."""
        run = self.run
        return bool(self.has_contact_force and run.touched and run.peak_force > _PUSH * run.impact_force)

    def to_dict(self) -> dict[str, Any]:
        """Return the encounter as one JSON object: numbers in SI, None where there is none; without the traces."""
        loop = self.loop
        found: dict[str, Any] = plain(
            {
                "status": ContactStatus(self.run.status).label,
                "headline": self.headline,
                "gain": self.gain,
                "method": self.prediction.method,
                "loop": _run_as_dict(self.run),
                "loop_no_mitigation": _run_as_dict(self.unmitigated),
                "predicted": self.prediction,
                "predicted_no_mitigation": self.unmitigated_prediction,
                "comparisons": self.comparisons,
                "contacts": self.contacts,
                "contacts_no_mitigation": self.unmitigated_contacts,
                "flags": self.flags,
                "detection": self.detection,
                "setup": {
                    "law": type(loop.law).__name__,
                    "period": loop.law.period,
                    "chain": loop.chain,
                    "plant": _part_as_dict(loop.plant),
                    "contact": None if loop.contact is None else _part_as_dict(loop.contact),
                    **{name: getattr(loop, name) for name in ("seed", "horizon", "follow")},
                },
                "warnings": self.warnings,
            }
        )
        return found

    def __repr__(self) -> str:
        return f"<SimulatedEncounter: {self.headline}>"


def _run_as_dict(run: SimulationResult) -> dict[str, Any]:
    return {"status": ContactStatus(run.status).label, **{name: getattr(run, name) for name in _RUN}}


def _part_as_dict(part: object) -> dict[str, Any]:
    """Return the fields of a part of the loop; a class of a user's own may have none."""
    return {"model": type(part).__name__, **(plain(part) if is_dataclass(part) else {})}


def _loop_clause(run: SimulationResult) -> str:
    if run.touched:
        return f"Contact on the loop at {_speed(run.relative_velocity)} after {_time(run.time)}"
    if run.status == ContactStatus.UNRESOLVED:
        return f"The loop runs away: its numbers leave all bounds after {_time(run.end_time)}"
    nearest = format_quantity(run.closest_distance, "m", 3)
    return f"No contact on the loop within {_time(run.end_time)}, {nearest} at the nearest"


def _against(encounter: SimulatedEncounter) -> str:
    """Say how much harder and earlier the contact is than predicted."""
    speed, time = encounter.comparison("relative_velocity"), encounter.comparison("time")
    share, late = speed.relative_difference, time.difference
    parts = []
    if share is not None:
        parts.append("as hard" if abs(share) < SAME else f"{percent(share)} {'harder' if share > 0 else 'softer'}")
    if late is not None and time.predicted is not None:
        same = abs(late) < SAME * time.predicted
        shown = format_quantity(abs(late), "s", 2 if abs(late) < 0.1 else 3)
        parts.append("at the same time" if same else f"{shown} {'later' if late > 0 else 'earlier'}")
    return ", ".join(parts)


def _force_sentence(encounter: SimulatedEncounter) -> str:
    run, free = encounter.run, encounter.unmitigated
    if not (encounter.has_contact_force and run.touched):
        return ""
    text = f" Impact force {_force(run.impact_force)}"
    text += f" instead of {_force(free.impact_force)} without mitigation" if free.touched else ""
    text += f", later up to {_force(run.peak_force)}" if encounter.grows_after_impact else ""
    return text + (f", {run.contacts} contacts." if run.contacts > 1 else ".")


def _warnings(encounter: SimulatedEncounter) -> Iterator[str]:
    run, seen = encounter.run, encounter.detection
    if seen is None:
        yield "The law never saw the object, so it made no force: look at its floor, its offset and the sensor's range."
    elif seen.missed_share is not None and seen.missed_share > _LATE:
        yield (
            f"Late detection: {seen.sentence[0].lower()}{seen.sentence[1:]} The prediction lets the law act from "
            f"{format_quantity(seen.start_distance, 'm')} on."
        )
    approach = run.time if run.touched else run.end_time
    for flag in encounter.flags:
        if flag.is_trouble and flag.approach_duration > (_PASSING * approach if flag.name == "stale" else 0.0):
            yield (
                f"During the approach the law reported {flag.name} ({flag.meaning}): from {_time(flag.since)} on, for "
                f"{_time(flag.approach_duration)} in all."
            )
    if run.contacts > 1:
        hardest = max(encounter.contacts, key=lambda contact: -contact.relative_velocity)
        which = f"the one after {_time(hardest.time)}, at {_speed(hardest.relative_velocity)},"
        which = "the first" if hardest is encounter.contacts[0] else which
        told = len(encounter.contacts)
        beyond = f"; the first {told} are told apart" if run.contacts > told else ""
        yield f"The bodies meet {run.contacts} times; {which} is the fastest{beyond}."
    if encounter.grows_after_impact:
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
