"""Implement the command `pretouch export`, which writes a verified control law for a robot."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import as_json

from .terminal import conclude, end, print_text
from .verbs import LoopFile, LoopGain, load_loop


class Target(StrEnum):
    """Format of an exported control law.

    The values are the names in `pretouch.exports.TARGETS`.
    """

    ARDUINO = "arduino"
    C = "c"
    FMU = "fmu"
    JSON = "json"
    ROS2 = "ros2"


def export(
    target: Annotated[
        Target,
        typer.Argument(
            metavar="TARGET",
            help="What to write: arduino (Arduino library with a whole loop), c (C99 source), fmu (co-simulation units "
            "for FMI 2.0 and 3.0), json (parameters and MATLAB code) or ros2 (ROS 2 package).",
        ),
    ],
    file: LoopFile,
    *,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="The new folder.")],
    gain: LoopGain = None,
    unverified: Annotated[
        bool,
        typer.Option("--unverified", help="Export without verification; the exported files say so."),
    ] = False,
    toward_object: Annotated[
        bool,
        typer.Option(
            "--toward-object", help="With --unverified, also export a law that pulls the robot toward the object."
        ),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an unchanged folder of an earlier export.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="List all files and warnings.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print only a JSON object.")] = False,
) -> None:
    """Verify the control law of a scenario file (TOML), and export it for use on a robot.

    The folder has the law's source, the constants of this design, test vectors from a simulation, a test that replays
    them, and instructions. If the verification finds that the gain does not hold, nothing is written.

    Exit status: 0 the folder is written, 1 the gain does not hold, 2 a mistake in the request.
    """
    run = partial(
        _export,
        target,
        file,
        output,
        gain=gain,
        unverified=unverified,
        toward_object=toward_object,
        force=force,
        verbose=verbose,
        json=json,
    )
    conclude(run, json_wanted=json)


def _export(
    target: Target,
    file: Path,
    output: Path,
    *,
    gain: str | None,
    unverified: bool,
    toward_object: bool,
    force: bool,
    verbose: bool,
    json: bool,
) -> None:
    """Export a control law and print the result."""
    from pretouch.exports import export  # noqa: PLC0415
    from pretouch.report.pages import page_of  # noqa: PLC0415 - keeps `pretouch --help` quick

    from .summary import summary_of  # noqa: PLC0415

    if toward_object and not unverified:
        raise InvalidInputError(
            "--toward-object: this option needs --unverified, because a law that pulls the robot toward the object "
            "fails every verification"
        )
    task = load_loop(file, "simulating encounters on the loop" if not unverified else "simulating", gain, None)
    result = export(
        task,
        output,
        target.value,
        verify=not unverified,
        toward_object=toward_object,
        date=_date(),
        overwrite=force,
    )
    if json:
        print_text(as_json(result.to_dict()))
    else:
        print_text(str(result) if verbose else summary_of(page_of(result), lines=15, ending=("All files: --verbose",)))
    end(good=result.is_written)


def _date() -> str:
    """Return the date for exported files in UTC. SOURCE_DATE_EPOCH can set another date than today."""
    text = os.environ.get("SOURCE_DATE_EPOCH")
    if text is None:
        return datetime.now(UTC).date().isoformat()
    try:
        return datetime.fromtimestamp(int(text), UTC).date().isoformat()
    except (ValueError, OverflowError, OSError):
        raise InvalidInputError(
            f"SOURCE_DATE_EPOCH: found {text!r}, expected a whole number of seconds since 1970"
        ) from None
