"""Recordings that are damaged, empty, of a wrong kind, or that say something impossible: a sentence, or a result."""

from __future__ import annotations

import re
import shutil
import sqlite3
import sys
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from pretouch.errors import InvalidInputError, MissingExtraError
from pretouch.recording import Recording, read_recording, replay

LOOP = Path(__file__).parents[2] / "examples/loop.toml"


@pytest.fixture
def recorded():
    pytest.importorskip("rosbags", reason="needs the extra ros")
    pytest.importorskip("mcap", reason="needs the extra ros")
    import recorded

    return recorded


@pytest.fixture(scope="module")
def task():
    return pt.load_scenario(LOOP).replace(gain=-0.86)


def readings(values, time=None, **named):
    time = 4e-3 * np.arange(len(values)) if time is None else np.asarray(time)
    fields = {"source": "bag", "topic": "/t", "message_type": "", **named}
    return Recording(stamps=np.round(1e9 * time).astype(np.int64), values=values, **fields)


# --- files


def test_a_wrong_topic_lists_the_topics_and_suggests_one(recorded, tmp_path):
    bag = recorded.range_bag(tmp_path / "bag", [0.0, 0.1], [0.1, 0.2], topic="/arm/range")
    for wrong in ("/arm/rnage", "arm/rang", "/arm/rangefinder"):
        with pytest.raises(InvalidInputError, match=r"did you mean /?arm/range\?.*sensor_msgs/msg/Range, 2 messages"):
            read_recording(bag, wrong)
    with pytest.raises(InvalidInputError, match="/arm/range"):
        read_recording(bag, "/zzz")
    with pytest.raises(InvalidInputError, match="--topic"):
        read_recording(bag)


def test_a_wrong_field_lists_the_fields(recorded, tmp_path):
    bag = recorded.range_bag(tmp_path / "bag", [0.0, 0.1], [0.1, 0.2])
    with pytest.raises(InvalidInputError, match=r"no numeric field 'rang'.*range"):
        read_recording(bag, "/range.rang")


def test_a_type_with_several_numbers_needs_a_field(recorded, tmp_path):
    rows = [(i, {"a": 1, "b": 2}) for i in range(3)]
    file = recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": rows})
    with pytest.raises(InvalidInputError, match=r"/j\.a"):
        read_recording(file, "/j")
    with pytest.raises(InvalidInputError, match="no numeric field 'c'"):
        read_recording(file, "/j.c")


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_bag_without_messages_says_so(recorded, tmp_path, storage):
    bag = recorded.write_bag(tmp_path / "bag", {"/range": (recorded.RANGE, [])}, storage=storage)
    with pytest.raises(InvalidInputError, match="no message"):
        read_recording(bag, "/range")


def test_a_bag_without_topics_says_so(recorded, tmp_path):
    bag = recorded.write_bag(tmp_path / "bag", {})
    with pytest.raises(InvalidInputError, match="no topic"):
        read_recording(bag, "/range")


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_bag_without_metadata_is_read_and_says_so(recorded, tmp_path, storage):
    bag = recorded.range_bag(tmp_path / "bag", [0.0, 0.1], [0.1, 0.2], storage=storage)
    (bag / "metadata.yaml").unlink()
    recording = read_recording(bag, "/range")
    assert len(recording.values) == 2
    assert "metadata" in recording.notes[0]


def test_a_missing_file_of_a_bag_is_named(recorded, tmp_path):
    bag = recorded.range_bag(tmp_path / "bag", [0.0, 0.1], [0.1, 0.2])
    text = (bag / "metadata.yaml").read_text()
    (bag / "metadata.yaml").write_text(text.replace("- bag.mcap", "- bag.mcap\n  - gone_1.mcap"))
    recording = read_recording(bag, "/range")
    assert len(recording.values) == 2
    assert any("gone_1.mcap" in note for note in recording.notes)


@pytest.mark.parametrize("chunks", [True, False])
def test_a_truncated_mcap_file_keeps_its_beginning(recorded, tmp_path, chunks):
    rows = [(i, {"v": i}) for i in range(3000)]
    file = recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": rows}, chunk_size=4096, use_chunking=chunks)
    whole = file.read_bytes()
    assert not read_recording(file, "/j").notes
    counts = []
    for share in (0.9, 0.6, 0.3):
        file.write_bytes(whole[: int(share * len(whole))])
        recording = read_recording(file, "/j")
        assert "truncated" in recording.notes[0]
        assert recording.values.tolist() == list(range(len(recording.values)))
        counts.append(len(recording.values))
    assert 3000 >= counts[0] > counts[1] > counts[2] > 0
    for size in (8, 20, 60):
        file.write_bytes(whole[:size])
        with pytest.raises(InvalidInputError):
            read_recording(file, "/j")


def test_a_damaged_chunk_is_left_out(recorded, tmp_path):
    """Its checksum is wrong; the chunks before and after it are read."""
    rows = [(i, {"v": i}) for i in range(3000)]
    file = recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": rows}, chunk_size=4096)
    content = bytearray(file.read_bytes())
    third = [match.start() for match in re.finditer(rb"\x28\xb5\x2f\xfd", content)][2]  # the start of compressed data
    content[third + 100] ^= 0xFF
    file.write_bytes(bytes(content))
    recording = read_recording(file, "/j")
    assert np.all(np.diff(recording.values) > 0)
    assert recording.values[[0, -1]].tolist() == [0, 2999]
    assert 2700 < len(recording.values) < 3000
    assert "damaged" in recording.notes[0]


def test_the_last_chunk_of_a_recorder_that_lost_its_power_is_read(recorded, tmp_path):
    """A single chunk without compression and without its end: no index, no footer, no checksum to compare."""
    from mcap.writer import CompressionType

    rows = [(i, {"v": i}) for i in range(3000)]
    file = recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": rows}, compression=CompressionType.NONE)
    file.write_bytes(file.read_bytes()[:60_000])
    recording = read_recording(file, "/j")
    assert recording.values.tolist() == list(range(len(recording.values)))
    assert len(recording.values) > 1000
    assert "truncated" in recording.notes[0]


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
@pytest.mark.parametrize("content", [b"", b"\0", b"\0\1\0\0\1", b"\xff" * 40, b"\0\1\0\0" + b"\xff" * 36])
def test_a_damaged_message_is_a_missing_reading(task, recorded, tmp_path, storage, content):
    """Also the first message, by which nothing may be decided."""
    types, time = recorded.store(), np.arange(500) * 4e-3
    messages = recorded.range_messages(types, time, 0.2 + 0.1 * np.sin(time))
    serialize = types.serialize_cdr
    damaged = {0, 100, 101, 499}
    calls = iter(range(len(messages)))
    types.serialize_cdr = lambda *given: content if next(calls) in damaged else serialize(*given)
    bag = recorded.write_bag(tmp_path / "bag", {"/range": (recorded.RANGE, messages)}, storage=storage, types=types)
    del types.serialize_cdr
    recording = read_recording(bag, "/range")
    assert len(recording.values) == 496
    assert recording.clock == "header"
    assert any("4 of 500 messages" in note for note in recording.notes)
    result = replay(task, recording)
    assert result.timing.dropout == pytest.approx(2 / 498)  # those in between
    assert result.timing.rate == pytest.approx(250)


def test_a_receive_time_that_is_impossible_is_a_damaged_message(recorded, tmp_path):
    rows = [(i * 10**7, {"v": i}) for i in range(50)]
    rows[20] = (2**64 - 1, {"v": 20})
    recording = read_recording(recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": rows}), "/j")
    assert len(recording.values) == 49
    assert any("1 of 50 messages" in note for note in recording.notes)


def test_a_beam_of_a_laser_scan_is_a_distance_with_bounds(task, recorded, tmp_path):
    types = recorded.store()
    kind = types.types["sensor_msgs/msg/LaserScan"]
    numbers = dict.fromkeys(("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time"), 0.0)
    rows = [
        (
            10**18 + i * 10**7,
            kind(
                header=recorded.stamp(types, 10**18 + i * 10**7),
                range_min=0.05,
                range_max=8.0,
                ranges=np.array([1.0, 8.0 if i % 2 else 0.1], dtype=np.float32),
                intensities=np.zeros(0, dtype=np.float32),
                **numbers,
            ),
        )
        for i in range(100)
    ]
    bag = recorded.write_bag(tmp_path / "bag", {"/scan": ("sensor_msgs/msg/LaserScan", rows)}, types=types)
    recording = read_recording(bag, "/scan.ranges[1]")
    assert (recording.kind, recording.bounds) == ("distance", pytest.approx((0.05, 8.0)))
    assert replay(task, recording).counts["no object"] == 50


def test_some_messages_without_a_stamp_are_a_remark(recorded, tmp_path):
    """A simulator stamps with 0 until its clock arrives."""
    types, time = recorded.store(), np.arange(100) * 0.01
    messages = recorded.range_messages(types, time, time, stamp_time=np.maximum(time - 0.05, 0.0))
    recording = read_recording(
        recorded.write_bag(tmp_path / "b", {"/r": (recorded.RANGE, messages)}, types=types), "/r"
    )
    assert recording.clock == "receive"
    assert any("lack a header stamp" in note for note in recording.notes)


def test_damaged_json_is_a_missing_reading(recorded, tmp_path):
    """A stamp that is missing because of the damage does not make the recording one without stamps."""
    rows = [(i, {"header": {"stamp": {"sec": 1, "nanosec": i}}, "v": i}) for i in range(50)]
    file = recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": rows}, use_chunking=False)
    for old, new in ((b'"v": 0}', b'"v": 0]'), (b'"v": 10}', b'"v": \xff\xfe}')):
        file.write_bytes(file.read_bytes().replace(old, new))
    recording = read_recording(file, "/j.v")
    assert (len(recording.values), recording.clock) == (48, "header")
    assert any("2 of 50 messages" in note for note in recording.notes)


@pytest.mark.parametrize("stamp", [{"sec": "now"}, {"sec": 1e300}, {"sec": 10**30, "nanosec": 0}, {"sec": None}, 7])
def test_a_stamp_that_is_none_is_no_stamp(recorded, tmp_path, stamp):
    rows = [(i, {"stamp": stamp, "v": 10**400 if i == 3 else i}) for i in range(5)]
    recording = read_recording(recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": rows}), "/j.v")
    assert recording.clock == "receive"
    assert recording.values == pytest.approx([0, 1, 2, np.nan, 4], nan_ok=True)


def test_only_damaged_messages_are_refused(recorded, tmp_path):
    file = recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": [(i, {"v": i}) for i in range(5)]}, use_chunking=False)
    file.write_bytes(file.read_bytes().replace(b'{"v"', b'["v"'))
    with pytest.raises(InvalidInputError, match="none of the 5 messages"):
        read_recording(file, "/j.v")


def test_messages_that_are_lost_from_a_database_are_noticed(recorded, tmp_path):
    """The rest of the database is whole, and only the metadata show the loss."""
    bag = recorded.float_bag(tmp_path / "bag", np.arange(100) * 0.01, np.arange(100), storage="SQLITE3")
    with sqlite3.connect(next(bag.glob("*.db3"))) as database:
        database.execute("DELETE FROM messages WHERE id > 60 AND id < 71")
    recording = read_recording(bag, "/reading")
    assert len(recording.values) == 90
    assert any("100 messages" in note and "90 messages" in note for note in recording.notes)


def test_messages_that_are_lost_from_an_mcap_file_are_noticed(recorded, tmp_path):
    """A damaged number of the channel, in a file without checksums; the statistics at its end are whole."""
    file = recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": [(i, {"v": i}) for i in range(50)]}, use_chunking=False)
    content = bytearray(file.read_bytes())
    content[content.index(b'{"v": 7}') - 22] ^= 0xFF
    file.write_bytes(bytes(content))
    recording = read_recording(file, "/j")
    assert len(recording.values) == 49
    assert any("50 messages" in note and "49 messages" in note for note in recording.notes)


def test_a_database_without_its_messages_has_none(recorded, tmp_path):
    bag = recorded.float_bag(tmp_path / "bag", [0.0, 0.1], [1.0, 2.0], storage="SQLITE3")
    with sqlite3.connect(next(bag.glob("*.db3"))) as database:
        database.execute("DROP TABLE messages")
    with pytest.raises(InvalidInputError, match="no messages"):
        read_recording(bag, "/reading")


@pytest.mark.parametrize("value", [1e308, -1e308, 1e200, 5e-324, np.nan, np.inf])
@pytest.mark.parametrize("kind", ["reading", "distance"])
def test_readings_that_no_sensor_has_raise_no_python_warning(task, value, kind):
    """Warnings of Python are errors in all tests."""
    values = 150.0 + 20 * np.random.default_rng(1).standard_normal(400)
    values[50:52], values[300] = value, -value
    result = replay(task, readings(values, kind=kind), reference=readings(values, kind="distance"))
    assert np.isfinite(result.steps.virtual_force).all()
    assert isinstance(result.to_dict()["headline"], str)


def test_a_time_that_no_clock_has_is_ignored(tmp_path):
    (tmp_path / "x.csv").write_text("time [s],a\n0,1\n1e300,2\n1,3\n")
    recording = read_recording(tmp_path / "x.csv", "a")
    assert recording.values.tolist() == [1.0, 3.0]
    assert any("without a time, which are not read: 1" in note for note in recording.notes)


@pytest.mark.parametrize("title", [True, False])
def test_a_type_that_an_idl_file_defines_is_read(recorded, tmp_path, title):
    """The recorder writes a separator and a title before the root of such a definition; other writers do not."""
    from mcap.writer import Writer

    separator = "=" * 80 + "\n"
    root = "module my_msgs { module msg { struct Gap { std_msgs::msg::Float64 gap; double spare; }; }; };\n"
    other = f"{separator}MSG: std_msgs/msg/Float64\nfloat64 data\n"
    text = f"{separator}IDL: my_msgs/msg/Gap\n{root}{other}" if title else root + other
    with (tmp_path / "x.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("my_msgs/msg/Gap", "ros2idl", text.encode())
        channel = writer.register_channel("/gap", "cdr", schema)
        for i in range(20):
            writer.add_message(channel, i, b"\0\1\0\0" + np.array([i, 7.0]).tobytes(), i)
        writer.finish()
    assert read_recording(tmp_path / "x.mcap", "/gap.gap.data").values.tolist() == list(range(20))


def test_a_truncated_database_is_refused_or_keeps_its_beginning(recorded, tmp_path):
    time = np.arange(5000) * 0.01
    bag = recorded.float_bag(tmp_path / "bag", time, time, storage="SQLITE3")
    file = next(bag.glob("*.db3"))
    whole = file.read_bytes()
    for share in (0.7, 0.01):
        file.write_bytes(whole[: int(share * len(whole))])
        try:
            recording = read_recording(bag, "/reading")
        except InvalidInputError:
            continue
        assert recording.notes
        assert recording.values.tolist() == time[: len(recording.values)].tolist()


def test_files_that_are_no_recordings_are_refused(recorded, tmp_path):
    cases = {
        "empty.mcap": b"",
        "text.db3": b"hello",
        "one.bag": b"#ROSBAG V2.0\n",
        "picture.mcap": b"\x89PNG\r\n\x1a\n",
    }
    for name, content in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InvalidInputError, match=name):
            read_recording(tmp_path / name, "/t")
    with sqlite3.connect(tmp_path / "other.db3") as database:
        database.execute("CREATE TABLE cats (name)")
    for name in ("other.db3", "missing.mcap", "missing"):
        with pytest.raises(InvalidInputError, match=name):
            read_recording(tmp_path / name, "/t")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InvalidInputError, match="no recording"):
        read_recording(tmp_path / "folder", "/t")


def test_an_unknown_encoding_or_type_is_refused(recorded, tmp_path):
    from mcap.writer import Writer

    for encoding, kind in (("protobuf", "a.B"), ("cdr", "my_msgs/msg/Own")):
        with (tmp_path / "x.mcap").open("wb") as stream:
            writer = Writer(stream)
            writer.start()
            schema = writer.register_schema(kind, encoding, b"")
            writer.add_message(writer.register_channel("/t", encoding, schema), 1, b"\0\1\0\0abcd", 1)
            writer.finish()
        with pytest.raises(InvalidInputError, match=encoding if encoding == "protobuf" else "my_msgs"):
            read_recording(tmp_path / "x.mcap", "/t")


def test_a_clock_that_was_not_recorded_is_refused(recorded, tmp_path):
    bag = recorded.float_bag(tmp_path / "bag", [0.0, 0.1], [1.0, 2.0])
    assert read_recording(bag, "/reading").clock == "receive"
    with pytest.raises(InvalidInputError, match="receive"):
        read_recording(bag, "/reading", clock="header")
    with pytest.raises(InvalidInputError, match="clock"):
        read_recording(bag, "/reading", clock="sun")


def test_without_the_libraries_a_sentence_names_the_extra(recorded, tmp_path, monkeypatch):
    bag = recorded.float_bag(tmp_path / "bag", [0.0, 0.1], [1.0, 2.0])
    for module in ("mcap.stream_reader", "mcap.records", "rosbags.typesys"):
        with monkeypatch.context() as changed:
            changed.setitem(sys.modules, module, None)
            with pytest.raises(MissingExtraError, match=r"pretouch\[ros\]"):
                read_recording(bag, "/reading")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "is empty"),
        ("a,b\n1,2\n", "time"),
        ("time [s]\n1\n", "header"),
        ("time [mm],a\n1,2\n", "time"),
        ("time [s],a,b\n1,2,3\n", "--topic"),
        ("time [s],a\nx,2\n", "time"),
    ],
)
def test_a_table_that_is_no_recording_is_refused(tmp_path, text, named):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(InvalidInputError, match=named):
        read_recording(tmp_path / "x.csv")


def test_columns_units_and_missing_cells_of_a_table(tmp_path):
    (tmp_path / "x.csv").write_text("# remark\nt [ms];range [mm];raw\n0;10;1\n5;;2\n;3;4\n10;30;x\n")
    recording = read_recording(tmp_path / "x.csv", "range")
    assert recording.stamps.tolist() == [0, 5_000_000, 10_000_000]
    assert recording.values == pytest.approx([0.010, np.nan, 0.030], nan_ok=True)
    assert (recording.kind, recording.clock) == ("distance", "column")
    assert read_recording(tmp_path / "x.csv", "raw [counts]").kind == "reading"
    with pytest.raises(InvalidInputError, match="raw"):
        read_recording(tmp_path / "x.csv", "rwa")


# --- impossible readings


def test_one_message_is_a_result(task):
    result = replay(task, readings([200.0]))
    assert len(result.detections) == 0
    assert result.chain == ""
    assert result.to_dict()["timing"]["rate"] is None
    assert "rate" in str(result)


def test_nan_and_infinite_ranges_are_those_of_rep_117(task, recorded, tmp_path):
    values = np.full(200, 0.1)
    values[20:40], values[60:80], values[100:120], values[150] = np.nan, np.inf, -np.inf, 2.0
    bag = recorded.range_bag(tmp_path / "bag", 4e-3 * np.arange(200), values)
    result = replay(task, read_recording(bag, "/range"))
    assert result.counts["invalid"] == 20
    assert result.counts["too near"] == 20
    assert result.counts["no object"] == 21  # and the range beyond max_range
    assert np.isfinite(result.steps.virtual_force).all()
    assert np.isfinite(result.steps.position).all()
    assert any("NaN" in text for text in pt_page(result).warnings)


def pt_page(result):
    from pretouch.report.pages import page_of

    return page_of(result)


def test_only_saturated_readings_are_no_detection(task):
    result = replay(task, readings(np.full(500, 65535.0)))
    assert result.counts["saturated"] == 500
    assert not result.is_good
    assert result.usable == 0
    assert result.to_dict()["status"] == "no-usable-reading"
    assert "saturated" in result.headline
    assert not result.steps.virtual_force.any()


def test_only_nan_is_no_detection(task):
    result = replay(task, readings(np.full(500, np.nan)))
    assert (result.counts["invalid"], result.usable) == (500, 0)
    assert "NaN" in result.headline
    assert result.noise.noise is None


def test_a_wrong_unit_is_noticed(task):
    """Readings in V instead of counts never reach the floor."""
    result = replay(task, readings(0.002 * np.random.default_rng(1).standard_normal(500)))
    assert not result.detections
    assert any("floor" in text for text in pt_page(result).warnings)


def test_duplicated_stamps_use_the_last_reading(task):
    time = np.repeat(8e-3 * np.arange(300), 2)
    result = replay(task, readings(150.0 + np.arange(600.0), time))
    assert result.timing.repeated_stamps == 300
    assert result.counts["replaced"] == 300
    assert result.steps.reading[result.steps.fresh].tolist() == (151.0 + 2 * np.arange(300)).tolist()


def test_all_stamps_equal_are_no_rate(task):
    result = replay(task, readings(np.full(50, 200.0), np.zeros(50)))
    assert np.isnan(result.timing.rate)
    assert result.chain == ""


def test_a_clock_that_is_set_back_leaves_the_longest_part(task):
    time = np.concatenate([4e-3 * np.arange(300), -5.0 + 4e-3 * np.arange(900)])
    result = replay(task, readings(np.full(1200, 200.0), time, clock="header"))
    assert len(result.readings) == 900
    assert any("300 of 1,200" in note and "--clock receive" in note for note in result.notes)


def test_a_recording_with_one_clock_is_not_told_to_use_another(task):
    time = np.concatenate([4e-3 * np.arange(300), -5.0 + 4e-3 * np.arange(900)])
    result = replay(task, readings(np.full(1200, 200.0), time, clock="receive"))
    assert not any("--clock" in note for note in result.notes)


def test_a_late_reading_is_refused_by_the_law(task):
    time = 4e-3 * np.arange(300)
    time[150] -= 20e-3
    result = replay(task, readings(np.full(300, 400.0), time))
    assert result.timing.late == 1
    assert len(result.readings) == 300


def test_a_part_without_readings_and_a_task_without_a_loop_are_refused(task):
    bag = readings(np.full(300, 200.0))
    assert len(replay(task, bag, start=0.5, end=0.7).readings) == 51
    with pytest.raises(InvalidInputError, match="from, to"):
        replay(task, bag, start=5.0)
    with pytest.raises(InvalidInputError, match="loop"):
        replay(pt.load_scenario(LOOP.with_name("approach.toml")), bag)
    with pytest.raises(InvalidInputError, match="before"):
        replay(task, bag, before=-1.0)
    with pytest.raises(InvalidInputError, match="periods"):
        replay(task, readings([1.0, 2.0], [0.0, 1e6]))


def test_files_in_a_path_with_odd_characters(recorded, tmp_path):
    folder = tmp_path / "a ?#%b"
    folder.mkdir()
    bag = recorded.float_bag(tmp_path / "x", [0.0, 0.1], [1.0, 2.0], storage="SQLITE3")
    shutil.move(bag, folder)
    assert len(read_recording(folder / "x", "/reading").values) == 2
