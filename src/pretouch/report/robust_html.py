"""The HTML report of a robust design."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch._core.files import write_text
from pretouch.design.certificate import DesignStatus
from pretouch.design.robust.result import RobustDesign

from .html import fitted_part, picture, render_page, source_part

if TYPE_CHECKING:
    from pretouch.calibration.result import CalibrationReport

__all__ = ["robust_report_html", "write_robust_report"]


def robust_report_html(
    design: RobustDesign,
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
) -> str:
    """Write a robust design as one self-contained HTML page.

    Args:
        design: a design of any status.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file: an object, or a mapping, with `name` or `path`, `text` and `sha256`.

    Returns:
        The page, signed as pretouch's own.
    """
    from .robust_figures import outcome_figure, price_figure, robust_figure, shown_prices  # noqa: PLC0415
    from .robust_page import robust_page  # noqa: PLC0415

    prices = [] if design.gain is None else shown_prices(design)
    contact = design.status is not DesignStatus.NO_CONTACT
    return render_page(
        "robust.html.j2",
        **robust_page(design, prices),
        measure_figure=picture(robust_figure(design), "measure"),
        outcomes=picture(outcome_figure(design), "outcomes") if contact else None,
        price_figure=picture(price_figure(design, prices), "price") if prices else None,
        fitted=fitted_part(calibration, design),
        source=source_part(source),
    )


def write_robust_report(
    design: RobustDesign,
    path: str | os.PathLike[str],
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
    overwrite: bool = False,
) -> Path:
    """Write a report of a robust design to a file.

    Args:
        design: a design of any status.
        path: where the page goes.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file, as `robust_report_html` takes it.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.
    """
    return write_text(path, robust_report_html(design, calibration=calibration, source=source), overwrite=overwrite)
