"""Read a sensor from a live ROS 2 topic.

The connection uses DDS and needs no ROS installation.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

from pretouch._core.errors import InvalidInputError, SourceError, require

from .source import SourceReading

_WAIT: Final = 0.1  # s, longest time of one call of `read`
_POLL: Final = 1e-3  # s between two looks for new messages
_DISCOVERY: Final = 5.0  # s until a topic without publisher counts as missing
_QUEUE: Final = 10_000  # messages that wait while the program is busy


class TopicSource:
    """Source of sensor readings from a ROS 2 topic.

    The messages have the type sensor_msgs/Range, std_msgs/Float64 or std_msgs/Float32.

    Args:
        topic: its name in ROS, such as `/proximity`, or in DDS, such as `rt/proximity`.
        domain: the DDS domain, in ROS the environment variable ROS_DOMAIN_ID.
    """

    def __init__(self, topic: str, domain: int = 0) -> None:
        require("cyclonedds", extra="ros")
        from cyclonedds.core import DDSException, Policy, Qos  # noqa: PLC0415 - an extra
        from cyclonedds.domain import DomainParticipant  # noqa: PLC0415
        from cyclonedds.sub import DataReader  # noqa: PLC0415
        from cyclonedds.topic import Topic  # noqa: PLC0415

        from .ros_messages import reading_members  # noqa: PLC0415

        members = reading_members()

        self.name = topic if topic.startswith("rt/") else f"rt/{topic.removeprefix('/')}"
        self.unit: str | None = None
        try:
            self._participant = DomainParticipant(domain)
            kind = _published_type(self._participant, self.name, {_full_name(kind): kind for kind in members})
            # best effort matches every publisher; a reliable reader would ignore best-effort sensors
            quality = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(_QUEUE))
            self._reader: Any = DataReader(self._participant, Topic(self._participant, self.name, kind), qos=quality)
        except DDSException as error:
            raise SourceError(
                f"{self.name}: DDS cannot read the topic ({error}); check the network interface"
            ) from None
        self._field = members[kind]

    def read(self) -> list[SourceReading] | None:
        """Return the readings that have arrived.

        The call waits up to a tenth of a second.
        """
        end = time.monotonic() + _WAIT
        messages = self._reader.take(_QUEUE)
        while not messages and time.monotonic() < end:
            time.sleep(_POLL)
            messages = self._reader.take(_QUEUE)
        # a publisher that leaves is announced by a sample without data
        return [SourceReading(float(getattr(m, self._field))) for m in messages if hasattr(m, self._field)]

    def close(self) -> None:
        """Close the DDS reader and its connection to the network."""
        self._reader = self._participant = None

    def why_silent(self) -> str:
        """Explain why no messages arrive, and what to do."""
        publishers = len(self._reader.get_matched_publications())
        if not publishers:
            return "the topic has no publisher any more: start the node that publishes the topic"
        return "the publisher sends no messages: check the sensor and its node"

    @property
    def notes(self) -> tuple[str, ...]:
        """A remark on messages that were lost.

        Empty if no message was lost.
        """
        lost = self._lost()
        return (f"{self.name}: {lost:,} messages were lost between the publisher and pretouch.",) if lost else ()

    def _lost(self) -> int:
        return 0 if self._reader is None else int(self._reader.get_sample_lost_status().total_count)


def _full_name(kind: Any) -> str:
    """Return the DDS name of a message type."""
    return str(kind.__idl_typename__)


def _published_type(participant: Any, topic: str, kinds: Mapping[str, Any]) -> Any:
    """Return the message type of a published topic."""
    from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication  # noqa: PLC0415 - an extra

    publications: Any = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
    end, types = time.monotonic() + _DISCOVERY, dict[str, str]()
    while topic not in types and time.monotonic() < end:
        types |= {p.topic_name: p.type_name for p in publications.take(_QUEUE) if hasattr(p, "topic_name")}
        time.sleep(_POLL)
    if topic not in types:
        listed = ", ".join(sorted(name for name in types if name.startswith("rt/"))) or "none"
        raise InvalidInputError(
            f"--topic: found no publisher of the topic {topic} within {_DISCOVERY:g} s. Start the node that publishes "
            f"this topic, and check ROS_DOMAIN_ID (--domain). Topics on this network: {listed}"
        )
    if types[topic] not in kinds:
        raise InvalidInputError(
            f"--topic: the topic {topic} has the message type {types[topic]}, expected one of {', '.join(kinds)}"
        )
    return kinds[types[topic]]
