"""Long tables: which column is the distance, which the output, and what the others are."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from pretouch._core.errors import CalibrationDataError
from pretouch._core.units import parse_unit

from .cells import Column, Layout, TextTable, is_missing, is_number, listed, shortened
from .choice import Chosen, ColumnChoice, remedy
from .headers import is_length, is_named, is_output_unit, output_unit, split_title

__all__ = ["long_layout", "output_column", "taken_as"]

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
            f"they are: {remedy(f'distance={place + 1},output={other + 1}')}"
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
            "comma, semicolon, tab or blanks"
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
    moving = {i for i in free if len({row[i] for _, row in table.rows}) > 1}  # a bias voltage stays, a photocurrent not
    first = ([i for i in group if i in moving] for group in (named, known, either if named or known else []))
    found = next((group for group in (*first, named, known, left, either) if group), [])
    return _only(table, found, "output")


def _tells_apart(table: TextTable, index: int) -> bool:
    """Tell whether a column that nothing is known of may hold labels: text, or values that come again and again."""
    cells = [row[index] for _, row in table.rows if not is_missing(row[index])]
    return not all(is_number(cell) for cell in cells) or len(set(cells)) < max(_FEW, len(cells) / 2)


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
        raise CalibrationDataError(f"{table.place}: found {shortened(title)}, a distance without a unit: {how}")
    if not is_length(unit):
        raise CalibrationDataError(f"{table.place}: found the unit {unit!r}, expected a length such as mm: {how}")
    return Column(index=index, title=title, unit="m", factor=parse_unit(unit).factor)


def _output_column(table: TextTable, outputs: Sequence[int], chosen: Chosen) -> tuple[Column, list[str]]:
    title, notes = table.header[outputs[0]], []
    unit = chosen.unit_beside(title)
    symbol, factor = output_unit(unit)
    if unit is None:
        symbol, taken = taken_as([row[i] for _, row in table.rows for i in outputs])
        notes.append(f"The output column {title!r} has no unit; its values are taken as {taken}.")
    if is_named(title, "setting") and not chosen.names_a_column:
        notes.append(f"The column {title!r} is named as a setting; it is taken as the output, for no other can be.")
    return Column(index=outputs[0], title=title, unit=symbol, factor=factor), notes


def taken_as(cells: Sequence[str]) -> tuple[str, str]:
    """Decide what outputs without a unit are: their unit, and what a sentence calls it."""
    filled = [cell for cell in cells if not is_missing(cell)]
    if filled and all(re.fullmatch(r"\+?\d+", cell) for cell in filled):
        return "counts", "counts, for all of them are integers"
    return "", "numbers without a unit"


def _labels(table: TextTable, distance: int, outputs: Sequence[int]) -> tuple[tuple[int, ...], list[str]]:
    """Find the columns that tell curves apart: all others but counts, other outputs, and settings that drift."""
    labels, notes = [], []
    for i, title in enumerate(table.header):
        cells, reason = [row[i] for _, row in table.rows], ""
        if i in {distance, *outputs}:
            continue
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
    for _, row in table.rows:
        found.setdefault(row[index], set()).add(row[distance])
    few = sum(len(distances) < _FEW for distances in found.values())
    return len(found) > 1 and 2 * few > len(found)


def output_column(table: TextTable, index: int, layout: Layout) -> Column:
    """Read the unit of a column of outputs: that of the calibration, and no other, also where its header has none."""
    title = table.header[index]
    found = split_title(title)[1]
    symbol, factor = output_unit(found) if found else (layout.unit, layout.pairs[0][1].factor)
    if symbol != layout.unit:
        raise CalibrationDataError(
            f"{table.place}: found the unit {found!r}, expected {layout.unit or 'none'!r} as in the calibration"
        )
    return Column(index=index, title=title, unit=symbol, factor=factor)
