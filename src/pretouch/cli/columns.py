"""Define the command-line options that select calibration columns and curves."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, TypeAlias

from pretouch._core.errors import InvalidInputError, PretouchError

from .terminal import option

if TYPE_CHECKING:
    from pretouch.calibration import Calibration
    from pretouch.config.sensor import FitRequest

Select: TypeAlias = Annotated[list[str] | None, option("COLUMN=VALUE", "Use only curves with this label; repeatable.")]
Columns: TypeAlias = Annotated[
    str | None,
    option(
        "distance=COLUMN,output=COLUMN",
        'Columns of distance and output, by header, number (from 1) or unit, such as "distance=1,output=3 [V]".',
    ),
]
Labels: TypeAlias = Annotated[
    str | None,
    option("COLUMN,...|none", "The columns with labels of curves; by default all columns except distance and output."),
]


def read_columns(text: str | None) -> dict[str, str]:
    """Parse the option --columns, such as `distance=1,output=3 [V]`; a header may contain commas."""
    if text is None:
        return {}
    parts = re.split(r"(?:^|[,;])\s*(\w+)\s*=", text)
    if parts[0].strip() or len(parts) < 3:
        raise InvalidInputError(
            f'--columns: found {text!r}, expected NAME=COLUMN, for example "distance=1,output=3 [V]". COLUMN is a '
            "column header, a column number from 1, or a unit in brackets"
        )
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def read_labels(text: str | None) -> tuple[str, ...] | None:
    """Return the column names in the option --labels.

    An example is `day,sensor`; `none` is an empty list.
    """
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    return () if names == ("none",) else names


def read_selection(texts: list[str] | None) -> dict[str, str]:
    """Parse the option --select for calibration curves. Curves are selected by their labels, such as `day=30`."""
    for text in texts or ():
        if not re.fullmatch(r"[^=]+=.*", text):
            raise InvalidInputError(f"--select: found {text!r}, expected COLUMN=VALUE, for example day=30")
    return {key.strip(): value.strip() for key, value in (text.split("=", 1) for text in texts or ())}


def selection_of(curve: Calibration) -> str:
    """Return the options --select for a labeled calibration curve."""
    return " ".join(f"--select {shlex.quote(f'{column}={label}')}" for column, label in curve.labels.items())


def fullest(curves: Sequence[Calibration]) -> Calibration:
    """Return the curve with readings at most distances, as an example of a curve that can be used."""
    return max(curves, key=lambda curve: len(curve.distinct_distances))


def without_labels(request: FitRequest) -> str:
    """Return advice to ignore the labels of a file, if its rows are one curve then; otherwise an empty text."""
    try:
        is_one = not request.select and len(replace(request, labels=()).read()) == 1
    except PretouchError:
        is_one = False
    return ". If all rows are of one sensor and one surface, use --labels none instead" if is_one else ""
