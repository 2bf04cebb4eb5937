"""Simulate one encounter and compare it with the prediction.

The simulation runs the sampled control loop.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass, replace
from functools import cached_property
from typing import Any, Final

from pretouch._core.blocks import (
    Cell,
    Film,
    Listing,
    Measured,
    Page,
    PageSection,
    PageTable,
    Paragraph,
    cell_as_text,
    named,
)
from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.vocabulary import words_for
from pretouch._core.warning_codes import caution
from pretouch.designs.impact import ImpactModel, impact_rows
from pretouch.motion import ContactResult, ContactStatus, ContinuousLaw, Motion, Scenario
from pretouch.motion.page_sections import approach_step, inputs_section, method_section, mitigating_step
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, LoopTrace, SimulationResult
from pretouch.simulation.closed_loop import contact_rows, loop_section
from pretouch.simulation.stability import passage

from .appraisal import USUAL_MARGIN
from .contact_speed import is_harder
from .effect import harm_in_words, idleness_in_words
from .encounter_parts import (
    Detection,
    LoopContact,
    QuantityComparison,
    ReportedFlag,
    cautions_in_words,
    compare_contacts,
    contacts_of,
    detection_of,
    ending_in_words,
    flags_of,
    force_in_words,
    headline_of,
    run_as_dict,
)
from .stability import limit_of, stability_margin

_SAMPLES: Final = 400
_PUSH: Final = 1.05  # a force above this multiple of the impact force is attributed to a push after the impact
_COMPARED: Final = (
    "Predicted: the continuous solution, with a perfect sensor and a plant that follows exactly. On the loop: one run "
    "with the sensor chain, controller, robot and contact listed below. {symbol} = 0: no mitigation, with the same "
    "noise. An approach has a negative relative velocity l\u2032. "
    '"Largest" means until the first contact, or until the end if there is none. Percentages compare magnitudes. '
    "Simulated and predicted, not measured."
)
_ELASTIC: Final = (
    "The predicted impact force is that of a lossless impact of two free bodies at the predicted relative velocity. "
    "The impact force on the loop is the largest until the bodies stop approaching each other. The robot's drive and "
    "an obstacle that does not yield raise it; losses lower it."
)
_COURSE: Final = (
    "The run on the loop, the prediction if there is one, and the run without mitigation until its contact. Dotted "
    "lines: first detection, if it is not at the start, and first contact. Virtual force and reading are held over a "
    "controller period. The predicted reading is the sensor curve at the predicted distance, without delay and noise."
)
_SEEN: Final = (
    "The controller responds to changes of ln \u03be after detection; changes before detection are ignored. If "
    "detection is too late, contact is as hard as without mitigation. The prediction assumes detection at the start."
)
_OF_THE_LOOP: Final = (
    "This is one run with one realization of the noise; the contact differs with another seed. `pretouch verify` "
    "reports how often a limit is met.",
    "Sensor noise is normal and independent from reading to reading, and the sensor curve is valid for this object.",
    "The robot consists of the listed mass, controller and friction. Its actuators have no other limits, its links are "
    "rigid, and its contact point moves in one dimension.",
    "The contact force depends on depth and rate of depth. Plant and contact are integrated by a Runge-Kutta method "
    "of order 4, with steps of 1/50 of the time scale of the contact.",
    "The controller starts at the start of the encounter, without a detected object.",
)

Row = tuple[Cell, ...]


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
        parts = self.detection, self.flags, self.contacts
        both = self.law.number, self.gain, self.run, self.unmitigated
        at = self.loop.detection(self.scenario, self.sensor)
        return (
            *harm_in_words(*both),
            *self.loop.start_warnings(self.scenario, self.sensor, self._predict),
            *self._instability(),
            *cautions_in_words(
                self.loop, self.run, *parts, grows=self.grows_after_impact, floor_is_late=at is not None and at.is_late
            ),
            *force_in_words(self.comparison("largest_virtual_force")),
            *idleness_in_words(*both),
        )

    def _predict(self, scenario: Scenario) -> ContactResult:
        return self.law.contact(scenario, self.sensor, self.gain, method=self.method, horizon=self.horizon)

    def _instability(self) -> Iterator[str]:
        """Yield a warning if the gain margin is too small."""
        distances = passage(self.law, self.scenario, self.sensor, self.gain, float(self.scenario.distance))
        limit = limit_of(self.loop, self.sensor, distances)
        margin = stability_margin(limit, self.gain)
        if limit is None or margin is None or margin >= USUAL_MARGIN:
            return
        number, place = self.law.number, format_quantity(limit.critical_distance, "m", 3)
        if limit.strongest == 0:
            yield caution("PT412", "The loop is unstable with any gain, however weak.")
        elif margin < 1:
            strongest = number.text(limit.strongest, 3)
            yield caution(
                "PT412",
                f"The sampled loop is unstable at a distance of {place}: the strongest stable "
                f"{number.name} there is {strongest}.",
            )
        else:
            yield caution(
                "PT412",
                f"The gain margin of the sampled loop is only {margin:.3g} at a distance of {place}; a gain "
                "margin of 2 is usual.",
            )

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


def encounter_page(encounter: SimulatedEncounter) -> Page:
    """Return the report page of a simulated encounter."""
    e = encounter
    impact = ((f"predicted impact: {name}", cell) for name, cell in impact_rows(e.impact))
    return Page(
        kind="One encounter on the sampled loop",
        headline=e.headline,
        status=f"on the loop: {ending_in_words(e.run.status)}",
        good=e.is_mitigated,
        key_figures=tuple(_key_figures(e)),
        warnings=e.warnings,
        next_step=_next_step(e),
        lead="simulation",
        blocks=(
            _comparison(e),
            _course(e),
            _contacts(e),
            _detection(e),
            loop_section(e.loop, (e.law.number.label, Measured(e.gain, e.law.number.unit))),
            inputs_section(e.scenario, e.sensor, *impact),
            _method(e),
        ),
    )


def _next_step(e: SimulatedEncounter) -> str:
    number = e.law.number
    if not e.run.touched and (step := approach_step(e.scenario)):
        return step
    if number.sign * e.gain < 0:
        return mitigating_step(number, e.gain)
    return "run `pretouch verify`, which repeats the encounter with other noise and checks every limit"


def _key_figures(e: SimulatedEncounter) -> Iterator[tuple[str, Cell]]:
    run, predicted, free = e.run, e.prediction, e.unmitigated
    yield e.law.number.label, Measured(e.gain, e.law.number.unit)
    if run.touched:
        yield f"{words_for('relative_velocity')}, on the loop", Measured(abs(run.relative_velocity), "m/s", 3)
    else:
        yield f"{words_for('closest_distance')}, on the loop", Measured(run.closest_distance, "m", 3)
    if predicted.reached.all():
        yield "predicted", Measured(abs(float(predicted.end.relative_velocity)), "m/s", 3)
    if free.touched:
        yield "without mitigation, on the loop", Measured(abs(free.relative_velocity), "m/s", 3)
    if run.touched and e.has_contact_force:
        yield f"{words_for('impact_force')}, on the loop", Measured(run.impact_force, "N", 3)
    elif run.touched:
        yield f"{words_for('time')}, on the loop", Measured(run.time, "s", 3)


def _comparison(e: SimulatedEncounter) -> PageSection:
    symbol = e.law.number.symbol
    head = ("", "on the loop", "predicted", "difference", *(f"{run}, {symbol} = 0" for run in ("loop", "predicted")))
    note = _COMPARED.format(symbol=symbol)
    table = PageTable(head=head, rows=tuple(_comparison_rows(e)), note=note, brief=True)
    loop = e.loop
    robot, contact = (cell_as_text(next(iter(rows))[1]) for rows in (loop.plant.rows(), contact_rows(loop.contact)))
    period = format_quantity(loop.law.period, "s", 3)
    method = " ".join(
        [
            f"In the simulation, the controller runs every {period}.",
            f"The simulated sensor measures at {loop.chain.rate:g} Hz.",
            f"The random seed is {loop.seed}. Robot: {robot}. Contact: {contact}.",
            f"Method of the prediction: {e.prediction.method}.",
        ]
    )
    elastic = Paragraph(text=_ELASTIC, quiet=True) if e.impact is not None and e.has_contact_force else None
    return PageSection(title="Loop and prediction", blocks=(table, Paragraph(text=method, brief=True), elastic))


def _comparison_rows(e: SimulatedEncounter) -> Iterator[Row]:
    results = e.run, e.prediction, e.unmitigated, e.unmitigated_prediction
    ends = [ending_in_words(result.status) for result in results]
    if set(ends) != {"contact"}:
        yield "ends with", *ends[:2], "", *ends[2:]
    for one in e.comparisons:
        if not one.is_empty:
            cells = [Measured(value, one.unit) for value in one.values]
            difference = one.difference_in_words or Measured(None)
            yield named(one.name), *cells[:2], difference, *cells[2:]


def _course(e: SimulatedEncounter) -> PageSection:
    shown = " The last panel shows the first contact, from its touch on." if e.has_contact_force else ""
    name = "Distance, relative velocity, virtual force, sensor reading and contact force over time"
    return PageSection(title="The run", blocks=(Film(figure="simulation", of=e, name=name, caption=_COURSE + shown),))


def _contacts(e: SimulatedEncounter) -> PageSection | None:
    if not (e.has_contact_force and e.contacts):
        return None
    head = ("touch", "l'", "peak force", "impulse", "l' after", "duration")
    return PageSection(
        title="Contacts", blocks=(PageTable(head=head, rows=tuple(map(_contact_row, e.contacts)), brief=True),)
    )


def _contact_row(contact: LoopContact) -> Row:
    lasts = contact.rebound_velocity is None and contact.duration is not None
    return (
        f"after {format_quantity(contact.time, 's')}",
        Measured(contact.relative_velocity, "m/s"),
        Measured(contact.peak_force, "N"),
        Measured(contact.impulse, "N*s"),
        "in contact at the end" if lasts else Measured(contact.rebound_velocity, "m/s"),
        Measured(contact.duration, "s", 3),
    )


def _detection(e: SimulatedEncounter) -> PageSection:
    sentence = "The controller never detected the object." if e.detection is None else e.detection.sentence
    head = ("reported by the controller", "since", "total", "before contact")
    flags = PageTable(head=head, rows=tuple(map(_flag_row, e.flags)), wraps=True, brief=True) if e.flags else None
    paragraphs = (Paragraph(text=sentence, brief=e.detection is not None), Paragraph(text=_SEEN, quiet=True))
    return PageSection(title="Detection", blocks=(*paragraphs, flags))


def _flag_row(flag: ReportedFlag) -> Row:
    times = (Measured(time, "s", 3) for time in (flag.since, flag.duration, flag.approach_duration))
    return flag.meaning if flag.has_meaning else f"{flag.meaning}, {flag.name}", *times


def _method(e: SimulatedEncounter) -> PageSection:
    loop = PageSection(title="Of the loop", blocks=(Listing(items=_OF_THE_LOOP),))
    prediction = replace(method_section(e.prediction.method, e.sensor), title="Of the prediction")
    return PageSection(title="Method and assumptions", blocks=(loop, prediction))
