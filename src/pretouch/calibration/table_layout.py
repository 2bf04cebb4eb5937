"""Find out which columns of a table contain distances, sensor outputs and labels."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import pairwise

import numpy as np

from pretouch._core.errors import CalibrationDataError
from pretouch._core.units import WORKABLE, has_workable_magnitude, parse_unit
from pretouch.tables.cells import (
    Column,
    TextTable,
    is_missing,
    is_no_object,
    is_number,
    is_quantity,
    join_first,
    quoted,
)
from pretouch.tables.column_options import ColumnOption, ColumnOptions, columns_hint
from pretouch.tables.dialect import DELIMITERS
from pretouch.tables.line_prefixes import TIME_OF_LINE
from pretouch.tables.names import (
    DistanceMark,
    distance_mark,
    is_length,
    is_logarithmic,
    is_named,
    is_output_unit,
    looks_wide,
    output_unit,
    split_title,
)
from pretouch.tables.unit_words import LENGTH, TIME, dimension, unit_in_words

from .data import if_negative

_SHOWN = 8  # columns that a message lists
_SIDES = frozenset(
    [
        "left",
        "right",
        "front",
        "rear",
        "back",
        "top",
        "bottom",
        "inner",
        "outer",
        "center",
        "middle",
        "north",
        "south",
        "east",
        "west",
        "a",
        "b",
        "c",
        "d",
        "l",
        "r",
    ]
)
_TRUE = frozenset(
    [
        "true",
        "actual",
        "real",
        "reference",
        "ref",
        "set",
        "target",
        "nominal",
        "commanded",
        "desired",
        "ground",
        "stage",
        "ruler",
        "soll",
    ]
)
_RENAMED = re.compile(r"\.\d+$")  # what pandas adds to a header that occurs again
_SCATTER = 0.2  # largest range of a quantity that hardly changes, as a share of its mean
_FEW = 3  # fewest distances of a curve: a setting with fewer is not a label


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Columns of a calibration table that contain distances, outputs and labels.

    A long table has one pair of columns, a wide table has many.

    A pair has the column of distances, or one distance [m] (infinite without an object), and the column of outputs.
    `distances` and `outputs` describe these columns, and `unit` is that of the outputs. `labels` are the indices of the
    columns that distinguish curves by default; `notes` are assumptions. `sensors` are the names of the pairs if each
    pair belongs to a sensor of its own.
    """

    pairs: tuple[tuple[Column | float, Column], ...]
    distances: str
    outputs: str
    unit: str
    labels: tuple[int, ...]
    notes: tuple[str, ...]
    sensors: tuple[str, ...] = ()


def long_layout(table: TextTable, options: ColumnOptions) -> Layout:
    """Find the columns of a table with one reading per row.

    The layout has the columns of distances, outputs and labels. Options take precedence over names and units of the
    columns.

    Returns:
        The layout.
    """
    _refuse_no_header(table)
    tables = _tables_side_by_side(table, options)
    if tables is not None:
        return tables
    distance_index, output_indices, are_sensors = _columns(table, options)
    distance_column = _distance_column(table, distance_index, options.distance)
    output_column, notes = _output_column(table, output_indices, options.output)
    labels, more_notes = _labels(table, distance_index, output_indices)
    notes += _understood(table, options, distance_column, output_column, output_indices)
    if len(output_indices) > 1:
        listed = join_first([table.header[i] for i in output_indices], _SHOWN)
        what = "as the outputs of several sensors, with a curve for each" if are_sensors else "as repeats"
        more_notes.append(f"The columns {listed} are read {what}.")
    return Layout(
        pairs=tuple((distance_column, replace(output_column, index=i, title=table.header[i])) for i in output_indices),
        distances=distance_column.title,
        outputs=output_column.title,
        unit=output_column.unit,
        labels=labels,
        notes=(*notes, *more_notes),
        sensors=tuple(split_title(table.header[i])[0] for i in output_indices) if are_sensors else (),
    )


def _tables_side_by_side(table: TextTable, options: ColumnOptions) -> Layout | None:
    """Return the layout of tables with equal headers, a distance and an output each, side by side; None for others.

    If their distances follow each other, they are parts of one table. Otherwise, each is a curve.
    """
    titles = [_RENAMED.sub("", title) for title in table.header]
    count = len(titles) // 2
    if options.names_a_column or count < 2 or titles != titles[:2] * count or titles[0] == titles[1]:
        return None
    if not (is_named(titles[0], "distance") or is_length(split_title(titles[0])[1])) or is_length(
        split_title(titles[1])[1]
    ):
        return None
    first = replace(_distance_column(table, 0, options.distance), title=titles[0])
    output, notes = _output_column(table, [2 * i + 1 for i in range(count)], options.output)
    places = [table.numbers(2 * i) for i in range(count)]
    places = [place[np.isfinite(place)] for place in places]
    follows = all(len(a) and len(b) and (a.max() < b.min() or a.min() > b.max()) for a, b in pairwise(places))
    what = "as the parts of one table" if follows else "with a curve for each"
    return Layout(
        pairs=tuple((replace(first, index=2 * i), replace(output, index=2 * i + 1)) for i in range(count)),
        distances=first.title,
        outputs=output.title,
        unit=output.unit,
        labels=(),
        notes=(*notes, f"The file has {count} tables side by side, which are read {what}."),
        sensors=() if follows else tuple(f"table {i + 1}" for i in range(count)),
    )


def _columns(table: TextTable, options: ColumnOptions) -> tuple[int, list[int], bool]:
    """Find the distance column and output columns of a table.

    Returns:
        The distance column, the output columns, and whether several output columns belong to several sensors.
        Otherwise, they are repeats.

    Raises:
        CalibrationDataError: there are no such columns.
    """
    selected = options.output.index(table)
    distance = _distance(table, options.distance, selected)
    repeats = _repeats(table, distance)
    if selected is None and distance is not None and len(repeats) > 1:
        return distance, repeats, False
    sensors = _sensors(table, distance)
    if selected is None and distance is not None and sensors:
        return distance, sensors, True
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
        readable = [i for i, title in enumerate(table.header) if not is_named(title, "time")] or [0]
        distance_or_first = readable[0] if distance is None else distance
        free = [i for i in [*readable, *range(len(table.header))] if i != distance_or_first]
        others = ("setting", "count", "time", "statistic")
        output_guess = next((i for i in free if not any(is_named(table.header[i], kind) for kind in others)), free[0])
        unit = "" if is_length(split_title(table.header[distance_or_first])[1]) else " [UNIT]"
        hint = f"distance={distance_or_first + 1}{unit}"
        if not _sensors(table, distance_or_first):
            hint += f",output={output_guess + 1}"
        raise CalibrationDataError(
            f"{table.place}: the table needs one column named distance and one column named output. It has the columns "
            f"{columns}. Rename two columns, or select two columns with {columns_hint(hint)}",
            problem=f"{table.place}: the table has no columns that are named distance and output",
        )
    return distance, [output], False


def _sensors(table: TextTable, distance: int | None) -> list[int]:
    """Return the output columns of several sensors next to one distance column.

    All columns that may be outputs must be alike: they have the same unit, and names that differ in one word or number.
    """
    others = ("setting", "count", "repeat", "statistic", "time", "setting or output")
    columns = []
    for i, title in enumerate(table.header):
        unit = split_title(title)[1]
        if i == distance or any(is_named(title, kind) for kind in others) or dimension(unit) in {LENGTH, TIME}:
            continue
        cells = [cell for cell in table.columns[i] if not is_missing(cell)]
        if not cells or not all(map(is_number, cells)):
            continue
        columns.append(i)
    titles = [split_title(table.header[i]) for i in columns]
    if len(columns) < 2 or len(dict(titles)) < len(titles) or len({unit for _, unit in titles}) > 1:
        return []
    words = [re.findall(r"[^\W\d_]+|\d+", name) for name, _ in titles]
    differing = [i for i, group in enumerate(zip(*words, strict=False)) if len(set(group)) > 1]
    if len({len(each) for each in words}) > 1 or len(differing) != 1:
        return []
    alone = len(words[0]) == 1  # such as left and right, but not output and raw
    known = is_output_unit(titles[0][1]) and not any(is_named(table.header[i], "output") for i in columns)
    sides = all(name.strip().casefold() in _SIDES for name, _ in titles)
    return columns if known or sides or not alone else []


def _repeats(table: TextTable, distance: int | None) -> list[int]:
    """Return the columns of repeated readings. Their units must agree, and no other column may be the output."""
    numbered = [i for i, title in enumerate(table.header) if is_named(title, "repeat") and i != distance]
    units = {split_title(table.header[i])[1] for i in numbered}
    named = [i for i, title in enumerate(table.header) if is_named(title, "output") and i not in {*numbered, distance}]
    named = [i for i in named if not is_named(table.header[i], "average")]  # which follows from the repeats
    return [] if named or len(units) > 1 else numbered


def _refuse_no_header(table: TextTable) -> None:
    if all(is_number(cell) for cell in table.header) or _begins_with_a_row(table):
        message = (
            f'{table.place}: the first row contains numbers, but a header such as "distance [mm],output [V]" is '
            "expected. Add a header, or name the columns and their units with "
            f"{columns_hint('distance=1 [UNIT],output=2')}"
        )
        if len(table.header) > 2:
            message += '. If these numbers are distances, use --columns "distance=[UNIT]"'
        raise CalibrationDataError(message)
    if len(table.header) < 2:
        raise CalibrationDataError(
            f"{table.place}: the table has only one column ({quoted(table.header[0])}), but needs two or more "
            "columns, separated by comma, semicolon, tab or blanks",
            problem=f"{table.place}: found one column, expected two or more",
        )


def _begins_with_a_row(table: TextTable) -> bool:
    """Return True if the header has a distance with its unit, and so have the cells below it."""
    for title, cells in zip(table.written_header, table.written_columns, strict=True):
        mark = distance_mark(title)
        if mark is not None and mark.unit and cells and all(is_quantity(cell, LENGTH) for cell in cells[:_SHOWN]):
            return True
    return False


def refuse_quantities_in_rows(table: TextTable) -> None:
    """Raise an error if a column names the quantity of each row, such as `distance` and `voltage` in turn."""
    for index, cells in enumerate(table.written_columns):
        names = dict.fromkeys(cells)
        if not 1 < len(names) <= _SHOWN or len(cells) < 2 * len(names):
            continue
        places = [name for name in names if is_named(name, "distance") and len(name) > 1]
        others = [name for name in names if name not in places]
        if len(places) == 1 and any(is_named(o, "output") or is_output_unit(split_title(o)[1]) for o in others):
            found = ", ".join(map(quoted, names))
            raise CalibrationDataError(
                f"{table.place}: the column {table.title(index)} says which quantity each row has ({found}), but each "
                "quantity needs a column of its own; turn the rows into columns, such as with a pivot table of a "
                "spreadsheet",
                problem=f"{table.place}: the rows are of several quantities",
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
    if {"l", "r"} <= {split_title(title)[0].casefold() for title in table.header}:  # left and right, not a length
        named = [i for i in named if split_title(table.header[i])[0].casefold() != "l"]
    lengths = [i for i, unit in enumerate(units) if is_length(unit) and i != output]
    matches = (
        [i for i in named if i in lengths]
        or [i for i in named if units[i] is None]
        or [i for i in lengths if not is_named(table.header[i], "setting")]
        or named
    )
    others = [i for i in range(len(table.header)) if i not in {*matches, output} and _may_be_output(table, i)]
    is_open = not others and output is None
    told = [i for i in matches if is_open and set(re.findall(r"[^\W\d_]+", table.header[i].casefold())) & _TRUE]
    return _single_match(table, told if len(told) == 1 else matches, "distance")


def _may_be_output(table: TextTable, index: int) -> bool:
    """Return True if a column has numbers, and no name of another kind."""
    kinds = ("setting", "count", "time", "statistic")
    title = table.header[index]
    return not any(is_named(title, kind) for kind in kinds) and not _may_be_label(table, index)


def _output(table: TextTable, distance: int | None) -> int | None:
    """Find the output column of a table.

    The column is identified by its name or unit, or is the only remaining column.

    Returns:
        The column.
    """
    free = [i for i in range(len(table.header)) if i != distance]
    no_outputs = ("setting", "time", "statistic")
    others = [i for i in free if not any(is_named(table.header[i], kind) for kind in no_outputs)]
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
    _refuse_two_units(table, title)
    hint = columns_hint(f"distance={index + 1} [UNIT]")
    how = (
        f'write the unit in which the distances were measured into the column header, as in "distance [cm]", or use '
        f"{hint} with this unit in place of UNIT"
    )
    if not unit:
        raise CalibrationDataError(
            f"{table.place}: found {quoted(title)}, a distance without a unit: {how}",
            problem=f"{table.place}: found a distance without a unit",
        )
    if not is_length(unit):
        raise CalibrationDataError(
            f"{table.place}: the unit {unit!r} of the distance is not a unit of length, such as mm; {how}"
        )
    return Column(index=index, title=title, unit="m", factor=parse_unit(str(unit_in_words(unit))).factor)


def _refuse_logarithms(table: TextTable, title: str) -> None:
    if is_logarithmic(title):
        raise CalibrationDataError(
            f"{table.place}: the column {quoted(title)} has logarithms, but a curve needs the output itself. "
            "Convert the readings: 10^(x/20) for a voltage in dB, 10^(x/10) for a power in dB, e^x for ln, and 10^x "
            "for log",
            problem=f"{table.place}: the output column has logarithms",
        )


def _refuse_two_units(table: TextTable, title: str) -> None:
    """Raise an error if a header such as `distance_cm [mm]` has two units."""
    name, unit = split_title(title)
    other = split_title(name)[1]
    if unit and other and other != unit and is_length(other):
        raise CalibrationDataError(
            f"{table.place}: the header {quoted(title)} has two units; write only the unit of the distances",
            problem=f"{table.place}: a header has two units",
        )
    scaled = re.fullmatch(r"([\d.,]+(?:e[-+]?\d+)?)\s*(\D+)", unit or "", re.IGNORECASE)
    if scaled and is_length(scaled[2]):
        raise CalibrationDataError(
            f"{table.place}: the unit {unit!r} of the distance contains a number; multiply the distances by "
            f'{scaled[1]}, and write "{name} [{unit_in_words(scaled[2])}]"',
            problem=f"{table.place}: the unit of the distance contains a number",
        )


def _output_column(table: TextTable, outputs: Sequence[int], option: ColumnOption) -> tuple[Column, list[str]]:
    title, notes = table.header[outputs[0]], []
    _refuse_logarithms(table, title)
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


def _understood(
    table: TextTable,
    options: ColumnOptions,
    distance_column: Column,
    output_column: Column,
    outputs: Sequence[int],
) -> list[str]:
    """Return a sentence on the columns, units and signs of a table that are not written as pretouch writes them."""
    parts, is_assumed = [], table.decimal_mark == ","
    for what, column, option in (
        ("distance", distance_column, options.distance),
        ("output", output_column, options.output),
    ):
        unit = option.unit_with(column.title)
        written = (
            unit is None or option.unit is not None or any(f"{a}{unit}{b}" in column.title for a, b in ("[]", "()"))
        )
        is_assumed |= not written
        known = unit_in_words(unit) if unit else None
        titles = [column.title] if what == "distance" else [table.header[i] for i in outputs]
        listed = join_first([quoted(title) for title in titles], _SHOWN)
        parts.append(f"{what} from {listed}{f' [{known}]' if known else ''}")
    if not is_assumed:
        return []
    signs = (
        f"{DELIMITERS.get(table.delimiter, repr(table.delimiter))} separate the columns, the comma is the decimal sign"
    )
    return [f"Read: {', '.join(parts)}{f'; {signs}' if table.decimal_mark == ',' else ''}."]


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
        elif is_named(title, "statistic"):
            reason = "it describes averaged readings"
        elif is_named(title, "remark") and _is_on_few(table, i, distance):
            reason = "it has remarks on single readings. If they tell curves apart, name it with --labels"
        elif title == TIME_OF_LINE or (_is_time(title) and _drifts(table, i, distance)):
            reason = "it is a time"
        elif _is_measured(table, i) and _drifts(table, i, distance):
            reason = "it changes within the curve"
        elif _wobbles(table, i):
            reason = "it is a measured quantity whose values scatter"
        if reason:
            notes.append(f"Column {table.title(i)} is not used: {reason}.")
        else:
            labels.append(i)
    return tuple(labels), notes


def _is_on_few(table: TextTable, index: int, distance: int) -> bool:
    """Return True if some texts of a column are at too few distances for a curve."""
    return any(len(distances) < _FEW for distances in _distances_by_cell(table, index, distance).values())


def _wobbles(table: TextTable, index: int) -> bool:
    """Return True if a column has a measured quantity that hardly changes, or has both signs, such as a speed."""
    cells = {cell for cell in table.columns[index] if not is_missing(cell)}
    if len(cells) < _FEW or not all(map(is_number, cells)):
        return False
    numbers = table.numbers(index)
    low, high = float(np.nanmin(numbers)), float(np.nanmax(numbers))
    has_fractions = bool(np.any(numbers[np.isfinite(numbers)] % 1 != 0))
    return (has_fractions and low < 0 < high) or high - low < _SCATTER * abs(high + low) / 2


def _is_time(title: str) -> bool:
    return is_named(title, "time") or dimension(split_title(title)[1]) == TIME


def _is_measured(table: TextTable, index: int) -> bool:
    """Return True if a column has a setting, an output or other numbers, which tell no curves apart if they drift."""
    cells = [cell for cell in table.columns[index] if not is_missing(cell)]
    title = table.header[index]
    named = is_named(title, "setting") or is_output_unit(split_title(title)[1])
    return named or (bool(cells) and not _may_be_label(table, index))


def _drifts(table: TextTable, index: int, distance: int) -> bool:
    """Return True if a column cannot be a label. Most values of such a column occur at too few distances."""
    distances_of = _distances_by_cell(table, index, distance)
    few = sum(len(distances) < _FEW for distances in distances_of.values())
    return len(distances_of) > 1 and 2 * few > len(distances_of)


def _distances_by_cell(table: TextTable, index: int, distance: int) -> dict[str, set[str]]:
    distances: dict[str, set[str]] = {}
    for cell, distance_cell in zip(table.columns[index], table.columns[distance], strict=True):
        distances.setdefault(cell, set()).add(distance_cell)
    return distances


_BRACKETS = re.compile(r"([^\[\]()]*)[\[(]\s*([^\[\]()]*)\s*[\])]")


def wide_layout(table: TextTable, options: ColumnOptions) -> Layout | None:
    """Find the columns of a table whose column headers are distances.

    The result is None for a long table. An option that selects a column implies a long table.

    Returns:
        The layout.
    """
    if options.names_a_column or not looks_wide(table.header, declared=options.declares_distances):
        return None
    if _begins_with_a_row(table):
        return None
    marks = {i: mark for i, title in enumerate(table.header) if (mark := distance_mark(title))}
    others = [i for i in range(len(table.header)) if i not in marks]
    if not options.declares_distances:
        _refuse_ambiguity(table, marks, others)
    unit = _distance_unit(table, options, marks, others)
    symbol, factor, notes = _output_unit(table, options, marks, others)
    counts = [i for i in others if _counts_rows(table, i) or _names_outputs(table, i)]
    places = [table.header[i] for i, mark in marks.items() if mark.number is not None]
    unit_text = "" if any(mark.unit for mark in marks.values()) else f" in {unit}"
    span = f"{places[0]} to {places[-1]}{unit_text}" if places else "none"
    filled = [table.title(i) for i in counts if any(table.columns[i]) and not _names_outputs(table, i)]
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
            f"the headers, use {columns_hint('distance=[UNIT]')}"
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
            f"{columns_hint('distance=[UNIT]')}"
        )
    return corner[0]


def _units(title: str) -> list[tuple[str, str]]:
    """Return all names and units in a column header. The header in the corner may contain two pairs."""
    units = [(name, unit.strip()) for name, unit in _BRACKETS.findall(title)]
    name, unit = split_title(title)
    return units or ([("" if name == unit else name, unit)] if unit else [("", title)])


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
        named = next(iter(table.columns[i]), "") if _names_outputs(table, i) else ""
        unit_text = unit_text or split_title(named)[1]
    if unit_text is not None:
        return (*output_unit(unit_text), [])
    symbol, meaning = default_output_unit(set().union(*(table.columns[i] for i in marks)))
    return symbol, 1.0, [f"The sensor outputs have no unit, so their values are interpreted as {meaning}."]


def _names_outputs(table: TextTable, index: int) -> bool:
    """Return True if a column says in words that the cells are outputs, as in a table that was turned."""
    cells = set(table.columns[index])
    return len(cells) == 1 and all(is_named(cell, "output") for cell in cells)


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
        unknown = np.empty(0)
        raise CalibrationDataError(f"{message}, which must not be negative; {if_negative(unknown, unknown)}")
    if not (math.isfinite(value) and has_workable_magnitude(value)):
        raise CalibrationDataError(f"{message}, expected a number {WORKABLE} (in m)")
    return value


def output_column(table: TextTable, index: int, layout: Layout) -> Column:
    """Return the output column of a file with no-object readings.

    Readings in another unit than that of the calibration are an error.

    Raises:
        CalibrationDataError: the unit is another one.
    """
    title = table.header[index]
    header_unit = split_title(title)[1]
    symbol, factor = output_unit(header_unit) if header_unit else (layout.unit, layout.pairs[0][1].factor)
    if symbol != layout.unit:
        raise CalibrationDataError(
            f"{table.place}: found readings in the unit {header_unit!r}, expected readings in the unit of the "
            f"calibration ({layout.unit or 'none'!r})"
        )
    return Column(index=index, title=title, unit=symbol, factor=factor)
