"""Split a text table such as CSV into header and rows."""

from __future__ import annotations

import hashlib
import os
import re
from array import array
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

from pretouch._core.errors import CalibrationDataError
from pretouch._core.files import read_regular_file

from .cell_forms import plain_columns
from .cells import TextTable, is_missing, is_no_object, is_number, is_row, quoted
from .column_options import ColumnOptions
from .dialect import BLANK, cells_of, delimiter_of_header, delimiter_of_row
from .distance_blocks import of_blocks, title_cells
from .documents import export_for, text_of_document
from .formed_lines import FormedLines
from .header_search import SEARCHED, ExpectedHeader, Lines, header_at, header_cells, without_remark
from .labeled_records import of_labels
from .labels import labeled_cells
from .line_forms import form_lines
from .names import is_length, is_named, is_unit

_refusal = CalibrationDataError.without_content

_SHOWN = 4  # cells that a message shows
_COUNTED = 1000  # rows from which the number of columns is determined
_MOST_BYTES = 100_000_000
_MOST_ROWS = 2_000_000
_LONGEST_LINE = 200_000  # characters, enough for ten thousand columns
_EMPTY = " \t\r\n,;"  # characters of a line without content
_BREAK = re.compile(r"\r\n|\n|\r")
_UNIT_TITLES = frozenset({"unit", "units", "einheit", "unité", "unidad", "unità", "eenheid", "единица", "单位", "単位"})
_FEWEST_TITLES = 2  # comments with a distance, from which on they belong to the readings below them
_START = 400  # characters in which a file says that it is a page
_PAGES = ("<!doctype", "<html", "<?xml", "<table", "<head", "<body", "<div", "<svg")
_FULL_WIDTH = {0xFF01 + i: 0x21 + i for i in range(94)} | {0x3000: 0x20, 0x3001: 0x2C}
"""The signs of East Asian keyboards, such as a wide comma, and those that they stand for."""
_HAS_FULL_WIDTH = re.compile("[\uff01-\uff5e\u3000\u3001]")
_NO_OBJECT = re.compile("no object", re.IGNORECASE)  # two words, one cell


def read_table(
    path: str | os.PathLike[str], options: ColumnOptions | None = None, *, is_recording: bool = False
) -> TextTable:
    """Read a table: text such as CSV, or a document such as a spreadsheet.

    Supported encodings are UTF-8 with or without BOM, UTF-16 with BOM, and 8-bit Windows text. An error is raised for
    unreadable or too large files, and for files without a table. Rows with another number of cells are an error in a
    calibration. In a recording, they are left out with a note, and the header names a time instead of a distance.

    Returns:
        The table.
    """
    path, options = Path(path), options or ColumnOptions()
    try:
        content = read_regular_file(path, most=_MOST_BYTES, refuse=_refusal)
    except OSError as error:
        raise _refusal(f"{path}: cannot be read ({error.strerror or error})") from None
    document = text_of_document(path.name, content)
    text, encoding = _decode(content, path.name) if document is None else (document, path.suffix.lower()[1:])
    digest = hashlib.sha256(content).hexdigest()
    del content  # to save memory with large files
    _refuse_no_table(path.name, text)
    text = text.translate(_FULL_WIDTH) if not text.isascii() and _HAS_FULL_WIDTH.search(text) else text
    numbers: Sequence[int]
    numbers, texts, remark = _lines(path.name, text)
    if not texts:
        raise _refusal(
            f"{path.name}: the file has no rows, only comments or separators, but a header and at least one row of "
            "numbers are needed; remove # from the lines of the table, or export it again"
        )
    numbers, texts, notes_on_lines, lost = _blocks_below_comments(path.name, text, texts) or form_lines(
        path.name, numbers, texts
    )
    head = list(zip(numbers[: SEARCHED + 2], texts, strict=False))
    at, head_lines, notes = header_at(path.name, head, remark, ExpectedHeader(options, is_recording))
    first = len(head) - (len(head_lines) - (at + 1))
    delimiter = delimiter_of_header(head_lines[at][1]) if at >= 0 else delimiter_of_row(head_lines[0][1])
    rows: list[Any] = texts[first:]  # lines, which `_split` replaces by their cells
    numbers, unquoted = numbers[first:], '"' not in text
    tight = not (" " in text or "\f" in text or ("\t" in text and delimiter != "\t"))
    del text, texts
    _split(rows, delimiter, plain=unquoted, tight=tight)
    header, units = _header_and_units(head_lines[at][1] if at >= 0 else None, rows, delimiter)
    notes_on_units = [f"The units are those of line {numbers[0]}."] if units else []
    rows, numbers = rows[units:], numbers[units:]
    if is_recording:
        rows, numbers, lost = _whole_rows(header, rows, numbers, lost)
    header = _without_empty_columns(_without_empty_end(header, rows), rows)
    if not is_recording:
        title = head_lines[at - 1][1] if at > 0 else ""
        header, rows, numbers = _with_titles(title, header, rows, numbers) or (header, rows, numbers)
        _refuse_second_table(path.name, header, rows, numbers)
    _refuse_other_widths(path.name, header, rows, numbers, delimiter)
    # one by one: `zip(*rows)` makes an iterator for each row, which takes ten times as long
    columns: tuple[Sequence[str], ...] = tuple(tuple([row[i] for row in rows]) for i in range(len(header)))
    header, columns = _with_units_of_column(header, columns)
    plain = plain_columns(path.name, header, columns, numbers, delimiter)
    if all(floats is None for floats in plain.floats):  # otherwise, no row has only words
        _refuse_other_table(path.name, header, rows, numbers)
    return TextTable(
        file=path.name,
        sha256=digest,
        encoding=encoding,
        delimiter=delimiter,
        decimal_mark=plain.decimal_mark,
        header_line=head_lines[max(at, 0)][0],
        header=plain.header,
        columns=plain.columns,
        lines=numbers,
        floats=plain.floats,
        written_header=header,
        written_columns=columns,
        notes=(*notes_on_lines, *notes, *notes_on_units, *plain.notes),
        lost=lost,
    )


def _refuse_no_table(file: str, text: str) -> None:
    """Raise an error if a text is empty, or a page of HTML or XML."""
    start = text[:_START].lstrip().lower()
    if not start and not text.strip():
        raise _refusal(
            f"{file}: the file is empty, but a header and at least one row of numbers are needed; if a program writes "
            "it, close that program first, or export the table again"
        )
    if start.startswith(_PAGES):
        raise _refusal(
            f"{file}: this file is a page of HTML or XML with the name of a table. If a browser shows the table in it, "
            "copy the table into a spreadsheet, and save it as CSV; if it shows a login or an error, download the "
            "table again"
        )


def _blocks_below_comments(file: str, text: str, texts: list[str]) -> FormedLines | None:
    """Return the rows of a file whose lines are readings, below comments that say the distance, or None."""
    if "#" not in text or not all(is_number(line.strip()) or _is_labeled(line) for line in texts[:SEARCHED]):
        return None
    lines = [(i, line.strip().lstrip("#").strip()) for i, line in enumerate(_BREAK.split(text), start=1)]
    lines = [(i, line) for i, line in lines if line]
    if not any(map(is_number, texts)):
        readings, titles = set(texts), [i for i, line in lines if title_cells(line)]
        if len(titles) < _FEWEST_TITLES:
            return None
        lines = [(i, line) for i, line in lines if line in readings or i in titles]
        return of_labels(file, [i for i, _ in lines], [line for _, line in lines])
    return of_blocks(file, [i for i, _ in lines], [line for _, line in lines])


def _is_labeled(line: str) -> bool:
    """Return True if a line has readings with labels, but no distance."""
    cells = labeled_cells(line)
    return cells is not None and not any(is_named(label, "distance") for label in cells)


def _split(rows: list[Any], delimiter: str, *, plain: bool, tight: bool) -> None:
    """Replace each line of a list by its table cells.

    Lines of `plain` text have no quotes, and those of `tight` text no blanks next to the cells; they are split faster.
    """
    mark = None if delimiter == BLANK else delimiter
    if plain and tight and mark is not None:
        rows[:] = [tuple(line.split(mark)) for line in rows]  # unlike lists, tuples of texts cost no garbage collection
        return
    for i, line in enumerate(rows):
        if plain and not (mark is None and _NO_OBJECT.search(line)):
            rows[i] = tuple(map(str.strip, line.split(mark)))
        else:
            rows[i] = cells_of(line, delimiter)


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
        header = without_remark(header_cells(line, delimiter, width), width)
        is_indented = delimiter == BLANK and line[:1].isspace()
        if is_indented and width == len(header) + 1 and _are_counted(rows):
            header = ("", *header)
    units = [cell.strip("[]() ") for cell in rows[0]] if rows else []
    if len(units) != len(header) or any(map(is_number, units)):
        return header, 0
    if not any(map(is_length, units)) and not (any(units) and all(is_unit(unit) for unit in units if unit)):
        return header, 0
    return tuple(f"{title} [{unit}]" if unit else title for title, unit in zip(header, units, strict=True)), 1


def _with_units_of_column(
    header: tuple[str, ...], columns: tuple[Sequence[str], ...]
) -> tuple[tuple[str, ...], tuple[Sequence[str], ...]]:
    """Write the units of a column such as `unit` behind the numbers of the column before it, and remove it."""
    for i in range(1, len(header)):
        units, numbers = columns[i], columns[i - 1]
        if header[i].strip().casefold() not in _UNIT_TITLES or not all(map(is_unit, set(units) - {""})):
            continue
        if (
            any(units)
            and all(is_number(cell) or not cell for cell in numbers[:_COUNTED])
            and not any(is_length(unit) for unit in set(units))
        ):
            cells = [f"{number} {unit}".strip() if number else "" for number, unit in zip(numbers, units, strict=True)]
            return (*header[:i], *header[i + 1 :]), (*columns[: i - 1], cells, *columns[i + 1 :])
    return header, columns


def _are_counted(rows: Sequence[tuple[str, ...]]) -> bool:
    """Return True if the first cells number the rows, as in a printed data frame."""
    first = [row[0] for row in rows[:_COUNTED] if row]
    if len(first) < 2 or not all(cell.isdecimal() for cell in first):
        return False
    return all(int(b) == int(a) + 1 for a, b in pairwise(first)) and int(first[0]) <= 1


def _without_empty_end(header: tuple[str, ...], rows: list[Any]) -> tuple[str, ...]:
    """Remove the last columns of a table if they are empty."""
    whole = width = len(header)
    while width > 1 and not header[width - 1] and all(not r[width - 1] for r in rows if width <= len(r) <= whole):
        width -= 1
    for i, row in enumerate(rows) if width < whole else ():
        rows[i] = row[:width] if len(row) <= whole else row
    return header[:width]


def _without_empty_columns(header: tuple[str, ...], rows: list[Any]) -> tuple[str, ...]:
    """Remove the columns of a table without a header and without any cell, as between two blocks of a spreadsheet."""
    empty = {i for i, title in enumerate(header) if not title} if rows else set()
    if empty and not set(map(len, rows)) <= {len(header)}:
        return header
    empty = {i for i in empty if not any(row[i] for row in rows)}
    if not empty:
        return header
    for k, row in enumerate(rows):
        rows[k] = tuple(cell for i, cell in enumerate(row) if i not in empty)
    return tuple(title for i, title in enumerate(header) if i not in empty)


def _whole_rows(
    header: tuple[str, ...], rows: list[Any], numbers: Sequence[int], lost: tuple[str, ...]
) -> tuple[list[Any], Sequence[int], tuple[str, ...]]:
    """Leave out the rows of a recording that have another number of cells than the header, and note their number."""
    if set(map(len, rows)) <= {len(header)}:
        return rows, numbers, lost
    short = [i for i, row in zip(numbers, rows, strict=True) if len(row) != len(header)]
    kept = [(i, row) for i, row in zip(numbers, rows, strict=True) if len(row) == len(header)]
    note = f"Left out rows with another number of cells than the header: {len(short):,}. The first is line {short[0]}."
    return (
        [row for _, row in kept],
        [i for i, _ in kept],
        (*lost, note),
    )


def _with_titles(
    title: str, header: tuple[str, ...], rows: Sequence[Any], numbers: Sequence[int]
) -> tuple[tuple[str, ...], list[Any], list[int]] | None:
    """Join tables with equal headers and a title each: the title becomes a label of the rows.

    Args:
        title: the line above the first header.
        header: the header.
        rows: the rows, with the other headers and titles.
        numbers: the numbers of their lines.

    Returns:
        Header, rows and line numbers; None if the header does not occur again, or has no title of its own.
    """
    titles, labeled, kept = [title.strip(" \t,;:#=-") or "first"], list[Any](), list[int]()
    for i, (number, row) in enumerate(zip(numbers, rows, strict=True)):
        if i + 1 < len(rows) and tuple(rows[i + 1]) == header:
            filled = [cell for cell in row if cell]
            if len(filled) != 1 or is_number(filled[0]):
                return None
            titles.append(filled[0].strip(" :#=-"))
        elif tuple(row) != header:
            labeled.append((*row, titles[-1]))
            kept.append(number)
    return ((*header, "table"), labeled, kept) if len(set(titles)) == len(titles) > 1 else None


def _refuse_second_table(file: str, header: tuple[str, ...], rows: Sequence[Any], numbers: Sequence[int]) -> None:
    """Raise an error if the header occurs again, because then another table follows."""
    wanted = [title.partition(" [")[0] for title in header]
    for number, row in zip(numbers, rows, strict=True):
        if len(row) == len(header) and not is_number(row[0]) and [cell.partition(" [")[0] for cell in row] == wanted:
            raise CalibrationDataError(
                f"{file}, line {number}: the header occurs again. If another table follows, save each table as a "
                "file of its own; if it continues the table, remove this line",
                problem=f"{file}, line {number}: the header occurs again",
            )


def _refuse_other_table(file: str, header: tuple[str, ...], rows: Sequence[Any], numbers: Sequence[int]) -> None:
    """Raise an error if the header of another table stands between the rows, with rows of numbers below it."""
    for i, row in enumerate(rows[:-1]):
        if not row or not row[0][:1].isalpha() or tuple(row) == header:
            continue
        below = rows[i + 1]
        if len(row) > 1 and all(cell[:1].isalpha() and not is_missing(cell) and not is_no_object(cell) for cell in row):
            if len(below) != len(row) or not all(map(is_number, below)):
                continue
            found = ", ".join(map(quoted, row[:_SHOWN]))
            raise CalibrationDataError(
                f"{file}, line {numbers[i]}: the cells {found} look like the header of another table. If so, save each "
                "table as a file of its own; otherwise, put # before this line",
                problem=f"{file}, line {numbers[i]}: another table begins here",
            )


def _refuse_other_widths(
    file: str, header: tuple[str, ...], rows: Sequence[tuple[str, ...]], numbers: Sequence[int], delimiter: str
) -> None:
    """Raise an error if a row does not match the header."""
    if set(map(len, rows)) <= {len(header)}:
        return
    for number, row in zip(numbers, rows, strict=True):
        if len(row) != len(header):
            place, hint = f"{file}, line {number}", _hint(row, delimiter)
            raise CalibrationDataError(
                f"{place}: this row has {_cells_in_words(row)}, but the header has {_cells_in_words(header)}{hint}",
                problem=f"{place}: this row and the header have different numbers of cells",
            )


def _decode(content: bytes, file: str) -> tuple[str, str]:
    """Decode the bytes of a text file. Also return the name of the encoding."""
    content = content.rstrip(b"\0") if content.count(b"\0") < len(content) // 4 else content
    marked = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    for start, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        if not marked and len(content) > 1 and not content[start::2].strip(b"\0") and content[1 - start :: 2].isascii():
            return content.decode(encoding, "replace"), encoding
    if b"\0" in content and not marked:
        raise _refusal(
            f"{file}: the file contains binary data, but must be a table of text such as CSV; {export_for(file)}"
        )
    for encoding in ("utf-16",) if marked else ("utf-8-sig", "cp1252", "latin-1"):
        with suppress(UnicodeDecodeError):
            return content.decode(encoding), encoding
    raise _refusal(f"{file}: the file contains bytes that are not valid UTF-16 text; save the table as UTF-8 text")


def _lines(file: str, text: str) -> tuple[Sequence[int], list[str], Lines]:
    """Return the lines of a text file with line numbers.

    Blank lines and comments are omitted.

    The last comment may be the header.
    """
    lines = _BREAK.split(text) if "\r" in text else text.split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    is_short = len(lines) <= _MOST_ROWS and max(map(len, lines), default=0) <= _LONGEST_LINE
    if is_short and "#" not in text and all(line.strip(_EMPTY) for line in lines):
        return range(1, len(lines) + 1), lines, []
    numbers = array("q")
    texts: list[str] = []
    remark: Lines = []
    for i, line in enumerate(lines, start=1):
        if len(line) > _LONGEST_LINE:
            raise _refusal(
                f"{file}, line {i}: this line has {len(line):,} characters, but at most {_LONGEST_LINE:,} are allowed"
            )
        start = line.strip(_EMPTY)[:1] and line.lstrip()[:1]
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
    return '; if blanks separate the columns, write "nan" for missing values' if delimiter == BLANK else ""
