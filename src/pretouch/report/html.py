"""Write a report as one self-contained HTML file without scripts."""

from __future__ import annotations

import base64
import hashlib
import os
import platform
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from html import escape
from importlib.metadata import PackageNotFoundError, version
from io import BytesIO
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any, Final, TypeVar

from pretouch._core.arguments import check_arguments
from pretouch._core.blocks import Block, Code, Film, LazyBlock, Page, PageSection, Paragraph, Picture
from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError, PretouchError, ResultUnavailableError
from pretouch._core.files import refuse_input, sign, write_text
from pretouch._core.warning_codes import caution

from . import plots
from .blocks_html import explained, lead_picture, page_as_excerpt, page_as_html
from .pages import page_of
from .style import draw_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pretouch.calibration import CalibrationReport

T = TypeVar("T")

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
    subtracted_offset: float | None = None,
    source: object = None,
    overwrite: bool = False,
    warn: Callable[[str], object] = warnings.warn,
) -> Path:
    """Write the report of a result to a self-contained HTML file.

    A figure that cannot be drawn is replaced by a warning that gives the reason. All other parts are written.

    Args:
        result: the result of a verb, with any status; or a task, scenario, contact or motion.
        path: path of the page.
        calibration: the calibration to which the sensor curve was fitted, if there is one.
        subtracted_offset: the offset that the controller subtracts [unit of the outputs]; by default, that of the
            calibration.
        source: the scenario file: an object or a mapping with `name` or `path`, `text` and `sha256`.
        overwrite: whether an existing file may be replaced; input files are never replaced.
        warn: receives each of these warnings; by default it is a Python warning.

    Returns:
        The path. A file that cannot be written raises an OutputError, for example because the disk is full.
    """
    refuse_input(path, getattr(source, "inputs", ()))
    html = report_html(result, calibration=calibration, subtracted_offset=subtracted_offset, source=source, warn=warn)
    return write_text(path, html, overwrite=overwrite)


@check_arguments
def report_html(
    result: Any,
    *,
    calibration: CalibrationReport | None = None,
    subtracted_offset: float | None = None,
    source: object = None,
    warn: Callable[[str], object] = warnings.warn,
) -> str:
    """Return the report of a result as one self-contained HTML page.

    Args:
        result: the result of a verb, with any status; or a task, scenario, contact or motion.
        calibration: the calibration to which the sensor curve was fitted, if there is one.
        subtracted_offset: the offset that the controller subtracts [unit of the outputs]; by default, that of the
            calibration.
        source: the scenario file, see `write_report`.
        warn: receives a warning for each figure that cannot be drawn, see `write_report`.

    Returns:
        The page, with pretouch's signature.

    Raises:
        InvalidInputError: `result` is not the result of a verb.
    """
    if not isinstance(result, Described):
        raise InvalidInputError(
            f"result: found {result!r}, expected a result that pretouch computed, such as the return value of "
            "design(task)",
            value=result,
        )
    page, file = page_of(result), _source(source)
    drawing = _Drawing(_draw)
    if calibration is not None:
        page = drawing.guarded(
            "The section on the sensor calibration cannot be made",
            lambda: _with_calibration(page, calibration, result, subtracted_offset),
            page,
        )
    if file is not None or not page.source:  # the page of a calibration has its own provenance
        page = replace(page.with_blocks(_provenance(file)), source=page.source if file is None else file["name"])
    html = page_html(page, drawing)
    for text in drawing.omitted:
        warn(text)
    return html


def page_html(page: Page, drawing: _Drawing | None = None) -> str:
    """Return a complete report page as HTML.

    It contains the software versions and a hash that reveals later changes. Parts that cannot be drawn are listed among
    the warnings of the page.
    """
    drawing = drawing or _Drawing(_draw)
    blocks = (drawing.made(block) for block in page.blocks)
    page = replace(page, blocks=tuple(block for block in blocks if block is not None))
    body = page_as_html(explained(page), drawing.draw)
    if drawing.omitted:
        page = replace(page, warnings=(*page.warnings, *drawing.omitted))
        body = page_as_html(explained(page), drawing.draw)
    shell = Template((Path(__file__).parent / "page.html").read_text(encoding="utf-8"))
    title = f"{page.kind}{'' if page.kind.endswith('?') else ':'} {page.source}" if page.source else page.kind
    versions = ", ".join(f"{name} {number}" for name, number in _versions())
    return sign(shell.substitute(title=escape(title), body=body, made=escape(versions)))


class _Drawing:
    """The drawn figures of one report, and the parts that cannot be drawn.

    Args:
        render: draws a figure, as an element.

    Attributes:
        omitted: a warning for each part that cannot be drawn.
    """

    def __init__(self, render: Callable[[Picture], str]) -> None:
        self.omitted: list[str] = []
        self._render = render
        self._drawn: dict[int, tuple[Picture, str]] = {}  # with the picture, so that its id stays unique

    def guarded(self, what: str, make: Callable[[], T], otherwise: T) -> T:
        """Return a part of the report.

        If it cannot be made, a warning is noted, and another part takes its place.
        """
        try:
            return make()
        except Exception as error:
            self.omitted.append(_omission(what, error))
            return otherwise

    def made(self, block: Block) -> Block | None:
        """Return a block of the page after its computation."""
        if not isinstance(block, LazyBlock):
            return block
        return self.guarded("A part of the report cannot be computed", block.make, None)

    def draw(self, picture: Picture) -> str:
        """Return a plot or a film as an HTML element, or the warning that replaces it."""
        if id(picture) not in self._drawn:
            what = f"The figure {picture.name!r} cannot be drawn"
            drawn = self.guarded(what, lambda: self._render(picture), None)
            notice = f'<p class="warning">{escape(self.omitted[-1])}</p>' if drawn is None else ""
            self._drawn[id(picture)] = picture, drawn or notice
        return self._drawn[id(picture)][1]


def _omission(what: str, error: Exception) -> str:
    """Return the warning about a missing part of a report."""
    reason = " ".join(str(error).split()) or "no message"
    kind = "" if isinstance(error, PretouchError) else f"{type(error).__name__}: "
    return caution("PT423", f"{what}. The reason is: {kind}{reason}")


def lead_figure(page: Page) -> Figure:
    """Return the first figure of a report page.

    Raises:
        ResultUnavailableError: the page has no figure.
    """
    picture = lead_picture(page)
    if picture is None:
        raise ResultUnavailableError(f"plot: this result ({page.status or page.kind}) has no figure")
    figure: Figure = _figure(picture)
    return figure


def excerpt_html(page: Page) -> str:
    """Return a short HTML version of a report page for notebooks.

    The main plot is an image.
    """
    drawing = _Drawing(_image)
    return page_as_excerpt(page, drawing.draw)


def _image(picture: Picture) -> str:
    """Draw a figure and return it as an HTML image element."""
    content = BytesIO()
    _figure(picture).savefig(content, format="png", dpi=110)
    data = base64.b64encode(content.getvalue()).decode()
    return f'<img alt="{escape(picture.name)}" style="max-width: 100%" src="data:image/png;base64,{data}">'


def _figure(picture: Picture) -> Any:
    return picture.of if hasattr(picture.of, "savefig") else getattr(plots, picture.figure)(picture.of)


def _draw(picture: Picture) -> str:
    """Return a plot or a film as an HTML element."""
    if isinstance(picture, Film) and picture.figure == "robot_film":
        from .robot_film import film_html  # noqa: PLC0415 - loads robots

        return film_html(picture.of)
    drawn = draw_svg(_figure(picture), picture.figure.replace("_", "-"))
    if isinstance(picture, Film):
        still = f'<div class="scroll" role="img" aria-label="{escape(picture.name)}">{drawn}</div>'
        return still + _animation(picture)
    return drawn


def _animation(picture: Film) -> str:
    """Return the animation of an encounter."""
    from .encounter_animation import encounter_animation  # noqa: PLC0415 - only what a report shows is loaded

    if picture.figure == "motion":
        from .motion_figures import lanes_of  # noqa: PLC0415

        return encounter_animation(*lanes_of(picture.of))
    from .simulation_figures import simulated_lanes  # noqa: PLC0415

    return encounter_animation(*simulated_lanes(picture.of))


def _with_calibration(page: Page, calibration: CalibrationReport, answer: Any, subtracted: float | None) -> Page:
    """Add a section about the sensor calibration to a report page."""
    from pretouch.calibration.page import fitted_blocks  # noqa: PLC0415 - only where there is one
    from pretouch.uncertainty import reservations_apply, reservations_of  # noqa: PLC0415

    applies = calibration.best is not None and reservations_apply(answer)
    reservations = reservations_of(calibration, answer, subtracted=subtracted) if applies else None
    blocks = fitted_blocks(calibration, () if reservations is None else reservations.lines)
    section = PageSection(title=f"Sensor calibration: {calibration.calibration.name}", blocks=blocks)
    opening = (reservations.headline,) if reservations is not None and reservations.headline else ()
    page = replace(page.with_blocks(section), reservations=(*opening, *page.reservations))
    if reservations is not None:
        page = replace(page, headline=reservations.with_spread(page.headline))
    if reservations is not None and reservations.is_refuted:
        return replace(page, status=f"status: not supported by the readings ({page.status})", good=False)
    return page


def _provenance(file: dict[str, str] | None) -> PageSection:
    """Return the report section with the computation method and the scenario file."""
    blocks: tuple[Any, ...] = ()
    if file is not None:
        name = Paragraph(text=f"Scenario file `{file['name']}`, SHA-256 `{file['sha256']}`")
        blocks = (name, Code(text=file["text"]) if file["text"] else None)
    return PageSection(title="Provenance", blocks=(Paragraph(text=_METHOD, quiet=True), *blocks))


@lru_cache(maxsize=1)
def _versions() -> tuple[tuple[str, str], ...]:
    versions = [("Python", platform.python_version())]
    for package in _PACKAGES:
        try:
            versions.append((package, version(package)))
        except PackageNotFoundError:
            versions.append((package, "not installed"))
    return tuple(versions)


def _source(source: object) -> dict[str, str] | None:
    """Return name, text and SHA-256 hash of the scenario file."""
    if source is None:
        return None
    keys = ("name", "path", "text", "sha256")
    parts = {key: source.get(key) if isinstance(source, Mapping) else getattr(source, key, None) for key in keys}
    name = parts["name"] or parts["path"] or "scenario"
    text = str(parts["text"] or "")
    digest = parts["sha256"] or hashlib.sha256(text.encode()).hexdigest()
    return {"name": Path(str(name)).name, "text": text, "sha256": str(digest)}
