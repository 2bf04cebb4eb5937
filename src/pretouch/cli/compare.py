"""Implement the command `pretouch compare`, which ranks sensors, control laws or robots."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import refuse_input

from .terminal import Presentation, option, print_progress, verb

if TYPE_CHECKING:
    from pretouch.designs import Task


@verb
def compare(
    shown: Presentation,
    *,
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="Scenario files (TOML) with [chain] and [controller]; with --parts, any scenario."
        ),
    ],
    parts: Annotated[
        bool, typer.Option("--parts", help="Compare the built-in sensor parts in the encounter of each file.")
    ] = False,
    runs: Annotated[
        int | None, option("NUMBER", "Simulated encounters of each candidate; by default as in the files.", min=1)
    ] = None,
) -> None:
    """Compare sensors, control laws or robots: which one is best?

    Verifies the gain of each file on its sampled loop. With --parts, each built-in sensor part takes the place of the
    sensor chain of the file, with a curve of the same shape; a calibration gives the shape of its fitted curve. Prints
    a table, best first: a gain that holds is better than one that does not, and among equals the lower contact speed
    is better. Writes a report with a figure, STEM-compare.html in this folder.

    Exit status: 0 at least one candidate holds, 1 none does, 2 a mistake in the request.
    """
    from pretouch.verification import compare  # noqa: PLC0415 - keeps `pretouch --help` quick

    if shown.output is not None:
        refuse_input(shown.output, files)
    tasks, notes = _tasks(files, parts=parts)
    print_progress(f"simulating {len(tasks)} candidates")
    result = compare(tasks, runs=runs, notes=notes)
    default = f"{files[0].stem}-compare.html"
    shown.show(result, default, good=result.best is not None, inputs=files, lines=None)


def _tasks(files: list[Path], *, parts: bool) -> tuple[dict[str, Task], tuple[str, ...]]:
    """Return tasks by the names of their scenario file, sensor part or both, and notes on what was assumed."""
    from pretouch.config import load_scenario  # noqa: PLC0415
    from pretouch.config.parts import tasks_of_parts  # noqa: PLC0415

    if not parts and len(files) < 2:
        raise InvalidInputError(
            "found 1 scenario file, expected two or more. To compare the built-in sensor parts in this scenario, run: "
            f"pretouch compare {files[0]} --parts"
        )
    stems = [file.stem for file in files]
    names = [file.stem if stems.count(file.stem) == 1 else str(file) for file in files]
    if len(set(names)) < len(names):
        raise InvalidInputError(f"found the file {names[0]} twice, expected different files")
    if not parts:
        return {name: load_scenario(file) for name, file in zip(names, files, strict=True)}, ()
    of_parts = [(name, tasks_of_parts(file)) for name, file in zip(names, files, strict=True)]
    notes = tuple(dict.fromkeys(note for _, found in of_parts for note in found.notes))
    if len(of_parts) == 1:
        return of_parts[0][1].tasks, notes
    return {f"{name} {part}": task for name, found in of_parts for part, task in found.tasks.items()}, notes
