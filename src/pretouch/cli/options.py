"""The options of the verbs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

__all__ = [
    "AxisTexts",
    "Columns",
    "DaskAddress",
    "DataOutput",
    "FigurePath",
    "FixedGain",
    "FloorSigmas",
    "Force",
    "Json",
    "Labels",
    "LoopGain",
    "LoopSeed",
    "Model",
    "NearFieldPeak",
    "NoObject",
    "Offset",
    "Output",
    "Replace",
    "Report",
    "ResultNames",
    "Saturation",
    "Select",
    "SweepJson",
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
Columns: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--columns",
        metavar="distance=COLUMN,output=COLUMN",
        help='Which columns are meant, by header, number (from 1) or unit, such as "distance=1,output=3 [V]".',
        show_default=False,
    ),
]
Labels: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--labels",
        metavar="COLUMN,...|none",
        help="The columns that tell curves apart; all that are left where not given.",
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

AxisTexts: TypeAlias = Annotated[
    list[str],
    typer.Option(
        "--axis",
        metavar="NAME=START:STOP:COUNT",
        help="An input and its values, such as obstacle.velocity=-1:-0.01:100; with :log for equal ratios, or a list "
        "NAME=VALUE,VALUE,...; values with units or bare in SI; repeatable.",
        show_default=False,
    ),
]
ResultNames: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--result",
        metavar="NAME",
        help="A quantity to be computed, such as relative_velocity; repeatable.",
        show_default=False,
    ),
]
FixedGain: TypeAlias = Annotated[
    str | None,
    typer.Option("--gain", metavar="GAIN", help='The gain of all encounters, such as "-0.7 N*s".', show_default=False),
]
LoopGain: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--gain",
        metavar="GAIN",
        help='The gain to run, such as "-0.7 N*s"; else that of the file, or the designed one.',
        show_default=False,
    ),
]
LoopSeed: TypeAlias = Annotated[
    int | None,
    typer.Option(
        "--seed", metavar="NUMBER", min=0, help="Seed of the noise, in the place of the file's.", show_default=False
    ),
]
DataOutput: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="PATH", help="Where the dataset goes: NAME.zarr or NAME.nc.", show_default=False
    ),
]
FigurePath: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--figure", metavar="PATH", help="Draw the results over one or two axes: PNG, SVG or PDF.", show_default=False
    ),
]
DaskAddress: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--dask",
        metavar="ADDRESS",
        help="Compute on the workers of this Dask scheduler, such as tcp://10.0.0.1:8786; they write the dataset.",
        show_default=False,
    ),
]
SweepJson: TypeAlias = Annotated[
    bool, typer.Option("--json", help="Print one JSON object, all SI, and nothing else; with values, if not too many.")
]
Replace: TypeAlias = Annotated[
    bool, typer.Option("--force", help="Replace another sweep at the output, or a figure; unasked, nothing is.")
]
