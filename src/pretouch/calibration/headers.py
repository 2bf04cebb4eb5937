"""Interpret the cells and headers of a text table: numbers, missing values, names and units of columns."""

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
    """A file as cells: header, the cells of each column, the line of each row, and how they were told apart."""

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
        """Where the header stands, for messages."""
        return f"{self.file}, line {self.header_line}"

    def row(self, index: int) -> tuple[str, ...]:
        """Return the cells of a row."""
        return tuple(column[index] for column in self.columns)

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
    value = math.nan
    if pattern.fullmatch(plain) or _DOTTED.fullmatch(plain):
        value = float(plain.replace(",", "."))
        if math.isfinite(value):
            scaled = value if column.factor == 1.0 else float(Decimal(repr(value)) * Decimal(repr(column.factor)))
            if has_workable_magnitude(scaled):
                return scaled
    place = f"{table.file}, line {line}"
    if math.isfinite(value):
        expected = f"expected a number {WORKABLE} (in {column.unit or 'its unit'}): the arithmetic of a fit ends there"
        problem = "a number of a magnitude that no arithmetic goes with"
    else:
        expected, problem = f"expected a number such as 12{table.decimal_mark}5", "a cell that is no number"
    raise CalibrationDataError(
        f"{place}: found {shortened(cell)} in column {table.title(column.index)}, {expected}",
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
    rf"{_SOURCE} (?:current|voltage|power|level|intensity|frequency)|current|power|frequency|supply|vcc|vdd|bias"
    r"|(?:pga|amplifier|analog|adc|sensor)? ?gain|(?:\w+ )?temperature|temp|humidity|wavelength|duty|duty cycle"
    r"|(?:integration|exposure|measurement|measuring|shutter|conversion|settling) time|integration|exposure"
    r"|(?:sample|sampling|data|frame) rate|pulse (?:width|length|count)|pulses|averages|averaging|led count"
)
_NAMES: dict[str, set[str] | re.Pattern[str]] = {
    "distance": _DISTANCES,
    "output": _OUTPUTS,
    "setting": _SETTING,
    "setting or output": {"current", "power", "frequency"},  # a setting beside another output, else an output
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
_KNOWN: dict[tuple[int, ...], str] = {(0, 0, 0, 1, 0): "V", (0, 0, 0, 0, 1): "counts"}
_AT = re.compile(
    r"(?:(?P<name>[^\W\d_]+)[\s=:@_]*)?(?P<number>[-+\N{MINUS SIGN}]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)"
    r"(?:[\s_]*[\[(]?(?P<unit>[^\W\d_]+)[\])]?(?:\.\d+)?)?"  # pandas writes 0cm.1 for a second 0cm
)
_AT_INFINITY = re.compile(r"[+]?(inf|infinity|∞)\s*[\[(]?[^\W\d_]*[\])]?", re.IGNORECASE)


class UnitMark(NamedTuple):
    """A header that is a distance: its number as written, None where it says that no object is there, and its unit."""

    number: str | None
    unit: str | None


def split_title(title: str) -> tuple[str, str | None]:
    """Split `output [V]`, `output (V)` and, where the name is known, `output_V` into name and unit."""
    if len(title) > _LONGEST:
        return title, None
    match = _TITLE.fullmatch(title)
    if match:
        return match.group(1), match.group(2).strip()
    match = _LAST_WORD.fullmatch(title.strip())
    if match:
        name, unit = match.groups()
        known = _plain(name)
        if (known in _DISTANCES and is_length(unit)) or (known in _OUTPUTS and _exponents(unit) in _KNOWN):
            return name, unit
    return title.strip(), None


def is_length(unit: str | None) -> bool:
    """Tell whether a unit is one of lengths."""
    return _exponents(unit) == (1, 0, 0, 0, 0)


def is_named(title: str, kind: str) -> bool:
    """Tell whether a header is named as columns of a kind often are."""
    # A `setting` is one of the sensor or its surroundings, such as `gain` or `temperature`; a `setting or output` may
    # be an output where nothing else is, as a photocurrent is a current; a `count` numbers rows, as `trial`, `#` or an
    # empty header do; a `repeat` is the number of one, such as `trial 3`, `run2 [V]` or `3`.
    known, name = _NAMES[kind], _plain(split_title(title)[0])
    return name in known if isinstance(known, set) else bool(known.fullmatch(name))


def output_unit(text: str | None) -> tuple[str, float]:
    """Turn volts and counts with their prefixes into V and counts; leave every other unit as it is written."""
    try:
        unit = parse_unit(text or "")
    except UnitError:
        return str(text), 1.0
    if unit.exponents in _KNOWN:
        return _KNOWN[unit.exponents], unit.factor
    return text or "", 1.0


def is_output_unit(unit: str | None) -> bool:
    """Tell whether a unit is one of volts or counts."""
    return output_unit(unit)[0] in _KNOWN.values()


def distance_mark(title: str) -> UnitMark | None:
    """Read a header such as `5 mm`, `d=5mm`, `0.5` or `inf` as a distance; None where it is none."""
    if title and (is_no_object(title) or _AT_INFINITY.fullmatch(title[:_LONGEST])):
        return UnitMark(None, None)
    match = _AT.fullmatch(title) if len(title) <= _LONGEST else None
    if match is None:
        return None
    name, unit = match["name"], match["unit"]
    if (unit is not None and not is_length(unit)) or (name and (unit is None or _plain(name) not in _DISTANCES)):
        return None
    return UnitMark(match["number"].replace("\N{MINUS SIGN}", "-").replace(",", "."), unit)


def looks_wide(header: Sequence[str], *, declared: bool) -> bool:
    """Tell whether columns are named by distance, whose unit is `declared` where somebody said it."""
    # They are where there are two distances with units, or bare numbers that can be nothing else.
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
    """Tell whether a line is the header of a calibration, by its words alone."""
    # It is where a cell names a distance or has a unit of lengths and none is a number, or columns are named by
    # distance, whose unit is `declared` where somebody said it. Where cells are the words of a line, `in_words`, they
    # may be prose: "Sensor X" names no distance.
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
    """Read the unit of a column of outputs: that of the calibration, and no other, also where its header has none."""
    title = table.header[index]
    found = split_title(title)[1]
    symbol, factor = output_unit(found) if found else (layout.unit, layout.pairs[0][1].factor)
    if symbol != layout.unit:
        raise CalibrationDataError(
            f"{table.place}: found the unit {found!r}, expected {layout.unit or 'none'!r} as in the calibration"
        )
    return Column(index=index, title=title, unit=symbol, factor=factor)
