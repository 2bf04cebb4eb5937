"""The options of the verbs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from pretouch._core.units import read_quantity

__all__ = [
    "Force",
    "Json",
    "LoopFile",
    "LoopGain",
    "LoopSeed",
    "Output",
    "Report",
    "ScenarioFile",
    "read_gain",
]

ScenarioFile: TypeAlias = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).")]
LoopFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="FILE", help="Scenario file (TOML) with [chain] and [controller].")
]
Json: TypeAlias = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object, all SI, and nothing else; write a report only with --output."),
]
Output: TypeAlias = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="PATH", help="Where the HTML report goes.")
]
Report: TypeAlias = Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report.")]
Force: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--force", help="Overwrite whatever stands where the report goes; unasked, only an own, unchanged report is."
    ),
]
LoopGain: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="GAIN", help='The gain to run, such as "-0.7 N*s"; else that of the file, or the designed one.'
    ),
]
LoopSeed: TypeAlias = Annotated[
    int | None, typer.Option(metavar="NUMBER", min=0, help="Seed of the noise, in the place of the file's.")
]


def read_gain(text: str | None) -> float | None:
    """Read the gain of an option, where it is given."""
    return None if text is None else read_quantity(text, "N*s", name="--gain")
