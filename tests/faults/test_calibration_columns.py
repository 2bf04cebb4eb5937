"""Calibration files as people have them: wide, set apart by blanks, with text above the header, with settings."""

import numpy as np
import pytest

from pretouch._core.errors import CalibrationDataError
from pretouch.calibration import read_calibration, read_calibrations

REMEDY = "(called columns in a scenario file and in Python)"


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "sensor.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    "text",
    [
        "0cm,1cm,2cm,inf\n9,5,3,1\n8,4,2,1\n",
        "0 mm;10 mm;20 mm;no object\n9;5;3;1\n8;4;2;1\n",
        "0 mm 10 mm 20 mm none\n9 5 3 1\n8 4 2 1\n",
        "0.0mm\t10.0mm\t20.0mm\t∞\n9\t5\t3\t1\n8\t4\t2\t1\n",
        "d=0mm,d=10mm,d=20mm,inf\n9,5,3,1\n8,4,2,1\n",
        "0 [cm],1 [cm],2 [cm],inf\n9,5,3,1\n8,4,2,1\n",
        "0,1cm,2cm,inf\n9,5,3,1\n8,4,2,1\n",
        "0 cm,1,2,inf\n9,5,3,1\n8,4,2,1\n",
        "0cm,10mm,0.02m,inf\n9,5,3,1\n8,4,2,1\n",
        "distance [mm],0,10,20,inf\n,9,5,3,1\n,8,4,2,1\n",
        "distance [mm],0,10,20,inf\n1,9,5,3,1\n2,8,4,2,1\n",
        "distance [mm] 0 10 20 inf\n1 9 5 3 1\n2 8 4 2 1\n",
        "cm,0,1,2,inf\n1,9,5,3,1\n2,8,4,2,1\n",
        "trial,0cm,1cm,2cm,inf\n1,9,5,3,1\n2,8,4,2,1\n",
        ",0cm,1cm,2cm,inf\ntrial 1,9,5,3,1\ntrial 2,8,4,2,1\n",
        "time,0cm,1cm,2cm,inf\n10:01,9,5,3,1\n10:02,8,4,2,1\n",
        "Bench 4\nOperator: Smith, J.\n0cm,1cm,2cm,inf\n9,5,3,1\n8,4,2,1\n",
    ],
)
def test_a_wide_table_gives_the_same_readings_however_it_is_written(file, text):
    curve = read_calibration(file(text))
    assert curve.distances.tolist() == [0, 0.01, 0.02] * 2
    assert curve.outputs.tolist() == [9, 5, 3, 8, 4, 2]
    assert (curve.no_object.tolist(), curve.unit, curve.label) == ([1, 1], "counts", "")
    assert any("interpreted as distances" in note for note in curve.source.notes)


def test_a_wide_table_is_the_long_one_turned(file):
    rng = np.random.default_rng(7)
    distances, outputs = np.arange(0, 65, 5), rng.integers(100, 900, (6, 13))
    wide = "\n".join([",".join(f"{d} mm" for d in distances), *(",".join(map(str, row)) for row in outputs)])
    long = "\n".join(f"{d},{y}" for row in outputs for d, y in zip(distances, row, strict=True))
    found, wanted = (read_calibration(file(t)) for t in (wide, f"distance [mm],output [counts]\n{long}"))
    assert found.distances.tobytes() == wanted.distances.tobytes()
    assert found.outputs.tobytes() == wanted.outputs.tobytes()


def test_labels_of_a_wide_table_tell_curves_apart(file):
    text = "sensor,day,trial,0cm,5cm,inf\na,1,1,9,5,1\na,1,2,8,4,1\nb,1,1,7,3,\nb,2,1,6,2,1\n"
    curves = read_calibrations(file(text))
    assert [c.label for c in curves] == ["sensor=a, day=1", "sensor=b, day=1", "sensor=b, day=2"]
    assert [len(c.outputs) for c in curves] == [4, 2, 2]
    assert [c.source.dropped for c in curves] == [0, 1, 0]
    assert read_calibration(file(text), select={"sensor": "b", "day": 2}).outputs.tolist() == [6, 2]
    assert len(read_calibrations(file(text), labels=[])) == 1
    assert len(read_calibrations(file(text), labels=[1])) == 2


def test_a_column_without_a_name_may_hold_labels(file):
    curves = read_calibrations(file(",0cm,1cm\nS1,9,5\nS2,8,4\n"))
    assert [c.label for c in curves] == ["column 1=S1", "column 1=S2"]
    assert read_calibration(file(",0cm,1cm\nS1,9,5\nS2,8,4\n"), select={"column 1": "S2"}).outputs.tolist() == [8, 4]


def test_equal_distances_are_repeats(file):
    for header in ("0cm,0cm,5cm", "0cm,0cm.1,5cm"):
        curve = read_calibration(file(f"{header}\n9,8,4\n"))
        assert (curve.distances.tolist(), curve.outputs.tolist()) == ([0, 0, 0.05], [9, 8, 4])


@pytest.mark.parametrize(
    ("text", "columns", "unit", "outputs"),
    [
        ("0cm,1cm,2cm\n900,500,300\n", None, "counts", [900, 500, 300]),
        ("0cm,1cm,2cm\n900,500.5,300\n", None, "", [900, 500.5, 300]),
        ("0cm,1cm,2cm\n900,500,300\n", {"output": "[mV]"}, "V", [0.9, 0.5, 0.3]),
        ("0,10,20\n900,500,300\n", {"distance": "[mm]", "output": "[counts]"}, "counts", [900, 500, 300]),
        ("output [mV],0cm,1cm,2cm\n,900,500,300\n", None, "V", [0.9, 0.5, 0.3]),
        ("distance [mm] / output [mV],0,10,20\n,900,500,300\n", None, "V", [0.9, 0.5, 0.3]),
        ("distance [mm],0,10,20\n1,900,500,300\n", {"distance": "[mm]"}, "counts", [900, 500, 300]),
    ],
)
def test_the_units_of_a_wide_table_are_said_or_stand_in_its_corner(file, text, columns, unit, outputs):
    curve = read_calibration(file(text), columns=columns)
    assert curve.distances.tolist() == [0, 0.01, 0.02]
    assert curve.outputs.tolist() == pytest.approx(outputs, rel=1e-15)
    assert curve.unit == unit


def test_numbered_columns_beside_a_distance_are_repeats_where_that_is_said(file):
    text = "distance [mm],1,2,3\n0,9,5,3\n10,8,4,\n"
    with pytest.raises(
        CalibrationDataError, match=r'"distance=1"\. If .* headers, use the option --columns "distance=\[UNIT\]"'
    ):
        read_calibration(file(text))
    curve = read_calibration(file(text), columns={"distance": 1})
    assert curve.distances.tolist() == [0, 0, 0, 0.01, 0.01]
    assert curve.outputs.tolist() == [9, 5, 3, 8, 4]
    assert curve.source.notes[-1] == "The columns 1, 2, 3 are read as repeats."


def test_columns_named_as_repeats_are_read_as_such(file):
    for heads in ("trial 1 [V],trial 2 [V]", "run1 [V],run2 [V]", "#1 [V],#2 [V]"):
        curve = read_calibration(file(f"distance [mm],{heads}\n0,9,8\n10,5,4\n"))
        assert (curve.distances.tolist(), curve.outputs.tolist()) == ([0, 0, 0.01, 0.01], [9, 8, 5, 4])
        assert curve.source.notes == (f"The columns {heads.replace(',', ', ')} are read as repeats.",)
    with pytest.raises(CalibrationDataError, match="may both contain the output"):
        read_calibration(file("distance [mm],trial 1 [V],trial 2 [mV]\n0,9,8\n10,5,4\n"))


@pytest.mark.parametrize(
    "text",
    [
        "distance [mm] output [counts]\n0 9\n5 8\ninf 1\n",
        "  distance [mm]    output [counts]  \n     0.0    9\n   5.0  8\n  no object   1\n",
        "distance[mm] output[counts]\n0 9\n5 8\n'#\n".replace("'#\n", "# end\ninf 1\n"),
        '"distance [mm]" "output [counts]"\n0 9\n5 8\ninf 1\n',
        "distance (mm)  sensor output (counts)\n0 9\n5 8\n∞ 1\n",
        "distance [mm] sensor output [counts]\n0 9\n5 8\nnone 1\n",
        "distance_mm  adc_counts\n0 9\n5 8\nnone 1\n",
        "# distance [mm] output [counts]\n0.0e0 9\n5 8\ninf 1\n",
        "Distance Output\nmm counts\n0 9\n5 8\ninf 1\n",
        "distance [mm], output [counts]\n0, 9\n5, 8\ninf, 1\n",
        '"distance, measured [mm]","output [counts]"\n0,9\n5,8\ninf,1\n',
    ],
)
def test_columns_set_apart_by_blanks_are_told_apart(file, text):
    curve = read_calibration(file(text))
    assert (curve.distances.tolist(), curve.outputs.tolist()) == ([0, 0.005], [9, 8])
    assert (curve.no_object.tolist(), curve.unit) == ([1], "counts")


def test_decimal_commas_are_understood_between_blanks(file):
    curve = read_calibration(file("distance [mm] output [V]\n0,5 9,25\n5 8,5\n"))
    assert (curve.distances.tolist(), curve.outputs.tolist()) == ([0.0005, 0.005], [9.25, 8.5])
    assert (curve.source.delimiter, curve.source.decimal_mark) == (" ", ",")


TABLE = "distance [mm];output [V]\n0;2,5\n5;1,5\ninf;0,1\n"


@pytest.mark.parametrize(
    ("above", "lines"),
    [
        ("Instrument: GP2Y0A21\n", "Line 1 is"),
        ("sep=;\n", "Line 1 is"),
        ("Sensor X\n\nOperator;Smith\nDate;2024-05-01\nRange;80 cm\n", "Lines 1 to 5 are"),
        ("Distance sensor, serial 0042\nGap 5 mm, gain 8\n", "Lines 1 to 2 are"),
        ("Range;80\nGain;8\n", "Lines 1 to 2 are"),
    ],
)
def test_text_above_a_certain_header_is_skipped_and_told(file, above, lines):
    curve = read_calibration(file(above + TABLE))
    assert (curve.distances.tolist(), curve.outputs.tolist()) == ([0, 0.005], [2.5, 1.5])
    assert curve.source.notes[0] == f"{lines} above the header and {'is' if 'Line ' in lines else 'are'} not read."
    assert curve.source.notes[1:] == (
        "Read: distance from 'distance [mm]' [mm], output from 'output [V]' [V]; semicolons separate the columns, the "
        "comma is the decimal sign.",
    )


def test_a_preamble_padded_by_a_spreadsheet_is_skipped(file):
    text = "Sensor X,,,\nRange,80,,\nGain,8,,\ndistance [mm],output [V],side,day\n0,,a,1\n5,1,a,1\n"
    curve = read_calibration(file(text))
    assert (curve.outputs.tolist(), curve.label, curve.source.dropped) == ([1], "side=a, day=1", 1)


def test_units_in_a_line_of_their_own_are_read(file):
    for line, text in (
        (2, "Distance;Voltage;gain\nmm;mV;\n0;2500;1\n"),
        (3, "Bench\nDistance\tVoltage\n(mm)\t(mV)\n0\t2500\n"),
    ):
        curve = read_calibration(file(text))
        assert (curve.distances.tolist(), curve.outputs.tolist(), curve.unit) == ([0], [2.5], "V")
        assert curve.source.notes[-1] == f"The units are those of line {line}."


# --- settings, counts and second outputs


def test_settings_are_no_outputs_but_tell_curves_apart(file):
    rows = "".join(f"{d},{c},{y * c / 20:g}\n" for c in (20, 50) for d, y in ((0, 2), (5, 1), (10, 0.5)))
    for output in ("output [V]", "detector [V]", "phototransistor"):
        curves = read_calibrations(file(f"distance [mm],current [mA],{output}\n{rows}"))
        assert [c.label for c in curves] == ["current [mA]=20", "current [mA]=50"]
        assert curves[0].outputs.tolist() == [2, 1, 0.5]


@pytest.mark.parametrize(
    "name",
    ["drive current [mA]", "gain", "temperature [°C]", "integration time [ms]", "supply voltage [V]", "LED_power"],
)
def test_the_output_is_what_no_setting_is(file, name):
    curve = read_calibration(file(f"distance [mm],{name},signal [V]\n0,5,2\n5,5,1\n"))
    assert (curve.outputs.tolist(), curve.label) == ([2, 1], f"{name}=5")


def test_a_setting_that_drifts_tells_no_curves_apart(file):
    text = "".join(f"{d},{23 + d / 100},{90 - d}\n" for d in range(20))
    curve = read_calibration(file(f"distance [mm],temperature [°C],output [counts]\n{text}"))
    assert len(curve.outputs) == 20
    assert curve.source.notes == ("Column 'temperature [°C]' is not used: it changes within the curve.",)


def test_a_current_is_the_output_where_nothing_else_is(file):
    for text in ("distance [mm],current [mA]\n0,2\n5,1\n", "distance [mm],current [mA],gain\n0,2,8\n5,1,8\n"):
        curve = read_calibration(file(text))
        assert (curve.outputs.tolist(), curve.unit) == ([2, 1], "mA")
        assert any(
            "'current [mA]' has the name of a sensor setting, but is used as the sensor output" in n
            for n in curve.source.notes
        )


def test_a_column_that_counts_the_rows_is_no_label(file):
    for name in ("", "index", "#", "Unnamed: 0"):
        curve = read_calibration(file(f"{name};distance [mm];output [V]\n" + "".join(f"{i};{i};9\n" for i in range(6))))
        assert len(curve.outputs) == 6
        assert "counts the rows" in curve.source.notes[-1]


def test_what_never_changes_is_no_output_where_something_else_may_be(file):
    for columns in ("voltage [V],current [uA]", "output,detector [V]", "detector [V],reading"):
        curve = read_calibration(file(f"distance [mm],{columns}\n0,5,9\n5,5,8\n10,5,7\n"), labels=[])
        assert curve.outputs.tolist() == [9, 8, 7]
    assert read_calibration(file("distance [mm],output,gain\n0,5,9\n5,5,9\n")).outputs.tolist() == [5, 5]


# --- what somebody says about the columns

EQUAL = "distance [mm],output,output\n0,9,8\n1,8,6\n2,7,4\n3,6,2\n"


def test_of_two_equal_headers_one_is_chosen_by_its_number(file):
    with pytest.raises(CalibrationDataError, match=r"the columns 2: 'output' and 3: 'output' may") as error:
        read_calibration(file(EQUAL))
    assert str(error.value).endswith(f' with the option --columns "output=2" {REMEDY}')
    for columns in (
        {"output": 3},
        {"output": "3"},
        {"output": "3 [counts]"},
        {"distance": "distance [mm]", "output": 3},
    ):
        curve = read_calibration(file(EQUAL), columns=columns)
        assert curve.outputs.tolist() == [8, 6, 4, 2]
        assert any("Column 2 ('output') is not used" in note for note in curve.source.notes)


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("distance,output\n0,2000\n5,1000\n", {"distance": "[mm]", "output": "[mV]"}),
        ("a,b,c\n0,7,2000\n5,7,1000\n", {"distance": "1 [mm]", "output": "3 [mV]"}),
        ("a,b,c\n0,7,2000\n5,7,1000\n", {"distance": "A [mm]", "output": "C [mV]"}),
        ("0,7,2000\n5,7,1000\n", {"distance": "1 [mm]", "output": "3 [mV]"}),
        ("Bench 4\nNo 5\n0,7,2000\n5,7,1000\n", {"distance": "1 [mm]", "output": "3 [mV]"}),
        ("0,0 7 2000,0\n5,0 7 1000,0\n", {"distance": "1 [mm]", "output": "3 [mV]"}),
        ("Bench 4\nNo 5\na,b,c\n0,7,2000\n5,7,1000\n", {"distance": "a [mm]", "output": "3 [mV]"}),
        ("Bench 4\nNo 5\na,b,c\n0,7,2000\n5,7,1000\n", {"distance": "1 [mm]", "output": "3 [mV]"}),
        ("range [mm],distance [mm],output [mV]\n0,5,2000\n5,5,1000\n", {"distance": "range"}),
        ("output [mV],range [mm],voltage [V]\n2000,0,3\n1000,5,3\n", {"output": 1}),
        ("distance [mm],range [mm],output [V]\n5,0,2\n5,5,1\n", {"distance": 2, "output": "output"}),
    ],
)
def test_columns_are_chosen_by_header_number_and_unit(file, text, columns):
    curve = read_calibration(file(text), columns=columns)
    assert (curve.distances.tolist(), curve.outputs.tolist(), curve.unit) == ([0, 0.005], [2, 1], "V")


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"range": 1}, "columns: found the key 'range', but only the keys 'distance' and 'output' are allowed"),
        ({"output": 0}, "columns: found '0' for the output column, expected a number from 1 to 3"),
        ({"output": True}, "columns: found True for the output column, expected a column header, a column number"),
        ({"output": " "}, "columns: found ' ' for the output column, expected a column header"),
        (
            {"output": "height"},
            "columns: found 'height' for the output column, expected one of 'distance [mm]', 'output', 'output'",
        ),
        (
            {"output": "output"},
            "for the output column. This name is ambiguous. The columns 2 and 3 of the file sensor.csv have",
        ),
        ({"distance": "[V]"}, "columns: found the unit 'V' for the distance, expected a unit of length such as mm"),
        (
            {"distance": "1 [cm]", "output": 2},
            "two units for the distance. The option gives the unit 'cm', but the column header 'distance [mm]' gives "
            "the unit 'mm'. Give only one unit",
        ),
        ({"distance": 2, "output": 2}, "columns: column 2 is given as the distance and also as the output"),
    ],
)
def test_a_choice_that_cannot_be_is_refused(file, columns, message):
    with pytest.raises(CalibrationDataError) as error:
        read_calibration(file(EQUAL), columns=columns)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,5,10,inf\n9,5,3,1\n", "line 1: the distances '0', '5', '10', ... have no unit; write the unit into each"),
        ("0,5,10,inf\n9,5,3,1\n", f'--columns "distance=[UNIT]" {REMEDY}'),
        ("sensor,0,5,10\na,9,5,3\n", "line 1: the distances '0', '5', '10' have no unit"),
        ("0,5,10,20\n9,5,3,1\n", 'line 1: the first row contains numbers, but a header such as "distance [mm],'),
        ("0,5,10,20\n9,5,3,1\n", '. If these numbers are distances, use --columns "distance=[UNIT]"'),
        ("1,1cm,2mm\n9,5,3\n", "line 1: the header '1' has no unit, and the units of the other headers differ"),
        ("-1cm,2cm\n9,5\n", "line 1: found the distance '-1 cm', which must not be negative"),
        ("0cm,1e400cm\n9,5\n", "line 1: found the distance '1e400 cm', expected a number of a magnitude"),
        ("0cm,1e99cm\n9,5\n", "line 1: found the distance '1e99 cm', expected a number of a magnitude"),
        ("0cm,1cm\n9,x\n", "line 2: found 'x' in column '1cm', expected a number"),
        ("0cm,0cm\n9,x\n", "line 2: found 'x' in column 2 ('0cm'), expected a number"),
        ("0cm,1cm\n9,5,3\n", "line 2: this row has 3 cells, but the header has 2 cells"),
        ("0cm,inf\n,5\n", "every reading was taken without an object"),
        ("0cm,1cm\n", "has a header but no rows below the header"),
        ("distance [mm] output [V]\n0 9\n5\n", "line 3: this row has 1 cell, but the header has 2 cells"),
        ("drive current [mA] distance [mm] output [V]\n20 0\n20 0 9\n20 1 8\n",
         "line 2: this row has 2 cells, but the header has 3 cells; if blanks"),
        ("day sensor distance [mm] sensor output [V]\n1 1 0 9\n1 1 5\n",
         "line 2: this row has 4 cells, but the header has 5 cells; if blanks"),
        ("distance [mm] output [V]\n0 9\n5 x\n", "line 3: found 'x' in column 'output [V]'"),
        ("distance [mm],output [V]\n0,9\nend of file\n",
         "line 3: this row has 1 cell, but the header has 2 cells; put # before a line"),
        ("Bench 4\nSerial 5\na,b\n0,2\n5,1\n", "line 1: found 'Bench 4', but a header such as"),
        ("Bench 4\nSerial 5\na,b\n0,2\n5,1\n", "The first row of numbers is in line 4. Put # before every line above"),
        ("Bench 4\nSerial 5\n0 2\n5 1\n", "line 1: found 'Bench 4', but a header such as"),
        ("1,2\n2,3\ndistance [mm],output [V]\n0,2\n", "line 1: found the numbers '1,2' above the header in line 3"),
        ("Bench 4\ndistance,output [V]\n0,2\n", "line 2: found 'distance', a distance without a unit"),
        ("distance,output [V]\n0,2\n", f'or use the option --columns "distance=1 [UNIT]" {REMEDY}'),
        ("distance [mm],drive current [mA],gain\n0,8,2\n", f'--columns "distance=1,output=2" {REMEDY}'),
        ("distance [mm],output [V],object\n0,1,a\n1,1,b\n2,1,c\n3,1,d\n", "use --labels none. In Python and in"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_sentence_with_its_line(file, text, message):
    with pytest.raises(CalibrationDataError) as error:
        read_calibrations(file(text))
    assert message in str(error.value)
    assert str(error.value).startswith("sensor.csv")
    assert "\n" not in str(error.value)


@pytest.mark.slow(keep=4)
@pytest.mark.parametrize("part", ["x", "1", "[", "(a", "a b", "1 ", "a_", '"', "1,", "distance "])
def test_lines_of_any_length_are_refused_in_one_sentence(file, part):
    """Patterns whose effort grows with the square of the length would take hours."""
    starts = r"found '|this row has \d+ cells?|the table has only one column \('|the first row contains numbers"
    long = part * (190_000 // len(part))  # longer lines are refused for their length
    for text in (f"distance [mm],output [V]\n0,1\n1,{long}\n", f"{long}\n0,1\n"):
        with pytest.raises(
            CalibrationDataError,
            match=rf"sensor\.csv, line \d+: ({starts})",
        ) as error:
            read_calibration(file(text))
        assert len(str(error.value)) < 1000
