"""Write recordings for tests: ROS 2 bags with rosbags, MCAP files with mcap, and CSV files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

RANGE, FLOAT, JOINTS = "sensor_msgs/msg/Range", "std_msgs/msg/Float64", "sensor_msgs/msg/JointState"


def store(version: str = "LATEST") -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(getattr(Stores, version))


def stamp(types: Any, nanoseconds: int, frame: str = "sensor") -> Any:
    time = types.types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return types.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def range_message(
    types: Any, nanoseconds: int, value: float, frame: str = "sensor", limits: tuple[float, float] = (0.0, 1.0)
) -> Any:
    kind = types.types[RANGE]
    extra = {"variance": 0.0} if "variance" in kind.__dataclass_fields__ else {}
    low, high = limits
    numbers = {"radiation_type": 1, "field_of_view": 0.1, "min_range": low, "max_range": high, "range": value}
    return kind(header=stamp(types, nanoseconds, frame), **numbers, **extra)


def float_message(types: Any, value: float, message_type: str = FLOAT) -> Any:
    return types.types[message_type](data=value)


def write_bag(
    path: Path,
    topics: dict[str, tuple[str, Iterable[tuple[int, Any]]]],
    *,
    storage: str = "MCAP",
    compression: str = "",
    version: int = 9,
    types: Any = None,
) -> Path:
    """Write a bag with messages of several topics, as topic: (type, [(receive time in ns, message), ...])."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    types = types or store()
    writer = Writer(path, version=version, storage_plugin=getattr(StoragePlugin, storage))
    if compression:
        writer.set_compression(getattr(CompressionMode, compression), CompressionFormat.ZSTD)
    with writer:
        rows = []
        for topic, (kind, messages) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=types)
            rows += [(time, connection, message) for time, message in messages]
        for time, connection, message in sorted(rows, key=lambda row: row[0]):
            writer.write(connection, time, types.serialize_cdr(message, connection.msgtype))
    return path


def write_json_mcap(path: Path, topics: dict[str, Sequence[tuple[int, Any]]], **options: Any) -> Path:
    """Write an MCAP file with JSON messages, in the given order of each topic."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start()
        schema = writer.register_schema("Any", "jsonschema", b'{"type": "object"}')
        for topic, messages in topics.items():
            channel = writer.register_channel(topic, "json", schema)
            for time, message in messages:
                writer.add_message(channel, time, json.dumps(message).encode(), time)
        writer.finish()
    return path


def range_bag(path: Path, time: Any, values: Any, *, delay_ns: int = 0, topic: str = "/range", **options: Any) -> Path:
    """Write a bag with a topic of type Range: header stamps, and receive times that are `delay_ns` later."""
    types = options.pop("types", None) or store()
    limits = options.pop("limits", (0.0, 1.0))
    messages = range_messages(types, time, values, delay_ns=delay_ns, limits=limits)
    return write_bag(path, {topic: (RANGE, messages)}, types=types, **options)


def range_messages(
    types: Any,
    time: Any,
    values: Any,
    *,
    delay_ns: int = 0,
    stamp_time: Any = None,
    limits: tuple[float, float] = (0.0, 1.0),
) -> list[tuple[int, Any]]:
    """Return messages of type Range with their receive times; `stamp_time` is the time of another clock."""
    received = np.round(np.asarray(time) * 1e9).astype(np.int64) + 10**18 + delay_ns
    stamps = received - delay_ns if stamp_time is None else np.round(np.asarray(stamp_time) * 1e9).astype(np.int64)
    rows = zip(received.tolist(), stamps.tolist(), np.asarray(values).tolist(), strict=True)
    return [(t, range_message(types, s, v, limits=limits)) for t, s, v in rows]


def float_bag(path: Path, time: Any, values: Any, *, topic: str = "/reading", **options: Any) -> Path:
    """Write a bag with a topic of type Float64."""
    types = options.pop("types", None) or store()
    stamps = np.round(np.asarray(time) * 1e9).astype(np.int64) + 10**18
    messages = [(int(s), float_message(types, float(v))) for s, v in zip(stamps, values, strict=True)]
    return write_bag(path, {topic: (FLOAT, messages)}, types=types, **options)
