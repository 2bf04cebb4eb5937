"""`pretouch reproduce`: the tables and figures of the letter, computed again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import Force, Json, Output, Report
from .terminal import NO_RESULT, OK, Presentation, conclude, print_progress

__all__ = ["reproduce"]

REPORT = "letter-reproduction.html"


def reproduce(
    ids: Annotated[
        list[str] | None,
        typer.Argument(metavar="ID", help="What to reproduce; all of it where none is named.", show_default=False),
    ] = None,
    *,
    json: Json = False,
    output: Output = None,
    report: Report = True,
    force: Force = False,
) -> None:
    """Compute the letter's tables and figures again.

    Sets every printed number beside ours. Prints how many agree, what disagrees and why, and where the letter's text
    contradicts its own equations; writes letter-reproduction.html in this folder, a report with figures, the code of
    each, and all numbers.

    \b
    ID is one of:
      table-1  figure-3  figure-4  figure-5  table-2  figure-6  one-gain  table-3
      attraction  constraints  impact-force

    Exit status: 0 every difference is explained, 1 not everything comes out, 2 a mistake in the request.
    """  # noqa: D301 - the escape keeps the lines of the list together
    presentation = Presentation(json=json, output=output, report=report, force=force)
    conclude(lambda: _run(tuple(ids or ()), presentation), json_wanted=json)


def _run(ids: tuple[str, ...], presentation: Presentation) -> int:
    from pretouch.letter import reproduce as compute  # noqa: PLC0415 - `pretouch --help` stays quick

    found = compute(ids, progress=lambda name: print_progress(f"computing {name}"))

    def write(path: Path, overwrite: bool) -> object:
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        return write_report(found, path, overwrite=overwrite)

    presentation.show(found, REPORT, write)
    return OK if found.holds else NO_RESULT
