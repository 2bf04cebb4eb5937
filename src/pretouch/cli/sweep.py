"""`pretouch sweep`: contacts or optimal gains over a grid of inputs of a scenario file."""

from __future__ import annotations

import time
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pretouch._core.errors import InvalidInputError, OutputExistsError
from pretouch._core.json_text import as_json

from .options import ScenarioFile, read_gain
from .terminal import conclude, end, print_message, print_progress, print_text, reservations_about

if TYPE_CHECKING:
    import xarray as xr

    from pretouch.design import Task
    from pretouch.sweep import Progress
    from pretouch.uncertainty import Reservations

__all__ = ["sweep"]

_FIGURES = (".png", ".svg", ".pdf")
_SECONDS = 1.0  # between two lines of progress


def sweep(
    file: ScenarioFile,
    *,
    axis: Annotated[
        list[str],
        typer.Option(
            metavar="NAME=START:STOP:COUNT",
            help="An input and its values, such as obstacle.velocity=-1:-0.01:100; with :log for equal ratios, or a "
            "list NAME=VALUE,VALUE,...; values with units or bare in SI; repeatable.",
        ),
    ],
    result: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A quantity to be computed, such as relative_velocity; repeatable."),
    ] = None,
    gain: Annotated[
        str | None, typer.Option(metavar="GAIN", help='The gain of all encounters, such as "-0.7 N*s".')
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="PATH", help="Where the dataset goes: NAME.zarr or NAME.nc."),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Draw the results over one or two axes: PNG, SVG or PDF."),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Compute on the workers of this Dask scheduler, such as tcp://10.0.0.1:8786; they write the dataset.",
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

    def run() -> None:
        from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick
        from pretouch.sweep import sweep as run_sweep  # noqa: PLC0415

        fixed = read_gain(gain)
        task = load_scenario(file).replace(gain=fixed)
        axes = _axes(task, axis)
        if figure is not None:
            _check_figure(figure, axes, force=force)
        try:
            found = run_sweep(
                task,
                axes,
                results=result or None,
                output=output,
                overwrite=force,
                dask=dask,
                progress=_Teller().tell,
            )
        except KeyboardInterrupt:
            if output is not None:
                print_message("interrupted; the same command goes on from here")
            raise
        _present(found, reservations_about(task, task.replace(gain=None)), output, figure, json=json, force=force)

    conclude(run, json_wanted=json)


def _axes(task: Task, texts: list[str]) -> dict[str, Any]:
    """Read the axes; which inputs there are depends on whether gains are designed."""
    from pretouch.sweep.axes import read_axis  # noqa: PLC0415
    from pretouch.sweep.inputs import inputs_of  # noqa: PLC0415

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


class _Teller:
    """Tells how far a sweep is, not too often."""

    def __init__(self) -> None:
        self._last = time.monotonic()

    def tell(self, progress: Progress) -> None:
        now = time.monotonic()
        if now - self._last >= _SECONDS and progress.finished < progress.total:
            self._last = now
            known = f", about {progress.remaining:.0f} s left" if progress.computed else ""
            print_progress(
                f"{progress.finished:,} of {progress.total:,} encounters "
                f"({100 * progress.finished / progress.total:.0f} %){known}"
            )


def _present(
    found: xr.Dataset,
    reservations: Reservations | None,
    output: Path | None,
    figure: Path | None,
    *,
    json: bool,
    force: bool,
) -> None:
    from pretouch.sweep.summary import counts, sweep_as_dict, sweep_as_text  # noqa: PLC0415

    if figure is not None:
        from pretouch._core.files import write_bytes  # noqa: PLC0415
        from pretouch.report import plots  # noqa: PLC0415 - Matplotlib, only when needed

        content = BytesIO()
        plots.sweep(found).savefig(content, format=figure.suffix[1:].lower())
        write_bytes(figure, content.getvalue(), overwrite=force)
    if json:
        told = {**sweep_as_dict(found), "output": output, "figure": figure}
        print_text(as_json(told if reservations is None else reservations.around_dict(told)))
    else:
        text = sweep_as_text(found)
        print_text(text if reservations is None else reservations.around_text(text))
        for what, path in (("Dataset", output), ("Figure", figure)):
            if path is not None:
                print_text(f"{what}: {path}")
    first = next(iter(counts(found).values()))  # contact, or optimal
    found.close()
    end(good=first > 0)
