"""Choose one sensor of a table whose rows are from several sensors, such as `time,sensor,value`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch.tables.cells import TextTable, float_of, is_number, join_first, quoted
from pretouch.tables.names import is_named, split_title
from pretouch.tables.number_forms import in_decimal

_CHOICE: Final = re.compile(r"(.*?)\s*\[\s*([^\[\]=]+=[^\[\]]*)\]")
_IDENTITY: Final = re.compile(
    r"(?:.* )?(?:sensor|device|channel|probe|node|module|board|mux|side|kanal|geraet|gerät)"
    r"(?: ?(?:id|name|nr|no|number|index|address|#))?|id|ch|name|label|addr|address|sid|unit|frame id|topic|source"
)
_MOST: Final = 64  # sensors in one table
_FEWEST: Final = 2  # rows of each sensor
_MIXED: Final = 0.5  # share of the rows at which the text changes, above which it names the sensor of each row
_FILLED: Final = 0.9  # share of the rows that have a text
_SHOWN: Final = 6


class SensorChoice(NamedTuple):
    """A column, and the values of other columns in the rows to be read."""

    name: str
    values: tuple[tuple[str, str], ...]


def parse_choice(wanted: str, header: Sequence[str]) -> SensorChoice:
    """Split a text such as `value[sensor=left]` into the column and the rows to be read.

    Args:
        wanted: the text; several conditions are separated by commas.
        header: headers of the table; one of them is a column without conditions.

    Returns:
        The column and the conditions.

    Examples:
        >>> parse_choice("value[sensor=left]", ()).values
        (('sensor', 'left'),)
    """
    match = None if wanted in header else _CHOICE.fullmatch(wanted)
    if match is None:
        return SensorChoice(wanted, ())
    parts = [part.partition("=") for part in match[2].split(",")]
    return SensorChoice(match[1], tuple((name.strip(), value.strip()) for name, _, value in parts))


def is_identity(title: str) -> bool:
    """Return True if a header says which sensor a row is from, such as `sensor_id`.

    Args:
        title: the header.
    """
    name = re.sub(r"[\s_.-]+", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", split_title(title)[0])).strip().casefold()
    return bool(_IDENTITY.fullmatch(name))


def rows_of_one_sensor(path: Path, table: TextTable, choice: SensorChoice) -> tuple[TextTable, tuple[str, ...]]:
    """Return the rows of the chosen sensor, with a remark on the choice.

    Args:
        path: the file.
        table: the table.
        choice: the column and the values of others.

    Returns:
        The table with these rows; all of them if they are from one sensor.

    Raises:
        InvalidInputError: the rows are from several sensors and none is chosen, or there are no such rows.
    """
    remarks: tuple[str, ...] = ()
    for name, value in choice.values:
        index = _column(path, table, name, value)
        cells = table.columns[index]
        kept = [i for i, cell in enumerate(cells) if _is_equal(cell, value)]
        if not kept:
            found = join_first([quoted(cell) for cell in dict.fromkeys(cells)], _SHOWN)
            raise InvalidInputError(
                f"{path}: no row has the value {value!r} in the column {table.title(index)}; it has the values {found}",
                value=value,
                remedy="--topic",
            )
        remarks = (
            *remarks,
            f"Only rows with {table.title(index)} = {quoted(value)} are read: {len(kept):,} of {len(cells):,}.",
        )
        table = _with_rows(table, kept)
    for index, title in enumerate(table.header):
        values = _sensors_in(table, index) if split_title(title)[0] != choice.name else []
        if values:
            name = choice.name or _a_column_of_readings(table, index)
            shown = ", ".join([*(f"{each}={value}" for each, value in choice.values), f"{title}={values[0]}"])
            topic = f"{name}[{shown}]"
            raise InvalidInputError(
                f"{path}: the rows are from several sensors: the column {table.title(index)} has {len(values)} values "
                f"({join_first([quoted(value) for value in values], _SHOWN)}). Choose one, such as: --topic '{topic}'",
                value=choice.name,
                limit=tuple(values),
                remedy=topic,
            )
    return table, remarks


def _sensors_in(table: TextTable, index: int) -> list[str]:
    """Return the sensors that a column names; empty if it names none, or only one."""
    title, cells = table.header[index], table.columns[index]
    if is_named(title, "time") or not _a_column_of_readings(table, index):
        return []
    counts = Counter(cells)
    counts.pop("", None)
    if not 1 < len(counts) <= _MOST or sum(counts.values()) < _FILLED * len(cells):
        return []
    if sum(counts.values()) < _FEWEST * len(counts):
        return []
    numbers = all(is_number(cell) for cell in counts)
    if is_identity(title):
        whole = not numbers or all(float_of(cell).is_integer() for cell in counts)
        return list(counts) if whole else []
    if numbers or any(is_number(cell) for cell in counts):
        return []
    changes = sum(one != other for one, other in pairwise(cells))
    return list(counts) if changes > _MIXED * len(cells) else []


def _a_column_of_readings(table: TextTable, identity: int) -> str:
    """Return the name of a column that may have the readings."""
    kinds = ("time", "count", "setting", "statistic")
    for i, title in enumerate(table.header):
        if i == identity or is_identity(title) or any(is_named(title, kind) for kind in kinds):
            continue
        if np.isfinite(table.numbers(i)).any():
            return split_title(title)[0]
    return ""


def _column(path: Path, table: TextTable, name: str, value: str) -> int:
    """Return the index of the column of a condition."""
    for titles in (list(table.header), [split_title(title)[0] for title in table.header]):
        if name in titles:
            return titles.index(name)
    raise InvalidInputError(
        f"{path}: there is no column {name!r} for [{name}={value}]; the columns are {', '.join(table.header)}",
        value=name,
        limit=table.header,
        remedy="--topic",
    )


def _is_equal(cell: str, value: str) -> bool:
    value = in_decimal(value)  # as in the table
    return cell == value or (is_number(cell) and is_number(value) and float_of(cell) == float_of(value))


def _with_rows(table: TextTable, kept: Sequence[int]) -> TextTable:
    """Return a table with some of its rows."""
    at = np.asarray(kept, dtype=np.int64)
    return replace(
        table,
        columns=tuple([column[i] for i in kept] for column in table.columns),
        lines=[table.lines[i] for i in kept],
        floats=tuple(None if floats is None else floats[at] for floats in table.floats),
    )
