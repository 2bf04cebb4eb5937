"""Create an empty figure.

Matplotlib is imported only when the first figure is created.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure of a given size in inches.

    Returns:
        The figure, made without pyplot or a display.
    """
    from .canvas import ReportFigure  # noqa: PLC0415 - Matplotlib is imported when a figure is drawn

    return ReportFigure(figsize=(width, height))
