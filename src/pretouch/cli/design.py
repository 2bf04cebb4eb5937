"""`pretouch design`: the optimal gain of a scenario file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import Force, Json, Output, Report
from .terminal import NO_RESULT, OK, Presentation, conclude, print_progress

__all__ = ["design"]


def design(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).", show_default=False)],
    *,
    json: Json = False,
    output: Output = None,
    report: Report = True,
    force: Force = False,
) -> None:
    """Choose the gain for a scenario file (TOML), and the admittance where the file leaves it open.

    Prints the optimal gain, the contact it leads to, every constraint with its margin, what no mitigation would have
    given, and what the gain is most sensitive to; writes a report with figures, STEM-design.html in this folder.

    Exit status: 0 optimal, 1 no gain meets the constraints or ends in contact, 2 a mistake in the request.
    """
    conclude(lambda: _run(file, Presentation(json=json, output=output, report=report, force=force)), json_wanted=json)


def _run(file: Path, presentation: Presentation) -> int:
    from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick

    problem = load_scenario(file)
    print_progress(f"{file}: searching gains")
    found = problem.design_admittance() if problem.is_admittance_free else problem.design()

    def write(path: Path, overwrite: bool) -> object:
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        return write_report(found, path, calibration=problem.calibration, source=problem.source, overwrite=overwrite)

    presentation.show(found, f"{file.stem}-design.html", write, problem.reservations(found))
    return OK if found.status.value == "optimal" else NO_RESULT
