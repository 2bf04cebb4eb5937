"""The options of the verbs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

__all__ = [
    "FloorSigmas",
    "Force",
    "Json",
    "Model",
    "NearFieldPeak",
    "NoObject",
    "Offset",
    "Output",
    "Report",
    "Saturation",
    "Select",
]

Json: TypeAlias = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object, all SI, and nothing else; write a report only with --output."),
]
Output: TypeAlias = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="PATH", help="Where the HTML report goes.", show_default=False)
]
Report: TypeAlias = Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report.")]
Force: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--force", help="Overwrite whatever stands where the report goes; unasked, only an own, unchanged report is."
    ),
]

Offset: TypeAlias = Annotated[
    str, typer.Option("--offset", metavar="auto|fit|zero|VALUE", help="Where the level without an object comes from.")
]
NoObject: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--no-object",
        metavar="FILE|VALUE",
        help="Readings without an object, beside those in FILE.",
        show_default=False,
    ),
]
Select: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--select", metavar="COLUMN=VALUE", help="Only curves with this label; repeatable.", show_default=False
    ),
]
Saturation: TypeAlias = Annotated[
    str, typer.Option("--saturation", metavar="auto|none|VALUE", help="Output from which the sensor is clipped.")
]
NearFieldPeak: TypeAlias = Annotated[
    str, typer.Option("--near-field-peak", metavar="auto|none|DISTANCE", help="Where the near-field peak lies.")
]
Model: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--model", metavar="NAME", help="Choose among these models only; repeatable.", show_default=False),
]
FloorSigmas: TypeAlias = Annotated[
    float,
    typer.Option("--floor-sigmas", metavar="NUMBER", help="Sigmas above the offset from which a signal is usable."),
]
