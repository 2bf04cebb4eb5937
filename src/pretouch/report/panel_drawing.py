"""Draw the panels of a figure: curves, points, ranges and maps, with a legend above each panel.

Matplotlib's constrained layout makes room for all texts. The end of a curve, and points that a legend cannot tell
apart, are named where they are.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from pretouch._core.numbers import FloatArray

from .new_figure import new_figure
from .style import BLOCKED, CURVES, INK, LIMIT, MARKERS, QUIET, log_axis, minus, minus_signs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import ContourSet
    from matplotlib.figure import Figure

    from .panels import Curve, Map, Mark, Panel

_WIDTH: Final = 7.4  # inch
_WIDTH_OF_ONE: Final = 5.2
_BESIDE: Final = 0.75  # inch of a panel for its vertical axis
_BELOW: Final = 0.45  # inch of a panel for its horizontal axis
_LINE_HEIGHT: Final = 0.16  # inch of a line of a legend
_LETTER: Final = 0.06  # inch, mean width of a letter of 8 pt
_TITLE: Final = 11.0  # pt, size of plain letters as wide as the bold letters of a title
_SAMPLE: Final = 6  # letters that have the width of the line sample of a legend and the space around it
_FAINT: Final = "#b4b4b4"
_HATCHED: Final = "#bdbdbd"
_SHAPES: Final = {"dot": ("o", True), "ring": ("o", False), "square": ("s", True)}
_MARKER_SIZES: Final = {"o": 4.4, "s": 4.0, "^": 5.0, "D": 3.8, "v": 5.0}
_DIGITS: Final = 1e-3, 1e5  # an axis whose largest number is outside gets a power of ten
_AT_EDGE: Final = 0.05  # share of a panel at its edge in which a contour line gets no number
_SHORT: Final = 18  # letters of the longest name of a point that is written next to it
_AT_TOP, _AT_BOTTOM = 0.9, 0.12  # shares of the height from which a text is below, and below which it is above
_FAR: Final = 2.0  # share of a panel: a longer step of a line leaves the panel
_OVER: Final = 0.05  # inch that a text may be above a panel, where nothing else is
_CLOSE: Final = 0.01  # share of a panel between two points of a line, so that a text cannot lie between them
_TEXT_HEIGHT: Final = 0.14  # inch between texts at the ends of curves
_LINE: Final[dict[str, Any]] = {"color": LIMIT, "linestyle": ":", "linewidth": 1.1, "zorder": 2}
_SPANS: Final[dict[str, dict[str, Any]]] = {
    "blocked": {"facecolor": BLOCKED, "edgecolor": _HATCHED, "hatch": "/////"},
    "missing": {"facecolor": BLOCKED, "edgecolor": _HATCHED, "hatch": "\\\\\\\\"},
    "used": {"facecolor": "#eef4f9"},
}
_SHADES: Final = ("#7fb2d6", "#ffffff")  # from low to high: dark enough to be distinct, light enough for text
_LEVELS: Final = 8
_CROWDED: Final = 0.6  # share of the map between two levels, from which the levels are quantiles


class LegendEntry(NamedTuple):
    """An entry of a legend: its text, the color of the text, and the drawn item."""

    text: str
    color: str
    handle: Any


def draw_figure(panels: Sequence[Panel], columns: int, height: float) -> Figure:
    """Draw panels in a grid, with a legend above each of them.

    Args:
        panels: the panels, row by row.
        columns: largest number of panels in a row.
        height: height of a row [inch], without legends.

    Returns:
        The figure.
    """
    width = _WIDTH_OF_ONE if len(panels) == 1 < columns else _WIDTH
    columns = min(columns, len(panels))
    rows, room = -(-len(panels) // columns), width / columns - _BESIDE
    entries = [list(_entries(panel)) for panel in panels]
    titles = [_wrapped(panel.title, room, _TITLE).count("\n") for panel in panels]
    lines = max(_legend_shape(each, room)[1] + more for each, more in zip(entries, titles, strict=True))
    figure = new_figure(width, rows * (height + _LINE_HEIGHT * lines))
    figure.set_layout_engine("constrained", w_pad=0.06, h_pad=0.06)
    for i, (panel, listed) in enumerate(zip(panels, entries, strict=True)):
        axes = figure.add_subplot(rows, columns, i + 1)
        contours = None if panel.map is None else _draw_map(axes, panel.map)
        _draw_panel(axes, panel, room, height - _BELOW)
        if contours is not None:
            _number_contours(axes, contours, np.array([room, height - _BELOW]))
        add_legend(axes, listed, panel.title, room)
    figure.align_ylabels()
    return figure


def add_legend(axes: Axes, entries: Sequence[LegendEntry], title: str, room: float) -> None:
    """Write a legend between a panel and its title, in as many columns as fit.

    Args:
        axes: the panel.
        entries: the entries; without any, only the title is written.
        title: title of the panel; empty for none.
        room: width of the panel [inch].
    """
    if not entries:
        axes.set_title(_wrapped(title, room, _TITLE), parse_math=False)
        return
    columns, _ = _legend_shape(entries, room)
    legend = axes.legend(
        [entry.handle for entry in entries],
        [str(i) for i in range(len(entries))],  # Matplotlib would read a text that begins with "_"
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        frameon=False,
        alignment="left",
        fontsize=8.0,
        borderpad=0.0,
        borderaxespad=0.4,
        handlelength=2.0,
        labelspacing=0.3,
        columnspacing=1.2,
    )
    for text, entry in zip(legend.get_texts(), entries, strict=True):
        text.set(parse_math=False, text=_wrapped(entry.text, room - _SAMPLE * _LETTER, 8.0), color=entry.color)
    if title:
        legend.set_title(_wrapped(title, room, _TITLE), FontProperties(size=9.0, weight="bold"))
        legend.get_title().set_parse_math(False)


def _legend_shape(entries: Sequence[LegendEntry], room: float) -> tuple[int, int]:
    """Return the largest number of columns that fit, and the number of lines."""
    wrapped = [_wrapped(entry.text, room - _SAMPLE * _LETTER, 8.0).split("\n") for entry in entries]
    letters = [max(map(len, lines)) + _SAMPLE for lines in wrapped]
    for columns in range(min(len(entries), 4), 1, -1):
        if sum(int(max(part)) for part in np.array_split(letters, columns)) * _LETTER <= room:
            break
    else:
        columns = 1
    return columns, -(-sum(map(len, wrapped)) // columns)


def _entries(panel: Panel) -> Iterator[LegendEntry]:
    """Yield the legend entries of a panel."""
    for curve, look in _looks(panel):
        if curve.label:
            color = QUIET if curve.quiet else look.color
            yield LegendEntry(_in_one_line(curve.label), color, Line2D([], [], **_curve_style(curve, look)))
    for mark in panel.marks:
        if mark.label and not _is_written(mark):
            yield LegendEntry(_in_one_line(mark.label), _color(mark.style), _mark_sample(mark))
    for span in panel.spans:
        if span.label:
            yield LegendEntry(minus_signs(span.label), LIMIT, Patch(**_SPANS[span.kind], linewidth=0))
    for lines, label in ((panel.levels, panel.y_label), (panel.positions, panel.x_label)):
        for text, at in lines.items():
            if text.strip():
                yield LegendEntry(_with_value(minus_signs(text), at, label), LIMIT, Line2D([], [], **_LINE))


def _in_one_line(text: str) -> str:
    return minus_signs(text).replace("\n", ", ")


def _is_written(mark: Mark) -> bool:
    """Return True if the name of a point is short enough to be written next to it."""
    return 0 < len(mark.label) <= _SHORT and "\n" not in mark.label


def _draw_panel(axes: Axes, panel: Panel, width: float, height: float) -> None:
    """Draw a panel of a width and height [inch], which do not include its labels, without its legend."""
    zoomed = panel.x_limits is not None or panel.y_limits is not None
    for curve, look in _looks(panel):
        _draw_curve(axes, curve, look, clipped=zoomed)
    for span in panel.spans:
        axes.axvspan(span.start, span.end, **_SPANS[span.kind], linewidth=0, zorder=0.5)
    for at in panel.levels.values():
        axes.axhline(at, **_LINE)
    for at in panel.positions.values():
        axes.axvline(at, **_LINE)
    for which, room in (("y", height), ("x", width)):
        _set_axis(axes, panel, which, room)
    for mark in panel.marks:
        axes.plot([mark.x], [mark.y], clip_on=False, **_mark_style(mark))
    texts = [_Text(mark.label, mark.x, mark.y, _color(mark.style), False) for mark in panel.marks if _is_written(mark)]
    _write(axes, [*texts, *_draw_ends(axes, panel)], _lines_of(axes, panel) * [width, height], width, height)


class _Look(NamedTuple):
    color: str
    dashes: Any
    marker: str


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


def _mark_style(mark: Mark) -> dict[str, Any]:
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


def _mark_sample(mark: Mark) -> Line2D:
    return Line2D([], [], **_mark_style(mark))


def _curve_style(curve: Curve, look: _Look) -> dict[str, Any]:
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
    style = _curve_style(curve, look)
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


class _Text(NamedTuple):
    """A text next to a point of a panel."""

    text: str
    x: float
    y: float
    color: str
    falls: bool  # whether the curve falls toward the point, so that the text is better below it


def _draw_ends(axes: Axes, panel: Panel) -> Iterator[_Text]:
    """Mark the ends of curves inside the limits; yield each text once, at its rightmost end."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    ends: dict[str, list[_Text]] = {}
    for curve, look in _looks(panel):
        x, y = (values[curve.known] for values in _xy(curve))
        if not curve.end or not (left <= x[-1] <= right and low <= y[-1] <= high):
            continue
        size, zorder = (3.6, 2.8) if curve.quiet else (5.5, 5.0)
        style: dict[str, Any] = {"markersize": size, "markeredgewidth": 0, "zorder": zorder, "clip_on": False}
        axes.plot(x[-1:], y[-1:], "o", color=look.color, **style)
        color = QUIET if curve.quiet else look.color
        end = _Text(curve.end, float(x[-1]), float(y[-1]), color, bool(y[-1] < y[-1 - len(y) // 10]))
        ends.setdefault(curve.end, []).append(end)
    for sharing in ends.values():
        colors = {end.color for end in sharing} - {QUIET}
        yield max(sharing)._replace(color=colors.pop() if len(colors) == 1 else INK if colors else QUIET)


class _Place(NamedTuple):
    """A place for a text next to its point [inch]."""

    left: float
    right: float
    bottom: float
    top: float
    above: bool
    to_right: bool
    shift: float  # away from the point, because of other texts

    def covers(self, points: FloatArray) -> int:
        """Return how many of some points the text would cover."""
        x, y = points[:, 0], points[:, 1]
        return int(np.sum((x > self.left) & (x < self.right) & (y > self.bottom) & (y < self.top)))


def _lines_of(axes: Axes, panel: Panel) -> FloatArray:
    """Return points on all lines of a panel, as shares of its width and height, close enough that a text meets one."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    lines = [np.column_stack(_xy(curve)) for curve in panel.curves if curve.kind != "points"]
    lines += [np.array([[left, at], [right, at]]) for at in panel.levels.values()]
    lines += [np.array([[at, low], [at, high]]) for at in panel.positions.values()]
    if not lines:
        return np.empty((0, 2))
    places = _shares(axes, np.concatenate([part for line in lines for part in (line, np.full((1, 2), np.nan))]))
    steps = np.diff(places, axis=0)
    length = np.hypot(*steps.T)
    known = np.flatnonzero(np.isfinite(length))
    count = 1 + (np.minimum(length[known], _FAR) / _CLOSE).astype(int)
    first = np.repeat(known, count)
    share = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)) / np.repeat(count, count)
    return np.asarray(places[first] + share[:, None] * steps[first])


def _write(axes: Axes, texts: Sequence[_Text], lines: FloatArray, width: float, height: float) -> None:
    """Write texts next to their points, one above the other where they would touch, and off the lines where possible.

    Points on the lines, width and height of the panel are in inches.
    """
    boxes: list[_Place] = []  # of the texts written so far
    points = _shares(axes, [(text.x, text.y) for text in texts])
    for i in np.argsort(points[:, 1], kind="stable"):
        (across, up), text = points[i], texts[i]
        rows = text.text.split("\n")
        size = np.array([0.08 + 1.1 * _LETTER * max(map(len, rows)), _TEXT_HEIGHT * len(rows)])  # with some air
        at_bottom = up < _AT_BOTTOM
        above = at_bottom or not (up > _AT_TOP or text.falls)
        to_right = at_bottom or across * width + size[0] < width
        sides = [(above, to_right), (not above, to_right), (above, not to_right), (not above, not to_right)]
        places = [_place((across * width, up * height), size, *side, boxes) for side in sides]
        fitting = [p for p in places if p.left >= 0 and p.bottom >= 0 and p.top <= height + _OVER]
        inside = [p for p in fitting if p.right <= width]  # beyond the right end, the layout makes room
        place = min([places[0], *inside, *fitting], key=lambda p: p.covers(lines))  # the first one of equals
        boxes.append(place)
        above, to_right, more = place.above, place.to_right, place.shift
        label = axes.annotate(
            minus_signs(text.text),
            (text.x, text.y),
            xytext=(6.0 if to_right else -6.0, (3.0 if above else -3.0) + 72 * more),
            textcoords="offset points",
            ha="left" if to_right else "right",
            va="bottom" if above else "top",
            color=text.color,
            fontsize=8.0,
            annotation_clip=False,
            parse_math=False,
            zorder=6,
        )
        label.set_path_effects([withStroke(linewidth=2.0, foreground="white")])


def _place(
    point: tuple[float, float], size: FloatArray, above: bool, to_right: bool, boxes: Sequence[_Place]
) -> _Place:
    """Return the place of a text of a size at one side of its point, farther away than other texts there [inch]."""
    left = point[0] + (0.08 if to_right else -0.08 - size[0])
    bottom = point[1] + (0.04 if above else -0.04 - size[1])
    shift = 0.0
    while any(
        left < box.right
        and box.left < left + size[0]
        and bottom + shift < box.top
        and box.bottom < bottom + shift + size[1]
        for box in boxes
    ):
        shift += _TEXT_HEIGHT / 2 if above else -_TEXT_HEIGHT / 2
    return _Place(left, left + size[0], bottom + shift, bottom + shift + size[1], above, to_right, shift)


def _shares(axes: Axes, places: Sequence[Any] | FloatArray) -> FloatArray:
    """Return places of a panel as shares of its width and height, shape (n, 2)."""
    pixels = axes.transData.transform(np.reshape(np.asarray(places, float), (-1, 2)))
    return np.asarray(axes.transAxes.inverted().transform(pixels))


def _with_value(text: str, at: float, label: str) -> str:
    """Add the value of a reference line to its name, because all reference lines look alike."""
    unit = label.rpartition("[")[2].partition("]")[0]
    number = minus(f"{at:.4g}")
    return f"{text} (at {number if unit == '1' else f'{number} {unit}'})"


def _wrapped(text: str, room: float, size: float) -> str:
    """Break a text into lines for a width [inch]; a unit stays whole."""
    head, bracket, unit = text.partition("[")
    width = max(12, int(room / (_LETTER * size / 8.0)))
    whole = head + bracket + unit.replace(" ", "\u00a0")
    lines = textwrap.wrap(whole, width, break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines).replace("\u00a0", " ")


def _set_axis(axes: Axes, panel: Panel, which: str, room: float) -> None:
    """Set limits, ticks and label of an axis. Very large or small values get a power of ten in the unit."""
    logarithmic, limits = getattr(panel, f"{which}_log"), getattr(panel, f"{which}_limits")
    low, high = limits or _data_limits(panel, which)
    label = getattr(panel, f"{which}_label")
    if logarithmic:
        log_axis(axes, which, low, high)
    else:
        axis = axes.xaxis if which == "x" else axes.yaxis
        (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
        largest = max(abs(low), abs(high))
        letters = len(f"{largest:.0f}") + max(0, math.ceil(-math.log10((high - low) / 6))) + 2
        most = 6 if which == "y" else max(2, min(6, int(room / (letters * _LETTER))))
        axis.set_major_locator(MaxNLocator(most, steps=[1, 2, 2.5, 5, 10]))
        formatter = ScalarFormatter(useOffset=False, useMathText=False)
        formatter.set_scientific(False)
        if not _DIGITS[0] <= largest < _DIGITS[1]:
            power = 3 * math.floor(math.log10(largest) / 3)
            formatter.set_scientific(True)
            formatter.set_powerlimits((power, power))
            label = _with_power(label, power)
        axis.set_major_formatter(formatter)
        axis.get_offset_text().set_visible(False)
    (axes.set_xlabel if which == "x" else axes.set_ylabel)(_wrapped(label, room, 8.5), parse_math=False)


def _with_power(label: str, power: int) -> str:
    """Add a power of ten to the unit of a label. `force [N]` becomes `force [10⁻⁶ N]`."""
    written = "10" + str(power).translate(
        str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")
    )
    head, _, unit = label.rpartition("[")
    return f"{head}[{written}{unit[1:] if unit.startswith('1]') else ' ' + unit}"


def _within_limits(curve: Curve, panel: Panel, which: str) -> Any:
    """Return a mask of the curve points within the axis limits; of all points if there are none."""
    limits, values = getattr(panel, f"{which}_limits"), np.asarray(getattr(curve, which), float)
    within = (values >= limits[0]) & (values <= limits[1]) if limits else np.ones(len(values), dtype=bool)
    return within if within.any() else np.ones(len(values), dtype=bool)


def _data_limits(panel: Panel, which: str) -> tuple[float, float]:
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
    before, after = (0.08, 0.08) if which == "y" else (0.03 if dotted else 0.0, 0.03)
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


def _draw_map(axes: Axes, shown: Map) -> ContourSet | None:
    """Draw a quantity as a map with shades and contour lines, as the background of a panel; return the lines."""
    axes.patch.set(facecolor=BLOCKED, edgecolor=QUIET, hatch="////", linewidth=0)  # visible where there is no value
    values = np.ma.masked_invalid(shown.values)
    low, high = float(values.min()), float(values.max())
    levels = _contour_levels(values.compressed()) if low < high else np.array([low - 1.0, low + 1.0])
    shades = LinearSegmentedColormap.from_list("pretouch", _SHADES if low < high else _SHADES[1:] * 2)
    filled = axes.contourf(shown.x, shown.y, values, levels=levels, cmap=shades, zorder=0.7)
    if low == high:
        axes.text(0.5, 0.5, minus(f"{low:.4g} everywhere"), transform=axes.transAxes, ha="center", color=INK)
        return None
    inner = levels[(levels > low) & (levels < high)]
    return axes.contour(filled, levels=inner, colors=INK, linewidths=0.8, linestyles="solid", zorder=0.9)


def _number_contours(axes: Axes, contours: ContourSet, size: FloatArray) -> None:
    """Write the value of each contour line at its middle, except at the edge of the panel and on another number.

    The size [inch] is that of the panel.
    """
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}
    numbers: list[FloatArray] = []  # places of the numbers so far [inch]
    for level, parts in zip(contours.levels, contours.allsegs, strict=True):
        text = minus(f"{level:.4g}")
        middle = max(parts, key=len, default=np.full((1, 2), np.nan))
        place = middle[len(middle) // 2]
        share = _shares(axes, [place])[0]
        apart = np.array([1.2 * _LETTER * len(text), 1.5 * _TEXT_HEIGHT])
        covers = any((np.abs(share * size - other) < apart).all() for other in numbers)
        if (np.abs(share - 0.5) < 0.5 - _AT_EDGE).all() and not covers:
            numbers.append(share * size)
            axes.text(place[0], place[1], text, fontsize=7.5, ha="center", va="center", bbox=box, zorder=1)


def _contour_levels(values: FloatArray) -> FloatArray:
    """Choose equally spaced contour levels of a map, or quantiles if most values are close together."""
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
