"""Draw two-dimensional maps with colors and contour lines in a plot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.contour import ContourSet
from matplotlib.ticker import MaxNLocator

from pretouch._core.numbers import FloatArray

from .labels import boxes_in, dense_points, free_places, size_of
from .panel_drawing import best_anchors, inside
from .style import BLOCKED, INK, QUIET, minus

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .panels import Map


_SHADES: Final = ("#7fb2d6", "#ffffff")  # from low to high: dark enough to be distinct, light enough for text
_SHORT: Final = 12  # least points of a path, about 4 pixels apart, on which there is room for a number
_BOX: Final[dict[str, Any]] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}
_LEVELS: Final = 8
_CROWDED: Final = 0.6  # share of the map between two levels, from which the levels are quantiles


def draw_map(axes: Axes, shown: Map) -> None:
    """Draw a quantity as a map with shades and contour lines.

    The map is the background of the plot.
    """
    axes.patch.set(facecolor=BLOCKED, edgecolor=QUIET, hatch="////", linewidth=0)  # visible where there is no value
    values = np.ma.masked_invalid(shown.values)
    low, high = float(values.min()), float(values.max())
    levels = _levels(values.compressed()) if low < high else np.array([low - 1.0, low + 1.0])
    shades = LinearSegmentedColormap.from_list("pretouch", _SHADES if low < high else _SHADES[1:] * 2)
    filled = axes.contourf(shown.x, shown.y, values, levels=levels, cmap=shades, zorder=0.7)
    if low < high:
        inner = levels[(levels > low) & (levels < high)]
        axes.contour(filled, levels=inner, colors=INK, linewidths=0.8, linestyles="solid", zorder=0.9)
    else:
        axes.text(0.5, 0.5, minus(f"{low:.4g} everywhere"), transform=axes.transAxes, ha="center", color=INK)


def number_contours(axes: Axes) -> None:
    """Label each contour line of a map with its value."""
    # All other artists of the plot must be final.
    contours = [c for c in axes.collections if isinstance(c, ContourSet) and not c.filled]
    lines = [(level, run) for c in contours for level, runs in zip(c.levels, c.allsegs, strict=True) for run in runs]
    paths = [inside(axes, dense_points(np.asarray(axes.transData.transform(run)))) for _, run in lines]
    occupied = boxes_in(axes)
    for i, ((level, _), path) in enumerate(zip(lines, paths, strict=True)):
        if len(path) < _SHORT:
            continue
        label = axes.text(0, 0, minus(f"{level:.4g}"), fontsize=7.5, ha="center", va="center", bbox=_BOX, zorder=1)
        half = np.array(size_of(label)) / 2 + 1
        anchors = best_anchors(path, [other[::3] for other in paths[:i] + paths[i + 1 :]])
        boxes = np.column_stack([anchors - half, anchors + half])
        free = np.flatnonzero(free_places(axes, boxes, occupied))
        if len(free):
            label.set_position(tuple(axes.transData.inverted().transform(anchors[free[0]])))
            occupied = np.vstack([occupied, boxes[free[0]]])
        else:
            label.remove()


def _levels(values: FloatArray) -> FloatArray:
    """Choose the contour levels of a map."""
    # The levels are equally spaced, or quantiles if most values are close together.
    low, high = float(values.min()), float(values.max())
    even = np.asarray(MaxNLocator(_LEVELS).tick_values(low, high))
    if np.histogram(values, even)[0].max() < _CROWDED * values.size:
        return even
    digits = 1 - int(np.floor(np.log10(max(abs(low), abs(high)))))
    for finer in range(digits, digits + 6):
        inner = np.unique(np.round(np.quantile(values, np.linspace(0, 1, _LEVELS)[1:-1]), finer))
        if len(inner) >= _LEVELS // 2:
            break
    return np.unique(np.concatenate([even[:1], inner[(inner > even[0]) & (inner < even[-1])], even[-1:]]))
