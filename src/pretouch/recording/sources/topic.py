"""Read a sensor from a live ROS 2 topic.

The connection uses DDS and needs no ROS installation.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

from pretouch._core.errors import InvalidInputError, SourceError, require
from pretouch.recording.no_object import distance_meaning

from .ros_discovery import Discovery, discovery_settings, undiscovered
from .source import SourceReading, is_usable

_WAIT: Final = 0.1  # s, longest time of one call of `read`
_POLL: Final = 1e-3  # s between two looks for new messages
_DISCOVERY: Final = 5.0  # s until a topic without publisher counts as missing
_MATCH: Final = 5.0  # s until a publisher that is found counts as unreachable
_TYPE_LOOKUP: Final = 2.0  # s until a publisher counts as one that does not send its message type
_ELSEWHERE: Final = 1.5  # s of a look into other domains
_DOMAINS: Final = range(102)  # those that ROS recommends, because their ports are not used by the operating system
_DOMAINS_AT_ONCE: Final = 34  # each needs some threads and open files
_QUEUE: Final = 10_000  # messages that wait while the program is busy
_TYPE_CONSISTENCY: Final = 24
_POLICIES: Final = {  # numbers in the DDS standard
    2: "durability",
    3: "presentation",
    4: "deadline",
    5: "latency budget",
    6: "ownership",
    8: "liveliness",
    10: "partition",
    11: "reliability",
    12: "destination order",
    23: "data representation",
    _TYPE_CONSISTENCY: "type consistency",
}


class TopicSource:
    """Source of sensor readings from a ROS 2 topic.

    The messages have the type sensor_msgs/Range, or one of the types of std_msgs with one number.

    Args:
        topic: its name in ROS, such as `/proximity`, or in DDS, such as `rt/proximity`.
        domain: the DDS domain, in ROS the environment variable ROS_DOMAIN_ID.
        unit: unit of the readings. Without one, or in m, messages of the type Range are distances, and those outside of
            the limits in the message are skipped.
    """

    def __init__(self, topic: str, domain: int = 0, unit: str | None = None) -> None:
        require("cyclonedds", extra="ros")
        from cyclonedds.core import DDSException  # noqa: PLC0415 - an extra

        self.name = topic if topic.startswith("rt/") else f"rt/{topic.removeprefix('/')}"
        self.unit: str | None = None
        self._skipped, self._example = Counter[str](), 0.0
        settings = discovery_settings()
        try:
            self._participant, *self._domain = settings.join(domain)
            publication = _publication(self._participant, self.name, domain, settings)
            self._field, versions = _message_type(self._participant, publication)
            self._reader = _reader_of(self._participant, publication, versions)
        except DDSException as error:
            raise SourceError(
                f"{self.name}: DDS cannot read the topic ({error}); check the network interface and the variables "
                f"{', '.join(settings.variables) or 'of ROS'}"
            ) from None
        self._last_notes: tuple[str, ...] = ()
        self._are_distances = self._field == "range" and unit in {None, "m"}

    def read(self) -> list[SourceReading] | None:
        """Return the readings that have arrived.

        The call waits up to a tenth of a second.
        """
        end = time.monotonic() + _WAIT
        messages = self._reader.take(_QUEUE)
        while not messages and time.monotonic() < end:
            time.sleep(_POLL)
            messages = self._reader.take(_QUEUE)
        return list(self._readings(messages))

    def close(self) -> None:
        """Close the DDS reader and its connection to the network."""
        self._last_notes = self._reader_notes()
        self._reader = self._participant = None
        self._domain = []

    def why_silent(self) -> str:
        """Explain why no messages arrive, and what to do."""
        if self._skipped:
            return f"{self._skipped.total():,} messages had no usable reading ({self._listed}): {self._remedy}"
        if not self._reader.get_matched_publications():
            return "the topic has no publisher any more: start the node that publishes the topic"
        return "the publisher sends no messages: check the sensor and its node"

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on messages that were lost or skipped, and on publishers that cannot be read."""
        notes = self._last_notes if self._reader is None else self._reader_notes()
        if not self._skipped:
            return notes
        count = self._skipped.total()
        return f"{self.name}: skipped {count:,} messages without a usable reading ({self._listed}).", *notes

    def _reader_notes(self) -> tuple[str, ...]:
        """Return remarks on messages that were lost, and on publishers that cannot be read."""
        notes = []
        if self._reader is not None and (lost := int(self._reader.get_sample_lost_status().total_count)):
            notes.append(f"{self.name}: {lost:,} messages were lost between the publisher and pretouch.")
        if self._reader is not None and (refused := _refused_policy(self._reader)):
            notes.append(f"{self.name}: another publisher of the topic was not read, because its {refused} differs.")
        return tuple(notes)

    def _readings(self, messages: list[Any]) -> Iterator[SourceReading]:
        """Yield the usable readings, and count the others."""
        for message in messages:
            if not hasattr(message, self._field):  # a publisher that leaves is announced by a sample without data
                continue
            output = float(getattr(message, self._field))
            if self._are_distances:
                meaning = distance_meaning(output, (message.min_range, message.max_range))
            else:
                meaning = "distance" if is_usable(output) else "no valid reading"
            if meaning == "distance":
                yield SourceReading(output)
            else:
                self._skipped[meaning] += 1
                self._example = output

    @property
    def _listed(self) -> str:
        parts = ", ".join(f"{count:,} {meaning}" for meaning, count in self._skipped.items())
        return f"{parts}; the last of them is {self._example:g}"

    @property
    def _remedy(self) -> str:
        if self._are_distances:
            return (
                "messages of the type Range are distances in m. If these are other readings, give their unit, such as "
                "--unit counts. If the sensor gives no distance without an object, use --no-empty-scene"
            )
        return "check the sensor and its node"


def _publications(participant: Any) -> Iterator[list[Any]]:
    """Yield, again and again, the publications that became known since the last time."""
    from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication  # noqa: PLC0415 - an extra

    reader: Any = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
    while True:
        yield [each for each in reader.take(_QUEUE) if hasattr(each, "topic_name")]


def _publication(participant: Any, topic: str, domain: int, settings: Discovery) -> Any:
    """Wait for a publication of a topic, preferably one with a reading, and return it."""
    from .ros_messages import LISTED, reading_types  # noqa: PLC0415

    end, names, types = time.monotonic() + _DISCOVERY, set[str](), set[str]()
    for arrived in _publications(participant):
        for each in arrived:
            if each.topic_name == topic and each.type_name in reading_types():
                return each
        names |= {each.topic_name for each in arrived}
        types |= {each.type_name for each in arrived if each.topic_name == topic}
        if types or time.monotonic() > end:
            break
        time.sleep(_POLL)
    if types:
        listed = ", ".join(sorted(map(_in_ros, types)))
        raise InvalidInputError(f"--topic: the topic {topic} has the message type {listed}, expected one of {LISTED}")
    start = f"--topic: found no publisher of the topic {topic} in the DDS domain {domain} within {_DISCOVERY:g} s"
    if others := _other_domains(topic, domain, settings):
        listed = " and ".join(map(str, others))
        raise InvalidInputError(f"{start}. It is published in the domain {listed}: use --domain {others[0]}")
    if listed := ", ".join(sorted(name for name in names if name.startswith("rt/"))):
        raise InvalidInputError(
            f"{start}. Check the name, and start the node that publishes the topic. The topics of this domain are "
            f"{listed}. {undiscovered(settings)}"
        )
    raise InvalidInputError(
        f"{start}, and no other topic either. Start the node that publishes the topic. {undiscovered(settings)}"
    )


def _other_domains(topic: str, domain: int, settings: Discovery) -> list[int]:
    """Return the other DDS domains in which a topic is published."""
    from cyclonedds.core import DDSException  # noqa: PLC0415 - an extra

    others = [other for other in _DOMAINS if other != domain]
    for first in range(0, len(others), _DOMAINS_AT_ONCE):
        joined = {}
        for other in others[first : first + _DOMAINS_AT_ONCE]:
            try:
                entities = settings.join(other)
            except DDSException:  # its ports are in use; the other domains can still be searched
                continue
            joined[other] = entities, _publications(entities[0])
        end, having = time.monotonic() + _ELSEWHERE, set[int]()
        while not having and time.monotonic() < end:
            time.sleep(_WAIT)
            having = {
                other
                for other, (_, publications) in joined.items()
                if any(each.topic_name == topic for each in next(publications))
            }
        if having:
            return sorted(having)
    return []


def _message_type(participant: Any, publication: Any) -> tuple[str, tuple[Any, ...]]:
    """Return the member with the reading, and the definitions of the message type that fit a publisher, best first.

    A publisher that sends its type is only matched by a definition with the same members. The versions of ROS differ,
    so the publisher's own definition is requested if no known one is equal.
    """
    from cyclonedds.core import DDSException  # noqa: PLC0415 - an extra
    from cyclonedds.dynamic import get_types_for_typeid  # noqa: PLC0415

    from .ros_messages import reading_types, type_identifiers  # noqa: PLC0415

    kind = reading_types()[publication.type_name]
    sent = publication.type_id
    if sent is None:
        return kind.member, kind.versions
    equal = [version for version in kind.versions if sent in type_identifiers(version)]
    if equal:
        return kind.member, tuple(equal)
    try:
        own, _ = get_types_for_typeid(participant, sent, round(1e9 * _TYPE_LOOKUP))
    except DDSException:  # the publisher does not answer
        return kind.member, kind.versions
    # another type with this name may lack the reading
    needed = {name: number for name, number in kind.versions[0].__annotations__.items() if name != "header"}
    return kind.member, (own,) if needed.items() <= own.__annotations__.items() else kind.versions


def _reader_of(participant: Any, publication: Any, versions: tuple[Any, ...]) -> Any:
    """Return a reader that is connected to a publisher.

    Raises:
        InvalidInputError: the publisher offers what no reader of pretouch accepts.
    """
    from cyclonedds.core import Policy, Qos  # noqa: PLC0415 - an extra
    from cyclonedds.sub import DataReader, Subscriber  # noqa: PLC0415
    from cyclonedds.topic import Topic  # noqa: PLC0415

    # The request matches every publisher: a reliable reader would ignore best-effort sensors. Partition and ownership
    # must be equal to those of the publisher.
    equal = (
        each for each in map(publication.qos.__getitem__, (Policy.Ownership, Policy.Partition)) if each is not None
    )
    representation = Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=True)
    quality = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(_QUEUE), representation, *equal)
    refused = ""
    for version in versions:
        subscriber = Subscriber(participant, qos=quality)
        topic = Topic(participant, publication.topic_name, version)
        reader: Any = DataReader(subscriber, topic, qos=quality)
        end = time.monotonic() + _MATCH
        while not reader.get_matched_publications() and not _refused_policy(reader) and time.monotonic() < end:
            time.sleep(_POLL)
        if reader.get_matched_publications():
            return reader
        refused = refused or _refused_policy(reader)
        del reader, topic, subscriber  # two definitions of one topic cannot exist at the same time
    refusal = _refusal(publication, refused)
    raise InvalidInputError(f"--topic: found a publisher of the topic {publication.topic_name}, but {refusal}")


def _refused_policy(reader: Any) -> str:
    """Return the name of the DDS policy because of which a publisher was refused last; empty if none was."""
    status = reader.get_requested_incompatible_qos_status()
    return _POLICIES.get(status.last_policy_id, f"policy {status.last_policy_id}") if status.total_count else ""


def _refusal(publication: Any, policy: str) -> str:
    """Explain why a publisher that was found cannot be read, and what to do."""
    if policy == _POLICIES[_TYPE_CONSISTENCY] or (not policy and publication.type_id is not None):
        return (
            f"its message type {_in_ros(publication.type_name)} has other members than in ROS 2 Humble, Jazzy and "
            f"Kilted (DDS policy {_POLICIES[_TYPE_CONSISTENCY]}). Publish the type of a ROS distribution"
        )
    if not policy:
        return f"it did not connect within {_MATCH:g} s; check whether the node still runs"
    return f"its DDS policy {policy} is incompatible. Publish the topic with the default or the sensor profile of ROS 2"


def _in_ros(name: str) -> str:
    """Return the ROS name of a message type in DDS."""
    return name.replace("::msg::dds_::", "/").removesuffix("_")
