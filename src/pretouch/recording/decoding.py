"""Decode one number and the header stamp of each message.

The messages are ROS 2 messages (CDR) or JSON messages.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, require
from pretouch._core.numbers import FloatArray, IntArray

from .containers import EXTRA
from .layout import (
    MessageLayout,
    UnsupportedLayoutError,
    column,
    empty_columns,
    group_by_size,
    layout_of,
    same_layout,
    stamps_of,
    table_of,
)
from .messages import Messages, Topic

_ZSTD: Final = b"\x28\xb5\x2f\xfd"
_STAMP: Final = ("header.stamp", "stamp", "timestamp")
_USUAL: Final = ("range", "data", "value", "distance")
_NAMES_FROM: Final = 12  # bytes of the encoding and of the stamp of a message with a header
_NANOSECONDS: Final = ("nanosec", "nsec", "nsecs")
_TOKEN: Final = re.compile(r"[^.\[\]]+")
_SHOWN: Final = 16  # fields that a message lists


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """Decoded numbers and header stamps of a topic.

    Args:
        field: the field that was decoded.
        values: the numbers; NaN for a message without the field.
        stamps: header stamps [ns]; 0 for a message without one.
        bounds: smallest and largest valid value according to the messages; NaN if they do not say.
    """

    field: str
    values: FloatArray
    stamps: IntArray
    bounds: tuple[float, float] = (float("nan"), float("nan"))


def decode(messages: Messages, field: str) -> Decoded:
    """Decode one numeric field in all messages of a topic.

    Args:
        messages: the messages, at least one.
        field: the field, such as "range" or "position[0]"; empty for the usual or only number of the type.

    Returns:
        The numbers and the stamps.
    """
    topic, data = messages.topic, _contents(messages)
    return _decode_json(data, topic, field) if topic.encoding == "json" else _decode_cdr(data, topic, field)


def _contents(messages: Messages) -> list[bytes]:
    """Return the uncompressed content of each message."""
    topic, data = messages.topic, messages.data
    if topic.encoding not in {"cdr", "json"}:
        raise InvalidInputError(
            f"{topic.name}: found messages with the encoding {topic.encoding!r}, expected 'cdr' (ROS 2) or 'json'; "
            "choose another topic, or convert the recording"
        )
    if any(message[:4] == _ZSTD for message in data[:1]):  # the recorder compressed each message
        unpack = require("zstandard", extra=EXTRA).ZstdDecompressor().decompress
        return [unpack(message) for message in data]
    return data


def decode_names(messages: Messages) -> tuple[str, ...]:
    """Return the names of the joints in messages such as sensor_msgs/JointState.

    Args:
        messages: the messages, at least one.

    Returns:
        The names, in the order of the positions.

    Raises:
        InvalidInputError: the messages have no names, or not all the same.
    """
    topic, data = messages.topic, _contents(messages)
    if topic.encoding == "json":
        lists = {tuple(_part_of(json.loads(text), "name") or ()) for text in data}
    else:
        store = _type_store(topic, data[0])
        fields = layout_of(data[0], topic.message_type, store.fielddefs).fields
        end = fields["position[0]"].offset if "position[0]" in fields else None
        different = {message[_NAMES_FROM:end]: message for message in data}  # messages without their stamps
        decoded = (store.deserialize_cdr(message, topic.message_type) for message in different.values())
        lists = {tuple(getattr(message, "name", ())) for message in decoded}
    names = next(iter(lists))
    if len(lists) > 1 or not names:
        joints = " or ".join(", ".join(each) or "none" for each in sorted(lists)[:2])
        raise InvalidInputError(
            f"{topic.name}: found messages with the joints {joints}, expected the same joints in all messages of "
            "this topic"
        )
    return names


def _decode_cdr(data: list[bytes], topic: Topic, field: str) -> Decoded:
    """Decode one number and one header stamp per ROS 2 message."""
    store = _type_store(topic, data[0])
    values, stamps = empty_columns(len(data))
    name, bounds = field, (float("nan"), float("nan"))
    for size, rows in group_by_size(data).items():
        table = table_of(data, rows, size)
        try:
            layout = layout_of(bytes(table[0]), topic.message_type, store.fielddefs)
        except UnsupportedLayoutError:
            layout = None
        if layout is None or not same_layout(table, layout):
            name = _decode_each(data, rows, topic, name, store=store, columns=(values, stamps))
            continue
        name = _field_of(name, list(layout.fields), topic)
        if name in layout.fields:
            values[rows] = column(table, layout.fields[name])
        stamps[rows] = _stamps(table, layout)
        if {"min_range", "max_range"} <= set(layout.fields):
            low, high = (float(column(table[:1], layout.fields[f"{end}_range"])[0]) for end in ("min", "max"))
            bounds = low, high
    return Decoded(field=name, values=values, stamps=stamps, bounds=bounds)


def _stamps(table: Any, layout: MessageLayout) -> Any:
    """Return the header stamps [ns] of messages with equal byte layout."""
    for name in _STAMP:
        pair = [layout.fields.get(f"{name}.{part}") for part in ("sec", "nanosec")]
        if pair[0] is not None and pair[1] is not None:
            return stamps_of(column(table, pair[0]), column(table, pair[1]))
    return 0


def _decode_each(
    data: list[bytes],
    rows: IntArray,
    topic: Topic,
    name: str,
    *,
    store: Any,
    columns: tuple[FloatArray, IntArray],
) -> str:
    """Decode messages one by one, and return the decoded field."""
    values, stamps = columns
    for i in rows:
        message = store.deserialize_cdr(data[i], topic.message_type)
        part = _part_of(message, name) if name else None
        if part is None:  # the first message, or one in which a list is too short
            name = _field_of(name, _numbers_in(message), topic)
            part = _part_of(message, name)
        values[i] = _as_number(part)
        stamps[i] = _stamp_of(message)
    return name


def _decode_json(data: list[bytes], topic: Topic, field: str) -> Decoded:
    values, stamps = empty_columns(len(data))
    for i, text in enumerate(data):
        try:
            message = json.loads(text)
        except ValueError:
            continue  # a damaged message is a missing reading
        if not field:
            field = _field_of(field, _numbers_in(message), topic) if isinstance(message, dict) else ""
        values[i] = _as_number(_part_of(message, field) if field else message)
        stamps[i] = _stamp_of(message)
    if not np.isfinite(values).any() and field:
        fields = _numbers_in(json.loads(data[0]))
        if field not in fields:
            _field_of(field, fields, topic)
    return Decoded(field=field, values=values, stamps=stamps)


def _field_of(field: str, fields: list[str], topic: Topic) -> str:
    """Return the name of the message field to decode."""
    kind = topic.message_type or topic.encoding
    if field:
        if field not in fields and not any(name.partition("[")[0] == field.partition("[")[0] for name in fields):
            raise InvalidInputError(
                f"{topic.name}: the message type {kind} has no numeric field {field!r}; its numeric fields are "
                f"{_listed(fields)}"
            )
        return field
    own = [name for name in fields if not name.startswith(_STAMP)]
    usual = [name for name in _USUAL if name in own]
    if usual or len(own) == 1:
        return (usual or own)[0]
    if not own:
        raise InvalidInputError(f"{topic.name}: the message type {kind} has no numeric fields; choose another topic")
    example = f"{topic.name}.{own[0]}"
    raise InvalidInputError(
        f"{topic.name}: the message type {kind} has {len(own)} numeric fields; choose one of these fields, for example "
        f"{example}. The numeric fields are {_listed(own)}"
    )


def _listed(fields: list[str]) -> str:
    more = f" and {len(fields) - _SHOWN} more" if len(fields) > _SHOWN else ""
    return f"{', '.join(fields[:_SHOWN]) or 'none'}{more}"


def _numbers_in(message: Any, path: str = "") -> list[str]:
    """Return the names of all numeric fields in a message."""
    if isinstance(message, bool | int | float | np.generic):
        return [path]
    if isinstance(message, str | bytes) or message is None:
        return []
    if isinstance(message, Mapping):
        parts: Any = message.items()
    elif isinstance(message, list | tuple | np.ndarray):
        return [name for i, part in enumerate(message) for name in _numbers_in(part, f"{path}[{i}]")]
    else:
        parts = ((n, getattr(message, n)) for n in getattr(message, "__dataclass_fields__", ()) if n != "__msgtype__")
    return [name for key, part in parts for name in _numbers_in(part, f"{path}.{key}" if path else str(key))]


def _part_of(message: Any, path: str) -> Any:
    """Return a named field of a decoded message, or None."""
    for token in _TOKEN.findall(path):
        if isinstance(message, Mapping):
            message = message.get(token)
        elif isinstance(message, list | tuple | np.ndarray) and token.isdigit():
            message = message[int(token)] if int(token) < len(message) else None
        else:
            message = getattr(message, token, None)
    return message


def _as_number(value: Any) -> float:
    """Return a message value as a float, or NaN."""
    try:
        return float(value)
    except (TypeError, ValueError):
        return float("nan")


def _stamp_of(message: Any) -> int:
    """Return the header stamp [ns] of a decoded message, or 0."""
    for name in _STAMP:
        stamp = _part_of(message, name)
        seconds = None if stamp is None else _part_of(stamp, "sec")
        if seconds is not None:
            parts = (_part_of(stamp, part) for part in _NANOSECONDS)
            return int(seconds) * 1_000_000_000 + int(next((part for part in parts if part is not None), 0))
    return 0


def _type_store(topic: Topic, message: bytes) -> Any:
    """Return the definitions of the message types for a topic."""
    types = require("rosbags.typesys", extra=EXTRA)
    parse = {"ros2msg": types.get_types_from_msg, "ros2idl": None}.get(topic.definition_format)
    if topic.definition and topic.definition_format == "ros2idl":
        parse_idl = require("rosbags.typesys", extra=EXTRA).get_types_from_idl
        return _registered(types, parse_idl(topic.definition))
    if topic.definition and parse is not None:
        return _registered(types, parse(topic.definition, topic.message_type))
    for version in (types.Stores.LATEST, types.Stores.ROS2_HUMBLE, types.Stores.ROS2_FOXY):
        store = types.get_typestore(version)
        try:
            layout_of(message, topic.message_type, store.fielddefs)
        except UnsupportedLayoutError:
            continue
        return store
    store = types.get_typestore(types.Stores.LATEST)
    if topic.message_type not in store.fielddefs:
        raise InvalidInputError(
            f"{topic.name}: neither the recording nor ROS defines the message type {topic.message_type}. Record again "
            "with a recent ROS 2 in the format MCAP. This format stores the definitions"
        )
    return store


def _registered(types: Any, definitions: Any) -> Any:
    store = types.get_typestore(types.Stores.EMPTY)
    store.register(definitions)
    return store
