"""The panels of the motion: distance, position, relative velocity and virtual force until contact."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.design.result import GainDesign
from pretouch.motion import ContactResult, Motion, solve_motion
from pretouch.simulation import ClosedLoop

from .labels import label_near
from .loop_motion import LoopMotion, loop_motion
from .style import BASELINE, CHOSEN, LIMIT, QUIET, Scale, minus, scale_for, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Run", "draw_panels", "runs_of"]

_PANELS: Final = (
    ("distance", "distance l", "m"),
    ("position", "plant position x", "m"),
    ("relative_velocity", "relative velocity l\u2032", "m/s"),
    ("virtual_force", "virtual force F\u209a", "N"),
)
_SAMPLES: Final = 160
_FAR: Final = 4.0  # limits farther off than this many times the largest magnitude are not drawn


class _Panel(NamedTuple):
    """One panel: its axes, the quantity that it shows, and in which units it shows time and that."""

    axes: Axes
    name: str
    clock: Scale
    scale: Scale

    def curve(self, run: Run) -> tuple[FloatArray, FloatArray]:
        """Return time and quantity of a run, in the units of the panel."""
        return run.motion.time / self.clock.factor, self.values(run) / self.scale.factor

    def values(self, run: Run) -> FloatArray:
        """Return the quantity of a run, in SI."""
        return np.asarray(getattr(run.motion, self.name))


class Run(NamedTuple):
    """One motion to be drawn."""

    label: str
    motion: Motion | LoopMotion
    color: str
    style: Any
    width: float


def runs_of(design: GainDesign) -> list[Run]:
    """Solve the motions that a design is about: with the gain, or the nearest one, and without mitigation.

    Args:
        design: the design.

    Returns:
        The motions. Those of a design on the sampled loop are run on that loop; those of a design on a function of the
        user's, which gives no motion, are L(1) in continuous time.
    """
    low, high = design.bounds
    if design.gain is not None:
        gain, label = design.gain, "D\u209a = {:#.4g} N s"
    elif design.nearest is not None:
        gain, label = float(design.nearest.gain), "nearest: D\u209a = {:#.4g} N s"
    else:
        gain, label = (high if abs(high) < abs(low) else low), "weakest: D\u209a = {:#.4g} N s"
    horizon = _horizon(design)
    chosen = _solve(design, gain, design.method, horizon)
    still = _solve(design, 0.0, design.no_mitigation.method, horizon)
    return [
        Run("no mitigation", still, BASELINE, (0, (5, 1.6)), 1.5),
        Run(minus(label.format(gain)), chosen, CHOSEN, "-", 2.0),
    ]


def draw_panels(panels: list[Axes], design: GainDesign) -> None:
    """Draw the four panels."""
    runs = runs_of(design)
    clock = scale_for("s", max(float(run.motion.time[-1]) for run in runs))
    for axes, (name, label, unit) in zip(panels, _PANELS, strict=True):
        values = np.concatenate([getattr(run.motion, name) for run in runs])
        limits = _worth_drawing(_limits(design, name), values)
        scale = scale_for(unit, float(np.nanmax(np.abs([*values, *(v for v, _ in limits)]))))
        panel = _Panel(axes, name, clock, scale)
        axes.locator_params(nbins=5)
        axes.set_xlabel(f"time [{clock.unit}]")
        axes.set_ylabel(f"{label} [{scale.unit}]")
        _draw_runs(panel, runs, limits)
        _draw_limits(panel, limits)
        _draw_clock(panel, design)
        _draw_reference(panel, design, runs)
        _label_runs(panel, runs)


def _horizon(design: GainDesign) -> float:
    """Return how long to follow a motion that may never end: a few time constants, or every contact time."""
    ends = [r for r in (design.result, design.nearest, design.no_mitigation) if r is not None]
    times = [float(r.end.time) for r in ends if _reached(r)]
    mass, damping = float(design.scenario.admittance.mass), float(design.scenario.admittance.damping)
    slow = 5 * mass / damping if damping > 0 else 1.0
    approach = abs(float(design.scenario.distance) / (float(design.scenario.relative_velocity) or np.inf))
    return max(times) * 1.01 if times else max(slow, 2 * approach)


def _reached(result: ContactResult) -> bool:
    return bool(result.reached.all())


def _solve(design: GainDesign, gain: float, method: str, horizon: float) -> Motion | LoopMotion:
    loop = design.evidence.problem.evaluator
    if isinstance(loop, ClosedLoop):
        return loop_motion(loop, design.scenario, design.sensor, gain, horizon=horizon)
    known = method if method in {"closed-form", "integration", "uniform-motion"} else "auto"
    return solve_motion(design.scenario, design.sensor, gain, method=known, horizon=horizon, samples=_SAMPLES)


def _limits(design: GainDesign, name: str) -> list[tuple[float, str]]:
    """Return the limits [SI] that belong into a panel, with their names."""
    found = []
    start, reference = float(design.scenario.plant.position), design.scenario.reference
    for outcome in design.constraints:
        if name == "position" and outcome.name == "travel":
            found += [(start - outcome.limit, "travel limit"), (start + outcome.limit, "travel limit")]
        elif name == "position" and outcome.name == "excursion" and not (reference.velocity or reference.acceleration):
            center = float(reference.position)
            found += [(center - outcome.limit, "excursion limit"), (center + outcome.limit, "excursion limit")]
        elif name in {"relative_velocity", "virtual_force"} and outcome.name == name:
            text = "limit at contact" if name == "relative_velocity" else "virtual force limit"
            found += [(-outcome.limit, text), (outcome.limit, text)]
    return found


def _worth_drawing(limits: list[tuple[float, str]], values: FloatArray) -> list[tuple[float, str]]:
    """Keep the limits on the side on which the motion takes place, where they do not dwarf it."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    reach = _FAR * max(high - low, 1e-12)
    below = abs(low) >= abs(high)
    return [(v, text) for v, text in limits if (v < 0) == below and low - reach < v < high + reach]


def _draw_runs(panel: _Panel, runs: list[Run], limits: list[tuple[float, str]]) -> None:
    axes = panel.axes
    for run in runs:
        time, value = panel.curve(run)
        axes.plot(time, value, color=run.color, linestyle=run.style, linewidth=run.width, zorder=3)
        if _reached(run.motion.result):
            axes.plot(time[-1:], value[-1:], "o", color=run.color, markersize=5.5, zorder=5, clip_on=False)
    values = np.concatenate([*(panel.values(run) for run in runs), np.array([v for v, _ in limits])])
    axes.set_xlim(0, 1.04 * max(float(panel.curve(run)[0][-1]) for run in runs))
    low, high = span(values / panel.scale.factor, 0.1)
    axes.set_ylim(0 if panel.name == "distance" and low < 0 else low, high)


def _draw_limits(panel: _Panel, limits: list[tuple[float, str]]) -> None:
    left, right = panel.axes.get_xlim()
    for value, text in limits:
        at = value / panel.scale.factor
        panel.axes.axhline(at, color=LIMIT, linestyle=":", linewidth=1.2, zorder=2)
        across = left + (right - left) * np.array([0.06, 0.3, 0.5, 0.7])
        label_near(panel.axes, across, np.full(4, at), text, color=LIMIT, size=7.5)


def _draw_clock(panel: _Panel, design: GainDesign) -> None:
    """Draw the limit of the time of contact, where there is one in sight."""
    axes = panel.axes
    for outcome in design.constraints:
        at = outcome.limit / panel.clock.factor
        if outcome.name == "time" and at < axes.get_xlim()[1] * 1.5:
            axes.set_xlim(0, max(axes.get_xlim()[1], 1.04 * at))
            axes.axvline(at, color=LIMIT, linestyle=":", linewidth=1.2, zorder=2)
            low, high = axes.get_ylim()
            up = low + (high - low) * np.array([0.5, 0.3, 0.7, 0.15])
            label_near(axes, np.full(4, at), up, "time limit", color=LIMIT, size=7.5)


def _draw_reference(panel: _Panel, design: GainDesign, runs: list[Run]) -> None:
    """Draw where the task wants the plant, where that is in sight."""
    if panel.name != "position":
        return
    reference = design.scenario.reference
    time = np.linspace(0.0, max(float(run.motion.time[-1]) for run in runs), 50)
    path = reference.position + (reference.velocity + reference.acceleration * time / 2) * time
    x, y = time / panel.clock.factor, path / panel.scale.factor
    low, high = panel.axes.get_ylim()
    if np.any((y >= low) & (y <= high)):
        panel.axes.plot(x, y, color=QUIET, linewidth=0.8, zorder=1.5)
        late = [45, 40, 35, 30, 20, 10]
        label_near(panel.axes, x[late], y[late], "reference", color=QUIET, size=7.5)


def _label_runs(panel: _Panel, runs: list[Run]) -> None:
    """Name the curves in the first panel, and write the value that each has at its end in the others."""
    largest = max(float(np.abs(panel.values(run)).max()) for run in runs)
    for run in runs:
        x, y = panel.curve(run)
        if panel.name == "distance":
            end = panel.clock.text(float(run.motion.time[-1]))
            text = f"{run.label}\n" + (f"contact after {end}" if _reached(run.motion.result) else "no contact")
            places = (np.linspace(0.35, 0.85, 11) * (len(x) - 1)).astype(int)
            label_near(panel.axes, x[places], y[places], text, color=run.color, weight="bold")
        else:
            text = panel.scale.text(float(panel.values(run)[-1]), largest=largest)
            label_near(panel.axes, x[-1], y[-1], text, color=run.color)
