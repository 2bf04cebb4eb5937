"""Read sensor readings and their times from a table of text with a time column."""

from __future__ import annotations

import math
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch.tables.cells import TextTable
from pretouch.tables.column_options import ColumnOption, ColumnOptions
from pretouch.tables.date_cells import number_of_date
from pretouch.tables.documents import DOCUMENTS
from pretouch.tables.names import is_named, split_title
from pretouch.tables.text_table import read_table
from pretouch.tables.times import in_order, read_times, refuse_coarse, times_at_rate
from pretouch.tables.unit_words import TIME, dimension

from .mixed_sensors import is_identity, parse_choice, rows_of_one_sensor
from .recording import UNBOUNDED

LINE = "line as received"
"""Header of the column with the lines of a recording at the bench as they came."""
_TABLES = (
    frozenset({".csv", ".tsv", ".txt", ".log", ".dat", ".json", ".jsonl", ".ndjson", ".lvm", ".yaml", ".yml"})
    | DOCUMENTS
)


class RecordedColumn(NamedTuple):
    """A column of a recording with its times.

    `stamps` are in nanoseconds; a cell that is no number is NaN, and one that says "no object" is infinite. `bounds`
    are the smallest and the largest distance [m] that Range messages state. `read` says how the file was understood,
    `notes` what is lost or doubtful.
    """

    name: str
    unit: str
    stamps: IntArray
    values: FloatArray
    bounds: tuple[float, float]
    read: tuple[str, ...]
    notes: tuple[str, ...]


def is_table(path: Path) -> bool:
    """Return True if the file is a table: text, or a document such as a spreadsheet.

    Only the ending of the file name counts.

    Args:
        path: the file.
    """
    return path.suffix.lower() in _TABLES and not path.is_dir()


def read_columns(path: Path, wanted: str, rate: float | None = None) -> RecordedColumn:
    """Read the times and one other column of a table.

    Args:
        path: the file.
        wanted: header of the column, with or without its unit, or its number from 1; empty if there is only one besides
            the times. `value[sensor=left]` reads only the rows with `left` in the column `sensor`.
        rate: readings per second [Hz] of a table without times; None if it has times.

    Returns:
        The column.

    Raises:
        InvalidInputError: the file cannot be read, or there is no time column or no such column.
    """
    if not path.exists():
        raise InvalidInputError(f"{path}: this file does not exist")
    options = None if rate is None else ColumnOptions(output=ColumnOption(key="output", number=1))  # needs no header
    table = read_table(path, options, is_recording=True)
    if not table.lines:
        raise InvalidInputError(
            f"{path}: the table has a header but no rows below the header; record again, or export all rows"
        )
    choice = parse_choice(wanted, table.header)
    table, chosen = rows_of_one_sensor(path, table, choice)
    table, turned = in_order(table)
    times = read_times(table) if rate is None else times_at_rate(table, rate)
    index = _index_of(path, table, choice.name, times.columns)
    values = table.numbers(index)
    name, unit = split_title(table.header[index])
    read = (f"The times are from {times.read}.", *chosen, *table.notes)
    notes = (*table.lost, *turned, *times.notes)
    bounds = UNBOUNDED
    if unit is None and _is_range(table, index):
        unit, bounds = "m", _bounds(table, index)
        read = (*read, f"The column {table.title(index)} of a Range message is in m.")
    usable = np.flatnonzero(times.usable)
    if turned:
        usable = usable[np.argsort(times.stamps[usable], kind="stable")]
    if rate is None:
        refuse_coarse(table, times, usable[~np.isnan(values[usable])])
    lost = int(np.isnan(values[usable]).sum())
    if lost:
        notes = (
            *notes,
            f"{lost:,} cells of the column {table.title(index)} are no numbers: missing readings.",
        )
        dates = sum(number_of_date(cell) is not None for cell in table.columns[index])
        if dates:
            notes = (*notes, f"{dates:,} of these cells are dates, which a spreadsheet made of numbers such as 1.2.")
    return RecordedColumn(name, unit or "", times.stamps[usable], values[usable], bounds, read, notes)


def _index_of(path: Path, table: TextTable, wanted: str, times: tuple[int, ...]) -> int:
    """Return the index of the chosen column, or of the only column with readings besides the times."""
    header = table.header
    others = [i for i in range(len(header)) if i not in times]
    kinds = ("count", "setting", "statistic")
    numeric = [i for i in others if not any(is_named(header[i], kind) for kind in kinds) and header[i] != LINE]
    numeric = [i for i in numeric if not is_identity(header[i])]
    numeric = [i for i in numeric if np.isfinite(table.numbers(i)).any() and not _is_another_clock(table, i)]
    for candidates in (others, numeric) if not wanted else ():
        if len(candidates) == 1:
            return candidates[0]
    matching = [i for i in others if wanted and wanted in {header[i], split_title(header[i])[0]}]
    if not matching and wanted.isdigit() and 1 <= int(wanted) <= len(header):
        matching = [int(wanted) - 1]
    if len(matching) == 1:
        return matching[0]
    names = [header[i] for i in (numeric or others)]
    if not names:
        raise InvalidInputError(
            f"{path}: the header has no column besides the times; expected at least two, such as: time [s],reading"
        )
    near = get_close_matches(wanted, names, 1) if wanted else []
    problem = f"there is no column {wanted!r}" if wanted else "there are several columns of readings"
    hint = f"; did you mean {near[0]}?" if near else ";"
    raise InvalidInputError(
        f"{path}: {problem}{hint} choose one with --topic: {', '.join(names)}",
        value=wanted,
        limit=tuple(names),
        remedy=near[0] if near else "--topic",
    )


def _is_another_clock(table: TextTable, index: int) -> bool:
    """Return True if a column has a unit of time, and only rises: the time of another computer."""
    numbers = table.numbers(index)
    return dimension(split_title(table.header[index])[1]) == TIME and bool(np.all(np.diff(numbers) >= 0))


def _bounds(table: TextTable, index: int) -> tuple[float, float]:
    """Return the smallest and the largest distance [m] in the rows of Range messages."""
    path = table.header[index].removesuffix("range")
    ends = (table.numbers(table.header.index(f"{path}{name}")) for name in ("min_range", "max_range"))
    known = ((column[np.isfinite(column)]) for column in ends)
    low, high = (float(np.median(column)) if len(column) else math.nan for column in known)
    return (low, high) if low < high else UNBOUNDED


def _is_range(table: TextTable, index: int) -> bool:
    """Return True if a column is the range of an exported sensor_msgs/Range, whose limits are columns as well."""
    path, _, field = table.header[index].rpartition("range")
    return not field and {f"{path}min_range", f"{path}max_range"} <= set(table.header)
