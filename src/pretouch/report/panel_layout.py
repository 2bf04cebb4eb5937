"""Arrange panels in a figure, and place the names of their curves."""

from __future__ import annotations

import textwrap
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D, Bbox, ScaledTranslation

from pretouch._core.numbers import FloatArray

from .labels import label_inside, label_near, marks_in
from .new_figure import new_figure
from .panel_drawing import Name, draw_panel, names_of
from .panel_maps import draw_map, number_contours

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    from .panels import Panel


_WIDTH: Final = 7.4  # inch
_WIDTH_OF_ONE: Final = 5.2
_EDGE: Final = 0.06
_GAP: Final = 0.2  # inch between panels, in addition to labels
_SMALLEST: Final = 0.4
_LEAST: Final = 0.5  # least share of the axes in the height of a row; otherwise the row grows
_REACHES: Final = (11.0, 34.0)  # pt from a curve to its name, without and with a leader line
_KINDS: Final = ("span", "point", "curve", "line")  # in the order of placement
_SIZES: Final = {"span": 7.5, "point": 8.0, "curve": 8.0, "line": 7.5}
_BREAKABLE: Final = 9  # least number of letters of a name that may be broken into two lines
_TICK_AIR: Final = 5.0  # pixels between the labels of ticks
_ROW_GAP: Final = 3.0  # pt, between lines of names
_TORN: Final = 16.0  # pt, largest distance between a title and its panel
_SAMPLE: Final = 20.0  # pt
_SAME: Final = 0.5  # pixels


class _Grid(NamedTuple):
    """A figure with its grid of plots, their smallest height [inch], and the measured tick labels."""

    figure: Figure
    rows: int
    columns: int
    least: float
    renderer: Any
    labels: dict[Any, tuple[FloatArray, FloatArray]]


def draw_figure(panels: tuple[Panel, ...], columns: int, height: float) -> Figure:
    """Draw plots in a grid; names of curves that do not fit into a plot are listed above the plot."""
    grid = _draw(panels, columns, height)
    listed: list[set[int]] = [set() for _ in panels]
    bare = [set(axes.get_children()) for axes in grid.figure.axes]
    while True:
        each = zip(grid.figure.axes, panels, listed, strict=True)
        unplaced = [_place_names(axes, panel, above) for axes, panel, above in each]
        if not any(unplaced):
            return grid.figure
        listed = [above | more for above, more in zip(listed, unplaced, strict=True)]
        for axes, drawn in zip(grid.figure.axes, bare, strict=True):
            for artist in set(axes.get_children()) - drawn:
                artist.remove()
        widths = [axes.bbox.width for axes in grid.figure.axes]
        artists = _list_names(grid, panels, listed)
        _fit(grid)
        if any(abs(axes.bbox.width - w) > _SAME for axes, w in zip(grid.figure.axes, widths, strict=True)):
            for artist in artists:  # the height of a list may change the width of its panel
                artist.remove()
            _list_names(grid, panels, listed)
            _fit(grid)
        _arrange(grid, final=True)


def _draw(panels: tuple[Panel, ...], columns: int, height: float) -> _Grid:
    """Draw plots at their final positions, without the names of curves."""
    width = _WIDTH_OF_ONE if len(panels) == 1 < columns else _WIDTH
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    figure = new_figure(width, rows * height)
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    grid = _Grid(figure, rows, columns, _LEAST * height, renderer, {})
    for i, panel in enumerate(panels):
        axes = figure.add_subplot(rows, columns, i + 1)
        if panel.map is not None:
            draw_map(axes, panel.map)
        draw_panel(axes, panel)
        axes.set_title(panel.title, y=1.0, parse_math=False)
    _fit(grid)
    _arrange(grid, final=True)
    return grid


def _fit(grid: _Grid) -> None:
    """Arrange the plots of a figure, and adapt ticks and labels to the size of the plots."""
    for _ in range(2):  # the size of labels depends on the ticks, which depend on the size of the axes
        _arrange(grid)
        changed = [_thin_ticks(axes, grid) | _wrap_labels(axes, grid.renderer) for axes in grid.figure.axes]
        if not any(changed):
            return


def _list_names(grid: _Grid, panels: tuple[Panel, ...], listed: list[set[int]]) -> list[Artist]:
    """Write lists of names between the plots and their titles."""
    artists: list[Artist] = []
    heights = np.zeros((grid.rows, grid.columns))  # pt
    for i, (axes, above) in enumerate(zip(grid.figure.axes, listed, strict=True)):
        names = names_of(axes, panels[i]) if above else []
        heights.flat[i], written = _write_list(axes, [names[k] for k in sorted(above)], grid.renderer)
        artists += written
    for i, axes in enumerate(grid.figure.axes):
        height, most = heights.flat[i], heights[i // grid.columns].max()
        shift = most if most - height < _TORN else height  # align titles, unless a title would be far from its panel
        pad = shift + 2 * _ROW_GAP if shift else None
        axes.set_title(axes.get_title("left"), y=1.0, pad=pad, parse_math=False)
    return artists


def _place_names(axes: Axes, panel: Panel, listed: set[int]) -> set[int]:
    """Write names of curves into a plot; return the indices of names that do not fit."""
    names = list(enumerate(names_of(axes, panel)))
    hardest_first = sorted(names, key=lambda each: (_KINDS.index(each[1].kind), -len(each[1].text)))
    marks = marks_in(axes)
    unplaced = {i for i, name in hardest_first if i not in listed and not _place(axes, name, marks)}
    if panel.map is not None:
        number_contours(axes)
    curves = {i for i, name in names if name.kind == "curve"}
    list_all = unplaced and 2 * len(curves & (unplaced | listed)) > len(curves)
    return unplaced | curves - listed if list_all else unplaced


def _place(axes: Axes, name: Name, marks: list[FloatArray]) -> bool:
    """Write a name in one or two lines next to its curve; return whether there was a free place."""
    if name.kind == "span":
        fill, size = name.sample["markerfacecolor"], _SIZES["span"]
        return label_inside(axes, name.x, name.y, name.text, color=name.color, size=size, fill=fill) is not None
    for reach in _REACHES[: 1 if name.kind == "line" else 2]:
        for text in dict.fromkeys((name.text, _in_two_lines(name.text))):
            label = label_near(
                axes,
                name.x,
                name.y,
                text,
                color=name.color,
                size=_SIZES[name.kind],
                reach=reach,
                side=name.side,
                strict=True,
                marks=marks,
            )
            if label is not None:
                label.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
                return True
    return False


def _in_two_lines(text: str) -> str:
    if len(text) < _BREAKABLE or "\n" in text or " " not in text:
        return text
    spaces = [i for i, letter in enumerate(text) if letter == " "]
    middle = min(spaces, key=lambda i: abs(i - len(text) / 2))
    return f"{text[:middle]}\n{text[middle + 1 :]}"


def _arrange(grid: _Grid, *, final: bool = False) -> None:
    """Give all plots of a figure the same size, with space between them for ticks and labels."""
    figure, rows, columns, least, *_ = grid
    figure.align_ylabels(figure.axes)
    over = np.zeros((4, max(rows, columns)))  # left, right, bottom, top [inch], by column or by row
    for i, axes in enumerate(figure.axes):
        row, column = divmod(i, columns)
        for k, side in enumerate(_overhang(axes, grid, final=final)):
            place = column if k < 2 else row
            over[k, place] = max(over[k, place], side / figure.dpi)
    width, height = figure.get_size_inches()
    wide = max((width - 2 * _EDGE - (columns - 1) * _GAP - over[:2].sum()) / columns, _SMALLEST)
    high = (height - 2 * _EDGE - (rows - 1) * _GAP - over[2:].sum()) / rows
    if high < least:
        height, high = height + rows * (least - high), least
        figure.set_size_inches(width, height)
    for i, axes in enumerate(figure.axes):
        row, column = divmod(i, columns)
        left = _EDGE + column * (_GAP + wide) + over[0, : column + 1].sum() + over[1, :column].sum()
        top = height - _EDGE - row * (_GAP + high) - over[3, : row + 1].sum() - over[2, :row].sum()
        axes.set_position((left / width, (top - high) / height, wide / width, high / height))


def _overhang(axes: Axes, grid: _Grid, *, final: bool) -> tuple[float, float, float, float]:
    """Return how far ticks and labels extend beyond the four sides of a plot [pixel].

    The sides are left, right, bottom and top.

    Texts that will be broken to fit do not count along the side that they must fit. The positions of labels follow
    Matplotlib's rule; asking Matplotlib would take five times as long.
    """
    inner: Any = axes.bbox
    renderer = grid.renderer
    boxes = [box for axis in (axes.xaxis, axes.yaxis) for box in _tick_boxes(axis, grid)]
    boxes += [inner, *(text.get_window_extent(renderer) for text in axes.texts)]
    union: Any = Bbox.union(boxes)
    upward, across, title = (t.get_window_extent(renderer) for t in (axes.yaxis.label, axes.xaxis.label, _title(axes)))
    pad = axes.xaxis.labelpad * axes.figure.dpi / 72
    left, right = inner.x0 - union.x0 + pad + upward.width, union.x1 - inner.x1
    bottom, top = inner.y0 - union.y0 + pad + across.height, max(union.y1, title.y1) - inner.y1
    if final:
        wide, high = (across.width - inner.width) / 2, (upward.height - inner.height) / 2
        left, right = max(left, wide), max(right, wide, title.x1 - inner.x1)
        bottom, top = max(bottom, high), max(top, high)
    return left, right, bottom, top


def _tick_boxes(axis: Any, grid: _Grid) -> list[Any]:
    """Return the boxes of the visible tick labels of an axis [pixel]."""
    # Sizes are measured only once.
    side, axes = "xy".index(axis.axis_name), axis.axes
    along: Any = (axes.get_xaxis_transform, axes.get_yaxis_transform)[side]()
    if axis not in grid.labels:
        low, high = sorted(axis.get_view_interval())
        labels = [t for t in axis.get_majorticklabels() if low <= t.get_position()[side] <= high and t.get_text()]
        places = np.array([t.get_position() for t in labels]).reshape(-1, 2)
        boxes = np.array([t.get_window_extent(grid.renderer).get_points() for t in labels]).reshape(-1, 2, 2)
        grid.labels[axis] = places, boxes - along.transform(places)[:, None]
    places, boxes = grid.labels[axis]
    return [Bbox(box) for box in boxes + along.transform(places)[:, None]]


def _title(axes: Axes) -> Text:
    title: Text = axes._left_title  # type: ignore[attr-defined]
    return title


def _thin_ticks(axes: Axes, grid: _Grid) -> bool:
    """Show fewer ticks if their labels would touch; return whether that was necessary."""
    thinned = False
    for axis, side in ((axes.xaxis, 0), (axes.yaxis, 1)):
        for most in (6, 5, 4, 3, 2):
            if not _touch(_tick_boxes(axis, grid), side):
                break
            del grid.labels[axis]
            locator: Any = axis.get_major_locator()
            locator.set_params(nbins=most)
            thinned = True
    return thinned


def _touch(boxes: list[Any], side: int) -> bool:
    ends = [(box.x0, box.x1) if side == 0 else (box.y0, box.y1) for box in boxes]
    return any(max(a[0], b[0]) - min(a[1], b[1]) < _TICK_AIR for a, b in pairwise(ends))


def _wrap_labels(axes: Axes, renderer: Any) -> bool:
    """Break axis labels and titles that are longer than the plot; return whether any label changed."""
    texts = (axes.xaxis.label, _title(axes), axes.yaxis.label)
    before = [text.get_text() for text in texts]
    for text, side in zip(texts, (0, 0, 1), strict=True):
        _break(text, text.get_text().replace("\n", " "), axes.bbox.size[side], side, renderer)
    return before != [text.get_text() for text in texts]


def _write_list(axes: Axes, names: list[Name], renderer: Any) -> tuple[float, list[Artist]]:
    """Write a list of names with line samples above a plot; return its height [pt] and the new texts."""
    dots = axes.figure.dpi / 72
    x, rows, placed = 0.0, [0.0], []
    for name in names:
        text = name.listed or name.text.replace("\n", ", ")
        label = axes.annotate(
            text,
            (0, 1),
            xycoords="axes fraction",
            xytext=(0, 0),
            textcoords="offset points",
            color=name.color,
            fontsize=_SIZES[name.kind],
            va="center",
            parse_math=False,
            annotation_clip=False,
        )
        room = axes.bbox.width - _SAMPLE * dots
        _break(label, text, room, 0, renderer, hyphens=True)
        size: FloatArray = np.asarray(label.get_window_extent(renderer).size) / dots
        if x and x + _SAMPLE + size[0] > axes.bbox.width / dots:
            x, rows = 0.0, [*rows, 0.0]
        rows[-1] = max(rows[-1], size[1] + _ROW_GAP)
        placed.append((name, label, x, len(rows)))
        x += _SAMPLE + size[0] + 12
    inside: Any = axes.transAxes
    corner = ScaledTranslation(0, 1, inside)  # points from the upper left corner of the axes
    points = Affine2D().scale(1 / 72) + axes.figure.dpi_scale_trans + corner
    artists: list[Artist] = []
    for name, label, left, row in placed:
        up = _ROW_GAP + sum(rows[row:]) + rows[row - 1] / 2
        label.set_position((left + _SAMPLE, up))
        sample = {**name.sample, "clip_on": False, "transform": points, "markevery": [1]}
        artists += [label, axes.add_artist(Line2D(left + np.array([0.0, 8.0, 16.0]), [up] * 3, **sample))]
    return sum(rows), artists


def _break(text: Text, words: str, room: float, side: int, renderer: Any, *, hyphens: bool = False) -> None:
    """Break a text into the fewest lines that fit into `room` [pixel], without breaking its unit."""
    head, bracket, unit = words.partition("[")
    whole = head + bracket + unit.replace(" ", "\u00a0")
    for width in range(len(whole) + 1, 7, -1):
        lines = textwrap.wrap(whole, width, break_long_words=False, break_on_hyphens=hyphens)
        text.set_text("\n".join(lines).replace("\u00a0", " "))
        if text.get_window_extent(renderer).size[side] <= room:
            break
