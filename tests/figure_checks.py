"""What every figure must keep: units on its axes, nothing outside the canvas, no text on other text."""

from __future__ import annotations

import re
from itertools import combinations

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

UNIT = re.compile(r"\[[^\]]+\]")
TOUCH = 1.0  # pixels at 100 dpi by which two boxes may share their air


def visible_texts(figure: Figure) -> list[tuple[str, Bbox]]:
    """Lay a figure out, and return every text that a reader sees, with its box in pixels."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw_without_rendering()  # all but the pixels, which nobody looks at
    texts = [text for axes in figure.axes for text in _texts_of(axes)]
    shown = [text for text in texts if text.get_visible() and text.get_text().strip()]
    return [(text.get_text(), text.get_window_extent(renderer)) for text in shown]


def _texts_of(axes: Axes) -> list[Text]:
    found = [axes.title, axes._left_title, axes._right_title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
    if axes.get_legend():
        found += [axes.get_legend().get_title(), *axes.get_legend().get_texts()]
    for axis in (axes.xaxis, axes.yaxis):
        low, high = sorted(axis.get_view_interval())
        air = 1e-9 * (high - low)
        found += [t.label1 for t in axis.get_major_ticks() if low - air <= t.get_loc() <= high + air]
        found.append(axis.get_offset_text())
    return found


def overlaps(texts: list[tuple[str, Bbox]]) -> list[tuple[str, str]]:
    """Return the pairs of texts that cover each other, of those that are visible."""
    return [
        (a, b)
        for (a, box_a), (b, box_b) in combinations(texts, 2)
        if min(box_a.x1, box_b.x1) - max(box_a.x0, box_b.x0) > TOUCH
        and min(box_a.y1, box_b.y1) - max(box_a.y0, box_b.y0) > TOUCH
    ]


def outside(figure: Figure, texts: list[tuple[str, Bbox]]) -> list[str]:
    """Return the texts that leave the canvas, of those that are visible."""
    width, height = figure.get_size_inches() * figure.dpi
    return [
        text for text, box in texts if box.x0 < -0.5 or box.y0 < -0.5 or box.x1 > width + 0.5 or box.y1 > height + 0.5
    ]


def labels_without_unit(figure: Figure) -> list[str]:
    """Return the axis labels that name no unit in brackets."""
    labels = [label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel())]
    return [label for label in labels if not UNIT.search(label)]


def is_blank(figure: Figure) -> bool:
    """Tell whether a figure shows no curve and no text."""
    return not any(axes.lines or axes.patches or axes.texts for axes in figure.axes)


def repeated_titles(figure: Figure) -> list[str]:
    """Return the titles that several panels of a figure have."""
    titles = [axes.get_title(loc) for axes in figure.axes for loc in ("left", "center") if axes.get_title(loc)]
    return sorted({title for title in titles if titles.count(title) > 1})


def crossed(figure: Figure) -> list[str]:
    """Return the texts inside a panel that a line of the panel crosses."""
    visible_texts(figure)  # lays the figure out
    renderer = FigureCanvasAgg(figure).get_renderer()
    found = []
    for axes in figure.axes:
        lines = [line for line in axes.lines if line.get_linestyle() not in {"None", ""}]
        paths = [line.get_transform().transform_path(line.get_path()) for line in lines]
        for text in (text for text in axes.texts if text.get_text().strip()):
            box = Text.get_window_extent(text, renderer).padded(-TOUCH)
            found += [text.get_text() for path in paths if path.intersects_bbox(box, filled=False)]
    return found


def assert_legible(figure: Figure) -> None:
    """Fail where a reader would miss a unit or could not read a text."""
    assert not is_blank(figure)
    assert labels_without_unit(figure) == []
    texts = visible_texts(figure)
    assert outside(figure, texts) == []
    assert overlaps(texts) == []
    assert repeated_titles(figure) == []
