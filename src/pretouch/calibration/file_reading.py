"""Read calibration curves from a text table such as CSV."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import CalibrationDataError
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import format_quantity
from pretouch.tables.cells import Column, TextTable, is_missing, is_no_object, number
from pretouch.tables.column_options import find_label_columns, parse_column_options
from pretouch.tables.names import split_title
from pretouch.tables.text_table import read_table

from .data import Calibration, Provenance, if_negative, if_positions
from .table_layout import Layout, long_layout, output_column, refuse_quantities_in_rows, wide_layout

_FEW: Final = 5  # number of distances from which on a stray one is searched for
_NEAR: Final = 5e-3  # largest distance [m] of a calibration below which its unit is doubted
_FAR: Final = 5.0  # the same, above
_STRAY: Final = 50.0  # smallest ratio of a stray distance to the next smaller distance
_SENSOR: Final = "sensor"  # label of curves whose outputs are in columns side by side
_COLUMN: Final = "column"  # the same, if the file has labels of that name
_REMEMBERED: Final = 10_000  # cells of a column whose numbers are cached, since distances and counts repeat

NoObject: TypeAlias = "float | Sequence[float] | FloatArray | str | os.PathLike[str] | None"


@check_arguments
def read_calibration(
    path: str | os.PathLike[str],
    *,
    no_object: NoObject = None,
    select: Mapping[str, object] | None = None,
    columns: Mapping[str, str | int] | None = None,
    labels: Sequence[str | int] | None = None,
) -> Calibration:
    r"""Read one sensor calibration from a text file.

    The file is a table with a header and units: long, `distance [mm],output [V]`, or wide, with a column for each
    distance, `0 mm,5 mm,inf`. The delimiter is a comma, semicolon, tab or blanks; decimal commas are understood unless
    the delimiter is a comma. Repeats are rows. A distance `inf`, `none`, `no object` or an empty one marks readings
    without an object. Empty and NaN outputs are counted and dropped. Lines that start with `#`, blank lines and text
    above the header are skipped. Other columns are labels. docs/explanation/calibration.md describes the format in
    full.

    Args:
        path: the file.
        no_object: readings without an object, in the unit of the output (V for mV): one number, several, or the path
            of a file with such readings; they are added to those in the file.
        select: values of label columns that select the curve, such as `{"sensor": "1"}`.
        columns: the `distance` and the `output` column, if names and units do not identify them: a header, a number
            counted from 1, a unit in brackets, or a header or number with a unit: `{"output": "3 [counts]"}`.
        labels: headers or numbers of the label columns; by default, all that are neither distance nor output.

    Returns:
        The calibration in SI units, with its provenance.

    Raises:
        CalibrationDataError: the file has a mistake (the message names the line), or no or several curves match.

    Examples:
        >>> import tempfile, pathlib
        >>> file = pathlib.Path(tempfile.mkdtemp()) / "sensor.csv"
        >>> _ = file.write_text("distance [mm];output [V]\n0;2,0\n10;1,0\ninf;0,1\n", encoding="utf-8")
        >>> measured = read_calibration(file)
        >>> measured.distances, measured.no_object
        (array([0.  , 0.01]), array([0.1]))
    """
    curves = _curves(path, no_object, columns, labels)
    wanted = {key: str(value).strip() for key, value in (select or {}).items()}
    keys = {key: None for curve_labels, _ in curves for key in curve_labels}
    for key in wanted:
        if key not in keys:
            available = ", ".join(sorted(keys)) or "none, because the file contains one curve"
            raise CalibrationDataError(
                f"select: the file has no label column named {key!r}; available label columns: {available}"
            )
    selected = [curve for curve_labels, curve in curves if wanted.items() <= curve_labels.items()]
    if len(selected) == 1:
        return selected[0]
    values = "; ".join(f"{k}: {', '.join(dict.fromkeys(curve_labels[k] for curve_labels, _ in curves))}" for k in keys)
    raise CalibrationDataError(
        f"{Path(path).name}: the file contains {len(selected)} curves{f' for {wanted}' if wanted else ''}, but "
        f"exactly one is needed. Choose one curve by its labels with select={{...}}. The labels are {values}"
    )


@check_arguments
def read_calibrations(
    path: str | os.PathLike[str],
    *,
    no_object: NoObject = None,
    columns: Mapping[str, str | int] | None = None,
    labels: Sequence[str | int] | None = None,
) -> tuple[Calibration, ...]:
    """Read all calibrations of a file.

    There is one calibration for each combination of values in the label columns.

    Args:
        path: the file, in the format of `read_calibration`.
        no_object: readings without an object, added to every curve.
        columns: the `distance` and the `output` column, if names and units do not identify them: a header, a number
            counted from 1, a unit in brackets, or a header or number with a unit: `{"output": "3 [counts]"}`.
        labels: headers or numbers of the label columns; by default, all that are neither distance nor output.

    Returns:
        The calibrations in the order of their first rows.
    """
    return tuple(curve for _, curve in _curves(path, no_object, columns, labels))


def _curves(
    path: str | os.PathLike[str],
    no_object: NoObject,
    columns: Mapping[str, str | int] | None,
    labels: Sequence[str | int] | None,
) -> list[tuple[dict[str, str], Calibration]]:
    """Read all calibrations of a file with their labels."""
    options = parse_column_options(columns)
    table = read_table(path, options)
    refuse_quantities_in_rows(table)
    layout = wide_layout(table, options) or long_layout(table, options)
    used = {column.index for pair in layout.pairs for column in pair if isinstance(column, Column)}
    label_columns = layout.labels if labels is None else find_label_columns(table, labels)
    label_columns = tuple(i for i in label_columns if i not in used)
    readings = _readings(table, layout)
    groups, shared = _rows_by_label(table, label_columns, readings.distances)
    _refuse_merged_cells(table, layout, groups)
    if not groups:
        raise CalibrationDataError.without_content(
            f"{table.file}: the table has a header but no rows below the header; add rows with distances and "
            "sensor outputs"
        )
    repeats = 1 if layout.sensors else len(layout.pairs)
    if labels is None and len(groups) > 3 and max(map(len, groups.values())) * repeats == 1:
        titles = ", ".join(repr(table.name(i)) for i in label_columns)
        raise CalibrationDataError(
            f"{table.file}: every row has a different label (label columns: {titles}). Therefore, each curve would "
            "have only one reading. Name the label columns with --labels NAME,NAME, or use --labels none. In Python "
            "and in scenario files, the option labels is a list of names"
        )
    extra = _no_object_readings(no_object, layout)
    names = tuple(table.name(i) for i in label_columns)
    curves = []
    for key, rows in groups.items():
        group = dict(zip(names, key, strict=True))
        if not layout.sensors:
            curves.append((group, _curve(table, layout, group, readings.of(rows, shared), extra)))
        for k, sensor in enumerate(layout.sensors):
            curve_labels = {**group, _SENSOR if _SENSOR not in group else _COLUMN: sensor}
            column = replace(layout, outputs=layout.pairs[k][1].title)
            curves.append((curve_labels, _curve(table, column, curve_labels, readings.pair(k).of(rows, shared), extra)))
    return curves


class _Readings(NamedTuple):
    """Distances and sensor outputs from a calibration table.

    A missing output is NaN. Both have the shape (rows, pairs). A distance is infinite if no object was in range.
    """

    distances: FloatArray
    outputs: FloatArray

    def pair(self, index: int) -> _Readings:
        """Return the readings of one pair of columns."""
        return _Readings(self.distances[:, [index]], self.outputs[:, [index]])

    def of(self, rows: Sequence[int], shared: Sequence[int]) -> _Readings:
        """Return the readings of selected table rows.

        The no-object readings that all curves share are included.

        A row without any label belongs to all curves if it has no object.
        """
        row_indices, shared_indices = (np.array(indices, dtype=np.int64) for indices in (rows, shared))
        without_object = np.isinf(self.distances[shared_indices])
        own = ~np.isin(row_indices, shared_indices)[:, None] | ~np.isinf(self.distances[row_indices])
        return _Readings(
            *(
                np.concatenate([column[row_indices][own], column[shared_indices][without_object]])
                for column in (self.distances, self.outputs)
            )
        )


def _rows_by_label(
    table: TextTable, columns: Sequence[int], distances: FloatArray
) -> tuple[dict[tuple[str, ...], Sequence[int]], Sequence[int]]:
    """Group the rows of a table by their labels. Also return the rows that belong to all groups."""
    if not columns:
        return ({(): range(len(distances))} if len(distances) else {}), ()
    groups: dict[tuple[str, ...], list[int]] = {}
    shared = []
    for i, key in enumerate(zip(*(table.written_columns[k] for k in columns), strict=True)):
        if any(key) and not (all(map(is_no_object, key)) and np.isinf(distances[i]).all()):
            groups.setdefault(key, []).append(i)
            continue
        if np.isinf(distances[i]).any():
            shared.append(i)
        if not np.isinf(distances[i]).all():
            groups.setdefault(key, []).append(i)
    empty = [key for key, rows in groups.items() if np.isinf(distances[rows]).all()]
    if len(empty) < len(groups):  # the readings of the empty scene have a label of their own
        shared += [i for key in empty for i in groups.pop(key)]
    return dict(groups), sorted(shared)


def _refuse_merged_cells(table: TextTable, layout: Layout, groups: Mapping[tuple[str, ...], Sequence[int]]) -> None:
    """Raise an error if distances are missing below others several times, as in a spreadsheet with merged cells."""
    distance = layout.pairs[0][0]
    if isinstance(distance, float):
        return
    cells = table.columns[distance.index]
    for rows in groups.values():
        is_empty = [not cells[i] for i in rows]
        starts = [k for k in range(1, len(is_empty)) if is_empty[k] and not is_empty[k - 1]]
        if len(starts) > 1:
            line = table.lines[rows[starts[0]]]
            raise CalibrationDataError(
                f"{table.file}, line {line}: {sum(is_empty)} cells of the distance are empty below others. If cells "
                "were merged, write the distance into each row; for a reading without an object, write inf",
                problem=f"{table.file}, line {line}: distances are missing below others",
            )


def _readings(table: TextTable, layout: Layout) -> _Readings:
    """Read all distances and outputs of a table."""
    shape = (len(table.lines), len(layout.pairs))
    distances, outputs = np.empty(shape), np.empty(shape)
    bad = len(table.lines)
    numbers: dict[int, tuple[FloatArray, int]] = {}  # one distance column may belong to several output columns
    for k, (distance, output) in enumerate(layout.pairs):
        for column, read, target in ((distance, _distance, distances), (output, _output, outputs)):
            if isinstance(column, float):
                target[:, k] = column
                continue
            if column.index not in numbers:
                numbers[column.index] = _numbers(table, column, read)
            target[:, k], stop = numbers[column.index]
            bad = min(bad, stop)
    if bad < len(table.lines):
        _refuse_negative(table, layout, distances[: bad + 1], outputs[: bad + 1])
        line, row = table.lines[bad], table.row(bad)
        for distance, output in layout.pairs:  # reading the invalid cell again raises its error
            if not isinstance(distance, float):
                _distance(table, line, row[distance.index], distance)
            _output(table, line, row[output.index], output)
    _refuse_negative(table, layout, distances, outputs)
    return _Readings(distances, outputs)


def _refuse_negative(table: TextTable, layout: Layout, distances: FloatArray, outputs: FloatArray) -> None:
    """Raise an error if a distance is negative."""
    if not (distances < 0).any():
        return
    row, pair = np.argwhere(distances < 0)[0].tolist()
    place, column = f"{table.file}, line {table.lines[row]}", layout.pairs[pair][0]
    cell = f"{distances[row, pair]:g} m" if isinstance(column, float) else table.columns[column.index][row]
    raise CalibrationDataError(
        f"{place}: found the distance {cell}, but distances must not be negative; "
        f"{if_negative(distances.ravel(), outputs.ravel())}",
        problem=f"{place}: found a negative distance, but a distance must be zero or positive",
    )


def _numbers(table: TextTable, column: Column, read: Callable[..., float]) -> tuple[FloatArray, int]:
    """Read the numbers of a table column up to its first invalid cell; also return the index of its row."""
    cells = table.columns[column.index]
    values = np.full(len(cells), np.nan)
    cache: dict[str, float] = {}
    for i, cell in enumerate(cells):
        value = cache.get(cell)
        if value is None:
            try:
                value = read(table, 0, cell, column)
            except CalibrationDataError:
                return values, i
            if len(cache) < _REMEMBERED:
                cache[cell] = value
        values[i] = value
    return values, len(cells)


def _distance(table: TextTable, line: int, cell: str, column: Column) -> float:
    """Read a distance from a table cell. The distance is infinite if no object was in range."""
    return math.inf if is_no_object(cell) else number(table, line, cell, column)


def _output(table: TextTable, line: int, cell: str, column: Column) -> float:
    """Read a sensor output from a table cell. A missing output is NaN."""
    return math.nan if is_missing(cell) else number(table, line, cell, column)


def _curve(
    table: TextTable, layout: Layout, labels: dict[str, str], readings: _Readings, extra: list[float]
) -> Calibration:
    present = ~np.isnan(readings.outputs)
    without_object = np.isinf(readings.distances)
    label = ", ".join(f"{name}={value}" for name, value in labels.items())
    dropped = int((~present).sum())
    missing = f"Number of rows or cells without an output (empty, nan or -): {dropped}. They are not used."
    _refuse_stray_distance(table, readings.distances[present & ~without_object])
    farthest = float(np.max(readings.distances[present & ~without_object], initial=0.0))
    doubt = f"The largest distance is {format_quantity(farthest, 'm')}: check the unit of the distances."
    places = np.unique(readings.distances[present & ~without_object])
    is_doubtful = places.size >= _FEW and not _NEAR <= farthest <= _FAR
    is_shifted = places.size >= _FEW and places[0] > places[-1] - places[0]
    shift = (
        f"The readings start at {format_quantity(float(places[0]), 'm')}, and end at {format_quantity(farthest, 'm')}. "
        "If these are positions, such as those of a stage, and not distances from contact, "
        f"{if_positions(readings.distances, readings.outputs)}."
        if is_shifted
        else ""
    )
    if not (present & ~without_object).any():
        raise CalibrationDataError(
            f"{table.file}{f', {label}' if label else ''}: every reading was taken without an object; add at "
            "least one reading with an object in range",
            problem=f"{table.file}: every reading was taken without an object, but at least one reading with an object "
            "in range is needed",
        )
    return Calibration(
        distances=readings.distances[present & ~without_object],
        outputs=readings.outputs[present & ~without_object],
        unit=layout.unit,
        no_object=np.concatenate([extra, readings.outputs[present & without_object]]),
        label=label,
        source=Provenance(
            file=table.file,
            sha256=table.sha256,
            encoding=table.encoding,
            delimiter=table.delimiter,
            decimal_mark=table.decimal_mark,
            distance_column=layout.distances,
            output_column=layout.outputs,
            label_columns=tuple(labels),
            rows=len(present),
            dropped=dropped,
            notes=(
                *table.notes,
                *table.lost,
                *((missing,) if dropped else ()),
                *layout.notes,
                *((doubt,) if is_doubtful else ()),
                *((shift,) if shift else ()),
            ),
        ),
    )


def _refuse_stray_distance(table: TextTable, distances: FloatArray) -> None:
    """Raise an error for a distance far beyond all others. Such a distance is a typing error or means "no object"."""
    distinct = np.unique(distances)
    if len(distinct) < _FEW or distinct[-1] <= _STRAY * distinct[-2]:
        return
    message = (
        f"{table.file}: the distance {distinct[-1]:g} m is implausible. It is "
        f"{distinct[-1] / distinct[-2]:,.0f} times the next smaller distance of {distinct[-2]:g} m. Correct the "
        "distance, or write inf if no object was present"
    )
    raise CalibrationDataError(message, problem=f"{table.file}: found one distance far beyond all others")


def _no_object_readings(no_object: NoObject, layout: Layout) -> list[float]:
    """Return the no-object readings from outside the calibration file.

    The readings are in the unit of the calibration.

    Raises:
        CalibrationDataError: the readings have another unit.
    """
    if no_object is None:
        return []
    if not isinstance(no_object, (str, os.PathLike)):
        return [float(v) for v in np.atleast_1d(finite(no_object, "no_object", layout.unit)).ravel()]
    table = read_table(no_object)
    index = len(table.header) - 1
    if len(table.header) > 1:
        names = [split_title(title)[0] for title in table.header]
        wanted = split_title(layout.pairs[0][1].title)[0]
        if wanted not in names:
            raise CalibrationDataError(
                f"{table.place}: found {len(names)} columns, expected a single column of readings, or a column named "
                f"{wanted!r}"
            )
        index = names.index(wanted)
    cells = list(zip(table.lines, table.columns[index], strict=True))
    column = output_column(table, index, layout)
    if not any(c.isalpha() for c in column.title):  # a bare list of numbers has no header
        cells.insert(0, (table.header_line, table.header[index]))
    return [number(table, line, cell, column) for line, cell in cells if not is_missing(cell)]
