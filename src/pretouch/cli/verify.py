"""`pretouch verify`: whether the gain of a scenario file holds on its sampled loop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pretouch._core.units import read_quantity

from .options import Force, Json, LoopGain, LoopSeed, Output, Report
from .terminal import NO_RESULT, OK, Presentation, conclude, print_progress

__all__ = ["verify"]


def verify(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Scenario file (TOML) with [chain] and [controller].", show_default=False),
    ],
    *,
    gain: LoopGain = None,
    runs: Annotated[
        int | None,
        typer.Option(
            "--runs", metavar="NUMBER", min=1, help="How many encounters; else as the file says.", show_default=False
        ),
    ] = None,
    seed: LoopSeed = None,
    changes: Annotated[
        bool, typer.Option("--changes/--no-changes", help="Look for the one change that would help most.")
    ] = True,
    json: Json = False,
    output: Output = None,
    report: Report = True,
    force: Force = False,
) -> None:
    """Tell whether the gain holds on the loop as it will really run (TOML).

    Runs many encounters with the noise of the sensor and what [uncertainty] says of inputs; where the file names a
    calibration, also the sensors that its readings allow. Prints a verdict, contact
    predicted and simulated, with mitigation and without, the margin to every limit and to instability, and the one
    change that would help most; writes a page with figures, STEM-verify.html in this folder.

    Exit status: 0 the gain holds, or does so narrowly, 1 it does not, or there is none, 2 a mistake in the request.
    """
    shown = Presentation(json=json, output=output, report=report, force=force)
    asked = {"runs": runs, "seed": seed, "changes": changes}
    conclude(lambda: _run(file, gain, asked, shown), json_wanted=json)


def _run(file: Path, gain: str | None, asked: dict[str, Any], presentation: Presentation) -> int:
    from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick

    fixed = None if gain is None else read_quantity(gain, "N*s", name="--gain")
    problem = load_scenario(file)
    print_progress(f"{file}: running encounters on the loop")
    found = problem.verify(gain=fixed, **asked)

    def write(path: Path, overwrite: bool) -> object:
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        print_progress(f"{file}: drawing the page")
        return write_report(found, path, calibration=problem.calibration, source=problem.source, overwrite=overwrite)

    presentation.show(found, f"{file.stem}-verify.html", write, problem.reservations(found))
    return OK if found.status.value in {"holds", "holds-narrowly"} else NO_RESULT
