"""Find the byte offset of each number in ROS 2 messages.

With these offsets, many messages are decoded at once.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.numbers import BoolArray, IntArray

_HEADER: Final = 4  # bytes before the content of a message, which describe its encoding
_PADDING: Final = 3  # bytes with which serializers may fill up a message
_TYPES: Final = {
    **{name: name for name in ("bool", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")},
    **{"byte": "uint8", "char": "uint8", "float32": "float32", "float64": "float64"},
}
_LENGTH: Final = 4  # bytes of the length of a text or a list
_MOST_ELEMENTS: Final = 4096  # of a list that are listed as fields


class Place(NamedTuple):
    """Byte offset and type of a number in a message.

    Args:
        offset: bytes from the start of the message.
        kind: NumPy type of the number, with its byte order.
    """

    offset: int
    kind: np.dtype[Any]


class MessageLayout(NamedTuple):
    """Offset and type of each number in a message.

    Args:
        fields: place of each number, by field, such as "header.stamp.sec" or "position[0]".
        lengths: places of the lengths of texts and lists; messages with the same lengths have the same layout.
        size: bytes of the message.
    """

    fields: dict[str, Place]
    lengths: list[Place]
    size: int


class UnsupportedLayoutError(Exception):
    """Raised if the byte layout of a message is unknown.

    Messages with wide characters are an example.
    """


def layout_of(message: bytes, message_type: str, types: Mapping[str, Any]) -> MessageLayout:
    """Find the byte offset and type of each number in one message.

    Args:
        message: the bytes of the message, encoded as CDR.
        message_type: its type.
        types: constants and fields of each type, as rosbags has them.

    Returns:
        The layout.

    Raises:
        UnsupportedLayoutError: the encoding or a type is not supported here, or the message has another size.
    """
    if len(message) < _HEADER or message[0] != 0 or message[1] not in {0, 1}:
        raise UnsupportedLayoutError
    walk = _Walk(message, "<" if message[1] else ">", types)
    try:
        walk.structure(message_type, "")
    except (struct.error, KeyError):
        raise UnsupportedLayoutError from None
    rest = len(message) - walk.place
    if not 0 <= rest <= _PADDING:
        raise UnsupportedLayoutError
    return MessageLayout(walk.fields, walk.lengths, walk.place)


class _Walk:
    """Parser that collects the byte offsets of message fields."""

    def __init__(self, message: bytes, order: str, types: Mapping[str, Any]) -> None:
        self.message, self.order, self.types = message, order, types
        self.place = _HEADER
        self.fields: dict[str, Place] = {}
        self.lengths: list[Place] = []

    def structure(self, kind: str, path: str) -> None:
        for name, description in self.types[kind][1]:
            self._field(description, f"{path}.{name}" if path else name)

    def _field(self, description: Any, path: str) -> None:
        node, detail = int(description[0]), description[1]
        if node == 1:  # a number or a text
            self._base(detail[0], path)
        elif node == 2:  # a structure
            self.structure(detail, path)
        else:  # an array of fixed length, or a list
            element, count = detail
            number = count if node == 3 else self._length()
            for i in range(number):
                if i >= _MOST_ELEMENTS:
                    raise UnsupportedLayoutError
                self._field(element, f"{path}[{i}]")

    def _base(self, name: str, path: str) -> None:
        if name == "string":
            size = self._length()
            self.place += size
            return
        if name not in _TYPES:
            raise UnsupportedLayoutError
        kind = np.dtype(_TYPES[name]).newbyteorder(">" if self.order == ">" else "<")
        self._align(kind.itemsize)
        self.fields[path] = Place(self.place, kind)
        self.place += kind.itemsize

    def _length(self) -> int:
        self._align(_LENGTH)
        self.lengths.append(Place(self.place, np.dtype(f"{self.order}u4")))
        (value,) = struct.unpack_from(f"{self.order}I", self.message, self.place)
        self.place += _LENGTH
        return int(value)

    def _align(self, size: int) -> None:
        self.place += -(self.place - _HEADER) % size


def column(table: Any, place: Place) -> Any:
    """Return one numeric field of many messages.

    Args:
        table: bytes of messages with the same layout, shape (n, size).
        place: place of the number.
    """
    part = np.ascontiguousarray(table[:, place.offset : place.offset + place.kind.itemsize])
    return part.view(place.kind)[:, 0]


def with_layout(table: Any, layout: MessageLayout) -> BoolArray:
    """Return for each message whether it has the byte layout of the first one.

    The layout is the same if the encodings and the lengths of strings and lists are equal.

    Args:
        table: bytes of the messages, shape (n, size).
        layout: layout of the first message.
    """
    encoding = Place(0, np.dtype("u2"))
    same: BoolArray = column(table, encoding) == column(table[:1], encoding)
    for place in layout.lengths:
        lengths = column(table, place)
        same &= lengths == lengths[0]
    return same


def stamps_of(seconds: Any, nanoseconds: Any) -> IntArray:
    """Combine seconds and nanoseconds into time stamps [ns]."""
    return np.asarray(seconds, dtype=np.int64) * 1_000_000_000 + np.asarray(nanoseconds, dtype=np.int64)


def group_by_size(data: Sequence[bytes]) -> dict[int, IntArray]:
    """Group message indices by message size in bytes."""
    sizes = np.fromiter(map(len, data), dtype=np.int64, count=len(data))
    if len(data) and (sizes == sizes[0]).all():
        return {int(sizes[0]): np.arange(len(data))}
    return {int(size): np.flatnonzero(sizes == size) for size in np.unique(sizes)}


def table_of(data: Sequence[bytes], rows: IntArray, size: int) -> Any:
    """Return messages of equal size as one byte array.

    The shape of the array is (n, size).
    """
    chosen = data if len(rows) == len(data) else [data[i] for i in rows]
    return np.frombuffer(b"".join(chosen), dtype=np.uint8).reshape(len(rows), size)
