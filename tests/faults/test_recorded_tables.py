"""Recordings as people have them in tables are read right, or refused with a remedy that leads to the right result."""

import re

import numpy as np
import pytest

from pretouch._core.errors import CalibrationDataError, InvalidInputError
from pretouch.config import load_scenario
from pretouch.recording import read_recording, replay

TIME = np.round(0.01 * np.arange(300), 3)
VALUES = [500 + i % 7 for i in range(300)]


def written(path, header: str, rows: list[str]):
    """Write a table and return its path."""
    path = path / "table.csv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def remedy_of(path, topic: str = "", kind: type[Exception] = InvalidInputError) -> str:
    """Return the topic that the refusal of a table proposes."""
    with pytest.raises(kind) as error:
        read_recording(path, topic)
    return re.findall(r"--topic '([^']*)'", str(error.value))[-1]


# --- rows of several sensors


@pytest.mark.parametrize("names", [("left", "right"), ("1", "2")])
@pytest.mark.parametrize("title", ["sensor", "sensor_id", "id", "Channel"])
def test_rows_of_several_sensors_are_refused_until_one_is_chosen(tmp_path, names, title: str) -> None:
    rows = [f"{t},{name},{v + 100 * k}" for t, v in zip(TIME, VALUES, strict=True) for k, name in enumerate(names)]
    path = written(tmp_path, f"time [s],{title},value", rows)
    topic = remedy_of(path)
    assert topic == f"value[{title}={names[0]}]"
    assert remedy_of(path, "value") == topic
    for k, name in enumerate(names):
        chosen = read_recording(path, topic.replace(names[0], name))
        assert chosen.values.tolist() == [v + 100 * k for v in VALUES]
        assert (np.diff(chosen.stamps) == 10_000_000).all()
        assert any("300 of 600" in sentence for sentence in chosen.read)


def test_an_address_may_be_hexadecimal(tmp_path) -> None:
    rows = [f"{t},{name},{v}" for t, v in zip(TIME, VALUES, strict=True) for name in ("0x29", "0x30")]
    path = written(tmp_path, "time [s],address,value", rows)
    assert read_recording(path, "value[address=0x30]").values.tolist() == VALUES


def test_two_columns_that_tell_sensors_apart_are_chosen_one_after_the_other(tmp_path) -> None:
    rows = [f"{t},{d},{s},{v}" for t, v in zip(TIME, VALUES, strict=True) for d in "ab" for s in (1, 2)]
    path = written(tmp_path, "time [s],device,sensor,range [mm]", rows)
    topic = remedy_of(path, remedy_of(path))
    assert topic == "range[device=a, sensor=1]"
    assert len(read_recording(path, topic).values) == len(VALUES)
    assert read_recording(path, f"{topic} [cm]").values[0] == pytest.approx(10 * read_recording(path, topic).values[0])


def test_a_text_that_changes_with_every_row_tells_sensors_apart_whatever_its_name(tmp_path) -> None:
    rows = [f"{t},{'xy'[i % 2]},{v}" for i, (t, v) in enumerate(zip(TIME, VALUES, strict=True))]
    assert remedy_of(written(tmp_path, "time [s],where,value", rows)) == "value[where=x]"


def test_a_state_that_seldom_changes_tells_no_sensors_apart(tmp_path) -> None:
    rows = [f"{t},{('ok', 'warm')[i > 100]},{v}" for i, (t, v) in enumerate(zip(TIME, VALUES, strict=True))]
    assert read_recording(written(tmp_path, "time [s],state,value", rows)).values.tolist() == VALUES


def test_one_sensor_and_the_numbers_of_rows_need_no_choice(tmp_path) -> None:
    rows = [f"{i},{t},7,{v}" for i, (t, v) in enumerate(zip(TIME, VALUES, strict=True))]
    assert read_recording(written(tmp_path, "id,time [s],sensor_id,value", rows)).values.tolist() == VALUES


@pytest.mark.parametrize("topic", ["value[sensor=up]", "value[place=left]"])
def test_a_choice_that_fits_no_row_is_refused(tmp_path, topic: str) -> None:
    rows = [f"{t},{'left' if i % 2 else 'right'},1" for i, t in enumerate(TIME)]
    path = written(tmp_path, "time [s],sensor,value", rows)
    with pytest.raises(InvalidInputError, match=r"'left'|sensor"):
        read_recording(path, topic)


# --- the newest row first


@pytest.mark.parametrize(
    ("title", "cell"),
    [
        ("time [s]", lambda t: f"{t:.3f}"),
        ("time", lambda t: f"{round(1000 * t) + 1_700_000_000_000}"),
        ("t", lambda t: f"{round(1e6 * t)}"),
        ("time", lambda t: f"{'23:59' if t < 1 else '00:00'}:{(59 + t) % 60:06.3f}"),
    ],
)
def test_the_newest_row_may_be_the_first(tmp_path, title: str, cell) -> None:
    rows = [f"{cell(t)},{v}" for t, v in zip(TIME, VALUES, strict=True)][::-1]
    recording = read_recording(written(tmp_path, f"{title},prox", rows))
    assert recording.values.tolist() == VALUES
    assert np.diff(recording.stamps) == pytest.approx(np.full(len(VALUES) - 1, 1e7), abs=1)
    assert any("newest row" in note for note in recording.notes)


# --- names of the time column


@pytest.mark.parametrize(
    "title",
    ["Zeitstempel", "ts", "created_at", "datum/zeit", "Datum / Zeit", "epoch", "unix_time", "Timestamp UTC", "pc_time"],
)
def test_usual_names_of_times_are_known(tmp_path, title: str) -> None:
    rows = [f"2024-05-17 10:12:{32 + t:06.3f};{v}" for t, v in zip(TIME, VALUES, strict=True)]
    recording = read_recording(written(tmp_path, f"{title};prox", rows))
    assert np.diff(recording.stamps) == pytest.approx(np.full(len(VALUES) - 1, 1e7), abs=1)


def test_dates_are_times_whatever_their_name(tmp_path) -> None:
    rows = [f"2024-05-17 10:12:{32 + t:06.3f};{v}" for t, v in zip(TIME, VALUES, strict=True)]
    assert len(read_recording(written(tmp_path, "when it was;prox", rows)).values) == len(VALUES)


def test_a_missing_time_column_is_refused_with_a_remedy_for_dates(tmp_path) -> None:
    rows = [f"10:12:{32 + t:06.3f};{v}" for t, v in zip(TIME, VALUES, strict=True)]
    with pytest.raises(CalibrationDataError, match='rename it to "time"'):
        read_recording(written(tmp_path, "when;prox", rows))
    assert len(read_recording(written(tmp_path, "time;prox", rows)).values) == len(VALUES)


# --- times that are coarser than the readings


@pytest.mark.parametrize(
    ("title", "cell", "unit"),
    [
        ("Time", lambda t: f"10:12:{int(32 + t):02d}", "1 s, with 100"),
        ("Timestamp", lambda t: f"05/17/2024 10:12:{int(32 + t):02d} AM", "1 s, with 100"),
        ("time [s]", lambda t: f"{int(10 * t) / 10:.1f}", "100 ms, with 10"),
        ("epoch", lambda t: f"{1_700_000_000 + int(t)}", "1 s, with 100"),
    ],
)
def test_times_coarser_than_the_readings_are_refused(tmp_path, title: str, cell, unit: str) -> None:
    rows = [f"{cell(t)},{v}" for t, v in zip(TIME + 1e-9, VALUES, strict=True)]
    with pytest.raises(CalibrationDataError, match=f"steps of {unit} readings each.*milliseconds"):
        read_recording(written(tmp_path, f"{title},prox", rows))


@pytest.mark.parametrize(("title", "size"), [("ms", 1000), ("Millis", 1000), ("us", 1_000_000), ("Time_ms", 1000)])
def test_the_fraction_of_the_second_may_be_in_another_column(tmp_path, title: str, size: int) -> None:
    rows = [f"10:12:{int(32 + t):02d},{round(t % 1 * size)},{v}" for t, v in zip(TIME, VALUES, strict=True)]
    recording = read_recording(written(tmp_path, f"Time,{title},prox", rows))
    assert (np.diff(recording.stamps) == 10_000_000).all()
    assert recording.values.tolist() == VALUES


def test_a_finer_clock_beside_coarse_times_is_used(tmp_path) -> None:
    rows = [f"10:12:{int(32 + t):02d},{round(1000 * t) + 345},{v}" for t, v in zip(TIME, VALUES, strict=True)]
    recording = read_recording(written(tmp_path, "Time,uptime [ms],prox", rows))
    assert (np.diff(recording.stamps) == 10_000_000).all()


def test_the_clock_of_another_computer_is_no_reading(tmp_path) -> None:
    rows = [f"{1_700_000_000 + t:.3f},{round(1000 * t)},{v}" for t, v in zip(TIME, VALUES, strict=True)]
    assert read_recording(written(tmp_path, "pc_time,mcu_ms,adc", rows)).values.tolist() == VALUES


def test_the_steady_clock_of_the_sensor_is_used_instead_of_arrivals_in_batches(tmp_path) -> None:
    late = [1_700_000_000 + np.ceil(t / 0.03 - 1e-9) * 0.03 + 0.0005 * (i % 3) for i, t in enumerate(TIME)]
    rows = [f"{a:.4f},{round(1000 * t)},{v}" for a, t, v in zip(late, TIME, VALUES, strict=True)]
    recording = read_recording(written(tmp_path, "pc_time,mcu_ms,adc", rows))
    assert (np.diff(recording.stamps) == 10_000_000).all()
    assert any("steadier" in note for note in recording.notes)


def test_two_topics_in_one_table_may_share_their_times(tmp_path) -> None:
    rows = [row for t, v in zip(TIME, VALUES, strict=True) for row in (f"{t},{v},", f"{t},,{v + 1}")]
    recording = read_recording(written(tmp_path, "time [s],left,right", rows), "right")
    assert recording.values[np.isfinite(recording.values)].tolist() == [v + 1 for v in VALUES]


# --- times that are none, or from a counter that restarts


@pytest.mark.parametrize("cells", [lambda _: "10", lambda i: str(10 + (i % 3 == 0) - (i % 7 == 0))])
@pytest.mark.parametrize("title", ["dt_ms", "time [ms]"])
def test_intervals_are_no_times(tmp_path, title: str, cells) -> None:
    rows = [f"{cells(i)},{v}" for i, v in enumerate(VALUES)]
    with pytest.raises(CalibrationDataError, match="running sum"):
        read_recording(written(tmp_path, f"{title},prox", rows))


@pytest.mark.parametrize(
    ("start", "title"), [(25569, "time"), (25569, "time [d]"), (25569, "date"), (719529, "datenum")]
)
def test_days_of_a_spreadsheet_are_times(tmp_path, start: int, title: str) -> None:
    rows = [f"{start + 19860.42 + t / 86400:.11f},{v}" for t, v in zip(TIME, VALUES, strict=True)]
    recording = read_recording(written(tmp_path, f"{title},prox", rows))
    assert recording.time == pytest.approx(TIME, abs=2e-5)
    assert recording.stamps[0] / 1e9 == pytest.approx(19860.42 * 86400, abs=1e-3)


def test_days_of_a_spreadsheet_under_the_unit_of_seconds_are_refused(tmp_path) -> None:
    rows = [f"{45000.42 + t / 86400:.11f},{v}" for t, v in zip(TIME, VALUES, strict=True)]
    with pytest.raises(CalibrationDataError, match=r"time \[d\]"):
        read_recording(written(tmp_path, "time [s],prox", rows))


def test_seconds_after_half_a_day_are_no_days(tmp_path) -> None:
    rows = [f"{45000 + t:.3f},{v}" for t, v in zip(TIME, VALUES, strict=True)]
    assert read_recording(written(tmp_path, "time,prox", rows)).time == pytest.approx(TIME, abs=1e-6)


@pytest.mark.parametrize(
    ("title", "first", "step", "low", "count"),
    [
        ("millis", 2**32 - 1500, 10, 0, 2**32),
        ("micros", 2**32 - 1_500_000, 10_000, 0, 2**32),
        ("time [us]", 2**31 - 1_500_000, 10_000, -(2**31), 2**32),
        ("time [ms]", 2**16 - 1500, 10, 0, 2**16),
    ],
)
def test_a_counter_that_restarts_is_continued(
    tmp_path, title: str, first: int, step: int, low: int, count: int
) -> None:
    rows = [f"{(first + step * i - low) % count + low},{v}" for i, v in enumerate(VALUES)]
    recording = read_recording(written(tmp_path, f"{title},prox", rows))
    assert recording.time == pytest.approx(TIME, abs=1e-9)
    assert any("restarted" in note for note in recording.notes)


def test_a_reset_of_the_board_is_no_restart_of_a_counter(tmp_path) -> None:
    rows = [f"{10 * i if i < 100 else 10 * (i - 100)},{v}" for i, v in enumerate(VALUES)]
    assert (np.diff(read_recording(written(tmp_path, "millis,prox", rows)).stamps) < 0).sum() == 1


@pytest.mark.parametrize("wrong", ["9999.0", "-500.0"])
@pytest.mark.parametrize("row", [1, 100, 290])
def test_a_single_wrong_time_is_left_out_with_its_line(tmp_path, wrong: str, row: int) -> None:
    rows = [f"{wrong if i == row else t},{v}" for i, (t, v) in enumerate(zip(TIME, VALUES, strict=True))]
    recording = read_recording(written(tmp_path, "time [s],prox", rows))
    assert recording.values.tolist() == VALUES[:row] + VALUES[row + 1 :]
    assert any(f"line {row + 2}." in note for note in recording.notes)


def test_two_wrong_times_in_a_row_are_left_out(tmp_path) -> None:
    rows = [f"{9999.0 if i in {100, 101} else t},{v}" for i, (t, v) in enumerate(zip(TIME, VALUES, strict=True))]
    recording = read_recording(written(tmp_path, "time [s],prox", rows))
    assert recording.values.tolist() == VALUES[:100] + VALUES[102:]


@pytest.mark.parametrize(("row", "wrong"), [(0, "-1700000000.0"), (299, "1700000000.0")])
def test_a_first_or_last_time_that_is_years_away_is_left_out(tmp_path, row: int, wrong: str) -> None:
    rows = [f"{wrong if i == row else t},{v}" for i, (t, v) in enumerate(zip(TIME, VALUES, strict=True))]
    recording = read_recording(written(tmp_path, "time [s],prox", rows))
    assert recording.values.tolist() == VALUES[:row] + VALUES[row + 1 :]


def test_a_pause_is_no_wrong_time(tmp_path) -> None:
    rows = [f"{t + 3600 * (i > 150)},{v}" for i, (t, v) in enumerate(zip(TIME, VALUES, strict=True))]
    assert read_recording(written(tmp_path, "time [s],prox", rows)).values.tolist() == VALUES


# --- units of the readings, and what a replay without use is


@pytest.fixture(scope="module")
def task():
    return load_scenario("examples/loop.toml").replace(gain=-0.86)


def approaches(near: float, idle: float) -> list[float]:
    """Return readings of three approaches."""
    time = np.arange(1200) * 0.01
    closeness = np.max([np.exp(-(((time - t) / 0.15) ** 2)) for t in (2.0, 6.0, 10.0)], axis=0)
    return [idle if c < 0.01 else round(near + (1 - c) * 400) for c in closeness]


@pytest.mark.parametrize("idle", [8190, 8191, 65535])
@pytest.mark.parametrize("title", ["range", "Distance", "Abstand"])
def test_distances_without_a_unit_are_refused_until_it_is_given(tmp_path, task, idle: float, title: str) -> None:
    rows = [f"{0.01 * i:.2f},{v}" for i, v in enumerate(approaches(20, idle))]
    topic = remedy_of(written(tmp_path, f"time [s],{title}", rows))
    assert topic == f"{title} [counts]"
    recording = read_recording(tmp_path / "table.csv", f"{title} [mm]")
    assert recording.kind == "distance"
    assert len(replay(task, recording).detections) == 3
    assert read_recording(tmp_path / "table.csv", topic).kind == "reading"


def test_a_rest_at_the_largest_value_is_a_distance_whose_unit_must_be_given(tmp_path) -> None:
    path = written(tmp_path, "time [s],range", [f"{0.01 * i:.2f},{v}" for i, v in enumerate(approaches(20, 421))])
    with pytest.raises(InvalidInputError, match=r"range \[UNIT\]"):
        read_recording(path)


def test_outputs_that_are_called_range_are_outputs(tmp_path) -> None:
    rows = [f"{0.01 * i:.2f},{150 + 400 - min(v, 400)}" for i, v in enumerate(approaches(20, 400))]
    assert read_recording(written(tmp_path, "time [s],range", rows)).kind == "reading"


@pytest.mark.parametrize("unit", ["V", "mV", "us"])
def test_outputs_in_another_unit_than_that_of_the_scenario_are_refused(tmp_path, task, unit: str) -> None:
    path = written(tmp_path, f"time [s],prox [{unit}]", [f"{t},{v}" for t, v in zip(TIME, VALUES, strict=True)])
    with pytest.raises(InvalidInputError, match="counts"):
        replay(task, read_recording(path))


@pytest.mark.parametrize("unit", ["counts", "LSB", "ADC counts"])
def test_outputs_in_the_unit_of_the_scenario_need_no_remark(tmp_path, task, unit: str) -> None:
    path = written(tmp_path, f"time [s],prox [{unit}]", [f"{t},{v}" for t, v in zip(TIME, VALUES, strict=True)])
    result = replay(task, read_recording(path))
    assert result.notes == ()
    assert result.is_good


def test_a_recording_of_which_less_than_half_is_replayed_is_incomplete(tmp_path, task) -> None:
    order = np.random.default_rng(1).permutation(len(TIME))
    path = written(tmp_path, "time [s],prox", [f"{TIME[i]},{VALUES[i]}" for i in order])
    result = replay(task, read_recording(path))
    assert not result.is_good
    assert result.to_dict()["status"] == "incomplete"
    assert result.headline.startswith("Only ")


def test_a_reset_that_leaves_more_than_half_of_a_recording_is_a_remark(tmp_path, task) -> None:
    path = written(tmp_path, "millis,prox", [f"{10 * (i if i < 100 else i - 100)},{v}" for i, v in enumerate(VALUES)])
    result = replay(task, read_recording(path))
    assert result.counts["left out"] == 100
    assert result.is_good


def test_a_law_that_uses_nearly_no_reading_shows_nothing(tmp_path, task) -> None:
    path = written(tmp_path, "time [us],prox", [f"{i},{v}" for i, v in enumerate(VALUES)])
    result = replay(task, read_recording(path))
    assert not result.is_good
    assert result.to_dict()["status"] == "no-usable-reading"
    assert "2 of 300" in result.headline or "1 of 300" in result.headline
