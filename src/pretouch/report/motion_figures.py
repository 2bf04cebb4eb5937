"""Plot the motion until contact over time.

The plots show distance, position, velocity and virtual force.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeGuard

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import FloatArray
from pretouch.designs.gain import GainDesign
from pretouch.motion import ContactResult, Motion, Scenario
from pretouch.sensors import SensorModel

from .encounter_animation import Lane, lane
from .panel_figure import panel_figure
from .panels import Curve, Panel
from .style import Scale, minus, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pretouch.simulation import ClosedLoop


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMotion:
    """Time series of a simulated run until contact.

    There is one value per controller step.

    Args:
        time: t [s].
        distance: l [m].
        position: x of the plant [m].
        relative_velocity: l' [m/s].
        virtual_force: F_p [N].
        result: the contact.
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray
    relative_velocity: FloatArray
    virtual_force: FloatArray
    result: ContactResult


def loop_motion(
    loop: ClosedLoop, scenario: Scenario, sensor: SensorModel, gain: float, *, horizon: float
) -> LoopMotion:
    """Simulate an encounter with the sampled controller until contact.

    The noise is that of the first run.

    Args:
        loop: the loop.
        scenario: the encounter.
        sensor: the sensor curve.
        gain: D_p [N s].
        horizon: end of the motion [s] if there is no contact.

    Returns:
        The motion, with the moment of contact as its last sample.
    """
    result = loop(scenario, sensor, gain)
    trace = replace(loop, contact=None).run(scenario, sensor, gain).trace()
    end = result.end
    last = float(end.time) if result.reached.all() else min(horizon, float(end.time))
    before_end = trace.time < last
    relative_velocity = scenario.obstacle.velocity_at(trace.time) - trace.velocity
    columns = {
        "time": (trace.time, end.time),
        "distance": (trace.distance, end.distance),
        "position": (trace.position, end.position),
        "relative_velocity": (relative_velocity, end.relative_velocity),
        "virtual_force": (trace.virtual_force, end.virtual_force),
    }
    whole = last == end.time
    joined = {
        name: np.append(values[before_end], at) if whole else values[before_end]
        for name, (values, at) in columns.items()
    }
    return LoopMotion(**joined, result=result)


_PANELS: Final = (
    ("distance", "distance l", "m"),
    ("position", "plant position x", "m"),
    ("relative_velocity", "relative velocity l\u2032", "m/s"),
    ("virtual_force", "virtual force F\u209a", "N"),
)
_SAMPLES: Final = 160
_FAR: Final = 4.0  # limits beyond this multiple of the range of the motion are not drawn
_DOT: Final = " "  # marks the end of a curve with a dot and no text


class DrawnMotion(NamedTuple):
    """A motion to draw, with its label and line style."""

    label: str
    motion: Motion | LoopMotion
    style: int


@check_arguments
def motion(design: GainDesign) -> Figure:
    """Draw the motion until contact, with and without the designed gain.

    Args:
        design: a design of any status; without a gain, the nearest gain or a bound is drawn.

    Returns:
        Four panels over time: distance, plant position, relative velocity and virtual force, with the limits of
        the constraints.
    """
    runs = runs_of(design)
    clock = scale_for("s", max(float(run.motion.time[-1]) for run in runs))
    return panel_figure(*(_panel(design, runs, clock, what) for what in _PANELS), height=2.4)


@check_arguments
def sampled_motion(motion: Motion) -> Figure:
    """Draw distance and relative velocity of a motion as functions of time.

    Args:
        motion: one motion, as `solve_motion` returns it.

    Returns:
        Two panels.
    """
    clock = scale_for("s", float(motion.time[-1]))
    panels = []
    for name, label, unit in (_PANELS[0], _PANELS[2]):
        values = getattr(motion, name)
        scale = scale_for(unit, float(np.abs(values).max()))
        curve = Curve(x=motion.time / clock.factor, y=values / scale.factor, end=_DOT)
        panels.append(Panel(x_label=f"time [{clock.unit}]", y_label=f"{label} [{scale.unit}]", curves=[curve]))
    return panel_figure(*panels, height=2.4)


def runs_of(design: GainDesign) -> list[DrawnMotion]:
    """Compute the motions with and without the designed gain.

    A design without a gain uses the nearest gain, or else the weakest gain within its bounds.

    Args:
        design: the design.

    Returns:
        The motions on the sampled loop if the design used the loop, otherwise the motions in continuous time by the
        letter's admittance, L(1). A custom evaluation function of a user has no motion.
    """
    (low, high), number = design.bounds, design.number
    if design.gain is not None:
        gain, label = design.gain, ""
    elif design.nearest is not None:
        gain, label = float(design.nearest.gain), "nearest: "
    else:
        gain, label = (high if abs(high) < abs(low) else low), "weakest: "
    horizon = _horizon(design)
    mitigated = _solve(design, gain, design.method, horizon)
    unmitigated = _solve(design, 0.0, design.no_mitigation.method, horizon)
    return [
        DrawnMotion("no mitigation", unmitigated, 1),
        DrawnMotion(minus(f"{label}{number.plot_symbol} = {number.plot_text(gain, '#.4g')}"), mitigated, 0),
    ]


def lanes_of(design: GainDesign) -> tuple[list[Lane], SensorModel]:
    """Return the motions to animate, and the sensor curve of the design.

    The animation has one row with mitigation, and one row without mitigation.

    Args:
        design: the design.
    """
    return [
        lane(
            run.label,
            run.style,
            design.scenario.obstacle,
            time=run.motion.time,
            distance=run.motion.distance,
            relative_velocity=run.motion.relative_velocity,
            ends_with_contact=_reached(run.motion.result),
        )
        for run in runs_of(design)
    ], design.sensor


def _panel(design: GainDesign, runs: list[DrawnMotion], clock: Scale, what: tuple[str, str, str]) -> Panel:
    name, label, unit = what
    values = np.concatenate([getattr(run.motion, name) for run in runs])
    levels = _worth_drawing(_limits(design, name), values)
    scale = scale_for(unit, float(np.nanmax(np.abs([*values, *levels.values()]))))
    curves = [_curve(run, name, clock, scale, float(np.nanmax(np.abs(values)))) for run in runs]
    last = max(float(run.motion.time[-1]) for run in runs)
    time_limits = [o.limit for o in design.constraints if o.name == "time" and o.limit < 1.5 * last]
    return Panel(
        x_label=f"time [{clock.unit}]",
        y_label=f"{label} [{scale.unit}]",
        curves=[*curves, *(_reference(design, last, values, clock, scale) if name == "position" else ())],
        levels={text: at / scale.factor for text, at in levels.items()},
        positions=dict.fromkeys(["time limit"] if time_limits else [], min(time_limits, default=0.0) / clock.factor),
    )


def _curve(run: DrawnMotion, name: str, clock: Scale, scale: Scale, largest: float) -> Curve:
    """Return one quantity of a motion as a labeled curve."""
    time, values, ended = run.motion.time, np.asarray(getattr(run.motion, name)), _reached(run.motion.result)
    label, end = "", scale.text(float(values[-1]), largest=largest)
    if name == "distance":
        label = f"{run.label}\n{f'contact after {clock.text(float(time[-1]))}' if ended else 'no contact'}"
        end = _DOT if ended else ""
    return Curve(x=time / clock.factor, y=values / scale.factor, label=label, style=run.style, end=end)


def _reference(design: GainDesign, last: float, values: FloatArray, clock: Scale, scale: Scale) -> list[Curve]:
    """Return the visible part of the robot's reference motion as a curve."""
    reference, time = design.scenario.reference, np.linspace(0.0, last, 50)
    path = reference.position + (reference.velocity + reference.acceleration * time / 2) * time
    margin = 0.1 * np.ptp(values)
    visible = np.where((path >= values.min() - margin) & (path <= values.max() + margin), path, np.nan)
    if np.isnan(visible).all():
        return []
    return [Curve(x=time / clock.factor, y=visible / scale.factor, label="reference", quiet=True)]


def _horizon(design: GainDesign) -> float:
    """Return the end time of a plotted motion without contact [s]."""
    ends = [r for r in (design.result, design.nearest, design.no_mitigation) if r is not None]
    times = [float(r.end.time) for r in ends if _reached(r)]
    mass, damping = float(design.scenario.admittance.mass), float(design.scenario.admittance.damping)
    slow = 5 * mass / damping if damping > 0 else 1.0
    approach = abs(float(design.scenario.distance) / (float(design.scenario.relative_velocity) or np.inf))
    return max(times) * 1.01 if times else max(slow, 2 * approach)


def _reached(result: ContactResult) -> bool:
    return bool(result.reached.all())


def _solve(design: GainDesign, gain: float, method: str, horizon: float) -> Motion | LoopMotion:
    loop = design.problem.task.evaluate
    if loop is not None and _is_sampled(loop):
        return loop_motion(loop, design.scenario, design.sensor, gain, horizon=horizon)
    solver = method if method in {"closed-form", "integration", "uniform-motion"} else "auto"
    law = design.problem.task.law
    return law.motion(design.scenario, design.sensor, gain, method=solver, horizon=horizon, samples=_SAMPLES)


def _is_sampled(evaluate: Any) -> TypeGuard[ClosedLoop]:
    """Return True if a model of motion is the sampled loop."""
    from pretouch.simulation import ClosedLoop  # noqa: PLC0415 - only for designs with their own model of motion

    return isinstance(evaluate, ClosedLoop)


def _limits(design: GainDesign, name: str) -> dict[str, float]:
    """Return the design limits of a plotted quantity in SI units."""
    limits: dict[str, float] = {}
    reference = design.scenario.reference
    centers = {"travel": float(design.scenario.plant.position)}
    if not (reference.velocity or reference.acceleration):
        centers["excursion"] = float(reference.position)
    for outcome in design.constraints:
        if name == "position" and outcome.name in centers:
            text, center = f"{outcome.name} limit", centers[outcome.name]
        elif name in {"relative_velocity", "virtual_force"} and outcome.name == name:
            text, center = "limit at contact" if name == "relative_velocity" else "virtual force limit", 0.0
        else:
            continue
        limits |= {text: center - outcome.limit, f"upper {text}": center + outcome.limit}
    return limits


def _worth_drawing(limits: dict[str, float], values: FloatArray) -> dict[str, float]:
    """Return the design limits that are close to the plotted motion."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    reach = _FAR * max(high - low, 1e-12)
    below = abs(low) >= abs(high)
    return {text: v for text, v in limits.items() if (v < 0) == below and low - reach < v < high + reach}
