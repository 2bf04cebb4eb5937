"""Store the raw messages of a recording by topic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Final, NamedTuple, NoReturn

from pretouch._core.errors import InvalidInputError

_SHOWN: Final = 12  # topics that a message lists


class Topic(NamedTuple):
    """Name, message type and encoding of a recorded topic.

    Args:
        name: name of the topic.
        message_type: type of the messages.
        encoding: "cdr" for ROS 2, "json", or another one.
        definition: definition of the message type in the recording; empty if there is none.
        definition_format: "ros2msg", "ros2idl", "jsonschema" or empty.
    """

    name: str
    message_type: str
    encoding: str
    definition: str = ""
    definition_format: str = ""


@dataclass(slots=True, kw_only=True)
class Messages:
    """Raw messages of one topic, in the order of the file.

    Args:
        topic: the topic.
        received: receive time of each message [ns].
        data: content of each message.
        damaged: number of messages without a content or a receive time.
    """

    topic: Topic
    received: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)
    damaged: int = 0


@dataclass(slots=True, kw_only=True)
class Contents:
    """Messages of the wanted topics in a recording.

    Args:
        counts: number of messages of each topic.
        messages: the messages of the wanted topics, by name.
        notes: remarks, such as that a file is truncated.
    """

    counts: dict[Topic, int] = field(default_factory=dict)
    messages: dict[str, Messages] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def messages_of(self, topic: Topic) -> Messages:
        """Return the container for the messages of a topic.

        The first call creates the container.

        Args:
            topic: the topic.
        """
        self.counts.setdefault(topic, 0)
        return self.messages.setdefault(topic.name, Messages(topic=topic))


def split_name(wanted: str, names: Sequence[str]) -> tuple[str, str] | None:
    """Split a name into a topic and a message field.

    Args:
        wanted: topic, or topic and field.
        names: the topics that exist.

    Returns:
        Topic and field, which is empty if the text is a topic; None if there is no such topic.

    Examples:
        >>> split_name("/arm/joints.position[0]", ["/arm/joints"])
        ('/arm/joints', 'position[0]')
    """
    for candidate in (wanted, f"/{wanted}"):
        topic, field_name = candidate, ""
        while topic:
            if topic in names:
                return topic, field_name
            topic, dot, last = topic.rpartition(".")
            field_name = f"{last}.{field_name}" if field_name else last
            if not dot:
                break
    return None


def refuse_unknown(wanted: str, counts: Mapping[Topic, int], source: str) -> NoReturn:
    """Raise an error for an unknown topic.

    The message suggests a similar name and lists the existing topics.

    Args:
        wanted: the topic.
        counts: the topics that exist, with their numbers of messages.
        source: name of the recording.

    Raises:
        InvalidInputError: always.
    """
    names = [topic.name for topic in counts]
    if not names:
        raise InvalidInputError(f"{source}: this recording contains no topics; choose another file")
    near = get_close_matches(wanted, [*names, *(name.lstrip("/") for name in names)], 1, 0.5)
    hint = f" (did you mean {near[0]}?)" if near else ""
    topics = [f"{topic.name} ({topic.message_type or topic.encoding}, {n:,} messages)" for topic, n in counts.items()]
    more = f" and {len(topics) - _SHOWN} more" if len(topics) > _SHOWN else ""
    listed = f"{', '.join(topics[:_SHOWN])}{more}"
    raise InvalidInputError(
        f"{source}: the recording has no topic {wanted!r}{hint}. The topics of the recording are {listed}",
        value=wanted,
        limit=tuple(names),
        remedy=near[0] if near else "",
    )
