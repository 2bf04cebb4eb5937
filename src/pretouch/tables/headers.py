"""Interpret the headers and cells of a calibration table.

They contain names, units, numbers and marks for missing values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import NamedTuple

from pretouch._core.errors import CalibrationDataError, UnitError
from pretouch._core.units import WORKABLE, has_workable_magnitude, parse_unit

_MISSING = {"", "nan", "na", "n/a", "null", "missing", "-", "--"}
_NO_OBJECT = {"", "inf", "+inf", "infinity", "+infinity", "∞", "none", "no object", "no-object", "no_object", "empty"}
_DOTTED = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
_COMMAED = re.compile(r"[-+]?(?:\d+(?:,\d*)?|,\d+)(?:[eE][-+]?\d+)?")
_LONGEST_LINE = 60  # characters of a line that a message shows


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """Text table with a header, columns and rows.

    It stores the line number of each row in the file.
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
    notes: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """The file name and line number of the table header.

        Error messages contain this text.
        """
        return f"{self.file}, line {self.header_line}"

    def row(self, index: int) -> tuple[str, ...]:
        """Return all cells of one table row."""
        return tuple(column[index] for column in self.columns)

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
        return self.header[index] or f"column {index + 1}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """Column of a calibration table with header and unit.

    The values of the column times `factor` are in this unit.
    """

    index: int
    title: str
    unit: str
    factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Columns of a calibration table that contain distances, outputs and labels.

    A long table has one pair of columns, a wide table has many.

    A pair has the column of distances, or one distance [m] (infinite without an object), and the column of outputs.
    `distances` and `outputs` describe these columns, and `unit` is that of the outputs. `labels` are the indices of the
    columns that distinguish curves by default; `notes` are assumptions.
    """

    pairs: tuple[tuple[Column | float, Column], ...]
    distances: str
    outputs: str
    unit: str
    labels: tuple[int, ...]
    notes: tuple[str, ...]


def is_number(cell: str) -> bool:
    """Return True if a table cell contains a number.

    The number may have a decimal point or a decimal comma.
    """
    plain = _ascii(cell)
    return bool(_DOTTED.fullmatch(plain) or _COMMAED.fullmatch(plain))


def is_missing(cell: str) -> bool:
    """Return True if a table cell means a missing output.

    Examples are an empty cell, NaN and a dash.
    """
    return cell.casefold() in _MISSING


def is_no_object(cell: str) -> bool:
    """Return True if a distance cell means no object in range.

    Examples are `inf` and `no object`.
    """
    return cell.casefold() in _NO_OBJECT


def is_row(cells: Sequence[str]) -> bool:
    """Return True if a line contains a distance and an output."""
    numbers = sum(is_number(cell) for cell in cells)
    special = [cell for cell in cells if is_missing(cell) or is_no_object(cell)]
    filled = sum(bool(cell) for cell in special)
    return numbers >= 1 and len(cells) >= 2 and (numbers + filled >= 2 or numbers + len(special) == len(cells))


def uses_commas(cells: Sequence[str]) -> bool:
    """Return True if the numbers in table cells have decimal commas."""
    return any("," in cell and _COMMAED.fullmatch(cell) for cell in cells)


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
    if math.isfinite(value):
        unit = f" (unit: {column.unit})" if column.unit else ""
        expected = f"expected a number {WORKABLE}{unit}. Other numbers are too large or too small to fit a curve"
        problem = "a number that is too large or too small for the arithmetic"
    else:
        expected, problem = f"expected a number such as 12{table.decimal_mark}5", "a cell that is not a number"
    raise CalibrationDataError(
        f"{place}: found {quoted(cell)} in column {table.title(column.index)}, {expected}",
        problem=f"{place}: found {problem}",
    )


def _ascii(cell: str) -> str:
    return cell if cell.isascii() else cell.replace("\N{MINUS SIGN}", "-")


_DISTANCES = {"distance", "dist", "range", "l", "x", "d", "z", "gap", "position", "abstand", "entfernung"}
_OUTPUTS = {
    *("output", "out", "voltage", "value", "reading", "readings", "signal", "xi", "y", "counts", "count", "adc"),
    *("intensity", "response", "sensor output", "sensor value", "u", "v", "level", "raw", "proximity", "photocurrent"),
    *("photo current", "adc value", "adc counts"),
}
_SOURCE = r"(?:led|ir led|ir|drive|driving|driver|forward|supply|bias|pulse|emitter|emission|laser|source|tx|transmit)"
_SETTING = re.compile(
    _SOURCE + r" (?:current|voltage|power|level|intensity|frequency)|current|power|frequency|supply|vcc|vdd|bias"
    r"|(?:pga|amplifier|analog|adc|sensor)? ?gain|(?:\w+ )?temperature|temp|humidity|wavelength|duty|duty cycle"
    r"|(?:integration|exposure|measurement|measuring|shutter|conversion|settling) time|integration|exposure"
    r"|(?:sample|sampling|data|frame) rate|pulse (?:width|length|count)|pulses|averages|averaging|led count"
)
_NAMES: dict[str, set[str] | re.Pattern[str]] = {
    "distance": _DISTANCES,
    "output": _OUTPUTS,
    "setting": _SETTING,
    "setting or output": {
        "current",
        "power",
        "frequency",
    },  # counts as a setting if another column is the output, else as the output
    "count": {
        *("", "#", "no", "nr", "n", "i", "index", "idx", "row", "unnamed: 0", "trial", "repeat", "repetition", "rep"),
        *("run", "sample", "measurement", "messung", "record"),
    },
    "repeat": re.compile(r"(?:(?:trial|repeat|repetition|rep|run|measurement|messung|reading|#) ?)?\d{1,6}"),
    "time": {"time", "date", "timestamp", "datetime", "clock", "zeit", "datum"},
}
_TITLE = re.compile(r"\s*(.*?)\s*[\[(]\s*([^\[\]()]*(?:\([^()]*\))?[^\[\]()]*)\s*[\])]\s*")
_LAST_WORD = re.compile(r"(.+?)(?:\s+in\s+|[\s_,]+)(\S+)")
_LONGEST = 200  # characters of a header
_OUTPUT_UNITS: dict[tuple[int, ...], str] = {(0, 0, 0, 1, 0): "V", (0, 0, 0, 0, 1): "counts"}
_DISTANCE_MARK = re.compile(
    r"(?:(?P<name>[^\W\d_]+)[\s=:@_]*)?(?P<number>[-+\N{MINUS SIGN}]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)"
    r"(?:[\s_]*[\[(]?(?P<unit>[^\W\d_]+)[\])]?(?:\.\d+)?)?"  # pandas renames a second column 0cm to 0cm.1
)
_NO_OBJECT_MARK = re.compile(r"[+]?(inf|infinity|∞)\s*[\[(]?[^\W\d_]*[\])]?", re.IGNORECASE)


class DistanceMark(NamedTuple):
    """Distance in a column header, such as `5 mm`.

    The number and the unit are separate. The number is None if the column has readings without an object.
    """

    number: str | None
    unit: str | None


def split_title(title: str) -> tuple[str, str | None]:
    """Split a column header such as `output [V]` into name and unit.

    Other notations are `output (V)` and `output_V`. A form such as `output_V` is split only for usual names.

    Returns:
        Name and unit.
    """
    if len(title) > _LONGEST:
        return title, None
    match = _TITLE.fullmatch(title)
    if match:
        return match.group(1), match.group(2).strip()
    match = _LAST_WORD.fullmatch(title.strip())
    if match:
        name, unit = match.groups()
        plain_name = _plain(name)
        if (plain_name in _DISTANCES and is_length(unit)) or (
            plain_name in _OUTPUTS and _exponents(unit) in _OUTPUT_UNITS
        ):
            return name, unit
    return title.strip(), None


def is_length(unit: str | None) -> bool:
    """Return True if a text is a unit of length."""
    return _exponents(unit) == (1, 0, 0, 0, 0)


def is_named(title: str, kind: str) -> bool:
    """Return True if a column header is a usual name.

    The name must be usual for this kind of column, such as distances or outputs.

    A `setting` is a property of the sensor or its surroundings, such as `gain` or `temperature`. A `setting or output`,
    such as a photocurrent, may be the output if no other column is. A `count` numbers the rows, such as `trial`, `#` or
    an empty header. A `repeat` has the number of a repeat, such as `trial 3`, `run2 [V]` or `3`.
    """
    names, name = _NAMES[kind], _plain(split_title(title)[0])
    return name in names if isinstance(names, set) else bool(names.fullmatch(name))


def output_unit(text: str | None) -> tuple[str, float]:
    """Return the base unit, V or counts, of a sensor output.

    The second result is the conversion factor. Units of other dimensions are returned unchanged.
    """
    try:
        unit = parse_unit(text or "")
    except UnitError:
        return str(text), 1.0
    if unit.exponents in _OUTPUT_UNITS:
        return _OUTPUT_UNITS[unit.exponents], unit.factor
    return text or "", 1.0


def is_output_unit(unit: str | None) -> bool:
    """Return True if a text is a unit of sensor outputs.

    These units are volts and counts.
    """
    return output_unit(unit)[0] in _OUTPUT_UNITS.values()


def distance_mark(title: str) -> DistanceMark | None:
    """Parse a column header such as `5 mm` as a distance.

    Other notations are `d=5mm` and `inf`. The result is None for other headers.

    Returns:
        The distance.
    """
    if title and (is_no_object(title) or _NO_OBJECT_MARK.fullmatch(title[:_LONGEST])):
        return DistanceMark(None, None)
    match = _DISTANCE_MARK.fullmatch(title) if len(title) <= _LONGEST else None
    if match is None:
        return None
    name, unit = match["name"], match["unit"]
    if (unit is not None and not is_length(unit)) or (name and (unit is None or _plain(name) not in _DISTANCES)):
        return None
    return DistanceMark(match["number"].replace("\N{MINUS SIGN}", "-").replace(",", "."), unit)


def looks_wide(header: Sequence[str], *, declared: bool) -> bool:
    """Return True if column headers are distances such as `5 mm`.

    `declared` means that an option gives the unit of the distances. Headers are distances if two of them have units of
    length, or if they are numbers that cannot mean anything else.
    """
    marks = [mark for title in header if (mark := distance_mark(title))]
    if any(mark.unit for mark in marks):
        return len(marks) > 1
    bare = [float(mark.number) for mark in marks if mark.number is not None]
    text = [title for title in header if title and not distance_mark(title)]
    if len(bare) > 1 and any(is_length(split_title(title)[1]) or is_length(title) for title in text):
        return True
    rising, falling = (len(bare) > 2 and bare == sorted(set(bare), reverse=down) for down in (False, True))
    return (rising and (bool(text) or len(bare) < len(marks))) or (declared and (rising or falling))


def names_a_distance(header: Sequence[str], *, declared: bool, in_words: bool = False) -> bool:
    """Return True if a line looks like a table header.

    The header of a calibration table names a distance.

    A header has a cell with a name of a distance or a unit of length, and no cell that is a number. A header whose
    cells are distances (see `looks_wide`) also counts. With `in_words`, the cells are words of a line that may be
    prose: "Sensor X" does not name a distance.
    """
    if looks_wide(header, declared=declared):
        return True
    for title in header:
        name, unit = split_title(title)
        named = is_named(title, "distance") and unit is None and (len(name) > 1 or not in_words)
        if name and (named or is_length(unit)):
            return not any(is_number(cell) for cell in header)
    return False


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]+", " ", name).strip(" .:").casefold()


def _exponents(unit: str | None) -> tuple[int, ...]:
    try:
        return parse_unit(unit).exponents if unit and not is_number(unit) else ()
    except UnitError:
        return ()


def output_column(table: TextTable, index: int, layout: Layout) -> Column:
    """Return the output column of a file with no-object readings.

    Readings in another unit than that of the calibration are an error.

    Raises:
        CalibrationDataError: the unit is another one.
    """
    title = table.header[index]
    header_unit = split_title(title)[1]
    symbol, factor = output_unit(header_unit) if header_unit else (layout.unit, layout.pairs[0][1].factor)
    if symbol != layout.unit:
        raise CalibrationDataError(
            f"{table.place}: found readings in the unit {header_unit!r}, expected readings in the unit of the "
            f"calibration ({layout.unit or 'none'!r})"
        )
    return Column(index=index, title=title, unit=symbol, factor=factor)
