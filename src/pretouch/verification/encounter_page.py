"""What a simulated encounter says: the run beside its prediction, its contacts, and what the law saw and reported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from pretouch._core.blocks import Cell, Chapter, Listing, Measured, Page, Paragraph, Picture, Rows, named
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import words_for
from pretouch.design.page import impact_rows
from pretouch.motion.describing import inputs_section, method_section
from pretouch.simulation.describing import loop_section

from .encounter import SimulatedEncounter, ending_in_words
from .encounter_parts import LoopContact, ReportedFlag

__all__ = ["encounter_page"]

Row = tuple[Cell, ...]

_HEAD: Final = ("", "on the loop", "predicted", "difference", "loop, D_p = 0", "predicted, D_p = 0")
_COMPARED: Final = (
    "Predicted: the continuous solution, with a perfect sensor and a plant that follows exactly. On the loop: one run "
    "with the sensor chain, the controller, the robot and the contact that are stated below. With D_p = 0, without "
    "mitigation, the same loop meets the same noise. An approach has a negative relative velocity l\u2032; "
    '"largest" means until the first contact, or until the end where there is none. Shares compare magnitudes. '
    "Simulated and predicted, not measured."
)
_ELASTIC: Final = (
    "The predicted impact force is that of a lossless impact of two free bodies at the predicted relative velocity. "
    "The impact force on the loop is the largest until the bodies stop approaching each other: the robot's drive and "
    "an obstacle that does not yield add to it, losses take from it."
)
_COURSE: Final = (
    "The course of the run on the loop, the prediction, and the run without mitigation until its contact. Dotted: when "
    "the law first saw the object, where that is not at the start, and the first contact. Virtual force and reading "
    "stay the same over a period of the law; the predicted reading is the output of the curve at the predicted "
    "distance, without delay and noise."
)
_SEEN: Final = (
    "A law answers the change of ln \u03be that it sees; what had passed before is lost to it. Seen too late, an "
    "object is met as hard as without mitigation. The prediction begins at the start."
)
_OF_THE_LOOP: Final = (
    "One run, with one draw of the noise: another seed comes to another contact. How often a limit holds is a question "
    "to many runs.",
    "The sensor chain is as stated: its noise is normal and independent from reading to reading, and the curve holds "
    "for the object that comes.",
    "The robot is the mass, the controller and the friction that are stated; its actuators have no other limits, its "
    "links do not bend, and its contact point moves in one dimension.",
    "The contact force is a function of depth and its rate. Plant and contact are integrated by Runge-Kutta's method "
    "of order 4, at 1/50 of the contact's time scale.",
    "The law starts with the encounter, with nothing detected.",
)


def encounter_page(encounter: SimulatedEncounter) -> Page:
    """Describe a run of the loop.

    Args:
        encounter: what `simulate_encounter` returned, however it ended.

    Returns:
        Its page.
    """
    e = encounter
    impact = ((f"predicted impact: {name}", cell) for name, cell in impact_rows(e.impact))
    return Page(
        kind="One encounter on the sampled loop",
        headline=e.headline,
        status=f"on the loop: {ending_in_words(e.run.status)}",
        good=bool(e.run.touched),
        key_figures=tuple(_key_figures(e)),
        warnings=e.warnings,
        blocks=(
            _comparison(e),
            _course(e),
            _contacts(e),
            _detection(e),
            loop_section(e.loop, ("gain D_p", Measured(e.gain, "N*s"))),
            inputs_section(e.scenario, e.sensor, *impact),
            _method(e),
        ),
    )


def _key_figures(e: SimulatedEncounter) -> Iterator[tuple[str, Cell]]:
    run, predicted, free = e.run, e.prediction, e.unmitigated
    yield "gain D_p", Measured(e.gain, "N*s")
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


def _comparison(e: SimulatedEncounter) -> Chapter:
    table = Rows(head=_HEAD, rows=tuple(_comparison_rows(e)), note=_COMPARED, brief=True)
    loop, contact = e.loop, e.loop.contact
    model = "no contact model" if contact is None else type(contact).__name__
    made = (
        f"On the loop: {type(loop.law).__name__} every {format_quantity(loop.law.period, 's', 3)}, readings at "
        f"{loop.chain.rate:g} Hz, {type(loop.plant).__name__}, {model}, seed {loop.seed}. Predicted: "
        f"{e.prediction.method}."
    )
    elastic = Paragraph(text=_ELASTIC, quiet=True) if e.impact is not None and e.has_contact_force else None
    return Chapter(title="Loop and prediction", blocks=(table, Paragraph(text=made, brief=True), elastic))


def _comparison_rows(e: SimulatedEncounter) -> Iterator[Row]:
    ends = [ending_in_words(r.status) for r in (e.run, e.prediction, e.unmitigated, e.unmitigated_prediction)]
    if set(ends) != {"contact"}:
        yield "ends with", *ends[:2], "", *ends[2:]
    for one in e.comparisons:
        if not one.is_empty:
            cells = [Measured(value, one.unit) for value in one.values]
            difference = one.difference_in_words or Measured(None)
            yield named(one.name), *cells[:2], difference, *cells[2:]


def _course(e: SimulatedEncounter) -> Chapter:
    shown = " The last panel shows the first contact, from its touch on." if e.has_contact_force else ""
    name = "Distance, relative velocity, virtual force, sensor reading and contact force over time"
    return Chapter(title="The run", blocks=(Picture(figure="simulation", of=e, name=name, caption=_COURSE + shown),))


def _contacts(e: SimulatedEncounter) -> Chapter | None:
    if not (e.has_contact_force and e.contacts):
        return None
    head = ("touch", "l'", "peak force", "impulse", "l' after", "duration")
    return Chapter(title="Contacts", blocks=(Rows(head=head, rows=tuple(map(_contact_row, e.contacts)), brief=True),))


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


def _detection(e: SimulatedEncounter) -> Chapter:
    said = "The law never saw the object." if e.detection is None else e.detection.sentence
    head = ("the law reported", "which means", "since", "in all", "before contact")
    flags = Rows(head=head, rows=tuple(map(_flag_row, e.flags)), wraps=True, brief=True) if e.flags else None
    seen = (Paragraph(text=said, brief=e.detection is not None), Paragraph(text=_SEEN, quiet=True))
    return Chapter(title="Detection", blocks=(*seen, flags))


def _flag_row(flag: ReportedFlag) -> Row:
    times = (Measured(time, "s", 3) for time in (flag.since, flag.duration, flag.approach_duration))
    return flag.name, flag.meaning, *times


def _method(e: SimulatedEncounter) -> Chapter:
    loop = Chapter(title="Of the loop", blocks=(Listing(items=_OF_THE_LOOP),))
    prediction = replace(method_section(e.prediction.method), title="Of the prediction")
    return Chapter(title="Method and assumptions", blocks=(loop, prediction))
