"""From a CSV file to calibrations: one per combination of label columns."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from pretouch._core.errors import CalibrationDataError
from pretouch._core.numbers import FloatArray, finite

from .csv_file import Column, TextTable, assign_columns, is_missing, is_no_object, number, output_column, read_table
from .data import Calibration, Provenance

__all__ = ["NoObject", "read_calibration", "read_calibrations"]

NoObject: TypeAlias = "float | Sequence[float] | FloatArray | str | os.PathLike[str] | None"


def read_calibration(
    path: str | os.PathLike[str],
    *,
    no_object: NoObject = None,
    select: Mapping[str, object] | None = None,
    columns: Mapping[str, str] | None = None,
    labels: Sequence[str] | None = None,
) -> Calibration:
    r"""Read the one calibration of a file, or the one that `select` names.

    The file is a table with a header that carries units, such as `distance [mm],output [V]`. Columns are separated
    by comma, semicolon or tab; with the latter two, decimal commas are understood. Repeats are rows. A row whose
    distance is `inf`, empty, `none` or `no object` is a no-object reading; a row whose output is empty or NaN is
    counted and dropped. Lines that start with `#` and blank lines are skipped. Further columns are labels.

    Args:
        path: the file.
        no_object: readings without an object, in the unit of the output (V where that is mV): one number, several,
            or the path of a file that holds them; they add to those in the file.
        select: value of each label column that tells the wanted curve from the others, such as `{"sensor": "1"}`.
        columns: headers of the `distance` and `output` columns, where names and units do not tell.
        labels: headers of the label columns; all that are neither distance nor output where None.

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
    found = read_calibrations(path, no_object=no_object, columns=columns, labels=labels)
    wanted = {key: str(value).strip() for key, value in (select or {}).items()}
    keys = {key for curve in found for key in _label(curve)}
    for key in wanted:
        if key not in keys:
            known = ", ".join(sorted(keys)) or "none: the file holds one curve"
            raise CalibrationDataError(f"select: found {key!r}, expected a label column ({known})")
    chosen = [curve for curve in found if all(_label(curve).get(k) == v for k, v in wanted.items())]
    if len(chosen) == 1:
        return chosen[0]
    values = "; ".join(f"{k}: {', '.join(dict.fromkeys(_label(c)[k] for c in found))}" for k in _label(found[0]))
    raise CalibrationDataError(
        f"{Path(path).name}: found {len(chosen)} curves{f' for {wanted}' if wanted else ''}, expected one: choose with "
        f"select={{...}} among {values}"
    )


def read_calibrations(
    path: str | os.PathLike[str],
    *,
    no_object: NoObject = None,
    columns: Mapping[str, str] | None = None,
    labels: Sequence[str] | None = None,
) -> tuple[Calibration, ...]:
    """Read every calibration of a file: one per combination of its label columns.

    Args:
        path: the file, as `read_calibration` describes it.
        no_object: readings without an object, added to every curve.
        columns: headers of the `distance` and `output` columns, where names and units do not tell.
        labels: headers of the label columns; all that are neither distance nor output where None.

    Returns:
        The calibrations in the order of their first rows.

    Raises:
        CalibrationDataError: the file has a mistake; the message names the line, what was found, what is expected.
    """
    table = read_table(path)
    distance, output, notes = assign_columns(table, columns)
    label_columns = _label_columns(table, {distance.index, output.index}, labels)
    groups: dict[tuple[str, ...], list[tuple[int, tuple[str, ...]]]] = {}
    shared: list[tuple[int, tuple[str, ...]]] = []
    for line, row in table.rows:
        key = tuple(row[i] for i in label_columns)
        if key and not any(key) and is_no_object(row[distance.index]):
            shared.append((line, row))
        else:
            groups.setdefault(key, []).append((line, row))
    if not groups:
        raise CalibrationDataError(f"{table.file}: found no rows below the header, expected distances and outputs")
    if labels is None and len(groups) > 3 and max(len(rows) for rows in groups.values()) == 1:
        names = ", ".join(repr(table.header[i]) for i in label_columns)
        raise CalibrationDataError(
            f"{table.file}: found another value of {names} in every row, which leaves one reading per curve: name the "
            "label columns, labels=[...], or none, labels=[]"
        )
    extra = _no_object_readings(no_object, output)
    return tuple(
        _curve(
            table,
            key,
            [*rows, *shared],
            columns=(distance, output),
            label_columns=label_columns,
            extra=extra,
            notes=notes,
        )
        for key, rows in groups.items()
    )


def _label_columns(table: TextTable, used: set[int], labels: Sequence[str] | None) -> list[int]:
    if labels is None:
        return [i for i in range(len(table.header)) if i not in used]
    for name in labels:
        if name not in table.header:
            found = ", ".join(repr(title) for title in table.header)
            raise CalibrationDataError(f"labels: found {name!r}, expected one of {found}")
    return [i for i, title in enumerate(table.header) if title in labels]


def _curve(
    table: TextTable,
    key: tuple[str, ...],
    rows: list[tuple[int, tuple[str, ...]]],
    *,
    columns: tuple[Column, Column],
    label_columns: list[int],
    extra: list[float],
    notes: tuple[str, ...],
) -> Calibration:
    distance, output = columns
    distances, outputs, no_object, dropped = [], [], list(extra), 0
    for line, row in rows:
        place = row[distance.index]
        absent = is_no_object(place)
        where = 0.0 if absent else number(table, line, place, distance)
        if where < 0:
            raise CalibrationDataError(
                f"{table.file}, line {line}: found the distance {place}, which must not be negative"
            )
        if is_missing(row[output.index]):
            dropped += 1
            continue
        value = number(table, line, row[output.index], output)
        if absent:
            no_object.append(value)
        else:
            distances.append(where)
            outputs.append(value)
    label = ", ".join(f"{table.header[i]}={value}" for i, value in zip(label_columns, key, strict=True))
    if not distances:
        raise CalibrationDataError(
            f"{table.file}{f', {label}' if label else ''}: found no reading with an object in range, expected at "
            "least one"
        )
    return Calibration(
        distances=np.array(distances),
        outputs=np.array(outputs),
        unit=output.unit,
        no_object=np.array(no_object),
        label=label,
        source=Provenance(
            file=table.file,
            sha256=table.sha256,
            encoding=table.encoding,
            delimiter=table.delimiter,
            decimal_mark=table.decimal_mark,
            distance_column=distance.title,
            output_column=output.title,
            label_columns=tuple(table.header[i] for i in label_columns),
            rows=len(rows),
            dropped=dropped,
            notes=notes,
        ),
    )


def _label(calibration: Calibration) -> dict[str, str]:
    """Return the labels of a calibration by column."""
    names = calibration.source.label_columns if calibration.source else ()
    values = calibration.label
    labels = {}
    for i, name in enumerate(names):
        rest = values.removeprefix(f"{name}=")
        following = f", {names[i + 1]}=" if i + 1 < len(names) else None
        value, _, tail = rest.partition(following) if following else (rest, "", "")
        labels[name] = value
        values = f"{names[i + 1]}={tail}" if following else ""
    return labels


def _no_object_readings(no_object: NoObject, output: Column) -> list[float]:
    """Collect the no-object readings that were given beside the file, in the unit of the calibration."""
    if no_object is None:
        return []
    if not isinstance(no_object, (str, os.PathLike)):
        return [float(v) for v in np.atleast_1d(finite(no_object, "no_object", output.unit)).ravel()]
    table = read_table(no_object)
    index = len(table.header) - 1
    if len(table.header) > 1:
        names = [title.partition("[")[0].partition("(")[0].strip() for title in table.header]
        wanted = output.title.partition("[")[0].partition("(")[0].strip()
        if wanted not in names:
            raise CalibrationDataError(
                f"{table.file}, line {table.header_line}: found {len(names)} columns, expected one of readings, or one "
                f"named {wanted!r}"
            )
        index = names.index(wanted)
    rows = list(table.rows)
    column = output_column(table, index, output)
    if not any(c.isalpha() for c in column.title):  # a bare list of numbers has no header
        rows.insert(0, (table.header_line, table.header))
    return [number(table, line, row[index], column) for line, row in rows if not is_missing(row[index])]
