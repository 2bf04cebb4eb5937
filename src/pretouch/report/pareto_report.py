"""The HTML report of a trade-off."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch._core.files import write_text
from pretouch.design.front import ParetoFront

from .html import fitted_part, picture, render_page, source_part

if TYPE_CHECKING:
    from pretouch.calibration.result import CalibrationReport

__all__ = ["pareto_report_html", "write_pareto_report"]


def pareto_report_html(
    front: ParetoFront, *, calibration: CalibrationReport | None = None, source: object = None
) -> str:
    """Write a report on a trade-off as one self-contained HTML page.

    Args:
        front: a front of any status.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file, as `design_report_html` takes it.

    Returns:
        The page, signed as pretouch's own.
    """
    from .pareto_figures import pareto_figure  # noqa: PLC0415
    from .pareto_page import pareto_page  # noqa: PLC0415

    figure = picture(pareto_figure(front), "front") if len(front.gain) else None
    return render_page(
        "pareto.html.j2",
        **pareto_page(front),
        figure=figure,
        fitted=fitted_part(calibration, front),
        source=source_part(source),
    )


def write_pareto_report(
    front: ParetoFront,
    path: str | os.PathLike[str],
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
    overwrite: bool = False,
) -> Path:
    """Write a report on a trade-off to a file.

    Args:
        front: a front of any status.
        path: where the page goes.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file, as `design_report_html` takes it.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.
    """
    return write_text(path, pareto_report_html(front, calibration=calibration, source=source), overwrite=overwrite)
