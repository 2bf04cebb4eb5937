"""Read numbers that are written as in source code: JSON, lists of Python, vectors of MATLAB and arrays of C."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Sequence
from typing import Any, Final

from .cells import is_number
from .formed_lines import COLUMN, FormedLines
from .labels import flat_cells, rows_of

_VECTOR: Final = re.compile(
    r"\s*(?:[\w ]*\s)?([^\W\d]\w*)(?:\[\d*\])?\s*[:=]\s*(?:\w+(?:\.\w+)*\()?[\[{(]([^\[\]{}()]*)[\]})]\)?\s*[;,]?\s*"
)
_FEWEST: Final = 2  # vectors, and numbers of a vector
_MOST_VECTORS: Final = 200
_MOST_LITERAL: Final = 1_000_000  # characters


def of_arrays(numbers: Sequence[int], texts: list[str]) -> FormedLines | None:
    """Return the rows of a JSON array of objects or of lists, or of a JSON object of arrays, or None.

    A list or dictionary of Python is read as well.

    Args:
        numbers: the numbers of the lines.
        texts: the lines.
    """
    if not texts or texts[0].lstrip()[:1] not in "[{(" or texts[-1].rstrip()[-1:] not in "]})":
        return None
    content, notes = _content("\n".join(texts)), ("The file is JSON.",)
    if isinstance(content, dict) and content and all(isinstance(key, (int, float)) for key in content):
        content, notes = [list(pair) for pair in content.items()], ("The file is a dictionary of Python.",)
    content = _split_frame(content)
    if isinstance(content, dict) and len({len(v) for v in content.values() if isinstance(v, list)}) == 1:
        columns = {name: column for name, column in content.items() if isinstance(column, list)}
        content = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if not content or not isinstance(content, list):
        return None
    line = [numbers[0]]
    if all(isinstance(row, dict) for row in content):
        rows = rows_of([flat_cells(row) for row in content])
        return FormedLines(line * len(rows), rows, notes)
    if all(isinstance(row, (list, tuple)) and len(row) > 1 for row in content):
        rows = [COLUMN.join(map(str, row)) for row in content]
        return FormedLines(line * len(rows), rows, notes)
    return None


def _split_frame(content: Any) -> Any:
    """Return a data frame whose headers and rows are two members of an object as a list of objects."""
    members = content.values() if isinstance(content, dict) else ()
    for header in members:
        is_header = (
            isinstance(header, list) and len(header) >= _FEWEST and all(isinstance(each, str) for each in header)
        )
        for rows in members if is_header else ():
            if isinstance(rows, list) and rows and all(isinstance(r, list) and len(r) == len(header) for r in rows):
                return [dict(zip(header, row, strict=True)) for row in rows]
    return content


def _content(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        pass
    try:
        return ast.literal_eval(text.strip()) if len(text) < _MOST_LITERAL else None
    except (ValueError, SyntaxError, RecursionError, MemoryError, TypeError):
        return None


def of_vectors(numbers: Sequence[int], texts: Sequence[str]) -> FormedLines | None:
    """Return the vectors of source code, such as `distance_mm = [5, 10, 15]`, as columns, or None.

    Args:
        numbers: the numbers of the lines.
        texts: the lines; each of them must have a vector, all of one length.
    """
    if not _FEWEST <= len(texts) <= _MOST_VECTORS:
        return None
    matches = [_VECTOR.fullmatch(text) for text in texts]
    if None in matches:
        return None
    names = [match[1] for match in matches if match]
    vectors = [re.split(r"\s*[,;]\s*|\s+", match[2].strip().rstrip(",;")) for match in matches if match]
    length = len(vectors[0])
    if len(set(names)) < len(names):  # such as a tuple in each line of a log
        return None
    if length < _FEWEST or any(len(v) != length or not all(map(is_number, v)) for v in vectors):
        return None
    rows = [COLUMN.join(row) for row in (names, *zip(*vectors, strict=True))]
    return FormedLines([numbers[0]] * len(rows), rows, ("Each vector in the file is a column.",))
