"""Define the ROS 2 message types of live sensor topics.

The DDS library `cyclonedds` needs these definitions. The members and their order are those of the message definitions
of ROS 2. Members that a later version of ROS adds at the end, such as `variance` of Range, are ignored.
"""

# The library reads the annotations of a class at run time, so this module does not import them from __future__.

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any


@cache
def message_types() -> Any:
    """Define the ROS message types, and return them in one object."""
    from cyclonedds.idl import IdlStruct  # noqa: PLC0415 - an extra
    from cyclonedds.idl.annotations import autoid, final  # noqa: PLC0415
    from cyclonedds.idl.types import float32, float64, int32, uint8, uint32  # noqa: PLC0415

    @dataclass
    @final
    @autoid("sequential")
    class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):  # type: ignore[misc, call-arg]
        """Time stamp of a ROS message, builtin_interfaces/Time."""

        sec: int32
        nanosec: uint32

    @dataclass
    @final
    @autoid("sequential")
    class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):  # type: ignore[misc, call-arg]
        """Time stamp and coordinate frame of a ROS message, std_msgs/Header."""

        stamp: Time
        frame_id: str

    @dataclass
    @final
    @autoid("sequential")
    class Range(IdlStruct, typename="sensor_msgs::msg::dds_::Range_"):  # type: ignore[misc, call-arg]
        """Reading of a range sensor, sensor_msgs/Range."""

        header: Header
        radiation_type: uint8
        field_of_view: float32
        min_range: float32
        max_range: float32
        range: float32

    @dataclass
    @final
    @autoid("sequential")
    class Float64(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):  # type: ignore[misc, call-arg]
        """A number in double precision, std_msgs/Float64."""

        data: float64

    @dataclass
    @final
    @autoid("sequential")
    class Float32(IdlStruct, typename="std_msgs::msg::dds_::Float32_"):  # type: ignore[misc, call-arg]
        """A number in single precision, std_msgs/Float32."""

        data: float32

    return SimpleNamespace(Time=Time, Header=Header, Range=Range, Float64=Float64, Float32=Float32)


def reading_members() -> dict[Any, str]:
    """Return the reading's field name for each message type."""
    types = message_types()
    return {types.Range: "range", types.Float64: "data", types.Float32: "data"}
