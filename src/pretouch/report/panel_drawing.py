"""Draw curves, bands, points and lines in a figure panel."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from pretouch._core.numbers import FloatArray

from .labels import dense_points
from .style import BLOCKED, CURVES, INK, LIMIT, MARKERS, QUIET, log_axis, minus, minus_signs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .panels import Curve, Panel


_FAINT: Final = "#b4b4b4"
_HATCHED: Final = "#bdbdbd"
_SHAPES: Final = {"dot": ("o", True), "ring": ("o", False), "square": ("s", True)}
_MARKER_SIZES: Final = {"o": 4.4, "s": 4.0, "^": 5.0, "D": 3.8, "v": 5.0}
_ANCHORS: Final = 25
_CLOSE: Final = 20.0  # pixels between reference lines, below which there is no room for a name
_APART: Final = 8.0  # least pixels to other curves, so that a name is not ambiguous
_CLEAR: Final = 30.0  # pixels to the nearest other curve, beyond which more distance has no advantage
_LETTER: Final = 6.6  # pixels, width of a letter of 8 pt
_MOST_ROOM: Final = 0.25  # of the width of a panel, for texts at the ends of curves
_DIGITS: Final = 1e-3, 1e5  # an axis whose largest number is outside gets a power of ten


_SPANS: Final[dict[str, dict[str, Any]]] = {
    "blocked": {"facecolor": BLOCKED, "edgecolor": _HATCHED, "hatch": "/////"},
    "missing": {"facecolor": BLOCKED, "edgecolor": _HATCHED, "hatch": "\\\\\\\\"},
    "used": {"facecolor": "#eef4f9"},
}
"""The fill style of a range of the horizontal axis, by its kind."""


class Name(NamedTuple):
    """Label of a plot item, with its possible anchor points."""

    text: str
    color: str
    x: FloatArray
    y: FloatArray
    sample: dict[str, Any]
    kind: str
    side: int = 1
    listed: str = ""


class _Look(NamedTuple):
    color: str
    dashes: Any
    marker: str


def draw_panel(axes: Axes, panel: Panel) -> None:
    """Draw everything in a plot except the names of its curves.

    The limits of the axes are set as well.
    """
    zoomed = panel.x_limits is not None or panel.y_limits is not None
    for curve, look in _looks(panel):
        _draw_curve(axes, curve, look, clipped=zoomed)
    for span in panel.spans:
        axes.axvspan(span.start, span.end, **_SPANS[span.kind], linewidth=0, zorder=0.5)
    for at in panel.levels.values():
        axes.axhline(at, **_LINE)
    for at in panel.positions.values():
        axes.axvline(at, **_LINE)
    for which in ("y", "x"):  # the space for texts along x depends on the limits of y
        _set_axis(axes, panel, which)
    for curve, look in _looks(panel):
        if curve.end:
            _draw_end(axes, curve, look)
    for mark in panel.marks:
        axes.plot([mark.x], [mark.y], clip_on=False, **_mark_style(mark))


def names_of(axes: Axes, panel: Panel) -> list[Name]:
    """Return all labels to write into a plot."""
    # Limits and position of the axes must be final.
    names = [
        Name(mark.label, _color(mark.style), np.array([mark.x]), np.array([mark.y]), _mark_style(mark), "point")
        for mark in panel.marks
        if mark.label
    ]
    names += [*_span_names(axes, panel), *_end_names(panel)]
    looks = list(_looks(panel))
    paths = [_path(axes, curve) for curve, _ in looks]
    for i, (curve, look) in enumerate(looks):
        if curve.label:
            others = [path for k, path in enumerate(paths) if k != i and not looks[k][0].quiet]
            points = axes.transData.inverted().transform(best_anchors(paths[i], others))
            color = QUIET if curve.quiet else look.color
            names.append(Name(curve.label, color, points[:, 0], points[:, 1], _curve_sample(curve, look), "curve"))
    return [n._replace(text=minus_signs(n.text)) for n in (*names, *_line_names(axes, panel)) if n.text.strip()]


_LINE: Final[dict[str, Any]] = {"color": LIMIT, "linestyle": ":", "linewidth": 1.1, "zorder": 2}


def _looks(panel: Panel) -> Iterator[tuple[Curve, _Look]]:
    position = 0
    for curve in panel.curves:
        if curve.quiet:
            yield curve, _Look(_FAINT, "-", "o")
        else:
            chosen = position if curve.style is None else curve.style
            color, dashes = CURVES[chosen]
            yield curve, _Look(color, dashes, MARKERS[chosen])
            position += 1


def _color(style: int | None) -> str:
    return INK if style is None else CURVES[style][0]


def _mark_style(mark: Any) -> dict[str, Any]:
    marker, filled = _SHAPES[mark.shape]
    color = _color(mark.style)
    return {
        "color": color,
        "linestyle": "None",
        "marker": marker,
        "markeredgewidth": 1.3,
        "markerfacecolor": color if filled else "white",
        "markersize": 6.0,
        "zorder": 5.5,
    }


def _curve_sample(curve: Curve, look: _Look) -> dict[str, Any]:
    """Return the Matplotlib line style of a curve."""
    return {
        "color": look.color,
        "linestyle": "None" if curve.kind == "points" else look.dashes,
        "linewidth": 0.7 if curve.quiet else 1.7,
        "marker": "None" if curve.kind == "line" else look.marker,
        "markersize": (0.6 if curve.quiet else 1.0) * _MARKER_SIZES[look.marker],
        "markeredgewidth": 0.0,
        "zorder": 0.9 if curve.quiet else 3,
    }


def _xy(curve: Curve) -> tuple[FloatArray, FloatArray]:
    return np.asarray(curve.x, float), np.asarray(curve.y, float)


def _draw_curve(axes: Axes, curve: Curve, look: _Look, *, clipped: bool) -> None:
    x, y = _xy(curve)
    style = _curve_sample(curve, look)
    axes.plot(x, y, clip_on=clipped, **style)
    if curve.low is not None and curve.high is not None:
        low, high = np.asarray(curve.low, float), np.asarray(curve.high, float)
        if curve.kind == "points":
            axes.vlines(x, low, high, color=look.color, linewidth=0.9, zorder=style["zorder"] - 0.05)
        else:
            axes.fill_between(x, low, high, color=look.color, alpha=0.17, linewidth=0, zorder=0.8)
    if curve.kind == "line":
        valid = np.concatenate([[False], curve.known, [False]])
        alone = valid[1:-1] & ~valid[:-2] & ~valid[2:]  # a line through one point would not be visible
        if alone.any():
            axes.plot(x[alone], y[alone], **{**style, "linestyle": "None", "marker": "o", "markersize": 3.0})


def _draw_end(axes: Axes, curve: Curve, look: _Look) -> None:
    x, y = (values[curve.known][-1] for values in _xy(curve))
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    if left <= x <= right and low <= y <= high:
        size, zorder = (3.6, 2.8) if curve.quiet else (5.5, 5.0)
        axes.plot([x], [y], "o", color=look.color, markersize=size, markeredgewidth=0, zorder=zorder, clip_on=False)


def _span_names(axes: Axes, panel: Panel) -> Iterator[Name]:
    """Yield the labels of hatched or shaded ranges of a plot."""
    (x0, bottom), (x1, top) = axes.bbox.get_points()
    for span in panel.spans:
        ends = axes.get_xaxis_transform().transform([(span.start, 0.5), (span.end, 0.5)])
        left, right = max(ends[0, 0], x0), min(ends[1, 0], x1)
        across = left + (right - left) * np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9, 0.0, 1.0])
        x, y = np.meshgrid(across, bottom + (top - bottom) * np.linspace(0.93, 0.07, 15))
        x, y = axes.transData.inverted().transform(np.column_stack([x.ravel(), y.ravel()])).T
        sample = {"color": _HATCHED, "linewidth": 5.0, "markerfacecolor": _SPANS[span.kind]["facecolor"]}
        yield Name(span.label, LIMIT, x, y, sample, "span")


def _end_names(panel: Panel) -> list[Name]:
    """Return the labels at the ends of curves.

    Several curves with the same label share one label.
    """
    ends: dict[str, list[tuple[Curve, _Look]]] = {}
    for curve, look in _looks(panel):
        if curve.end:
            ends.setdefault(curve.end, []).append((curve, look))
    names = []
    for text, sharing in ends.items():
        loud = [look.color for curve, look in sharing if not curve.quiet]
        color = loud[0] if len(set(loud)) == 1 else INK if loud else QUIET
        points = np.array([[values[curve.known][-1] for values in _xy(curve)] for curve, _ in sharing])
        sample = {"color": color, "linestyle": "None", "marker": "o", "markersize": 5.5, "markeredgewidth": 0.0}
        points = points[np.argsort(-points[:, 0], kind="stable")]
        names.append(Name(text, color, points[:, 0], points[:, 1], sample, "point"))
    return names


def _line_names(axes: Axes, panel: Panel) -> Iterator[Name]:
    """Yield the labels of reference lines in a plot."""
    (x0, y0), (x1, y1) = axes.bbox.get_points()
    shares = np.concatenate([[0.99, 0.01], np.linspace(0.95, 0.05, 19)])
    pixels = np.column_stack([x0 + shares * (x1 - x0), y0 + shares * (y1 - y0)])
    across, upward = axes.transData.inverted().transform(pixels).T
    for text, at in panel.levels.items():
        heights = [axes.transData.transform((across[0], level))[1] for level in (at, *panel.levels.values())]
        side = -1 if any(0 < height - heights[0] < _CLOSE for height in heights) else 1
        yield Name(text, LIMIT, across, np.full(21, at), _LINE, "line", side, _with_value(text, at, panel.y_label))
    for text, at in panel.positions.items():
        yield Name(text, LIMIT, np.full(21, at), upward, _LINE, "line", -1, _with_value(text, at, panel.x_label))


def _with_value(text: str, at: float, label: str) -> str:
    """Add the value of a reference line to its name."""
    # All reference lines look alike in a legend.
    unit = label.rpartition("[")[2].partition("]")[0]
    number = minus(f"{at:.4g}")
    return f"{text} (at {number if unit == '1' else f'{number} {unit}'})"


def _path(axes: Axes, curve: Curve) -> FloatArray:
    """Return points along the visible part of a curve [pixel]."""
    x, y = _xy(curve)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], curve.known, [False]]).astype(int)))
    runs = [slice(*run) for run in edges.reshape(-1, 2)]
    pixels = [np.asarray(axes.transData.transform(np.column_stack([x[run], y[run]]))) for run in runs]
    return inside(axes, np.concatenate(pixels if curve.kind == "points" else [dense_points(run) for run in pixels]))


def inside(axes: Axes, path: FloatArray) -> FloatArray:
    """Return only the points inside the axes of a plot [pixel]."""
    low, high = axes.bbox.get_points()
    return np.asarray(path[((path >= low) & (path <= high)).all(axis=1)])


def best_anchors(path: FloatArray, others: list[FloatArray]) -> FloatArray:
    """Return possible positions for the label of a curve.

    Positions far from other curves come first.
    """
    # Points near two thirds of the length are preferred.
    if not len(path):
        return path
    share = np.linspace(0.02, 0.98, _ANCHORS)
    anchors = path[np.unique((share * (len(path) - 1)).round().astype(int))]
    share = np.linspace(0.02, 0.98, len(anchors))
    score = -8.0 * np.abs(share - 0.65)
    if any(len(other) for other in others):
        other_points = np.concatenate(others)
        nearest = np.sqrt(((anchors[:, None] - other_points) ** 2).sum(axis=2)).min(axis=1)
        score += np.minimum(nearest, _CLEAR)
        if (nearest > _APART).any():
            anchors, score = anchors[nearest > _APART], score[nearest > _APART]
    return np.asarray(anchors[np.argsort(-score, kind="stable")])


def _set_axis(axes: Axes, panel: Panel, which: str) -> None:
    """Set limits, ticks and label of an axis.

    Very large or small values get a power of ten in the unit.
    """
    logarithmic, limits = getattr(panel, f"{which}_log"), getattr(panel, f"{which}_limits")
    low, high = limits or _data_limits(axes, panel, which)
    label = getattr(panel, f"{which}_label")
    if logarithmic:
        log_axis(axes, which, low, high)
    else:
        axis = axes.xaxis if which == "x" else axes.yaxis
        (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
        largest = max(abs(low), abs(high))
        formatter = ScalarFormatter(useOffset=False, useMathText=False)
        formatter.set_scientific(False)
        if not _DIGITS[0] <= largest < _DIGITS[1]:
            power = 3 * math.floor(math.log10(largest) / 3)
            formatter.set_scientific(True)
            formatter.set_powerlimits((power, power))
            label = _with_power(label, power)
        axis.set_major_formatter(formatter)
        axis.get_offset_text().set_visible(False)
    (axes.set_xlabel if which == "x" else axes.set_ylabel)(label, parse_math=False)


def _with_power(label: str, power: int) -> str:
    """Add a power of ten to the unit of a label."""
    # `force [N]` becomes `force [10⁻⁶ N]`.
    written = "10" + str(power).translate(
        str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")
    )
    head, _, unit = label.rpartition("[")
    return f"{head}[{written}{unit[1:] if unit.startswith('1]') else ' ' + unit}"


def _within_limits(curve: Curve, panel: Panel, which: str) -> Any:
    """Return a mask of the curve points within the axis limits."""
    # If the panel has no limits, or no point is within the limits, all points count as within.
    limits, values = getattr(panel, f"{which}_limits"), np.asarray(getattr(curve, which), float)
    within = (values >= limits[0]) & (values <= limits[1]) if limits else np.ones(len(values), dtype=bool)
    return within if within.any() else np.ones(len(values), dtype=bool)


def _data_limits(axes: Axes, panel: Panel, which: str) -> tuple[float, float]:
    """Return axis limits that contain everything in the plot."""
    if panel.map is not None:
        coordinates = np.asarray(getattr(panel.map, which))
        return coordinates[0], coordinates[-1]
    lines = panel.positions if which == "x" else panel.levels
    ends = [end for span in panel.spans for end in (span.start, span.end)] if which == "x" else []
    parts = [np.array([*lines.values(), *ends, *(getattr(mark, which) for mark in panel.marks)], float)]
    for curve in panel.curves:
        visible = _within_limits(curve, panel, "y" if which == "x" else "x")
        parts += [column[visible] for name, column in curve.columns() if (name == "x") == (which == "x")]
    values = np.concatenate(parts)
    values = values[np.isfinite(values)]
    low, high = float(values.min()), float(values.max())
    dotted = any(curve.kind != "line" for curve in panel.curves)
    before, after = (0.08, 0.08) if which == "y" else (0.03 if dotted else 0.0, 0.03 + _room_for_ends(axes, panel))
    if getattr(panel, f"{which}_log"):
        reach = math.log(high / low) or math.log(4.0)
        return low * math.exp(-before * reach), high * math.exp(after * reach)
    reach = high - low
    if reach <= 1e-12 * max(abs(low), abs(high)):
        margin = 0.5 * abs(high) or 1.0
        return low - margin, high + margin
    near = 0.15 if which == "y" else 0.03
    start = 0.0 if 0 <= low <= near * high else low - before * reach
    end = 0.0 if which == "y" and near * low <= high <= 0 else high + after * reach
    return start, end


def _room_for_ends(axes: Axes, panel: Panel) -> float:
    """Return the label width as a fraction of the remaining plot width."""
    low, high = axes.get_ylim()
    down = [c.end for c in panel.curves if c.end and np.asarray(c.y, float)[c.known][-1] < low + 0.05 * (high - low)]
    width = _LETTER * max((len(line) for text in down for line in text.split("\n")), default=0)
    share = width / max(axes.bbox.width - width, 1.0)
    return share if share < _MOST_ROOM else 0.0
