"""Cells of a text table: what is a number, a missing output or no object, and what one means in its column."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

from pretouch._core.errors import CalibrationDataError
from pretouch._core.magnitudes import WORKABLE, has_workable_magnitude

__all__ = [
    "Column",
    "Layout",
    "TextTable",
    "is_missing",
    "is_no_object",
    "is_number",
    "is_row",
    "listed",
    "number",
    "shortened",
    "uses_commas",
]

_MISSING = {"", "nan", "na", "n/a", "null", "missing", "-", "--"}
_NO_OBJECT = {"", "inf", "+inf", "infinity", "+infinity", "∞", "none", "no object", "no-object", "no_object", "empty"}
_DOTTED = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
_COMMAED = re.compile(r"[-+]?(?:\d+(?:,\d*)?|,\d+)(?:[eE][-+]?\d+)?")
_LONGEST_LINE = 60  # characters of a line that a message shows


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A file as cells: header, rows with their line numbers, and how they were told apart."""

    file: str
    sha256: str
    encoding: str
    delimiter: str
    decimal_mark: str
    header_line: int
    header: tuple[str, ...]
    rows: tuple[tuple[int, tuple[str, ...]], ...]
    notes: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """Where the header stands, for messages."""
        return f"{self.file}, line {self.header_line}"

    def title(self, index: int) -> str:
        """Name a column for messages: its header, and its number where the header does not tell it from others."""
        title = self.header[index]
        return shortened(title) if title and self.header.count(title) == 1 else f"{index + 1} ({shortened(title)})"

    def name(self, index: int) -> str:
        """Name a column of labels: its header, or its number where that is empty."""
        return self.header[index] or f"column {index + 1}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One column: its place, its header as written, and what its unit means."""

    index: int
    title: str
    unit: str
    factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Where the readings of a table stand: one pair of columns in a long table, many in a wide one.

    Beside a column of outputs stands that of their distances, or one distance [m] for all, infinite where no object is.
    `distances` and `outputs` say what is taken as such, `unit` is that of the outputs, `labels` are indices of the
    columns that tell curves apart, where nobody says which, and `notes` what had to be assumed.
    """

    pairs: tuple[tuple[Column | float, Column], ...]
    distances: str
    outputs: str
    unit: str
    labels: tuple[int, ...]
    notes: tuple[str, ...]


def is_number(cell: str) -> bool:
    """Tell whether a cell is a number, with either decimal mark."""
    plain = _ascii(cell)
    return bool(_DOTTED.fullmatch(plain) or _COMMAED.fullmatch(plain))


def is_missing(cell: str) -> bool:
    """Tell whether an output is missing: empty, NaN or a dash."""
    return cell.casefold() in _MISSING


def is_no_object(cell: str) -> bool:
    """Tell whether a distance says that no object was in range: `inf`, empty, `none`, `no object`."""
    return cell.casefold() in _NO_OBJECT


def is_row(cells: Sequence[str]) -> bool:
    """Tell whether cells are a row of readings: at least a distance and an output, one of them a number."""
    numbers = sum(is_number(cell) for cell in cells)
    special = [cell for cell in cells if is_missing(cell) or is_no_object(cell)]
    filled = sum(bool(cell) for cell in special)
    return numbers >= 1 and len(cells) >= 2 and (numbers + filled >= 2 or numbers + len(special) == len(cells))


def uses_commas(cells: Sequence[str]) -> bool:
    """Tell whether numbers are written with decimal commas."""
    return any("," in cell and _COMMAED.fullmatch(cell) for cell in cells)


def shortened(text: str) -> str:
    """Quote a line for a message."""
    return repr(text if len(text) <= _LONGEST_LINE else f"{text[: _LONGEST_LINE - 3]}...")


def listed(items: Sequence[str], most: int) -> str:
    """List the first items for a message."""
    return ", ".join([*items[:most], *(["..."] if len(items) > most else [])])


def number(table: TextTable, line: int, cell: str, column: Column) -> float:
    """Read one cell as a number in the unit of the calibration, in the decimal mark of its file and no locale's."""
    # 42.2 mm is the float nearest to 0.0422, which 42.2 * 0.001 is not. What is no finite number, or one whose products
    # with others are none, is refused.
    pattern = _COMMAED if table.decimal_mark == "," else _DOTTED
    plain = _ascii(cell)
    where = f"{table.file}, line {line}: found {shortened(cell)} in column {table.title(column.index)}"
    if pattern.fullmatch(plain) or _DOTTED.fullmatch(plain):
        value = float(plain.replace(",", "."))
        if math.isfinite(value):
            scaled = float(Decimal(repr(value)) * Decimal(repr(column.factor)))
            if has_workable_magnitude(scaled):
                return scaled
            raise CalibrationDataError(
                f"{where}, expected a number {WORKABLE} (in {column.unit or 'its unit'}): the arithmetic of a fit ends "
                "there"
            )
    raise CalibrationDataError(f"{where}, expected a number such as 12{table.decimal_mark}5")


def _ascii(cell: str) -> str:
    return cell.replace("\N{MINUS SIGN}", "-")
