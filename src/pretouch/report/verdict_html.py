"""The HTML report of a verdict: what an engineer takes to a review."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pretouch._core.errors import ResultUnavailableError
from pretouch._core.files import write_text
from pretouch.verification import Verdict

from .html import fitted_part, picture, render_page, source_part

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pretouch.calibration.result import CalibrationReport

__all__ = ["verdict_report_html", "write_verdict_report"]


def verdict_report_html(
    verdict: Verdict,
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
) -> str:
    """Write a verdict as one self-contained HTML page.

    Args:
        verdict: a verdict of any status.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file: an object, or a mapping, with `name` or `path`, `text` and `sha256`.

    Returns:
        The page, signed as pretouch's own.
    """
    from .verdict_figures import verdict_figure, verdict_run_figure  # noqa: PLC0415
    from .verdict_gains import verdict_gain_figure, verdict_stability_figure  # noqa: PLC0415
    from .verdict_page import verdict_page  # noqa: PLC0415

    return render_page(
        "verdict.html.j2",
        **verdict_page(verdict),
        outcome_figure=_drawn(verdict_figure, verdict, "outcomes"),
        run_figure=_drawn(verdict_run_figure, verdict, "runs"),
        stability_figure=_drawn(verdict_stability_figure, verdict, "stability"),
        gain_figure=_drawn(verdict_gain_figure, verdict, "gains"),
        fitted=fitted_part(calibration, verdict),
        source=source_part(source),
    )


def _drawn(draw: Callable[[Verdict], Figure], verdict: Verdict, name: str) -> Any:
    """Draw a figure for the template; None where the verdict has nothing to show in it."""
    try:
        return picture(draw(verdict), name)
    except ResultUnavailableError:
        return None


def write_verdict_report(
    verdict: Verdict,
    path: str | os.PathLike[str],
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
    overwrite: bool = False,
) -> Path:
    """Write a report of a verdict to a file.

    Args:
        verdict: a verdict of any status.
        path: where the page goes.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file, as `verdict_report_html` takes it.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.
    """
    return write_text(path, verdict_report_html(verdict, calibration=calibration, source=source), overwrite=overwrite)
