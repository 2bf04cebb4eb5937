"""Decode one number and the header stamp of each message.

The messages are ROS 2 messages (CDR) or JSON messages.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, require
from pretouch._core.numbers import BoolArray, FloatArray, IntArray

from .containers import EXTRA
from .layout import (
    MessageLayout,
    UnsupportedLayoutError,
    column,
    group_by_size,
    layout_of,
    stamps_of,
    table_of,
    with_layout,
)
from .messages import Messages, Topic

_ZSTD: Final = b"\x28\xb5\x2f\xfd"
_STAMP: Final = ("header.stamp", "stamp", "timestamp")
_BOUNDS: Final = (("min_range", "max_range"), ("range_min", "range_max"))  # of Range and LaserScan
_USUAL: Final = ("range", "data", "value", "distance")
_NAMES_FROM: Final = 12  # bytes of the encoding and of the stamp of a message with a header
_NANOSECONDS: Final = ("nanosec", "nsec", "nsecs")
_TOKEN: Final = re.compile(r"[^.\[\]]+")
_SHOWN: Final = 16  # fields that a message lists
_COMPRESSED: Final = 100  # messages of which one must be compressed if the recorder compressed each
_LATEST: Final = 2**62  # ns, in the year 2116: a later time is damaged
_MOST_LAYOUTS: Final = 8  # of messages of equal size; the rest is decoded one by one
_IDL: Final = ("ros2idl", "omgidl")
_SEPARATOR: Final = re.compile(r"^={80}\n", re.MULTILINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """Decoded numbers and header stamps of a topic.

    Damaged messages are left out.

    Args:
        field: the field that was decoded.
        values: the numbers; NaN for a message without the field.
        stamps: header stamps [ns]; 0 for a message without one.
        received: receive times [ns].
        damaged: number of messages that could not be decoded.
        bounds: smallest and largest valid value according to the messages; NaN if they do not say.
    """

    field: str
    values: FloatArray
    stamps: IntArray
    received: IntArray
    damaged: int = 0
    bounds: tuple[float, float] = (float("nan"), float("nan"))


@dataclass(slots=True, kw_only=True)
class _Columns:
    """What was decoded of each message.

    Args:
        values: the numbers; NaN for a message without the field.
        stamps: header stamps [ns]; 0 for a message without one.
        usable: whether the message could be decoded.
    """

    values: FloatArray
    stamps: IntArray
    usable: BoolArray


def decode(messages: Messages, field: str) -> Decoded:
    """Decode one numeric field in all messages of a topic.

    Args:
        messages: the messages, at least one.
        field: the field, such as "range" or "position[0]"; empty for the usual or only number of the type.

    Returns:
        The numbers and the stamps.

    Raises:
        InvalidInputError: the messages have no such field, have an unknown type, or are all damaged.
    """
    topic, data = messages.topic, _contents(messages)
    received, usable = _receive_times(messages.received)
    columns = _Columns(values=np.full(len(data), np.nan), stamps=np.zeros(len(data), dtype=np.int64), usable=usable)
    rows, bounds = np.flatnonzero(usable), (float("nan"), float("nan"))
    if len(rows):
        read = _decode_json if topic.encoding == "json" else _decode_cdr
        field, bounds = read(data, rows, topic, field, columns)
    if not usable.any():
        raise InvalidInputError(
            f"{topic.name}: none of the {len(data):,} messages can be decoded as "
            f"{topic.message_type or topic.encoding}; the file is damaged, or the recording has another version of "
            "this type. Record again in the format MCAP, which stores the definitions of the types"
        )
    kept = slice(None) if usable.all() else usable
    return Decoded(
        field=field,
        values=columns.values[kept],
        stamps=columns.stamps[kept],
        received=received[kept],
        damaged=int((~usable).sum()) + messages.damaged,
        bounds=bounds,
    )


def _receive_times(received: list[int]) -> tuple[IntArray, BoolArray]:
    """Return the receive times [ns], and whether each of them is possible."""
    try:
        times = np.array(received, dtype=np.int64)
    except OverflowError:
        times = np.array([time if time < _LATEST else -1 for time in received], dtype=np.int64)
    return times, (times >= 0) & (times < _LATEST)


def _contents(messages: Messages) -> list[bytes]:
    """Return the uncompressed content of each message; none for a message that cannot be decompressed."""
    topic, data = messages.topic, messages.data
    if topic.encoding not in {"cdr", "json"}:
        raise InvalidInputError(
            f"{topic.name}: found messages with the encoding {topic.encoding!r}, expected 'cdr' (ROS 2) or 'json'; "
            "choose another topic, or convert the recording"
        )
    if not any(message[:4] == _ZSTD for message in data[:_COMPRESSED]):
        return data
    library = require("zstandard", extra=EXTRA)  # the recorder compressed each message
    unpack = library.ZstdDecompressor().decompress
    plain = []
    for message in data:
        try:
            plain.append(unpack(message))
        except library.ZstdError:
            plain.append(b"")
    return plain


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
        decoded = (_parse(text) for text in data)
    else:
        typical = data[max(group_by_size(data).values(), key=len)[0]]
        store = _type_store(topic, typical)
        fields = layout_of(typical, topic.message_type, store.fielddefs).fields
        end = fields["position[0]"].offset if "position[0]" in fields else None
        different = {message[_NAMES_FROM:end]: message for message in data}  # messages without their stamps
        decoded = (_deserialize(store, message, topic) for message in different.values())
    lists = {tuple(_part_of(message, "name") or ()) for message in decoded if message is not None}
    names = next(iter(lists), ())
    if len(lists) > 1 or not names:
        joints = " or ".join(", ".join(each) or "none" for each in sorted(lists)[:2])
        raise InvalidInputError(
            f"{topic.name}: found messages with the joints {joints}, expected the same joints in all messages of "
            "this topic"
        )
    return names


def _decode_cdr(
    data: list[bytes], rows: IntArray, topic: Topic, field: str, columns: _Columns
) -> tuple[str, tuple[float, float]]:
    """Decode one number and one header stamp per ROS 2 message.

    Returns:
        The field, and the smallest and largest valid value.
    """
    chosen = data if len(rows) == len(data) else [data[i] for i in rows]
    # the most frequent size first: a damaged message must choose neither the definition nor the field
    groups = sorted(group_by_size(chosen).values(), key=len, reverse=True)
    store = _type_store(topic, chosen[groups[0][0]])
    name, bounds, is_known = field, (float("nan"), float("nan")), False
    for group in groups:
        rest, table = rows[group], table_of(chosen, group, len(chosen[group[0]]))
        for attempt in range(_MOST_LAYOUTS):
            try:
                layout = layout_of(bytes(table[0]), topic.message_type, store.fielddefs)
            except UnsupportedLayoutError:
                layout = None
            if layout is None or attempt == _MOST_LAYOUTS - 1:
                name = _decode_each(data, rest, topic, name, store=store, columns=columns)
                break
            name = name if is_known else _field_of(name, list(layout.fields), topic)
            is_known = True
            same = with_layout(table, layout)
            places, part = (rest, table) if same.all() else (rest[same], table[same])
            if name in layout.fields:
                with np.errstate(invalid="ignore"):  # the bits of a damaged number can be those of a signaling NaN
                    columns.values[places] = column(part, layout.fields[name])
            columns.stamps[places] = _stamps(part, layout)
            for low, high in _BOUNDS:
                if np.isnan(bounds[0]) and {low, high} <= set(layout.fields):
                    ends = (float(column(part[:1], layout.fields[end])[0]) for end in (low, high))
                    bounds = (next(ends), next(ends))
            if same.all():
                break
            rest, table = rest[~same], table[~same]
    return name, bounds


def _stamps(table: Any, layout: MessageLayout) -> Any:
    """Return the header stamps [ns] of messages with equal byte layout."""
    for name in _STAMP:
        pair = [layout.fields.get(f"{name}.{part}") for part in ("sec", "nanosec")]
        if pair[0] is not None and pair[1] is not None:
            return stamps_of(column(table, pair[0]), column(table, pair[1]))
    return 0


def _decode_each(data: list[bytes], rows: IntArray, topic: Topic, name: str, *, store: Any, columns: _Columns) -> str:
    """Decode messages one by one, and return the decoded field."""
    for i in rows:
        message = _deserialize(store, data[i], topic)
        if message is None:
            columns.usable[i] = False
            continue
        part = _part_of(message, name) if name else None
        if part is None:  # the first message, or one in which a list is too short
            name = _field_of(name, _numbers_in(message), topic)
            part = _part_of(message, name)
        columns.values[i] = _as_number(part)
        columns.stamps[i] = _stamp_of(message)
    return name


def _deserialize(store: Any, message: bytes, topic: Topic) -> Any:
    """Decode one ROS 2 message; None if it is damaged."""
    serde = require("rosbags.serde", extra=EXTRA)
    try:
        return store.deserialize_cdr(message, topic.message_type)
    except (serde.SerdeError, LookupError, AssertionError, MemoryError, OverflowError):
        return None


def _decode_json(
    data: list[bytes], rows: IntArray, topic: Topic, field: str, columns: _Columns
) -> tuple[str, tuple[float, float]]:
    """Decode one number and one header stamp per JSON message.

    Returns:
        The field, and the smallest and largest valid value.
    """
    bounds = (float("nan"), float("nan"))
    example = None
    for i in rows.tolist():
        message = _parse(data[i])
        if message is None:
            columns.usable[i] = False
            continue
        if example is None:
            example = message
            given = [[_as_number(_part_of(message, end)) for end in ends] for ends in _BOUNDS]
            bounds = next(((low, high) for low, high in given if low < high), bounds)
        if not field and isinstance(message, dict):
            field = _field_of(field, _numbers_in(message), topic)
        columns.values[i] = _as_number(_part_of(message, field) if field else message)
        columns.stamps[i] = _stamp_of(message)
    if not np.isfinite(columns.values).any() and field and example is not None:
        fields = _numbers_in(example)
        if field not in fields:
            _field_of(field, fields, topic)
    return field, bounds


def _parse(text: bytes) -> Any:
    """Parse a JSON message; None if it is damaged."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


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
    except (TypeError, ValueError, OverflowError):
        return float("nan")


def _stamp_of(message: Any) -> int:
    """Return the header stamp [ns] of a decoded message, or 0."""
    for name in _STAMP:
        stamp = _part_of(message, name)
        seconds = None if stamp is None else _part_of(stamp, "sec")
        if seconds is not None:
            parts = (_part_of(stamp, part) for part in _NANOSECONDS)
            rest = next((part for part in parts if part is not None), 0)
            try:
                time = int(seconds) * 1_000_000_000 + int(rest)
            except (TypeError, ValueError, OverflowError):
                return 0
            return time if abs(time) < _LATEST else 0
    return 0


def _type_store(topic: Topic, message: bytes) -> Any:
    """Return the definitions of the message types for a topic."""
    types = require("rosbags.typesys", extra=EXTRA)
    if topic.definition:
        with suppress(types.TypesysError):
            store = types.get_typestore(types.Stores.EMPTY)
            store.register(_definitions(topic, types))
            return store
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


def _definitions(topic: Topic, types: Any) -> dict[str, Any]:
    """Parse the definition of a message type in a recording, with the types that it contains.

    The recorder of ROS 2 writes a separator and a title before each definition, and before the first one only if it is
    in the format IDL.

    Returns:
        Constants and fields of each type, as rosbags has them.
    """
    first, *others = _SEPARATOR.split(topic.definition)
    parsed: dict[str, Any] = {}
    if first.strip() and topic.definition_format in _IDL:
        parsed |= types.get_types_from_idl(first)
    elif first.strip():
        return dict(types.get_types_from_msg(topic.definition, topic.message_type))
    for part in others:
        title, _, text = part.partition("\n")
        form, _, name = title.partition(":")
        if form.strip() == "IDL":
            parsed |= types.get_types_from_idl(text)
        else:
            parsed |= types.get_types_from_msg(text, name.strip())
    return parsed
