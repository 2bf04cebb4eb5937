"""Simulate one encounter and compare it with the prediction.

The simulation runs the sampled control loop.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.values import Value
from pretouch.designs.impact import ImpactModel
from pretouch.motion import ContactResult, ContactStatus, ContinuousLaw, Motion, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, LoopTrace, SimulationResult

from .effect import is_harder
from .encounter_parts import (
    Detection,
    LoopContact,
    QuantityComparison,
    ReportedFlag,
    compare_contacts,
    contacts_of,
    detection_of,
    flags_of,
    headline_of,
    run_as_dict,
)
from .run_warnings import (
    contacts_in_words,
    flags_of_run,
    force_in_words,
    harm_in_words,
    idleness_in_words,
    instability_in_words,
    late_detection,
    missing_readings,
    never_detected,
    push_in_words,
)

_SAMPLES: Final = 400
_PUSH: Final = 1.05  # a force above this multiple of the impact force is attributed to a push after the impact


@dataclass(frozen=True, kw_only=True, repr=False)
class SimulatedEncounter(Described, Value):
    """Result of `simulate`: one encounter, simulated and predicted.

    Both have results with and without impact mitigation. Comparisons are computed when they are first read.

    Args:
        scenario: the encounter.
        sensor: the sensor curve.
        loop: the sampled loop.
        law: the law in continuous time.
        gain: the law's number, such as D_p [N s].
        impact: the physical properties, or None.
        method: method of the prediction, as in `find_contact`.
        horizon: the longest predicted time until contact [s].
        run: the run on the loop with the gain.
        unmitigated: the run on the loop with gain 0 and the same noise.
        prediction: the continuous solution with the gain.
        unmitigated_prediction: the continuous solution with gain 0.
    """

    scenario: Scenario
    sensor: SensorModel
    loop: ClosedLoop
    law: ContinuousLaw
    gain: float
    impact: ImpactModel | None
    method: str
    horizon: float
    run: SimulationResult
    unmitigated: SimulationResult
    prediction: ContactResult
    unmitigated_prediction: ContactResult

    @cached_property
    def trace(self) -> LoopTrace:
        """Time series of the simulated run with the gain."""
        return self.run.trace()

    @cached_property
    def unmitigated_trace(self) -> LoopTrace:
        """Time series of the simulated run without mitigation."""
        return self.unmitigated.trace()

    @cached_property
    def motion(self) -> Motion:
        """The predicted motion with the gain.

        It ends at contact, or at the end of the simulated run.
        """
        return self._motion(self.gain, self.prediction, self.run)

    @cached_property
    def unmitigated_motion(self) -> Motion:
        """The predicted motion without mitigation.

        It ends at contact, or at the end of the simulated run.
        """
        return self._motion(0.0, self.unmitigated_prediction, self.unmitigated)

    def _motion(self, gain: float, prediction: ContactResult, run: SimulationResult) -> Motion:
        horizon = self.horizon if prediction.reached.all() else min(self.horizon, run.end_time)
        how: dict[str, Any] = {"method": self.method, "horizon": horizon, "samples": _SAMPLES}
        return self.law.motion(self.scenario, self.sensor, gain, **how)

    @property
    def has_contact_force(self) -> bool:
        """True if the loop has a contact model.

        A simulated run then continues after the first touch.
        """
        return self.loop.contact is not None

    @cached_property
    def comparisons(self) -> tuple[QuantityComparison, ...]:
        """Simulated and predicted contact quantities, with and without impact mitigation."""
        runs, predictions = (self.run, self.unmitigated), (self.prediction, self.unmitigated_prediction)
        return compare_contacts(runs, predictions, self.impact, self.has_contact_force)

    def comparison(self, name: str) -> QuantityComparison:
        """Return the comparison of one quantity, such as `relative_velocity`."""
        for found in self.comparisons:
            if found.name == name:
                return found
        names = ", ".join(c.name for c in self.comparisons)
        raise InvalidInputError(f"name: found {name!r}, expected one of {names}", value=name)

    @cached_property
    def contacts(self) -> tuple[LoopContact, ...]:
        """Contacts in the run with the gain.

        Repeated contacts are included, in chronological order.
        """
        return contacts_of(self.run, self.has_contact_force)

    @cached_property
    def unmitigated_contacts(self) -> tuple[LoopContact, ...]:
        """The contacts of the run without mitigation, in chronological order."""
        return contacts_of(self.unmitigated, self.has_contact_force)

    @cached_property
    def flags(self) -> tuple[ReportedFlag, ...]:
        """Status flags of the controller in the run with the gain.

        They are in chronological order.
        """
        return flags_of(self.trace, self.loop.law.period, self.run.time)

    @cached_property
    def detection(self) -> Detection | None:
        """First detection of the object by the controller.

        None if the object was not detected.
        """
        return detection_of(self.run, self.trace, self.sensor, self.scenario)

    @cached_property
    def headline(self) -> str:
        """A summary of the simulated contact in words.

        It compares the contact with the prediction and with the unmitigated contact.
        """
        compared = self.comparison("relative_velocity"), self.comparison("time")
        grows = self.grows_after_impact if self.has_contact_force else None
        return headline_of(self.run, self.unmitigated, self.prediction, compared, grows)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the simulated encounter, most important first."""
        both = self.law.number, self.gain, self.run, self.unmitigated
        return (
            *harm_in_words(*both),
            *self.loop.start_warnings(self.scenario, self.sensor, self._predict),
            *instability_in_words(self.loop, self.law, self.sensor, self.scenario, self.gain),
            *never_detected(self.loop, self.run),
            *self._late_detection(),
            *flags_of_run(self.flags),
            *missing_readings(self.run),
            *contacts_in_words(self.run.contacts, self.contacts),
            *push_in_words(self.loop, self.run, self.unmitigated),
            *force_in_words(self.comparison("largest_virtual_force")),
            *idleness_in_words(*both),
        )

    def _late_detection(self) -> Iterator[str]:
        """Yield a warning if the object is detected late."""
        found, at = self.detection, self.loop.detection(self.scenario, self.sensor)
        if found is not None and found.missed_share is not None:
            where = (np.array([value]) for value in (found.start_distance, found.distance, found.time))
            floor = at is not None and at.is_late
            yield from late_detection(self.loop, self.sensor, *where, is_floor_late=floor)

    def _predict(self, scenario: Scenario) -> ContactResult:
        return self.law.contact(scenario, self.sensor, self.gain, method=self.method, horizon=self.horizon)

    @property
    def is_mitigated(self) -> bool:
        """True if contact occurs and is no harder than without mitigation."""
        return bool(self.run.touched) and not is_harder(self.run, self.unmitigated)

    @property
    def grows_after_impact(self) -> bool:
        """True if the contact force grows after the impact.

        A push or a later contact then has a larger force than the impact itself.
        """
        run = self.run
        return bool(self.has_contact_force and run.touched and run.peak_force > _PUSH * run.impact_force)

    def to_dict(self) -> dict[str, Any]:
        """Return the encounter as one JSON object in SI units.

        Time series are not included.
        """
        loop = self.loop
        fields: dict[str, Any] = plain(
            {
                "status": ContactStatus(self.run.status).label,
                "headline": self.headline,
                "gain": self.gain,
                "method": self.prediction.method,
                "loop": run_as_dict(self.run),
                "loop_no_mitigation": run_as_dict(self.unmitigated),
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
                    **{name: getattr(loop, name) for name in ("seed", "horizon", "follow_time")},
                },
                "warnings": self.warnings,
            }
        )
        return fields

    def __repr__(self) -> str:
        return f"<SimulatedEncounter: {self.headline}>"


def _part_as_dict(part: object) -> dict[str, Any]:
    """Return model name and parameters of a loop component."""
    return {"model": type(part).__name__, **(plain(part) if is_dataclass(part) else {})}
