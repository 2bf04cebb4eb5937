"""`pretouch fit`: the sensor curves that a calibration file supports."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import as_json
from pretouch._core.units import read_quantity

from .terminal import Presentation, end, option, print_progress, print_text, verb

if TYPE_CHECKING:
    from pretouch.calibration import Calibration, CalibrationReport
    from pretouch.config.sensor import FitRequest


@verb
def fit(
    shown: Presentation,
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Calibration (CSV).")],
    offset: Annotated[str, option("auto|fit|zero|VALUE", "Where the level without an object comes from.")] = "auto",
    no_object: Annotated[str | None, option("FILE|VALUE", "Readings without an object, beside those in FILE.")] = None,
    select: Annotated[list[str] | None, option("COLUMN=VALUE", "Only curves with this label; repeatable.")] = None,
    columns: Annotated[
        str | None,
        option(
            "distance=COLUMN,output=COLUMN",
            'Which columns are meant, by header, number (from 1) or unit, such as "distance=1,output=3 [V]".',
        ),
    ] = None,
    labels: Annotated[
        str | None,
        option("COLUMN,...|none", "The columns that tell curves apart; all that are left where not given."),
    ] = None,
    saturation: Annotated[str, option("auto|none|VALUE", "Output from which the sensor is clipped.")] = "auto",
    near_field_peak: Annotated[str, option("auto|none|DISTANCE", "Where the near-field peak lies.")] = "auto",
    model: Annotated[list[str] | None, option("NAME", "Choose among these models only; repeatable.")] = None,
    floor_sigmas: Annotated[float, option("NUMBER", "Sigmas above the offset from which a signal is usable.")] = 3.0,
) -> None:
    """Fit sensor models to a calibration (CSV).

    Ranks the models and prints parameters with uncertainty, the usable window, the offset and a verdict; writes a
    report with figures, STEM-fit.html in this folder. A file with several curves gives one row for each; choose one
    with --select for its report. VALUE is a number in the unit of the output, or text such as "110 mV".

    Exit status: 0 a usable fit, 1 no usable signal, 2 a mistake in the request.
    """
    from pretouch.config.sensor import FitRequest, read_no_object, read_output  # noqa: PLC0415 - `pretouch --help` stays quick

    request = FitRequest(
        path=file,
        select=_selected(select or []),
        columns=_columns(columns),
        labels=None if labels is None else _names(labels),
        no_object=None if no_object is None else read_no_object(no_object, Path(), name="--no-object"),
        offset=_or(offset, ("auto", "fit", "zero"), read_output, "--offset"),
        saturation=_or(saturation, ("auto", "none"), read_output, "--saturation"),
        near_field_peak=_or(near_field_peak, ("auto", "none"), partial(read_quantity, unit="m"), "--near-field-peak"),
        models=tuple(model or ()),
        floor_sigmas=floor_sigmas,
    )
    _show(request, shown)


def _show(request: FitRequest, shown: Presentation) -> None:
    """Fit the curves that are asked for, and show what was found."""
    curves = request.read()
    if not shown.json:
        _print_notes(curves[0], ())
    if len(curves) > 1:
        _several(request, curves, shown)
    else:
        _one(request, curves[0], shown)


def _print_notes(curve: Calibration, known: tuple[str, ...]) -> None:
    """Print what was noted of a curve, but for what is known already."""
    for note in () if curve.source is None else curve.source.notes:
        if note not in known:
            print_text(f"note: {note}")


def _or(text: str, words: tuple[str, ...], read: Callable[..., Any], name: str) -> Any:
    """Keep one of the words; read everything else."""
    return text if text in words else read(text, name=name)


def _columns(text: str | None) -> dict[str, str]:
    """Read `distance=1,output=3 [V]`; a header may hold commas."""
    if text is None:
        return {}
    parts = re.split(r"(?:^|[,;])\s*(\w+)\s*=", text)
    if parts[0].strip() or len(parts) < 3:
        raise InvalidInputError(
            f"--columns: found {text!r}, expected columns by header, number or unit, for example "
            '"distance=1,output=3 [V]"'
        )
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def _names(text: str) -> tuple[str, ...]:
    """Read `day,sensor`, or `none`."""
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    return () if names == ("none",) else names


def _selected(texts: list[str]) -> dict[str, str]:
    """Read `day=30` as a label."""
    for text in texts:
        if not re.fullmatch(r"[^=]+=.+", text):
            raise InvalidInputError(f"--select: found {text!r}, expected COLUMN=VALUE, for example day=30")
    return {key.strip(): value.strip() for key, value in (text.split("=", 1) for text in texts)}


def _one(request: FitRequest, curve: Calibration, shown: Presentation) -> None:
    """Fit one curve: report on the terminal and as a file."""
    found = request.rank(curve)
    if not shown.json and curve.source is not None:
        _print_notes(found.calibration, curve.source.notes)
    label = re.sub(r"[^\w.-]+", "-", f"-{curve.label}") if request.select else ""
    shown.show(found, f"{request.path.stem}{label}-fit.html", good=found.best is not None, inputs=request.files)


def _several(request: FitRequest, curves: tuple[Calibration, ...], shown: Presentation) -> None:
    """Fit several curves: a row or an object for each."""
    if shown.output is not None:
        raise InvalidInputError(
            f"--output: found {len(curves)} curves in {request.path.name}, expected one: choose it with --select, "
            f"for example {' '.join(f'--select {shlex.quote(part)}' for part in curves[0].label.split(', '))}"
        )
    width = max(len(curve.label) for curve in curves)
    usable, objects = 0, []
    if not shown.json:
        print_text(f"{'curve':<{width}}  {'best model':<14}  {'RMSE ln ξ':>10}  {'window [mm]':>13}  verdict")
    for number, curve in enumerate(curves, start=1):
        found = request.rank(curve)
        usable += found.best is not None
        if shown.json:
            print_progress(f"{number} of {len(curves)} curves fitted")
            objects.append({"label": curve.label, **found.to_dict()})
        else:
            print_text(_row(curve.label, width, found))
    if shown.json:
        print_text(as_json({"file": request.path.name, "usable": usable, "curves": objects}))
    else:
        print_text(f"\n{usable} of {len(curves)} curves usable; choose one with --select for its report and figures")
    end(good=usable > 0)


def _row(label: str, width: int, found: CalibrationReport) -> str:
    """Lay out one curve as a row."""
    best = found.best
    model, error, window = "-", "-", "-"
    if best is not None:
        model, error = best.model, f"{best.rmse_log_output:.4f}"
        window = f"{1e3 * found.window.l_min:.4g} to {1e3 * found.window.l_max:.4g}"
    return f"{label:<{width}}  {model:<14}  {error:>10}  {window:>13}  {found.verdict}"
