"""Implement the command `pretouch project` for robot models.

It prints mass and limits of a robot model along sensor axes.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from pretouch._core.blocks import Page

from .terminal import conclude, print_text

_ROWS = 12  # rows of the table without --verbose


def project(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Robot model (MJCF or URDF) with named sites.")],
    *,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print all rows and all warnings.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print only a JSON object.")] = False,
) -> None:
    """Print mass and limits of a robot model at its named points.

    The table also has the longest retreat. The named points are the sites of the model. Each site is projected along
    its own axes x, y and z, in the posture in which the model is defined and in all of its keyframes. This command
    needs MuJoCo: pip install 'pretouch[mujoco]'.

    Exit status: 0 the table is printed, 2 a mistake in the request or in the model.
    """
    conclude(partial(_project, model, verbose=verbose, json=json), json_wanted=json)


def _project(file: Path, *, verbose: bool, json: bool) -> None:
    """Print mass and limits at all named points of a robot model."""
    from pretouch._core.files import as_json  # noqa: PLC0415
    from pretouch.report.pages import page_of  # noqa: PLC0415 - keeps `pretouch --help` quick, as below
    from pretouch.robots import load_model, project  # noqa: PLC0415

    table = project(load_model(file))
    if json:
        print_text(as_json(table.to_dict()))
        return
    print_text(str(table) if verbose else _short(page_of(table)))


def _short(page: Page) -> str:
    """Shorten the table of a robot model for the terminal."""
    from pretouch._core.blocks import aligned, cell_as_text, tables_of  # noqa: PLC0415

    (table,) = tables_of(page.blocks)
    cells = [[cell_as_text(cell) for cell in row] for row in (table.head, *table.rows)]
    lines = aligned(cells)[: _ROWS + 1]
    omitted = [(len(table.rows) - _ROWS, "more row"), (len(page.warnings), "warning")]
    counts = [f"{n} {what}{'s' if n > 1 else ''}" for n, what in omitted if n > 0]
    ending = [*page.findings, *([f"{' and '.join(counts)}: --verbose"] if counts else [])]
    return "\n\n".join("\n".join(block) for block in ([page.headline], lines, ending) if block)
