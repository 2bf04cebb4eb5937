"""Draw several panels (subplots) in a grid as one figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError

from .panel_checks import as_number, as_values
from .panels import Panel
from .style import drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@check_arguments
def panel_figure(*panels: Panel, columns: int = 2, height: float = 3.3) -> Figure:
    """Draw one or several plots in a grid.

    A legend above each panel names curves, ranges, reference lines and points. Points that look alike, and the ends of
    curves, are named where they are. If the numbers on an axis are very small or very large, the label of this axis has
    a power of ten.

    Args:
        panels: the panels, row by row.
        columns: number of panels per row, 1 to 4.
        height: height of a row [inch] without its legends, at least 1.

    Returns:
        A figure, 7.4 inch wide (5.2 inch for a single panel with `columns` above 1). Notebooks show it, and `savefig`
        output is reproducible.

    Raises:
        InvalidInputError: there is no panel, or the number of columns or the height is not allowed.

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
        raise InvalidInputError(f"columns: found {columns!r}, expected 1, 2, 3 or 4", value=columns)
    if not as_number(height, "height") >= 1:
        raise InvalidInputError(
            f"height: found a row height of {height:g} inch, but each row of plots needs at least 1 inch", value=height
        )
    from .panel_drawing import draw_figure  # noqa: PLC0415 - Matplotlib is imported when something is drawn

    with drawing():
        return draw_figure(shown, int(columns), float(height))
