"""Read tables from spreadsheets, MATLAB files, NumPy files and measurement files of data acquisition."""

from __future__ import annotations

import datetime
import io
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from pathlib import PurePath
from typing import Any, Final

import numpy as np

from pretouch._core.errors import CalibrationDataError, require

from .cells import is_number

SPREADSHEETS: Final = frozenset({".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"})
DOCUMENTS: Final = SPREADSHEETS | {".mat", ".npy", ".npz", ".tdms"}
"""Endings of the files that this module reads."""
_COLUMN: Final = "\t"
_FEWEST: Final = 2  # columns and rows of a table
_MOST_COLUMNS: Final = 200
_AS_CSV: Final = "save the table as CSV"
_EXPORTS: Final = {
    ".wfm": "export the waveform as CSV in the oscilloscope or its program",
    ".isf": "export the waveform as CSV in the oscilloscope or its program",
    ".psdata": "save the waveform as CSV in the program of the oscilloscope",
    ".sal": "export the analog channels as CSV in the logic analyzer's program",
    ".mf4": "export the channels as CSV",
    ".mdf": "export the channels as CSV",
    ".dat": _AS_CSV,
    ".numbers": "export the sheet as CSV",
    ".parquet": "write it as CSV, such as with DataFrame.to_csv of pandas",
    ".feather": "write it as CSV, such as with DataFrame.to_csv of pandas",
    ".pkl": "write it as CSV, such as with DataFrame.to_csv of pandas",
    ".h5": "write the columns as CSV, such as with numpy.savetxt",
    ".hdf5": "write the columns as CSV, such as with numpy.savetxt",
    ".fig": "write the data as CSV in MATLAB with writematrix",
    ".bag": "convert the ROS 1 bag with the command rosbags-convert, then use pretouch replay",
    ".mcap": "use pretouch replay",
    ".db3": "use pretouch replay",
    ".pdf": _AS_CSV,
    ".docx": _AS_CSV,
    ".zip": "unpack the file, then choose one table",
    ".gz": "unpack the file with gunzip",
}


def text_of_document(file: str, content: bytes) -> str | None:
    """Return the table of a document as lines with tabs.

    Args:
        file: name of the file; its ending tells the format.
        content: the bytes of the file.

    Returns:
        The text; None if the ending is none of `DOCUMENTS`.
    """
    suffix = PurePath(file).suffix.lower()
    if suffix not in DOCUMENTS:
        return None
    if suffix in SPREADSHEETS:
        rows = _of_spreadsheet(file, content)
    elif suffix == ".tdms":
        rows = _of_measurement(file, content)
    elif suffix == ".mat":
        rows = _of_matlab(file, content)
    else:
        rows = _of_numpy(file, content)
    return "\n".join(_COLUMN.join(map(_cell, row)).rstrip(_COLUMN) for row in rows)


def export_for(file: str) -> str:
    """Return what to do with a file that has no text, such as `save the table as CSV`."""
    return _EXPORTS.get(PurePath(file).suffix.lower(), _AS_CSV)


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float):
        return f"{value:.15g}"
    if isinstance(value, (datetime.datetime, datetime.date, datetime.time)):
        return value.isoformat()
    return " ".join(str(value).split())


def _of_spreadsheet(file: str, content: bytes) -> Sequence[Sequence[Any]]:
    """Return the rows of the only sheet with a table."""
    if content.lstrip()[:1] == b"<":
        raise CalibrationDataError.without_content(
            f"{file}: this file is a page of HTML or XML with the name of a spreadsheet; open it, and save it as CSV"
        )
    calamine = require("python_calamine", extra="files")
    try:
        book = calamine.CalamineWorkbook.from_filelike(io.BytesIO(content))
        sheets = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in book.sheet_names}
    except Exception as error:  # the library has several kinds of errors
        raise CalibrationDataError.without_content(
            f"{file}: the spreadsheet cannot be read; it may be damaged or have a password. Save the sheet as CSV"
        ) from error
    tables = {name: rows for name, rows in sheets.items() if _has_table(rows)}
    if len(tables) == 1:
        return next(iter(tables.values()))
    found = f"the sheets {', '.join(tables)} have numbers" if tables else "no sheet has a table of numbers"
    raise CalibrationDataError(
        f"{file}: {found}, but exactly one sheet must have them; save the sheet with the readings as CSV",
        problem=f"{file}: the number of sheets with a table is {len(tables)}, but must be one",
    )


def _has_table(rows: Iterable[Sequence[Any]]) -> bool:
    return sum(sum(is_number(_cell(cell)) for cell in row) >= _FEWEST for row in rows) >= _FEWEST


def _of_matlab(file: str, content: bytes) -> Sequence[Sequence[Any]]:
    """Return the vectors of a MATLAB file as columns."""
    from scipy.io import loadmat  # noqa: PLC0415 - only when needed

    advice = "write the table as CSV in MATLAB with writetable or writematrix"
    try:
        found = loadmat(io.BytesIO(content), squeeze_me=True, simplify_cells=True)
    except NotImplementedError as error:
        raise CalibrationDataError.without_content(
            f"{file}: this MATLAB file has the version 7.3; save it with -v7, or {advice}"
        ) from error
    except Exception as error:  # the reader has several kinds of errors
        raise CalibrationDataError.without_content(f"{file}: the MATLAB file cannot be read; {advice}") from error
    arrays = {name: value for name, value in _flat(found).items() if not name.startswith("__")}
    return _of_arrays(file, arrays, advice)


def _of_numpy(file: str, content: bytes) -> Sequence[Sequence[Any]]:
    """Return the arrays of a NumPy file as columns."""
    advice = "write the columns as CSV with numpy.savetxt"
    try:
        loaded = np.load(io.BytesIO(content), allow_pickle=False)
        arrays = {name: loaded[name] for name in loaded.files} if hasattr(loaded, "files") else {"": loaded}
    except Exception as error:  # the reader has several kinds of errors
        raise CalibrationDataError.without_content(f"{file}: the NumPy file cannot be read; {advice}") from error
    return _of_arrays(file, arrays, advice)


def _flat(found: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the members of structures with their paths, such as `data.distance`."""
    members: dict[str, Any] = {}
    for name, value in found.items():
        if isinstance(value, dict):
            members |= _flat(value, f"{prefix}{name}.")
        else:
            members[f"{prefix}{name}"] = value
    return members


def _of_arrays(file: str, arrays: Mapping[str, Any], advice: str) -> Sequence[Sequence[Any]]:
    """Return arrays as rows of a table with a header; a single matrix has no header."""
    columns: dict[str, Any] = {}
    matrices = []
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.names is not None and array.ndim == 1:
            columns |= {field: array[field] for field in array.dtype.names}
        elif array.dtype.kind in "biufU" and array.ndim == 1 and len(array) >= _FEWEST:
            columns[name] = array
        elif array.dtype.kind in "biuf" and array.ndim == 2 and min(array.shape) >= _FEWEST:
            matrices.append(array if array.shape[0] >= array.shape[1] else array.T)
    lengths = Counter(len(column) for column in columns.values())
    if lengths:
        length = max(lengths, key=lambda size: (lengths[size], size))
        kept = {name: column for name, column in columns.items() if len(column) == length}
        if _FEWEST <= len(kept) <= _MOST_COLUMNS:
            return [list(kept), *zip(*(column.tolist() for column in kept.values()), strict=True)]
    if len(matrices) == 1 and matrices[0].shape[1] <= _MOST_COLUMNS:
        rows: list[list[Any]] = matrices[0].tolist()
        return rows
    raise CalibrationDataError(
        f"{file}: expected vectors of equal length or one matrix, found {', '.join(arrays) or 'nothing'}; {advice}",
        problem=f"{file}: found no vectors of equal length and no single matrix",
    )


def _of_measurement(file: str, content: bytes) -> Sequence[Sequence[Any]]:
    """Return the channels of a measurement file (TDMS) as columns, with their units and the time of the samples."""
    nptdms = require("nptdms", extra="files")
    try:
        channels = [
            channel for group in nptdms.TdmsFile.read(io.BytesIO(content)).groups() for channel in group.channels()
        ]
        values = [np.asarray(channel[:]) for channel in channels]
    except Exception as error:  # the library has several kinds of errors
        raise CalibrationDataError.without_content(
            f"{file}: the measurement file cannot be read; export the channels as CSV"
        ) from error
    titles: list[str] = []
    columns: list[list[Any]] = []
    for channel, column in zip(channels, values, strict=True):
        step = channel.properties.get("wf_increment")
        if step and not titles:
            start = float(channel.properties.get("wf_start_offset", 0.0))
            titles.append("time [s]")
            columns.append([start + i * float(step) for i in range(len(column))])
        unit = channel.properties.get("unit_string") or channel.properties.get("NI_UnitDescription")
        titles.append(f"{channel.name} [{unit}]" if unit else channel.name)
        columns.append([str(each) if column.dtype.kind == "M" else each for each in column.tolist()])
    if len(columns) < _FEWEST:
        raise CalibrationDataError.without_content(
            f"{file}: expected two or more channels, found {len(columns)}; export the channels as CSV"
        )
    return [titles, *zip_longest(*columns)]
