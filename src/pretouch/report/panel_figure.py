"""Panels become a figure; panels of shares of runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.vocabulary import unit_of, words_for

from .panel_checks import as_number, as_values
from .panels import Curve, Mark, Panel
from .style import Scale, drawing, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@check_arguments
def panel_figure(*panels: Panel, columns: int = 2, height: float = 3.3) -> Figure:
    """Draw panels beside each other, with the name of every curve beside the curve.

    A name that finds no place in its panel where it covers neither text nor curve stands in a line above it. Where
    the numbers of an axis are tiny or huge, a power of ten joins the unit in its label.

    Args:
        panels: what to draw, row by row.
        columns: how many panels stand side by side, 1 to 4.
        height: height of a row [inch], at least 1; rows grow where labels would leave less than half of it.

    Returns:
        A figure, 7.4 inch wide (5.2 where `columns` has room for more than the only panel); it shows itself in a
        notebook, and `savefig` writes the same bytes each time.

    Raises:
        InvalidInputError: there is no panel, or a number of columns or a height that cannot be drawn.

    Examples:
        >>> import numpy as np
        >>> from pretouch.report import Curve
        >>> distance = np.linspace(1.0, 80.0, 40)
        >>> figure = panel_figure(
        ...     Panel(
        ...         x_label="distance l [mm]",
        ...         y_label="slope g [1/m]",
        ...         curves=[
        ...             Curve(x=distance, y=-3320.0 / (distance + 41.9), label="inverse power", end="far end"),
        ...             Curve(x=distance, y=np.full(40, -63.46), label="exponential"),
        ...         ],
        ...         levels={"no slope": 0.0},
        ...     )
        ... )
        >>> figure.axes[0].get_ylabel()
        'slope g [1/m]'
    """
    shown = as_values(panels, Panel, "panels")
    if not shown:
        raise InvalidInputError("panels: found none, expected at least one Panel")
    if isinstance(columns, bool) or columns not in {1, 2, 3, 4}:
        raise InvalidInputError(f"columns: found {columns!r}, expected 1, 2, 3 or 4")
    if not as_number(height, "height") >= 1:
        raise InvalidInputError(f"height: found {height:g} inch, expected at least 1 inch for a row of panels")
    from .panel_layout import draw_figure  # noqa: PLC0415 - drawing is loaded when it is asked for

    with drawing():
        return draw_figure(shown, int(columns), float(height))


_MOST: Final = 400  # points of a curve: closer than a pixel
_NOTHING: Final = 1e-6  # of the largest value shown: a curve of such values says nothing
_AIR: Final = 1.04
_TOP: Final = 104.0  # percent, so that the line at 100 % is seen


def share_panel(
    columns: Sequence[tuple[str, int, FloatArray]],
    label: str,
    scale: Scale,
    *,
    of: str = "runs",
    title: str = "",
    marks: Sequence[Mark] = (),
    positions: Mapping[str, float] | None = None,
    levels: Mapping[str, float] | None = None,
) -> Panel:
    """Draw in which share of runs a quantity stays below a value, as a staircase through them.

    Args:
        columns: name, place in the palette and values in SI of each curve; a run without a value is NaN or
            infinite, and its curve stays below 100 %.
        label: of the quantity, without its unit.
        scale: the unit in which it is shown; one without a name is written as 1.
        of: what the columns are of: runs, or encounters.
        title: of the panel.
        marks: points that stand out, in that unit and in percent.
        positions: vertical reference lines: name to SI value.
        levels: horizontal reference lines: name to percent.

    Returns:
        The panel.
    """
    lines = {name: at / scale.factor for name, at in (positions or {}).items()}
    largest = [np.max(values, initial=0.0, where=np.isfinite(values)) / scale.factor for _, _, values in columns]
    end = _AIR * float(max([*largest, *(mark.x for mark in marks), *lines.values()]))
    return Panel(
        x_label=f"{label} [{scale.unit or '1'}]",
        y_label=f"share of {of} below [%]",
        title=title,
        curves=[_share_curve(name, style, values / scale.factor, end) for name, style, values in columns],
        marks=marks,
        positions=lines,
        levels=levels or {},
        x_limits=(0.0, end) if end > 0 else None,  # from zero on: a spread is judged beside what it spreads of
        y_limits=(0.0, _TOP),
    )


def outcome_panel(
    name: str,
    columns: Sequence[tuple[str, int, FloatArray]],
    limit: tuple[float, float] | None,
    *,
    symbol: str = "",
    of: str = "runs",
    marks: Callable[[Scale], Sequence[Mark]] = lambda _: (),
) -> Panel:
    """Draw a quantity of the vocabulary with its limit; a curve that is at nothing throughout is left out.

    Args:
        name: of the quantity.
        columns: as of `share_panel`.
        limit: its limit in SI and the share of runs in which that must be kept; None without one.
        symbol: what is written behind its name.
        of: as of `share_panel`.
        marks: gives points that stand out in the unit of the panel; those in the color of no curve are left out.

    Returns:
        The panel.
    """
    known = [values[np.isfinite(values)] for _, _, values in columns]
    largest = max((float(values.max()) for values in known if len(values)), default=1.0)
    whole = largest if limit is None else max(largest, limit[0])
    scale = scale_for(unit_of(name), whole)
    something = [not len(values) or float(values.max()) > _NOTHING * whole for values in known]
    kept = [c for c, shown in zip(columns, something, strict=True) if shown] or columns
    drawn = {style for _, style, _ in kept}
    return share_panel(
        kept,
        f"{words_for(name)} {symbol}".strip(),
        scale,
        of=of,
        marks=[mark for mark in marks(scale) if mark.style in drawn],
        positions={} if limit is None else {"limit": limit[0]},
        levels={} if limit is None or limit[1] == 1 else {"required": 100 * limit[1]},
    )


def _share_curve(name: str, style: int, values: FloatArray, end: float) -> Curve:
    """Return the staircase: after the k-th of n ordered values the share is k / n, and less than 1 after the last."""
    ordered = np.sort(values[np.isfinite(values)])
    if not len(ordered):
        return Curve(x=[0.0, end], y=[0.0, 0.0], label=name, style=style)
    place = np.unique(np.linspace(0, len(ordered) - 1, min(len(ordered), _MOST)).round().astype(int))
    after = 100 * (place + 1) / len(values)
    before = np.concatenate([[0.0], after[:-1]])
    x, y = np.repeat(ordered[place], 2), np.column_stack([before, after]).ravel()
    if len(ordered) < len(values):  # those without a value are above any
        x, y = np.append(x, end), np.append(y, y[-1])
    return Curve(x=x, y=y, label=name, style=style)
