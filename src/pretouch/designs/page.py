"""Build the report of a gain design.

It shows the optimal gain, the state at contact and the evidence of optimality.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from pretouch._core.blocks import (
    Cell,
    Film,
    Measured,
    Named,
    Page,
    PageSection,
    PageTable,
    Paragraph,
    Picture,
    named,
)
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.units import format_quantity, format_range
from pretouch._core.vocabulary import QUANTITIES, words_for
from pretouch.motion import DAMPER, DRAG, ContactResult, ContactStatus, LawNumber
from pretouch.motion.contact import ContactState
from pretouch.motion.page_sections import (
    inputs_section,
    method_section,
    scenario_rows,
    sensor_rows,
    solved_on,
)

from .certificate import ACTIVE, ConstraintOutcome, DesignStatus
from .custom_objectives import CustomObjective
from .drag.alternative import drag_alternative
from .evidence_page import evidence_section, sensitivity_section
from .gain import GainDesign, designed_number
from .impact import ImpactModel, impact_rows
from .objectives import Objective
from .page_sentences import limit_in_words, step_without_gain, verify_step
from .quantities import contact_value
from .task import Task

Row = tuple[Cell, ...]

_STATUS: Final = {
    DesignStatus.OPTIMAL: "optimal gain found",
    DesignStatus.INFEASIBLE: "infeasible: no gain within the bounds meets every constraint",
    DesignStatus.NO_CONTACT: "no contact: no gain within the bounds ends in contact",
}
_ADVICE: Final = {
    DesignStatus.INFEASIBLE: (
        "No gain within the bounds meets all constraints. The value column is for the gain that exceeds the limits "
        "least. The next step names changes with which a gain exists. Another admittance can help, too."
    ),
    DesignStatus.NO_CONTACT: (
        "Without contact there is no impact to mitigate. Check the signs: an approaching obstacle has a negative "
        "velocity, an approaching plant a positive one. Check the reference and the valid range of the sensor curve."
    ),
}
_NOT_AT_CONTACT: Final = ("closest_distance", "settling_distance", "impulse_residual", "distance", "gain", "objective")
_CUSTOM_OBJECTIVE: Final = "A user-defined objective, with the parts that it declares."
_MOTION_NOTES: Final = {
    "loop": " One run of the sampled loop, with the same noise for every gain.",
    "other": " These are motions in continuous time, L(1): the user-defined evaluator returns no motions.",
}


def task_page(task: Task) -> Page:
    """Return the report page of a design problem.

    It describes encounter, sensor, objective and limits.
    """
    if task.scenario.shape:
        return Page(kind="Task", headline=f"Task for encounters of shape {task.scenario.shape}")
    number = task.law.number
    rows: list[Row] = [("law", task.law.kind)]
    if task.objective is not None:
        rows.append(("objective", task.goal.name))
    if task.bounds is not None:
        rows.append((f"bounds of {number.label}", format_range(task.bounds, number.unit)))
    limits = ((c.limit, number.entry(c.quantity)) for c in task.limits)
    rows += [(f"limit: {limited.words}", Measured(limit, limited.unit)) for limit, limited in limits]
    table = PageTable(rows=(*rows, *scenario_rows(task.scenario), *sensor_rows(task.sensor)), brief=True)
    loop = "" if task.loop is None else ", on a sampled loop"
    return Page(kind="Task", headline=f"Task for one encounter{loop}", blocks=(table,))


def gain_page(design: GainDesign) -> Page:
    """Return the report page on the designed gain of one encounter."""
    if design.scenario.shape:
        raise ResultUnavailableError("page: found an array of designs, expected one; select it with .at(index)")
    advice = _ADVICE.get(design.status)
    return Page(
        kind="Gain of preemptive impact mitigation",
        headline=design.headline,
        status=_STATUS[design.status],
        good=design.status is DesignStatus.OPTIMAL,
        key_figures=tuple(_key_figures(design)),
        warnings=design.warnings,
        findings=tuple(_findings(design)),
        next_step=_next_step(design),
        lead="motion",
        blocks=(
            _contact(design),
            _constraints(design) if design.constraints else None,
            None if advice is None else Paragraph(text=advice),
            drag_alternative(design),
            _trade_off(design),
            _motion(design),
            _gain_and_sensor(design),
            evidence_section(design),
            sensitivity_section(design) if design.sensitivities else None,
            inputs_section(design.scenario, design.sensor, *_searched(design)),
            method_section(design.method, design.sensor, solved_on=solved_on(design)),
        ),
    )


def _displayed_result(design: GainDesign) -> ContactResult | None:
    return design.result or design.nearest


def _key_figures(design: GainDesign) -> Iterator[tuple[str, Cell]]:
    run, before = _displayed_result(design), design.no_mitigation
    if run is None:
        yield "nearest approach without mitigation", Measured(float(before.closest_distance), "m")
        return
    n = design.number
    yield n.label if design.result else f"nearest {n.label}", Measured(float(run.gain), n.unit)
    speed = abs(float(run.end.relative_velocity))
    yield words_for("relative_velocity"), Measured(speed, "m/s", 3)
    if before.reached.all():
        free = abs(float(before.end.relative_velocity))
        yield "without mitigation", Measured(free, "m/s", 3)
        yield "change of speed", f"{100 * (speed / free - 1):+.1f} %"
    yield words_for("time"), Measured(float(run.end.time), "s", 3)


def _findings(design: GainDesign) -> Iterator[str]:
    """Yield one sentence for each constraint of the design."""
    for c in design.constraints:
        met = c.margin is not None and c.margin >= -ACTIVE * c.limit
        yield limit_in_words(design.number.entry(c.quantity).words, c.value, c.limit, c.unit, met=met)


def _next_step(design: GainDesign) -> str:
    if design.without_margin is not None:
        gain, task = design.without_margin.gain, design.problem.task
        faster = "read the sensor faster"
        if task.loop.chain.rate >= task.largest_sensor_rate:
            faster = f"use a faster sensor than the {task.sensor_part.name}"
        return (
            f"{faster}, so that the optimal {design.number.name} {design.number.equals(gain)} has the "
            "required gain margin; `pretouch verify` reports the necessary sensor rate"
        )
    if design.result is None:
        contact = design.status is not DesignStatus.NO_CONTACT
        return step_without_gain(
            design.problem.task, contact=contact, relaxations=design.relaxations, design=designed_number
        )
    return verify_step(design.problem.task)


def _contact(design: GainDesign) -> PageSection:
    run = _displayed_result(design)
    runs = [r for r in (design.no_mitigation, run) if r is not None]
    head: Row = ("", "without mitigation")
    if run is not None:
        gain = design.number.equals(float(run.gain))
        head = (*head, f"{'optimal' if design.result else 'nearest'}, {gain}", "change")
    note = (
        "Predicted, not measured. x points away from the sensor: an approach has a negative relative velocity "
        'l\u2032, and mitigation moves the plant toward negative x. "Largest" means over the whole motion until '
        "contact. Changes compare magnitudes."
    )
    names = [*ContactState.names(), *(("drive_force", "impact_force") if design.impact is not None else ())]
    names += [term.quantity for term in design.definition.terms] + [c.quantity for c in design.constraints]
    table = PageTable(head=head, rows=tuple(_contact_rows(runs, names, design.impact)), note=note, brief=True)
    return PageSection(title="The contact", blocks=(table,), opened=True)


def _contact_rows(runs: list[ContactResult], names: list[str], impact: ImpactModel | None) -> Iterator[Row]:
    blank = ("",) * (len(runs) - 1)
    ended = all(run.reached.all() for run in runs)
    if not ended:
        yield ("ends with", *(ContactStatus(int(run.status)).words for run in runs), *blank)
        nearest = (Measured(float(run.closest_distance), "m") for run in runs)
        yield (words_for("closest_distance"), *nearest, *blank)
    for name in dict.fromkeys(names):
        if name in _NOT_AT_CONTACT:
            continue
        values = [float(contact_value(name, run.end, impact)) for run in runs]
        largest = max(abs(v) for v in values)
        label = named(name)
        if not ended:
            words = label.words.replace("at contact", "at the end").replace("of contact", "of the end")
            label = Named(words, label.symbol)
        shown = [0.0 if abs(v) < max(1e-9 * largest, 1e-15) else v for v in values]
        cells = [Measured(v, QUANTITIES[name].unit) for v in shown]
        yield (label, *cells, *([_change(*values)] if len(values) > 1 else []))


def _change(before: float, value: float) -> str:
    if not np.isfinite([value, before]).all() or abs(before) < 1e-9 * max(abs(value), 1e-9):
        return ""
    return f"{100 * (abs(value) / abs(before) - 1):+.1f} %"


def _constraints(design: GainDesign) -> PageSection:
    head = ("constraint", "value", "limit", "margin", "state", "smallest value of any gain")
    rows = tuple(_constraint_row(o, design.number) for o in design.constraints)
    return PageSection(title="Constraints", blocks=(PageTable(head=head, rows=rows, brief=True),), opened=True)


def _constraint_row(o: ConstraintOutcome, number: LawNumber) -> Row:
    if o.best_value is None or o.best_gain is None:
        state, least = "no contact", "-"
    else:
        least = f"{format_quantity(o.best_value, o.unit)} at {number.text(o.best_gain)}"
        exceeded = o.margin is not None and o.margin < 0 and not o.active
        state = "exceeded" if exceeded else "active" if o.active else "met"
        state = state if o.achievable else "cannot be met"
    return (
        number.entry(o.quantity).words,
        *(Measured(v, o.unit) for v in (o.value, o.limit, o.margin)),
        state,
        least,
    )


def _trade_off(design: GainDesign) -> PageSection:
    itemized = bool(design.objective_parts or not isinstance(design.definition, CustomObjective))
    caption = (
        f"The left plot shows {'the objective and its terms' if itemized else 'the objective'} over the searched "
        "range of gains. Hatched ranges contain gains that exceed a limit or do not result in contact. The right plot "
        "shows the state at contact for each gain."
    )
    if shows_equals(design):
        caption += (
            " The thin line is the contour of the optimal objective: no gain reaches inside it, and the chosen gain "
            "touches it unless a limit is active."
        )
    if not design.trade_off.reached.any():
        caption = "Closest distance over the gain."
    name = "Objective over the gain, and relative velocity at contact over the quantity it is traded for"
    custom = isinstance(design.definition, CustomObjective)
    formula = (
        "Each term is weight \u00d7 (quantity / typical value)\u00b2, as in the letter's objectives L(20) and L(22)."
    )
    note = _CUSTOM_OBJECTIVE if custom else formula
    terms = PageTable(
        head=("term of the objective", "typical value", "weight", "value"),
        rows=(
            *_valued_terms(design),
            (f"objective f ({design.definition.name})", "", "", Measured(design.objective, "", 5)),
        ),
        note=note,
        brief=design.objective is not None,
    )
    picture = Picture(figure="trade_off", of=design, name=name, caption=caption)
    return PageSection(title="The trade-off", blocks=(picture, terms))


def _valued_terms(design: GainDesign) -> Iterator[Row]:
    definition, result = design.definition, design.result
    if isinstance(definition, CustomObjective):
        for name, part in design.objective_parts.items():
            yield words_for(name), "", "", Measured(part)
        return
    speed = abs(design.scenario.obstacle.velocity)
    for term, row in zip(definition.terms, objective_rows(definition, design.number), strict=True):
        yield *row, Measured(None if result is None else float(term.value(result.end, speed, design.impact)))


def objective_rows(objective: Objective, number: LawNumber) -> Iterator[Row]:
    """Yield a table row for each term of an objective.

    A row has quantity, typical value and weight.
    """
    if isinstance(objective, CustomObjective):
        yield f"{objective.name}: a user-defined objective", "", ""
        return
    for term in objective.terms:
        label, quantity = words_for(term.scale) if isinstance(term.scale, str) else None, number.entry(term.quantity)
        scale = label or Measured(abs(float(term.scale)), quantity.unit)
        yield quantity.words, scale, Measured(term.weight)


def traded_quantity(design: GainDesign) -> str:
    """Return the quantity that the objective weighs against contact speed.

    An example is the excursion.
    """
    for term in design.definition.terms:
        if term.quantity not in {"relative_velocity", "impact_force"} and term.weight > 0:
            return term.quantity
    return "largest_excursion"


def shows_equals(design: GainDesign) -> bool:
    """Return True if a plot can show contours of the objective.

    The objective must depend on the contact speed and exactly one other quantity.
    """
    quantities = sorted(t.quantity for t in design.definition.terms if t.weight > 0)
    return design.objective is not None and quantities == sorted((traded_quantity(design), "relative_velocity"))


def _motion(design: GainDesign) -> PageSection:
    caption = "The motion until contact (dot), with the optimal gain and without mitigation. Dotted lines are limits."
    name = "Distance, position, relative velocity and virtual force over time"
    caption += _MOTION_NOTES.get(solved_on(design), "")
    return PageSection(title="The motion", blocks=(Film(figure="motion", of=design, name=name, caption=caption),))


_FORCE_LAWS: Final = {
    DAMPER.kind: (
        "The virtual force is F_p = D_p g(l) l\u2032: a damper between plant and obstacle whose coefficient is D_p g.",
        "damping D_p g",
        "twice",
    ),
    DRAG.kind: (
        "The virtual force is F_p = \u2212\u03c6 (g(l) l\u2032)\u00b2 while the object approaches: a drag between "
        "plant and obstacle whose coefficient is \u03c6 g\u00b2.",
        "coefficient \u03c6 g\u00b2",
        "four times",
    ),
}
"""For each kind of law: its force, the name of its coefficient, and the factor on the gain if the slope is halved."""


def _gain_and_sensor(design: GainDesign) -> PageSection | None:
    """Return a table of the coefficient of the virtual force, such as D_p g, at the start and at contact."""
    run, n, law = _displayed_result(design), design.number, design.law
    if run is None or law.degree is None:
        return None
    power, exponent = law.degree, "" if law.degree == 1 else f"^{law.degree}"
    general = (
        f"The virtual force is proportional to the {n.label} and to (g(l) l′){exponent}. Here, l is the distance, g "
        "the sensor slope and l′ the relative velocity.",
        f"product {n.symbol} g{exponent}",
        f"{2**power} times",
    )
    (force, coefficient, times), unit = _FORCE_LAWS.get(law.kind, general), f"{n.unit}/m{exponent}"
    gain, (low, high) = float(run.gain), design.sensor.valid_range
    rows = []
    for name, distance in (("at contact", 0.0), ("at the start", float(design.scenario.distance))):
        if low <= distance <= high:
            slope = float(design.sensor.log_slope(distance))
            place = f"{name}, l = {format_quantity(distance, 'm')}"
            rows.append((place, Measured(gain, n.unit), Measured(slope, "1/m"), Measured(gain * slope**power, unit)))
    note = (
        f"{force} The motion depends on the {coefficient}, not on the {n.name} alone. Therefore, do not compare the "
        f"{n.name} between different sensors. If the slope g is half as large, the same motion needs about {times} the "
        f"{n.name}. An offset that remains in the readings reduces the measured slope g and weakens the force."
    )
    head = ("distance", n.label, "sensor slope g", coefficient)
    table = PageTable(head=head, rows=tuple(rows), note=note, brief=True)
    return PageSection(title="Gain and sensor together", blocks=(table,)) if rows else None


def _searched(design: GainDesign) -> Iterator[Row]:
    yield f"{design.number.name}: bounds", format_range(design.bounds, design.number.unit)
    yield from impact_rows(design.impact)
