"""Tables as people have them are read right, or refused with a remedy that leads to the right result."""

import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from fuzz.mutated_tables import finds
from pretouch._core.errors import CalibrationDataError, InvalidInputError, SourceError
from pretouch.calibration import read_calibration, read_calibrations
from pretouch.recording import read_recording
from pretouch.recording.sources.lines import LineFormat, LineParser
from table_kinds import KINDS, MORE_KINDS, RECORDINGS, TIMES, Kind, Readings, readings

SEEDS = (1, 2, 3)


def remedied(text: str, message: str, kind: Kind) -> tuple[str, dict[str, str]]:
    """Follow the remedy of a message literally, with the true unit in place of UNIT."""
    chosen = re.search(r'--columns "([^"]*)"', message)
    if chosen:
        option = chosen[1].replace("UNIT", kind.distance_unit)
        return text, dict(part.split("=") for part in option.split(","))
    if kind.remedy is not None:
        return kind.remedy(text), {}
    line = re.search(r"line (\d+): .*ut # before", message)
    if line:
        lines = text.splitlines(keepends=True)
        lines[int(line[1]) - 1] = f"# {lines[int(line[1]) - 1]}"
        return "".join(lines), {}
    assert "without a separator of thousands" in message
    return re.sub(r'"(\d+),(\d+)"', r"\1\2", text), {}


def curves(path, text: str, kind: Kind):
    """Read all curves of a table, following remedies as long as it is refused."""
    columns: dict[str, str] = {}
    for _ in range(3):
        path.write_text(text, encoding="utf-8")
        try:
            return read_calibrations(path, columns=columns)
        except CalibrationDataError as error:
            if not kind.refused:
                raise
            text, more = remedied(text, str(error), kind)
            columns |= more
    raise AssertionError("the remedies do not help")


@pytest.mark.parametrize(
    ("kind", "seed"),
    [(kind, seed) for kind in KINDS for seed in SEEDS] + [(kind, 2) for kind in MORE_KINDS],
    ids=lambda each: each.name if isinstance(each, Kind) else str(each),
)
def test_a_table_is_read_right_or_refused_with_a_remedy_that_works(tmp_path, kind: Kind, seed: int) -> None:
    made = readings(seed)
    text = kind.write(made).replace("\n", ("\n", "\r\n", "\n")[seed - 1])
    found = curves(tmp_path / "table.txt", text, kind)
    assert len(found) == kind.sensors
    for curve in found:
        order = np.argsort(curve.distances, kind="stable")
        distances = np.repeat(made.distances, kind.per_distance) / 1000
        assert curve.distances[order] == pytest.approx(distances, rel=kind.tolerance)
        assert curve.outputs[order] == pytest.approx(np.repeat(kind.output(made), kind.per_distance), rel=1e-12)
        assert curve.unit == kind.unit
    assert len(found[0].no_object) == 3 * (kind.name == "no target")


def test_the_kinds_are_as_many_as_documented() -> None:
    assert len(KINDS) * len(SEEDS) + len(MORE_KINDS) + len(TIMES) + len(RECORDINGS) >= 250


VALUES = [500 + i % 7 for i in range(400)]


@pytest.mark.parametrize("title", TIMES)
def test_times_of_a_recording_are_read_with_their_unit_and_rate(tmp_path, title: str) -> None:
    rows = [f"{TIMES[title](i, 0.005 * i)};{value}" for i, value in enumerate(VALUES)]
    (tmp_path / "table.csv").write_text("\n".join([f"{title};prox", *rows]) + "\n", encoding="utf-8")
    recording = read_recording(tmp_path / "table.csv")
    assert np.diff(recording.stamps) == pytest.approx(
        np.full(len(VALUES) - 1, 5e6), abs=1100
    )  # clocks have milliseconds
    assert recording.values.tolist() == VALUES
    assert "200 Hz" in recording.read[0]


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_recording_is_read_with_its_times(tmp_path, name: str) -> None:
    above, topic, write = RECORDINGS[name]
    text = above + "".join(write(i, 0.005 * i, value) for i, value in enumerate(VALUES))
    (tmp_path / "recording.log").write_text(text, encoding="utf-8")
    recording = read_recording(tmp_path / "recording.log", topic)
    assert recording.values.tolist() == VALUES
    assert np.diff(recording.stamps) == pytest.approx(np.full(len(VALUES) - 1, 5e6), abs=1100)
    assert any("clock was set" in note for note in recording.notes) == name.startswith("a clock")


NO_TIMES = {
    "a header": ("prox\n", "{v}\n", ""),
    "no header": ("", "{v}\n", ""),
    "two columns": ("prox,als\n", "{v},7\n", "prox"),
    "two columns without a header": ("", "7;{v}\n", "column 2"),
    "labels": ("", "prox: {v}, als: 7\n", "prox"),
    "a number of the reading": ("sample,prox\n", "{i},{v}\n", "prox"),
    "times that are too coarse": ("time [s],prox\n", "{s},{v}\n", "prox"),
}


@pytest.mark.parametrize("name", NO_TIMES)
def test_a_recording_without_times_is_read_at_a_stated_rate(tmp_path, name: str) -> None:
    head, row, topic = NO_TIMES[name]
    path = tmp_path / "log.txt"
    path.write_text(head + "".join(row.format(v=v, i=i, s=i // 200) for i, v in enumerate(VALUES)))
    with pytest.raises((CalibrationDataError, InvalidInputError)) as error:
        read_recording(path, topic)
    assert "--rate" in str(error.value)
    recording = read_recording(path, topic, rate=200.0)
    assert recording.values.tolist() == VALUES
    assert np.unique(np.diff(recording.stamps)).tolist() == [5_000_000]
    assert recording.clock == "rate"
    assert "stated rate: 200 Hz" in recording.read[0]


def test_missing_numbers_of_readings_are_gaps_at_a_stated_rate(tmp_path) -> None:
    (tmp_path / "log.csv").write_text("seq,prox\n" + "".join(f"{i},{i % 7}\n" for i in range(400) if i % 10))
    recording = read_recording(tmp_path / "log.csv", rate=100.0)
    assert np.unique(np.diff(recording.stamps)).tolist() == [10_000_000, 20_000_000]


@pytest.mark.parametrize("rate", [0.0, -5.0, math.nan, math.inf])
def test_a_rate_is_refused_that_is_none_or_that_the_times_show(tmp_path, rate: float) -> None:
    (tmp_path / "log.csv").write_text("time [s],prox\n" + "".join(f"{i / 100},{i % 7}\n" for i in range(400)))
    for stated in (rate, 50.0):
        with pytest.raises((CalibrationDataError, InvalidInputError)) as error:
            read_recording(tmp_path / "log.csv", rate=stated)
        assert ("100 Hz" in str(error.value)) == (stated == 50.0)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_a_log_without_a_header_gets_the_line_to_write_above_it(tmp_path, mark: str) -> None:
    """Following the remedy with the true unit reads the log."""
    rows = "".join(mark.join([f"{1000 * i}", f"{v}", f"{-i}", "0", "0"]) + "\n" for i, v in enumerate(VALUES))
    (tmp_path / "log.csv").write_text(rows)
    with pytest.raises(CalibrationDataError) as error:
        read_recording(tmp_path / "log.csv")
    line = re.search(r'write the line "([^"]*)" above it', str(error.value))[1]
    (tmp_path / "log.csv").write_text(line.replace("UNIT", "us") + "\n" + rows)
    recording = read_recording(tmp_path / "log.csv", "column 2")
    assert recording.values.tolist() == VALUES
    assert np.unique(np.diff(recording.stamps)).tolist() == [1_000_000]


def test_a_number_before_labels_is_a_time_if_it_rises(tmp_path) -> None:
    (tmp_path / "log.txt").write_text("".join(f"{4999 + 5 * i} L:{v} R:7\n" for i, v in enumerate(VALUES)))
    recording = read_recording(tmp_path / "log.txt", "L")
    assert recording.values.tolist() == VALUES
    assert np.unique(np.diff(recording.stamps)).tolist() == [5_000_000]


def test_the_range_of_echoed_messages_bounds_their_distances(tmp_path) -> None:
    rows = "".join(f"{1_700_000_000 + i},500000000,ir,1,0.1,0.02,4.0,{0.1 + i / 1000}\n" for i in range(150))
    (tmp_path / "echo.csv").write_text(rows)
    recording = read_recording(tmp_path / "echo.csv", "range")
    assert (recording.kind, recording.bounds) == ("distance", (0.02, 4.0))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the file is empty"),
        ("\n \n", "the file is empty"),
        ("# distance [mm],output [V]\n", "only comments"),
        ("distance [mm],output [V]\n", "no rows below the header"),
        ("<!DOCTYPE html><html><body>Log in</body></html>\n", "page of HTML"),
        ("<?xml version='1.0'?><data><p d='5' v='2'/></data>\n", "page of HTML or XML"),
    ],
)
def test_a_file_without_a_table_is_refused_with_what_to_do(tmp_path, text: str, says: str) -> None:
    (tmp_path / "x.csv").write_text(text)
    for read in (read_calibrations, read_recording):
        if text.startswith("distance") and read is read_recording:
            (tmp_path / "x.csv").write_text("time [s],prox\n")
        with pytest.raises((CalibrationDataError, InvalidInputError)) as error:
            read(tmp_path / "x.csv")
        assert says in str(error.value)


@pytest.mark.parametrize("leader", ["Distance: {d} mm", "ADC: {c}"])
def test_alternating_lines_that_can_be_paired_in_two_ways_are_refused_with_both(tmp_path, leader: str) -> None:
    made = readings(1)
    other = "ADC: {c}" if leader.startswith("D") else "Distance: {d} mm"
    pairs = [
        (leader.format(d=d, c=c), other.format(d=d, c=c)) for d, c in zip(made.distances, made.counts, strict=True)
    ]
    lines = [line for pair in pairs for line in pair]
    for cut, kept in ((lines[:-1], pairs[:-1]), (lines[1:], None)):
        (tmp_path / "x.log").write_text("\n".join(cut) + "\n")
        with pytest.raises(CalibrationDataError) as error:
            read_calibrations(tmp_path / "x.log")
        at_end, at_start = map(int, re.findall(r"remove line (\d+)", str(error.value)))
        rest = [line for i, line in enumerate(cut, start=1) if i != (at_end if kept else at_start)]
        (tmp_path / "x.log").write_text("\n".join(rest) + "\n")
        curve = read_calibrations(tmp_path / "x.log")[0]
        whole = slice(None, -1) if kept else slice(1, None)
        assert 1000 * curve.distances == pytest.approx(made.distances[whole])
        assert curve.outputs.tolist() == list(made.counts[whole])


def test_incomplete_groups_of_lines_are_left_out_and_counted(tmp_path) -> None:
    made = readings(2)
    lines = [
        line for d, c in zip(made.distances, made.counts, strict=True) for line in (f"Distance: {d} mm", f"ADC: {c}")
    ]
    del lines[6]  # a distance
    (tmp_path / "x.log").write_text("\n".join(lines) + "\n")
    curve = read_calibrations(tmp_path / "x.log")[0]
    assert len(curve.distances) == len(made.distances) - 1
    assert made.distances[3] / 1000 not in curve.distances
    assert not len(curve.no_object)
    assert any("incomplete groups of 2 lines" in note for note in curve.source.notes)


def test_each_reading_belongs_to_the_distance_above_it(tmp_path) -> None:
    made = readings(3)
    text = "".join(
        f"Distance: {d} mm\nADC: {c}\nADC: {c + 1}\n" for d, c in zip(made.distances, made.counts, strict=True)
    )
    (tmp_path / "x.log").write_text(text)
    curve = read_calibrations(tmp_path / "x.log")[0]
    assert curve.distances == pytest.approx(np.repeat(made.distances, 2) / 1000)
    assert curve.outputs.tolist() == [c + k for c in made.counts for k in (0, 1)]


@pytest.mark.parametrize(
    ("rest", "count"), [("812,815,811", 0), ("812, 815, 811", 3), ("812 815 811", 3), ("8.12,8.15", 2)]
)
def test_commas_between_readings_behind_a_distance_are_no_decimal_signs(tmp_path, rest: str, count: int) -> None:
    (tmp_path / "x.txt").write_text("".join(f"{d} mm: {rest}\n" for d in (5, 10, 20, 40)))
    if not count:
        with pytest.raises(CalibrationDataError, match="may be decimal signs or separate readings"):
            read_calibrations(tmp_path / "x.txt")
        return
    assert len(read_calibrations(tmp_path / "x.txt")[0].outputs) == 4 * count


@pytest.mark.parametrize(
    ("read", "header"), [(read_calibrations, "distance [mm],output"), (read_recording, "time [s],output")]
)
def test_another_table_behind_the_first_is_refused(tmp_path, read, header: str) -> None:
    rows = "".join(f"{i / 100},{500 - i}\n" for i in range(20))
    (tmp_path / "x.csv").write_text(f"{header}\n{rows}time,temperature\n{rows}")
    with pytest.raises(CalibrationDataError, match=r"line 22: .* header of another table"):
        read(tmp_path / "x.csv")


def test_tables_with_titles_in_one_file_are_curves_with_these_names(tmp_path) -> None:
    made = readings(1)
    rows = "".join(f"{d},{v}\n" for d, v in zip(made.distances, made.volts, strict=True))
    header = "distance [mm],output [V]\n"
    (tmp_path / "x.csv").write_text(f"Left\n{header}{rows}\nRight\n{header}{rows}")
    curves = read_calibrations(tmp_path / "x.csv")
    assert [curve.label for curve in curves] == ["table=Left", "table=Right"]
    assert all(curve.distances == pytest.approx(np.array(made.distances) / 1000) for curve in curves)


@pytest.mark.parametrize(
    "form", ["10:12:{s:06.3f} -> {c}", "[10:12:{s:06.3f}] {c}", '{{"t": {s:.3f}, "prox": {c}}}', "t={s:.3f} prox={c}"]
)
def test_lines_of_a_monitor_are_a_recording(tmp_path, form: str) -> None:
    lines = [form.format(s=33 + 0.005 * i, c=value) for i, value in enumerate(VALUES)]
    (tmp_path / "monitor.log").write_text("\n".join(lines) + "\n", encoding="utf-8")
    recording = read_recording(tmp_path / "monitor.log")
    assert np.diff(recording.stamps) == pytest.approx(np.full(len(VALUES) - 1, 5e6), abs=1)
    assert recording.values.tolist() == VALUES


def test_seconds_and_nanoseconds_in_two_columns_are_one_time(tmp_path) -> None:
    rows = [f"17,{5_000_000 * i},{value / 1000}" for i, value in enumerate(VALUES[:150])]
    header = "header.stamp.sec,header.stamp.nanosec,range"
    (tmp_path / "x.csv").write_text("\n".join([header, *rows]) + "\n")
    recording = read_recording(tmp_path / "x.csv", "range [m]")
    assert (np.diff(recording.stamps) == 5_000_000).all()
    assert recording.kind == "distance"


def test_integer_times_whose_unit_no_rate_tells_are_refused_with_a_remedy_that_works(tmp_path) -> None:
    rows = "".join(f"{i},{value}\n" for i, value in enumerate(VALUES))
    (tmp_path / "x.csv").write_text(f"time,prox\n{rows}")
    with pytest.raises(CalibrationDataError) as error:
        read_recording(tmp_path / "x.csv")
    found = re.search(r'rename the column to "([^"]*)"', str(error.value))
    assert found
    (tmp_path / "x.csv").write_text(f"{found[1].replace('UNIT', 'ms')},prox\n{rows}")
    assert (np.diff(read_recording(tmp_path / "x.csv").stamps) == 1_000_000).all()


def test_an_implausible_rate_is_said(tmp_path) -> None:
    (tmp_path / "x.csv").write_text("time [s],prox\n" + "".join(f"{37 * i},{v}\n" for i, v in enumerate(VALUES)))
    assert any("Check the unit of the times" in note for note in read_recording(tmp_path / "x.csv").notes)


def test_damaged_rows_of_a_recording_are_left_out_and_counted(tmp_path) -> None:
    rows = [f"{0.005 * i:.3f},{value}" for i, value in enumerate(VALUES)]
    rows[50:50] = ["boot ok"]
    rows[99] = f"{rows[99]},7"
    (tmp_path / "x.csv").write_text("\n".join(["time [s],prox", *rows, "2.0"]) + "\n")
    recording = read_recording(tmp_path / "x.csv")
    assert len(recording.values) == len(VALUES) - 1
    assert any("rows with another number of cells than the header: 3." in note for note in recording.notes)


def test_outputs_in_millivolts_are_volts_as_in_a_calibration(tmp_path) -> None:
    (tmp_path / "x.csv").write_text(
        "time [s],prox [mV]\n" + "".join(f"{0.01 * i:.2f},{v}\n" for i, v in enumerate(VALUES))
    )
    assert read_recording(tmp_path / "x.csv").values[0] == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize(("unit", "is_doubted"), [("mm", True), ("cm", False), ("m", True)])
def test_an_unlikely_unit_of_the_distances_is_doubted(tmp_path, unit: str, is_doubted: bool) -> None:
    rows = "".join(f"{0.5 * i},{900 / (1 + i)}\n" for i in range(1, 9 if unit != "m" else 12))
    (tmp_path / "x.csv").write_text(f"distance [{unit}],output [V]\n{rows}")
    notes = read_calibrations(tmp_path / "x.csv")[0].source.notes
    assert any("check the unit of the distances" in note for note in notes) == is_doubted


# --- the lines of a recording at the bench


def parsed(lines: str, **layout: str) -> list[tuple[float, float | None]]:
    """Return outputs and distances of lines."""
    parser = LineParser("a sensor", LineFormat(**layout), from_middle=False)
    return [(reading.output, reading.distance) for reading in parser.feed(lines.encode())]


@pytest.mark.parametrize(
    ("line", "layout"),
    [
        ("2,5;3,392", {"distance_column": "1", "column": "2"}),
        ("2,5 3,392", {"distance_column": "1", "column": "2"}),
        ("2.5,3.392", {"distance_column": "1", "column": "2"}),
        ("2.5 mm\t3.392 V", {"distance_column": "1", "column": "2"}),
        ("0.25 cm;3.392", {"distance_column": "1", "column": "2"}),
        ("d:2.5,v:3.392", {"distance_column": "d", "column": "v"}),
        ("d=0.25cm v=3.392", {"distance_column": "d", "column": "v"}),
        ('{"d": 2.5, "v": 3.392}', {"distance_column": "d", "column": "v"}),
        ("10:12:33.000 -> 2.5,3.392", {"distance_column": "1", "column": "2"}),
        ("distance_cm,v\n0.25,3.392", {"distance_column": "distance_cm", "column": "v"}),
    ],
)
def test_lines_are_read_by_the_rules_of_files(line: str, layout: dict[str, str]) -> None:
    ((output, distance),) = parsed(f"{line}\n", **layout)
    assert (output, distance) == (pytest.approx(3.392, rel=1e-12), pytest.approx(0.0025, rel=1e-12))


LINES = {
    **dict.fromkeys(
        ("inches in words", "name and inches", "in inches", "unit alone", "volts in V", "one word"), ("1", "2")
    ),
    **dict.fromkeys(
        ("capital units", "half capital units", "units as in physics", "German", "index in brackets"), ("1", "2")
    ),
    **dict.fromkeys(("units in cells", "units glued to cells", "uncertainties", "mean and deviation"), ("1", "2")),
    **dict.fromkeys(("no header", "no target", "overload", "tabs and a remark", "two outputs"), ("1", "2")),
    **dict.fromkeys(("monitor", "monitor with header", "left and right"), ("1", "2")),
    **dict.fromkeys(("serial plotter", "JSON lines"), ("distance_mm", "prox")),
    "data frame with index": ("distance_mm", "adc"),
    "time of each reading": ("distance_mm", "prox"),
    "milliseconds of each reading": ("2", "3"),
    "labels and units": ("Distance", "ADC"),
    "short labels": ("d", "v"),
    "YAML": ("distance_mm", "value"),
}
"""The kinds of tables that a sensor can send line by line, with the columns of distance and output."""


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.name in LINES], ids=lambda kind: kind.name)
def test_the_lines_of_a_table_are_read_as_the_table_is(kind: Kind) -> None:
    made = readings(2)
    distance, column = LINES[kind.name]
    found = [
        pair for pair in parsed(kind.write(made), distance_column=distance, column=column) if math.isfinite(pair[1])
    ]
    assert [pair[1] for pair in found] == pytest.approx(np.array(made.distances) / 1000, rel=kind.tolerance)
    assert [pair[0] for pair in found] == pytest.approx(kind.output(made), rel=1e-12)


PAIRS = "".join(f"Distance: {d} mm\nADC: {900 - d}\n" for d in (5, 10, 15))
TURNED = "".join(f"ADC: {900 - d}\nDistance: {d} mm\n" for d in (5, 10, 15))


@pytest.mark.parametrize("column", ["ADC", ""])
@pytest.mark.parametrize("text", [PAIRS, TURNED, PAIRS.replace("Dist", "\nDist")])
def test_two_lines_that_belong_together_are_one_reading(text: str, column: str) -> None:
    found = parsed(text, distance_column="Distance", column=column)
    assert found == [(900 - d, pytest.approx(d / 1000)) for d in (5, 10, 15)]


def test_a_recording_that_begins_between_two_lines_stops_unless_blank_lines_separate_the_pairs() -> None:
    layout = LineFormat(distance_column="Distance", column="ADC")
    with pytest.raises(SourceError, match="the distance before it or behind it"):
        LineParser("a sensor", layout, from_middle=True).feed(PAIRS.encode())
    apart = LineParser("a sensor", layout, from_middle=True).feed(TURNED.replace("ADC", "---\nADC").encode())
    assert [(r.output, r.distance) for r in apart] == [(900 - d, pytest.approx(d / 1000)) for d in (10, 15)]
    assert apart[0].line == b"ADC: 890 | Distance: 10 mm"


def test_a_line_whose_other_line_is_missing_is_left_out_and_counted() -> None:
    parser = LineParser("a sensor", LineFormat(distance_column="Distance", column="ADC"), from_middle=False)
    readings_left = parser.feed(PAIRS.replace("Distance: 10 mm\n", "").encode())
    assert [reading.distance for reading in readings_left] == pytest.approx([0.005, 0.015])
    assert any("1 lines of pairs" in note for note in parser.notes)


def test_lines_without_a_distance_among_whole_ones_are_no_pairs() -> None:
    text = '{"gap": 5, "y": 7}\n{"y": 6}\n{"gap": 8}\n{"gap": 9, "y": 4}\n'
    found = parsed(text, distance_column="gap", column="y")
    assert found == [(7, pytest.approx(0.005)), (4, pytest.approx(0.009))]


def test_an_echoed_topic_is_recorded_by_its_field() -> None:
    documents = "".join(f"header:\n  stamp:\n    sec: 17\n    nanosec: {i}\nrange: 0.{i}\n---\n" for i in (1, 2, 3))
    assert [output for output, _ in parsed(documents, column="range")] == [0.1, 0.2, 0.3]
    assert [output for output, _ in parsed("17,500,ir,1,0.1,0.02,4.0,0.12\n", column="8")] == [0.12]


@pytest.mark.parametrize("line", ["2,5", "1,250;3,392"])
def test_a_line_that_can_be_read_in_two_ways_ends_the_recording_with_both(line: str) -> None:
    layout = {} if line == "2,5" else {"distance_column": "1", "column": "2"}
    with pytest.raises(SourceError) as error:
        parsed(f"{line}\n", **layout)
    one, other = ("2.5", "2 and 5") if line == "2,5" else ("1.250", "1250")
    assert one in str(error.value)
    assert other in str(error.value)
    options = [shlex.split(found)[1] for found in re.findall(r"--decimal \"[.,]\"", str(error.value))]
    for mark in options:
        assert parsed(f"{line}\n", **layout, decimal_mark=mark)


def test_a_unit_of_the_lines_that_contradicts_the_option_is_refused() -> None:
    with pytest.raises(SourceError, match="cm"):
        parsed("d:2.5cm,v:3\n", distance_column="d", column="v", distance_unit="mm")
    with pytest.raises(InvalidInputError):
        LineFormat(decimal_mark=";")


def test_the_readings_differ_between_seeds() -> None:
    assert len({readings(seed) for seed in SEEDS}) == len(SEEDS)
    assert isinstance(readings(1), Readings)


def test_mutated_tables_are_read_or_refused_and_lose_nothing_in_silence(tmp_path) -> None:
    """`make fuzz` tries many more, from other seeds."""
    assert finds(300, 5, tmp_path) == []


# --- tables that a newcomer tried


def rows(*columns, mark=",") -> str:
    return "".join(mark.join(map(str, row)) + "\n" for row in zip(*columns, strict=True))


FALLING = (3300, 2280, 1660, 1266, 997, 666, 485)
PLACES = (0, 5, 10, 15, 20, 30, 40)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        (
            "distance [mm];counts\n" + rows(PLACES, ("3.300", "2.280", "1.660", "1.266", 997, 666, 485), mark=";"),
            "3300 or 3.300",
        ),
        ("distance [mm],level [dB]\n" + rows(PLACES, (10, 8, 6, 4, 2, 0, -2)), "10^(x/20)"),
        ("distance [mm],ln(V)\n" + rows(PLACES, (1.2, 1.0, 0.8, 0.6, 0.4, 0.1, -0.2)), "e^x for ln"),
        ("distance_cm [mm],output [V]\n" + rows(PLACES, FALLING), "two units"),
        ("distance [0.1 mm],output [V]\n" + rows(PLACES, FALLING), "multiply the distances by 0.1"),
        ("distance [mm],output [V]\n0,3.30\n,3.31\n,3.29\n5,2.28\n,2.27\n10,1.6\n", "merged"),
        (
            "distance [mm],output [V]\n0,3\n5,2\ndistance [mm],output [V]\n0,1\n5,0.5\n",
            "line 4: the header occurs again",
        ),
        ("distance [mm],output [V]\n0,3\n-5,2\n", "change the sign"),
        ("distance [mm],output [V]\n0,3\n5,2\nrien,0.1\n", "inf if no object was present"),
        (
            "commanded position [mm],encoder position [mm],output [V]\n" + rows(PLACES, PLACES, FALLING),
            "may both contain",
        ),
    ],
)
def test_a_table_that_would_be_read_wrong_is_refused_with_what_to_do(tmp_path, text: str, remedy: str) -> None:
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(CalibrationDataError) as error:
        read_calibrations(tmp_path / "x.csv")
    assert remedy in str(error.value)


@pytest.mark.parametrize(
    "text",
    [
        "distance,output [V]\n0 mm,3300\n0.5 cm,2280\n10 mm,1660\n1.5 cm,1266\n20 mm,997\n30 mm,666\n40 mm,485\n",
        "distance [mm],output [V]\n0,3300\n0.5 cm,2280\n10,1660\n1.5 cm,1266\n20,997\n30,666\n40,485\n",
        "object,distance [mm],output [V]\n" + rows(["white"] * 7, PLACES, FALLING) + "none,inf,100\n",
        "distance [mm],velocity [mm/s],output [V]\n" + rows(PLACES, (-10.1, -10, -9.9, -10, -10.1, -9.9, -10), FALLING),
        "distance [mm],tilt [deg],output [V]\n" + rows(PLACES, (-0.1, 0.0, 0.1, 0.0, -0.1, 0.1, 0.0), FALLING),
        '{"distance_mm": [0, 5, 10, 15, 20, 30, 40], "volts": [3300, 2280, 1660, 1266, 997, 666, 485]}\n',
        "distance [mm],output [V]\n" + rows(PLACES, FALLING) + "kein Objekt,100\n",
    ],
)
def test_a_table_with_mixed_units_scattering_columns_or_labels_of_the_empty_scene_is_one_curve(
    tmp_path, text: str
) -> None:
    (tmp_path / "x.csv").write_text(text)
    (curve,) = read_calibrations(tmp_path / "x.csv")
    assert curve.distances == pytest.approx(np.array(PLACES) / 1000, rel=1e-12)
    assert curve.outputs.tolist() == list(FALLING)


def test_text_in_utf_16_without_a_mark_is_read(tmp_path) -> None:
    text = "distance [mm],output [V]\n" + rows(PLACES, FALLING)
    for encoding in ("utf-16-le", "utf-16-be"):
        (tmp_path / "x.csv").write_bytes(text.encode(encoding))
        assert len(read_calibrations(tmp_path / "x.csv")[0].outputs) == len(PLACES)
    parser = LineParser("a sensor", LineFormat(column="2"), from_middle=False)
    assert [reading.output for reading in parser.feed("5,12\n".encode("utf-16"))] == [12]


def test_a_file_of_an_oscilloscope_with_a_short_second_row_is_read(tmp_path) -> None:
    rows = "".join(f"{i},{0.1 + i % 3}\n" for i in range(50))
    (tmp_path / "x.csv").write_text(f"X,CH1,Start,Increment,\nSequence,VOLT,-6e-3,1e-3\n{rows}")
    recording = read_recording(tmp_path / "x.csv")
    assert (np.diff(recording.stamps) == 1_000_000).all()


def test_an_assumed_unit_of_distances_is_said() -> None:
    for lines, options, is_said in (
        (b"5,12\n", {}, True),
        (b"5,12\n", {"distance_unit": "cm"}, False),
        (b"d_cm,v\n5,12\n", {}, False),
        (b"5 mm,12\n", {}, False),
    ):
        parser = LineParser("a sensor", LineFormat(column="2", distance_column="1", **options), from_middle=False)
        parser.feed(lines)
        assert any("mm was assumed" in note for note in parser.notes) == is_said


DISTANCES = (0, 3, 7, 12, 18, 26, 36, 52)
COUNTS = (9600, 7360, 5396, 3879, 2798, 1976, 1442, 1045)


def grouped(value: int) -> str:
    return f"{value // 1000}.{value % 1000:03d}" if value >= 1000 else str(value)


def test_counts_with_three_decimals_may_be_thousands(tmp_path: Path) -> None:
    """Also if all of them have a point; a fourth decimal makes them decimals."""
    rows = [f"{distance};{grouped(value)}" for distance, value in zip(DISTANCES, COUNTS, strict=True)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Abstand (mm);ADC (counts)", *rows]) + "\n")
    with pytest.raises(CalibrationDataError, match=r"9600 or 9\.600"):
        read_calibration(path)
    path.write_text("\n".join(["Abstand (mm);ADC (counts)", *(row + "0" for row in rows)]) + "\n")
    assert read_calibration(path).outputs.max() == 9.6


def test_points_next_to_decimal_commas_separate_thousands(tmp_path: Path) -> None:
    counts = (*COUNTS, 749)
    rows = [f"{d / 10:.1f}".replace(".", ",") + f";{grouped(v)}" for d, v in zip((*DISTANCES, 80), counts, strict=True)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Abstand (cm);ADC", *rows]) + "\n")
    data = read_calibration(path)
    assert sorted(data.outputs) == sorted(counts)
    assert sorted(data.distances) == pytest.approx([d / 1000 for d in (*DISTANCES, 80)])


def test_thousands_that_come_late_in_a_recording_are_found(tmp_path: Path) -> None:
    readings = [608] * 200 + [988, 1023, 1082, 2417, 1100]
    rows = [f"{5000 + 10 * i};{grouped(value)}" for i, value in enumerate(readings)]
    path = tmp_path / "r.csv"
    path.write_text("\n".join(["Zeit (ms);ADC", *rows]) + "\n")
    with pytest.raises(InvalidInputError, match=r"1023 or 1\.023"):
        read_recording(path)


@pytest.mark.parametrize(
    ("line", "layout", "distance", "output"),
    [
        ('1 1/4";900', {"column": "2", "distance_column": "1"}, 0.03175, 900.0),
        ("1/8 in;9.60k", {"column": "2", "distance_column": "1"}, 0.003175, 9600.0),
        ("4999 L:608 R:295", {"column": "L"}, None, 608.0),
        ("5 L:608 R:295", {"column": "R", "distance_column": "column 1"}, 0.005, 295.0),
    ],
)
def test_lines_of_the_bench_follow_the_rules_of_files(line: str, layout: dict[str, str], distance, output) -> None:
    parser = LineParser("a sensor", LineFormat(**layout), from_middle=False)
    (reading,) = parser.feed(f"{line}\n".encode())
    assert reading.distance == (None if distance is None else pytest.approx(distance))
    assert reading.output == output
