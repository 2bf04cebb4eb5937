"""Read lines of text that are no rows of a table yet, such as `10:12:33.000 -> 27` or `prox:5087,als:12`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

from .cells import is_number, is_row
from .dialect import cells_of, delimiter_of_row
from .names import is_named, split_title
from .number_forms import WITHIN_LINE
from .unit_words import LENGTH, dimension

TIME_OF_LINE: Final = "time of the line"
"""Header of the column with the times that a serial monitor writes in front of each line."""
_STAMP: Final = re.compile(
    r"\s*(\[?)((?:\d{4}-\d\d-\d\d[T ])?\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?)(\]?)\s*(->|>|)\s*(.*)", re.DOTALL
)
_PAIR: Final = re.compile(
    rf"\s*\"?([^\W\d_][^:=,;\t\"]*?)\"?\s*[:=]\s*(?:({WITHIN_LINE})\s*([^\s\d,;:=]*)|(none|inf|no object|nan))"
    r"(?:\s*[,;\t|]\s*|\s+|$)",
    re.IGNORECASE,
)
_LENGTH_AND_NUMBERS: Final = re.compile(rf"\s*({WITHIN_LINE})\s*([^\s\d,;:=]+)\s*[:=]\s*((?:{WITHIN_LINE}[\s,;]*)*)")
_RULE: Final = re.compile(r"[\s|+:=-]*--[\s|+:=-]*|\s*\\(?:hline|toprule|midrule|bottomrule|begin|end)\b.*")
_MOST: Final = 0.8  # share of the lines that have labels in a file of such lines
_LOOKED_AT: Final = 200  # lines from which the form is told
_MOST_LABELS: Final = 200
_OSCILLOSCOPE: Final = 5  # columns of a file with settings, times and values
_FEWEST: Final = 2  # columns, and distances of readings in blocks
_SHORT: Final = 4096  # characters of a line that is searched for labels
_COLUMN: Final = "\t"


class FormedLines(NamedTuple):
    """Lines of a file as rows of a table, with the line number of each.

    `notes` say how the lines were understood, `lost` which lines are not read.
    """

    numbers: Sequence[int]
    texts: list[str]
    notes: tuple[str, ...]
    lost: tuple[str, ...] = ()


def without_stamp(line: str) -> tuple[str, str]:
    """Split the time that a serial monitor puts in front of a line from the rest.

    Returns:
        The time, empty if there is none, and the rest of the line.

    Examples:
        >>> without_stamp("10:12:33.000 -> 27")
        ('10:12:33.000', '27')
        >>> without_stamp("27")
        ('', '27')
    """
    match = _STAMP.fullmatch(line) if ":" in line[:24] else None
    if match is None or not (match[4] or (match[1] and match[3])):
        return "", line
    return match[2], match[5]


def labeled_cells(line: str) -> dict[str, str] | None:
    """Return the cells of a line whose values have labels, such as a JSON object or `prox:5087,als:12`.

    A unit behind a number becomes part of the label: `d=5 mm` has the label `d [mm]`.

    Returns:
        The cells by label; None if the line has another form.

    Examples:
        >>> labeled_cells("prox:5087,als:12")
        {'prox': '5087', 'als': '12'}
        >>> labeled_cells('{"d": 5}'), labeled_cells("5,12")
        ({'d': '5'}, None)
    """
    text = line.strip()
    if len(text) > _SHORT:
        return None
    text = text.removeprefix("- ").rstrip(",") if text.startswith(("- {", "{")) else text
    if text.startswith("{"):
        return _of_object(text)
    cells: dict[str, str] = {}
    position = 0
    while position < len(text):
        match = _PAIR.match(text, position)
        if match is None or match.end() == position:
            return None
        name, value, unit, mark = match.groups()
        label = f"{name} [{unit}]" if unit and dimension(unit) else name
        if label in cells or (unit and not dimension(unit)):
            return None
        cells[label] = value if mark is None else mark
        position = match.end()
    return cells or None


def _of_object(text: str) -> dict[str, str] | None:
    try:
        content = json.loads(text)
    except ValueError:
        inner = text[1:].removesuffix("}")
        return None if "{" in inner or "}" in inner else labeled_cells(inner)
    return _flat(content) if isinstance(content, dict) else None


def _flat(content: dict[str, Any], prefix: str = "") -> dict[str, str]:
    """Return the numbers and texts of a JSON object with their paths, such as `header.stamp.sec`."""
    cells: dict[str, str] = {}
    for key, value in content.items():
        if isinstance(value, dict):
            cells |= _flat(value, f"{prefix}{key}.")
        elif value is None or isinstance(value, (str, int, float)):
            cells[f"{prefix}{key}"] = "" if value is None else str(value)
    return cells


def form_lines(numbers: Sequence[int], texts: list[str]) -> FormedLines:
    """Bring the lines of a file into rows of a table.

    Times in front of the lines become a column. Labels become the header. Brackets around rows, and the frames of
    tables in Markdown and LaTeX are removed. Other lines stay as they are.

    Returns:
        The lines, with notes on what was changed.
    """
    first = texts[:_LOOKED_AT]
    array = (
        _of_array(numbers, texts)
        if texts and texts[0].lstrip()[:1] in "[{" and texts[-1].rstrip()[-1:] in "]}"
        else None
    )
    if array is not None:
        return array
    oscilloscope = _of_oscilloscope(numbers, texts)
    if oscilloscope is not None:
        return oscilloscope
    notes: tuple[str, ...] = ()
    if _share(without_stamp(text)[0] for text in first) >= _MOST:
        numbers, texts = _with_times(numbers, texts)
        notes = ("The times in front of the lines are read as a column.",)
        first = texts[:_LOOKED_AT]
    if _share(labeled_cells(text.rpartition(_COLUMN)[2]) for text in first) >= _MOST:
        labeled = _of_labels(numbers, texts)
        if labeled is not None:
            return labeled._replace(notes=(*notes, *labeled.notes))
    blocks = _of_blocks(numbers, texts) if any(":" in text or "=" in text for text in first) else None
    if blocks is not None:
        return blocks
    if any(_is_framed(text) for text in first):
        numbers, texts = _without_frames(numbers, texts)
    return FormedLines(numbers, texts, notes)


def _share(found: Iterable[object]) -> float:
    marks = [bool(each) for each in found]
    return sum(marks) / len(marks) if marks else 0.0


def _of_array(numbers: Sequence[int], texts: list[str]) -> FormedLines | None:
    """Return the rows of a JSON array of objects or of lists, or of a JSON object of arrays, or None."""
    try:
        content = json.loads("\n".join(texts))
    except (ValueError, RecursionError):
        return None
    if isinstance(content, dict) and len({len(v) for v in content.values() if isinstance(v, list)}) == 1:
        columns = {name: column for name, column in content.items() if isinstance(column, list)}
        content = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if not content or not isinstance(content, list):
        return None
    line, notes = [numbers[0]], ("The file is JSON.",)
    if all(isinstance(row, dict) for row in content):
        cells = [_flat(row) for row in content]
        rows = _rows_of(cells)
        return FormedLines(line * len(rows), rows, notes)
    if all(isinstance(row, list) and len(row) > 1 for row in content):
        rows = [_COLUMN.join(map(str, row)) for row in content]
        return FormedLines(line * len(rows), rows, notes)
    return None


def _of_oscilloscope(numbers: Sequence[int], texts: list[str]) -> FormedLines | None:
    """Return the rows of two formats of oscilloscopes, or None.

    One has its settings in the first three columns of the first rows; the other counts the samples, and gives the start
    and the increment of the time in its second row.
    """
    cells = [[cell.strip() for cell in text.split(",")] for text in texts[:_LOOKED_AT]]
    if cells and cells[0][0] == "Record Length" and len(cells[0]) >= _OSCILLOSCOPE:
        settings = {row[0]: row[1] for row in cells if len(row) >= _OSCILLOSCOPE and row[0]}
        header = f"time [{settings.get('Horizontal Units') or 's'}],output [{settings.get('Vertical Units') or 'V'}]"
        rows = [",".join(text.split(",")[3:5]) for text in texts]
        return FormedLines([numbers[0], *numbers], [header, *rows], ("The file is one of an oscilloscope.",))
    if len(cells) > 1 and cells[0][0] == "X" and {"Start", "Increment"} <= set(cells[0]):
        channels = [name for name in cells[0][1:] if name and name not in {"Start", "Increment"}]
        ends = [cell for cell in cells[1][1 + len(channels) :] if is_number(cell)]
        if len(ends) != len(("start", "increment")) or not all(
            text.partition(",")[0].strip().isdigit() for text in texts[2:]
        ):
            return None
        units, (start, step) = cells[1][1 : 1 + len(channels)], map(float, ends)
        titles = [f"{name} [{unit}]" for name, unit in zip(channels, units, strict=True)]
        rows = [",".join(["time [s]", *titles])]
        for text in texts[2:]:
            first, *rest = text.split(",")
            rows.append(",".join([f"{start + step * float(first):.12g}", *rest[: len(channels)]]))
        return FormedLines([numbers[0], *numbers[2:]], rows, ("The file is one of an oscilloscope.",))
    return None


def _with_times(numbers: Sequence[int], texts: list[str]) -> tuple[Sequence[int], list[str]]:
    """Make the times in front of the lines a column; a line without one belongs to the header or has no time."""
    rows = []
    parts = [without_stamp(text) for text in texts]
    several = next((rest for _, rest in parts if len(cells_of(rest, delimiter_of_row(rest))) > 1), "")
    mark = _COLUMN if labeled_cells(several) or not several else delimiter_of_row(several)
    for stamp, rest in parts:
        is_reading = is_row(cells_of(rest, mark)) or is_number(rest.strip()) or labeled_cells(rest) is not None
        rows.append(f"{stamp if is_reading else TIME_OF_LINE}{mark}{rest}")
    head = rows[0].startswith(TIME_OF_LINE)
    if not head and not labeled_cells(parts[0][1]):
        width = len(cells_of(parts[0][1], mark))
        rows.insert(0, mark.join([TIME_OF_LINE, *(f"column {i + 2}" for i in range(width))]))
        numbers = [numbers[0], *numbers]
    return numbers, rows


def _of_labels(numbers: Sequence[int], texts: list[str]) -> FormedLines | None:
    """Return the rows of a file whose lines have labels; lines without labels are not read."""
    found: list[dict[str, str]] = []
    lines, others = [], []
    for number, text in zip(numbers, texts, strict=True):
        stamp, _, rest = text.rpartition(_COLUMN)
        cells = labeled_cells(rest)
        if cells is None:
            others.append(number)
            continue
        found.append({TIME_OF_LINE: stamp, **cells} if stamp else cells)
        lines.append(number)
    rows = _rows_of(found)
    if not rows or len(rows[0].split(_COLUMN)) < _FEWEST:
        return None
    lost = []
    if others:
        lost.append(f"Lines without labels, which are not read: {len(others):,}. The first is line {others[0]}.")
    return FormedLines(
        [lines[0], *lines], rows, ("The names of the columns are the labels in the lines.",), tuple(lost)
    )


def _rows_of(found: Sequence[dict[str, str]]) -> list[str]:
    """Return header and rows of labeled cells; a label that a line lacks is an empty cell."""
    header = list(dict.fromkeys(key for cells in found for key in cells))
    if len(header) > _MOST_LABELS:
        return []
    return [
        _COLUMN.join(cell.replace(_COLUMN, " ").replace("\n", " ") for cell in row)
        for row in (header, *([cells.get(key, "") for key in header] for cells in found))
    ]


def _of_blocks(numbers: Sequence[int], texts: list[str]) -> FormedLines | None:
    """Return the rows of a file in which a distance stands above or in front of its readings, or None."""
    rows, lines, units, distances, others = [], [], set(), set(), 0
    place = None
    for number, text in zip(numbers, texts, strict=True):
        pair = _LENGTH_AND_NUMBERS.fullmatch(text) if len(text) < _SHORT else None
        cells = labeled_cells(text) if pair is None else None
        readings: list[str] = []
        if pair is not None and dimension(pair[2]) == LENGTH:
            place, readings = pair[1], re.findall(WITHIN_LINE, pair[3])
            units.add(pair[2])
        elif cells is not None and len(cells) == 1 and is_named(next(iter(cells)), "distance"):
            ((label, place),) = cells.items()
            if place.casefold() not in {"inf", "none", "no object"}:
                units.add(split_title(label)[1] or "")
        elif all(map(is_number, text.split())) and place is not None:
            readings = text.split()
        else:
            others += 1
            if others > (1 - _MOST) * len(texts):
                return None
        if place is not None:
            distances.add(place)
        rows += [f"{place}{_COLUMN}{reading}" for reading in readings]
        lines += [number] * len(readings)
    if len(distances) < _FEWEST or len(units) != 1 or len(rows) < len(distances):
        return None
    unit = units.pop()
    header = f"distance [{unit}]" if unit else "distance"
    note = "Each distance belongs to the readings behind it and below it."
    return FormedLines([lines[0], *lines], [f"{header}{_COLUMN}output", *rows], (note,))


def _is_framed(text: str) -> bool:
    stripped = text.strip()
    return (stripped[:1] in "|([" and stripped.rstrip(",")[-1:] in "|)]") or stripped.endswith("\\\\")


def _without_frames(numbers: Sequence[int], texts: list[str]) -> tuple[Sequence[int], list[str]]:
    """Remove the brackets around rows, and the frames of tables in Markdown and LaTeX."""
    if _share(_is_framed(text) or _RULE.fullmatch(text) for text in texts) < _MOST:
        return numbers, texts
    kept = [(i, text.strip()) for i, text in zip(numbers, texts, strict=True) if not _RULE.fullmatch(text)]
    kept = [(i, text) for i, text in kept if text.strip("()[]|, ")]
    rows = []
    for _, text in kept:
        if text.startswith("|") or text.endswith("\\\\"):
            mark = "|" if text.startswith("|") else "&"
            inner = text.removesuffix("\\\\").strip().strip("|")
            rows.append(_COLUMN.join(cell.strip() for cell in inner.split(mark)))
        else:
            rows.append(text.rstrip(",").strip("()[]"))
    return [i for i, _ in kept], rows
