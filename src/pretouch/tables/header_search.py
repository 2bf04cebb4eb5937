"""Find the header line of a text table, and split it into column headers."""

from __future__ import annotations

import re
from typing import Final, NamedTuple, TypeAlias

from pretouch._core.errors import CalibrationDataError

from .cells import is_missing, is_number, is_row, quoted
from .column_options import ColumnOptions, columns_hint
from .dialect import BLANK, BRACKETED, cells_of, delimiter_of_header, delimiter_of_row
from .names import distance_mark, is_named, is_unit, names_a_distance

Lines: TypeAlias = "list[tuple[int, str]]"

SEARCHED: Final = 200
"""Number of lines in which the header is searched."""
_HEADER_WORD: Final = re.compile(
    rf'"[^"]*"|[-+]?\d+(?:[.,]\d*)?[ \t]*(?:[unµμmck]?m|in|inch)(?!\S)|no[ -]object|(?:{BRACKETED}|\S+)', re.IGNORECASE
)
_UP_TO_UNIT: Final = re.compile(rf"[^\[\](){BLANK}\t][^\[\]()]*{BRACKETED}|\S.*")


class ExpectedHeader(NamedTuple):
    """What the header of a table is expected to name.

    The header of a calibration names a distance, or a column that the user selected. That of a recording names a time.
    """

    options: ColumnOptions
    is_recording: bool


def header_at(file: str, lines: Lines, remark: Lines, expected: ExpectedHeader) -> tuple[int, Lines, tuple[str, ...]]:
    """Find the header line in a calibration file.

    The index is -1 if the file has no header and needs none. Numbers above the header are refused.

    Returns:
        The index of this line, the lines, and notes.

    Raises:
        CalibrationDataError: numbers stand above the header.
    """
    index = _certain_header(lines, expected)
    if index is None and _certain_header([*remark, *lines[:1]], expected) == 0:
        return 0, [*remark, *lines], (f"The header is the comment in line {remark[0][0]}.",)
    if not index:
        return (*_uncertain_header(file, lines, expected), ()) if index is None else (0, lines, ())
    header, delimiter = lines[index], delimiter_of_header(lines[index][1])
    width = len(cells_of(lines[index + 1][1], delimiter))
    for i, line in lines[:index]:
        cells = cells_of(line, delimiter)
        names_itself = (
            bool(cells) and cells[0][:1].isalpha() and not is_missing(cells[0])
        )  # such as the setting "Samples 100 100"
        if len(cells) == width and sum(is_number(cell) for cell in cells) > 1 and not names_itself:
            raise CalibrationDataError(
                f"{file}, line {i}: found the numbers {quoted(line)} above the header in line "
                f"{header[0]}. Put # before every line that is not part of the table",
                problem=f"{file}, line {i}: found numbers above the header in line {header[0]}",
            )
    first, last = lines[0], lines[index - 1]
    which, are = (f"Line {first[0]}", "is") if index == 1 else (f"Lines {first[0]} to {last[0]}", "are")
    return index, lines, (f"{which} {are} above the header and {are} not read.",)


def _certain_header(lines: Lines, expected: ExpectedHeader) -> int | None:
    """Find a header line with known column names.

    The header names a distance or a selected column, and rows with as many cells follow it.

    Returns:
        The index of this line.
    """
    width: int | None = None
    wanted: list[int] = []
    for i in range(min(len(lines), SEARCHED)):
        delimiter = delimiter_of_header(lines[i][1])
        below = cells_of(lines[i + 1][1], delimiter) if i + 1 < len(lines) else ()
        is_first = i + 1 < len(lines) and _are_alike(lines[i][1], lines[i + 1][1])
        if not is_first and _is_header(lines[i][1], len(below), expected) and is_row(below):
            return i - 1 if i and _has_units_of(lines[i - 1][1], lines[i][1], expected) else i
        row = cells_of(lines[i][1], delimiter_of_row(lines[i][1]))
        if width is None and is_row(row):
            width = len(row)
            # the line below the header may have no reading: its output is missing, or it has units or a mistake
            wanted = [j for j in range(i) if _is_header(lines[j][1], width, expected)]
            wanted = [j for j in wanted if not _are_alike(lines[j][1], lines[i][1])]
            wanted = [j for j in wanted if delimiter_of_header(lines[j][1]) == delimiter_of_row(lines[i][1])]
    return wanted[-1] if wanted else None


def _are_alike(line: str, below: str) -> bool:
    """Return True if two lines have a distance with its unit in the same column, so that neither is a header."""
    cells = (header_cells(each, delimiter_of_header(each), None) for each in (line, below))
    marks = [[distance_mark(cell) for cell in row] for row in cells]
    return len(marks[0]) == len(marks[1]) and any(
        a is not None and b is not None and a.unit is not None and b.unit is not None
        for a, b in zip(*marks, strict=True)
    )


def _has_units_of(header: str, line: str, expected: ExpectedHeader) -> bool:
    """Return True if a line has the units of the header line above it, such as `mm;mV` below `Distance;Voltage`."""
    delimiter = delimiter_of_header(line)
    units = header_cells(line, delimiter, None)
    if not all(is_unit(cell) for cell in units if cell) or delimiter_of_header(header) != delimiter:
        return False
    names = header_cells(header, delimiter, len(units))
    known = any(is_named(name, kind) for name in names for kind in ("distance", "output", "time") if name)
    return len(names) == len(units) and (known or expected.options.names_one_of(names))


def _is_header(line: str, width: int, expected: ExpectedHeader) -> bool:
    """Return True if a line is a table header.

    A header has `width` cells, and names a distance or a selected column.
    """
    delimiter = delimiter_of_header(line)
    header = header_cells(line, delimiter, width)
    header = without_remark(header, width)
    if len(header) != width or width < 2:
        return False
    if expected.is_recording and any(is_named(title, "time") for title in header):
        return not any(is_number(cell) for cell in header)
    named = expected.options.names_one_of(header) and not is_row(header)
    return named or names_a_distance(header, declared=expected.options.declares_distances, in_words=delimiter == BLANK)


def _uncertain_header(file: str, lines: Lines, expected: ExpectedHeader) -> tuple[int, Lines]:
    """Find a table header without known column names. Raise an error if the header is doubtful."""
    data = next((i for i, (_, t) in enumerate(lines[:SEARCHED]) if is_row(cells_of(t, delimiter_of_row(t)))), None)
    if data is None:
        is_number_alone = expected.options.has_a_number and is_number(lines[0][1].strip())
        return (-1 if is_number_alone else 0), lines
    delimiter = delimiter_of_row(lines[data][1])
    cells = [header_cells(line, delimiter, None) for _, line in lines[:data]] + [cells_of(lines[data][1], delimiter)]
    if expected.options.has_a_number:
        named = (
            data > 0
            and delimiter_of_header(lines[data - 1][1]) == delimiter
            and len(cells[data - 1]) == len(cells[data])
        )
        return (data - 1, lines) if named else (-1, lines[data:])
    if data < 2 or (delimiter != BLANK and len({len(row) for row in cells}) == 1):
        return 0, lines
    raise CalibrationDataError(
        f'{file}, line {lines[0][0]}: found {quoted(lines[0][1])}, but a header such as "distance [mm],output '
        f'[V]" is expected here. The first row of numbers is in line {lines[data][0]}. Put # before every line '
        f"above the header, or name the columns with {columns_hint('distance=1 [UNIT],output=2')}",
        problem=f"{file}, line {lines[0][0]}: found no header of a calibration",
    )


def header_cells(line: str, delimiter: str, expected: int | None) -> tuple[str, ...]:
    """Split a header line into column headers. Units in brackets stay together with their names."""
    if delimiter != BLANK:
        return cells_of(line, delimiter)
    words: list[str] = []
    for word in _HEADER_WORD.findall(line):
        if words and word[0] in "[(":
            words[-1] += f" {word}"
        else:
            words.append(word.strip('"'))
    wide_gaps = re.split(r"[ \t]{2,}", line.strip())
    for cells in (words, wide_gaps, _UP_TO_UNIT.findall(line), _phrases(line)):
        if len(cells) == expected:
            return tuple(cell.strip() for cell in cells)
    return tuple(words)


def without_remark(header: tuple[str, ...], width: int | None) -> tuple[str, ...]:
    """Remove the last header, if it announces remarks that no row has."""
    is_longer = width is not None and len(header) == width + 1
    return header[:-1] if is_longer and (not header[-1] or is_named(header[-1], "remark")) else header


def _phrases(line: str) -> list[str]:
    """Split a header such as `distance in cm volts in V` behind the units."""
    cells: list[str] = []
    words = line.split()
    start = 0
    for i in range(1, len(words)):
        if words[i - 1].casefold() == "in" and i - 1 > start:
            cells.append(" ".join(words[start : i + 1]))
            start = i + 1
    return cells + words[start:]
