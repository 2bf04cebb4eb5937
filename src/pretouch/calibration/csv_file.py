"""Text tables, whatever program wrote them: encoding, delimiter, decimal mark, header, rows; errors name the line."""

from __future__ import annotations

import csv
import hashlib
import os
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from pretouch._core.errors import CalibrationDataError

from .choice import ColumnChoice, remedy
from .headers import TextTable, is_length, is_number, is_row, names_a_distance, shortened, uses_commas

Lines: TypeAlias = "list[tuple[int, str]]"

_SEARCHED = 200  # lines in which a header is looked for
_BLANK = " "
_BRACKETED = r"[\[(][^\[\]()]*[\])]"
_HEADER_WORD = re.compile(
    rf'"[^"]*"|[-+]?\d+(?:[.,]\d*)?[ \t]*(?:[unµμmck]?m|in|inch)(?!\S)|no[ -]object|(?:{_BRACKETED}|\S)+', re.IGNORECASE
)
_UP_TO_UNIT = re.compile(rf"[^\[\](){_BLANK}\t][^\[\]()]*{_BRACKETED}|\S.*")
_ROW_WORD = re.compile(r'"[^"]*"|no object|\S+', re.IGNORECASE)


def read_table(path: str | os.PathLike[str], choice: ColumnChoice | None = None) -> TextTable:
    """Split a text file into header and rows; what was said about its columns helps to find its header."""
    # It may be UTF-8 with or without BOM, UTF-16 with BOM, or an 8-bit Windows text. A file that cannot be read or
    # holds no table, and a row with another number of cells, are refused.
    path, choice = Path(path), choice or ColumnChoice()
    try:
        content = path.read_bytes()
    except OSError as error:
        raise CalibrationDataError(f"{path}: cannot be read ({error.strerror or error})") from None
    text, encoding = _decode(content, path.name)
    lines, remark = _lines(text)
    if not lines:
        raise CalibrationDataError(f"{path.name}: found no rows, expected a header and at least one row of numbers")
    at, lines, notes = _header_at(path.name, lines, remark, choice)
    delimiter = _delimiter(lines[at][1]) if at >= 0 else _any_delimiter(lines[0][1])
    header, rows, told = _header_and_rows(lines, at, delimiter)
    for i, row in rows:
        if len(row) != len(header):
            raise CalibrationDataError(
                f"{path.name}, line {i}: found {len(row)} cells, expected {len(header)} as in the header"
                f"{_hint(row, delimiter)}"
            )
    return TextTable(
        file=path.name,
        sha256=hashlib.sha256(content).hexdigest(),
        encoding=encoding,
        delimiter=delimiter,
        decimal_mark="," if delimiter != "," and uses_commas([c for _, row in rows for c in row]) else ".",
        header_line=lines[max(at, 0)][0],
        header=header,
        rows=tuple(rows),
        notes=(*notes, *told),
    )


def _header_and_rows(
    lines: Lines, at: int, delimiter: str
) -> tuple[tuple[str, ...], list[tuple[int, tuple[str, ...]]], list[str]]:
    """Split header and rows, without units in a line of their own and an empty last column; tell what was done."""
    rows = [(i, _cells(line, delimiter)) for i, line in lines[at + 1 :]]
    widths = Counter(len(row) for _, row in rows if is_row(row))
    width = max(widths, key=lambda cells: (widths[cells], cells)) if widths else None
    header = tuple(f"column {i + 1}" for i in range(width or 1))
    told = []
    if at >= 0:
        header = _header_cells(lines[at][1], delimiter, width)
    units = [cell.strip("[]()") for cell in rows[0][1]] if rows else []
    if len(units) == len(header) and any(map(is_length, units)) and not any(map(is_number, units)):
        header = tuple(f"{title} [{unit}]" if unit else title for title, unit in zip(header, units, strict=True))
        told.append(f"The units are those of line {rows.pop(0)[0]}.")
    while len(header) > 1 and not header[-1] and all(not row[-1] for _, row in rows if len(row) == len(header)):
        rows = [(i, row[:-1] if len(row) == len(header) else row) for i, row in rows]
        header = header[:-1]
    return header, rows, told


def _decode(content: bytes, file: str) -> tuple[str, str]:
    """Turn bytes into text, by the byte-order mark where there is one."""
    marked = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in content and not marked:
        raise CalibrationDataError(f"{file}: found binary data, expected a text table such as CSV")
    for encoding in ("utf-16",) if marked else ("utf-8-sig", "cp1252", "latin-1"):
        with suppress(UnicodeDecodeError):
            return content.decode(encoding), encoding
    raise CalibrationDataError(f"{file}: found bytes that are no utf-16 text, expected a text table")


def _lines(text: str) -> tuple[Lines, Lines]:
    """Return the lines that are not blank and no remarks, and the last remark before them, which may be a header."""
    lines: Lines = []
    remark: Lines = []
    for i, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        if not line.strip(" \t\r\n,;"):
            continue
        if not line.lstrip().startswith("#"):
            lines.append((i, line))
        elif not lines:
            remark = [(i, line.lstrip().lstrip("#").strip())]
    return lines, remark


def _header_at(file: str, lines: Lines, remark: Lines, choice: ColumnChoice) -> tuple[int, Lines, tuple[str, ...]]:
    """Find the header: its place among the lines, -1 where there is none and none is needed."""
    # The lines follow, and what was left out above it or taken for it. Numbers above the header are refused.
    found = _certain_header(lines, choice)
    if found is None and _certain_header([*remark, *lines[:1]], choice) == 0:
        return 0, [*remark, *lines], (f"The header is that of the remark in line {remark[0][0]}.",)
    if not found:
        return (*_uncertain_header(file, lines, choice), ()) if found is None else (0, lines, ())
    header, delimiter = lines[found], _delimiter(lines[found][1])
    width = len(_cells(lines[found + 1][1], delimiter))
    for i, line in lines[:found]:
        cells = _cells(line, delimiter)
        if len(cells) == width and sum(is_number(cell) for cell in cells) > 1:
            raise CalibrationDataError(
                f"{file}, line {i}: found numbers ({shortened(line)}) above the header in line {header[0]}, expected "
                "them below it: put # before every line that is not to be read"
            )
    first, last = lines[0], lines[found - 1]
    which = f"Line {first[0]} stands" if found == 1 else f"Lines {first[0]} to {last[0]} stand"
    return found, lines, (f"{which} above the header and {'is' if found == 1 else 'are'} not read.",)


def _certain_header(lines: Lines, choice: ColumnChoice) -> int | None:
    """Find the line that names a distance, or what was chosen, and has as many cells as the first row below it."""
    width: int | None = None
    wanted: list[int] = []
    for i in range(min(len(lines), _SEARCHED)):
        delimiter = _delimiter(lines[i][1])
        below = _cells(lines[i + 1][1], delimiter) if i + 1 < len(lines) else ()
        if _is_header(lines[i][1], len(below), choice) and is_row(below):
            return i
        row = _cells(lines[i][1], _any_delimiter(lines[i][1]))
        if width is None and is_row(row):
            width = len(row)
            # what follows the header may be no row: its output is missing, or it holds units, or a mistake
            wanted = [j for j in range(i) if _is_header(lines[j][1], width, choice)]
            wanted = [j for j in wanted if _delimiter(lines[j][1]) == _any_delimiter(lines[i][1])]
    return wanted[-1] if wanted else None


def _is_header(line: str, width: int, choice: ColumnChoice) -> bool:
    """Tell whether a line names a distance, or what was chosen, in so many cells."""
    delimiter = _delimiter(line)
    header = _header_cells(line, delimiter, width)
    if len(header) != width or width < 2:
        return False
    named = choice.names_one_of(header) and not is_row(header)
    return named or names_a_distance(header, declared=choice.declares_distances, in_words=delimiter == _BLANK)


def _uncertain_header(file: str, lines: Lines, choice: ColumnChoice) -> tuple[int, Lines]:
    """Take the first line for the header where nothing speaks against it."""
    data = next((i for i, (_, t) in enumerate(lines[:_SEARCHED]) if is_row(_cells(t, _any_delimiter(t)))), None)
    if data is None:
        return 0, lines
    delimiter = _any_delimiter(lines[data][1])
    cells = [_header_cells(line, delimiter, None) for _, line in lines[:data]] + [_cells(lines[data][1], delimiter)]
    if choice.has_a_number:
        named = data > 0 and _delimiter(lines[data - 1][1]) == delimiter and len(cells[data - 1]) == len(cells[data])
        return (data - 1, lines) if named else (-1, lines[data:])
    if data < 2 or (delimiter != _BLANK and len({len(row) for row in cells}) == 1):
        return 0, lines
    raise CalibrationDataError(
        f"{file}, line {lines[0][0]}: found {shortened(lines[0][1])} where the header is expected, such as "
        f'"distance [mm],output [V]", and the first row of numbers in line {lines[data][0]}: put # before every line '
        f"above the header, and name the distance in it, or say which columns are meant: "
        f"{remedy('distance=1 [mm],output=2')}"
    )


def _delimiter(line: str) -> str:
    """Find what separates the columns, outside brackets and quotes; blanks where nothing else does."""
    bare = re.sub(rf'"[^"]*"|{_BRACKETED}', "", line)
    return next((mark for mark in ("\t", ";", ",") if mark in bare.strip()), _BLANK)


def _any_delimiter(line: str) -> str:
    """Find what separates the columns of a row, in which commas may be decimal marks."""
    found = _delimiter(line)
    if found != ",":
        return found
    by_comma, by_blank = _cells(line, ","), _cells(line, _BLANK)
    marks = len(by_blank) > 1 and all(map(is_number, by_blank)) and not all(map(is_number, by_comma))
    return _BLANK if marks or not is_row(by_comma) else ","


def _cells(line: str, delimiter: str) -> tuple[str, ...]:
    """Split a row."""
    if delimiter == _BLANK:
        return tuple(word.strip('"').strip() for word in _ROW_WORD.findall(line))
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line.strip("\r\n")], delimiter=delimiter)))
    except csv.Error:  # a cell of more than a hundred thousand characters
        return tuple(cell.strip() for cell in line.split(delimiter))


def _header_cells(line: str, delimiter: str, expected: int | None) -> tuple[str, ...]:
    """Split a header; where blanks separate columns, units in brackets and words of one name are kept together."""
    if delimiter != _BLANK:
        return _cells(line, delimiter)
    words: list[str] = []
    for word in _HEADER_WORD.findall(line):
        if words and word[0] in "[(":
            words[-1] += f" {word}"
        else:
            words.append(word.strip('"'))
    wide_gaps = re.split(r"[ \t]{2,}", line.strip())
    for cells in (words, wide_gaps, _UP_TO_UNIT.findall(line)):
        if len(cells) == expected:
            return tuple(cell.strip() for cell in cells)
    return tuple(words)


def _hint(row: Sequence[str], delimiter: str) -> str:
    """Say what a row with another number of cells may be due to."""
    if not is_row(row) and sum(is_number(cell) for cell in row) < 2:
        return "; put # before a line that holds no reading"
    if delimiter == ",":
        return "; with decimal commas separate the columns by semicolons"
    return '; where blanks separate columns, write "nan" for what is missing' if delimiter == _BLANK else ""
