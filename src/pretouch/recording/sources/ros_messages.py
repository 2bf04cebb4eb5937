"""Define the ROS 2 message types of live sensor topics.

The DDS library `cyclonedds` needs these definitions. The members and their order are those of the message definitions
of ROS 2.
"""

from __future__ import annotations

from functools import cache
from types import MappingProxyType, SimpleNamespace
from typing import Any, Final, NamedTuple

NUMBERS: Final = MappingProxyType(
    {
        "Float64": "float64",
        "Float32": "float32",
        "Int8": "int8",
        "UInt8": "uint8",
        "Int16": "int16",
        "UInt16": "uint16",
        "Int32": "int32",
        "UInt32": "uint32",
        "Int64": "int64",
        "UInt64": "uint64",
    }
)
"""Messages of std_msgs with one number, and the type of this number."""

LISTED: Final = "sensor_msgs/Range, std_msgs/Float64, Float32, Int8 to Int64 and UInt8 to UInt64"
"""The message types, in words."""


class ReadingType(NamedTuple):
    """A ROS message type with a sensor reading.

    Args:
        member: name of the member with the reading.
        versions: definitions of the type. The first one also decodes messages of the others, because it has their first
            members; the library ignores the rest.
    """

    member: str
    versions: tuple[Any, ...]


@cache
def message_types() -> Any:
    """Define the ROS message types, and return them in one object."""
    from cyclonedds.idl import types  # noqa: PLC0415 - an extra

    time = _message("builtin_interfaces", "Time", sec=types.int32, nanosec=types.uint32)
    header = _message("std_msgs", "Header", stamp=time, frame_id=str)
    members = {
        "header": header,
        "radiation_type": types.uint8,
        "field_of_view": types.float32,
        "min_range": types.float32,
        "max_range": types.float32,
        "range": types.float32,
    }
    return SimpleNamespace(
        Time=time,
        Header=header,
        Range=_message("sensor_msgs", "Range", **members),  # until Humble
        RangeWithVariance=_message("sensor_msgs", "Range", **members, variance=types.float32),
        **{name: _message("std_msgs", name, data=getattr(types, number)) for name, number in NUMBERS.items()},
    )


@cache
def reading_types() -> dict[str, ReadingType]:
    """Return the message types with a sensor reading, by their names in DDS."""
    types = message_types()
    numbers = [getattr(types, name) for name in NUMBERS]
    return {
        dds_name(types.Range): ReadingType("range", (types.Range, types.RangeWithVariance)),
        **{dds_name(number): ReadingType("data", (number,)) for number in numbers},
    }


def dds_name(message: Any) -> str:
    """Return the name of a message type in DDS."""
    return str(message.__idl_typename__)


def type_identifiers(message: Any) -> tuple[Any, ...]:
    """Return the identifiers of a message type that publishers send: hashes of its members."""
    information = message.__idl__.get_type_info()
    return tuple(each.typeid_with_size.type_id for each in (information.minimal, information.complete))


def _message(package: str, name: str, **members: Any) -> Any:
    """Define one message type."""
    from cyclonedds.idl import make_idl_struct  # noqa: PLC0415 - an extra
    from cyclonedds.idl.annotations import autoid, final  # noqa: PLC0415

    return autoid("sequential")(final(make_idl_struct(name, f"{package}::msg::dds_::{name}_", members)))
