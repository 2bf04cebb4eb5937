"""Read lines whose values have labels, such as `prox:5087,als:12` or a JSON object."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any, Final

from .formed_lines import COLUMN
from .number_forms import WITHIN_LINE
from .unit_words import LENGTH, dimension

_PAIR: Final = re.compile(
    rf"\s*\"?([^\W\d_][^:=,;\t\"]*?)\"?\s*[:=]\s*(?:({WITHIN_LINE})\s*([^\s\d,;:=]*)|(none|inf|no object|nan))"
    r"(?:\s*[,;\t|]\s*|\s+|$)",
    re.IGNORECASE,
)
_LEADING: Final = re.compile(rf"({WITHIN_LINE})(?:\s*([^\W\d_]+))?(?:\s*[,;|]\s*|\s+)(?=[^\W\d_])")
_LEADING_ALONE: Final = re.compile(rf"({WITHIN_LINE})(?:\s*[,;|]\s*|\s+)(?=[^\W\d_])")
_PLACE: Final = re.compile(rf".*?(?:^|[\s=@]){WITHIN_LINE}\s*([^\W\d_]+)\s*", re.DOTALL)
FIRST: Final = "column 1"
"""Header of a number without a label in front of the others."""
_MOST_LABELS: Final = 200
_LONGEST: Final = 4096  # characters of a line that is searched for labels


def labeled_cells(line: str) -> dict[str, str] | None:
    """Return the cells of a line whose values have labels, such as a JSON object or `prox:5087,als:12`.

    A unit behind a number becomes part of the label: `d=5 mm` has the label `d [mm]`. A number in front of the first
    label, such as a time, has the label `column 1`.

    Returns:
        The cells by label; None if the line has another form.

    Examples:
        >>> labeled_cells("prox:5087,als:12")
        {'prox': '5087', 'als': '12'}
        >>> labeled_cells('{"d": 5}'), labeled_cells("5,12")
        ({'d': '5'}, None)
        >>> labeled_cells("4999 L:608 R:295")
        {'column 1': '4999', 'L': '608', 'R': '295'}
    """
    text = line.strip()
    if len(text) > _LONGEST:
        return None
    text = text.removeprefix("- ").rstrip(",") if text.startswith(("- {", "{")) else text
    if text.startswith("{"):
        return _of_object(text)
    cells: dict[str, str] = {}
    position, name = 0, ""
    leading = _LEADING.match(text)
    if leading is not None and dimension(leading[2]):
        cells[f"{FIRST} [{leading[2]}]"], position = leading[1], leading.end()
    elif (leading := _LEADING_ALONE.match(text)) is not None:
        cells[FIRST], position = leading[1], leading.end()
    while position < len(text):
        match = _PAIR.match(text, position)
        if match is None or match.end() == position:
            return None
        name, value, unit, mark = match.groups()
        label = f"{name} [{unit}]" if unit and dimension(unit) else name
        if label in cells or (unit and not dimension(unit)) or (len(cells) == 1 and leading and dimension(name)):
            return None  # such as `5 mm: 812`, where the first name is a unit
        cells[label] = value if mark is None else mark
        position = match.end()
    if len(cells) == 1 and (place := _PLACE.fullmatch(name)) and dimension(place[1]) == LENGTH:
        return None  # a distance in front of its reading, such as `wall at 5 mm = 812`
    return cells or None


def _of_object(text: str) -> dict[str, str] | None:
    try:
        content = json.loads(text)
    except ValueError:
        inner = text[1:].removesuffix("}")
        return None if "{" in inner or "}" in inner else labeled_cells(inner)
    return flat_cells(content) if isinstance(content, dict) else None


def flat_cells(content: dict[str, Any], prefix: str = "") -> dict[str, str]:
    """Return the numbers and texts of a JSON object with their paths, such as `header.stamp.sec`."""
    cells: dict[str, str] = {}
    for key, value in content.items():
        if isinstance(value, dict):
            cells |= flat_cells(value, f"{prefix}{key}.")
        elif value is None or isinstance(value, (str, int, float)):
            cells[f"{prefix}{key}"] = "" if value is None else str(value)
    return cells


def rows_of(found: Sequence[dict[str, str]]) -> list[str]:
    """Return header and rows of labeled cells; a label that a line lacks is an empty cell."""
    header = list(dict.fromkeys(key for cells in found for key in cells))
    if len(header) > _MOST_LABELS:
        return []
    return [
        COLUMN.join(cell.replace(COLUMN, " ").replace("\n", " ") for cell in row)
        for row in (header, *([cells.get(key, "") for key in header] for cells in found))
    ]
