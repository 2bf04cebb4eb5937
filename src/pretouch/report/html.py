"""HTML reports: one file each, with its pictures inside, nothing fetched, nothing run."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.arguments import check_arguments
from pretouch._core.blocks import Chapter, Code, Described, Page, Paragraph, Picture, page_of
from pretouch._core.errors import InvalidInputError
from pretouch._core.files import refuse_input, sign, write_text

from . import plots
from .blocks_html import blocks_as_html, page_top
from .style import draw_svg

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport


_PACKAGES: Final = ("pretouch", "numpy", "scipy", "matplotlib")
_METHOD: Final = (
    'Method: "Optimization of Preemptive Impact Mitigation Without Prior Collision Testing", equations cited as L(n).'
)


@check_arguments
def write_report(
    result: Any,
    path: str | os.PathLike[str],
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
    overwrite: bool = False,
) -> Path:
    """Write the report of a result to a file: one HTML page that needs nothing else.

    Args:
        result: what one of the verbs returned, however it ended.
        path: where the page goes.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file: an object, or a mapping, with `name` or `path`, `text` and `sha256`.
        overwrite: whether a file that stands there may be replaced; the scenario file and what it names never is.

    Returns:
        The path.
    """
    refuse_input(path, getattr(source, "inputs", ()))
    return write_text(path, report_html(result, calibration=calibration, source=source), overwrite=overwrite)


@check_arguments
def report_html(result: Any, *, calibration: CalibrationReport | None = None, source: object = None) -> str:
    """Write the report of a result as one self-contained HTML page.

    Args:
        result: what one of the verbs returned, however it ended.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file, as for `write_report`.

    Returns:
        The page, signed as pretouch's own.

    Raises:
        InvalidInputError: it is nothing that a verb returns.
    """
    if not isinstance(result, Described):
        raise InvalidInputError(f"result: found {result!r}, expected what one of the verbs returned")
    page, given = page_of(result), _source(source)
    if calibration is not None:
        page = _with_calibration(page, calibration, result)
    if given is not None or not page.source:  # a calibration says itself where it comes from
        page = replace(page.with_blocks(_provenance(given)), source=page.source if given is None else given["name"])
    return page_html(page)


def page_html(page: Page) -> str:
    """Write a page as HTML that names the versions that made it, signed as pretouch's own."""
    shell = Template((Path(__file__).parent / "page.html").read_text(encoding="utf-8"))
    title = f"{page.kind}: {page.source}" if page.source else page.kind
    body = "\n".join([page_top(page), *blocks_as_html(page.blocks, _draw)])
    made = ", ".join(f"{name} {number}" for name, number in _versions())
    return sign(shell.substitute(title=escape(title), body=body, made=escape(made)))


def _draw(picture: Picture) -> str:
    """Draw a picture as an SVG element, in which text is drawn as shapes."""
    drawn = picture.of if hasattr(picture.of, "savefig") else getattr(plots, picture.figure)(picture.of)
    return draw_svg(drawn, picture.figure.replace("_", "-"))


def _with_calibration(page: Page, calibration: CalibrationReport, answer: Any) -> Page:
    """Say on a page what the calibration of its sensor is, and what it leaves open, before anything else."""
    from pretouch.calibration.page import fitted_blocks  # noqa: PLC0415 - only where there is one
    from pretouch.uncertainty import reservations_of  # noqa: PLC0415

    left = None if calibration.best is None else reservations_of(calibration, answer)
    told = fitted_blocks(calibration, () if left is None else left.lines)
    section = Chapter(title=f"The calibration of its sensor: {calibration.calibration.name}", blocks=told)
    opening = (left.headline,) if left is not None and left.headline else ()
    page = replace(page.with_blocks(section), open=(*opening, *page.open))
    if left is not None and left.is_refuted:
        return replace(page, status=f"status: not supported by the readings ({page.status})", good=False)
    return page


def _provenance(given: dict[str, str] | None) -> Chapter:
    known: tuple[Any, ...] = ()
    if given is not None:
        file = Paragraph(text=f"Scenario file `{given['name']}`, SHA-256 `{given['sha256']}`")
        known = (file, Code(text=given["text"]) if given["text"] else None)
    return Chapter(title="Provenance", blocks=(Paragraph(text=_METHOD, quiet=True), *known))


@lru_cache(maxsize=1)
def _versions() -> tuple[tuple[str, str], ...]:
    found = [("Python", platform.python_version())]
    for package in _PACKAGES:
        try:
            found.append((package, version(package)))
        except PackageNotFoundError:
            found.append((package, "not installed"))
    return tuple(found)


def _source(source: object) -> dict[str, str] | None:
    """Read name, text and hash of a file from an object or a mapping that has them."""
    if source is None:
        return None
    keys = ("name", "path", "text", "sha256")
    given = {key: source.get(key) if isinstance(source, Mapping) else getattr(source, key, None) for key in keys}
    name = given["name"] or given["path"] or "scenario"
    text = str(given["text"] or "")
    digest = given["sha256"] or hashlib.sha256(text.encode()).hexdigest()
    return {"name": Path(str(name)).name, "text": text, "sha256": str(digest)}
