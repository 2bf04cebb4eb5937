"""Calibration files as they come, good and bad; each mistake gets one sentence with its line."""

import hashlib
import json
import os
from decimal import Decimal

import numpy as np
import pytest

from pretouch._core.errors import CalibrationDataError, ResultUnavailableError
from pretouch.calibration import Calibration, fit, fit_sensor, read_calibration, read_calibrations
from pretouch.config.sensor import FitRequest

PLAIN = "distance [mm],output [V]\n0,2.0\n10,1.0\n42.2,0.5\n"


def write(tmp_path, text, encoding="utf-8", name="sensor.csv"):
    path = tmp_path / name
    path.write_bytes(text.encode(encoding) if isinstance(text, str) else text)
    return path


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        "distance [mm];output [V]\r\n0;2,0\r\n10;1,0\r\n42,2;0,5\r\n",
        "distance [mm]\toutput [V]\n0\t2,0\n10\t1,0\n42,2\t0,5\n",
        "# a sensor\n\n" + PLAIN.replace("10,", "# in between\n\n10,"),
        "\ufeff" + PLAIN,
        "output (V),distance (mm)\n2.0,0\n1.0,10\n0.5,42.2\n",
        "l [cm],xi [mV]\n0,2000\n1,1e3\n4.22,500\n",
        "range [m],voltage [V]\n0,2\n0.01,1\n0.0422,.5\n",
        "foo [mm],bar [V]\n0,2\n10,1\n42.2,.5\n",
        '"distance [mm]","output [V]"\n"0","2"\n"10","1"\n"42.2","0.5"\n',
        "distance [mm],output [V],\n0,2,\n10,1,\n42.2,0.5,\n",
    ],
)
def test_every_common_layout_gives_the_same_numbers(tmp_path, text):
    measured = read_calibration(write(tmp_path, text))
    assert measured.distances.tolist() == [0.0, 0.01, 0.0422]  # exactly: 42.2 mm is the float nearest to 0.0422
    assert measured.outputs.tolist() == pytest.approx([2.0, 1.0, 0.5], rel=1e-15)
    assert measured.unit == "V"


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252", "utf-8-sig"])
def test_other_encodings_are_read_and_recorded(tmp_path, encoding):
    measured = read_calibration(write(tmp_path, "# Gerät\n" + PLAIN, encoding))
    assert measured.source.encoding == encoding


def test_the_provenance_names_the_very_bytes(tmp_path):
    path = write(tmp_path, PLAIN + "20,nan\n30,\n")
    source = read_calibration(path).source
    assert source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (source.file, source.distance_column, source.output_column) == (
        "sensor.csv",
        "distance [mm]",
        "output [V]",
    )
    assert (source.rows, source.dropped) == (5, 2)


@pytest.mark.parametrize("word", ["inf", "", "none", "No object", "∞"])
def test_rows_without_an_object_are_no_object_readings(tmp_path, word):
    measured = read_calibration(write(tmp_path, PLAIN + f"{word},0.1\n{word},0.2\n"))
    assert measured.no_object.tolist() == [0.1, 0.2]
    assert len(measured.distances) == 3


def test_no_object_readings_come_as_number_list_or_file(tmp_path):
    path = write(tmp_path, PLAIN)
    bare = write(tmp_path, "0.1\n0.2\n", name="bare.csv")
    headed = write(tmp_path, "output [mV]\n100\n200\n", name="headed.csv")
    assert read_calibration(path, no_object=0.1).no_object.tolist() == [0.1]
    for given in ([0.1, 0.2], np.array([0.1, 0.2]), bare, str(headed)):
        assert read_calibration(path, no_object=given).no_object.tolist() == pytest.approx([0.1, 0.2], rel=1e-15)
    with pytest.raises(
        CalibrationDataError, match=r"'counts', expected readings in the unit of the calibration \('V'\)"
    ):
        read_calibration(path, no_object=write(tmp_path, "output [counts]\n1\n", name="wrong.csv"))


def test_further_columns_tell_curves_apart(tmp_path):
    path = write(tmp_path, "day,distance [mm],side,output [counts]\n1,0,a,9\n1,1,a,8\n1,0,b,7\n2,0,b,6\n,inf,,1\n")
    curves = read_calibrations(path)
    assert [c.label for c in curves] == ["day=1, side=a", "day=1, side=b", "day=2, side=b"]
    assert all(c.no_object.tolist() == [1.0] for c in curves)
    assert read_calibration(path, select={"day": 2}).outputs.tolist() == [6.0]
    assert len(read_calibrations(path, labels=["day"])) == 2
    with pytest.raises(
        CalibrationDataError, match=r"3 curves, but exactly one is needed\. .*The labels are day: 1, 2; side: a, b"
    ):
        read_calibration(path)
    with pytest.raises(CalibrationDataError, match="select: the file has no label column named 'size'"):
        read_calibration(path, select={"size": "1"})


def test_an_output_without_unit_is_taken_as_counts_and_said_so(tmp_path):
    measured = read_calibration(write(tmp_path, "distance [mm],output\n0,9\n1,8\n"))
    assert measured.unit == "counts"
    assert "no unit" in measured.source.notes[0]
    assert not read_calibration(write(tmp_path, "distance [mm],output\n0,9.5\n1,8\n")).unit


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("# nothing\n\n", "the file has no rows"),
        ("0,1\n1,2\n", r"line 1: the first row contains numbers"),
        ("distance [mm],output [V]\n", "has a header but no rows below the header"),
        ("distance,output [V]\n0,1\n", r"line 1: found 'distance', a distance without a unit.*distance=1 \[UNIT\]"),
        ("distance [V],output [V]\n0,1\n", "line 1: the unit 'V' of the distance is not a unit of length"),
        ("# c\ndistance [mm],output [V]\n0,1\n1,x\n", r"line 4: found 'x' in column 'output \[V\]', expected a number"),
        ("distance [mm],output [V]\n0,1\nten,1\n", r"line 3: found 'ten' in column 'distance \[mm\]'"),
        ("distance [mm],output [V]\n0,1\n-1,1\n", "line 3: found the distance -1, but distances must not be negative"),
        ("distance [mm],output [V]\n0,1,5\n", "line 2: this row has 3 cells, but the header has 2 cells; .*semicolons"),
        ("distance [mm],output [V]\n0,inf\n", "line 2: found 'inf'"),
        ("distance [mm];output [V]\n0;1.00,5\n", "line 2: found '1.00,5'"),
        ("distance [mm],range [mm],output [V]\n0,1,2\n", "may both contain the distance"),
        ("a,b,c\n0,1,2\n", "needs one column named distance and one column named output"),
        ("distance [mm]\n0\n", "line 1: the table has only one column"),
        ("distance [mm],output [V]\ninf,1\n", "every reading was taken without an object"),
        ("distance [mm],output [V],object\n0,1,a\n1,1,b\n2,1,c\n3,1,d\n", "each curve would have only one reading"),
        (b"\x00\x01\x02", "binary data"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path, text, message):
    with pytest.raises(CalibrationDataError, match=message) as error:
        read_calibration(write(tmp_path, text))
    assert "sensor.csv" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(CalibrationDataError, match=r"absent\.csv: cannot be read"):
        read_calibration(tmp_path / "absent.csv")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"x" * 100_000_001, "the largest allowed size is 100 MB"),
        (
            b"distance [mm],output [V]\n" + b"1,2\n" * 2_000_001,
            "more than 2,000,000 rows, the largest allowed number; average .*keep every tenth row",
        ),
        (
            PLAIN.encode() + b"1," + b"2" * 200_000,
            "line 5: this line has 200,002 characters, but at most 200,000",
        ),
    ],
    ids=["bytes", "rows", "one line"],
)
def test_a_file_beyond_all_measure_is_refused_with_what_is_allowed(tmp_path, content, message):
    with pytest.raises(CalibrationDataError, match=message) as error:
        read_calibration(write(tmp_path, content))
    assert error.value.problem == str(error.value), "it quotes nothing of the file"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX pipes and devices")
def test_what_never_ends_is_no_calibration(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(CalibrationDataError, match=r"is a (pipe|device or a socket), but .* needs a regular file"):
            read_calibration(path)
        with pytest.raises(CalibrationDataError, match=r"is a (pipe|device or a socket), but .* needs a regular file"):
            read_calibration(write(tmp_path, PLAIN), no_object=path)


@pytest.mark.slow
def test_many_rows_are_read_as_few_are(tmp_path):
    """A quarter of a million rows, whole columns at a time, next to the numbers themselves, row by row."""
    rng = np.random.default_rng(5)
    distances = rng.choice(np.arange(50, 2000), 250_000) / 10
    outputs = np.round(3 * np.exp(-distances / 30) + 0.001 * rng.standard_normal(len(distances)), 6)
    rows = [f"{distance:g},{output:.6f}" for distance, output in zip(distances, outputs, strict=True)]
    found = read_calibration(write(tmp_path, "\n".join(["distance [mm],output [V]", *rows, "inf,0.001", "7,nan", ""])))
    assert found.outputs.tolist() == outputs.tolist()
    assert found.distances.tolist() == [float(Decimal(row.partition(",")[0]) / 1000) for row in rows]
    assert found.no_object.tolist() == [0.001]
    assert (found.source.rows, found.source.dropped) == (250_002, 1)


def test_the_first_mistake_of_a_long_file_is_named(tmp_path):
    rows = ["distance [mm],output [V]"] + ["10,1.0"] * 30_000
    rows[20_000], rows[25_000] = "10,x", "y,1.0"
    with pytest.raises(CalibrationDataError, match="line 20001: found 'x' in column 'output"):
        read_calibration(write(tmp_path, "\n".join(rows)))
    rows[15_000] = "-3,z"
    with pytest.raises(CalibrationDataError, match="line 15001: found the distance -3, but distances must not"):
        read_calibration(write(tmp_path, "\n".join(rows)))


def test_readings_without_an_object_and_without_labels_belong_to_every_curve(tmp_path):
    """In a wide table a row without a label may hold both: readings of its own, and one without an object for all."""
    wide = "5 mm,10 mm,inf,day\n5,4,1,1\n6,5,2,2\n,,3,\n7,6,4,\n"
    curves = {curve.label: curve for curve in read_calibrations(write(tmp_path, wide), labels=["day"])}
    assert {label: curve.no_object.tolist() for label, curve in curves.items()} == {
        "day=1": [1.0, 3.0, 4.0],
        "day=2": [2.0, 3.0, 4.0],
        "day=": [3.0, 4.0],
    }
    assert curves["day="].outputs.tolist() == [7.0, 6.0]


def test_a_table_with_many_empty_last_columns_is_read_at_once(tmp_path):
    """Each of them was taken away in a pass over all rows: the time grew with their square."""
    found = read_calibration(write(tmp_path, f"distance [mm],output [V]{',' * 100_000}\n" + f"5,1{',' * 100_000}\n"))
    assert found.outputs.tolist() == [1.0]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"distances": [0, 1], "outputs": [1]}, "found 1 values for 2 distances"),
        ({"distances": [], "outputs": []}, "expected at least one reading"),
        ({"distances": [-0.1], "outputs": [1]}, "must not be negative"),
        ({"distances": [0.1], "outputs": [np.nan]}, "must be finite"),
        ({"distances": [[0.1]], "outputs": [[1]]}, "expected a one-dimensional array"),
        ({"distances": [0.1], "outputs": [1], "no_object": ["a"]}, "expected a number"),
    ],
)
def test_columns_that_are_no_calibration_are_refused(fields, message):
    with pytest.raises(CalibrationDataError, match=message):
        Calibration(**fields)


def flat(level=50.0, noise=0.0, points=12):
    rng = np.random.default_rng(3)
    return Calibration(
        distances=np.arange(points) * 0.01, outputs=level + noise * rng.standard_normal(points), unit="counts"
    )


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    "measured",
    [
        flat(),
        flat(noise=3.0),
        flat(level=0.0),
        Calibration(distances=[0.0], outputs=[1.0]),
        Calibration(distances=[0.0, 0.01, 0.02], outputs=[3.0, 2.0, 1.0]),
        Calibration(distances=np.arange(9) * 0.01, outputs=np.arange(9.0), no_object=[0.0, 0.1, 0.2]),
        Calibration(distances=np.arange(9) * 0.01, outputs=[1020.0] * 9, unit="counts", no_object=[1020, 1020, 1016]),
        Calibration(distances=np.zeros(20), outputs=np.arange(20.0)),
    ],
    ids=["constant", "noise", "zero", "one point", "three points", "rising", "stuck", "one distance"],
)
def test_what_is_no_signal_is_called_so(measured):
    report = fit(measured)
    few = len(measured.distinct_distances) < 4  # "stuck" is clipped at all of its distances, which are enough
    verdict = "too few distances" if few else "no usable signal"
    assert report.verdict == verdict
    assert report.best is None
    assert report.reasons
    found = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert {"verdict", "reasons", "best", "window", "offset", "noise", "models"} <= set(found)
    assert {"value", "standard_error", "kind"} <= set(found["offset"])
    assert (found["best"], found["models"]) == (None, [])
    assert verdict in str(report)
    assert verdict in report._repr_html_()
    assert ("no usable signal" in str(report)) == (not few)
    with pytest.raises(ResultUnavailableError, match="cannot be fitted"):
        fit_sensor(measured)


def test_a_report_reads_well_and_is_plain_json():
    distance = np.repeat(np.arange(10) * 0.005, 3)
    rng = np.random.default_rng(4)
    measured = Calibration(
        distances=distance,
        outputs=0.1 + np.exp(-50 * distance) + 0.002 * rng.standard_normal(30),
        unit="V",
        no_object=[0.1, 0.102, 0.098],
    )
    report = fit(measured)
    found = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert found["best"] == report.best.model
    assert found["window"] == [0.0, 0.045]
    keys = {"name", "parameters", "intervals", "r_squared", "rmse_log_output", "rmse_log_slope", "aicc"}
    assert all(keys | {"cross_validation", "runs_p_value"} <= set(model) for model in found["models"])
    assert all(len(line) == len(line.rstrip()) for line in str(report).splitlines())
    assert "1/m" in str(report.best)
    assert "<script" not in report._repr_html_()


def test_a_scenario_file_instead_of_a_calibration_is_named(tmp_path):
    path = write(tmp_path, "[sensor]\nscale = 1.0\n", name="approach.toml")
    with pytest.raises(CalibrationDataError, match="this is a scenario file"):
        FitRequest(path=path).read()
