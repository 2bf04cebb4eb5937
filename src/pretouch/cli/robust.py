"""`pretouch robust`: the gain of a scenario file whose inputs are not known exactly."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import Force, Json, Output, Report
from .terminal import NO_RESULT, OK, Presentation, conclude, print_progress

__all__ = ["robust"]


def robust(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Scenario file (TOML) with [uncertainty].", show_default=False)
    ],
    *,
    samples: Annotated[
        int | None,
        typer.Option(
            "--samples",
            metavar="NUMBER",
            min=2,
            help="Encounters that are sampled, and as many fresh ones; in the place of what the file says.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="NUMBER", min=0, help="Seed of all samples, likewise.", show_default=False),
    ] = None,
    json: Json = False,
    output: Output = None,
    report: Report = True,
    force: Force = False,
) -> None:
    """Choose the gain where inputs are not known exactly (TOML).

    Prints the gain, what fresh samples say of it beside the gain that is optimal where nothing is uncertain, and how
    often every constraint holds; writes a report with figures, STEM-robust.html in this folder.

    Exit status: 0 optimal, 1 no gain meets the constraints or ends in contact as often as it must, 2 a mistake in the
    request.
    """
    shown = Presentation(json=json, output=output, report=report, force=force)
    conclude(lambda: _run(file, samples, seed, shown), json_wanted=json)


def _run(file: Path, samples: int | None, seed: int | None, presentation: Presentation) -> int:
    from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick

    problem = load_scenario(file)
    print_progress(f"{file}: sampling encounters")
    found = problem.design_robust(samples=samples, seed=seed)

    def write(path: Path, overwrite: bool) -> object:
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        print_progress(f"{file}: drawing the report")
        return write_report(found, path, calibration=problem.calibration, source=problem.source, overwrite=overwrite)

    presentation.show(found, f"{file.stem}-robust.html", write, problem.reservations(found))
    return OK if found.status.value == "optimal" else NO_RESULT
