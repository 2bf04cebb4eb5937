"""The two panels of the trade-off: the objective over the gain, and the plane of what is traded."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.vocabulary import in_short, unit_of, words_for
from pretouch.design.certificate import ConstraintOutcome
from pretouch.design.page import shows_equals, traded_quantity
from pretouch.design.quantities import quantity_of
from pretouch.design.result import GainDesign

from .labels import label_inside, label_near
from .style import BASELINE, BLOCKED, CHOSEN, CURVES, INK, LIMIT, QUIET, Scale, log_axis, minus, scale_for, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_objective", "draw_plane"]

_TERMS: Final = (CURVES[2], CURVES[3], CURVES[4])
_WIDE: Final = 30.0  # ratio from which an objective is shown on a logarithmic axis


def draw_objective(axes: Axes, design: GainDesign) -> None:
    """Draw f(D_p) and its terms, the optimum, and the gains that are out of the question."""
    gain, label = _gain_axis(design)
    total = design.trade_off.objective
    terms = _terms(design)
    axes.locator_params(nbins=6)
    axes.set_title("Objective over the gain", y=1.0)
    axes.set_xlabel(label)
    axes.set_ylabel("objective f [1]")
    _set_limits(axes, gain, total, logarithmic=_one_signed(design))
    axes.plot(gain, total, color=INK, linewidth=2.0, zorder=4)
    for i, values in enumerate(terms.values()):
        axes.plot(gain, values, color=_TERMS[i % 3][0], linestyle=_TERMS[i % 3][1], linewidth=1.3, zorder=3)
    if design.gain is not None and design.objective is not None:
        here = _shown_gain(design, design.gain)
        axes.plot([here], [design.objective], "o", color=CHOSEN, markersize=7, zorder=5)
        text = minus(f"optimum D\u209a = {design.gain:#.4g} N s\nf = {design.objective:#.4g}")
        label_near(axes, here, design.objective, text, color=CHOSEN, weight="bold")
    for start, end, reason, hatch in _blocked(design, gain):
        axes.axvspan(start, end, facecolor=BLOCKED, edgecolor="#bdbdbd", hatch=hatch, linewidth=0, zorder=0.5)
        _label_span(axes, start, end, reason)
    _label_terms(axes, gain, total, terms)


def draw_plane(axes: Axes, design: GainDesign) -> None:
    """Draw the relative speed that is left at contact against what it costs, one point per gain."""
    name = traded_quantity(design)
    state, reached = design.trade_off.state, design.trade_off.reached
    cost = np.where(reached, np.abs(quantity_of(name, state, design.impact)), np.nan)
    speed = np.where(reached, np.abs(state.relative_velocity), np.nan)
    points = _points(design, name)
    every = (
        np.concatenate([[p[0] for p in points.values()], cost]),
        np.concatenate([[p[1] for p in points.values()], speed]),
    )
    across, up = _scale(unit_of(name), every[0]), _scale("m/s", every[1])
    axes.locator_params(nbins=6)
    axes.set_title("What the gain trades", y=1.0)
    axes.set_xlabel(f"{words_for(name)} [{across.unit}]")
    axes.set_ylabel(f"{words_for('relative_velocity')} [{up.unit}]")
    x, y = cost / across.factor, speed / up.factor
    _plane_limits(axes, every[0] / across.factor, every[1] / up.factor)
    broken = reached & ~design.trade_off.feasible
    axes.plot(x, y, color=QUIET, linewidth=1.2, zorder=3)
    axes.plot(np.where(broken, np.nan, x), np.where(broken, np.nan, y), color=INK, linewidth=2.2, zorder=3)
    _draw_limits(axes, design, name, across, up)
    _draw_equals(axes, design, name, across, up)
    for kind, (px, py, color, marker, text) in points.items():
        sx, sy = px / across.factor, py / up.factor
        axes.plot([sx], [sy], marker, color=color, markersize=7, zorder=5, clip_on=False)
        label_near(axes, sx, sy, text, color=color, weight="bold" if kind == "chosen" else "normal")
    _gain_ticks(axes, design, x, y)
    if not reached.any():
        _empty(axes, "no gain within the bounds ends in contact")


def _one_signed(design: GainDesign) -> bool:
    low, high = design.bounds
    return low > 0 or high < 0


def _shown_gain(design: GainDesign, gain: Any) -> Any:
    return -gain if design.bounds[1] < 0 else gain


def _gain_axis(design: GainDesign) -> tuple[FloatArray, str]:
    sign = "\u2212" if design.bounds[1] < 0 else ""
    return np.asarray(_shown_gain(design, design.trade_off.gain)), f"virtual force gain {sign}D\u209a [N s]"


def _terms(design: GainDesign) -> dict[str, FloatArray]:
    parts = design.definition.parts(design.trade_off.state, abs(design.scenario.obstacle.velocity), design.impact)
    weighed = {t.quantity for t in design.definition.terms if t.weight > 0} or set(parts)
    return {name: np.where(design.trade_off.reached, value, np.nan) for name, value in parts.items() if name in weighed}


def _set_limits(axes: Axes, gain: FloatArray, total: FloatArray, *, logarithmic: bool) -> None:
    known = total[np.isfinite(total)]
    if logarithmic:
        log_axis(axes, "x", float(gain.min()), float(gain.max()))
    else:
        axes.set_xlim(float(gain.min()), float(gain.max()))
    if not len(known):
        axes.set(ylim=(0, 1), yticks=[])
    elif known.min() > 0 and known.max() > _WIDE * known.min():
        log_axis(axes, "y", float(known.min()) / 8, float(known.max()) * 2.5)
    else:
        axes.set_ylim(0, 1.12 * float(known.max()) or 1.0)


def _label_terms(axes: Axes, gain: FloatArray, total: FloatArray, terms: dict[str, FloatArray]) -> None:
    order = np.argsort(gain)
    places = order[(np.linspace(0.03, 0.97, 31) * (len(order) - 1)).astype(int)]
    label_near(axes, gain[places], np.where(np.isfinite(total), total, np.nan)[places], "f", color=INK, weight="bold")
    for i, (name, values) in enumerate(terms.items()):
        text = f"{in_short(name)} term"
        label_near(axes, gain[places], values[places], text, color=_TERMS[i % 3][0])


def _blocked(design: GainDesign, gain: FloatArray) -> Iterator[tuple[float, float, str, str]]:
    """Yield each stretch of gains that is out of the question, with the reason and a hatch."""
    trade = design.trade_off
    reasons = np.full(len(gain), "", dtype=object)
    for outcome in design.constraints:
        for i in np.flatnonzero(trade.reached & _breaks(design, outcome)):
            name = outcome.name.replace("_", " ")
            reasons[i] = f"{reasons[i]}, {name}" if reasons[i] else name
    reasons[~trade.reached] = "no contact"
    order = np.argsort(gain)
    edges = _edges(gain[order], logarithmic=_one_signed(design))
    sorted_reasons = reasons[order]
    changes = [0, *(np.flatnonzero(sorted_reasons[1:] != sorted_reasons[:-1]) + 1), len(gain)]
    for first, last in pairwise(changes):
        reason = sorted_reasons[first]
        if reason:
            text = reason if reason == "no contact" else f"broken: {reason}"
            yield float(edges[first]), float(edges[last]), text, "\\\\\\\\" if reason == "no contact" else "/////"


def _breaks(design: GainDesign, outcome: ConstraintOutcome) -> BoolArray:
    magnitude = np.abs(quantity_of(outcome.quantity, design.trade_off.state, design.impact))
    return np.asarray(magnitude > outcome.limit * (1 + 1e-9))


def _edges(gain: FloatArray, *, logarithmic: bool) -> FloatArray:
    """Return the ends of the gains and the middles between them."""
    middles = np.sqrt(gain[1:] * gain[:-1]) if logarithmic else (gain[1:] + gain[:-1]) / 2
    return np.concatenate([gain[:1], middles, gain[-1:]])


def _label_span(axes: Axes, start: float, end: float, text: str) -> None:
    """Write the reason into a hatched stretch of gains."""
    places = np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9, 0.0, 1.0])
    logarithmic = axes.get_xscale() == "log"
    across = start * (end / start) ** places if logarithmic else start + (end - start) * places
    heights = np.linspace(0.93, 0.07, 15)
    low, high = axes.get_ylim()
    up = low * (high / low) ** heights if axes.get_yscale() == "log" else low + (high - low) * heights
    x, y = np.meshgrid(across, up)
    label_inside(axes, x.ravel(), y.ravel(), text, color=LIMIT, size=7.5, fill=BLOCKED)


def _points(design: GainDesign, name: str) -> dict[str, tuple[float, float, str, str, str]]:
    """Return the points that are marked in the plane: cost and speed in SI, color, marker, label."""
    found: dict[str, tuple[float, float, str, str, str]] = {}
    runs = (
        ("none", design.no_mitigation, BASELINE, "s", "no mitigation"),
        ("chosen", design.result, CHOSEN, "o", "chosen"),
        ("nearest", design.nearest, CHOSEN, "D", "nearest to the limits"),
    )
    for kind, run, color, marker, text in runs:
        if run is None or not run.reached.all() or (kind == "nearest" and design.result is not None):
            continue
        cost = abs(float(quantity_of(name, run.end, design.impact)))
        found[kind] = (cost, abs(float(run.end.relative_velocity)), color, marker, text)
    return found


def _scale(unit: str, values: FloatArray) -> Scale:
    known = np.abs(values[np.isfinite(values)])
    return scale_for(unit, float(known.max()) if len(known) else 1.0)


def _plane_limits(axes: Axes, x: FloatArray, y: FloatArray) -> None:
    known = x[np.isfinite(x)]
    wide = len(known) > 0 and known.min() > 1e-6 * known.max() and known.max() > 100 * known.min()
    if wide:
        log_axis(axes, "x", float(known.min()) / 1.4, float(known.max()) * 1.4)
    else:
        axes.set_xlim(min(0.0, span(x)[0]) if len(known) and known.min() < 0 else -0.02 * span(x)[1], span(x)[1])
    axes.set_ylim(0, span(np.append(y, 0.0))[1])


def _draw_limits(axes: Axes, design: GainDesign, name: str, across: Scale, up: Scale) -> None:
    """Draw the limits of the two quantities that the plane shows."""
    for outcome in design.constraints:
        if outcome.quantity == name or (name == "displacement" and outcome.quantity == "largest_excursion"):
            at = outcome.limit / across.factor
            if axes.get_xlim()[0] < at < axes.get_xlim()[1]:
                axes.axvline(at, color=LIMIT, linestyle=":", linewidth=1.2)
                label_near(
                    axes, [at] * 5, _rungs(axes, "y"), f"{outcome.name.replace('_', ' ')} limit", color=LIMIT, size=7.5
                )
        if outcome.quantity == "relative_velocity":
            at = outcome.limit / up.factor
            if axes.get_ylim()[0] < at < axes.get_ylim()[1]:
                axes.axhline(at, color=LIMIT, linestyle=":", linewidth=1.2)
                label_near(axes, _rungs(axes, "x"), [at] * 5, "relative velocity limit", color=LIMIT, size=7.5)


def _draw_equals(axes: Axes, design: GainDesign, name: str, across: Scale, up: Scale) -> None:
    """Draw where the objective equals its optimum: the curve of what is possible touches it and stays outside."""
    if not shows_equals(design):
        return
    terms = {t.quantity: t for t in design.definition.terms if t.weight > 0}
    speed = abs(design.scenario.obstacle.velocity)
    a, b = (
        abs(float(terms[q].scale_for(speed))) * np.sqrt(design.objective / terms[q].weight) / scale.factor
        for q, scale in ((name, across), ("relative_velocity", up))
    )
    turn = np.linspace(0.0, np.pi / 2, 90)
    x, y = a * np.cos(turn), b * np.sin(turn)
    axes.plot(x, y, color=CHOSEN, linestyle=(0, (1, 1.6)), linewidth=1.1, zorder=2)
    places = [75, 65, 55, 45, 35, 25, 15]
    label_near(axes, x[places], y[places], f"f = {design.objective:#.4g}", color=CHOSEN, size=7.5)


def _rungs(axes: Axes, which: str) -> FloatArray:
    low, high = axes.get_xlim() if which == "x" else axes.get_ylim()
    return low + (high - low) * np.array([0.9, 0.75, 0.6, 0.45, 0.3])


def _gain_ticks(axes: Axes, design: GainDesign, x: FloatArray, y: FloatArray) -> None:
    """Mark round gains along the curve, so that one can read which gain leads where."""
    gain = design.trade_off.gain
    lines = [np.asarray(line.get_xydata()) for line in axes.lines]
    marked = [axes.transData.transform(points)[0] for points in lines if len(points) == 1]
    for wanted in (-0.1, -1.0, -10.0, -100.0, -0.01, 0.1, 1.0, 10.0):
        if not design.bounds[0] <= wanted <= design.bounds[1] or not np.isfinite(x).any():
            continue
        order = np.argsort(gain)
        px, py = (float(np.interp(wanted, gain[order], values[order])) for values in (x, y))
        if not (np.isfinite(px) and np.isfinite(py)):
            continue
        here = axes.transData.transform([(px, py)])
        if np.min(np.abs(np.reshape(marked, (-1, 2)) - here).max(axis=1), initial=np.inf) < 15:
            continue
        marked.append(here[0])
        axes.plot([px], [py], "o", color="white", markeredgecolor=INK, markersize=3.6, markeredgewidth=0.9, zorder=4)
        text = minus(f"{wanted:g} N s")
        label_near(axes, px, py, text, color=QUIET, size=7.5, reach=20.0)


def _empty(axes: Axes, text: str) -> None:
    axes.set(xticks=[], yticks=[])
    axes.text(
        0.5,
        0.5,
        text,
        transform=axes.transAxes,
        ha="center",
        va="center",
        color=LIMIT,
        wrap=False,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 2},
        zorder=6,
    )
