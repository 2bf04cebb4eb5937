"""What charts promise: units, a name for every curve, nothing on top of anything, and the same bytes each time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from figure_checks import assert_legible, crossed, visible_texts
from pretouch.report import Curve, Map, Mark, Panel, Span, panel_figure
from pretouch.report.style import CURVES, MARKERS
from refusals import refused

X = np.linspace(0.0, 10.0, 200)
LONG = (
    "exponential, first order",
    "exponential, second order",
    "inverse power with offset",
    "Mittag-Leffler of order 0.8",
    "table of measured values",
)


def panel(*curves: Curve, **given: Any) -> Panel:
    return Panel(**{"x_label": "time t [s]", "y_label": "distance l [mm]", "curves": curves, **given})


def line(**given: Any) -> Curve:
    return Curve(**{"x": X, "y": np.exp(-X / 4), **given})


def crossing() -> Panel:
    curves = [line(y=np.sin(X * (0.5 + 0.12 * i) + i), label=name) for i, name in enumerate(LONG)]
    return panel(*curves, title="Five curves that cross")


def motions() -> Panel:
    curves = []
    for i, name in enumerate(("no mitigation", "exponential", "inverse power", "table")):
        time = np.linspace(0.0, 280.0 + 43.0 * i, 90)
        shape = 1.5 - 0.2 * i
        curves.append(Curve(x=time, y=42.0 * (1 - (time / time[-1]) ** shape), label=name, end="contact"))
    return panel(*curves, x_label="time t [ms]", levels={"recess": 2.0}, positions={"reaction time": 100.0})


def logarithmic() -> Panel:
    frequency = np.geomspace(0.01, 100.0, 60)
    curves = [
        Curve(x=frequency, y=1 / np.hypot(1.0, frequency / corner), label=f"corner {corner:g} Hz", kind=kind)
        for corner, kind in ((0.1, "line"), (1.0, "both"), (10.0, "points"))
    ]
    lines = {"levels": {"\u22123 dB": 0.708}, "positions": {"sampling rate": 50.0}}
    labels = {"x_label": "frequency f [Hz]", "y_label": "magnitude |H| [1]"}
    return panel(*curves, **lines, **labels, x_log=True, y_log=True)


def tiny() -> Panel:
    y = 3e-6 * np.exp(-X[::8] / 3)
    points = Curve(x=X[::8], y=y, low=0.9 * y, high=1.2 * y, kind="points", label="measured")
    return panel(points, line(y=2.9e-6 * np.exp(-X / 3.2), label="model"), y_label="impulse [N s]")


def negative() -> Panel:
    y = -0.3 * np.exp(-X / 4)
    curves = (
        line(y=y, low=1.2 * y, high=0.8 * y, label="chosen gain"),
        line(y=0 * X - 0.3, label="none", end="contact"),
    )
    return panel(*curves, y_label="relative velocity l\u2032 [m/s]", levels={"limit": -0.1})


def family() -> Panel:
    quiet = [line(y=np.exp(-X / (3 + i / 6)), quiet=True, label="neighbors" if i == 29 else "") for i in range(30)]
    marks = (Mark(x=10.0, y=np.exp(-2.0), label="end", shape="ring"), Mark(x=0.0, y=1.0, label="start", shape="square"))
    return panel(*quiet, line(y=np.exp(-X / 5), label="optimum"), marks=marks)


def border() -> Panel:
    gain = np.geomspace(0.01, 10.0, 80)
    marks = (Mark(x=10.0, y=0.74, label="bound", style=1), Mark(x=0.01, y=4.94, label="other bound"))
    curve = Curve(x=gain, y=0.1 + (np.log10(gain) - 0.2) ** 2, label="objective")
    lines = {"target": 1.0, "floor": 0.9}
    return panel(curve, x_label="gain [N s]", x_log=True, x_limits=(0.01, 10.0), marks=marks, levels=lines)


def stretches() -> Panel:
    spans = [Span(start=0.0, end=2.5, label="broken: excursion, virtual force"), Span(start=7.0, end=9.0, kind="used")]
    spans.append(Span(start=2.5, end=7.0, label="no contact", kind="missing"))
    return panel(line(y=np.exp(-X / 5), label="objective"), spans=spans)


def dense() -> Panel:
    curves = [line(y=1000 + 0.001 * np.sin(8 * X + i), label=name) for i, name in enumerate(LONG)]
    words = "a label of an axis that is by far too long to be written into a single line q [N s/m]"
    return panel(*curves, y_label=words, x_label=words, title=words)


def gaps() -> Panel:
    y = np.where((X > 2) & (X < 4) | (X > 8), np.nan, X)
    alone = Curve(x=[1.0, 2.0, 3.0], y=[np.nan, 4.0, np.nan], label="one point", end="here")
    return panel(line(y=y, label="interrupted, costs $5 or $6"), alone)


def plane() -> Panel:
    x, y = np.linspace(0.0, 10.0, 40), np.geomspace(0.1, 10.0, 30)
    values = np.where(x > 8.0, np.nan, np.sin(x / 3.0) * np.log(y)[:, None])
    border = Curve(x=x, y=1.0 + x / 5.0, label="border", style=1)
    return panel(border, map=Map(x=x, y=y, values=values), title="height h [mm]", y_log=True)


PANELS: dict[str, Callable[[], Panel]] = {
    f.__name__: f
    for f in (crossing, motions, logarithmic, tiny, negative, family, border, stretches, dense, gaps, plane)
}


def words(figure: Figure) -> list[str]:
    return [text.replace("-\n", "-").replace("\n", " ") for text, _ in visible_texts(figure)]


def drawn(figure: Figure, kind: str = "svg") -> bytes:
    content = BytesIO()
    figure.savefig(content, format=kind)
    return content.getvalue()


def names_in(shown: Panel) -> list[str]:
    labels = [item.label for item in (*shown.curves, *shown.marks, *shown.spans)] + [
        curve.end for curve in shown.curves
    ]
    return [text for text in (*labels, *shown.levels, *shown.positions) if text]


GRIDS: list[tuple[int, dict[str, Any]]] = [(1, {}), (2, {}), (3, {"columns": 3, "height": 2.6}), (1, {"columns": 1})]


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("name", "copies", "given"),
    [(name, *grid) for name in PANELS for grid in GRIDS if (name, grid[0]) != ("dense", 3)],  # 80 letters need room
)
def test_charts_are_legible_and_name_everything(name: str, copies: int, given: dict[str, Any]) -> None:
    shown = PANELS[name]()
    figure = panel_figure(*[shown] * copies, **given)
    assert_legible(figure)
    found = words(figure)
    for text in names_in(shown):
        assert sum(text in word for word in found) >= copies


def test_four_different_panels_stand_side_by_side() -> None:
    figure = panel_figure(motions(), logarithmic(), tiny(), negative())
    assert_legible(figure)
    width, height = figure.get_size_inches()
    assert (width, height > 6.6) == (7.4, True)  # a row is higher by the lines of its legends
    sizes = np.array([axes.get_position().size for axes in figure.axes])
    assert np.allclose(sizes[:, 0], sizes[0, 0], rtol=0.1)


def test_rows_grow_where_lists_of_names_would_leave_no_room() -> None:
    figure = panel_figure(dense(), dense(), height=2.0)
    assert figure.get_size_inches()[1] > 2.0
    assert figure.axes[0].bbox.height >= 0.99 * figure.dpi


def test_what_is_seen_lies_inside_the_canvas_however_wide_the_tick_labels_are() -> None:
    wide = panel(line(y=123456.0 + 1e-3 * X, label="drift"), y_limits=(123455.99, 123456.02), y_label="force [N]")
    assert_legible(panel_figure(wide, wide, wide, columns=3))


def test_every_end_is_marked_and_its_text_is_written_once() -> None:
    figure = panel_figure(motions())
    dots = {(float(d.get_xdata()[0]), float(d.get_ydata()[0])) for d in figure.axes[0].lines if d.get_marker() == "o"}
    for curve in motions().curves:
        assert (np.asarray(curve.x)[-1], np.asarray(curve.y)[-1]) in dots
    assert words(figure).count("contact") == 1


def test_the_end_is_the_last_finite_point() -> None:
    shown = panel(line(y=np.where(X > 5, np.nan, X), end="lost"))
    dots = [d for d in panel_figure(shown).axes[0].lines if d.get_marker() == "o" and len(d.get_xdata())]
    assert [float(d.get_xdata()[0]) for d in dots] == [X[X <= 5][-1]]


def test_the_legend_above_a_panel_names_each_curve_in_its_color() -> None:
    figure = panel_figure(panel(line(y=0 * X + 1, label="upper"), line(y=0 * X, label="_lower $", style=3)))
    axes = figure.axes[0]
    texts = axes.get_legend().get_texts()
    assert [(t.get_text(), t.get_color()) for t in texts] == [("upper", CURVES[0][0]), ("_lower $", CURVES[3][0])]
    assert all(box.y0 >= axes.bbox.y1 for text, box in visible_texts(figure) if text in {"upper", "_lower $"})


def test_texts_at_neighboring_points_do_not_cover_each_other() -> None:
    """A marker and a text each for two points that nearly coincide, at the end of two curves."""
    marks = [Mark(x=10.0, y=0.05, label="\u22120.0741 m/s"), Mark(x=10.1, y=0.0501, label="\u22120.0739 m/s", style=1)]
    curves = [line(y=X / 200, end="on the loop"), line(y=X / 199, end="predicted")]
    assert_legible(panel_figure(panel(*curves, marks=marks, y_limits=(-0.3, 0.1)), panel(line())))


def test_no_word_is_broken_however_long_it_is() -> None:
    word = "counterelectromotiveforcecompensationfactor"
    figure = panel_figure(*[panel(line(), y_label=f"{word} of the drive [N s/m]", x_label=f"{word} [s]")] * 3)
    shown = [text for text in words(figure) if "counter" in text]
    assert len(shown) >= 4
    assert all(word in text for text in shown)


def test_tiny_and_huge_numbers_put_a_power_of_ten_into_the_unit() -> None:
    assert panel_figure(tiny()).axes[0].get_ylabel() == "impulse [10\u207b\u2076 N s]"
    huge = panel(line(y=2e6 * X, label="a"), y_label="count [1]")
    assert panel_figure(huge).axes[0].get_ylabel() == "count [10\u2076]"


def test_a_positive_quantity_near_zero_starts_at_zero() -> None:
    assert panel_figure(panel(line(y=X))).axes[0].get_ylim()[0] == 0
    assert panel_figure(panel(line(y=-X))).axes[0].get_ylim()[1] == 0
    assert panel_figure(panel(line(y=50 + X))).axes[0].get_ylim()[0] > 40


def test_limits_asked_for_are_kept_and_the_other_axis_follows_what_is_seen() -> None:
    axes = panel_figure(panel(line(y=X**2), x_limits=(0.0, 2.0))).axes[0]
    assert axes.get_xlim() == (0.0, 2.0)
    assert axes.get_ylim()[1] < 5


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("kind", ["svg", "png"])
def test_the_same_chart_gives_the_same_bytes(kind: str) -> None:
    charts = [panel_figure(motions(), dense(), family()) for _ in range(2)]
    assert drawn(charts[0], kind) == drawn(charts[1], kind)


@pytest.mark.slow
def test_charts_show_themselves_in_a_notebook_and_need_no_pyplot() -> None:
    assert panel_figure(tiny())._repr_png_().startswith(b"\x89PNG")
    code = (
        "import sys; from pretouch.report import *; assert 'matplotlib' not in sys.modules; "
        "panel_figure(Panel(x_label='x [1]', y_label='y [1]', curves=[Curve(x=[0, 1], y=[0, 1])])); "
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def told_apart(*styles: tuple[str, Any]) -> bool:
    """Whether no two lines look the same on a gray print: by brightness, strokes in a period, ink, or its length."""

    def look(color: str, pattern: Any) -> np.ndarray:
        strokes = (1.0, 0.0) if pattern == "-" else pattern[1]
        length, ink = sum(strokes), sum(strokes[::2]) / sum(strokes)
        brightness = float(np.dot(to_rgb(color), (0.2126, 0.7152, 0.0722)))
        return np.array([brightness / 0.25, len(strokes) / 2, ink / 0.15, np.log(length) / np.log(1.5)])

    looks = [look(*style) for style in styles]
    return all(np.abs(one - other).max() >= 1 for i, one in enumerate(looks) for other in looks[:i])


def test_the_five_styles_differ_in_grey() -> None:
    assert told_apart(*CURVES)
    assert not told_apart(*CURVES, CURVES[2])
    assert not told_apart(("#0072b2", "-"), ("#8a4f7d", "-")), "colors as bright as each other"
    assert not told_apart(("#0072b2", (0, (5, 1.6))), ("#0072b2", (0, (5.2, 1.7)))), "nearly the same strokes"
    assert len(set(MARKERS)) == len(MARKERS) == len(CURVES)


def test_quiet_curves_take_no_place_in_the_palette() -> None:
    figure = panel_figure(panel(line(quiet=True), line(y=X / 10, label="loud")))
    colors = [part.get_color() for part in figure.axes[0].lines if len(part.get_xdata()) == len(X)]
    assert colors[1] == CURVES[0][0] != colors[0]


def test_values_are_frozen_and_keep_no_hold_on_what_they_were_made_from() -> None:
    given = np.arange(3.0)
    curve = Curve(x=given, y=given, label="a")
    given[0] = 9.0
    assert np.asarray(curve.x)[0] == 0.0
    with pytest.raises(AttributeError):
        curve.label = "b"  # type: ignore[misc]
    assert repr(curve) == "<Curve a: 3 of 3 points>"
    assert repr(panel(curve, title="T")) == "<Panel T over time t [s]: 1 curve>"


def test_masked_numbers_are_missing() -> None:
    curve = Curve(x=[1, 2, 3], y=np.ma.masked_greater([1.0, 2.0, 30.0], 10.0))
    assert np.asarray(curve.known).tolist() == [True, True, False]


def test_a_map_is_the_same_in_whatever_order_its_rows_and_columns_come() -> None:
    values = np.arange(6.0).reshape(2, 3)
    there = Map(x=[1, 2, 3], y=[0, 1], values=values)
    assert Map(x=[3, 2, 1], y=[1, 0], values=values[::-1, ::-1]) == there


def test_every_contour_line_with_room_carries_its_number() -> None:
    x = np.linspace(0.0, 10.0, 30)
    shown = Panel(x_label="x [m]", y_label="y [m]", title="x [m]", map=Map(x=x, y=x, values=np.tile(x, (30, 1))))
    texts = [text.get_text() for text in panel_figure(shown).axes[0].texts]
    assert sorted(map(float, texts)) == [1.5, 3.0, 4.5, 6.0, 7.5, 9.0]  # upright lines, as far apart as can be


WRONG: dict[str, tuple[Callable[[], object], dict[str, Any]]] = {
    "no unit": (
        lambda: panel(line(), x_label="time"),
        {"argument": "x_label"},
    ),
    "lengths": (
        lambda: line(x=[0, 1], y=[1], label="a"),
        {"argument": "curve 'a'"},
    ),
    "length of low": (lambda: line(low=[1], high=[1]), {"argument": "curve"}),
    "no values": (lambda: line(x=[], y=[]), {"argument": "curve"}),
    "all missing": (lambda: line(y=np.full(200, np.nan)), {"argument": "curve"}),
    "infinite": (lambda: line(x=[0, 1], y=[0, np.inf]), {"argument": "curve"}),
    "words": (lambda: line(x=["a"], y=[0]), {"argument": "curve"}),
    "different shapes": (lambda: line(x=[1, 2], y=[[1, 2], [1]]), {"argument": "curve"}),
    "two rows": (lambda: line(x=[[0, 1]], y=[0, 1]), {"argument": "curve"}),
    "kind": (lambda: line(kind="dots"), {"argument": "curve", "value": "dots", "limit": ("line", "points", "both")}),
    "style": (lambda: line(style=5), {"argument": "curve", "value": 5}),
    "low alone": (lambda: line(low=X), {"argument": "curve"}),
    "high alone": (lambda: line(high=X), {"argument": "curve"}),
    "low above": (lambda: line(low=X + 1, high=X), {"argument": "curve", "value": (1.0, 0.0)}),
    "mark": (lambda: Mark(x=np.nan, y=0.0, label="m"), {"argument": "mark 'm'"}),
    "mark of two": (lambda: Mark(x=[0.0, 1.0], y=0.0), {"argument": "mark"}),
    "shape": (
        lambda: Mark(x=0.0, y=0.0, shape="star"),
        {"argument": "mark", "value": "star", "limit": ("dot", "ring", "square")},
    ),
    "log x": (lambda: panel(line(label="a"), x_log=True), {"argument": "curve 'a'"}),
    "log level": (lambda: panel(line(), y_log=True, levels={"z": -1}), {"argument": "levels"}),
    "log limits": (lambda: panel(line(), y_log=True, y_limits=(0, 1)), {"argument": "y_limits"}),
    "limits": (lambda: panel(line(), x_limits=(1, 0)), {"argument": "x_limits", "value": (1, 0)}),
    "mark outside": (lambda: panel(line(), marks=[Mark(x=20, y=0)], x_limits=(0, 1)), {"argument": "mark"}),
    "span outside": (
        lambda: panel(line(), spans=[Span(start=20, end=30)], x_limits=(0, 1)),
        {"argument": "span"},
    ),
    "span reversed": (lambda: Span(start=2, end=1, label="a"), {"argument": "span 'a'", "value": (2, 1)}),
    "span kind": (
        lambda: Span(start=1, end=2, kind="red"),
        {"argument": "span", "value": "red", "limit": ("blocked", "missing", "used")},
    ),
    "log span": (lambda: panel(line(x=X + 1), x_log=True, spans=[Span(start=0, end=2)]), {"argument": "span"}),
    "curve outside": (
        lambda: panel(line(label="a"), y_limits=(5, 6)),
        {"argument": "curve 'a'"},
    ),
    "no curves": (panel, {"argument": "curves"}),
    "one curve": (lambda: panel(curves=line()), {"argument": "curves"}),
    "no curve": (lambda: panel(curves=[X]), {"argument": "curves"}),
    "six": (
        lambda: panel(*[line()] * 6),
        {"argument": "curves"},
    ),
    "map without unit": (
        lambda: panel(map=Map(x=[0, 1], y=[0, 1], values=np.eye(2)), title="height"),
        {"argument": "title"},
    ),
    "map of a row": (lambda: Map(x=[0, 1], y=[0], values=[[0, 1]]), {"argument": "map"}),
    "map turned": (
        lambda: Map(x=[0, 1], y=[0, 1, 2], values=np.ones((2, 3))),
        {"argument": "map"},
    ),
    "map of nothing": (
        lambda: Map(x=[0, 1], y=[0, 1], values=np.full((2, 2), np.nan)),
        {"argument": "map"},
    ),
    "map on log": (
        lambda: panel(map=Map(x=[0, 1], y=[0, 1], values=np.eye(2)), title="h [m]", x_log=True),
        {"argument": "map"},
    ),
    "no panels": (panel_figure, {"argument": "panels"}),
    "columns": (lambda: panel_figure(tiny(), columns=0), {"argument": "columns", "value": 0}),
    "height": (
        lambda: panel_figure(tiny(), height=0.2),
        {"argument": "height", "value": 0.2},
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_makes_no_sense_is_said_in_one_line(case: str) -> None:
    make, fields = WRONG[case]
    with refused(**fields) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("slope", [1.0, 0.1, -0.1, -1.0])
def test_no_line_crosses_the_text_at_the_end_of_a_curve(slope: float) -> None:
    """A curve that ends at any place, with another one and a limit through the place where its text would be."""
    x = np.linspace(0.0, 1.0, 200)
    rising = Curve(x=x, y=0.5 + 0.4 * slope * x, label="one", end="0.123 m/s")
    figure = panel_figure(
        Panel(
            x_label="time [s]",
            y_label="speed [m/s]",
            curves=[rising, Curve(x=x, y=1.02 * rising.y + 0.02, label="two")],
            levels={"limit": 0.5},
            y_limits=(0.0, 1.0),
        )
    )
    assert_legible(figure)
    assert crossed(figure) == []
