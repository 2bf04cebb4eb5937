"""Find the columns of a table that hold distances, outputs and labels, in long and in wide tables."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace
from decimal import Decimal

from pretouch._core.errors import CalibrationDataError
from pretouch._core.units import WORKABLE, has_workable_magnitude, parse_unit

from .column_options import Chosen, ColumnChoice, remedy
from .headers import (
    Column,
    Layout,
    TextTable,
    UnitMark,
    distance_mark,
    is_length,
    is_missing,
    is_named,
    is_no_object,
    is_number,
    is_output_unit,
    listed,
    looks_wide,
    output_unit,
    shortened,
    split_title,
)

_SHOWN = 8  # columns that a message lists
_FEW = 3  # distances of a curve, without which a setting is no label


def long_layout(table: TextTable, choice: ColumnChoice) -> Layout:
    """Decide which column is the distance, which the output, or several where numbered columns are repeats."""
    # What was said about the columns comes first; names and units decide what is open, and what tells curves apart.
    _refuse_no_header(table)
    distance, outputs = _columns(table, choice)
    where = _distance_column(table, distance, choice.distance)
    what, notes = _output_column(table, outputs, choice.output)
    labels, further = _labels(table, distance, outputs)
    if len(outputs) > 1:
        further.append(f"The columns {', '.join(table.header[i] for i in outputs)} are read as repeats.")
    return Layout(
        pairs=tuple((where, replace(what, index=i, title=table.header[i])) for i in outputs),
        distances=where.title,
        outputs=what.title,
        unit=what.unit,
        labels=labels,
        notes=(*notes, *further),
    )


def _columns(table: TextTable, choice: ColumnChoice) -> tuple[int, list[int]]:
    """Find the distance and the output, of which there are several where their headers are numbers of repeats."""
    said = choice.output.index(table)
    distance = _distance(table, choice.distance, said)
    repeats = _repeats(table, distance)
    if said is None and distance is not None and len(repeats) > 1:
        return distance, repeats
    output = _output(table, distance) if said is None else said
    if len(table.header) == 2:  # of two columns with one known, the other is the other; else distance comes first
        distance = (0 if output is None else 1 - output) if distance is None else distance
        output = 1 - distance if output is None else output
    if distance is not None and distance == output:
        raise CalibrationDataError(f"columns: found column {distance + 1} for the distance and for the output")
    if distance is None or output is None:
        found = listed([f"{i}: {shortened(title)}" for i, title in enumerate(table.header, start=1)], _SHOWN)
        place = 0 if distance is None else distance
        free = [i for i in range(len(table.header)) if i != place]
        other = next((i for i in free if not is_named(table.header[i], "setting")), free[0])
        raise CalibrationDataError(
            f"{table.place}: found the columns {found}, expected one named distance and one named output; or say which "
            f"they are: {remedy(f'distance={place + 1},output={other + 1}')}",
            problem=f"{table.place}: found no columns that are named as distance and output",
        )
    return distance, [output]


def _repeats(table: TextTable, distance: int | None) -> list[int]:
    """Find columns that number repeats, all in one unit, beside which no other is named as the output."""
    numbered = [i for i, title in enumerate(table.header) if is_named(title, "repeat") and i != distance]
    units = {split_title(table.header[i])[1] for i in numbered}
    named = [i for i, title in enumerate(table.header) if is_named(title, "output") and i not in {*numbered, distance}]
    return [] if named or len(units) > 1 else numbered


def _refuse_no_header(table: TextTable) -> None:
    if all(is_number(cell) for cell in table.header):
        wide = ', or --columns "distance=[mm]" where they are distances' if len(table.header) > 2 else ""
        raise CalibrationDataError(
            f'{table.place}: found numbers where the header is expected, such as "distance [mm],output [V]"; or say '
            f"what the columns are: {remedy('distance=1 [mm],output=2 [V]')}{wide}"
        )
    if len(table.header) < 2:
        raise CalibrationDataError(
            f"{table.place}: found one column ({shortened(table.header[0])}), expected two or more, separated by "
            "comma, semicolon, tab or blanks",
            problem=f"{table.place}: found one column, expected two or more",
        )


def _distance(table: TextTable, chosen: Chosen, output: int | None) -> int | None:
    """Find the distance: what was said, else the one named so (with a length where several are), else the length."""
    if chosen.names_a_column:
        return chosen.index(table)
    units = [split_title(title)[1] for title in table.header]
    named = [i for i, title in enumerate(table.header) if is_named(title, "distance") and i != output]
    lengths = [i for i, unit in enumerate(units) if is_length(unit) and i != output]
    found = (
        [i for i in named if i in lengths]
        or [i for i in named if units[i] is None]
        or [i for i in lengths if not is_named(table.header[i], "setting")]
        or named
    )
    return _only(table, found, "distance")


def _output(table: TextTable, distance: int | None) -> int | None:
    """Find the output: the one named so, else volts or counts, else what is left, else a current; one that changes."""
    free = [i for i in range(len(table.header)) if i != distance]
    others = [i for i in free if not is_named(table.header[i], "setting")]
    named = [i for i in others if is_named(table.header[i], "output")]
    known = [i for i in others if is_output_unit(split_title(table.header[i])[1])]
    either = [i for i in free if len(free) > 1 and is_named(table.header[i], "setting or output")]
    left = others if len(free) > 1 and len(others) == 1 and not _tells_apart(table, others[0]) else []
    moving = {i for i in free if len(set(table.columns[i])) > 1}  # a bias voltage stays, a photocurrent not
    first = ([i for i in group if i in moving] for group in (named, known, either if named or known else []))
    found = next((group for group in (*first, named, known, left, either) if group), [])
    return _only(table, found, "output")


def _tells_apart(table: TextTable, index: int) -> bool:
    """Tell whether a column that nothing is known of may hold labels: text, or values that come again and again."""
    counts = {cell: count for cell, count in Counter(table.columns[index]).items() if not is_missing(cell)}
    return not all(map(is_number, counts)) or len(counts) < max(_FEW, sum(counts.values()) / 2)


def _only(table: TextTable, found: Sequence[int], what: str) -> int | None:
    """Return the one column that fits; None where none does."""
    if len(found) < 2:
        return found[0] if found else None
    first, second = (f"{i + 1}: {shortened(table.header[i])}" for i in found[:2])
    raise CalibrationDataError(
        f"{table.place}: found two columns that may be the {what} ({first}, {second}), expected one: say which with "
        f"{remedy(f'{what}={found[0] + 1}')}"
    )


def _distance_column(table: TextTable, index: int, chosen: Chosen) -> Column:
    title, unit = table.header[index], chosen.unit_beside(table.header[index])
    how = f'write it into the header, such as "distance [mm]", or say it: {remedy(f"distance={index + 1} [mm]")}'
    if not unit:
        raise CalibrationDataError(
            f"{table.place}: found {shortened(title)}, a distance without a unit: {how}",
            problem=f"{table.place}: found a distance without a unit",
        )
    if not is_length(unit):
        raise CalibrationDataError(f"{table.place}: found the unit {unit!r}, expected a length such as mm: {how}")
    return Column(index=index, title=title, unit="m", factor=parse_unit(unit).factor)


def _output_column(table: TextTable, outputs: Sequence[int], chosen: Chosen) -> tuple[Column, list[str]]:
    title, notes = table.header[outputs[0]], []
    unit = chosen.unit_beside(title)
    symbol, factor = output_unit(unit)
    if unit is None:
        symbol, taken = taken_as(set().union(*(table.columns[i] for i in outputs)))
        notes.append(f"The output column {title!r} has no unit; its values are taken as {taken}.")
    if is_named(title, "setting") and not chosen.names_a_column:
        notes.append(f"The column {title!r} is named as a setting; it is taken as the output, for no other can be.")
    return Column(index=outputs[0], title=title, unit=symbol, factor=factor), notes


def taken_as(cells: Collection[str]) -> tuple[str, str]:
    """Decide what outputs without a unit are: their unit, and what a sentence calls it."""
    filled = [cell for cell in cells if not is_missing(cell)]
    if filled and all(re.fullmatch(r"\+?\d+", cell) for cell in filled):
        return "counts", "counts, for all of them are integers"
    return "", "numbers without a unit"


def _labels(table: TextTable, distance: int, outputs: Sequence[int]) -> tuple[tuple[int, ...], list[str]]:
    """Find the columns that tell curves apart: all others but counts, other outputs, and settings that drift."""
    labels, notes = [], []
    for i, title in enumerate(table.header):
        if i in {distance, *outputs}:
            continue
        cells, reason = table.columns[i], ""
        if is_named(title, "output") or (is_named(title, "distance") and is_length(split_title(title)[1])):
            reason = "another column is the distance or the output"
        elif is_named(title, "count") and len(set(cells)) == len(cells) > 1:
            reason = "it counts the rows"
        elif (is_named(title, "setting") or is_output_unit(split_title(title)[1])) and _drifts(table, i, distance):
            reason = "it changes within the curve"
        if reason:
            notes.append(f"Column {table.title(i)} is not used: {reason}.")
        else:
            labels.append(i)
    return tuple(labels), notes


def _drifts(table: TextTable, index: int, distance: int) -> bool:
    """Tell whether most values of a column hold too few distances to be curves of their own."""
    found: dict[str, set[str]] = {}
    for cell, place in zip(table.columns[index], table.columns[distance], strict=True):
        found.setdefault(cell, set()).add(place)
    few = sum(len(distances) < _FEW for distances in found.values())
    return len(found) > 1 and 2 * few > len(found)


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
    filled = [table.title(i) for i in counts if any(table.columns[i])]
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
    cells = set(table.columns[corner])
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
    symbol, taken = taken_as(set().union(*(table.columns[i] for i in marks)))
    return symbol, 1.0, [f"The outputs have no unit; they are taken as {taken}."]


def _counts_rows(table: TextTable, index: int) -> bool:
    """Tell whether a column numbers or times the repeats, or is the empty one below a corner."""
    title = table.header[index]
    cells = table.columns[index]
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
