"""Implement the command `pretouch sweep` for grids of inputs.

It computes contacts or optimal gains.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
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
from .verbs import refuse_existing

if TYPE_CHECKING:
    import xarray as xr

    from pretouch.designs import Task
    from pretouch.sweeps import Progress
    from pretouch.uncertainty import Reservations


_FIGURES = (".png", ".svg", ".pdf")
_TABLES = (".csv", ".md")
_INTERVAL = 1.0  # s between two lines of progress


def sweep(
    file: ScenarioFile,
    *,
    axis: Annotated[
        list[str],
        option(
            "NAME=START:STOP:COUNT",
            "An input and its values, such as obstacle.velocity=-1:-0.01:100; with :log for logarithmic spacing, or a "
            "list NAME=VALUE,VALUE,...; values with units or bare in SI; repeatable.",
        ),
    ],
    result: Annotated[
        list[str] | None,
        option("NAME", "A quantity to compute, such as relative_velocity; repeatable."),
    ] = None,
    gain: Annotated[str | None, option("GAIN", 'The gain of all encounters, such as "-0.7 N*s".')] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="PATH", help="Path of the dataset: NAME.zarr or NAME.nc."),
    ] = None,
    figure: Annotated[
        Path | None,
        option("PATH", "Draw the results over one or two axes: PNG, SVG or PDF."),
    ] = None,
    table: Annotated[
        Path | None,
        option("PATH", "Write a table with a row for each encounter: NAME.csv (in SI) or NAME.md (Markdown)."),
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
        typer.Option("--json", help="Print only a JSON object, in SI; it has the values of up to 10,000 encounters."),
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace an existing sweep or figure; without it, nothing is replaced.")
    ] = False,
) -> None:
    """Compute the contact or the optimal gain at each point of a grid of inputs.

    Every combination of the values of all axes is an encounter; all other inputs are those of the scenario file. With
    --gain, or an axis gain=..., contacts are computed; otherwise the optimal gain of each encounter. With --output an
    interrupted sweep is resumed by the same command.

    Exit status: 0 some encounter ends in contact, or has an optimal gain, 1 none does, 2 a mistake in the request.
    """
    shown = Presentation(json=json, verbose=False, output=output, report=False, force=force)
    run = partial(_sweep, shown, file, axis, results=result, gain=gain, figure=figure, table=table, dask=dask)
    conclude(run, json_wanted=json)


def _sweep(
    shown: Presentation,
    file: Path,
    axis: list[str],
    *,
    results: list[str] | None,
    gain: str | None,
    figure: Path | None,
    table: Path | None,
    dask: str | None,
) -> None:
    """Compute the sweep that the command-line options describe, and show its results."""
    from pretouch.config import load_scenario  # noqa: PLC0415 - keeps `pretouch --help` quick
    from pretouch.sweeps import sweep as run_sweep  # noqa: PLC0415

    task = load_scenario(file)
    for path in (shown.output, figure, table):
        if path is not None:
            refuse_input(path, getattr(task.source, "inputs", ()))
    task = task.replace(gain=read_gain(gain, task.law))
    axes = _axes(task, axis)
    if figure is not None:
        _check_figure(figure, axes, force=shown.force)
    if table is not None:
        _check_table(table, force=shown.force)
    options: dict[str, Any] = {
        "results": results or None,
        "output": shown.output,
        "overwrite": shown.force,
        "dask": dask,
    }
    try:
        dataset = run_sweep(task, axes, progress=_progress_printer(), **options)
    except KeyboardInterrupt:
        if shown.output is not None:
            print_message("interrupted; run the same command again to resume")
        raise
    subject = task if "gain" in axes else _nominal(task)  # over several gains, no designed gain is part of the sweep
    from pretouch.sweeps.gain_warnings import gain_warnings  # noqa: PLC0415

    warnings = gain_warnings(task, dataset)
    _present(dataset, reservations_about(task, subject), shown, figure, table, warnings=warnings)


def _nominal(task: Task) -> Any:
    """Design the gain for the nominal inputs. The task is returned unchanged if there is no gain to design."""
    if task.gain is not None or task.objective is None or task.bounds is None:
        return task
    from pretouch.designs import design_gain  # noqa: PLC0415 - keeps `pretouch --help` quick

    return design_gain(task.replace(evaluate=None))


def _axes(task: Task, texts: list[str]) -> dict[str, Any]:
    """Parse the sweep axes that the command line options define."""
    from pretouch.sweeps.axes import inputs_of, read_axis  # noqa: PLC0415

    contacts = task.gain is not None or any(text.partition("=")[0].strip() == "gain" for text in texts)
    units = inputs_of(task.replace(objective=None) if contacts else task)
    axes: dict[str, Any] = {}
    for text in texts:
        name, values = read_axis(text, units)
        if name in axes:
            raise InvalidInputError(
                f"--axis: the input {name} is given twice, expected once; remove one of its two --axis options"
            )
        axes[name] = values
    return axes


def _check_figure(path: Path, axes: dict[str, Any], *, force: bool) -> None:
    """Check that the figure of a sweep can be written. This check runs before anything is computed."""
    if path.suffix.lower() not in _FIGURES:
        raise InvalidInputError(
            f"--figure: found {str(path)!r}, expected a file name that ends in {' or '.join(_FIGURES)}"
        )
    long = [name for name, values in axes.items() if len(values) > 1]
    if len(long) not in {1, 2}:
        raise InvalidInputError(
            f"--figure: found {len(long)} axes with several values, expected one or two such axes for a figure"
        )
    if path.exists() and not force:
        raise OutputExistsError(
            f"{path}: this file already exists, and pretouch does not overwrite it; replace the file with --force",
            remedy="--force",
        )


def _check_table(path: Path, *, force: bool) -> None:
    """Check that the table of a sweep can be written. This check runs before anything is computed."""
    if path.suffix.lower() not in _TABLES:
        raise InvalidInputError(
            f"--table: found {str(path)!r}, expected a file name that ends in {' or '.join(_TABLES)}"
        )
    refuse_existing(path, force=force)


def _progress_printer() -> Callable[[Progress], None]:
    """Return a function that prints a sweep's progress. It prints once per second."""
    last = time.monotonic()

    def show(progress: Progress) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _INTERVAL and progress.finished < progress.total:
            last = now
            remaining = f", about {progress.remaining:.0f} s left" if progress.computed else ""
            print_progress(
                f"{progress.finished:,} of {progress.total:,} encounters "
                f"({100 * progress.finished / progress.total:.0f} %){remaining}"
            )

    return show


def _present(
    dataset: xr.Dataset,
    reservations: Reservations | None,
    shown: Presentation,
    figure: Path | None,
    table: Path | None = None,
    *,
    warnings: tuple[str, ...] = (),
) -> None:
    """Draw the figure of a sweep, write its table, print its results, and exit."""
    from pretouch.sweeps.results import (  # noqa: PLC0415
        counts,
        sweep_as_csv,
        sweep_as_dict,
        sweep_as_markdown,
        sweep_as_text,
    )

    from .summary import wrapped  # noqa: PLC0415 - keeps `pretouch --help` quick

    if table is not None:
        from pretouch._core.files import write_text  # noqa: PLC0415

        as_table = sweep_as_csv if table.suffix.lower() == ".csv" else sweep_as_markdown
        write_text(table, as_table(dataset), overwrite=shown.force)

    if figure is not None:
        from pretouch._core.files import write_bytes  # noqa: PLC0415
        from pretouch.report import plots  # noqa: PLC0415 - Matplotlib, only when needed

        content = BytesIO()
        plots.sweep(dataset).savefig(content, format=figure.suffix[1:].lower())
        write_bytes(figure, content.getvalue(), overwrite=shown.force)
    places = {"output": shown.output, "figure": figure, **({} if table is None else {"table": table})}
    remarks = [line for text in warnings for line in wrapped(f"Warning: {text}")]
    witness = None if reservations is None else reservations.witness
    says_nothing = witness is not None and witness.headline is None and witness.spread is None
    if reservations is not None and says_nothing and not shown.json:
        reservations = replace(reservations, witness=None)  # its numbers are those of the nominal encounter alone
    try:
        text = shown.formatted(
            reservations,
            lambda: {**sweep_as_dict(dataset), "warnings": warnings, **places},
            lambda: sweep_as_text(dataset, remarks),
        )
        ends_well = next(iter(counts(dataset).values())) > 0  # the first status is contact, or optimal
    except Exception as error:
        if shown.output is None:
            raise
        raise InvalidInputError(  # a large sweep is read here for the first time
            f"{shown.output}: the dataset cannot be loaded and may be damaged. Remove the file, or choose another "
            f"name with --output. The error is: {' '.join(str(error).split())[:200]}"
        ) from None
    print_text(text)
    for what, path in () if shown.json else (("Dataset", shown.output), ("Figure", figure), ("Table", table)):
        if path is not None:
            print_text(f"{what}: {path}")
    dataset.close()
    end(good=ends_well and not (reservations is not None and reservations.is_refuted))
