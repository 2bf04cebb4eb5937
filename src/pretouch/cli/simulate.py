"""`pretouch simulate`: one encounter on the sampled loop of a scenario file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pretouch._core.units import read_quantity

from .options import Force, Json, LoopGain, LoopSeed, Output, Report
from .terminal import NO_RESULT, OK, Presentation, conclude, print_progress

__all__ = ["simulate"]


def simulate(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Scenario file (TOML) with [chain] and [controller].", show_default=False),
    ],
    *,
    gain: LoopGain = None,
    seed: LoopSeed = None,
    json: Json = False,
    output: Output = None,
    report: Report = True,
    force: Force = False,
) -> None:
    """Run one encounter on the loop as it will really run (TOML).

    Prints the contact on the loop beside the predicted one and beside no mitigation, when the object was first seen,
    every contact with its force, and what the controller reported; writes a report with the course of the run,
    STEM-simulate.html in this folder.

    Exit status: 0 the run ended in contact, 1 it did not, 2 a mistake in the request.
    """
    shown = Presentation(json=json, output=output, report=report, force=force)
    conclude(lambda: _run(file, gain, seed, shown), json_wanted=json)


def _run(file: Path, gain: str | None, seed: int | None, presentation: Presentation) -> int:
    from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick

    fixed = None if gain is None else read_quantity(gain, "N*s", name="--gain")
    problem = load_scenario(file)
    print_progress(f"{file}: running the loop")
    found = problem.simulate_encounter(gain=fixed, seed=seed)

    def write(path: Path, overwrite: bool) -> object:
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        return write_report(found, path, calibration=problem.calibration, source=problem.source, overwrite=overwrite)

    presentation.show(found, f"{file.stem}-simulate.html", write, problem.reservations(found))
    return OK if found.run.touched.all() else NO_RESULT
