"""Read files whose lines have labels: one record in each line, or over several lines in turn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from pretouch._core.errors import CalibrationDataError

from .distance_blocks import title_cells
from .formed_lines import COLUMN, MOST, FormedLines
from .labels import labeled_cells, rows_of
from .line_prefixes import TIME_OF_LINE
from .names import is_named

_FEWEST: Final = 2  # columns
_SEVERAL: Final = 1.5  # readings per distance, from which a distance belongs to all lines below it

Kind = tuple[str, ...]


class _Line(NamedTuple):
    """A line with its labels, its number, and the time in front of it."""

    number: int
    stamp: str
    cells: dict[str, str]

    @property
    def kind(self) -> Kind:
        return tuple(self.cells)


def of_labels(file: str, numbers: Sequence[int], texts: Sequence[str]) -> FormedLines | None:
    """Return the rows of a file whose lines have labels; lines without labels are not read.

    Args:
        file: name of the file, for messages.
        numbers: the numbers of the lines.
        texts: the lines, with the time in front of a line in a column of its own.

    Returns:
        The rows; None if they have fewer than two columns.
    """
    lines: list[_Line] = []
    others = []
    for number, text in zip(numbers, texts, strict=True):
        stamp, _, rest = text.rpartition(COLUMN)
        cells = labeled_cells(rest) or title_cells(rest)
        if cells is None:
            others.append(number)
        else:
            lines.append(_Line(number, stamp, cells))
    notes, lost = ["The names of the columns are the labels in the lines."], []
    kinds = Counter(line.kind for line in lines)
    are_apart = len(kinds) > 1 and sum(map(len, kinds)) == len({label for kind in kinds for label in kind})
    records = _of_several_lines(file, lines, kinds) if are_apart else None
    if records is not None:
        is_below = len(records) > kinds[lines[0].kind]  # several readings for each distance
        left_out = 0 if is_below else len(lines) - sum(len(record) for record in records)
        notes.append(
            "Each distance belongs to the readings below it." if is_below else f"Each row is from {len(kinds)} lines."
        )
        if left_out:
            lost.append(f"Lines of incomplete groups of {len(kinds)} lines, which are not read: {left_out:,}.")
    else:
        records = [[line] for line in lines]
    rows = rows_of([_cells(record) for record in records])
    if not rows or len(rows[0].split(COLUMN)) < _FEWEST:
        return None
    if others:
        lost.append(f"Lines without labels, which are not read: {len(others):,}. The first is line {others[0]}.")
    starts = [record[0].number for record in records]
    return FormedLines([starts[0], *starts], rows, tuple(notes), tuple(lost))


def _cells(record: Sequence[_Line]) -> dict[str, str]:
    cells = {label: cell for line in record for label, cell in line.cells.items()}
    return {TIME_OF_LINE: record[0].stamp, **cells} if record[0].stamp else cells


def _of_several_lines(file: str, lines: Sequence[_Line], kinds: Counter[Kind]) -> list[list[_Line]] | None:
    """Join lines that have different labels in turn; return None if they are no parts of records."""
    leader = lines[0].kind
    least = min(kinds.values())
    if least < _FEWEST:
        return None
    is_place = any(is_named(label, "distance") for label in leader)
    if is_place and len(kinds) == 2 and max(kinds.values()) > _SEVERAL * kinds[leader]:
        return _below_distances(lines, leader)
    if max(kinds.values()) > _SEVERAL * least:
        return None
    groups: list[list[_Line]] = []
    for line in lines:
        if line.kind == leader or not groups:
            groups.append([line])
        elif line.kind not in {other.kind for other in groups[-1]}:
            groups[-1].append(line)
    complete = [group for group in groups if len(group) == len(kinds)]
    if len(complete) * len(kinds) < MOST * len(lines):
        return None
    if lines[-1].kind == leader and not _are_set_apart(complete):
        ends = " + ".join(leader)
        other = " + ".join(label for line in complete[0][1:] for label in line.cells)
        raise CalibrationDataError(
            f"{file}: the lines with {ends} and {other} alternate, and both the first and the last line have {ends}, "
            f"so they can be paired in two ways. If each pair begins with {ends}, remove line {lines[-1].number}. If "
            f"it ends with {ends}, remove line {lines[0].number}",
            problem=f"{file}: alternating lines can be paired in two ways",
        )
    return complete


def _below_distances(lines: Sequence[_Line], leader: Kind) -> list[list[_Line]]:
    """Return each reading with the distance above it."""
    records = []
    place = lines[0]
    for line in lines:
        if line.kind == leader:
            place = line
        else:
            records.append([_Line(line.number, line.stamp, place.cells), line])
    return records


def _are_set_apart(groups: Sequence[Sequence[_Line]]) -> bool:
    """Return True if blank lines or other lines separate the groups."""
    inner = [b.number - a.number for group in groups for a, b in pairwise(group)]
    between = [b[0].number - a[-1].number for a, b in pairwise(groups)]
    return bool(inner and between) and max(inner) == 1 and min(between) > 1
