"""Arrange the panels of a figure, and place the curve labels."""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from pretouch._core.numbers import FloatArray

from .labels import label_inside, label_near, marks_in
from .new_figure import new_figure
from .panel_drawing import Name, draw_panel, names_of
from .panel_maps import draw_map, number_contours

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    from .panels import Panel


_WIDTH: Final = 7.4  # inch
_WIDTH_OF_ONE: Final = 5.2
_GAP: Final = 0.09  # inch around a panel with its labels
_LEAST: Final = 0.5  # least share of the axes in the height of a row; otherwise the row grows
_REACHES: Final = (11.0, 34.0)  # pt from a curve to its name, without and with a leader line
_KINDS: Final = ("span", "point", "curve", "line")  # in the order of placement
_SIZES: Final = {"span": 7.5, "point": 8.0, "curve": 8.0, "line": 7.5}
_BREAKABLE: Final = 9  # least number of letters of a name that may be broken into two lines
_TICK_AIR: Final = 5.0  # pixels between the labels of ticks
_SAME: Final = 0.01  # inch
_SHORTEST: Final = 8  # letters of a broken line
_SAMPLE: Final = 26.0  # pt, width of a line sample in a legend and of the space around it


def draw_figure(panels: tuple[Panel, ...], columns: int, height: float) -> Figure:
    """Draw plots in a grid, with a legend above each plot.

    Returns:
        The figure. A legend contains the names that do not fit next to the curves.
    """
    width = _WIDTH_OF_ONE if len(panels) == 1 < columns else _WIDTH
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    figure = new_figure(width, rows * height)
    for i, panel in enumerate(panels):
        axes = figure.add_subplot(rows, columns, i + 1)
        if panel.map is not None:
            draw_map(axes, panel.map)
        draw_panel(axes, panel)
        axes.set_title(panel.title, y=1.0, parse_math=False)
    listed: list[set[int]] = [set() for _ in panels]
    bare = [set(axes.get_children()) for axes in figure.axes]
    while True:
        arrange(figure, _LEAST * height)
        each = zip(figure.axes, panels, listed, strict=True)
        unplaced = [_place_names(axes, panel, above) for axes, panel, above in each]
        if not any(unplaced):
            return figure
        listed = [above | more for above, more in zip(listed, unplaced, strict=True)]
        for axes, panel, drawn, above in zip(figure.axes, panels, bare, listed, strict=True):
            for artist in set(axes.get_children()) - drawn:
                artist.remove()
            names = names_of(axes, panel)
            listed_names = [names[k] for k in sorted(above)]
            texts = [name.listed or name.text.replace("\n", ", ") for name in listed_names]
            lines = [Line2D([], [], **name.sample) for name in listed_names]
            legend_above(axes, [(t, n.color, line) for t, n, line in zip(texts, listed_names, lines, strict=True)])


def arrange(figure: Figure, least: float) -> None:
    """Arrange the plots of a figure so that all labels fit.

    Args:
        figure: a figure with panels in a grid.
        least: least height of the axes [inch]; the figure grows if there is less room.
    """
    renderer: Any = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    engine = ConstrainedLayoutEngine(w_pad=_GAP, h_pad=_GAP, wspace=0.0, hspace=0.0)
    rows = figure.axes[0].get_gridspec().nrows  # type: ignore[union-attr]
    figure.align_ylabels(figure.axes)
    settled = False
    for _ in range(8):  # the size of labels depends on the ticks, which depend on the size of the axes
        changed = [_thin_ticks(axes, renderer) | _wrap_labels(axes, renderer, least) for axes in figure.axes]
        if settled and not any(changed):
            return
        with warnings.catch_warnings(record=True) as collapsed:  # Matplotlib's warning that there is no room
            warnings.simplefilter("always")
            engine.execute(figure)
        missing = least if collapsed else least - min(axes.bbox.height for axes in figure.axes) / figure.dpi
        settled = missing <= _SAME
        if not settled:
            figure.set_figheight(figure.get_figheight() + rows * missing)


def _thin_ticks(axes: Axes, renderer: Any) -> bool:
    """Show fewer ticks if tick labels would touch."""
    # The result is True if this was necessary.
    thinned = False
    for axis, side in ((axes.xaxis, 0), (axes.yaxis, 1)):
        for most in (6, 5, 4, 3, 2):
            low, high = sorted(axis.get_view_interval())
            labels = [label for label in axis.get_majorticklabels() if low <= label.get_position()[side] <= high]
            ends = sorted(tuple(label.get_window_extent(renderer).get_points()[:, side]) for label in labels)
            if all(right[0] - left[1] >= _TICK_AIR for left, right in pairwise(ends)):
                break
            locator: Any = axis.get_major_locator()
            locator.set_params(nbins=most)
            thinned = True
    return thinned


def _wrap_labels(axes: Axes, renderer: Any, least: float) -> bool:
    """Wrap axis labels and titles longer than the plot."""
    # The result is True if the line breaks of a text changed.
    texts = (axes.xaxis.label, axes._left_title, axes.yaxis.label)  # type: ignore[attr-defined]
    before = [text.get_text() for text in texts]
    height = max(axes.bbox.height, least * axes.figure.dpi)  # a lower panel will grow
    for text, side, room in zip(texts, (0, 0, 1), (axes.bbox.width, axes.bbox.width, height), strict=True):
        _break(text, text.get_text().replace("\n", " "), room, side, renderer)
    return before != [text.get_text() for text in texts]


def legend_above(axes: Axes, entries: Sequence[tuple[str, str, Any]]) -> None:
    """Write a legend between a plot and its title.

    The legend has as many columns as fit.

    Args:
        axes: the panel.
        entries: text, color of the text, and line of each entry.
    """
    if not entries:
        return
    renderer: Any = FigureCanvasAgg(axes.figure).get_renderer()  # type: ignore[arg-type, no-untyped-call]
    width = axes.bbox.width
    for columns in range(min(len(entries), 4), 0, -1):
        legend = axes.legend(
            [line for *_, line in entries],
            [str(i) for i in range(len(entries))],  # Matplotlib would read a text that begins with "_"
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=columns,
            frameon=False,
            labelcolor=[color for _, color, _ in entries],
            fontsize=8.0,
            borderpad=0.0,
            borderaxespad=0.4,
            handlelength=2.0,
            labelspacing=0.3,
            columnspacing=1.2,
        )
        for text, (label, *_) in zip(legend.get_texts(), entries, strict=True):
            text.set(parse_math=False, text=label)
            if columns == 1:
                _break(text, label, width - _SAMPLE / 72 * axes.figure.dpi, 0, renderer, hyphens=True)
        if legend.get_window_extent(renderer).x1 <= axes.bbox.x1:
            break
    pad = (legend.get_window_extent(renderer).y1 - axes.bbox.y1) / axes.figure.dpi * 72 + 6.0
    title = axes.get_title("left")
    axes.set_title(title, y=1.0, pad=pad, parse_math=False)
    legend.set_in_layout(not title)  # space for a title is space for its legend; a wide legend would narrow the panel


def _place_names(axes: Axes, panel: Panel, listed: set[int]) -> set[int]:
    """Write the labels of curves into a plot."""
    # The result contains the indices of labels without free space.
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
    """Write a label next to its curve."""
    # The result is True if there was free space.
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


def _break(text: Text, words: str, room: float, side: int, renderer: Any, *, hyphens: bool = False) -> None:
    """Break a text into as few lines as possible.

    Each line is at most `room` pixels long. Units remain whole.
    """
    head, bracket, unit = words.partition("[")
    whole = head + bracket + unit.replace(" ", "\u00a0")
    width = len(whole) + 1
    while True:
        lines = textwrap.wrap(whole, width, break_long_words=False, break_on_hyphens=hyphens)
        text.set_text("\n".join(lines).replace("\u00a0", " "))
        excess = text.get_window_extent(renderer).size[side] / room
        if excess <= 1 or width <= _SHORTEST:
            return
        width = max(_SHORTEST, min(width - 1, int(max(map(len, lines)) / excess) + 2))
