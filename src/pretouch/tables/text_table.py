"""Split a text table such as CSV into header and rows."""

from __future__ import annotations

import csv
import hashlib
import os
import re
from array import array
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

from pretouch._core.errors import CalibrationDataError
from pretouch._core.files import read_regular_file

from .column_options import ColumnOptions, columns_hint
from .headers import TextTable, is_length, is_number, is_row, names_a_distance, quoted, uses_commas

Lines: TypeAlias = "list[tuple[int, str]]"
_refusal = CalibrationDataError.without_content

_SEARCHED = 200  # lines in which the header is searched
_COUNTED = 1000  # rows from which the number of columns is determined
_MOST_BYTES = 100_000_000
_MOST_ROWS = 2_000_000
_LONGEST_LINE = 200_000  # characters, enough for ten thousand columns
_BREAK = re.compile(r"\r\n|\n|\r")
_BLANK = " "
_BRACKETED = r"[\[(][^\[\]()]*[\])]"
_HEADER_WORD = re.compile(
    rf'"[^"]*"|[-+]?\d+(?:[.,]\d*)?[ \t]*(?:[unµμmck]?m|in|inch)(?!\S)|no[ -]object|(?:{_BRACKETED}|\S)+', re.IGNORECASE
)
_UP_TO_UNIT = re.compile(rf"[^\[\](){_BLANK}\t][^\[\]()]*{_BRACKETED}|\S.*")
_ROW_WORD = re.compile(r'"[^"]*"|no object|\S+', re.IGNORECASE)
_NO_OBJECT = re.compile("no object", re.IGNORECASE)  # two words, one cell


def read_table(path: str | os.PathLike[str], options: ColumnOptions | None = None) -> TextTable:
    """Read a text table such as a CSV file.

    Supported encodings are UTF-8 with or without BOM, UTF-16 with BOM, and 8-bit Windows text. An error is raised for
    unreadable or too large files, for files without a table, and for rows with another number of cells.

    Returns:
        The table.
    """
    path, options = Path(path), options or ColumnOptions()
    try:
        content = read_regular_file(path, most=_MOST_BYTES, refuse=_refusal)
    except OSError as error:
        raise _refusal(f"{path}: cannot be read ({error.strerror or error})") from None
    text, encoding = _decode(content, path.name)
    digest = hashlib.sha256(content).hexdigest()
    del content  # to save memory with large files
    numbers, texts, remark = _lines(path.name, text)
    if not texts:
        raise _refusal(f"{path.name}: the file has no rows, but a header and at least one row of numbers are needed")
    head = list(zip(numbers[: _SEARCHED + 2], texts, strict=False))
    at, head_lines, notes = _header_at(path.name, head, remark, options)
    first = len(head) - (len(head_lines) - (at + 1))
    delimiter = _delimiter(head_lines[at][1]) if at >= 0 else _any_delimiter(head_lines[0][1])
    rows: list[Any] = texts[first:]  # lines, which `_split` replaces by their cells
    numbers, plain = numbers[first:], '"' not in text
    commas = delimiter != "," and "," in text
    del text, texts
    _split(rows, delimiter, plain=plain)
    header, units = _header_and_units(head_lines[at][1] if at >= 0 else None, rows, delimiter)
    notes_on_units = [f"The units are those of line {numbers[0]}."] if units else []
    rows, numbers = rows[units:], numbers[units:]
    header = _without_empty_end(header, rows)
    _refuse_other_widths(path.name, header, rows, numbers, delimiter)
    columns = tuple(zip(*rows, strict=True)) or ((),) * len(header)
    return TextTable(
        file=path.name,
        sha256=digest,
        encoding=encoding,
        delimiter=delimiter,
        decimal_mark="," if commas and any(uses_commas(column) for column in columns) else ".",
        header_line=head_lines[max(at, 0)][0],
        header=header,
        columns=columns,
        lines=numbers,
        notes=(*notes, *notes_on_units),
    )


def _split(rows: list[Any], delimiter: str, *, plain: bool) -> None:
    """Replace each line of a list by its table cells. Lines of `plain` text have no quotes and are split faster."""
    mark = None if delimiter == _BLANK else delimiter
    for i, line in enumerate(rows):
        if plain and not (mark is None and _NO_OBJECT.search(line)):
            rows[i] = tuple(map(str.strip, line.split(mark)))
        else:
            rows[i] = _cells(line, delimiter)


def _header_and_units(line: str | None, rows: Sequence[tuple[str, ...]], delimiter: str) -> tuple[tuple[str, ...], int]:
    """Split the header line of a table into column headers.

    Without a header, the columns are numbered. The second result is the number of rows with units below the header.

    Returns:
        The headers, and the number of rows with units.
    """
    widths = Counter(len(row) for row in rows[:_COUNTED] if is_row(row))
    width = max(widths, key=lambda cells: (widths[cells], cells)) if widths else None
    header = tuple(f"column {i + 1}" for i in range(width or 1))
    if line is not None:
        header = _header_cells(line, delimiter, width)
    units = [cell.strip("[]()") for cell in rows[0]] if rows else []
    if len(units) != len(header) or not any(map(is_length, units)) or any(map(is_number, units)):
        return header, 0
    return tuple(f"{title} [{unit}]" if unit else title for title, unit in zip(header, units, strict=True)), 1


def _without_empty_end(header: tuple[str, ...], rows: list[Any]) -> tuple[str, ...]:
    """Remove the last columns of a table if they are empty."""
    whole = width = len(header)
    while width > 1 and not header[width - 1] and all(not r[width - 1] for r in rows if width <= len(r) <= whole):
        width -= 1
    for i, row in enumerate(rows) if width < whole else ():
        rows[i] = row[:width] if len(row) <= whole else row
    return header[:width]


def _refuse_other_widths(
    file: str, header: tuple[str, ...], rows: Sequence[tuple[str, ...]], numbers: Sequence[int], delimiter: str
) -> None:
    """Raise an error if a row does not match the header."""
    for number, row in zip(numbers, rows, strict=True):
        if len(row) != len(header):
            place, hint = f"{file}, line {number}", _hint(row, delimiter)
            raise CalibrationDataError(
                f"{place}: this row has {_cells_in_words(row)}, but the header has {_cells_in_words(header)}{hint}",
                problem=f"{place}: this row and the header have different numbers of cells",
            )


def _decode(content: bytes, file: str) -> tuple[str, str]:
    """Decode the bytes of a text file. Also return the name of the encoding."""
    marked = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in content and not marked:
        raise _refusal(f"{file}: the file contains binary data, but a calibration must be a text table such as CSV")
    for encoding in ("utf-16",) if marked else ("utf-8-sig", "cp1252", "latin-1"):
        with suppress(UnicodeDecodeError):
            return content.decode(encoding), encoding
    raise _refusal(f"{file}: the file contains bytes that are not valid UTF-16 text; save the table as UTF-8 text")


def _lines(file: str, text: str) -> tuple[array[int], list[str], Lines]:
    """Return the lines of a text file with line numbers.

    Blank lines and comments are omitted.

    The last comment may be the header.
    """
    numbers = array("q")
    texts: list[str] = []
    remark: Lines = []
    for i, line in enumerate(_BREAK.split(text) if "\r" in text else text.split("\n"), start=1):
        if len(line) > _LONGEST_LINE:
            raise _refusal(
                f"{file}, line {i}: this line has {len(line):,} characters, but at most {_LONGEST_LINE:,} are allowed"
            )
        start = line.strip(" \t\r\n,;")[:1] and line.lstrip()[:1]
        if not start:
            continue
        if start != "#":
            numbers.append(i)
            texts.append(line)
            if len(texts) > _MOST_ROWS:
                raise _refusal(
                    f"{file}: the table has more than {_MOST_ROWS:,} rows, the largest allowed number; average "
                    "readings at the same distance, or keep every tenth row"
                )
        elif not texts:
            remark = [(i, line.lstrip().lstrip("#").strip())]
    return numbers, texts, remark


def _header_at(file: str, lines: Lines, remark: Lines, options: ColumnOptions) -> tuple[int, Lines, tuple[str, ...]]:
    """Find the header line in a calibration file.

    The index is -1 if the file has no header and needs none. Numbers above the header are refused.

    Returns:
        The index of this line, the lines, and notes.

    Raises:
        CalibrationDataError: numbers stand above the header.
    """
    index = _certain_header(lines, options)
    if index is None and _certain_header([*remark, *lines[:1]], options) == 0:
        return 0, [*remark, *lines], (f"The header is the comment in line {remark[0][0]}.",)
    if not index:
        return (*_uncertain_header(file, lines, options), ()) if index is None else (0, lines, ())
    header, delimiter = lines[index], _delimiter(lines[index][1])
    width = len(_cells(lines[index + 1][1], delimiter))
    for i, line in lines[:index]:
        cells = _cells(line, delimiter)
        if len(cells) == width and sum(is_number(cell) for cell in cells) > 1:
            raise CalibrationDataError(
                f"{file}, line {i}: found the numbers {quoted(line)} above the header in line "
                f"{header[0]}. Put # before every line that is not part of the table",
                problem=f"{file}, line {i}: found numbers above the header in line {header[0]}",
            )
    first, last = lines[0], lines[index - 1]
    which, are = (f"Line {first[0]}", "is") if index == 1 else (f"Lines {first[0]} to {last[0]}", "are")
    return index, lines, (f"{which} {are} above the header and {are} not read.",)


def _certain_header(lines: Lines, options: ColumnOptions) -> int | None:
    """Find a header line with known column names.

    The header names a distance or a selected column, and rows with as many cells follow it.

    Returns:
        The index of this line.
    """
    width: int | None = None
    wanted: list[int] = []
    for i in range(min(len(lines), _SEARCHED)):
        delimiter = _delimiter(lines[i][1])
        below = _cells(lines[i + 1][1], delimiter) if i + 1 < len(lines) else ()
        if _is_header(lines[i][1], len(below), options) and is_row(below):
            return i
        row = _cells(lines[i][1], _any_delimiter(lines[i][1]))
        if width is None and is_row(row):
            width = len(row)
            # the line below the header may have no reading: its output is missing, or it has units or a mistake
            wanted = [j for j in range(i) if _is_header(lines[j][1], width, options)]
            wanted = [j for j in wanted if _delimiter(lines[j][1]) == _any_delimiter(lines[i][1])]
    return wanted[-1] if wanted else None


def _is_header(line: str, width: int, options: ColumnOptions) -> bool:
    """Return True if a line is a table header.

    A header has `width` cells, and names a distance or a selected column.
    """
    delimiter = _delimiter(line)
    header = _header_cells(line, delimiter, width)
    if len(header) != width or width < 2:
        return False
    named = options.names_one_of(header) and not is_row(header)
    return named or names_a_distance(header, declared=options.declares_distances, in_words=delimiter == _BLANK)


def _uncertain_header(file: str, lines: Lines, options: ColumnOptions) -> tuple[int, Lines]:
    """Find a table header without known column names. Raise an error if the header is doubtful."""
    data = next((i for i, (_, t) in enumerate(lines[:_SEARCHED]) if is_row(_cells(t, _any_delimiter(t)))), None)
    if data is None:
        return 0, lines
    delimiter = _any_delimiter(lines[data][1])
    cells = [_header_cells(line, delimiter, None) for _, line in lines[:data]] + [_cells(lines[data][1], delimiter)]
    if options.has_a_number:
        named = data > 0 and _delimiter(lines[data - 1][1]) == delimiter and len(cells[data - 1]) == len(cells[data])
        return (data - 1, lines) if named else (-1, lines[data:])
    if data < 2 or (delimiter != _BLANK and len({len(row) for row in cells}) == 1):
        return 0, lines
    raise CalibrationDataError(
        f'{file}, line {lines[0][0]}: found {quoted(lines[0][1])}, but a header such as "distance [mm],output '
        f'[V]" is expected here. The first row of numbers is in line {lines[data][0]}. Put # before every line '
        f"above the header, or name the columns with {columns_hint('distance=1 [mm],output=2')}",
        problem=f"{file}, line {lines[0][0]}: found no header of a calibration",
    )


def _delimiter(line: str) -> str:
    """Find the column delimiter in a header line. Text in brackets and quotes is ignored."""
    bare = re.sub(rf'"[^"]*"|{_BRACKETED}', "", line)
    return next((mark for mark in ("\t", ";", ",") if mark in bare.strip()), _BLANK)


def _any_delimiter(line: str) -> str:
    """Find the column delimiter in a row of numbers. The numbers may have decimal commas."""
    delimiter = _delimiter(line)
    if delimiter != ",":
        return delimiter
    by_comma, by_blank = _cells(line, ","), _cells(line, _BLANK)
    marks = len(by_blank) > 1 and all(map(is_number, by_blank)) and not all(map(is_number, by_comma))
    return _BLANK if marks or not is_row(by_comma) else ","


def _cells(line: str, delimiter: str) -> tuple[str, ...]:
    """Split a table row into cells."""
    if delimiter == _BLANK:
        return tuple(word.strip('"').strip() for word in _ROW_WORD.findall(line))
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line.strip("\r\n")], delimiter=delimiter)))
    except csv.Error:  # a cell of more than a hundred thousand characters
        return tuple(cell.strip() for cell in line.split(delimiter))


def _header_cells(line: str, delimiter: str, expected: int | None) -> tuple[str, ...]:
    """Split a header line into column headers. Units in brackets stay together with their names."""
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


def _cells_in_words(cells: Sequence[str]) -> str:
    """Return the number of table cells as text. Examples are `1 cell` and `3 cells`."""
    return f"{len(cells)} cell{'s' * (len(cells) != 1)}"


def _hint(row: Sequence[str], delimiter: str) -> str:
    """Return a hint about a row of wrong length.

    The hint explains why the row has more or fewer cells than the header.
    """
    if not is_row(row) and sum(is_number(cell) for cell in row) < 2:
        return "; put # before a line that holds no reading"
    if delimiter == ",":
        return "; with decimal commas separate the columns by semicolons"
    return '; if blanks separate the columns, write "nan" for missing values' if delimiter == _BLANK else ""
