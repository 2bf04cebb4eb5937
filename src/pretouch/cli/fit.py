"""Implement the command `pretouch fit`, which fits sensor curves to a calibration file."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import as_json
from pretouch._core.units import read_quantity

from .columns import (
    Columns,
    Labels,
    Select,
    fullest,
    read_columns,
    read_labels,
    read_selection,
    selection_of,
    without_labels,
)
from .terminal import Presentation, end, option, print_progress, print_text, verb

if TYPE_CHECKING:
    from pretouch.calibration import Calibration, CalibrationReport
    from pretouch.config.sensor import FitRequest


@verb
def fit(
    shown: Presentation,
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Calibration (CSV).")],
    offset: Annotated[
        str, option("auto|fit|zero|VALUE", "Offset, the output without an object: how to find it, or its value.")
    ] = "auto",
    no_object: Annotated[
        str | None, option("FILE|VALUE", "Readings without an object, in addition to those in FILE.")
    ] = None,
    select: Select = None,
    columns: Columns = None,
    labels: Labels = None,
    saturation: Annotated[str, option("auto|none|VALUE", "Output at which the sensor clips.")] = "auto",
    near_field_peak: Annotated[str, option("auto|none|DISTANCE", "Distance of the near-field peak.")] = "auto",
    model: Annotated[list[str] | None, option("NAME", "Fit only this model; repeatable.")] = None,
    floor_sigmas: Annotated[float, option("NUMBER", "Noise floor, in standard deviations above the offset.")] = 3.0,
) -> None:
    """Fit sensor curves to a calibration (CSV).

    Ranks the models. Prints parameters with uncertainties, the usable window, the offset and a verdict. Writes a report
    with figures, STEM-fit.html in this folder. A file with several curves gives one row for each; choose one with
    --select for its report. VALUE is a number in the unit of the output, or text such as "110 mV".

    Exit status: 0 a usable fit, 1 no fit, 2 a mistake in the request.
    """
    from pretouch.config.sensor import FitRequest, read_no_object, read_output  # noqa: PLC0415 - keeps `pretouch --help` quick

    request = FitRequest(
        path=file,
        select=read_selection(select),
        columns=read_columns(columns),
        labels=read_labels(labels),
        no_object=None if no_object is None else read_no_object(no_object, Path(), name="--no-object"),
        offset=_word_or(offset, ("auto", "fit", "zero"), read_output, "--offset"),
        saturation=_word_or(saturation, ("auto", "none"), read_output, "--saturation"),
        near_field_peak=_word_or(
            near_field_peak, ("auto", "none"), partial(read_quantity, unit="m"), "--near-field-peak"
        ),
        models=tuple(model or ()),
        floor_sigmas=floor_sigmas,
    )
    _show(request, shown)


def _show(request: FitRequest, shown: Presentation) -> None:
    """Fit the selected calibration curves and show the results."""
    curves = request.read()
    if not shown.json:
        _print_notes(curves[0], ())
    if len(curves) > 1:
        _several(request, curves, shown)
    else:
        _one(request, curves[0], shown)


def _print_notes(curve: Calibration, printed: tuple[str, ...]) -> None:
    """Print the notes on a calibration curve, except those that are already printed."""
    from .summary import wrapped  # noqa: PLC0415 - keeps `pretouch --help` quick

    for note in () if curve.source is None else curve.source.notes:
        if note not in printed:
            print_text("\n".join(wrapped(f"note: {note}", indent="  ")))


def _word_or(text: str, words: tuple[str, ...], read: Callable[..., Any], name: str) -> Any:
    """Parse a value or an allowed word such as `auto`."""
    return text if text in words else read(text, name=name)


def _one(request: FitRequest, curve: Calibration, shown: Presentation) -> None:
    """Fit one calibration curve, print the result and write its report."""
    report = request.rank(curve)
    if not shown.json and curve.source is not None:
        _print_notes(report.calibration, curve.source.notes)
    label = re.sub(r"[^\w.-]+", "-", f"-{curve.label}") if request.select else ""
    shown.show(
        report, f"{request.path.stem}{label}-fit.html", good=report.best is not None, inputs=request.files, lines=20
    )


def _several(request: FitRequest, curves: tuple[Calibration, ...], shown: Presentation) -> None:
    """Fit several calibration curves and print the results."""
    if shown.output is not None:
        raise InvalidInputError(
            f"--output: a report covers only one curve, but the file {request.path.name} contains {len(curves)} "
            f"curves. Choose a curve with --select, for example {selection_of(fullest(curves))}"
            f"{without_labels(request)}"
        )
    width = max(len(curve.label) for curve in curves)
    usable, objects, shown_curve = 0, [], None
    for number, curve in enumerate(curves, start=1):
        report = request.rank(curve)
        usable += report.best is not None
        if shown_curve is None and report.best is not None and report.verdict != "usable":
            shown_curve = curve
        if shown.json:
            print_progress(f"{number} of {len(curves)} curves fitted")
            objects.append({"label": curve.label, **report.to_dict()})
            continue
        if number == 1:  # after the first fit, which may refuse the options
            print_text(f"{'curve':<{width}}  {'best model':<14}  {'RMSE ln ξ':>10}  {'window [mm]':>13}  verdict")
        print_text(_row(curve.label, width, report))
    if shown.json:
        print_text(as_json({"file": request.path.name, "usable": usable, "curves": objects}))
    else:
        print_text(
            f"\n{usable} of {len(curves)} calibration curves are usable. To get the report and figures of a curve, "
            f"choose it with --select, such as {selection_of(shown_curve or fullest(curves))}"
        )
    end(good=usable > 0)


def _row(label: str, width: int, report: CalibrationReport) -> str:
    """Return the result of one calibration curve as a table row."""
    best = report.best
    model, error, window = "-", "-", "-"
    if best is not None:
        model, error = best.model, f"{best.rmse_log_output:.4f}"
        window = f"{1e3 * report.window.l_min:.4g} to {1e3 * report.window.l_max:.4g}"
    return f"{label:<{width}}  {model:<14}  {error:>10}  {window:>13}  {report.verdict}"
