"""The HTML report of a trade-off."""

from __future__ import annotations

import os
from pathlib import Path

from pretouch._core.files import write_text
from pretouch.design.front import ParetoFront

from .html import picture, render_page, source_part

__all__ = ["pareto_report_html", "write_pareto_report"]


def pareto_report_html(front: ParetoFront, *, source: object = None) -> str:
    """Write a report on a trade-off as one self-contained HTML page.

    Args:
        front: a front of any status.
        source: the scenario file, as `design_report_html` takes it.

    Returns:
        The page, signed as pretouch's own.
    """
    from .pareto_figures import pareto_figure  # noqa: PLC0415
    from .pareto_page import pareto_page  # noqa: PLC0415

    figure = picture(pareto_figure(front), "front") if len(front.gain) else None
    return render_page("pareto.html.j2", **pareto_page(front), figure=figure, source=source_part(source))


def write_pareto_report(
    front: ParetoFront, path: str | os.PathLike[str], *, source: object = None, overwrite: bool = False
) -> Path:
    """Write a report on a trade-off to a file.

    Args:
        front: a front of any status.
        path: where the page goes.
        source: the scenario file, as `design_report_html` takes it.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.
    """
    return write_text(path, pareto_report_html(front, source=source), overwrite=overwrite)
