"""Find out which columns of a table contain distances, sensor outputs and labels."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace
from decimal import Decimal

from pretouch._core.errors import CalibrationDataError
from pretouch._core.units import WORKABLE, has_workable_magnitude, parse_unit
from pretouch.tables.column_options import ColumnOption, ColumnOptions, columns_hint
from pretouch.tables.headers import (
    Column,
    DistanceMark,
    Layout,
    TextTable,
    distance_mark,
    is_length,
    is_missing,
    is_named,
    is_no_object,
    is_number,
    is_output_unit,
    join_first,
    looks_wide,
    output_unit,
    quoted,
    split_title,
)

from .data import IF_NEGATIVE

_SHOWN = 8  # columns that a message lists
_FEW = 3  # fewest distances of a curve: a setting with fewer is not a label


def long_layout(table: TextTable, options: ColumnOptions) -> Layout:
    """Find the columns of a table with one reading per row.

    The layout has the columns of distances, outputs and labels. Options take precedence over names and units of the
    columns.

    Returns:
        The layout.
    """
    _refuse_no_header(table)
    distance_index, output_indices = _columns(table, options)
    distance_column = _distance_column(table, distance_index, options.distance)
    output_column, notes = _output_column(table, output_indices, options.output)
    labels, more_notes = _labels(table, distance_index, output_indices)
    if len(output_indices) > 1:
        more_notes.append(f"The columns {', '.join(table.header[i] for i in output_indices)} are read as repeats.")
    return Layout(
        pairs=tuple((distance_column, replace(output_column, index=i, title=table.header[i])) for i in output_indices),
        distances=distance_column.title,
        outputs=output_column.title,
        unit=output_column.unit,
        labels=labels,
        notes=(*notes, *more_notes),
    )


def _columns(table: TextTable, options: ColumnOptions) -> tuple[int, list[int]]:
    """Find the distance column and output columns of a table. Several output columns count as repeats."""
    selected = options.output.index(table)
    distance = _distance(table, options.distance, selected)
    repeats = _repeats(table, distance)
    if selected is None and distance is not None and len(repeats) > 1:
        return distance, repeats
    output = _output(table, distance) if selected is None else selected
    if len(table.header) == 2:  # the second of two columns follows from the first; by default the distance is the first
        distance = (0 if output is None else 1 - output) if distance is None else distance
        output = 1 - distance if output is None else output
    if distance is not None and distance == output:
        raise CalibrationDataError(
            f"columns: column {distance + 1} is given as the distance and also as the output; give two different "
            "columns"
        )
    if distance is None or output is None:
        columns = join_first([f"{i}: {quoted(title)}" for i, title in enumerate(table.header, start=1)], _SHOWN)
        distance_or_first = 0 if distance is None else distance
        free = [i for i in range(len(table.header)) if i != distance_or_first]
        output_guess = next((i for i in free if not is_named(table.header[i], "setting")), free[0])
        raise CalibrationDataError(
            f"{table.place}: the table needs one column named distance and one column named output. It has the columns "
            f"{columns}. Rename two columns, or select two columns with "
            f"{columns_hint(f'distance={distance_or_first + 1},output={output_guess + 1}')}",
            problem=f"{table.place}: the table has no columns that are named distance and output",
        )
    return distance, [output]


def _repeats(table: TextTable, distance: int | None) -> list[int]:
    """Return the columns of repeated readings. Their units must agree, and no other column may be the output."""
    numbered = [i for i, title in enumerate(table.header) if is_named(title, "repeat") and i != distance]
    units = {split_title(table.header[i])[1] for i in numbered}
    named = [i for i, title in enumerate(table.header) if is_named(title, "output") and i not in {*numbered, distance}]
    return [] if named or len(units) > 1 else numbered


def _refuse_no_header(table: TextTable) -> None:
    if all(is_number(cell) for cell in table.header):
        message = (
            f'{table.place}: the first row contains numbers, but a header such as "distance [mm],output [V]" is '
            f"expected. Add a header, or name the columns with {columns_hint('distance=1 [mm],output=2 [V]')}"
        )
        if len(table.header) > 2:
            message += '. If these numbers are distances, use --columns "distance=[mm]"'
        raise CalibrationDataError(message)
    if len(table.header) < 2:
        raise CalibrationDataError(
            f"{table.place}: the table has only one column ({quoted(table.header[0])}), but needs two or more "
            "columns, separated by comma, semicolon, tab or blanks",
            problem=f"{table.place}: found one column, expected two or more",
        )


def _distance(table: TextTable, option: ColumnOption, output: int | None) -> int | None:
    """Find the distance column of a table.

    The column is identified by the user's option, by its name, or by its unit of length.

    Returns:
        The column.
    """
    if option.names_a_column:
        return option.index(table)
    units = [split_title(title)[1] for title in table.header]
    named = [i for i, title in enumerate(table.header) if is_named(title, "distance") and i != output]
    lengths = [i for i, unit in enumerate(units) if is_length(unit) and i != output]
    matches = (
        [i for i in named if i in lengths]
        or [i for i in named if units[i] is None]
        or [i for i in lengths if not is_named(table.header[i], "setting")]
        or named
    )
    return _single_match(table, matches, "distance")


def _output(table: TextTable, distance: int | None) -> int | None:
    """Find the output column of a table.

    The column is identified by its name or unit, or is the only remaining column.

    Returns:
        The column.
    """
    free = [i for i in range(len(table.header)) if i != distance]
    others = [i for i in free if not is_named(table.header[i], "setting")]
    named = [i for i in others if is_named(table.header[i], "output")]
    with_unit = [i for i in others if is_output_unit(split_title(table.header[i])[1])]
    either = [i for i in free if len(free) > 1 and is_named(table.header[i], "setting or output")]
    remaining = others if len(free) > 1 and len(others) == 1 and not _may_be_label(table, others[0]) else []
    moving = {i for i in free if len(set(table.columns[i])) > 1}  # a bias voltage is constant, a photocurrent changes
    first = ([i for i in group if i in moving] for group in (named, with_unit, either if named or with_unit else []))
    matches = next((group for group in (*first, named, with_unit, remaining, either) if group), [])
    return _single_match(table, matches, "output")


def _may_be_label(table: TextTable, index: int) -> bool:
    """Return True if a column may contain labels. Such a column holds text or repeated values."""
    counts = {cell: count for cell, count in Counter(table.columns[index]).items() if not is_missing(cell)}
    return not all(map(is_number, counts)) or len(counts) < max(_FEW, sum(counts.values()) / 2)


def _single_match(table: TextTable, matches: Sequence[int], what: str) -> int | None:
    """Return the only matching column of a table.

    Return None if no column matches. Two matching columns are an error.

    Raises:
        CalibrationDataError: two columns match.
    """
    if len(matches) < 2:
        return matches[0] if matches else None
    first, second = (f"{i + 1}: {quoted(table.header[i])}" for i in matches[:2])
    raise CalibrationDataError(
        f"{table.place}: the columns {first} and {second} may both contain the {what}; select one of these "
        f"columns with {columns_hint(f'{what}={matches[0] + 1}')}"
    )


def _distance_column(table: TextTable, index: int, option: ColumnOption) -> Column:
    title, unit = table.header[index], option.unit_with(table.header[index])
    hint = columns_hint(f"distance={index + 1} [mm]")
    how = f'write the unit into the column header, as in "distance [mm]", or use {hint}'
    if not unit:
        raise CalibrationDataError(
            f"{table.place}: found {quoted(title)}, a distance without a unit: {how}",
            problem=f"{table.place}: found a distance without a unit",
        )
    if not is_length(unit):
        raise CalibrationDataError(
            f"{table.place}: the unit {unit!r} of the distance is not a unit of length, such as mm; {how}"
        )
    return Column(index=index, title=title, unit="m", factor=parse_unit(unit).factor)


def _output_column(table: TextTable, outputs: Sequence[int], option: ColumnOption) -> tuple[Column, list[str]]:
    title, notes = table.header[outputs[0]], []
    unit = option.unit_with(title)
    symbol, factor = output_unit(unit)
    if unit is None:
        symbol, meaning = default_output_unit(set().union(*(table.columns[i] for i in outputs)))
        notes.append(f"The column {title!r} of sensor outputs has no unit, so its values are interpreted as {meaning}.")
    if is_named(title, "setting") and not option.names_a_column:
        notes.append(
            f"The column {title!r} has the name of a sensor setting, but is used as the sensor output. No other column "
            "can be the output."
        )
    return Column(index=outputs[0], title=title, unit=symbol, factor=factor), notes


def default_output_unit(cells: Collection[str]) -> tuple[str, str]:
    """Return the default unit of sensor outputs.

    It applies if a table states no unit. The second result is a phrase for messages.
    """
    filled = [cell for cell in cells if not is_missing(cell)]
    if filled and all(re.fullmatch(r"\+?\d+", cell) for cell in filled):
        return "counts", "counts, because all of them are integers"
    return "", "numbers without a unit"


def _labels(table: TextTable, distance: int, outputs: Sequence[int]) -> tuple[tuple[int, ...], list[str]]:
    """Return the label columns of a table. Also return notes on ignored columns."""
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
    """Return True if a column cannot be a label. Most values of such a column occur at too few distances."""
    distances_of: dict[str, set[str]] = {}
    for cell, distance_cell in zip(table.columns[index], table.columns[distance], strict=True):
        distances_of.setdefault(cell, set()).add(distance_cell)
    few = sum(len(distances) < _FEW for distances in distances_of.values())
    return len(distances_of) > 1 and 2 * few > len(distances_of)


_BRACKETS = re.compile(r"([^\[\]()]*)[\[(]\s*([^\[\]()]*)\s*[\])]")


def wide_layout(table: TextTable, options: ColumnOptions) -> Layout | None:
    """Find the columns of a table whose column headers are distances.

    The result is None for a long table. An option that selects a column implies a long table.

    Returns:
        The layout.
    """
    if options.names_a_column or not looks_wide(table.header, declared=options.declares_distances):
        return None
    marks = {i: mark for i, title in enumerate(table.header) if (mark := distance_mark(title))}
    others = [i for i in range(len(table.header)) if i not in marks]
    if not options.declares_distances:
        _refuse_ambiguity(table, marks, others)
    unit = _distance_unit(table, options, marks, others)
    symbol, factor, notes = _output_unit(table, options, marks, others)
    counts = [i for i in others if _counts_rows(table, i)]
    places = [table.header[i] for i, mark in marks.items() if mark.number is not None]
    unit_text = "" if any(mark.unit for mark in marks.values()) else f" in {unit}"
    span = f"{places[0]} to {places[-1]}{unit_text}" if places else "none"
    filled = [table.title(i) for i in counts if any(table.columns[i])]
    notes = [
        f"The column headers {span} are interpreted as distances, and each row as one repetition of the measurement.",
        *notes,
    ]
    notes += [f"Column {title} is not used: it counts the rows." for title in filled]
    columns = [Column(index=i, title=table.header[i], unit=symbol, factor=factor) for i in marks]
    distances = [_distance_of_header(table, mark, unit) for mark in marks.values()]
    return Layout(
        pairs=tuple(zip(distances, columns, strict=True)),
        distances=f"the headers {span}",
        outputs="the cells below them",
        unit=symbol,
        labels=tuple(i for i in others if i not in counts),
        notes=tuple(notes),
    )


def _refuse_ambiguity(table: TextTable, marks: dict[int, DistanceMark], others: list[int]) -> None:
    """Raise an error if column headers are ambiguous. Such headers may be distances as well as repeat numbers."""
    corner = next((i for i in others if is_length(split_title(table.header[i])[1])), None)
    if corner is None or any(mark.unit or mark.number is None for mark in marks.values()):
        return
    cells = set(table.columns[corner])
    if any(cells) and all(is_number(cell) or is_no_object(cell) for cell in cells):
        first, last = (table.header[i] for i in (min(marks), max(marks)))
        raise CalibrationDataError(
            f"{table.place}: the distances may be in the column {table.header[corner]!r} or in the headers "
            f'{first!r} to {last!r}. If they are in the column, use --columns "distance={corner + 1}". If they are in '
            f"the headers, use {columns_hint('distance=[mm]')}"
        )


def _distance_unit(table: TextTable, options: ColumnOptions, marks: dict[int, DistanceMark], others: list[int]) -> str:
    """Find the unit of the distances in column headers.

    The unit is in these headers, in an option, or in another header.

    Returns:
        The unit.

    Raises:
        CalibrationDataError: there is no unit.
    """
    header_units = list(dict.fromkeys(mark.unit for mark in marks.values() if mark.unit))
    bare = [i for i, mark in marks.items() if mark.unit is None and mark.number is not None and float(mark.number)]
    option_unit = options.distance.unit
    if header_units:
        first = next((unit for unit in header_units if unit != option_unit), option_unit)
        if option_unit is not None and first != option_unit:
            raise CalibrationDataError(
                f"columns: found two units for the distance. The option gives the unit {option_unit!r}, but a column "
                f"header gives the unit {first!r}. Give only one unit"
            )
        if bare and len(header_units) > 1:
            raise CalibrationDataError(
                f"{table.place}: the header {table.header[bare[0]]!r} has no unit, and the units of the other "
                'headers differ; add the unit, such as "5 mm"'
            )
        return str(first)
    if option_unit is not None:
        return option_unit
    corner = [u for i in others for name, u in _units(table.header[i]) if is_length(u) and _is_distance_name(name)]
    if not corner:
        shown = join_first([repr(table.header[i]) for i in marks], 3)
        raise CalibrationDataError(
            f'{table.place}: the distances {shown} have no unit; write the unit into each header, such as "5 '
            'mm", or use '
            f"{columns_hint('distance=[mm]')}"
        )
    return corner[0]


def _units(title: str) -> list[tuple[str, str]]:
    """Return all names and units in a column header. The header in the corner may contain two pairs."""
    units = [(name, unit.strip()) for name, unit in _BRACKETS.findall(title)]
    name, unit = split_title(title)
    return units or ([(name, unit)] if unit else [("", title)])


def _is_distance_name(name: str) -> bool:
    words = re.split(r"[\W_]+", name)
    return not any(words) or any(is_named(word, "distance") for word in words if word)


def _output_unit(
    table: TextTable, options: ColumnOptions, marks: dict[int, DistanceMark], others: list[int]
) -> tuple[str, float, list[str]]:
    """Return the output unit of a table with distance headers.

    The unit comes from the option or from the corner cell; otherwise, integers are counts.
    """
    unit_text = options.output.unit
    for i in others:
        for name, unit in _units(table.header[i]):
            if (
                unit_text is None
                and is_output_unit(unit)
                and (not name.strip() or is_named(name.strip(" \\/|,;"), "output"))
            ):
                unit_text = unit
    if unit_text is not None:
        return (*output_unit(unit_text), [])
    symbol, meaning = default_output_unit(set().union(*(table.columns[i] for i in marks)))
    return symbol, 1.0, [f"The sensor outputs have no unit, so their values are interpreted as {meaning}."]


def _counts_rows(table: TextTable, index: int) -> bool:
    """Return True if a column contains only repeat numbers or times. The column may also be empty."""
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
    """Return True if a cell contains a repeat number. Examples are `3` and `trial 3`."""
    return is_number(cell) or is_missing(cell) or is_named(re.sub(r"\d+$", "", cell), "count")


def _distance_of_header(table: TextTable, mark: DistanceMark, unit: str) -> float:
    if mark.number is None:
        return math.inf
    value = float(Decimal(mark.number) * Decimal(repr(parse_unit(mark.unit or unit).factor)))
    message = f"{table.place}: found the distance {quoted(f'{mark.number} {mark.unit or unit}')}"
    if value < 0:
        raise CalibrationDataError(f"{message}, which must not be negative; {IF_NEGATIVE}")
    if not (math.isfinite(value) and has_workable_magnitude(value)):
        raise CalibrationDataError(f"{message}, expected a number {WORKABLE} (in m)")
    return value
