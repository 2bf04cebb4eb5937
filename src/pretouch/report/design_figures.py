"""Draw the figures of a gain design.

They show the objective versus the gain, the contact speed versus the excursion, and the sensitivities of the optimal
gain.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.units import format_quantity, pretty_unit
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.designs.certificate import ConstraintOutcome, Sensitivity
from pretouch.designs.gain import GainDesign
from pretouch.designs.page import shows_equals, traded_quantity
from pretouch.designs.quantities import contact_value
from pretouch.motion import LawNumber

from .new_figure import new_figure
from .panel_figure import panel_figure
from .panels import Curve, Mark, Panel, Span, containing
from .style import BASELINE, CHOSEN, INK, QUIET, WIDE, Scale, drawing, gain_axis, minus, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_TERMS: Final = (2, 3, 4)  # places in the palette
_WIDE_COST: Final = 100.0  # ratio of the largest to the smallest cost, from which the axis is logarithmic
_ROUND: Final = (-0.1, -1.0, -10.0, -100.0, -0.01, 0.1, 1.0, 10.0)  # gains that are marked along the curve [N s]
_CLOSE: Final = 0.06  # of the panel: least distance between two marks


@check_arguments
def trade_off(design: GainDesign) -> Figure:
    """Draw the trade-off between contact speed and excursion of a gain design.

    Args:
        design: a design of any status.

    Returns:
        Two panels: the objective with its terms over the gain, with hatched ranges of gains without contact and gains
        that violate a constraint; and the relative speed at contact over the cost. If no gain ends in contact, the
        smallest distance over the gain.
    """
    if not design.trade_off.reached.any():
        return panel_figure(_no_contact_panel(design))
    return panel_figure(_objective_panel(design), _trade_off_panel(design), height=3.5)


def _no_contact_panel(design: GainDesign) -> Panel:
    """Return a plot of the smallest distance versus the gain."""
    scanned = design.scan_result
    gain = _shown_gain(design, np.asarray(scanned.gain, float))
    nearest = np.asarray(scanned.closest_distance, float)
    scale = scale_for("m", float(nearest.max()))
    return containing(
        **_gain_axis(design),
        y_label=f"{words_for('closest_distance')} [{scale.unit}]",
        title="No gain within the bounds ends in contact",
        curves=[Curve(x=gain, y=nearest / scale.factor)],
        spans=[Span(start=float(gain.min()), end=float(gain.max()), label="no contact", kind="missing")],
    )


def _objective_panel(design: GainDesign) -> Panel:
    """Return a plot of the objective and its terms versus the gain."""
    gain, total = np.asarray(_shown_gain(design, design.trade_off.gain)), design.trade_off.objective
    finite = total[np.isfinite(total)]
    low, high = float(finite.min()), float(finite.max())
    wide = low > 0 and high > WIDE * low
    limits = (low / 8, 2.5 * high) if wide else (min(0.0, 1.12 * low), max(0.0, 1.12 * high) or 1.0)
    terms = {f"{name.replace('_', ' ')} term": values for name, values in _terms(design).items()}
    curves = []
    styles = [*_TERMS, *_TERMS, *_TERMS][: len(terms)]
    for (name, values), style in zip([*terms.items(), ("f", total)], [*styles, 0], strict=True):
        valid = np.isfinite(values) & (values > 0 if wide else True)
        if np.any(valid & (values >= limits[0]) & (values <= limits[1])):
            curves.append(Curve(x=gain, y=np.where(valid, values, np.nan), label=name, style=style))
    marks = []
    if design.gain is not None and design.objective is not None:
        n = design.number
        text = f"optimum {n.plot_symbol} = {minus(n.plot_text(design.gain, '#.4g'))}\nf = {design.objective:#.4g}"
        marks = [Mark(x=float(_shown_gain(design, design.gain)), y=design.objective, label=text, style=0)]
    return containing(
        **_gain_axis(design),
        y_label="objective f [1]",
        title="Objective over the gain",
        curves=curves,
        marks=marks,
        spans=list(_infeasible_ranges(design, gain)),
        y_log=wide,
        y_limits=limits,
    )


def _trade_off_panel(design: GainDesign) -> Panel:
    """Return a plot of the contact speed versus excursion or another cost."""
    name = traded_quantity(design)
    state, reached = design.trade_off.state, design.trade_off.reached
    cost = np.where(reached, np.abs(contact_value(name, state, design.impact)), np.nan)
    speed = np.where(reached, np.abs(state.relative_velocity), np.nan)
    points = list(_points(design, name))
    across = _scale(unit_of(name), np.array([*cost, *(p[0] for p in points)]))
    up = _scale("m/s", np.array([*speed, *(p[1] for p in points)]))
    x, y = cost / across.factor, speed / up.factor
    marks = [Mark(x=c / across.factor, y=v / up.factor, **style) for c, v, style in points]
    marks += _round_gains(design, x, y, marks)
    feasible = np.where(design.trade_off.feasible, y, np.nan)
    path = Curve(x=x, y=y, quiet=True)
    costs = np.array([*x[np.isfinite(x)], *(mark.x for mark in marks)])
    wide = bool(costs.min() > 1e-6 * costs.max() and costs.max() > _WIDE_COST * costs.min())
    contour = [] if wide else _optimal_contour(design, name, across, up, (float(costs.max()), float(np.nanmax(y))))
    levels, positions = _limits(design, name, across, up)
    return Panel(
        x_label=f"{words_for(name)} [{across.unit}]",
        y_label=f"{words_for('relative_velocity')} |l\u2032| [{up.unit}]",
        title="Trade-off along the gain",
        curves=[path, *([Curve(x=x, y=feasible, style=0)] if np.isfinite(feasible).any() else []), *contour],
        marks=marks,
        levels={text: at for text, at in levels.items() if at < 1.1 * np.nanmax(y)},
        positions={text: at for text, at in positions.items() if at < 1.1 * costs.max()},
        x_log=wide,
    )


def _shown_gain(design: GainDesign, gain: Any) -> Any:
    return gain_axis(design.bounds, design.number)[0] * gain


def _gain_axis(design: GainDesign) -> dict[str, Any]:
    _, label, logarithmic = gain_axis(design.bounds, design.number)
    ends = sorted(_shown_gain(design, np.array(design.bounds)))
    return {"x_label": label, "x_log": logarithmic, "x_limits": tuple(ends)}


def _terms(design: GainDesign) -> dict[str, FloatArray]:
    parts = design.definition.parts(design.trade_off.state, abs(design.scenario.obstacle.velocity), design.impact)
    relevant = {t.quantity for t in design.definition.terms if t.weight > 0} or set(parts)
    reached = design.trade_off.reached
    return {name: np.where(reached, value, np.nan) for name, value in parts.items() if name in relevant}


def _infeasible_ranges(design: GainDesign, gain: FloatArray) -> Iterator[Span]:
    """Yield each range of infeasible gains with its reason."""
    trade = design.trade_off
    reasons = np.full(len(gain), "", dtype=object)
    for outcome in design.constraints:
        for i in np.flatnonzero(trade.reached & _violates(design, outcome)):
            name = outcome.name.replace("_", " ")
            reasons[i] = f"{reasons[i]}, {name}" if reasons[i] else f"violated: {name}"
    reasons[~trade.reached] = "no contact"
    order = np.argsort(gain)
    edges = _edges(gain[order], logarithmic=gain_axis(design.bounds, design.number)[2])
    ordered = reasons[order]
    changes = [0, *(np.flatnonzero(ordered[1:] != ordered[:-1]) + 1), len(gain)]
    for first, last in pairwise(changes):
        if ordered[first]:
            kind: Any = "missing" if ordered[first] == "no contact" else "blocked"
            yield Span(start=float(edges[first]), end=float(edges[last]), label=ordered[first], kind=kind)


def _violates(design: GainDesign, outcome: ConstraintOutcome) -> BoolArray:
    magnitude = np.abs(contact_value(outcome.quantity, design.trade_off.state, design.impact))
    return np.asarray(magnitude > outcome.limit * (1 + 1e-9))


def _edges(gain: FloatArray, *, logarithmic: bool) -> FloatArray:
    """Return the borders of the plotted interval around each gain."""
    middles = np.sqrt(gain[1:] * gain[:-1]) if logarithmic else (gain[1:] + gain[:-1]) / 2
    return np.concatenate([gain[:1], middles, gain[-1:]])


def _points(design: GainDesign, name: str) -> Iterator[tuple[float, float, dict[str, Any]]]:
    """Yield points that mark gains, such as the chosen gain."""
    nearest = design.nearest if design.result is None else None
    for run, style in (
        (design.no_mitigation, {"label": "no mitigation", "style": 1, "shape": "square"}),
        (design.result, {"label": "chosen", "style": 0}),
        (nearest, {"label": "nearest to the limits", "style": 0}),
    ):
        if run is not None and run.reached.all():
            cost = abs(float(contact_value(name, run.end, design.impact)))
            yield cost, abs(float(run.end.relative_velocity)), style


def _scale(unit: str, values: FloatArray) -> Scale:
    return scale_for(unit, float(np.nanmax(np.abs(values))))


def _limits(design: GainDesign, name: str, across: Scale, up: Scale) -> tuple[dict[str, float], dict[str, float]]:
    """Return reference lines at the design limits of both axes."""
    levels, positions = {}, {}
    for outcome in design.constraints:
        text = f"{outcome.name.replace('_', ' ')} limit"
        if outcome.quantity == name or (name == "displacement" and outcome.quantity == "largest_excursion"):
            positions[text] = outcome.limit / across.factor
        elif outcome.quantity == "relative_velocity":
            levels[text] = outcome.limit / up.factor
    return levels, positions


def _optimal_contour(design: GainDesign, name: str, across: Scale, up: Scale, most: tuple[float, float]) -> list[Curve]:
    """Return the contour line of the objective through the optimum."""
    if not shows_equals(design):
        return []
    terms = {t.quantity: t for t in design.definition.terms if t.weight > 0}
    speed = abs(design.scenario.obstacle.velocity)
    a, b = (
        abs(float(terms[q].scale_for(speed))) * np.sqrt(design.objective / terms[q].weight) / scale.factor
        for q, scale in ((name, across), ("relative_velocity", up))
    )
    turn = np.linspace(0.0, np.pi / 2, 90)
    x, y = a * np.cos(turn), b * np.sin(turn)
    visible = (x <= most[0]) & (y <= most[1])
    text = f"f = {design.objective:#.4g}"
    return [Curve(x=x, y=np.where(visible, y, np.nan), label=text, quiet=True)] if visible.any() else []


def _round_gains(design: GainDesign, x: FloatArray, y: FloatArray, marks: list[Mark]) -> list[Mark]:
    """Return points that mark round gains, such as -1 N s."""
    order = np.argsort(design.trade_off.gain)
    size = np.array([np.nanmax(x), np.nanmax(y)])
    new_marks: list[Mark] = []
    for gain in _ROUND:
        if not design.bounds[0] <= gain <= design.bounds[1]:
            continue
        point = np.array([np.interp(gain, design.trade_off.gain[order], values[order]) for values in (x, y)])
        distances = [np.abs((point - [mark.x, mark.y]) / size).max() for mark in (*marks, *new_marks)]
        if np.isfinite(point).all() and min(distances, default=1.0) > _CLOSE:
            label = minus(design.number.plot_text(gain, "g"))
            new_marks.append(Mark(x=float(point[0]), y=float(point[1]), label=label, shape="ring"))
    return new_marks


@check_arguments
def sensitivity(design: GainDesign) -> Figure:
    """Draw the sensitivity of the optimal gain to each input.

    A bar shows by how much the gain changes if an input grows by 1 %.

    Args:
        design: a design; without sensitivities the figure is an empty panel with a message.

    Returns:
        One bar per input, the most influential input on top.
    """
    largest = max((abs(s.gain_change_per_percent) for s in design.sensitivities), default=0.0)
    relevant = [s for s in design.sensitivities if abs(s.gain_change_per_percent) > 1e-6 * largest]
    ranked = sorted(relevant, key=lambda s: abs(s.gain_change_per_percent), reverse=True)
    with drawing():
        height = 1.05 + 0.27 * max(len(ranked), 2)
        figure = new_figure(7.4, height)
        axes = figure.add_subplot()
        figure.subplots_adjust(left=0.42, right=0.97, bottom=0.5 / height, top=1 - 0.4 / height)
        axes.set_title("Effect of a 1 % increase of each input", y=1.0)
        axes.set_ylabel("input [its value]", rotation=0, ha="right", va="bottom")
        axes.yaxis.set_label_coords(-0.02, 1.0)
        axes.locator_params(axis="x", nbins=7)
        if ranked:
            _draw_bars(axes, ranked, scale_for(design.number.unit, largest), design.number)
        else:
            n = design.number
            axes.set_xlabel(f"change of the optimal {n.name} {n.plot_symbol} [{pretty_unit(n.unit)}]")
            axes.set(xlim=(-1, 1), ylim=(-1, 1), xticks=[], yticks=[])
            text = "no gain was chosen" if design.gain is None else "no input changes the optimal gain"
            axes.text(0, 0, text, ha="center", va="center", color=QUIET)
    return figure


def _draw_bars(axes: Axes, ranked: list[Sensitivity], scale: Scale, number: LawNumber) -> None:
    axes.set_xlabel(f"change of the optimal {number.name} {number.plot_symbol} [{scale.unit}]")
    changes = [s.gain_change_per_percent / scale.factor for s in ranked]
    reach = 1.4 * max(abs(c) for c in changes)
    rows = range(len(ranked))
    colors = [CHOSEN if c < 0 else BASELINE for c in changes]
    hatches = ["" if c < 0 else "////" for c in changes]
    axes.barh(rows, changes, height=0.62, color=colors, hatch=hatches, edgecolor="white", linewidth=0)
    axes.axvline(0, color=INK, linewidth=0.8)
    for row, change in zip(rows, changes, strict=True):
        side = 1 if change >= 0 else -1
        axes.annotate(
            minus(f"{change:+.3g}"),
            (change, row),
            xytext=(4 * side, 0),
            textcoords="offset points",
            ha="left" if change >= 0 else "right",
            va="center",
        )
    axes.set(xlim=(-reach, reach), ylim=(len(ranked) - 0.4, -0.6), yticks=list(rows))
    values = (pretty_unit(format_quantity(s.value, s.unit)) for s in ranked)
    axes.set_yticklabels([f"{s.name} [{value}]" for s, value in zip(ranked, values, strict=True)], parse_math=False)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
