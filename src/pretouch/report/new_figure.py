"""An empty figure; Matplotlib is loaded when it is made."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure of a size in inches, without pyplot and without a display."""
    from .canvas import ReportFigure  # noqa: PLC0415 - matplotlib is loaded when a figure is drawn

    return ReportFigure(figsize=(width, height))
