"""Spreadsheets, MATLAB and NumPy files and measurement files: read as tables, or refused with the export that works."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pytest
from scipy.io import savemat

from pretouch._core.errors import CalibrationDataError
from pretouch.calibration import read_calibration
from pretouch.recording import read_recording
from table_kinds import readings

MADE = readings(4)
HEADER = ["distance [mm]", "output [V]"]
ROWS = [list(row) for row in zip(MADE.distances, MADE.volts, strict=True)]


def workbook(*sheets: list[list[Any]]) -> bytes:
    """Return a spreadsheet (Office Open XML) with text and numbers."""
    space = "http://schemas.openxmlformats.org"
    related = f"{space}/officeDocument/2006/relationships"
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    names = range(1, len(sheets) + 1)
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{space}/package/2006/content-types">'
        '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{kind}.sheet.main+xml"/>'
        + "".join(f'<Override PartName="/xl/s{i}.xml" ContentType="{kind}.worksheet+xml"/>' for i in names)
        + "</Types>",
        "_rels/.rels": f'<Relationships xmlns="{space}/package/2006/relationships">'
        f'<Relationship Id="r" Type="{related}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{space}/spreadsheetml/2006/main" xmlns:r="{related}"><sheets>'
        + "".join(f'<sheet name="S{i}" sheetId="{i}" r:id="r{i}"/>' for i in names)
        + "</sheets></workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{space}/package/2006/relationships">'
        + "".join(f'<Relationship Id="r{i}" Type="{related}/worksheet" Target="s{i}.xml"/>' for i in names)
        + "</Relationships>",
    }
    for i, rows in enumerate(sheets, start=1):
        body = "".join(f"<row>{''.join(map(_written, row))}</row>" for row in rows)
        parts[f"xl/s{i}.xml"] = (
            f'<worksheet xmlns="{space}/spreadsheetml/2006/main"><sheetData>{body}</sheetData></worksheet>'
        )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, text in parts.items():
            archive.writestr(name, f'<?xml version="1.0" encoding="UTF-8"?>{text}')
    return stream.getvalue()


def _written(cell: Any) -> str:
    if isinstance(cell, str):
        return f'<c t="inlineStr"><is><t>{escape(cell)}</t></is></c>'
    return f"<c><v>{cell!r}</v></c>"


def check(path: Path, **options: Any) -> None:
    """Check that a file gives the readings."""
    curve = read_calibration(path, **options)
    assert curve.distances == pytest.approx(np.array(MADE.distances) / 1000, rel=1e-12)
    assert curve.outputs == pytest.approx(MADE.volts, rel=1e-12)
    assert curve.unit == "V"


def test_the_only_sheet_with_numbers_of_a_spreadsheet_is_read(tmp_path: Path) -> None:
    pytest.importorskip("python_calamine")
    path = tmp_path / "bench.xlsx"
    path.write_bytes(workbook([["Bench 4"], ["Operator", "A. Smith"]], [["Run of May"], HEADER, *ROWS]))
    check(path)
    assert read_calibration(path).source.encoding == "xlsx"
    path.write_bytes(workbook([["Abstand in mm", "Spannung in V"], *[[str(a).replace(".", ","), b] for a, b in ROWS]]))
    check(path)
    path.write_bytes(workbook([HEADER, *ROWS], [HEADER, *ROWS]))
    with pytest.raises(CalibrationDataError, match=r"S1, S2.*as CSV"):
        read_calibration(path)
    path.write_bytes(b"PK\x03\x04 damaged")
    with pytest.raises(CalibrationDataError, match=r"cannot be read.*as CSV"):
        read_calibration(path)


def test_a_spreadsheet_is_a_recording_as_well(tmp_path: Path) -> None:
    pytest.importorskip("python_calamine")
    rows = [[5 * i, 500 + i % 7] for i in range(100)]
    (tmp_path / "run.xlsx").write_bytes(workbook([["time [ms]", "prox"], *rows]))
    assert (np.diff(read_recording(tmp_path / "run.xlsx").stamps) == 5_000_000).all()


def test_vectors_of_a_matlab_file_are_columns(tmp_path: Path) -> None:
    vectors = {"distance_mm": np.array(MADE.distances), "volts": np.array(MADE.volts)}
    savemat(tmp_path / "a.mat", {**vectors, "gain": 3.0, "name": "bench"})
    check(tmp_path / "a.mat")
    savemat(tmp_path / "b.mat", {"run": {name: vector[:, None] for name, vector in vectors.items()}})
    check(tmp_path / "b.mat")
    savemat(tmp_path / "c.mat", {"data": np.array(ROWS)})
    check(tmp_path / "c.mat", columns={"distance": "1 [mm]", "output": "2 [V]"})
    savemat(tmp_path / "d.mat", {"gain": 3.0})
    with pytest.raises(CalibrationDataError, match="writetable"):
        read_calibration(tmp_path / "d.mat")


def test_arrays_of_numpy_files_are_columns(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", distance_mm=np.array(MADE.distances), volts=np.array(MADE.volts))
    check(tmp_path / "a.npz")
    kinds = [("distance_mm", float), ("volts", float)]
    np.save(tmp_path / "b.npy", np.array([tuple(row) for row in ROWS], dtype=kinds))
    check(tmp_path / "b.npy")
    np.save(tmp_path / "c.npy", np.array(ROWS))
    check(tmp_path / "c.npy", columns={"distance": "1 [mm]", "output": "2 [V]"})
    (tmp_path / "d.npy").write_bytes(b"no array")
    with pytest.raises(CalibrationDataError, match="savetxt"):
        read_calibration(tmp_path / "d.npy")


def test_channels_of_a_measurement_file_are_columns_with_their_units(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        channels = (("distance", MADE.distances, {"unit_string": "mm"}), ("ai0", MADE.volts, {"unit_string": "V"}))
        writer.write_segment([nptdms.ChannelObject("run", n, np.array(v), properties=p) for n, v, p in channels])
    check(tmp_path / "a.tdms")
    with nptdms.TdmsWriter(tmp_path / "b.tdms") as writer:
        values = np.arange(100) % 7 + 500.0
        writer.write_segment([nptdms.ChannelObject("run", "ai0", values, properties={"wf_increment": 0.005})])
    recording = read_recording(tmp_path / "b.tdms")
    assert (np.diff(recording.stamps) == 5_000_000).all()
    assert recording.values.tolist() == values.tolist()


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("a.wfm", "oscilloscope"), ("a.parquet", "to_csv"), ("a.bag", "rosbags-convert"), ("a.mcap", "pretouch replay")],
)
def test_what_cannot_be_read_is_refused_with_the_export_that_works(tmp_path: Path, name: str, remedy: str) -> None:
    (tmp_path / name).write_bytes(b"\x00\x01\x02\x00 binary")
    with pytest.raises(CalibrationDataError, match=remedy):
        read_calibration(tmp_path / name)
