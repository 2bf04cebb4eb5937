"""Text tables, whatever program wrote them: delimiter, decimal mark, header, rows; every error names its line."""

from __future__ import annotations

import csv
import hashlib
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

from pretouch._core.errors import CalibrationDataError, UnitError
from pretouch._core.magnitudes import WORKABLE, has_workable_magnitude
from pretouch._core.units import parse_unit

__all__ = [
    "Column",
    "TextTable",
    "assign_columns",
    "is_missing",
    "is_no_object",
    "number",
    "output_column",
    "read_table",
]

_DISTANCE_NAMES = {"distance", "dist", "range", "l", "x", "d", "z", "gap", "position", "l_m", "abstand", "entfernung"}
_OUTPUT_NAMES = {
    *("output", "out", "voltage", "value", "reading", "readings", "signal", "xi", "y", "counts", "count", "adc"),
    *("intensity", "response", "sensor output", "sensor_output", "sensor value", "u", "v", "current", "level", "raw"),
}
_MISSING = {"", "nan", "na", "n/a", "null", "missing", "-", "--"}
_NO_OBJECT = {"", "inf", "+inf", "infinity", "+infinity", "∞", "none", "no object", "no-object", "no_object", "empty"}
_HEADER = re.compile(r"\s*(.*?)\s*[\[(]\s*([^\[\]()]*(?:\([^()]*\))?[^\[\]()]*)\s*[\])]\s*")
_DOTTED = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_COMMAED = re.compile(r"[-+]?(?:\d+,?\d*|,\d+)(?:[eE][-+]?\d+)?")
_HOW = 'write it into the header, such as "distance [mm]"'


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One column: its place, its header as written, and what its unit means."""

    index: int
    title: str
    unit: str
    factor: float


def read_table(path: str | os.PathLike[str]) -> TextTable:
    """Split a text file into header and rows.

    Args:
        path: the file; UTF-8 with or without BOM, UTF-16 with BOM, or an 8-bit Windows text.

    Returns:
        Its cells.

    Raises:
        CalibrationDataError: the file cannot be read, holds no table, or a row has another number of cells.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise CalibrationDataError(f"{path}: cannot be read ({error.strerror or error})") from None
    text, encoding = _decode(content, path.name)
    lines = [
        (i, line.strip("\r\n"))
        for i, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1)
        if line.strip(" \t\r\n,;") and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise CalibrationDataError(f"{path.name}: found no rows, expected a header and at least one row of numbers")
    delimiter = _delimiter(lines[0][1])
    cells = [(i, tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter)))) for i, line in lines]
    header_line, header = cells[0]
    while len(header) > 1 and not header[-1] and all(not row[-1] for _, row in cells if len(row) == len(header)):
        cells = [(i, row[:-1] if len(row) == len(header) else row) for i, row in cells]
        header = cells[0][1]
    for i, row in cells[1:]:
        if len(row) != len(header):
            hint = "; with decimal commas separate the columns by semicolons" if delimiter == "," else ""
            raise CalibrationDataError(
                f"{path.name}, line {i}: found {len(row)} cells, expected {len(header)} as in the header{hint}"
            )
    return TextTable(
        file=path.name,
        sha256=hashlib.sha256(content).hexdigest(),
        encoding=encoding,
        delimiter=delimiter,
        decimal_mark="," if delimiter != "," and _uses_commas(cells[1:]) else ".",
        header_line=header_line,
        header=header,
        rows=tuple(cells[1:]),
    )


def _decode(content: bytes, file: str) -> tuple[str, str]:
    """Turn bytes into text, by the byte-order mark where there is one."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        candidates = ["utf-16"]
    elif b"\0" in content:
        raise CalibrationDataError(f"{file}: found binary data, expected a text table such as CSV")
    else:
        candidates = ["utf-8-sig", "cp1252", "latin-1"]
    for encoding in candidates:
        try:
            return content.decode(encoding), encoding
        except UnicodeDecodeError:
            continue
    raise CalibrationDataError(f"{file}: found bytes that are no {candidates[0]} text, expected a text table")


def _delimiter(header: str) -> str:
    """Find what separates the columns: the header decides, outside brackets and quotes."""
    bare = re.sub(r'"[^"]*"|\[[^\]]*\]|\([^)]*\)', "", header)
    return next((mark for mark in ("\t", ";", ",") if mark in bare), ",")


def _uses_commas(rows: list[tuple[int, tuple[str, ...]]]) -> bool:
    """Tell whether the numbers are written with decimal commas."""
    cells = [cell for _, row in rows for cell in row]
    return any("," in cell and _COMMAED.fullmatch(cell) for cell in cells)


def number(table: TextTable, line: int, cell: str, column: Column) -> float:
    """Read one cell as a number, in the decimal mark of its file and no locale's.

    Args:
        table: the file.
        line: number of the line.
        cell: the text.
        column: the column, whose unit is applied.

    Returns:
        The number in the unit of the calibration; 42.2 mm is the float nearest to 0.0422, which 42.2 * 0.001 is not.

    Raises:
        CalibrationDataError: the text is no finite number, or one whose products with others are none.
    """
    pattern = _COMMAED if table.decimal_mark == "," else _DOTTED
    plain = cell.replace("\N{MINUS SIGN}", "-")
    if pattern.fullmatch(plain) or _DOTTED.fullmatch(plain):
        value = float(plain.replace(",", "."))
        if math.isfinite(value):
            scaled = float(Decimal(repr(value)) * Decimal(repr(column.factor)))
            if has_workable_magnitude(scaled):
                return scaled
            raise CalibrationDataError(
                f"{table.file}, line {line}: found {cell!r} in column {column.title!r}, expected a number {WORKABLE} "
                f"(in {column.unit or 'its unit'}): the arithmetic of a fit ends there"
            )
    raise CalibrationDataError(
        f"{table.file}, line {line}: found {cell!r} in column {column.title!r}, expected a number such as 12"
        f"{table.decimal_mark}5"
    )


def is_missing(cell: str) -> bool:
    """Tell whether an output is missing: empty, NaN or a dash."""
    return cell.casefold() in _MISSING


def is_no_object(cell: str) -> bool:
    """Tell whether a distance says that no object was in range: `inf`, empty, `none`, `no object`."""
    return cell.casefold() in _NO_OBJECT


def assign_columns(table: TextTable, columns: Mapping[str, str] | None) -> tuple[Column, Column, tuple[str, ...]]:
    """Decide which column is the distance and which the output.

    Args:
        table: the file.
        columns: the headers of `distance` and `output` where names or units do not tell; None to decide by these.

    Returns:
        The two columns, and what had to be assumed.

    Raises:
        CalibrationDataError: there is no header, or it leaves open which column is which, or a unit is missing.
    """
    place = f"{table.file}, line {table.header_line}"
    if all(_DOTTED.fullmatch(cell) or _COMMAED.fullmatch(cell) for cell in table.header):
        raise CalibrationDataError(
            f'{place}: found numbers where the header is expected, such as "distance [mm],output [V]"'
        )
    if len(table.header) < 2:
        raise CalibrationDataError(
            f"{place}: found one column ({table.header[0]!r}), expected two or more, separated by comma, "
            "semicolon or tab"
        )
    titles = [_split(title) for title in table.header]
    given = dict(columns or {})
    unknown = set(given) - {"distance", "output"}
    if unknown:
        raise CalibrationDataError(f"columns: found {min(unknown)!r}, expected only 'distance' and 'output'")
    names = [name.casefold() for name, _ in titles]
    distance = _pick(table, given.get("distance"), "distance", [n in _DISTANCE_NAMES for n in names], place)
    if distance is None:
        lengths = [_exponents(unit) == (1, 0, 0, 0, 0) for _, unit in titles]
        distance = _pick(table, None, "distance", lengths, place)
    output = _pick(table, given.get("output"), "output", [n in _OUTPUT_NAMES for n in names], place)
    distance, output = _complete(distance, output, len(titles))
    if distance is None or output is None or distance == output:
        found = ", ".join(repr(t) for t in table.header)
        raise CalibrationDataError(
            f"{place}: found the columns {found}, expected one named distance and one named output; or say which they "
            'are: columns={"distance": ..., "output": ...}'
        )
    return _typed(table, distance, output, titles, place)


def _complete(distance: int | None, output: int | None, count: int) -> tuple[int | None, int | None]:
    """Of two columns with one known, the other is the other; with none known, distance comes first."""
    if count == 2:
        if distance is None:
            distance = 0 if output is None else 1 - output
        if output is None:
            output = 1 - distance
    return distance, output


def output_column(table: TextTable, index: int, default: Column) -> Column:
    """Read the unit of a column of outputs; that of `default` where its header has none.

    Args:
        table: the file.
        index: of the column.
        default: the column whose unit it must have.

    Returns:
        The column.

    Raises:
        CalibrationDataError: the unit is another one.
    """
    title = table.header[index]
    found = _split(title)[1]
    symbol, factor = _output_unit(found) if found else (default.unit, default.factor)
    if symbol != default.unit:
        raise CalibrationDataError(
            f"{table.file}, line {table.header_line}: found the unit {found!r}, expected {default.unit or 'none'!r} as "
            "in the calibration"
        )
    return Column(index=index, title=title, unit=symbol, factor=factor)


def _split(title: str) -> tuple[str, str | None]:
    match = _HEADER.fullmatch(title)
    return (match.group(1), match.group(2).strip()) if match else (title.strip(), None)


def _exponents(unit: str | None) -> tuple[int, ...]:
    try:
        return parse_unit(unit).exponents if unit else ()
    except UnitError:
        return ()


def _pick(table: TextTable, given: str | None, what: str, fits: list[bool], place: str) -> int | None:
    """Return the index of the one column that fits; None where none does."""
    if given is not None:
        fits = [given in {title, _split(title)[0]} for title in table.header]
        if not any(fits):
            found = ", ".join(repr(t) for t in table.header)
            raise CalibrationDataError(f"columns: found {given!r} for {what}, expected one of {found}")
    found_at = [i for i, fit in enumerate(fits) if fit]
    if len(found_at) > 1:
        first, second = (table.header[i] for i in found_at[:2])
        raise CalibrationDataError(
            f"{place}: found two columns that may be the {what} ({first!r}, {second!r}), expected one: say which with "
            f'columns={{"{what}": {first!r}}}'
        )
    return found_at[0] if found_at else None


def _typed(
    table: TextTable, distance: int, output: int, titles: list[tuple[str, str | None]], place: str
) -> tuple[Column, Column, tuple[str, ...]]:
    """Read the units of the two columns."""
    unit = titles[distance][1]
    if not unit:
        raise CalibrationDataError(f"{place}: found {table.header[distance]!r}, a distance without a unit: {_HOW}")
    if _exponents(unit) != (1, 0, 0, 0, 0):
        raise CalibrationDataError(f"{place}: found the unit {unit!r}, expected a length such as mm: {_HOW}")
    length = parse_unit(unit)
    notes: tuple[str, ...] = ()
    found = titles[output][1]
    symbol, factor = _output_unit(found)
    if found is None:
        symbol = "counts" if _integers(table, output) else ""
        taken = "counts, for all of them are integers" if symbol else "numbers without a unit"
        notes = (f"The output column {table.header[output]!r} has no unit; its values are taken as {taken}.",)
    return (
        Column(index=distance, title=table.header[distance], unit="m", factor=length.factor),
        Column(index=output, title=table.header[output], unit=symbol, factor=factor),
        notes,
    )


def _output_unit(text: str | None) -> tuple[str, float]:
    """Turn volts and counts with their prefixes into V and counts; leave every other unit as it is written."""
    try:
        unit = parse_unit(text or "")
    except UnitError:
        return str(text), 1.0
    known: dict[tuple[int, ...], str] = {(0, 0, 0, 1, 0): "V", (0, 0, 0, 0, 1): "counts"}
    if unit.exponents in known:
        return known[unit.exponents], unit.factor
    return text or "", 1.0


def _integers(table: TextTable, index: int) -> bool:
    cells = [row[index] for _, row in table.rows if not is_missing(row[index])]
    return bool(cells) and all(re.fullmatch(r"\+?\d+", cell) for cell in cells)
