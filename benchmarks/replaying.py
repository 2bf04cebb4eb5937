"""How long a recording of 10 minutes at 1 kHz takes to read and to replay, next to rosbags' reader and deserializer.

It needs the extra `ros`. Times are CPU times of this process; the bags have 600,000 messages.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import pretouch as pt
from pretouch.recording import read_recording, replay

MESSAGES, RATE, START = 600_000, 1000, 1_700_000_000_000_000_000
RANGE = "sensor_msgs/msg/Range"


def write(folder: Path, storage: StoragePlugin, count: int) -> Path:
    """Write a bag with ranges of an object that comes and goes; one message is serialized, and its numbers changed."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    clock = types["builtin_interfaces/msg/Time"](sec=START // 10**9, nanosec=0)
    header = types["std_msgs/msg/Header"](stamp=clock, frame_id="sensor")
    limits = {"radiation_type": 1, "field_of_view": 0.1, "min_range": 0.0, "max_range": 1.0, "variance": 0.0}
    raw = bytearray(store.serialize_cdr(types[RANGE](header=header, range=0.0, **limits), RANGE))
    moment = np.arange(count) / RATE
    ranges = (0.25 * (1 + np.cos(moment * 2 + np.sin(moment / 3)))).astype("<f4")
    with Writer(folder, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection("/range", RANGE, typestore=store)
        for i, value in enumerate(ranges):
            stamp = START + i * 10**9 // RATE
            raw[4:12] = np.array([stamp // 10**9, stamp % 10**9], dtype="<u4").tobytes()
            raw[36:40] = value.tobytes()  # after encoding, stamp, frame "sensor", kind, field of view and limits
            writer.write(connection, stamp, bytes(raw))
    return folder


def by_rosbags(bag: Path) -> np.ndarray:
    """Read stamps and ranges with rosbags alone."""
    store = get_typestore(Stores.ROS2_JAZZY)
    rows = []
    with Reader(bag) as reader:
        for connection, _, raw in reader.messages():
            message: Any = store.deserialize_cdr(raw, connection.msgtype)
            rows.append((message.header.stamp.sec * 10**9 + message.header.stamp.nanosec, message.range))
    return np.array(rows)


def timed(call: Callable[[], Any], repeats: int = 1) -> tuple[float, Any]:
    """Return the shortest CPU time of a call [s], and its result."""
    best, result = float("inf"), None
    for _ in range(repeats):
        start = time.process_time()
        result = call()
        best = min(best, time.process_time() - start)
    return best, result


def main(count: int = MESSAGES) -> None:
    """Print the times for an MCAP file and for sqlite3."""
    task = pt.load_scenario(Path(__file__).parents[1] / "examples" / "loop.toml").replace(gain=-0.86)
    replay(task, read_recording(Path(__file__).parents[1] / "examples" / "approaches.csv", "reading"))  # loads the core
    print(f"{count:,} messages of {RANGE}, {count / RATE:g} s at {RATE} Hz; CPU time")
    with tempfile.TemporaryDirectory() as folder:
        for storage in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
            bag = write(Path(folder, storage.name), storage, count)
            reading, recording = timed(lambda bag=bag: read_recording(bag, "/range"), 3)
            running, result = timed(lambda recording=recording: replay(task, recording), 3)
            peer, rows = timed(lambda bag=bag: by_rosbags(bag))
            if not np.array_equal(recording.values, rows[:, 1]):
                raise SystemExit("pretouch and rosbags have read different ranges")
            steps = len(result.steps.time)
            print(f"{storage.name.lower()}: reading {reading:.2f} s, replay of {steps:,} steps {running:.2f} s,")
            total = reading + running
            print(f"  together {total:.2f} s; rosbags reads in {peer:.2f} s, {peer / reading:.1f} times as long")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
