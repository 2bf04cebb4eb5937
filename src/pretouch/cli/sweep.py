"""`pretouch sweep`: contacts or optimal gains over a grid of inputs of a scenario file."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pretouch._core.errors import InvalidInputError, OutputExistsError
from pretouch._core.files import refuse_input

from .terminal import (
    Presentation,
    ScenarioFile,
    conclude,
    end,
    option,
    print_message,
    print_progress,
    print_text,
    read_gain,
    reservations_about,
)

if TYPE_CHECKING:
    import xarray as xr

    from pretouch.design import Task
    from pretouch.sweep import Progress
    from pretouch.uncertainty import Reservations


_FIGURES = (".png", ".svg", ".pdf")
_SECONDS = 1.0  # between two lines of progress


def sweep(
    file: ScenarioFile,
    *,
    axis: Annotated[
        list[str],
        option(
            "NAME=START:STOP:COUNT",
            "An input and its values, such as obstacle.velocity=-1:-0.01:100; with :log for equal ratios, or a "
            "list NAME=VALUE,VALUE,...; values with units or bare in SI; repeatable.",
        ),
    ],
    result: Annotated[
        list[str] | None,
        option("NAME", "A quantity to be computed, such as relative_velocity; repeatable."),
    ] = None,
    gain: Annotated[str | None, option("GAIN", 'The gain of all encounters, such as "-0.7 N*s".')] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="PATH", help="Where the dataset goes: NAME.zarr or NAME.nc."),
    ] = None,
    figure: Annotated[
        Path | None,
        option("PATH", "Draw the results over one or two axes: PNG, SVG or PDF."),
    ] = None,
    dask: Annotated[
        str | None,
        option(
            "ADDRESS",
            "Compute on the workers of this Dask scheduler, such as tcp://10.0.0.1:8786; they write the dataset.",
        ),
    ] = None,
    json: Annotated[
        bool,
        typer.Option("--json", help="Print one JSON object, all SI, and nothing else; with values, if not too many."),
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace another sweep at the output, or a figure; unasked, nothing is.")
    ] = False,
) -> None:
    """Compute contacts or optimal gains over a grid of inputs.

    Every combination of the values of all axes is an encounter; what no axis names is that of the scenario file. With
    --gain, or an axis gain=..., contacts are found; else each encounter gets its optimal gain. With --output the same
    command goes on where it was ended.

    Exit status: 0 some encounter ends in contact, or has an optimal gain, 1 none does, 2 a mistake in the request.
    """
    shown = Presentation(json=json, output=output, report=False, force=force)
    asked = partial(_sweep, shown, file, axis, results=result, gain=gain, figure=figure, dask=dask)
    conclude(asked, json_wanted=json)


def _sweep(
    shown: Presentation,
    file: Path,
    axis: list[str],
    *,
    results: list[str] | None,
    gain: str | None,
    figure: Path | None,
    dask: str | None,
) -> None:
    """Sweep, and show what came of it."""
    from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick
    from pretouch.sweep import sweep as run_sweep  # noqa: PLC0415

    task = load_scenario(file)
    for path in (shown.output, figure):
        if path is not None:
            refuse_input(path, getattr(task.source, "inputs", ()))
    task = task.replace(gain=read_gain(gain, task.law))
    axes = _axes(task, axis)
    if figure is not None:
        _check_figure(figure, axes, force=shown.force)
    ways: dict[str, Any] = {"results": results or None, "output": shown.output, "overwrite": shown.force, "dask": dask}
    try:
        found = run_sweep(task, axes, progress=_telling(), **ways)
    except KeyboardInterrupt:
        if shown.output is not None:
            print_message("interrupted; the same command goes on from here")
        raise
    _present(found, reservations_about(task, _nominal(task)), shown, figure)


def _nominal(task: Task) -> Any:
    """Return the answer to the nominal encounter: with the given gain, or the optimal one where one is designed."""
    if task.gain is not None or task.objective is None or task.bounds is None or task.scenario.obstacle.course:
        return task
    from pretouch.design import design_gain  # noqa: PLC0415 - `pretouch --help` stays quick

    return design_gain(task.replace(evaluate=None))


def _axes(task: Task, texts: list[str]) -> dict[str, Any]:
    """Read the axes; which inputs there are depends on whether gains are designed."""
    from pretouch.sweep.axes import inputs_of, read_axis  # noqa: PLC0415

    contacts = task.gain is not None or any(text.partition("=")[0].strip() == "gain" for text in texts)
    known = inputs_of(task.replace(objective=None) if contacts else task)
    axes: dict[str, Any] = {}
    for text in texts:
        name, values = read_axis(text, known)
        if name in axes:
            raise InvalidInputError(f"--axis: found {name} twice, expected every input once")
        axes[name] = values
    return axes


def _check_figure(path: Path, axes: dict[str, Any], *, force: bool) -> None:
    """Refuse before anything is computed what could not be drawn or written after."""
    if path.suffix.lower() not in _FIGURES:
        raise InvalidInputError(f"--figure: found {str(path)!r}, expected a name that ends in {', '.join(_FIGURES)}")
    long = [name for name, values in axes.items() if len(values) > 1]
    if len(long) not in {1, 2}:
        raise InvalidInputError(f"--figure: found {len(long)} axes of more than one value, expected one or two")
    if path.exists() and not force:
        raise OutputExistsError(f"{path}: this file exists and is not overwritten unasked; replace it with --force")


def _telling() -> Callable[[Progress], None]:
    """Return what tells how far a sweep is, not too often."""
    last = time.monotonic()

    def tell(progress: Progress) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _SECONDS and progress.finished < progress.total:
            last = now
            known = f", about {progress.remaining:.0f} s left" if progress.computed else ""
            print_progress(
                f"{progress.finished:,} of {progress.total:,} encounters "
                f"({100 * progress.finished / progress.total:.0f} %){known}"
            )

    return tell


def _present(found: xr.Dataset, reservations: Reservations | None, shown: Presentation, figure: Path | None) -> None:
    from pretouch.sweep.results import counts, sweep_as_dict, sweep_as_text  # noqa: PLC0415

    if figure is not None:
        from pretouch._core.files import write_bytes  # noqa: PLC0415
        from pretouch.report import plots  # noqa: PLC0415 - Matplotlib, only when needed

        content = BytesIO()
        plots.sweep(found).savefig(content, format=figure.suffix[1:].lower())
        write_bytes(figure, content.getvalue(), overwrite=shown.force)
    places = {"output": shown.output, "figure": figure}
    try:
        text = shown.told(reservations, lambda: {**sweep_as_dict(found), **places}, lambda: sweep_as_text(found))
        ends_well = next(iter(counts(found).values())) > 0  # contact, or optimal
    except Exception as error:
        if shown.output is None:
            raise
        raise InvalidInputError(  # the numbers of a large sweep are read here for the first time
            f"{shown.output}: cannot be read ({' '.join(str(error).split())[:200]}); it may be damaged: choose another "
            "name with --output, or remove it"
        ) from None
    print_text(text)
    for what, path in () if shown.json else (("Dataset", shown.output), ("Figure", figure)):
        if path is not None:
            print_text(f"{what}: {path}")
    found.close()
    end(good=ends_well and not (reservations is not None and reservations.is_refuted))
