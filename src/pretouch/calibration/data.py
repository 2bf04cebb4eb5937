"""What was measured: distances, outputs and no-object readings, where they come from, and how files are read."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import CalibrationDataError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import MAGNITUDES, WORKABLE
from pretouch._core.values import Value

from .choice import chosen_labels, read_choice
from .csv_file import read_table
from .headers import Column, Layout, TextTable, is_missing, is_no_object, number, output_column, split_title
from .table_layout import long_layout, wide_layout

_FEW = 5  # distances, from which on one can be far beyond all others
_STRAY = 50.0  # times as far as the next one
_REMEMBERED = 10_000  # texts of a column: distances and counts come again and again


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance(Value):
    """Where a calibration was read from, and every decision that reading it took.

    Args:
        file: name of the file.
        sha256: SHA-256 of its bytes, in hexadecimal digits.
        encoding: the text encoding it was read with.
        delimiter: what separates its columns.
        decimal_mark: `.` or `,`.
        distance_column: header of the column taken as distance.
        output_column: header of the column taken as output.
        label_columns: headers of the columns that tell the curves of the file apart.
        rows: rows of numbers that belong to this curve, dropped ones included.
        dropped: rows whose output was empty or NaN; they are not used.
        notes: what had to be assumed, in sentences.
    """

    file: str
    sha256: str
    encoding: str
    delimiter: str
    decimal_mark: str
    distance_column: str
    output_column: str
    label_columns: tuple[str, ...] = ()
    rows: int
    dropped: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Calibration(Value):
    """Readings of one sensor in front of one object, at known distances.

    Args:
        distances: l of every reading [m], shape (N,), not negative; repeats are repeated distances, in any order.
        outputs: y of every reading, shape (N,), in `unit`.
        unit: unit of the outputs, such as `V` or `counts`; empty where it has none.
        no_object: readings with no object in range, shape (M,), in `unit`; may be empty.
        label: what tells this curve from others of the same file, such as `day=30, sensor=1`.
        source: the file it was read from; None for numbers that came from Python.

    Raises:
        CalibrationDataError: the columns differ in length, are empty, or hold numbers that are not finite or beyond
            MAGNITUDES, or a distance is negative.

    Examples:
        >>> measured = Calibration(distances=[0.0, 0.01, 0.01], outputs=[2.0, 1.0, 1.2], unit="V")
        >>> measured.distinct_distances
        array([0.  , 0.01])
    """

    distances: FloatArray = field(metadata={"checked": False})  # by _column
    outputs: FloatArray = field(metadata={"checked": False})
    unit: str = ""
    no_object: FloatArray = field(default_factory=lambda: np.empty(0), metadata={"checked": False})
    label: str = ""
    source: Provenance | None = None

    def __post_init__(self) -> None:
        check_types(self)
        for name, unit in (("distances", "m"), ("outputs", self.unit), ("no_object", self.unit)):
            object.__setattr__(self, name, _column(getattr(self, name), name, unit))
        if len(self.distances) != len(self.outputs):
            raise CalibrationDataError(f"outputs: found {len(self.outputs)} values for {len(self.distances)} distances")
        if not len(self.distances):
            raise CalibrationDataError("distances: found none, expected at least one reading with an object in range")
        if self.distances.min() < 0:
            raise CalibrationDataError(
                f"distances: found {self.distances.min():g} m, which must not be negative: l is measured from the "
                "sensor (or the contact surface) to the object"
            )

    @property
    def distinct_distances(self) -> FloatArray:
        """The distances [m] at which there are readings, in increasing order, each once."""
        return np.unique(self.distances)

    def __repr__(self) -> str:
        readings = f"{len(self.outputs)} readings at {len(self.distinct_distances)} distances"
        return f"<Calibration {self.name}: {readings}, {len(self.no_object)} without an object>"

    @property
    def name(self) -> str:
        """File and label, for titles."""
        parts = [self.source.file if self.source else "", self.label]
        return ", ".join(part for part in parts if part) or "calibration"


def _column(values: ArrayLike, name: str, unit: str) -> FloatArray:
    try:
        column = np.atleast_1d(finite(values, name, unit))
    except ValueError as error:
        raise CalibrationDataError(str(error)) from None
    if column.ndim != 1:
        raise CalibrationDataError(f"{name}: found an array of shape {column.shape}, expected one column")
    column = np.array(column, dtype=np.float64)
    size = np.abs(column)
    beyond = column[(size != 0) & ~((size >= MAGNITUDES[0]) & (size <= MAGNITUDES[1]))]
    if beyond.size:
        raise CalibrationDataError(f"{name}: found {f'{beyond[0]:g} {unit}'.rstrip()}, expected numbers {WORKABLE}")
    column.setflags(write=False)
    return column


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
    r"""Read the one calibration of a file, or the one that `select` names.

    The file is a table with a header that carries units: long, `distance [mm],output [V]`, or wide, with columns
    named by distance, `0 mm,5 mm,inf`. Columns are separated by comma, semicolon, tab or blanks; with all but the
    first, decimal commas are understood. Repeats are rows. A distance that is `inf`, empty, `none` or `no object`
    has no-object readings; an output that is empty or NaN is counted and dropped. Lines that start with `#`, blank
    lines and lines of text above the header are skipped. Further columns are labels. docs/calibration.md has the
    whole of it.

    Args:
        path: the file.
        no_object: readings without an object, in the unit of the output (V where that is mV): one number, several,
            or the path of a file that holds them; they add to those in the file.
        select: value of each label column that tells the wanted curve from the others, such as `{"sensor": "1"}`.
        columns: the `distance` and the `output` column, where names and units do not tell: a header, a number
            counted from 1, a unit in brackets, or one of the former with a unit: `{"output": "3 [counts]"}`.
        labels: headers or numbers of the label columns; all that are neither distance nor output where None.

    Returns:
        The calibration, in SI, with its provenance.

    Raises:
        CalibrationDataError: the file has a mistake (the message names the line), or holds no or several such curves.

    Examples:
        >>> import tempfile, pathlib
        >>> file = pathlib.Path(tempfile.mkdtemp()) / "sensor.csv"
        >>> _ = file.write_text("distance [mm];output [V]\n0;2,0\n10;1,0\ninf;0,1\n", encoding="utf-8")
        >>> measured = read_calibration(file)
        >>> measured.distances, measured.no_object
        (array([0.  , 0.01]), array([0.1]))
    """
    found = _curves(path, no_object, columns, labels)
    wanted = {key: str(value).strip() for key, value in (select or {}).items()}
    keys = {key: None for told, _ in found for key in told}
    for key in wanted:
        if key not in keys:
            known = ", ".join(sorted(keys)) or "none: the file holds one curve"
            raise CalibrationDataError(f"select: found {key!r}, expected a label column ({known})")
    chosen = [curve for told, curve in found if all(told[k] == v for k, v in wanted.items())]
    if len(chosen) == 1:
        return chosen[0]
    values = "; ".join(f"{k}: {', '.join(dict.fromkeys(told[k] for told, _ in found))}" for k in keys)
    raise CalibrationDataError(
        f"{Path(path).name}: found {len(chosen)} curves{f' for {wanted}' if wanted else ''}, expected one: choose with "
        f"select={{...}} among {values}"
    )


@check_arguments
def read_calibrations(
    path: str | os.PathLike[str],
    *,
    no_object: NoObject = None,
    columns: Mapping[str, str | int] | None = None,
    labels: Sequence[str | int] | None = None,
) -> tuple[Calibration, ...]:
    """Read every calibration of a file, as `read_calibration` does: one per combination of its label columns.

    Args:
        path: the file, as `read_calibration` describes it.
        no_object: readings without an object, added to every curve.
        columns: the `distance` and the `output` column, where names and units do not tell: a header, a number
            counted from 1, a unit in brackets, or one of the former with a unit: `{"output": "3 [counts]"}`.
        labels: headers or numbers of the label columns; all that are neither distance nor output where None.

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
    """Read every calibration of a file, each with the values of its label columns by their names."""
    choice = read_choice(columns)
    table = read_table(path, choice)
    layout = wide_layout(table, choice) or long_layout(table, choice)
    used = {column.index for pair in layout.pairs for column in pair if isinstance(column, Column)}
    label_columns = layout.labels if labels is None else chosen_labels(table, labels)
    label_columns = tuple(i for i in label_columns if i not in used)
    readings = _readings(table, layout)
    groups, shared = _rows_by_label(table, label_columns, readings.distances)
    if not groups:
        raise CalibrationDataError.without_content(
            f"{table.file}: found no rows below the header, expected distances and outputs"
        )
    if labels is None and len(groups) > 3 and max(map(len, groups.values())) * len(layout.pairs) == 1:
        found = ", ".join(repr(table.name(i)) for i in label_columns)
        raise CalibrationDataError(
            f"{table.file}: found another value of {found} in every row, which leaves one reading per curve: name the "
            "label columns with --labels NAME,NAME, or say --labels none (in a scenario file and in Python: labels, a "
            "list, which may be empty)"
        )
    extra = _no_object_readings(no_object, layout)
    names = tuple(table.name(i) for i in label_columns)
    told = [dict(zip(names, key, strict=True)) for key in groups]
    curves = zip(told, groups.values(), strict=True)
    return [(of, _curve(table, layout, of, readings.of(rows, shared), extra)) for of, rows in curves]


class _Readings(NamedTuple):
    """Outputs, shape (rows, pairs), NaN where one is missing, and their distances, infinite where no object is."""

    distances: FloatArray
    outputs: FloatArray

    def of(self, rows: Sequence[int], shared: Sequence[int]) -> _Readings:
        """Return the readings of some rows, and those without an object of rows that are shared."""
        # A row without any label belongs to all curves, where it has no object.
        own, added = (np.array(indices, dtype=np.int64) for indices in (rows, shared))
        common = np.isinf(self.distances[added])
        kept = ~np.isin(own, added)[:, None] | ~np.isinf(self.distances[own])
        return _Readings(
            *(np.concatenate([column[own][kept], column[added][common]]) for column in (self.distances, self.outputs))
        )


def _rows_by_label(
    table: TextTable, columns: Sequence[int], distances: FloatArray
) -> tuple[dict[tuple[str, ...], Sequence[int]], Sequence[int]]:
    """Sort rows by their labels, in the order of the file; return those without any label that have no object."""
    if not columns:
        return ({(): range(len(distances))} if len(distances) else {}), ()
    groups: dict[tuple[str, ...], list[int]] = {}
    shared = []
    for i, key in enumerate(zip(*(table.columns[k] for k in columns), strict=True)):
        if any(key):
            groups.setdefault(key, []).append(i)
            continue
        if np.isinf(distances[i]).any():
            shared.append(i)
        if not np.isinf(distances[i]).all():
            groups.setdefault(key, []).append(i)
    return dict(groups), shared


def _readings(table: TextTable, layout: Layout) -> _Readings:
    """Read every cell of distances and outputs; refuse the first row in which one cannot be read."""
    shape = (len(table.lines), len(layout.pairs))
    distances, outputs = np.empty(shape), np.empty(shape)
    bad = len(table.lines)
    known: dict[int, FloatArray | int] = {}  # columns of distances serve several columns of outputs
    for k, (where, what) in enumerate(layout.pairs):
        for column, read, target in ((where, _distance, distances), (what, _output, outputs)):
            if isinstance(column, float):
                target[:, k] = column
                continue
            if column.index not in known:
                known[column.index] = _numbers(table, column, read)
            found = known[column.index]
            if isinstance(found, int):
                bad = min(bad, found)
            else:
                target[:, k] = found
    if bad < len(table.lines):
        line, row = table.lines[bad], table.row(bad)
        for where, what in layout.pairs:  # the first cell of the row that cannot be read says so
            if not isinstance(where, float):
                _distance(table, line, row[where.index], where)
            _output(table, line, row[what.index], what)
    return _Readings(distances, outputs)


def _numbers(table: TextTable, column: Column, read: Callable[..., float]) -> FloatArray | int:
    """Read a column, the most frequent texts in it once; where a cell cannot be read, return its row."""
    cells = table.columns[column.index]
    found = np.empty(len(cells))
    known: dict[str, float] = {}
    for i, cell in enumerate(cells):
        value = known.get(cell)
        if value is None:
            try:
                value = read(table, 0, cell, column)
            except CalibrationDataError:
                return i
            if len(known) < _REMEMBERED:
                known[cell] = value
        found[i] = value
    return found


def _distance(table: TextTable, line: int, cell: str, column: Column) -> float:
    """Read a distance, infinite where no object is."""
    value = math.inf if is_no_object(cell) else number(table, line, cell, column)
    if value < 0:
        raise CalibrationDataError(
            f"{table.file}, line {line}: found the distance {cell}, which must not be negative",
            problem=f"{table.file}, line {line}: found a distance that is negative",
        )
    return value


def _output(table: TextTable, line: int, cell: str, column: Column) -> float:
    """Read an output, NaN where it is missing."""
    return math.nan if is_missing(cell) else number(table, line, cell, column)


def _curve(
    table: TextTable, layout: Layout, labels: dict[str, str], readings: _Readings, extra: list[float]
) -> Calibration:
    there = ~np.isnan(readings.outputs)
    empty = np.isinf(readings.distances)
    label = ", ".join(f"{name}={value}" for name, value in labels.items())
    _refuse_stray_distance(table, readings.distances[there & ~empty])
    if not (there & ~empty).any():
        raise CalibrationDataError(
            f"{table.file}{f', {label}' if label else ''}: found no reading with an object in range, expected at "
            "least one",
            problem=f"{table.file}: found no reading with an object in range, expected at least one",
        )
    return Calibration(
        distances=readings.distances[there & ~empty],
        outputs=readings.outputs[there & ~empty],
        unit=layout.unit,
        no_object=np.concatenate([extra, readings.outputs[there & empty]]),
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
            rows=len(there),
            dropped=int((~there).sum()),
            notes=(*table.notes, *layout.notes),
        ),
    )


def _refuse_stray_distance(table: TextTable, distances: FloatArray) -> None:
    """Refuse one distance far beyond all others: a typing error, or a number that stands for no object."""
    found = np.unique(distances)
    if len(found) < _FEW or found[-1] <= _STRAY * found[-2]:
        return
    told = (
        f"{table.file}: found the distance {found[-1]:g} m, {found[-1] / found[-2]:,.0f} times as far as the next one "
        f"({found[-2]:g} m), expected distances that follow each other; correct it, or write inf where it means that "
        "no object was there"
    )
    raise CalibrationDataError(told, problem=f"{table.file}: found one distance far beyond all others")


def _no_object_readings(no_object: NoObject, layout: Layout) -> list[float]:
    """Collect the no-object readings that were given beside the file, in the unit of the calibration."""
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
                f"{table.place}: found {len(names)} columns, expected one of readings, or one named {wanted!r}"
            )
        index = names.index(wanted)
    cells = list(zip(table.lines, table.columns[index], strict=True))
    column = output_column(table, index, layout)
    if not any(c.isalpha() for c in column.title):  # a bare list of numbers has no header
        cells.insert(0, (table.header_line, table.header[index]))
    return [number(table, line, cell, column) for line, cell in cells if not is_missing(cell)]
