"""The picture of a calibration: the readings, what the controller feels of them, its slope, and what is left over."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .new_figure import new_figure
from .style import drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pretouch.calibration.result import CalibrationReport

__all__ = ["calibration"]


def calibration(report: CalibrationReport) -> Figure:
    """Draw a calibration with its fitted models.

    Args:
        report: a report of any verdict.

    Returns:
        Four panels over the distance: the readings with offset, clipping level, floor and usable window; the signal
        above the offset on a logarithmic axis, which is what the controller feels; its slope g beside differences
        of neighboring readings; and the residuals of ln xi. Where there is no usable signal, the readings alone.
    """
    from .calibration_panels import (  # noqa: PLC0415 - drawing is loaded when it is asked for
        draw_log_output,
        draw_readings,
        draw_residuals,
        draw_slope,
    )

    with drawing():
        if not report.fits:
            figure = new_figure(7.4, 3.2)
            axes = figure.add_subplot()
            figure.subplots_adjust(left=0.11, right=0.972, bottom=0.15, top=0.9)
            draw_readings(axes, report)
            return figure
        figure = new_figure(7.4, 5.8)
        panels = [figure.add_subplot(2, 2, i + 1) for i in range(4)]
        figure.subplots_adjust(left=0.11, right=0.972, bottom=0.085, top=0.95, wspace=0.29, hspace=0.34)
        for axes, draw in zip(panels, (draw_readings, draw_log_output, draw_slope, draw_residuals), strict=True):
            draw(axes, report)
    return figure
