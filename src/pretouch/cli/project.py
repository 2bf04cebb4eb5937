"""Implement the command `pretouch project` for robot models.

It prints mass and limits of a robot model along sensor axes.
"""

from __future__ import annotations

from functools import partial
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pretouch._core.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pretouch._core.blocks import Page
    from pretouch.robots import ProjectionTable

from .terminal import conclude, option, print_text

_ROWS = 12  # rows of the table without --verbose
_REASONS = 5  # reasons for missing rows, likewise
_WIDTH = 100
_LINE = 120  # width of findings


Sites = Annotated[
    list[str] | None,
    option(
        "TEXT", "Name of a site, or BODY:AXIS[:OFFSET] such as wrist_3_link:+z:50mm. Repeatable. Default: all sites."
    ),
]
Packages = Annotated[list[str] | None, option("DIR", "Folder that contains the packages of a URDF file. Repeatable.")]
Base = Annotated[str | None, option("NAME", "How the base stands: fixed or free (floating). Default: as in the file.")]
Posture = Annotated[list[str] | None, option("JOINT=VALUE", "Position of a joint, such as elbow=90deg. Repeatable.")]
Joints = Annotated[
    list[str] | None, option("NAME", "Joint that may move; all others are held. Repeatable. Default: all.")
]


def project(
    model: Annotated[str, typer.Argument(metavar="MODEL", help="Robot model: MJCF, URDF or xacro file, or its name.")],
    *,
    site: Sites = None,
    posture: Posture = None,
    packages: Packages = None,
    base: Base = None,
    joint: Joints = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print all rows and all warnings.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print only a JSON object.")] = False,
) -> None:
    """Print mass and limits of a robot model at its named points.

    The table also has the longest retreat. The named points are the sites of the model, or points on bodies that --site
    names. Each site is projected along its own axes x, y and z, in the posture in which the model is defined and in all
    of its keyframes. MODEL may also be a name of robot_descriptions or MuJoCo Menagerie, if its files are on this
    computer. This command needs MuJoCo: pip install 'pretouch[mujoco]'.

    Exit status: 0 the table is printed, 2 a mistake in the request or in the model.
    """
    choices = {"packages": packages or [], "base": base, "joints": joint or []}
    request = partial(_table, model, site or [], posture or [], choices)
    conclude(partial(_project, request, verbose=verbose, json=json), json_wanted=json)


def _project(request: Callable[[], ProjectionTable], *, verbose: bool, json: bool) -> None:
    """Print mass and limits at all named points of a robot model."""
    from pretouch._core.files import as_json  # noqa: PLC0415
    from pretouch.report.pages import page_of  # noqa: PLC0415 - keeps `pretouch --help` quick, as below

    table = request()
    if json:
        print_text(as_json(table.to_dict()))
        return
    print_text(str(table) if verbose else _short(page_of(table)))


def _table(model: str, sites: list[str], posture: list[str], choices: dict[str, Any]) -> ProjectionTable:
    """Load a robot model, and compute its mass and limits."""
    from pretouch.robots import SensorSite, load_model, project, site_on_body  # noqa: PLC0415

    positions = dict(_position(text) for text in posture)
    on_bodies = {text: site_on_body(text) for text in sites}
    loaded = load_model(
        model,
        **choices,
        posture=positions,
        sites=[found for found in on_bodies.values() if found is not None],
    )
    wanted = [
        SensorSite(text, axis=axis) if found is None else SensorSite(found.name, axis=found.axis)
        for text, found in on_bodies.items()
        for axis in (("+x", "+y", "+z") if found is None else (found.axis,))
    ]
    moving = {name: value for name, value in positions.items() if not choices["joints"] or name in choices["joints"]}
    return project(loaded, wanted, moving)


def _position(text: str) -> tuple[str, str | float]:
    """Parse the position of a joint, such as "elbow=90deg"."""
    name, sign, value = text.rpartition("=")
    if not (sign and name and value):
        raise InvalidInputError(f"--posture: found {text!r}, expected JOINT=VALUE, such as elbow=90deg", value=text)
    try:
        return name, float(value)  # in SI units
    except ValueError:
        return name, value


def _short(page: Page) -> str:
    """Shorten the tables of a robot model for the terminal."""
    from pretouch._core.blocks import aligned, cell_as_text, tables_of  # noqa: PLC0415

    numbers, *others = tables_of(page.blocks)
    cells = [[cell_as_text(cell) for cell in row] for row in (numbers.head, *numbers.rows)]
    reasons = [": ".join((f"{row[0]}, {row[1]}", str(row[2]))) for table in others for row in table.rows]
    blocks = [
        aligned(cells)[: _ROWS + 1],
        [line for reason in reasons[:_REASONS] for line in wrap(f"no numbers for {reason}", _WIDTH)],
    ]
    counts = [(len(numbers.rows) - _ROWS, "more row"), (len(reasons) - _REASONS, "more reason")]
    counts.append((len(page.warnings), "warning"))
    texts = [f"{n} {what}{'s' if n > 1 else ''}" for n, what in counts if n > 0]
    listed = " and ".join((", ".join(texts[:-1]), texts[-1]) if len(texts) > 1 else texts)
    findings = [line for finding in page.findings for line in wrap(finding, _LINE)]
    ending = [*findings, *([f"{listed}: --verbose"] if texts else [])]
    return "\n\n".join("\n".join(block) for block in ([page.headline], *blocks, ending) if block)
