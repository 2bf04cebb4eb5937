"""`pretouch pareto`: the trade-off of a scenario file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import Force, Json, Output, Report
from .terminal import NO_RESULT, OK, Presentation, conclude, print_progress

__all__ = ["pareto"]


def pareto(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).", show_default=False)],
    *,
    json: Json = False,
    output: Output = None,
    report: Report = True,
    force: Force = False,
) -> None:
    """Find what a scenario file (TOML) can trade: the Pareto front of contact quantities.

    Prints the knee of the front, its ends, where the designed gain or the choice of the file lies, and how far all of
    them are from what any controller could reach; writes a report with figures, STEM-pareto.html in this folder.

    Exit status: 0 a front was found, 1 no choice meets the constraints or ends in contact, 2 a mistake in the request.
    """
    conclude(lambda: _run(file, Presentation(json=json, output=output, report=report, force=force)), json_wanted=json)


def _run(file: Path, presentation: Presentation) -> int:
    from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick

    problem = load_scenario(file)
    print_progress(f"{file}: tracing what can be traded")
    found = problem.trade_off()

    def write(path: Path, overwrite: bool) -> object:
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        return write_report(found, path, calibration=problem.calibration, source=problem.source, overwrite=overwrite)

    presentation.show(found, f"{file.stem}-pareto.html", write, problem.reservations(found))
    return OK if found.status.value == "found" else NO_RESULT
