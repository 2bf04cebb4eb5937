"""Build the report of one simulated encounter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

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
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import words_for
from pretouch.designs.impact import impact_rows
from pretouch.motion.page_sections import approach_step, inputs_section, method_section, mitigating_step
from pretouch.simulation.closed_loop import contact_rows, loop_section

from .encounter import SimulatedEncounter
from .encounter_parts import LoopContact, ReportedFlag, ending_in_words

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
    return PageSection(
        title="Loop and prediction", blocks=(table, Paragraph(text=method, brief=True), elastic), opened=True
    )


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
