"""A quantity over a plane: shades that survive greyscale, and contour lines that say what they stand for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import MaxNLocator

from pretouch._core.numbers import FloatArray

from .style import BLOCKED, INK, QUIET, log_axis, minus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Map", "draw_maps"]

_SHADES: Final = ("#7fb2d6", "#ffffff")  # from low to high: dark enough to be told apart, light enough for letters
_LEVELS: Final = 8
_CROWDED: Final = 0.6  # of the plane
_GAP: Final = 3.0  # pixels between the labels of lines


class Map(NamedTuple):
    """One quantity over two axes, in the units of the labels."""

    x: FloatArray
    y: FloatArray
    values: FloatArray
    title: str
    x_label: str
    y_label: str
    x_log: bool
    y_log: bool


def draw_maps(figure: Figure, maps: list[Map], columns: int) -> None:
    """Draw maps, row by row."""
    rows = -(-len(maps) // columns)
    inches = float(figure.get_size_inches()[1])
    figure.subplots_adjust(
        left=0.1 if columns == 2 else 0.14,
        right=0.97,
        bottom=0.5 / inches,
        top=1 - 0.42 / inches,
        wspace=0.3,
        hspace=0.9 * rows / max(inches - 0.82 * rows, 1.0),
    )
    for i, shown in enumerate(maps):
        _draw(figure, figure.add_subplot(rows, columns, i + 1), shown)


def _draw(figure: Figure, axes: Axes, shown: Map) -> None:
    axes.set_facecolor(BLOCKED)
    axes.set_xlabel(shown.x_label)
    axes.set_ylabel(shown.y_label)
    axes.set_title(shown.title, fontsize=8.0)
    known = shown.values[np.isfinite(shown.values)]
    for which, numbers, logarithmic in (("x", shown.x, shown.x_log), ("y", shown.y, shown.y_log)):
        low, high = float(numbers.min()), float(numbers.max())
        if logarithmic:
            log_axis(axes, which, low, high)
        else:
            (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
            (axes.xaxis if which == "x" else axes.yaxis).set_major_locator(MaxNLocator(6))
    low, high = float(known.min()), float(known.max())
    masked = np.ma.masked_invalid(shown.values)
    if not low < high:
        axes.contourf(shown.x, shown.y, masked, levels=[low - 1.0, low + 1.0], colors=[_SHADES[1]])
        axes.text(0.5, 0.5, minus(f"{low:.4g} everywhere"), transform=axes.transAxes, ha="center", color=INK)
        return
    levels = _levels(known)
    shades: Any = LinearSegmentedColormap.from_list("pretouch", _SHADES)
    axes.contourf(shown.x, shown.y, masked, levels=levels, cmap=shades)
    inner = [level for level in levels if low < level < high]
    lines = axes.contour(shown.x, shown.y, masked, levels=inner, colors=INK, linewidths=0.8, linestyles="solid")
    labels = axes.clabel(lines, fmt=_level, fontsize=7.5, inline=False)
    for label in labels:
        label.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6})
    _thin_out(figure, axes, list(labels))
    if masked.mask.any():
        _hatch(axes, shown)


def _levels(known: FloatArray) -> FloatArray:
    """Choose levels: equally spaced, or of equally large areas where nearly everything lies between two of those."""
    low, high = float(known.min()), float(known.max())
    even = np.asarray(MaxNLocator(_LEVELS).tick_values(low, high))
    if np.histogram(known, even)[0].max() < _CROWDED * known.size:
        return even
    digits = 1 - int(np.floor(np.log10(max(abs(low), abs(high)))))
    for finer in range(digits, digits + 6):
        inner = np.unique(np.round(np.quantile(known, np.linspace(0, 1, _LEVELS)[1:-1]), finer))
        if len(inner) >= _LEVELS // 2:
            break
    return np.unique(np.concatenate([even[:1], inner[(inner > even[0]) & (inner < even[-1])], even[-1:]]))


def _hatch(axes: Axes, shown: Map) -> None:
    """Mark where there is no value, and say so."""
    missing = np.isnan(shown.values).astype(float)
    filled = axes.contourf(shown.x, shown.y, missing, levels=[0.5, 1.5], colors="none", hatches=["////"])
    filled.set_edgecolor(QUIET)
    filled.set_linewidth(0.0)
    axes.set_title(f"{shown.title}\nhatched: no value", fontsize=8.0)


def _thin_out(figure: Figure, axes: Axes, labels: list[Any]) -> None:
    """Take away labels that cover others or leave the axes."""
    canvas: Any = FigureCanvasAgg(figure)
    renderer = canvas.get_renderer()
    frame = axes.get_window_extent(renderer)
    kept: list[Any] = []
    for label in labels:
        box = label.get_window_extent(renderer)
        outside = box.x0 < frame.x0 or box.x1 > frame.x1 or box.y0 < frame.y0 or box.y1 > frame.y1
        if outside or any(box.padded(_GAP).overlaps(other) for other in kept):
            label.remove()
        else:
            kept.append(box)


def _level(value: float) -> str:
    return minus(f"{value:.4g}")
