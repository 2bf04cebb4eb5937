"""Build the report on a designed virtual drag."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.blocks import Cell, Listing, Measured, Page, PageSection, PageTable, Picture
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity, pretty_unit
from pretouch._core.vocabulary import unit_of, words_for
from pretouch._core.warning_codes import caution
from pretouch.motion import DAMPER, DRAG, ContactResult, Scenario
from pretouch.motion.page_sections import inputs_section, method_section

from ..front.physical_bound import find_physical_bound, why_no_bound
from ..gain import GainDesign, design_gain
from ..impact import ImpactModel, impact_rows
from ..page_sentences import limit_in_words, verify_step
from ..quantities import contact_value
from .limits import DragEffect
from .result import ROUNDING, DragDesign

Row = tuple[Cell, ...]

_SPEEDS: Final = (0.05, 0.1, 0.3, 1.0)
_PUSHES: Final = (0.0, 0.5, 1.0, 2.0, 5.0)
_DISTANCES: Final = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
_SEARCHED: Final = (100.0, 1e-3)  # bounds of D_p, relative to the gain that would cancel the momentum M v until contact
_COMPARED: Final = {
    "relative_velocity": "contact speed",
    "displacement": "excursion",
    "largest_acceleration": "largest acceleration",
    "time": "time",
}
_OF_IMPACT: Final = {"drive_force": "drive force", "impact_force": "impact force"}
_UNIFORM: Final = (
    "For uniform approaches. With the drag, the share of the speed that remains and the excursion are the same at "
    "every speed. The acceleration grows with the square of the speed."
)
_BOUND: Final = (
    "The bound holds for any motion of the object after detection under two conditions: at detection, it is at most as "
    "fast as in this encounter; and its acceleration toward the plant never exceeds the limit. The acceleration of the "
    "reference counts as part of this acceleration, and so does the return of the plant unless it is suspended. The "
    "bound also holds for an object that turns around and returns."
)
_DETECTED: Final = (
    "Effects of the same drag at other detection distances. The smallest distance has the fastest contact and the "
    "largest distance has the largest excursion, so the two ends bound the effects. An object that stops nearby and "
    "starts again counts as detected where it stopped."
)


def drag_page(design: DragDesign) -> Page:
    """Return the report of a virtual drag design."""
    task, run = design.designed_task, design.result
    acceleration = push_of(design.scenario)
    warnings = [*task.start_warnings(design.drag), *task.warnings]
    if acceleration:
        warnings.append(
            caution(
                "PT311",
                f"the object accelerates {('toward' if acceleration > 0 else 'away from')} the robot at "
                f"{pretty_unit(format_quantity(abs(acceleration), 'm/s^2'))}, but the virtual drag was designed for a "
                "constant velocity: use the bound `contact_speed_bound`",
            )
        )
    if -float(design.scenario.relative_velocity) > design.largest_speed:
        warnings.append(
            caution(
                "PT311",
                "the virtual drag was designed for approach speeds up to "
                f"{format_quantity(design.largest_speed, 'm/s')}, but this object approaches at "
                f"{format_quantity(-float(design.scenario.relative_velocity), 'm/s')}",
            )
        )
    return Page(
        kind="Drag of preemptive impact mitigation",
        headline=design.headline,
        status="drag found" if design.holds else "a limit is exceeded" if run.reached else "no contact",
        good=design.holds,
        key_figures=tuple(_key_figures(design, run)),
        warnings=tuple(warnings),
        findings=tuple(_findings(design, run)),
        next_step=verify_step(task),
        lead="drag",
        blocks=(
            _contact(design, run),
            _limits(design, run) if task.limits else None,
            _speeds(design),
            _figure(design),
            _guarantee(design),
            _detection(design),
            inputs_section(design.scenario, design.sensor, _chosen_by(design), *impact_rows(task.impact)),
            method_section(run.method, design.sensor),
        ),
    )


def _findings(design: DragDesign, run: ContactResult) -> Iterator[str]:
    """Yield one sentence on each limited quantity of the task."""
    for c in design.designed_task.limits:
        value = abs(float(c.magnitude(run.end, design.designed_task.impact)))
        entry = design.law.number.entry(c.quantity)
        yield limit_in_words(entry.words, value, c.limit, entry.unit, met=value <= c.limit * (1 + ROUNDING))


def letters_optimum(design: DragDesign) -> GainDesign | None:
    """Design the optimal virtual damper to compare with a drag.

    Both apply to the encounter of the drag design.

    Args:
        design: the drag of a task.

    Returns:
        The optimal gain; None without an objective or without a feasible gain. It is searched within the task's
        bounds if they are bounds of D_p, else within wide bounds.
    """
    task = design.designed_task
    if task.objective is None:
        return None
    bounds = task.bounds
    if bounds is None or task.law != DAMPER:
        near, far = (float(design.sensor.log_output(d)) for d in (0.0, design.detection_distance))
        unit = design.mass * abs(float(design.scenario.relative_velocity)) / (near - far)  # impulse of L(2)
        bounds = (-_SEARCHED[0] * unit, -_SEARCHED[1] * unit)
    limits = tuple(c for c in task.limits if c.quantity != "gain" or task.law == DAMPER)
    optimum = design_gain(
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
    return None if optimum.result is None else optimum


def speeds_of(design: DragDesign) -> tuple[float, float, float]:
    """Return the approach speeds [m/s] of a drag report.

    They are the lowest and the highest speed, and the speed of the task.
    """
    speed = -float(design.scenario.relative_velocity)
    top = design.largest_speed if math.isfinite(design.largest_speed) else _SPEEDS[-1]
    return min(_SPEEDS[0], speed), max(top, speed), speed


def at_speeds(scenario: Scenario, speed: FloatArray) -> Scenario:
    """Return copies of an encounter with other approach speeds [m/s].

    The object moves with constant speed.
    """
    velocity, acceleration = scenario.plant.velocity - speed, scenario.reference.acceleration
    return replace(scenario, obstacle=replace(scenario.obstacle, velocity=velocity, acceleration=acceleration))


def push_of(scenario: Scenario) -> float:
    """Return the object's acceleration toward the robot [m/s^2].

    It is relative to the reference motion.
    """
    return float(scenario.reference.acceleration - scenario.obstacle.acceleration)


def _key_figures(design: DragDesign, run: ContactResult) -> Iterator[tuple[str, Cell]]:
    yield DRAG.number.label, Measured(design.drag, DRAG.number.unit)
    yield "share of any approach speed", f"{100 * design.ratio:.3g} %"
    for words, unit, (value,) in _quantities(design.designed_task.impact, run):
        yield words, Measured(value, unit, 3)


def _contact(design: DragDesign, run: ContactResult) -> PageSection:
    letter, rest = letters_optimum(design), DRAG.contact(design.scenario, design.sensor, 0.0)
    columns = {"without mitigation": rest, DRAG.number.equals(design.drag): run}
    if letter is not None and letter.result is not None:
        columns[f"the letter's optimum, {DAMPER.number.equals(letter.gain or 0.0)}"] = letter.result
    rows = [*compared_rows(design.scenario, design.designed_task.impact, *columns.values())]
    place = ("", Measured(float(design.peak_distance), "m"), "")[: len(columns)]
    if not push_of(design.scenario):
        rows.insert(4, ("distance of the largest acceleration", *place))
    note = (
        "Predicted magnitudes, not measured. The excursion is the one at contact; the plant retreats further later. "
        "The smallest possible excursion is that of an ideal robot with the same largest acceleration and the same "
        "contact speed."
    )
    return PageSection(
        title="The contact",
        blocks=(PageTable(head=("", *columns), rows=tuple(rows), note=note, brief=True),),
        opened=True,
    )


def compared_rows(scenario: Scenario, impact: ImpactModel | None, *runs: ContactResult) -> Iterator[Row]:
    """Yield table rows that compare the contact quantities of several encounters."""
    speed = abs(float(scenario.relative_velocity))
    for words, unit, values in _quantities(impact, *runs):
        yield words, *(Measured(v, unit) for v in values)
        if words == "contact speed":
            yield "share of the approach speed", *(f"{100 * v / speed:.3g} %" for v in values)
    if not why_no_bound(scenario):
        yield (
            "relative to the smallest possible excursion",
            *(Measured(_excursion_over_bound(scenario, r), "", 3) for r in runs),
        )


def _quantities(impact: ImpactModel | None, *runs: ContactResult) -> Iterator[tuple[str, str, list[float]]]:
    """Yield name, unit and magnitudes of each contact quantity of several encounters."""
    for name, words in {**_COMPARED, **(_OF_IMPACT if impact is not None else {})}.items():
        yield words, unit_of(name), [abs(float(contact_value(name, run.end, impact))) for run in runs]


def _excursion_over_bound(scenario: Scenario, run: ContactResult) -> float:
    """Return the excursion relative to the smallest possible excursion. NaN if the smallest excursion is unknown."""
    limit = float(run.end.largest_acceleration)
    if not run.reached or not limit > 0 or not float(run.end.displacement) < 0:
        return math.nan
    least = find_physical_bound(scenario, acceleration_limit=limit).excursion(abs(float(run.end.relative_velocity)))
    return float(abs(run.end.displacement) / least) if least > 0 else math.nan


def _limits(design: DragDesign, run: ContactResult) -> PageSection:
    def row(limit: Any) -> Row:
        if limit.quantity == "gain":
            return "gain", "", Measured(limit.limit, limit.unit), "does not apply: a limit of D_p"
        value = float(limit.magnitude(run.end, design.designed_task.impact))
        state = "met" if design.keeps(limit) else "exceeded"
        return words_for(limit.quantity), Measured(value, limit.unit), Measured(limit.limit, limit.unit), state

    table = PageTable(
        head=("constraint", "value", "limit", "state"), rows=tuple(map(row, design.designed_task.limits)), brief=True
    )
    return PageSection(title="Constraints", blocks=(table,), opened=True)


def _speeds(design: DragDesign) -> PageSection:
    low, high, speed = speeds_of(design)
    speeds = np.array(sorted({speed, high, *(v for v in _SPEEDS if low <= v <= high)}))
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
        head, columns = _add_letter_columns(design, letter, head, columns, at_speeds(design.scenario, speeds))
    rows = zip(*([Measured(float(v), unit) for v in values] for values, unit in columns), strict=True)
    table = PageTable(head=tuple(head), rows=tuple(rows), note=_UNIFORM, brief=True)
    return PageSection(title="Effect at every approach speed", titled=True, blocks=(table,))


def _add_letter_columns(
    design: DragDesign, letter: GainDesign, head: list[str], columns: list[tuple[Any, str]], starts: Scenario
) -> tuple[list[str], list[tuple[Any, str]]]:
    """Add table columns for the optimal virtual damper."""
    end = DAMPER.contact(starts, design.sensor, letter.gain).end
    names = ("relative_velocity", "displacement", "largest_acceleration")
    more = [(np.abs(getattr(end, name)), unit_of(name)) for name in names]
    return [*head, *(f"letter: {words}" for words in head[1:4])], [*columns, *more]


def _figure(design: DragDesign) -> PageSection:
    caption = (
        "First plot: share of the speed that remains at contact over the excursion, for all drags and the chosen one. "
        "With an objective, it also shows the gains of the letter's law L(2) at this approach speed and the optimal "
        "gain. Other plots: effects of the chosen drag and of the optimal gain at every approach speed."
    )
    name = "Remaining share of the speed over the excursion; share, excursion and acceleration over the approach speed"
    picture = Picture(figure="drag", of=design, name=name, caption=caption)
    return PageSection(title="The trade-off", blocks=(picture,))


def _guarantee(design: DragDesign) -> PageSection:
    speed, distance = -float(design.scenario.relative_velocity), float(design.detection_distance)
    pushes = np.array(_PUSHES)
    bound = design.contact_speed_bound(speed, pushes)
    free = np.sqrt(speed**2 + 2 * pushes * distance)
    rows = tuple(
        (Measured(a, "m/s^2"), Measured(float(w), "m/s"), Measured(float(v), "m/s"))
        for a, w, v in zip(_PUSHES, bound, free, strict=True)
    )
    head = ("acceleration of the object toward the plant, at most", "contact speed, at most", "without mitigation")
    premises = PageSection(title="Assumptions", blocks=(Listing(items=design.premises),))
    return PageSection(
        title="Guaranteed contact speed", blocks=(PageTable(head=head, rows=rows, note=_BOUND), premises)
    )


def _detection(design: DragDesign) -> PageSection:
    speed, last = -float(design.scenario.relative_velocity), float(design.sensor.valid_range[1])
    distances = np.array([d for share in _DISTANCES if (d := share * float(design.detection_distance)) <= last])
    designs = design.seen_from(distances)
    columns: list[tuple[Any, str]] = [
        (distances, "m"),
        (designs.contact_speed(speed), "m/s"),
        (designs.excursion, "m"),
        (designs.acceleration(speed), "m/s^2"),
    ]
    head = ["detection distance", "contact speed", "excursion", "largest acceleration"]
    letter = letters_optimum(design)
    if letter is not None:
        start = at_speeds(design.scenario, np.full(len(distances), speed))
        start = replace(start, obstacle=replace(start.obstacle, position=start.plant.position + distances))
        head, columns = _add_letter_columns(design, letter, head, columns, start)
    rows = zip(*([Measured(float(v), unit) for v in values] for values, unit in columns), strict=True)
    table = PageTable(head=tuple(head), rows=tuple(rows), note=_DETECTED)
    return PageSection(title="Other detection distances", blocks=(table,))


def _chosen_by(design: DragDesign) -> Row:
    name, value, unit = (design.designed_task.drag_effect or DragEffect(ratio=design.ratio)).chosen
    up_to = f", up to {format_quantity(design.largest_speed, 'm/s')}" if math.isfinite(design.largest_speed) else ""
    return f"the drag is chosen by its {name.replace('_', ' ')}", Measured(float(value), unit, suffix=up_to)
