"""Read sensor readings and their times from a CSV file with a time column."""

from __future__ import annotations

import csv
import re
from difflib import get_close_matches
from pathlib import Path
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError, UnitError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import parse_unit

TIME: Final = re.compile(r"(?:time|timestamp|stamp|t|sec|seconds|__time)\b.*", re.IGNORECASE)
_UNIT: Final = re.compile(r"(.*?)\s*[\[(]\s*([^\[\]()]*)\s*[\])]\s*$")
_SECONDS: Final = parse_unit("s").exponents
_EPOCH_NS: Final = 1e17  # a time without unit above this is in nanoseconds since 1970
_FEWEST: Final = 2  # columns


def is_table(path: Path) -> bool:
    """Return True if the file is a text table.

    Only the ending of the file name counts: .csv, .tsv or .txt.

    Args:
        path: the file.
    """
    return path.suffix.lower() in {".csv", ".tsv", ".txt"}


def split_unit(title: str) -> tuple[str, str]:
    """Split a column header such as "distance [mm]" into name and unit.

    Args:
        title: the header.

    Returns:
        Name and unit; the unit is empty if there is none.

    Examples:
        >>> split_unit("distance [mm]"), split_unit("reading")
        (('distance', 'mm'), ('reading', ''))
    """
    match = _UNIT.fullmatch(title)
    return (match[1], match[2]) if match and match[1] else (title, "")


def read_columns(path: Path, wanted: str) -> tuple[str, str, FloatArray, FloatArray]:
    """Read the time column and one other column of a CSV file.

    Args:
        path: the file.
        wanted: header of the column, with or without its unit; empty if there is only one besides the time.

    Returns:
        Name and unit of the column, times [s] and values; a cell that is no number is NaN.

    Raises:
        InvalidInputError: the file cannot be read, or there is no time column or no such column.
    """
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        what = "does not exist" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
        raise InvalidInputError(f"{path}: this file {what}") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise InvalidInputError(f"{path}: this file is empty; expected a header line, and rows with time and reading")
    delimiter = max("\t;,", key=lines[0].count)
    header = [cell.strip() for cell in next(csv.reader(lines[:1], delimiter=delimiter))]
    rows = list(csv.reader(lines[1:], delimiter=delimiter))
    if len(header) < _FEWEST:
        raise InvalidInputError(
            f"{path}: found the header line {lines[0]!r}, expected two or more columns, such as: time [s],reading"
        )
    clock = next((i for i, title in enumerate(header) if TIME.fullmatch(title)), None)
    if clock is None:
        raise InvalidInputError(
            f"{path}: found no time column among the columns {', '.join(header)}; rename the column with the times "
            "to time [s]"
        )
    index = _index_of(path, header, wanted, clock)
    time, values = (np.array([_number(row, i) for row in rows]) for i in (clock, index))
    name, unit = split_unit(header[index])
    return name, unit, time * _factor(path, header[clock], time), values


def _index_of(path: Path, header: list[str], wanted: str, clock: int) -> int:
    """Return the index of the chosen column, or of the only column besides the time column."""
    others = [i for i in range(len(header)) if i != clock]
    if not wanted and len(others) == 1:
        return others[0]
    matching = [i for i in others if wanted in {header[i], split_unit(header[i])[0]}]
    if len(matching) == 1:
        return matching[0]
    names = [header[i] for i in others]
    near = get_close_matches(wanted, names, 1) if wanted else []
    problem = f"there is no column {wanted!r}" if wanted else "there are several columns of readings"
    hint = f"; did you mean {near[0]}?" if near else ";"
    raise InvalidInputError(
        f"{path}: {problem}{hint} choose one with --topic: {', '.join(names)}",
        value=wanted,
        limit=tuple(names),
        remedy=near[0] if near else "--topic",
    )


def _number(row: list[str], index: int) -> float:
    try:
        return float(row[index])
    except (ValueError, IndexError):
        return float("nan")


def _factor(path: Path, title: str, time: FloatArray) -> float:
    """Return the factor that converts the time column to seconds."""
    unit = split_unit(title)[1] or next((u for u in ("ns", "us", "ms") if title.lower().endswith(f"_{u}")), "")
    if not unit:
        return 1e-9 if len(time) and np.nanmax(np.abs(time)) > _EPOCH_NS else 1.0
    try:
        parsed = parse_unit(unit)
    except UnitError:
        parsed = None
    if parsed is None or parsed.exponents != _SECONDS:
        raise InvalidInputError(
            f"{path}: the name of the time column, {title!r}, has no unit of time; add the unit, such as time [s]"
        )
    return parsed.factor
