"""Plot cumulative distributions of quantities over many runs.

A curve shows the share of runs in which a quantity is below each value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.vocabulary import unit_of, words_for

from .panels import Curve, Mark, Panel, containing
from .style import NEGLIGIBLE, Scale, scale_for

_MOST: Final = 400  # points of a curve: closer than a pixel
_AIR: Final = 1.04
_TOP: Final = 104.0  # percent, so that a line at 100 % is visible


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
    """Return a plot of cumulative distributions.

    It shows the share of runs in which a quantity is below a value.

    Args:
        columns: name, palette index and values in SI of each curve; a run without a value is NaN or infinite, and its
            curve stays below 100 %.
        label: name of the quantity, without its unit.
        scale: display unit of the quantity; an empty unit is written as 1.
        of: the counted objects: runs, or encounters.
        title: title of the panel.
        marks: highlighted points, with x in the display unit and y in percent.
        positions: vertical reference lines: name to SI value.
        levels: horizontal reference lines: name to percent.

    Returns:
        The panel.
    """
    lines = {name: at / scale.factor for name, at in (positions or {}).items()}
    largest = [np.max(values, initial=0.0, where=np.isfinite(values)) / scale.factor for _, _, values in columns]
    end = _AIR * float(max([*largest, *(mark.x for mark in marks), *lines.values()]))
    return containing(
        x_label=f"{label} [{scale.unit or '1'}]",
        y_label=f"share of {of} below [%]",
        title=title,
        curves=[_share_curve(name, style, values / scale.factor, end) for name, style, values in columns],
        marks=marks,
        positions=lines,
        levels=levels or {},
        x_limits=(0.0, end) if end > 0 else None,  # from zero, so that a spread is seen relative to the value
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
    """Return a plot of the distribution of a quantity.

    Curves of negligible values are not drawn.

    Args:
        name: name of the quantity in `pretouch._core.vocabulary`.
        columns: see `share_panel`.
        limit: limit of the quantity in SI, and the required share of runs; None without a limit.
        symbol: symbol after the name of the quantity.
        of: see `share_panel`.
        marks: returns highlighted points in the unit of the panel; only points in the color of a curve are drawn.

    Returns:
        The panel.
    """
    finite = [values[np.isfinite(values)] for _, _, values in columns]
    largest = max((float(values.max()) for values in finite if len(values)), default=1.0)
    whole = largest if limit is None else max(largest, limit[0])
    scale = scale_for(unit_of(name), whole)
    visible = [not len(values) or float(values.max()) > NEGLIGIBLE * whole for values in finite]
    shown = [column for column, is_visible in zip(columns, visible, strict=True) if is_visible] or columns
    drawn = {style for _, style, _ in shown}
    return share_panel(
        shown,
        f"{words_for(name)} {symbol}".strip(),
        scale,
        of=of,
        marks=[mark for mark in marks(scale) if mark.style in drawn],
        positions={} if limit is None else {"limit": limit[0]},
        levels={} if limit is None or limit[1] == 1 else {"required": 100 * limit[1]},
    )


def _share_curve(name: str, style: int, values: FloatArray, end: float) -> Curve:
    """Return the empirical cumulative distribution of values as a step curve."""
    ordered = np.sort(values[np.isfinite(values)])
    if not len(ordered):
        return Curve(x=[0.0, end], y=[0.0, 0.0], label=name, style=style)
    indices = np.unique(np.linspace(0, len(ordered) - 1, min(len(ordered), _MOST)).round().astype(int))
    after = 100 * (indices + 1) / len(values)
    before = np.concatenate([[0.0], after[:-1]])
    x, y = np.repeat(ordered[indices], 2), np.column_stack([before, after]).ravel()
    if len(ordered) < len(values):  # runs without a value count as larger than any value
        x, y = np.append(x, end), np.append(y, y[-1])
    return Curve(x=x, y=y, label=name, style=style)
