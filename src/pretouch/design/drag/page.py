"""What the design of a drag says, and what that of a gain says of the drag beside it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.blocks import Cell, Chapter, LazyBlock, Listing, Measured, Page, Paragraph, Picture, Rows
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity, pretty_unit
from pretouch._core.vocabulary import unit_of
from pretouch.motion import DAMPER, DRAG, ContactResult, Scenario
from pretouch.motion.page_sections import inputs_section, method_section

from ..constraints import ImpactModel, impact_rows, quantity_of
from ..front.physical_bound import find_physical_bound, why_no_bound
from ..gain import GainDesign, design_gain
from .design import why_no_drag
from .limits import DragEffect, strongest_by_excursion
from .result import ROUNDING, DragDesign

Row = tuple[Cell, ...]

_SPEEDS: Final = (0.05, 0.1, 0.3, 1.0)
_PUSHES: Final = (0.0, 0.5, 1.0, 2.0, 5.0)
_DISTANCES: Final = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
_SEARCHED: Final = (100.0, 1e-3)  # in the gain that gives the object's whole momentum to a plant of the virtual mass
_BETTER: Final = 0.99  # of a contact speed, from which on less is worth a sentence
_COMPARED: Final = {
    "relative_velocity": "contact speed",
    "displacement": "excursion",
    "largest_acceleration": "largest acceleration",
    "time": "time",
}
_OF_IMPACT: Final = {"drive_force": "drive force", "impact_force": "impact force"}
_UNIFORM: Final = (
    "For uniform approaches. The drag leaves each the same share of its speed after the same excursion, also where the "
    "object is slow; its acceleration grows with the square of the speed."
)
_BOUND: Final = (
    "Whatever the object does from the detection distance on, at the approach speed of this encounter or less, and if "
    "its acceleration toward the plant never exceeds the one named (that of the reference, and the plant's own return "
    "where it is not held off, count as well): it also holds for one that turns back and comes again."
)
_DETECTED: Final = (
    "What the same drag does to an object that is seen from elsewhere: contact is fastest for the nearest and the "
    "excursion largest for the farthest, so two ends say all. An object that stops near and comes again is such a "
    "near one."
)


def drag_page(design: DragDesign) -> Page:
    """Describe the drag of a task."""
    task, run = design.asked, design.result
    acceleration = _push(design.scenario)
    warnings = []
    if acceleration:
        warnings.append(
            "the drag was chosen by its effect on an object in uniform motion; this one accelerates "
            f"{'toward' if acceleration > 0 else 'away from'} the plant by "
            f"{pretty_unit(format_quantity(abs(acceleration), 'm/s^2'))}"
        )
    if -float(design.scenario.relative_velocity) > design.largest_speed:
        warnings.append(
            f"this object is faster than {format_quantity(design.largest_speed, 'm/s')}, up to which the drag was made"
        )
    return Page(
        kind="Drag of preemptive impact mitigation",
        headline=design.headline,
        status="drag found" if design.holds else "a limit is exceeded" if run.reached else "no contact",
        good=design.holds,
        key_figures=tuple(_key_figures(design, run)),
        warnings=tuple(warnings),
        blocks=(
            _contact(design, run),
            _limits(design, run) if task.limits else None,
            _speeds(design),
            _figure(design),
            _guarantee(design),
            _detection(design),
            inputs_section(design.scenario, design.sensor, _chosen_by(design), *impact_rows(task.impact)),
            method_section(run.method),
        ),
    )


def letters_optimum(design: DragDesign) -> GainDesign | None:
    """Design the letter's gain for the encounter of a drag.

    Args:
        design: the drag of a task.

    Returns:
        The optimum, within the task's bounds where they are bounds of D_p, else within wide ones; None where there is
        no objective, or where none will do.
    """
    task = design.asked
    if task.objective is None:
        return None
    bounds = task.bounds
    if bounds is None or task.law != DAMPER:
        near, far = (float(design.sensor.log_output(d)) for d in (0.0, design.detection_distance))
        one = design.mass * abs(float(design.scenario.relative_velocity)) / (near - far)
        bounds = (-_SEARCHED[0] * one, -_SEARCHED[1] * one)
    limits = tuple(c for c in task.limits if c.quantity != "gain" or task.law == DAMPER)
    found = design_gain(
        task.replace(
            law=DAMPER,
            bounds=bounds,
            constraints=limits,
            method="auto",
            evaluate=None,
            stability_margin=None,
            loop=None,
        )
    )
    return None if found.result is None else found


def speeds_of(design: DragDesign) -> tuple[float, float, float]:
    """Return the approach speeds [m/s] between which a page shows a drag, and that of its task."""
    own = -float(design.scenario.relative_velocity)
    top = design.largest_speed if math.isfinite(design.largest_speed) else _SPEEDS[-1]
    return min(_SPEEDS[0], own), max(top, own), own


def at_speeds(scenario: Scenario, speed: FloatArray) -> Scenario:
    """Return uniform approaches at other speeds [m/s]."""
    velocity, acceleration = scenario.plant.velocity - speed, scenario.reference.acceleration
    return replace(scenario, obstacle=replace(scenario.obstacle, velocity=velocity, acceleration=acceleration))


def _push(scenario: Scenario) -> float:
    """Return the acceleration of the object toward the plant, relative to the reference [m/s^2]."""
    return float(scenario.reference.acceleration - scenario.obstacle.acceleration)


def _key_figures(design: DragDesign, run: ContactResult) -> Iterator[tuple[str, Cell]]:
    yield DRAG.number.label, Measured(design.drag, DRAG.number.unit)
    yield "share of any approach speed", f"{100 * design.ratio:.3g} %"
    for words, unit, (value,) in _quantities(design.asked.impact, run):
        yield words, Measured(value, unit, 3)


def _contact(design: DragDesign, run: ContactResult) -> Chapter:
    letter, rest = letters_optimum(design), DRAG.contact(design.scenario, design.sensor, 0.0)
    columns = {"without mitigation": rest, DRAG.number.equals(design.drag): run}
    if letter is not None and letter.result is not None:
        columns[f"the letter's optimum, {DAMPER.number.equals(letter.gain or 0.0)}"] = letter.result
    rows = [*_compared(design.scenario, design.asked.impact, *columns.values())]
    place = ("", Measured(float(design.peak_distance), "m"), "")[: len(columns)]
    if not _push(design.scenario):
        rows.insert(4, ("distance of the largest acceleration", *place))
    note = (
        "Predicted, not measured; magnitudes. The excursion is that at contact, after which the plant still goes back. "
        "The least excursion is that of any robot that accelerates no more and comes to the same speed at contact."
    )
    return Chapter(title="The contact", blocks=(Rows(head=("", *columns), rows=tuple(rows), note=note, brief=True),))


def _compared(scenario: Scenario, impact: ImpactModel | None, *runs: ContactResult) -> Iterator[Row]:
    """Yield what encounters come to, side by side."""
    speed = abs(float(scenario.relative_velocity))
    for words, unit, values in _quantities(impact, *runs):
        yield words, *(Measured(v, unit) for v in values)
        if words == "contact speed":
            yield "share of the approach speed", *(f"{100 * v / speed:.3g} %" for v in values)
    if not why_no_bound(scenario):
        yield "times the least excursion of any robot", *(Measured(_beyond_bound(scenario, r), "", 3) for r in runs)


def _quantities(impact: ImpactModel | None, *runs: ContactResult) -> Iterator[tuple[str, str, list[float]]]:
    """Yield words, unit and magnitudes of what encounters come to."""
    for name, words in {**_COMPARED, **(_OF_IMPACT if impact is not None else {})}.items():
        yield words, unit_of(name), [abs(float(quantity_of(name, run.end, impact))) for run in runs]


def _beyond_bound(scenario: Scenario, run: ContactResult) -> float:
    """Return by how much an excursion exceeds the least of any robot that accelerates as much; NaN for none."""
    limit = float(run.end.largest_acceleration)
    if not run.reached or not limit > 0 or not float(run.end.displacement) < 0:
        return math.nan
    least = find_physical_bound(scenario, acceleration_limit=limit).excursion(abs(float(run.end.relative_velocity)))
    return float(abs(run.end.displacement) / least) if least > 0 else math.nan


def _limits(design: DragDesign, run: ContactResult) -> Chapter:
    def row(limit: Any) -> Row:
        if limit.quantity == "gain":
            return limit.name, "", Measured(limit.limit, limit.unit), "of D_p, no drag"
        value = float(limit.magnitude(run.end, design.asked.impact))
        state = "met" if design.keeps(limit) else "exceeded"
        return limit.name, Measured(value, limit.unit), Measured(limit.limit, limit.unit), state

    table = Rows(head=("constraint", "value", "limit", "state"), rows=tuple(map(row, design.asked.limits)), brief=True)
    return Chapter(title="Constraints", blocks=(table,))


def _speeds(design: DragDesign) -> Chapter:
    low, high, own = speeds_of(design)
    speeds = np.array(sorted({own, high, *(v for v in _SPEEDS if low <= v <= high)}))
    head = ["approach speed", "contact speed", "excursion", "largest acceleration", "time"]
    columns: list[tuple[Any, str]] = [
        (speeds, "m/s"),
        (design.contact_speed(speeds), "m/s"),
        (np.full(len(speeds), design.excursion), "m"),
        (design.acceleration(speeds), "m/s^2"),
        (design.time(speeds), "s"),
    ]
    letter = letters_optimum(design)
    if letter is not None:
        head, columns = _with_letter(design, letter, head, columns, at_speeds(design.scenario, speeds))
    rows = zip(*([Measured(float(v), unit) for v in values] for values, unit in columns), strict=True)
    table = Rows(head=tuple(head), rows=tuple(rows), note=_UNIFORM, brief=True)
    return Chapter(title="Every speed", titled=True, blocks=(table,))


def _with_letter(
    design: DragDesign, letter: GainDesign, head: list[str], columns: list[tuple[Any, str]], starts: Scenario
) -> tuple[list[str], list[tuple[Any, str]]]:
    """Put what the letter's gain does in the same encounters beside columns of contact speed, excursion and so on."""
    end = DAMPER.contact(starts, design.sensor, letter.gain).end
    names = ("relative_velocity", "displacement", "largest_acceleration")
    more = [(np.abs(getattr(end, name)), unit_of(name)) for name in names]
    return [*head, *(f"letter: {words}" for words in head[1:4])], [*columns, *more]


def _figure(design: DragDesign) -> Chapter:
    caption = (
        "Contact speed over approach speed against the excursion: all drags, the one that was chosen, and where there "
        "is an objective the gains of the letter's law at the speed of this encounter, with the optimal one. And what "
        "the one drag, beside that one gain, does at every approach speed."
    )
    name = "Share of the speed against excursion, and share, excursion and acceleration over the approach speed"
    picture = Picture(figure="drag", of=design, name=name, caption=caption)
    return Chapter(title="The trade-off", blocks=(picture,))


def _guarantee(design: DragDesign) -> Chapter:
    speed, distance = -float(design.scenario.relative_velocity), float(design.detection_distance)
    pushes = np.array(_PUSHES)
    bound = design.contact_speed_bound(speed, pushes)
    free = np.sqrt(speed**2 + 2 * pushes * distance)
    rows = tuple(
        (Measured(a, "m/s^2"), Measured(float(w), "m/s"), Measured(float(v), "m/s"))
        for a, w, v in zip(_PUSHES, bound, free, strict=True)
    )
    head = ("acceleration of the object toward the plant, at most", "contact speed, at most", "without mitigation")
    premises = Chapter(title="Premises", blocks=(Listing(items=design.premises),))
    return Chapter(title="The guarantee", blocks=(Rows(head=head, rows=rows, note=_BOUND), premises))


def _detection(design: DragDesign) -> Chapter:
    speed, last = -float(design.scenario.relative_velocity), float(design.sensor.valid_range[1])
    distances = np.array([d for share in _DISTANCES if (d := share * float(design.detection_distance)) <= last])
    seen = design.seen_from(distances)
    columns: list[tuple[Any, str]] = [
        (distances, "m"),
        (seen.contact_speed(speed), "m/s"),
        (seen.excursion, "m"),
        (seen.acceleration(speed), "m/s^2"),
    ]
    head = ["detected from", "contact speed", "excursion", "largest acceleration"]
    letter = letters_optimum(design)
    if letter is not None:
        start = at_speeds(design.scenario, np.full(len(distances), speed))
        start = replace(start, obstacle=replace(start.obstacle, position=start.plant.position + distances))
        head, columns = _with_letter(design, letter, head, columns, start)
    rows = zip(*([Measured(float(v), unit) for v in values] for values, unit in columns), strict=True)
    return Chapter(title="Seen nearer or farther", blocks=(Rows(head=tuple(head), rows=tuple(rows), note=_DETECTED),))


def _chosen_by(design: DragDesign) -> Row:
    name, value, unit = (design.asked.effect or DragEffect(ratio=design.ratio)).chosen
    up_to = f", up to {format_quantity(design.largest_speed, 'm/s')}" if math.isfinite(design.largest_speed) else ""
    return f"the drag is chosen by its {name.replace('_', ' ')}", Measured(float(value), unit, beside=up_to)


def drag_beside(design: GainDesign) -> Chapter | None:
    """Say what a virtual drag would do in the encounter of an optimal gain.

    Args:
        design: the gain, of one encounter.

    Returns:
        A section; None where the drag is not known to touch more slowly after the same excursion and to keep the
        limits of the task. That is known in continuous time, for a plant that rests at its reference and an object that
        does not brake.
    """
    task, run = design.problem.task, design.result
    if run is None or task.law != DAMPER or task.loop is not None or design.on_evaluator:
        return None
    scenario, sensor, push = design.scenario, design.sensor, _push(design.scenario)
    excursion, before = -float(run.end.displacement), abs(float(run.end.relative_velocity))
    if why_no_drag(scenario) or push < 0 or not excursion > 0 or sensor.valid_range[0] > 0:
        return None
    mass, distance = float(scenario.admittance.mass), float(scenario.distance)
    speed = -float(scenario.relative_velocity)
    try:
        drag = strongest_by_excursion(sensor, distance, mass, excursion, speed, push)
        beside = DRAG.contact(scenario, sensor, drag, horizon=task.horizon)
    except InvalidInputError:  # a curve that does not fall down to contact, or more excursion than any drag takes
        return None
    limits = [c for c in task.limits if c.quantity != "gain"]
    after = abs(float(beside.end.relative_velocity))
    kept = all(c.magnitude(beside.end, task.impact) <= c.limit * (1 + ROUNDING) for c in limits)
    if not (beside.reached and after < _BETTER * before and kept):
        return None
    accelerations = [pretty_unit(format_quantity(float(r.end.largest_acceleration), "m/s^2")) for r in (beside, run)]
    text = (
        f"A virtual drag {DRAG.number.equals(drag)} would touch at {format_quantity(after, 'm/s')} instead of "
        f"{format_quantity(before, 'm/s')} after the same excursion, with a largest acceleration of {accelerations[0]} "
        f"instead of {accelerations[1]}"
    )
    if not push:
        text += f", and leave {100 * after / speed:.3g} % of any other approach speed as well"
    table = LazyBlock(make=lambda: _drags_beside(design, run, drag, beside))
    return Chapter(title="The virtual drag beside it", blocks=(Paragraph(text=f"{text}.", brief=True), table))


def _drags_beside(design: GainDesign, run: ContactResult, drag: float, beside: ContactResult) -> Rows:
    """Return the optimal gain, the drag of the same excursion, and that of the same contact speed."""
    scenario, sensor = design.scenario, design.sensor
    columns = {"the optimal gain": run, f"same excursion, {DRAG.number.equals(drag)}": beside}
    if not _push(scenario):
        ratio = float(run.end.relative_velocity) / float(scenario.relative_velocity)
        weak, _ = DragEffect(ratio=ratio).drag(sensor, float(scenario.distance), float(scenario.admittance.mass))
        columns[f"same contact speed, {DRAG.number.equals(weak)}"] = DRAG.contact(scenario, sensor, weak)
    note = (
        "The virtual drag is another law, F = \u2212\u03c6 s\u2032\u00b2 while s = ln \u03be grows, else 0 "
        "(docs/drag.md), predicted under the same assumptions and with the admittance's pull held off while the object "
        "approaches. Its excursion is the same at every speed, also at low ones, where this gain may give way less."
    )
    rows = tuple(_compared(scenario, design.impact, *columns.values()))
    return Rows(head=("", *columns), rows=rows, note=note)
