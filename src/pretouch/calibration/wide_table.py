"""Wide tables: columns named by distance, `0 cm,1 cm,...,inf`, and a row for every repeat."""

from __future__ import annotations

import math
import re
from decimal import Decimal

from pretouch._core.errors import CalibrationDataError
from pretouch._core.magnitudes import WORKABLE, has_workable_magnitude
from pretouch._core.units import parse_unit

from .cells import Column, Layout, TextTable, is_missing, is_no_object, is_number, listed, shortened
from .choice import ColumnChoice, remedy
from .columns import taken_as
from .headers import UnitMark, distance_mark, is_length, is_named, is_output_unit, looks_wide, output_unit, split_title

__all__ = ["wide_layout"]

_BRACKETS = re.compile(r"([^\[\]()]*)[\[(]\s*([^\[\]()]*)\s*[\])]")


def wide_layout(table: TextTable, choice: ColumnChoice) -> Layout | None:
    """Read the headers of a table as distances, with a pair for every column of outputs."""
    # None where the table is no wide one; whoever names a column means a long table.
    if choice.names_a_column or not looks_wide(table.header, declared=choice.declares_distances):
        return None
    marks = {i: mark for i, title in enumerate(table.header) if (mark := distance_mark(title))}
    others = [i for i in range(len(table.header)) if i not in marks]
    if not choice.declares_distances:
        _refuse_doubt(table, marks, others)
    unit = _distance_unit(table, choice, marks, others)
    symbol, factor, notes = _output_unit(table, choice, marks, others)
    counts = [i for i in others if _counts_rows(table, i)]
    places = [table.header[i] for i, mark in marks.items() if mark.number is not None]
    said = "" if any(mark.unit for mark in marks.values()) else f" in {unit}"
    span = f"{places[0]} to {places[-1]}{said}" if places else "none"
    filled = [table.title(i) for i in counts if any(row[i] for _, row in table.rows)]
    notes = [f"The headers {span} are read as distances, each row as a repeat.", *notes]
    notes += [f"Column {title} is not used: it counts the rows." for title in filled]
    columns = [Column(index=i, title=table.header[i], unit=symbol, factor=factor) for i in marks]
    distances = [_place(table, mark, unit) for mark in marks.values()]
    return Layout(
        pairs=tuple(zip(distances, columns, strict=True)),
        distances=f"the headers {span}",
        outputs="the cells below them",
        unit=symbol,
        labels=tuple(i for i in others if i not in counts),
        notes=tuple(notes),
    )


def _refuse_doubt(table: TextTable, marks: dict[int, UnitMark], others: list[int]) -> None:
    """Refuse bare numbers beside a column of distances: they may number the repeats of a table turned the other way."""
    corner = next((i for i in others if is_length(split_title(table.header[i])[1])), None)
    if corner is None or any(mark.unit or mark.number is None for mark in marks.values()):
        return
    cells = [row[corner] for _, row in table.rows]
    if any(cells) and all(is_number(cell) or is_no_object(cell) for cell in cells):
        first, last = (table.header[i] for i in (min(marks), max(marks)))
        raise CalibrationDataError(
            f"{table.place}: found a column {table.header[corner]!r} of numbers and headers {first!r} to {last!r}, "
            "expected distances in one of them: say "
            f'--columns "distance={corner + 1}" where the column is the distance and the headers number repeats, or '
            f"{remedy('distance=[mm]')} where the headers are the distances"
        )


def _distance_unit(table: TextTable, choice: ColumnChoice, marks: dict[int, UnitMark], others: list[int]) -> str:
    """Find the unit of bare numbers: that of the other headers, what was said, or what stands in the corner."""
    own = list(dict.fromkeys(mark.unit for mark in marks.values() if mark.unit))
    bare = [i for i, mark in marks.items() if mark.unit is None and mark.number is not None and float(mark.number)]
    said = choice.distance.unit
    if own:
        first = next((unit for unit in own if unit != said), said)
        if said is not None and first != said:
            raise CalibrationDataError(
                f"columns: found the unit {said!r} for the distance, whose headers say {first!r}: leave one of them out"
            )
        if bare and len(own) > 1:
            raise CalibrationDataError(
                f"{table.place}: found the header {table.header[bare[0]]!r} beside several units, expected a unit on "
                'it, such as "5 mm"'
            )
        return str(first)
    if said is not None:
        return said
    corner = [u for i in others for name, u in _units(table.header[i]) if is_length(u) and _of_distance(name)]
    if not corner:
        shown = listed([repr(table.header[i]) for i in marks], 3)
        raise CalibrationDataError(
            f"{table.place}: found the distances {shown} without a unit: write it into them, such as "
            f'"5 mm", or say it: {remedy("distance=[mm]")}'
        )
    return corner[0]


def _units(title: str) -> list[tuple[str, str]]:
    """Find every name with a unit in a header; a corner may hold two, and a bare unit is one."""
    found = [(name, unit.strip()) for name, unit in _BRACKETS.findall(title)]
    name, unit = split_title(title)
    return found or ([(name, unit)] if unit else [("", title)])


def _of_distance(name: str) -> bool:
    words = re.split(r"[\W_]+", name)
    return not any(words) or any(is_named(word, "distance") for word in words if word)


def _output_unit(
    table: TextTable, choice: ColumnChoice, marks: dict[int, UnitMark], others: list[int]
) -> tuple[str, float, list[str]]:
    """Find the unit of the cells: what was said, or what stands in the corner; else integers are counts."""
    said = choice.output.unit
    for i in others:
        for name, unit in _units(table.header[i]):
            if (
                said is None
                and is_output_unit(unit)
                and (not name.strip() or is_named(name.strip(" \\/|,;"), "output"))
            ):
                said = unit
    if said is not None:
        return (*output_unit(said), [])
    symbol, taken = taken_as([row[i] for _, row in table.rows for i in marks])
    return symbol, 1.0, [f"The outputs have no unit; they are taken as {taken}."]


def _counts_rows(table: TextTable, index: int) -> bool:
    """Tell whether a column numbers or times the repeats, or is the empty one below a corner."""
    title = table.header[index]
    cells = [row[index] for _, row in table.rows]
    distinct = len(set(cells)) == len(cells)
    corner = not title or any(is_length(unit) or is_output_unit(unit) for _, unit in _units(title))
    return (
        not any(cells)
        or (is_named(title, "count") and bool(title))
        or (is_named(title, "time") and distinct and len(cells) > 1)
        or (corner and distinct and all(map(_numbers_a_repeat, cells)))
    )


def _numbers_a_repeat(cell: str) -> bool:
    """Tell whether a cell is a number, or one after a word for repeats, such as `trial 3`."""
    return is_number(cell) or is_missing(cell) or is_named(re.sub(r"\d+$", "", cell), "count")


def _place(table: TextTable, mark: UnitMark, unit: str) -> float:
    if mark.number is None:
        return math.inf
    value = float(Decimal(mark.number) * Decimal(repr(parse_unit(mark.unit or unit).factor)))
    found = f"{table.place}: found the distance {shortened(f'{mark.number} {mark.unit or unit}')}"
    if value < 0:
        raise CalibrationDataError(f"{found}, which must not be negative")
    if not (math.isfinite(value) and has_workable_magnitude(value)):
        raise CalibrationDataError(f"{found}, expected a number {WORKABLE} (in m)")
    return value
