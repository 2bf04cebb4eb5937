"""Recordings as people have them in tables are read right, or refused with a remedy that leads to the right result."""

import re

import numpy as np
import pytest

from pretouch._core.errors import CalibrationDataError, InvalidInputError
from pretouch.recording import read_recording

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
