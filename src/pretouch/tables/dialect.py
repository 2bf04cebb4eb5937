"""Find the delimiter of a line, and split the line into cells."""

from __future__ import annotations

import csv
import re
from typing import Final

from .cells import is_number, is_row

BLANK: Final = " "
"""The delimiter of columns that are set apart by blanks."""
DELIMITERS: Final = {"\t": "tabs", " ": "blanks", ",": "commas", ";": "semicolons"}
"""The delimiters in words."""
BRACKETED: Final = r"[\[(][^\[\]()]*[\])]"
"""Text in brackets, such as a unit."""
_ROW_WORD = re.compile(r'"[^"]*"|no object|\S+', re.IGNORECASE)


def delimiter_of_header(line: str) -> str:
    """Find the column delimiter in a header line. Text in brackets and quotes is ignored."""
    bare = re.sub(rf'"[^"]*"|{BRACKETED}', "", line)
    return next((mark for mark in ("\t", ";", ",") if mark in bare.strip()), BLANK)


def delimiter_of_row(line: str) -> str:
    """Find the column delimiter in a row of numbers. The numbers may have decimal commas."""
    delimiter = delimiter_of_header(line)
    if delimiter != ",":
        return delimiter
    by_comma, by_blank = cells_of(line, ","), cells_of(line, BLANK)
    marks = len(by_blank) > 1 and all(map(is_number, by_blank)) and not all(map(is_number, by_comma))
    return BLANK if marks or not is_row(by_comma) else ","


def cells_of(line: str, delimiter: str) -> tuple[str, ...]:
    """Split a table row into cells."""
    if delimiter == BLANK:
        return tuple(word.strip('"').strip() for word in _ROW_WORD.findall(line))
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line.strip("\r\n")], delimiter=delimiter)))
    except csv.Error:  # a cell of more than a hundred thousand characters
        return tuple(cell.strip() for cell in line.split(delimiter))
