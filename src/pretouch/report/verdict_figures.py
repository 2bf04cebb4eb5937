"""Plot simulated runs and compare them with the prediction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch.designs.quantities import size_of
from pretouch.motion import ContactResult
from pretouch.simulation import SimulationResult
from pretouch.verification import LimitCheck, Verdict
from pretouch.verification.appraisal import simulated_quantity

from .panel_figure import panel_figure
from .panels import Curve, Mark, Panel
from .share_panels import outcome_panel
from .style import MOST_POINTS, Scale, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_WITH, _WITHOUT, _WORST, _PREDICTED = 0, 1, 3, 4  # palette indices: a run has the same style in all figures
_LONGEST: Final = 2.0  # times the predicted contact time: end of the plot of a run without contact
_SYMBOLS: Final = {
    "relative_velocity": "|l\u2032|",
    "largest_excursion": "|x \u2212 x_d|",
    "largest_speed": "|x\u2032|",
}


@check_arguments
def verdict(verdict: Verdict) -> Figure:
    """Draw the distributions of contact quantities in simulated runs.

    Args:
        verdict: a verdict with a gain.

    Returns:
        Panels of the speed at contact, the contact force if simulated, the largest excursion, the time of contact, and
        any other quantity with a limit. Each panel shows the share of runs in which the quantity is below a value, with
        and without mitigation on the loop. Rings are predicted values; dotted lines are limits and the required share.

    Raises:
        ResultUnavailableError: there is no gain, or no run ends in contact.
    """
    if verdict.mitigated is None or verdict.unmitigated is None:
        raise ResultUnavailableError("verdict: there is no gain, so nothing was simulated")
    panels = [_outcome_panel(verdict, name) for name in _quantities(verdict)]
    shown = [panel for panel in panels if panel is not None]
    if not shown:
        raise ResultUnavailableError("verdict: no run ends in contact, so there is nothing to draw")
    return panel_figure(*shown, height=2.75)


def _quantities(verdict: Verdict) -> list[str]:
    """Return the names of the most important quantities and of those with a limit."""
    compared = [c.name for c in verdict.comparisons]
    forces = [name for name in ("impact_force", "peak_force") if name in compared]
    names = ["relative_velocity", *forces, "largest_excursion", "time"]
    names += [c.required.constraint.quantity for c in verdict.limits if c.name != "gain"]
    unique = list(dict.fromkeys(names))
    return unique if len(unique) % 2 == 0 else list(dict.fromkeys([*unique, "largest_speed"]))


def _outcome_panel(verdict: Verdict, name: str) -> Panel | None:
    """Return a plot of the distribution of one quantity. The plot is None if no run has a value."""
    columns = [
        ("without mitigation", _WITHOUT, _magnitudes(verdict, name, verdict.unmitigated, 0.0)),
        ("with the gain", _WITH, _magnitudes(verdict, name, verdict.mitigated, verdict.gain)),
    ]
    if not any(np.isfinite(values).any() for _, _, values in columns):
        return None
    check = _limit_of(verdict, name)
    limit = None if check is None else (check.limit, check.required.probability)
    symbol = _SYMBOLS.get(name, "")
    return outcome_panel(name, columns, limit, symbol=symbol, marks=lambda scale: [*_predictions(verdict, name, scale)])


def _limit_of(verdict: Verdict, name: str) -> LimitCheck | None:
    return next((c for c in verdict.limits if c.required.constraint.quantity == name), None)


def _magnitudes(verdict: Verdict, name: str, result: SimulationResult | None, gain: float | None) -> FloatArray:
    """Return the magnitude of a quantity in every run; NaN without contact."""
    if result is None or gain is None:
        return np.empty(0)
    values = size_of(name, simulated_quantity(name, result, gain, verdict.loop, verdict.design.impact))
    return np.where(result.touched & np.isfinite(values), values, np.nan)


def _predictions(verdict: Verdict, name: str, scale: Scale) -> Iterator[Mark]:
    """Yield points at the predicted values, at a height of 50 % for a comparison with the median of the runs."""
    compared = verdict.comparison(name)
    check = _limit_of(verdict, name)
    if compared is not None:
        values = (compared.predicted, compared.predicted_unmitigated)
    else:
        values = (None if check is None else check.predicted, None)
    for value, style in zip(values, (_WITH, _WITHOUT), strict=True):
        if value is not None:
            label = "predicted" if style == _WITH else ""
            yield Mark(x=value / scale.factor, y=50.0, label=label, style=style, shape="ring")


class _Shown(NamedTuple):
    """Time series of a run, with its name and line style."""

    label: str
    style: int
    shape: Literal["dot", "ring", "square"]
    time: FloatArray
    distance: FloatArray
    relative_velocity: FloatArray
    touched: bool


@check_arguments
def verdict_run(verdict: Verdict) -> Figure:
    """Draw the predicted run and two simulated runs.

    The simulated runs have the median and the highest contact speed.

    Args:
        verdict: a verdict with a gain.

    Returns:
        Two panels over time until contact: distance and relative velocity. If no run ends in contact, the first run is
        drawn.

    Raises:
        ResultUnavailableError: there is no gain.
    """
    if verdict.gain is None or verdict.mitigated is None or verdict.predicted is None:
        raise ResultUnavailableError("verdict: there is no gain, so nothing was simulated")
    end = _shown_until(verdict, verdict.mitigated, verdict.predicted)
    shown = [
        _run_until_contact(verdict, index, label, style, end) for label, style, index in _chosen_runs(verdict.mitigated)
    ]
    shown.append(_predicted(verdict, verdict.predicted, verdict.gain, end))
    clock = scale_for("s", max(float(s.time[-1]) for s in shown))
    return panel_figure(
        _run_panel(shown, "distance", ("distance l", "m"), clock),
        _run_panel(shown, "relative_velocity", ("relative velocity l\u2032", "m/s"), clock),
        height=2.75,
    )


def _chosen_runs(result: SimulationResult) -> list[tuple[str, int, int]]:
    """Return label, line style and index of the runs to draw."""
    touched = np.flatnonzero(result.touched)
    if not len(touched):
        return [("first run", _WITH, 0)]
    speed = np.abs(np.asarray(result.relative_velocity)[touched])
    order = touched[np.argsort(speed, kind="stable")]
    median, worst = int(order[(len(order) - 1) // 2]), int(order[-1])
    if np.ptp(speed) <= 1e-9 * speed.max():
        return [("run on the loop" if result.shape == (1,) else "each run", _WITH, median)]
    return [("worst run", _WORST, worst), ("median run", _WITH, median)]


def _shown_until(verdict: Verdict, result: SimulationResult, predicted: ContactResult) -> float:
    """Return the end time of a plotted run without contact [s]."""
    distance, speed = float(verdict.scenario.distance), abs(float(verdict.scenario.relative_velocity))
    times = [distance / speed] if speed > 0 else []
    times += [float(predicted.end.time)] if predicted.reached.all() else []
    times += [float(np.nanmax(result.time))] if result.touched.any() else []
    return min(_LONGEST * max(times, default=verdict.loop.horizon), verdict.loop.horizon)


def _run_until_contact(verdict: Verdict, index: int, label: str, style: int, end: float) -> _Shown:
    """Return the time series of a run until first contact."""
    result: Any = verdict.mitigated
    trace, touched = result.trace(index), bool(result.touched[index])
    visible = trace.time < (result.time[index] if touched else end)
    time, obstacle = trace.time[visible], trace.obstacle_position[visible]
    obstacle_velocity = np.gradient(obstacle, time) if len(time) > 1 else np.full(len(time), np.nan)
    columns = [time, trace.distance[visible], obstacle_velocity - trace.velocity[visible]]
    if touched:
        last = (result.time[index], 0.0, result.relative_velocity[index])
        columns = [np.append(column, value) for column, value in zip(columns, last, strict=True)]
    indices = np.unique(np.linspace(0, len(columns[0]) - 1, min(len(columns[0]), MOST_POINTS)).round().astype(int))
    time, distance, velocity = (column[indices] for column in columns)
    return _Shown(label, style, "dot", time, distance, velocity, touched)


def _predicted(verdict: Verdict, predicted: ContactResult, gain: float, end: float) -> _Shown:
    touched = bool(predicted.reached.all())
    until = float(predicted.end.time) * (1 + 1e-6) if touched else end
    motion = verdict.law.motion(
        verdict.scenario, verdict.sensor, gain, method=predicted.method, horizon=until, samples=MOST_POINTS // 2
    )
    time, distance, velocity = (np.asarray(c) for c in (motion.time, motion.distance, motion.relative_velocity))
    return _Shown("predicted", _PREDICTED, "ring", time, distance, velocity, touched)


def _run_panel(shown: list[_Shown], name: str, label: tuple[str, str], clock: Scale) -> Panel:
    """Return a plot of one quantity over time until contact."""
    values: list[FloatArray] = [getattr(s, name) for s in shown]
    scale = scale_for(label[1], max(float(np.nanmax(np.abs(v))) for v in values))
    first = name == "distance"
    return Panel(
        x_label=f"time [{clock.unit}]",
        y_label=f"{label[0]} [{scale.unit}]",
        curves=[
            Curve(x=s.time / clock.factor, y=v / scale.factor, label=s.label if first else "", style=s.style)
            for s, v in zip(shown, values, strict=True)
        ],
        marks=[
            Mark(
                x=float(s.time[-1]) / clock.factor,
                y=float(v[-1]) / scale.factor,
                label="" if first else f"{s.label}, {scale.text(float(v[-1]))}",
                style=s.style,
                shape=s.shape,
            )
            for s, v in zip(shown, values, strict=True)
            if s.touched
        ],
    )
