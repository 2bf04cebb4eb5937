"""The picture of what moves the optimum of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pretouch._core.units import format_quantity, pretty_unit
from pretouch.design.certificate import Sensitivity
from pretouch.design.result import GainDesign

from .new_figure import new_figure
from .style import BASELINE, CHOSEN, INK, QUIET, Scale, drawing, minus, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["sensitivity"]


def sensitivity(design: GainDesign) -> Figure:
    """Draw how far the optimal gain moves when each input grows by 1 %.

    Args:
        design: a design; one without sensitivities gives an empty panel that says so.

    Returns:
        One bar per input, the most influential one on top.
    """
    largest = max((abs(s.gain_change_per_percent) for s in design.sensitivities), default=0.0)
    felt = [s for s in design.sensitivities if abs(s.gain_change_per_percent) > 1e-6 * largest]
    ranked = sorted(felt, key=lambda s: abs(s.gain_change_per_percent), reverse=True)
    with drawing():
        height = 1.05 + 0.27 * max(len(ranked), 2)
        figure = new_figure(7.4, height)
        axes = figure.add_subplot()
        figure.subplots_adjust(left=0.42, right=0.97, bottom=0.5 / height, top=1 - 0.4 / height)
        axes.set_title("When the input grows by 1 %", y=1.0)
        axes.set_ylabel("input [its value]", rotation=0, ha="right", va="bottom")
        axes.yaxis.set_label_coords(-0.02, 1.0)
        axes.locator_params(axis="x", nbins=7)
        if ranked:
            _draw_bars(axes, ranked, scale_for("N*s", largest))
        else:
            axes.set_xlabel("change of the optimal gain D\u209a [N s]")
            axes.set(xlim=(-1, 1), ylim=(-1, 1), xticks=[], yticks=[])
            text = "no gain was chosen" if design.gain is None else "no input moves the optimal gain"
            axes.text(0, 0, text, ha="center", va="center", color=QUIET)
    return figure


def _draw_bars(axes: Axes, ranked: list[Sensitivity], scale: Scale) -> None:
    axes.set_xlabel(f"change of the optimal gain D\u209a [{scale.unit}]")
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
