"""Panels become a figure; Matplotlib is loaded when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pretouch._core.errors import InvalidInputError

from .panel_checks import as_number, as_values
from .panels import Panel
from .style import drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["panel_figure"]


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
