"""Plot a simulated encounter and compare it with the prediction.

The same encounter without mitigation is plotted as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import FloatArray
from pretouch.motion import ContactResult, ContactStatus
from pretouch.sensors import SensorModel
from pretouch.simulation import LoopTrace, SimulationResult
from pretouch.verification import SimulatedEncounter

from .encounter_animation import Lane, lane
from .panel_figure import panel_figure
from .panels import Curve, Mark, Panel, containing
from .style import MOST_POINTS, Scale, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_LOOP, _NONE, _PREDICTED = 0, 1, 4  # palette indices: a run has the same style in all panels
_AIR: Final = 1.05
_AFTER: Final = 0.1  # of the time of contact: how long a persistent contact is shown
_LONGEST: Final = 3.0  # times the contact time on the loop: later contacts are not shown
_SETTLED: Final = 0.02  # of the approach: tolerance of the smallest distance of a run without contact
_BEFORE: Final = 0.06  # of the shown time of the contact: time that is shown before the contact
_FIRST: Final = 1.6  # times the duration of the impact: how long a persistent contact is shown in detail


class _TimeSeries(NamedTuple):
    """Time series of one run in SI units, with its name."""

    label: str
    style: int
    columns: dict[str, tuple[FloatArray, FloatArray]]


@check_arguments
def simulation(encounter: SimulatedEncounter) -> Figure:
    """Draw a simulated encounter, its prediction, and the same encounter without mitigation.

    Args:
        encounter: a result of `simulate`, with any status.

    Returns:
        Panels over the same time axis: distance, relative velocity, virtual force, and the readings of the law compared
        with the output of an ideal sensor, with the moments of detection and contact. With a contact model, one more
        panel shows the contact force over the same time axis, and another panel shows the force of the first contact.
    """
    end = _shown_until(encounter)
    clock = scale_for("s", end)
    runs = [_unmitigated_series(encounter), _loop_series(encounter)]
    if encounter.prediction.status is not ContactStatus.UNRESOLVED:
        runs.append(_predicted_series(encounter))
    panels = [_panel(encounter, runs, which, clock, end) for which in _PANELS]
    if encounter.has_contact_force and (encounter.run.touched or encounter.unmitigated.touched):
        panels += [_panel(encounter, runs, _FORCE, clock, end), _impact_panel(encounter)]
    return panel_figure(*panels, height=2.75)


def simulated_lanes(encounter: SimulatedEncounter) -> tuple[list[Lane], SensorModel]:
    """Return the runs to animate, and the sensor curve of the encounter.

    The animation has one row with mitigation, and one row without mitigation. Each row ends with the first contact.

    Args:
        encounter: a result of `simulate`.
    """
    end = _shown_until(encounter)
    runs = ((_unmitigated_series(encounter), encounter.unmitigated), (_loop_series(encounter), encounter.run))
    return [_lane_until_contact(encounter, series, run, end) for series, run in runs], encounter.sensor


def _lane_until_contact(encounter: SimulatedEncounter, series: _TimeSeries, run: SimulationResult, end: float) -> Lane:
    touched = bool(run.touched) and float(run.time) <= end
    (time, distance), (_, speed) = series.columns["distance"], series.columns["relative_velocity"]
    shown = time <= (float(run.time) if touched else end)
    return lane(
        series.label,
        series.style,
        encounter.scenario.obstacle,
        time=time[shown],
        distance=distance[shown],
        relative_velocity=speed[shown],
        ends_with_contact=touched,
    )


_PANELS: Final = (
    ("distance", "distance l", "m"),
    ("relative_velocity", "relative velocity l\u2032", "m/s"),
    ("virtual_force", "virtual force F\u209a", "N"),
    ("reading", "sensor reading", "unit of \u03be"),
)
_FORCE: Final = ("contact_force", "contact force", "N")


def _shown_until(encounter: SimulatedEncounter) -> float:
    """Return the end of the plot's time axis [s]."""
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
    """Return the time of contact [s]; None without contact."""
    if isinstance(result, SimulationResult):
        return float(result.time) if result.touched else None
    return None if result is None or not result.reached.all() else float(result.end.time)


def _loop_series(encounter: SimulatedEncounter) -> _TimeSeries:
    return _TimeSeries("on the loop", _LOOP, _columns_of(encounter, encounter.run, encounter.trace))


def _unmitigated_series(encounter: SimulatedEncounter) -> _TimeSeries:
    """Return the time series of the run without mitigation.

    The contact force is not cut, because the panel of the contact shows the whole force.
    """
    run, trace = encounter.unmitigated, encounter.unmitigated_trace
    columns = _columns_of(encounter, run, trace)
    until = run.time if run.touched else run.end_time
    cut = {k: (t[t <= until], v[t <= until]) for k, (t, v) in columns.items() if k != "contact_force"}
    return _TimeSeries("no mitigation", _NONE, {**cut, "contact_force": columns["contact_force"]})


def _columns_of(
    encounter: SimulatedEncounter, run: SimulationResult, trace: LoopTrace
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return each plotted quantity of a run as a time series."""
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
    steps = {name: _step_curve(time, values, period) for name, values in _step_columns(trace).items()}
    return {**joined, **steps}


def _step_columns(trace: LoopTrace) -> dict[str, FloatArray]:
    """Return virtual force and sensor reading at each controller step. Readings are NaN before the first one."""
    reading = trace.reading.copy()
    reading[: int((reading != 0.0).argmax()) if (reading != 0.0).any() else 0] = np.nan
    return {"virtual_force": trace.virtual_force, "reading": reading}


def _step_curve(time: FloatArray, values: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    """Convert sampled values to the points of a step curve."""
    return np.column_stack([time, time + period]).ravel(), np.repeat(values, 2)


def _relative_velocity(encounter: SimulatedEncounter, run: SimulationResult, trace: LoopTrace) -> FloatArray:
    """Return the velocity of the obstacle relative to the robot.

    This also holds after contact has moved the obstacle. The obstacle's velocity is then a difference quotient.
    """
    obstacle_velocity = encounter.scenario.obstacle.velocity_at(trace.time)
    contact = encounter.loop.contact
    moved = trace.time > run.time if contact is not None and np.isfinite(contact.obstacle_mass) else None
    if moved is not None and moved.any() and len(trace.time) > 1:
        obstacle_velocity = np.where(moved, np.gradient(trace.obstacle_position, trace.time), obstacle_velocity)
    return np.asarray(obstacle_velocity - trace.velocity)


def _predicted_series(encounter: SimulatedEncounter) -> _TimeSeries:
    motion = encounter.motion
    low, high = encounter.sensor.valid_range
    output = np.exp(np.asarray(encounter.sensor.log_output(np.clip(motion.distance, low, high))))
    reading = np.where(motion.distance <= high, output, 0.0)
    columns = {name: (motion.time, np.asarray(getattr(motion, name))) for name in _SOLVED}
    offset = encounter.loop.chain.offset + encounter.loop.chain.crosstalk
    return _TimeSeries("predicted", _PREDICTED, {**columns, "reading": (motion.time, reading + offset)})


_SOLVED: Final = ("distance", "relative_velocity", "virtual_force")


def _panel(
    encounter: SimulatedEncounter, runs: list[_TimeSeries], which: tuple[str, str, str], clock: Scale, end: float
) -> Panel:
    """Return a plot of one quantity over time."""
    name, label, unit = which
    shown = [(c, *thin_out(*c.columns[name], end)) for c in runs if name in c.columns]
    shown = [(c, t, v) for c, t, v in shown if np.isfinite(v).any()]
    scale = Scale(1.0, unit) if name == "reading" else scale_for(unit, max(_largest(v) for _, _, v in shown))
    first = name == "distance"
    curves = [
        Curve(x=t / clock.factor, y=v / scale.factor, label=c.label if first else "", style=c.style)
        for c, t, v in shown
    ]
    return containing(
        x_label=f"time [{clock.unit}]",
        y_label=f"{label} [{scale.unit}]",
        curves=curves,
        marks=list(_marks(encounter, name, clock, scale, end)),
        positions=_positions(encounter, clock, end),
        x_limits=(0.0, end / clock.factor),
    )


def _largest(values: FloatArray) -> float:
    return float(np.nanmax(np.abs(values)))


def thin_out(time: FloatArray, values: FloatArray, end: float) -> tuple[FloatArray, FloatArray]:
    """Remove points from a time series, but keep its extremes.

    Returns:
        Time and values until the end of the plot.
    """
    visible = time <= end
    time, values = time[visible], np.where(np.isfinite(values[visible]), values[visible], np.nan)
    if len(time) <= MOST_POINTS:
        return time, values
    groups = np.array_split(np.arange(len(time)), MOST_POINTS // 2)
    filled = np.where(np.isnan(values), 0.0, values)
    both = [sorted({int(g[filled[g].argmin()]), int(g[filled[g].argmax()])}) for g in groups]
    chosen = np.unique([0, *(i for pair in both for i in pair), len(time) - 1])
    return time[chosen], values[chosen]


def _marks(encounter: SimulatedEncounter, name: str, clock: Scale, scale: Scale, end: float) -> Iterator[Mark]:
    """Yield points that mark detection and contact in a plot."""
    run, detection = encounter.run, encounter.detection
    if name == "distance" and detection is not None and detection.time <= end:
        text = f"detected at {scale.text(detection.distance)}"
        yield Mark(
            x=detection.time / clock.factor, y=detection.distance / scale.factor, label=text, style=_LOOP, shape="ring"
        )
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
    """Return the visible times of detection and contact."""
    run, detection = encounter.run, encounter.detection
    moments = {}
    if detection is not None and 0.01 * end < detection.time <= end:
        moments["detection"] = detection.time / clock.factor
    if run.touched:
        moments["contact"] = run.time / clock.factor
    return moments


def _impact_panel(encounter: SimulatedEncounter) -> Panel:
    """Return a plot of the force during the first contact."""
    runs = [
        ("no mitigation", _NONE, encounter.unmitigated, encounter.unmitigated_trace),
        ("on the loop", _LOOP, encounter.run, encounter.trace),
    ]
    touching = [(label, style, run, trace) for label, style, run, trace in runs if run.touched]
    end = max(_impact_end(trace) for *_, trace in touching)
    shown = [(label, style, *_impact(trace, end)) for label, style, _, trace in touching]
    clock, scale = Scale(1e-3, "ms"), scale_for("N", max(float(force.max()) for *_, force in shown))
    curves, marks = [], []
    for label, style, time, force in shown:
        t, f = thin_out(time, force, end)
        curves.append(Curve(x=t / clock.factor, y=f / scale.factor, label=label, style=style))
        at = int(force.argmax())
        text = scale.text(float(force[at]))
        marks.append(Mark(x=time[at] / clock.factor, y=force[at] / scale.factor, label=text, style=style))
    return containing(
        x_label="time since the first touch [ms]",
        y_label=f"contact force [{scale.unit}]",
        curves=curves,
        marks=marks,
        x_limits=(-_BEFORE * end / clock.factor, end / clock.factor),
    )


def _impact_end(trace: LoopTrace) -> float:
    """Return the end time of the plotted first contact [s]."""
    samples, first = _first_contact(trace), trace.contacts[0]
    if np.isfinite(first[4]):
        return float(_AIR * first[5])
    separating = samples[:, 2] >= 0
    reversal = samples[int(separating.argmax()), 0] if separating.any() else samples[-1, 0]
    return float(min(_FIRST * (reversal - first[0]), first[5]))


def _impact(trace: LoopTrace, end: float) -> tuple[FloatArray, FloatArray]:
    """Return time [s] and force [N] of the first contact."""
    samples, first = _first_contact(trace), trace.contacts[0]
    time = np.concatenate([[-_BEFORE * end, 0.0], samples[:, 0] - first[0]])
    force = np.concatenate([[0.0, 0.0], samples[:, 3]])
    return (np.append(time, end), np.append(force, 0.0)) if time[-1] < end else (time[time <= end], force[time <= end])


def _first_contact(trace: LoopTrace) -> FloatArray:
    course, first = trace.contact_course, trace.contacts[0]
    return np.asarray(course[course[:, 0] <= first[0] + first[5] + 1e-12])
