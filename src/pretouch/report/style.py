"""Define the colors, fonts, ticks and units of all figures.

Matplotlib is imported only when a figure is drawn.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import StringIO
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import pretty_unit
from pretouch.motion import LawNumber

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Okabe & Ito's palette (2008), ordered so that neighbors differ in luminance as well as in hue
CHOSEN: Final = "#0072b2"
BASELINE: Final = "#d55e00"
LIMIT: Final = "#333333"
INK: Final = "#222222"
QUIET: Final = "#767676"
BLOCKED: Final = "#ececec"
CURVES: Final = (
    ("#0072b2", "-"),
    ("#d55e00", (0, (5, 1.6))),
    ("#009e73", (0, (6, 1.5, 1.2, 1.5))),
    ("#8a4f7d", (0, (1.4, 1.2))),
    ("#222222", (0, (3, 1.2, 1, 1.2, 1, 1.2))),
)
MARKERS: Final = ("o", "s", "^", "D", "v")  # one per curve of the palette

_GROUPS: Final = frozenset(
    (
        *("axes", "figure", "font", "hatch", "lines", "markers", "mathtext", "patch", "path", "savefig", "scatter"),
        *("svg", "text", "xaxis", "xtick", "yaxis", "ytick"),
    )
)
_SETTINGS: Final[dict[str, Any]] = {
    "axes.edgecolor": QUIET,
    "axes.formatter.useoffset": False,
    "axes.formatter.use_mathtext": False,
    "axes.labelcolor": INK,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlepad": 7.0,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.unicode_minus": True,
    "figure.dpi": 100.0,
    "figure.facecolor": "white",
    "font.family": ["DejaVu Sans"],
    "font.size": 8.0,
    "hatch.linewidth": 0.5,
    "lines.linewidth": 1.7,
    "savefig.dpi": 150,
    "savefig.facecolor": "white",
    "svg.fonttype": "path",
    "svg.hashsalt": "pretouch",
    "text.color": INK,
    "xtick.color": QUIET,
    "xtick.labelcolor": INK,
    "xtick.labelsize": 8.0,
    "xtick.major.size": 3.0,
    "ytick.color": QUIET,
    "ytick.labelcolor": INK,
    "ytick.labelsize": 8.0,
    "ytick.major.size": 3.0,
}


class Scale(NamedTuple):
    """The display unit of a quantity and its conversion factor.

    The factor is the size of the display unit in SI units, such as 0.001 for mm.
    """

    factor: float
    unit: str

    def text(self, value: float, digits: int = 3, largest: float = 1.0) -> str:
        """Format an SI value in the display unit.

        Returns:
            The text; 0 for a value that is negligible compared with `largest`.
        """
        shown = 0.0 if abs(value) < NEGLIGIBLE * abs(largest) else value / self.factor
        size = digits - 1 - math.floor(math.log10(abs(shown))) if shown and math.isfinite(shown) else 0
        number = "0" if not shown else f"{shown:.{size}f}" if 0 <= size <= 6 else f"{shown:.{digits}g}"
        return minus(f"{number} {self.unit}".strip())


NEGLIGIBLE: Final = 1e-6
"""A value below this share of the largest value cannot be distinguished from zero in a figure."""

WIDE: Final = 30.0
"""A range of values with a larger ratio gets a logarithmic axis."""

HEADROOM: Final = 6.0
"""The largest value that is shown on a linear axis, as a multiple of the smallest value."""

MOST_POINTS: Final = 900
"""The largest number of points of a time series: about two per pixel."""

_SMALLER: Final = {
    "m": (("mm", 1e-3), ("µm", 1e-6)),
    "s": (("ms", 1e-3), ("µs", 1e-6)),
    "m/s": (("mm/s", 1e-3), ("µm/s", 1e-6)),
    "N": (("mN", 1e-3), ("µN", 1e-6)),
    "N*s": (("mN s", 1e-3), ("µN s", 1e-6)),
    "N*s^2": (("mN s²", 1e-3), ("µN s²", 1e-6)),
}
_LONGEST_IN_UNIT: Final = {"m": 1.0, "s": 1.0, "m/s": 0.1, "N": 0.1, "N*s": 1.0, "N*s^2": 1.0}


def scale_for(unit: str, largest: float) -> Scale:
    """Choose the display unit for numbers up to a given magnitude.

    Args:
        unit: SI unit.
        largest: the largest magnitude, in SI.

    Returns:
        The display unit: millimeters below 1 m, milliseconds below 1 s, and so on.

    Examples:
        >>> scale_for("m", 0.0422)
        Scale(factor=0.001, unit='mm')
    """
    chosen = Scale(1.0, pretty_unit(unit))
    limit = _LONGEST_IN_UNIT.get(unit, 0.0)
    for smaller, factor in _SMALLER.get(unit, ()):
        if 0 < abs(largest) < limit:
            chosen = Scale(factor, smaller)
        limit = _LONGEST_IN_UNIT[unit] * factor
    return chosen


def gain_axis(bounds: tuple[float, float], number: LawNumber, *, magnitude: bool = False) -> tuple[float, str, bool]:
    """Return sign, label and scale of the gain axis.

    The last element is True for a logarithmic axis.
    """
    low, high = bounds
    name = "virtual force gain" if number.name == "gain" else f"virtual {number.name}"
    sign = "\u2212" if high <= 0 else ""
    shown = f"|{number.plot_symbol}|" if magnitude else f"{sign}{number.plot_symbol}"
    return -1.0 if sign else 1.0, f"{name} {shown} [{pretty_unit(number.unit)}]", high < 0 or low > 0


def objective_axis(values: FloatArray, shown: Sequence[float]) -> tuple[float, bool, tuple[float, float] | None]:
    """Choose the axis of an objective over the gain.

    Values far above the minimum are not drawn, but every value in `shown` is.

    Args:
        values: the values of all curves; values that are not finite are ignored.
        shown: values that the axis must contain, such as those of marked gains.

    Returns:
        The largest value that is drawn, whether the axis is logarithmic, and its limits. The limits are None if they
        follow from the drawn values.
    """
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 1.0, False, None
    low, high = float(min([*finite, *shown])), float(max([*finite, *shown]))
    highest = max(shown, default=low)
    if low > 0 and highest > HEADROOM * low:  # the marked values differ too much for a linear axis
        return high, True, None
    top = max(min(high, HEADROOM * low), highest) if low > 0 else high
    return top, False, (min(0.0, 1.06 * low), 1.06 * top) if top > min(0.0, low) else None


def minus(text: str) -> str:
    """Replace the hyphens in a formatted number by minus signs, for figures."""
    return text.replace("-", "\u2212")


def minus_signs(text: str) -> str:
    """Replace hyphens before numbers by minus signs, but keep hyphens in words.

    Args:
        text: any text.

    Returns:
        The text for a figure.

    Examples:
        >>> minus_signs("first-order optimum -0.75 N s") == "first-order optimum \u22120.75 N s"
        True
    """
    return re.sub(r"(?<![\w.])-(?=[\d.])", "\u2212", text)


@contextmanager
def drawing() -> Iterator[None]:
    """Use the Matplotlib settings of pretouch temporarily.

    The user's settings are restored afterwards.
    """
    from matplotlib import rc_context, rcParams, rcParamsDefault  # noqa: PLC0415

    plain = {k: v for k, v in rcParamsDefault.items() if k.split(".")[0] in _GROUPS and rcParams[k] != v}
    settings: Any = {**plain, **_SETTINGS}
    with rc_context(settings):
        yield


_OVERLAP: Final = 0.5  # share of the smaller width and height, from which two overlapping axes are one panel
_WIDE: Final = 0.6  # share of the width of the figure, from which a panel fills a row


def draw_svg(figure: Figure, name: str) -> str:
    """Draw a figure as an SVG element for an HTML page.

    Equal figures give identical elements.

    Args:
        figure: the figure.
        name: prefix of its identifiers, which must be unique on the page.

    Returns:
        The element without namespaces, metadata and unused identifiers.
    """
    panels = _lay_out(figure)
    content = StringIO()
    figure.savefig(content, format="svg")
    text = content.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :].strip(), flags=re.DOTALL)
    text = re.sub(r' xmlns(?::\w+)?="[^"]*"', "", text).replace("xlink:href", "href")
    text = re.sub(r'<g id="[^"]*">', "<g>", text).replace("<g>", '<g id="all">', 1)
    whole = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{name}-", text)
    if len(panels) < 2:
        return whole
    # on a narrow screen, each panel is a view of the same drawing, one below the other
    use = f'<use href="#{name}-all"/>'
    views = (
        f'<svg viewBox="{x:.1f} {y:.1f} {w:.1f} {h:.1f}" style="max-width: {w:.0f}pt">{use}</svg>'
        for x, y, w, h in panels
    )
    return f'<div class="whole">{whole}</div>\n<div class="panels">{"".join(views)}</div>'


def _lay_out(figure: Figure) -> list[tuple[float, float, float, float]]:
    """Lay out a figure, and find its panels.

    All passes share a canvas, so that each text is measured once. Saving would draw a figure with an engine twice.

    Returns:
        The boxes of the panels, see `_panel_boxes`.
    """
    from matplotlib import rc_context  # noqa: PLC0415 - loaded with the figure
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415

    canvas, engine = FigureCanvasAgg(figure), figure.get_layout_engine()
    with drawing(), rc_context({"text.hinting": "no_hinting"}):  # the letters of an SVG are not hinted
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)
        return _panel_boxes(figure, canvas)


def _panel_boxes(figure: Figure, canvas: Any) -> list[tuple[float, float, float, float]]:
    """Return position and size of each plot in a figure [pt]. Each box has x, y (from the top), width and height."""
    from matplotlib.transforms import Bbox  # noqa: PLC0415 - loaded with the figure

    parts = [part for part in (*figure.legends, *figure.axes) if part.get_visible()]
    if all(axes.get_position().width > _WIDE for axes in figure.axes):  # a single column
        return []
    boxes: list[Bbox] = []
    for box in filter(None, (part.get_tightbbox(canvas.get_renderer()) for part in parts)):
        for i, other in enumerate(boxes):  # axes that overlap, such as twins and insets, are one panel
            common = Bbox.intersection(box, other)
            if common is not None and (common.size > _OVERLAP * np.minimum(box.size, other.size)).all():
                boxes[i] = Bbox.union([box, other])
                break
        else:
            boxes.append(box)
    scale, height = 72 / figure.dpi, 72 * figure.get_figheight()
    return [
        (scale * box.x0 - 2, height - scale * box.y1 - 2, scale * box.width + 4, scale * box.height + 4)
        for box in boxes
    ]


def log_axis(axes: Axes, which: str, low: float, high: float) -> None:
    """Make an axis logarithmic with given limits.

    The axis has few ticks, which are written as plain numbers.
    """
    from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter, NullLocator  # noqa: PLC0415

    locator = FixedLocator(log_ticks(low, high)) if high > 4 * low else MaxNLocator(5)
    axis = axes.xaxis if which == "x" else axes.yaxis
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
    axis.set_major_locator(locator)
    axis.set_major_formatter(FuncFormatter(_tick))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _tick(value: float, _: int | None = None) -> str:
    """Format the number at an axis tick in about five characters."""
    text = f"{value:g}"
    if len(text) <= 5 and "e" not in text:
        return minus(text)
    mantissa, exponent = f"{value:.3e}".split("e")
    return minus(f"{float(mantissa):g}e{int(exponent)}")


def log_ticks(low: float, high: float, most: int = 7) -> list[float]:
    """Choose a limited number of round tick values between two positive numbers.

    Args:
        low: lower end > 0.
        high: upper end > low.
        most: the largest number of ticks.

    Returns:
        The finest series with at most `most` ticks: 1-2-...-9, 1-2-5, 1-3, decades, or every n-th decade.

    Examples:
        >>> log_ticks(0.01, 10)
        [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0]
        >>> log_ticks(0.1, 2)
        [0.1, 0.2, 0.5, 1.0, 2.0]
    """
    first, last = math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 1
    ticks: list[float] = []
    steps: tuple[tuple[float, ...], ...] = (tuple(range(1, 10)), (1, 2, 5), (1, 3), (1,))
    for mantissas in steps:
        numbers = [float(f"{m}e{k}") for k in range(first, last + 1) for m in mantissas]
        ticks = [n for n in numbers if low * (1 - 1e-9) <= n <= high * (1 + 1e-9)]
        if len(ticks) <= most:
            return ticks
    return ticks[:: math.ceil(len(ticks) / most)]


def span(values: FloatArray, pad: float = 0.06) -> tuple[float, float]:
    """Return axis limits that contain all finite values, with a margin."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    margin = pad * (high - low) or 0.5 * abs(high) or 1.0
    return low - margin, high + margin
