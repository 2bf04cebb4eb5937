"""HTML reports: one file each, with its pictures inside, nothing fetched, nothing run."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pretouch._core.files import sign, write_text
from pretouch.design.admittance_result import AdmittanceDesign
from pretouch.design.result import GainDesign

from .style import draw_svg

if TYPE_CHECKING:
    from jinja2 import Environment
    from matplotlib.figure import Figure

    from pretouch.calibration.result import CalibrationReport

__all__ = [
    "design_report_html",
    "fit_report_html",
    "fitted_part",
    "picture",
    "render_page",
    "source_part",
    "write_design_report",
    "write_fit_report",
]

_PACKAGES = ("pretouch", "numpy", "scipy", "matplotlib")


def fit_report_html(report: CalibrationReport) -> str:
    """Write a calibration report as one self-contained HTML page.

    Args:
        report: a report of any verdict.

    Returns:
        The page, signed as pretouch's own.
    """
    from .calibration_figures import calibration_figure  # noqa: PLC0415
    from .fit_page import fit_page  # noqa: PLC0415

    figure = picture(calibration_figure(report), "calibration")
    return render_page("fit.html.j2", **fit_page(report), figure=figure)


def design_report_html(
    design: GainDesign | AdmittanceDesign,
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
) -> str:
    """Write a design report as one self-contained HTML page.

    Args:
        design: a design of any status, of the gain alone or together with the admittance.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file: an object, or a mapping, with `name` or `path`, `text` and `sha256`.

    Returns:
        The page, signed as pretouch's own.
    """
    from .design_figures import motion_figure, trade_off_figure  # noqa: PLC0415
    from .design_page import design_page  # noqa: PLC0415

    together = None
    if isinstance(design, AdmittanceDesign):
        from .pareto_figures import admittance_figure  # noqa: PLC0415
        from .pareto_page import admittance_block  # noqa: PLC0415

        drawn = None if design.certificate is None else picture(admittance_figure(design), "admittance")
        together = {**admittance_block(design), "figure": drawn}
        design = design.gain_design or design.as_it_is

    return render_page(
        "design.html.j2",
        **design_page(design),
        trade_off=picture(trade_off_figure(design), "trade-off"),
        motion=picture(motion_figure(design), "motion"),
        fitted=fitted_part(calibration, design),
        together=together,
        source=source_part(source),
    )


def fitted_part(calibration: CalibrationReport | None, answer: Any) -> dict[str, Any] | None:
    """Collect what a page says of the calibration that a sensor was fitted to; None where there is none."""
    if calibration is None:
        return None
    from pretouch.uncertainty import reservations_of  # noqa: PLC0415

    from .calibration_figures import calibration_figure  # noqa: PLC0415
    from .fit_page import fit_page  # noqa: PLC0415

    left = None if calibration.best is None else reservations_of(calibration, answer)
    return {
        **fit_page(calibration),
        "figure": picture(calibration_figure(calibration), "calibration"),
        "unsupported": left and left.headline,
        "open": () if left is None else left.lines,
    }


def write_fit_report(report: CalibrationReport, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a calibration report to a file.

    Args:
        report: a report of any verdict.
        path: where the page goes.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.
    """
    return write_text(path, fit_report_html(report), overwrite=overwrite)


def write_design_report(
    design: GainDesign | AdmittanceDesign,
    path: str | os.PathLike[str],
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
    overwrite: bool = False,
) -> Path:
    """Write a design report to a file.

    Args:
        design: a design of any status, of the gain alone or together with the admittance.
        path: where the page goes.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file, as `design_report_html` takes it.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.
    """
    return write_text(path, design_report_html(design, calibration=calibration, source=source), overwrite=overwrite)


@lru_cache(maxsize=1)
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # noqa: PLC0415

    folder = Path(__file__).parent / "templates"
    return Environment(
        loader=FileSystemLoader(folder),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )


def render_page(template: str, **values: Any) -> str:
    """Fill a template: text is escaped, the page names the versions that made it, and is signed as pretouch's own.

    Args:
        template: name of a file in `report/templates`.
        values: what the template speaks of.

    Returns:
        The page.

    Examples:
        >>> render_page("base.html.j2").startswith("<!DOCTYPE html>")
        True
    """
    text = _environment().get_template(template).render(**values, versions=_versions())
    return sign(text.rstrip() + "\n")


def picture(figure: Figure, name: str) -> Any:
    """Draw a figure for a template, which takes it as it is.

    Args:
        figure: the figure.
        name: what sets its identifiers apart from those of other figures on the page: letters, digits, hyphens.

    Returns:
        An SVG element as markup.
    """
    from markupsafe import Markup  # noqa: PLC0415

    return Markup(draw_svg(figure, name))  # noqa: S704 - our own drawing, in which text is drawn as shapes


@lru_cache(maxsize=1)
def _versions() -> tuple[tuple[str, str], ...]:
    found = [("Python", platform.python_version())]
    for package in _PACKAGES:
        try:
            found.append((package, version(package)))
        except PackageNotFoundError:
            found.append((package, "not installed"))
    return tuple(found)


def source_part(source: object) -> dict[str, str] | None:
    """Read name, text and hash of a file from an object or a mapping that has them."""
    if source is None:
        return None
    keys = ("name", "path", "text", "sha256")
    given = {key: source.get(key) if isinstance(source, Mapping) else getattr(source, key, None) for key in keys}
    name = given["name"] or given["path"] or "scenario"
    text = str(given["text"] or "")
    digest = given["sha256"] or hashlib.sha256(text.encode()).hexdigest()
    return {"name": Path(str(name)).name, "text": text, "sha256": str(digest)}
