"""Store the cells of a text table, and read numbers and marks for missing values from them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from pretouch._core.errors import CalibrationDataError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import WORKABLE, has_workable_magnitude

from .date_cells import number_of_date
from .number_forms import UNSIGNED, WITH_COMMA, WITH_POINT
from .unit_words import LENGTH, dimension, unit_in_words

_MISSING = {
    *("", "nan", "na", "n/a", "null", "missing", "-", "--", "---", "?", "ol", "o.l", "overload", "overflow", "timeout"),
    *("error", "err", "#n/a", "#na", "#value!", "#div/0!", "#ref!", "invalid", "fail", "failed"),
}
_NO_OBJECT = {
    *("", "inf", "+inf", "infinity", "+infinity", "∞", "none", "no object", "no-object", "no_object", "empty"),
    *("no target", "no hit", "no echo", "out of range", "oor", "nothing", "free air", "air", "free", "open", "clear"),
    *(
        "kein objekt",
        "ohne objekt",
        "frei",
        "leer",
        "aucun objet",
        "sans objet",
        "sin objeto",
        "nessun oggetto",
        "vide",
    ),
    *("--", "---"),
}
_INFINITE = re.compile(r"\+?(?:inf|infinity|∞)\s*(\D{1,12})", re.IGNORECASE)
_BEYOND = re.compile(r"[>≥]\s*\d[\d.,]*\s*\w*")
_DOTTED = re.compile(WITH_POINT)
_COMMAED = re.compile(WITH_COMMA)
_QUANTITY = re.compile(rf"[-+]?{UNSIGNED}\s*([^\d\s.,].{{0,20}})")
_LONGEST_LINE = 60  # characters of a line that a message shows


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """Text table with a header, columns and rows.

    It stores the line number of each row in the file. `floats` has the numbers of each column, None for a column with
    other cells than numbers with a decimal point. Labels are as they are written, so header and columns are also kept
    without any change. `notes` say how the file was understood, `lost` what is not read.
    """

    file: str
    sha256: str
    encoding: str
    delimiter: str
    decimal_mark: str
    header_line: int
    header: tuple[str, ...]
    columns: tuple[Sequence[str], ...]
    lines: Sequence[int]
    floats: tuple[FloatArray | None, ...]
    written_header: tuple[str, ...]
    written_columns: tuple[Sequence[str], ...]
    notes: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """The file name and line number of the table header.

        Error messages contain this text.
        """
        return f"{self.file}, line {self.header_line}"

    def row(self, index: int) -> tuple[str, ...]:
        """Return all cells of one table row."""
        return tuple(column[index] for column in self.columns)

    def numbers(self, index: int) -> FloatArray:
        """Return the numbers of a column.

        A cell that says "no object" is infinite, and one without a number is NaN.
        """
        floats = self.floats[index]
        return np.array([float_of(cell) for cell in self.columns[index]]) if floats is None else floats

    def title(self, index: int) -> str:
        """Return the header of a column for messages.

        The column number is added if several headers are equal.
        """
        title = self.header[index]
        return quoted(title) if title and self.header.count(title) == 1 else f"{index + 1} ({quoted(title)})"

    def name(self, index: int) -> str:
        """Return the header of a label column.

        If the header is empty, return the column number.
        """
        return self.written_header[index] or f"column {index + 1}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """Column of a calibration table with header and unit.

    The values of the column times `factor` are in this unit.
    """

    index: int
    title: str
    unit: str
    factor: float


def is_number(cell: str) -> bool:
    """Return True if a table cell contains a number.

    The number may have a decimal point or a decimal comma.
    """
    plain = _ascii(cell)
    return bool(_DOTTED.fullmatch(plain) or _COMMAED.fullmatch(plain))


def is_quantity(cell: str, exponents: tuple[int, ...] = ()) -> bool:
    """Return True if a table cell contains a number with its unit, such as `5 mm`.

    With exponents, the unit must have this dimension.
    """
    match = _QUANTITY.fullmatch(cell) if cell[-1:] and not cell[-1:].isdigit() else None
    found = dimension(match[1]) if match else ()
    return bool(found) and exponents in {(), found}


def unit_of(cell: str) -> str | None:
    """Return the unit in a table cell such as `5 mm`, or None."""
    match = _QUANTITY.fullmatch(cell.strip())
    return unit_in_words(match[1]) if match else None


def is_missing(cell: str) -> bool:
    """Return True if a table cell means a missing output.

    Examples are an empty cell, NaN and a dash.
    """
    return cell.casefold() in _MISSING


def is_no_object(cell: str) -> bool:
    """Return True if a distance cell means no object in range.

    Examples are `inf`, `no object` and `> 500`.
    """
    if cell.casefold() in _NO_OBJECT:
        return True
    infinite = _INFINITE.fullmatch(cell) if cell[:1] in "+iI∞" and cell else None
    return bool(infinite and dimension(infinite[1].strip())) or bool(cell[:1] in ">≥" and _BEYOND.fullmatch(cell))


def is_row(cells: Sequence[str]) -> bool:
    """Return True if a line contains a distance and an output."""
    numbers = sum(is_number(cell.partition("±")[0].strip()) for cell in cells)
    quantities = [cell for cell in cells if is_quantity(cell)]
    if len(quantities) < 2 or not all(is_quantity(cell, LENGTH) or is_no_object(cell) for cell in cells):
        numbers += len(quantities)  # otherwise, it is the header of a wide table
    special = [cell for cell in cells if is_missing(cell) or is_no_object(cell)]
    filled = sum(bool(cell) for cell in special)
    return numbers >= 1 and len(cells) >= 2 and (numbers + filled >= 2 or numbers + len(special) == len(cells))


def quoted(text: str) -> str:
    """Quote a text for an error message."""
    return repr(text if len(text) <= _LONGEST_LINE else f"{text[: _LONGEST_LINE - 3]}...")


def join_first(items: Sequence[str], most: int) -> str:
    """Join the first items of a list for an error message.

    Dots replace the other items.

    Returns:
        The text.
    """
    return ", ".join([*items[:most], *(["..."] if len(items) > most else [])])


def number(table: TextTable, line: int, cell: str, column: Column) -> float:
    """Parse the number in a table cell.

    The locale is ignored. Decimal arithmetic makes 42.2 mm the float nearest to 0.0422, which 42.2 * 0.001 is not.
    Numbers that are not finite, or whose products with others could overflow, are refused.

    Returns:
        The number.

    Raises:
        CalibrationDataError: the cell has no such number.
    """
    pattern = _COMMAED if table.decimal_mark == "," else _DOTTED
    plain = _ascii(cell)
    value = math.nan
    if pattern.fullmatch(plain) or _DOTTED.fullmatch(plain):
        value = float(plain.replace(",", "."))
        if math.isfinite(value):
            scaled = value if column.factor == 1.0 else float(Decimal(repr(value)) * Decimal(repr(column.factor)))
            if has_workable_magnitude(scaled):
                return scaled
    place = f"{table.file}, line {line}"
    original = number_of_date(cell)
    if original is not None:
        raise CalibrationDataError(
            f"{place}: found the date {quoted(cell)} in column {table.title(column.index)}. A spreadsheet made it of a "
            f"number, probably of {original}. Write the number instead of each such date, or import the original file "
            "into the spreadsheet again, with this column as text",
            problem=f"{place}: found a date instead of a number",
        )
    if math.isfinite(value):
        unit = f" (unit: {column.unit})" if column.unit else ""
        expected = f"expected a number {WORKABLE}{unit}. Other numbers are too large or too small to fit a curve"
        problem = "a number that is too large or too small for the arithmetic"
    else:
        expected = f"expected a number such as 12{table.decimal_mark}5"
        if column.unit == "m":
            expected += ", or inf if no object was present"
        expected += ". Put # before a line that is no reading"
        problem = "a cell that is not a number"
    raise CalibrationDataError(
        f"{place}: found {quoted(cell)} in column {table.title(column.index)}, {expected}",
        problem=f"{place}: found {problem}",
    )


def float_of(cell: str) -> float:
    """Return the number in a cell; NaN without one, and infinity if it says that there is no object."""
    if is_number(cell):
        return float(_ascii(cell).replace(",", "."))
    return math.inf if cell and is_no_object(cell) else math.nan


def _ascii(cell: str) -> str:
    return cell if cell.isascii() else cell.replace("\N{MINUS SIGN}", "-")
