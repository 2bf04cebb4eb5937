#!/usr/bin/env bash
# MCAP for Python: of a recording that was cut off, the readers return no message at all, although nearly all are intact.
#
# Expected: MCAP's guide lists as a feature: "Recover partially-written files when data recording is interrupted". The reader for streams
#   (NonSeekingReader) should yield the messages of all complete chunks before it reports that the file ends early.
# What happens: mcap 1.6.0 yields nothing. make_reader looks for the footer, takes data for a record header and raises an error about a
#   record of an absurd length. NonSeekingReader reads all complete chunks, then raises EndOfFile before it yields the first message:
#   it sorts by log time first, and that is the default. With log_time_order=False, the same reader yields every message of the complete
#   chunks and raises afterwards. rosbags 0.11.9 raises "File end magic is invalid." and has no such option.
# Why it matters: an emergency stop or a power cut ends the recording of exactly the collision that one wants to look at. The error text
#   suggests a damaged file, and a loop around the default reader makes the data look lost.
# Remedy: NonSeekingReader(stream).iter_messages(log_time_order=False), and keep what arrived before EndOfFile.
# Source: MCAP documentation, page "Guides" (features); docstrings of mcap.reader.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "this script needs Python 3.11 or later as python3")'
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -qq --disable-pip-version-check mcap==1.6.0 rosbags==0.11.9 numpy==2.4.6
cd "$work"
"$work/venv/bin/python" - <<'PY'
import importlib.metadata
import struct
import sys
from pathlib import Path

from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
types = store.types
definition, _ = store.generate_msgdef("sensor_msgs/msg/Range", ros_version=2)


def reading(time_ns, distance):
    stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="hand")
    message = types["sensor_msgs/msg/Range"](
        header=header, radiation_type=1, field_of_view=0.4, min_range=0.02, max_range=2.0, range=distance, variance=0.0
    )
    return bytes(store.serialize_cdr(message, "sensor_msgs/msg/Range"))


def record(path, interrupted):
    """Record 1000 range readings at 1 kHz; an interrupted recorder leaves its last chunk half written and no footer."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=4096, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="example")
        schema = writer.register_schema("sensor_msgs/msg/Range", "ros2msg", definition.encode())
        channel = writer.register_channel("/hand/range", "cdr", schema)
        for i in range(1000):
            writer.add_message(channel, i * 10**6, reading(i * 10**6, 1.0 - 0.001 * i), i * 10**6)
        writer.finish()
    if interrupted:
        content = path.read_bytes()
        last_chunk = offset = 8
        while content[offset] != 0x0F:  # until the "data end" record
            last_chunk = offset if content[offset] == 0x06 else last_chunk
            offset += 9 + struct.unpack_from("<Q", content, offset + 1)[0]
        path.write_bytes(content[: last_chunk + 200])


def outcome(messages):
    """Number of messages before the error, the error."""
    count = 0
    try:
        for _ in messages:
            count += 1
    except Exception as error:  # noqa: BLE001
        return count, error
    return count, None


def rosbags_messages(path):
    with AnyReader([path], default_typestore=store) as reader:
        yield from reader.messages()


results = {}
for interrupted in (False, True):
    path = Path("interrupted.mcap" if interrupted else "complete.mcap")
    record(path, interrupted)
    results[interrupted] = [
        outcome(make_reader(path.open("rb")).iter_messages()),
        outcome(NonSeekingReader(path.open("rb")).iter_messages()),
        outcome(NonSeekingReader(path.open("rb")).iter_messages(log_time_order=False)),
        outcome(rosbags_messages(path)),
    ]
    print("mcap", importlib.metadata.version("mcap"), "- rosbags", importlib.metadata.version("rosbags"), "-", path.name)
    for name, (count, error) in zip(("make_reader", "NonSeekingReader", "same, log_time_order=False", "rosbags"), results[interrupted]):
        print(f"  {name:27s} {count:5d} messages", f"then {type(error).__name__}: {error}"[:110] if error else "")

seeking, stream, unsorted, bags = results[True]
checks = {
    "all readers read the complete file": all(result == (1000, None) for result in results[False]),
    "make_reader reads nothing of the interrupted file": seeking[0] == 0 and isinstance(seeking[1], McapError),
    "NonSeekingReader reads nothing by default": stream[0] == 0 and isinstance(stream[1], EndOfFile),
    "the same reader has more than 90 % of the messages": unsorted[0] > 900 and isinstance(unsorted[1], EndOfFile),
    "rosbags reads nothing": bags[0] == 0 and bags[1] is not None,
}
for text, holds in checks.items():
    print("as found:" if holds else "CHANGED: ", text)
sys.exit(not all(checks.values()))
PY
