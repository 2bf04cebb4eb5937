"""Compare an optimal virtual damper with a virtual drag.

Both need the same excursion of the robot.
"""

from __future__ import annotations

from typing import Final

from pretouch._core.blocks import LazyBlock, PageSection, PageTable, Paragraph
from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity, pretty_unit
from pretouch.motion import DAMPER, DRAG, ContactResult

from ..gain import GainDesign
from .design import why_no_drag
from .limits import DragEffect, strongest_by_excursion
from .page import compared_rows, push_of
from .result import ROUNDING

_BETTER: Final = 0.99  # largest ratio of contact speeds at which the drag is reported as better


def drag_alternative(design: GainDesign) -> PageSection | None:
    """Compare the optimal gain with a virtual drag.

    Both need the same excursion of the robot.

    Args:
        design: the gain design of one encounter.

    Returns:
        The section; None unless the drag gives slower contact after the same excursion and meets the limits of the
        task. This can be predicted in continuous time, for a plant at rest at its reference and an object that does
        not brake.
    """
    task, run = design.problem.task, design.result
    if run is None or task.law != DAMPER or task.loop is not None or design.on_evaluator:
        return None
    scenario, sensor, push = design.scenario, design.sensor, push_of(design.scenario)
    excursion, before = -float(run.end.displacement), abs(float(run.end.relative_velocity))
    if why_no_drag(scenario) or push < 0 or not excursion > 0 or sensor.valid_range[0] > 0:
        return None
    mass, distance = float(scenario.admittance.mass), float(scenario.distance)
    speed = -float(scenario.relative_velocity)
    try:
        drag = strongest_by_excursion(sensor, distance, mass, excursion, speed, push)
        with_drag = DRAG.contact(scenario, sensor, drag, horizon=task.horizon)
    except InvalidInputError:  # ln xi does not fall all the way to contact, or no drag has such a large excursion
        return None
    limits = [c for c in task.limits if c.quantity != "gain"]
    after = abs(float(with_drag.end.relative_velocity))
    feasible = all(c.magnitude(with_drag.end, task.impact) <= c.limit * (1 + ROUNDING) for c in limits)
    if not (with_drag.reached and after < _BETTER * before and feasible):
        return None
    runs = (with_drag, run)
    accelerations = [pretty_unit(format_quantity(float(r.end.largest_acceleration), "m/s^2")) for r in runs]
    text = (
        f"With a virtual drag of {DRAG.number.equals(drag)}, the excursion would be the same. The contact speed "
        f"would be {format_quantity(after, 'm/s')} instead of {format_quantity(before, 'm/s')}. "
        f"The largest acceleration would be {accelerations[0]} instead of {accelerations[1]}."
    )
    if not push:
        text += f" With this virtual drag, the contact speed is {100 * after / speed:.3g} % of every approach speed."
    table = LazyBlock(make=lambda: _comparison(design, run, drag, with_drag))
    return PageSection(title="Comparison with the virtual drag", blocks=(Paragraph(text=text, brief=True), table))


def _comparison(design: GainDesign, run: ContactResult, drag: float, with_drag: ContactResult) -> PageTable:
    """Compare the optimal gain with virtual drags in a table."""
    scenario, sensor = design.scenario, design.sensor
    columns = {"the optimal gain": run, f"same excursion, {DRAG.number.equals(drag)}": with_drag}
    if not push_of(scenario):
        ratio = float(run.end.relative_velocity) / float(scenario.relative_velocity)
        weak, _ = DragEffect(ratio=ratio).drag(sensor, float(scenario.distance), float(scenario.admittance.mass))
        columns[f"same contact speed, {DRAG.number.equals(weak)}"] = DRAG.contact(scenario, sensor, weak)
    note = (
        "The virtual drag is another law: F = \u2212\u03c6 s\u2032\u00b2 while s = ln \u03be grows, else 0 "
        "(docs/explanation/drag.md). It is predicted under the same assumptions, with the pull of the "
        "admittance suspended while the object approaches. Its excursion is the same at every speed; with this "
        "gain, the plant may retreat less from slow objects."
    )
    rows = tuple(compared_rows(scenario, design.impact, *columns.values()))
    return PageTable(head=("", *columns), rows=rows, note=note)
