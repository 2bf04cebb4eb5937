"""The picture of one run of the loop: its course beside the prediction and without mitigation, and its contact."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import FloatArray
from pretouch.motion import ContactResult, ContactStatus
from pretouch.simulation import LoopTrace, SimulationResult
from pretouch.verification import SimulatedEncounter

from .panel_figure import panel_figure
from .panels import Curve, Mark, Panel
from .style import Scale, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_LOOP, _NONE, _PREDICTED = 0, 1, 4  # places in the palette: the same run looks the same in every panel
_MOST: Final = 900  # points of a curve: about two per pixel
_AIR: Final = 1.05
_AFTER: Final = 0.1  # of the time of contact, for which a contact that lasts is followed
_LONGEST: Final = 3.0  # times the contact of the loop, up to where a later one is shown
_SETTLED: Final = 0.02  # of the approach, from which a run without contact counts as at its nearest
_BEFORE: Final = 0.06  # of the contact, shown before its touch
_FIRST: Final = 1.6  # times the duration of the impact, up to where a contact that lasts is shown in detail


class _Course(NamedTuple):
    """One curve of every panel: its name, its look, and its columns in SI over its own time [s]."""

    label: str
    style: int
    columns: dict[str, tuple[FloatArray, FloatArray]]


@check_arguments
def simulation(encounter: SimulatedEncounter) -> Figure:
    """Draw one run of the loop beside the prediction and beside the run without mitigation.

    Args:
        encounter: what `simulate_encounter` returned, however it ended.

    Returns:
        Panels over one time axis: distance, relative velocity, virtual force, and the readings that the law was handed
        beside the output of an ideal sensor, with the moments of detection and contact; with a contact model also the
        contact force over the same time, and from the first touch on in milliseconds.
    """
    end = _shown_until(encounter)
    clock = scale_for("s", end)
    courses = [_unmitigated_course(encounter), _loop_course(encounter)]
    if encounter.prediction is not None and encounter.prediction.status is not ContactStatus.UNRESOLVED:
        courses.append(_predicted_course(encounter))
    panels = [_panel(encounter, courses, which, clock, end) for which in _PANELS]
    if encounter.has_contact_force and (encounter.run.touched or encounter.unmitigated.touched):
        panels += [_panel(encounter, courses, _FORCE, clock, end), _impact_panel(encounter)]
    return panel_figure(*panels, height=2.75)


_PANELS: Final = (
    ("distance", "distance l", "m"),
    ("relative_velocity", "relative velocity l\u2032", "m/s"),
    ("virtual_force", "virtual force F\u209a", "N"),
    ("reading", "sensor reading", "unit of \u03be"),
)
_FORCE: Final = ("contact_force", "contact force", "N")


def _shown_until(encounter: SimulatedEncounter) -> float:
    """Return the time [s] up to which a run is shown: beyond its contacts, or beyond where it came nearest."""
    run = encounter.run
    others: tuple[ContactResult | SimulationResult | None, ...] = (encounter.prediction, encounter.unmitigated)
    times = [t for t in map(_contact_time, others) if t is not None]
    if not run.touched:
        distance = encounter.trace.distance
        settled = distance <= distance.min() + _SETTLED * (distance[0] - distance.min())
        nearest = float(encounter.trace.time[int(settled.argmax())])
        free = abs(float(encounter.scenario.distance) / (float(encounter.scenario.relative_velocity) or np.inf))
        return float(min(_AIR * max(2 * nearest, 2 * free, *times, encounter.loop.law.period), run.end_time))
    last = [c.time + min(c.duration or 0.0, _AFTER * run.time) for c in encounter.contacts]
    return _AIR * float(max(*last, *(min(t, _LONGEST * run.time) for t in times)))


def _contact_time(result: ContactResult | SimulationResult | None) -> float | None:
    """Return the time of contact [s], None without one."""
    if isinstance(result, SimulationResult):
        return float(result.time) if result.touched else None
    return None if result is None or not result.reached.all() else float(result.end.time)


def _loop_course(encounter: SimulatedEncounter) -> _Course:
    return _Course("on the loop", _LOOP, _columns_of(encounter, encounter.run, encounter.trace))


def _unmitigated_course(encounter: SimulatedEncounter) -> _Course:
    """Return the run without mitigation until its first contact: what comes then is told by the contact panel."""
    run, trace = encounter.unmitigated, encounter.unmitigated_trace
    columns = _columns_of(encounter, run, trace)
    until = run.time if run.touched else run.end_time
    kept = {k: (t[t <= until], v[t <= until]) for k, (t, v) in columns.items() if k != "contact_force"}
    return _Course("no mitigation", _NONE, {**kept, "contact_force": columns["contact_force"]})


def _columns_of(
    encounter: SimulatedEncounter, run: SimulationResult, trace: LoopTrace
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return the columns of a run, with what the integration knows of its contacts between the steps of the law."""
    time, course = trace.time, trace.contact_course
    touch = (run.time, 0.0, run.relative_velocity, 0.0) if run.touched else None
    extra = course if len(course) else np.array([touch] if touch else np.empty((0, 4)))
    moments = np.concatenate([time, extra[:, 0]])
    order = np.argsort(moments, kind="stable")
    parts = {
        "distance": (trace.distance, extra[:, 1]),
        "relative_velocity": (_relative_velocity(encounter, run, trace), extra[:, 2]),
        "contact_force": (trace.contact_force, extra[:, 3]),
    }
    joined = {name: (moments[order], np.concatenate(pair)[order]) for name, pair in parts.items()}
    period = encounter.loop.law.period
    held = {name: _held(time, values, period) for name, values in _held_columns(trace).items()}
    return {**joined, **held}


def _held_columns(trace: LoopTrace) -> dict[str, FloatArray]:
    """Return what stays the same over a period of the law; before the first reading there is none."""
    reading = trace.reading.copy()
    reading[: int((reading != 0.0).argmax()) if (reading != 0.0).any() else 0] = np.nan
    return {"virtual_force": trace.virtual_force, "reading": reading}


def _held(time: FloatArray, values: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    return np.column_stack([time, time + period]).ravel(), np.repeat(values, 2)


def _relative_velocity(encounter: SimulatedEncounter, run: SimulationResult, trace: LoopTrace) -> FloatArray:
    """Return l' at each step: that of the obstacle is given until a contact may move it, and then a difference."""
    given = encounter.scenario.obstacle.velocity_at(trace.time)
    contact = encounter.loop.contact
    moved = trace.time > run.time if contact is not None and np.isfinite(contact.obstacle_mass) else None
    if moved is not None and moved.any() and len(trace.time) > 1:
        given = np.where(moved, np.gradient(trace.obstacle_position, trace.time), given)
    return np.asarray(given - trace.velocity)


def _predicted_course(encounter: SimulatedEncounter) -> _Course:
    motion = encounter.motion
    low, high = encounter.sensor.valid_range
    output = np.exp(np.asarray(encounter.sensor.log_output(np.clip(motion.distance, low, high))))
    seen = np.where(motion.distance <= high, output, 0.0)
    columns = {name: (motion.time, np.asarray(getattr(motion, name))) for name in _SOLVED}
    offset = encounter.loop.chain.offset + encounter.loop.chain.crosstalk
    return _Course("predicted", _PREDICTED, {**columns, "reading": (motion.time, seen + offset)})


_SOLVED: Final = ("distance", "relative_velocity", "virtual_force")


def _panel(
    encounter: SimulatedEncounter, courses: list[_Course], which: tuple[str, str, str], clock: Scale, end: float
) -> Panel:
    """Make one panel over the shared time; the names of the curves stand in the first."""
    name, label, unit = which
    shown = [(c, *_window(*c.columns[name], end)) for c in courses if name in c.columns]
    shown = [(c, t, v) for c, t, v in shown if np.isfinite(v).any()]
    scale = Scale(1.0, unit) if name == "reading" else scale_for(unit, max(_largest(v) for _, _, v in shown))
    first = name == "distance"
    curves = [
        Curve(x=t / clock.factor, y=v / scale.factor, label=c.label if first else "", style=c.style)
        for c, t, v in shown
    ]
    return Panel(
        x_label=f"time [{clock.unit}]",
        y_label=f"{label} [{scale.unit}]",
        curves=curves,
        marks=list(_marks(encounter, name, clock, scale, end)),
        positions=_positions(encounter, clock, end),
        x_limits=(0.0, end / clock.factor),
    )


def _largest(values: FloatArray) -> float:
    return float(np.nanmax(np.abs(values)))


def _window(time: FloatArray, values: FloatArray, end: float) -> tuple[FloatArray, FloatArray]:
    """Cut a column at the end of the picture, and keep the extremes of more points than it can show."""
    kept = time <= end
    time, values = time[kept], np.where(np.isfinite(values[kept]), values[kept], np.nan)
    if len(time) <= _MOST:
        return time, values
    groups = np.array_split(np.arange(len(time)), _MOST // 2)
    filled = np.where(np.isnan(values), 0.0, values)
    both = [sorted({int(g[filled[g].argmin()]), int(g[filled[g].argmax()])}) for g in groups]
    chosen = np.unique([0, *(i for pair in both for i in pair), len(time) - 1])
    return time[chosen], values[chosen]


def _marks(encounter: SimulatedEncounter, name: str, clock: Scale, scale: Scale, end: float) -> Iterator[Mark]:
    """Yield the moments that matter: the detection with its distance, and the contacts with their speeds."""
    run, seen = encounter.run, encounter.detection
    if name == "distance" and seen is not None and seen.time <= end:
        text = f"first seen at {scale.text(seen.distance)}"
        yield Mark(x=seen.time / clock.factor, y=seen.distance / scale.factor, label=text, style=_LOOP, shape="ring")
    if name == "relative_velocity":
        ends: tuple[tuple[Any, int, Literal["dot", "ring", "square"]], ...] = (
            (encounter.unmitigated, _NONE, "square"),
            (encounter.prediction, _PREDICTED, "ring"),
            (run, _LOOP, "dot"),
        )
        for result, style, shape in ends:
            time = _contact_time(result)
            if time is not None and time <= end:
                state: Any = result if isinstance(result, SimulationResult) else result.end
                value = float(state.relative_velocity)
                x, y = time / clock.factor, value / scale.factor
                yield Mark(x=x, y=y, label=scale.text(value), style=style, shape=shape)


def _positions(encounter: SimulatedEncounter, clock: Scale, end: float) -> dict[str, float]:
    """Return the moments of detection and contact on the loop, as far as they are in the picture."""
    run, seen = encounter.run, encounter.detection
    found = {}
    if seen is not None and 0.01 * end < seen.time <= end:
        found["first seen"] = seen.time / clock.factor
    if run.touched:
        found["contact"] = run.time / clock.factor
    return found


def _impact_panel(encounter: SimulatedEncounter) -> Panel:
    """Draw the force of the first contact from its touch on, with the gain and without."""
    runs = [
        ("no mitigation", _NONE, encounter.unmitigated, encounter.unmitigated_trace),
        ("on the loop", _LOOP, encounter.run, encounter.trace),
    ]
    found = [(label, style, run, trace) for label, style, run, trace in runs if run.touched]
    end = max(_impact_end(trace) for *_, trace in found)
    shown = [(label, style, *_impact(trace, end)) for label, style, _, trace in found]
    clock, scale = Scale(1e-3, "ms"), scale_for("N", max(float(force.max()) for *_, force in shown))
    curves, marks = [], []
    for label, style, time, force in shown:
        t, f = _window(time, force, end)
        curves.append(Curve(x=t / clock.factor, y=f / scale.factor, label=label, style=style))
        at = int(force.argmax())
        text = scale.text(float(force[at]))
        marks.append(Mark(x=time[at] / clock.factor, y=force[at] / scale.factor, label=text, style=style))
    return Panel(
        x_label="time since the first touch [ms]",
        y_label=f"contact force [{scale.unit}]",
        curves=curves,
        marks=marks,
        x_limits=(-_BEFORE * end / clock.factor, end / clock.factor),
    )


def _impact_end(trace: LoopTrace) -> float:
    """Return up to when the first contact is shown [s]: beyond its end, or beyond the impact of one that lasts."""
    mine, first = _first_contact(trace), trace.contacts[0]
    if np.isfinite(first[4]):
        return float(_AIR * first[5])
    together = mine[:, 2] >= 0
    turned = mine[int(together.argmax()), 0] if together.any() else mine[-1, 0]
    return float(min(_FIRST * (turned - first[0]), first[5]))


def _impact(trace: LoopTrace, end: float) -> tuple[FloatArray, FloatArray]:
    """Return time since the first touch [s] and the force of the first contact [N], and none before and after it."""
    mine, first = _first_contact(trace), trace.contacts[0]
    time = np.concatenate([[-_BEFORE * end, 0.0], mine[:, 0] - first[0]])
    force = np.concatenate([[0.0, 0.0], mine[:, 3]])
    return (np.append(time, end), np.append(force, 0.0)) if time[-1] < end else (time[time <= end], force[time <= end])


def _first_contact(trace: LoopTrace) -> FloatArray:
    course, first = trace.contact_course, trace.contacts[0]
    return np.asarray(course[course[:, 0] <= first[0] + first[5] + 1e-12])
