"""Read sensor readings from a ROS 2 bag, MCAP or CSV file.

The user chooses the topic or column, the clock and the unit.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError, UnitError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import parse_unit
from pretouch.tables.names import is_named, output_unit
from pretouch.tables.unit_words import unit_in_words

from .clocks import Transport, compare_clocks
from .columns import RecordedColumn, is_table, read_columns
from .containers import read_contents
from .decoding import Decoded, decode
from .messages import Contents, Messages, refuse_unknown, split_name
from .no_object import are_like_distances, has_codes_of_parts, idle_codes
from .recording import UNBOUNDED, Clock, Kind, Recording

_WITH_UNIT: Final = re.compile(r"(.*\S)\s+\[\s*([^\[\]=]*?)\s*\]")
_LENGTH: Final = parse_unit("m").exponents
_RANGE: Final = re.compile(r"sensor_msgs/(msg/)?(Range|LaserScan)")
_RANGE_FIELD: Final = re.compile(r"range|ranges\[\d+\]")
_LATEST: Final = 2**62 / 1e9  # s, in the year 2116


@check_arguments
def read_recording(
    path: str | os.PathLike[str], topic: str = "", *, clock: str | None = None, rate: float | None = None
) -> Recording:
    """Read one topic or CSV column of a recording.

    Args:
        path: folder or file of a ROS 2 bag (MCAP or sqlite3), an MCAP file with JSON messages, or a CSV file.
        topic: the topic, with a field if its messages have several numbers, such as "/joints.position[0]"; with a unit
            of length for distances, such as "/laser [mm]". Distances of sensor_msgs/Range and LaserScan need no unit.
            For a CSV file, the header of a column; if its rows are from several sensors, with the one to be read, such
            as "value[sensor=left]".
        clock: "header" for the stamps in the messages, or "receive" for the times at which they were recorded; None
            for the stamps if all messages have one, and if those of several topics are from one clock.
        rate: readings per second [Hz] of a table without times; None for recordings with times.

    Returns:
        The readings.
    """
    return read_recordings(path, (topic,), clock=clock, rate=rate)[0]


def read_recordings(
    path: str | os.PathLike[str], topics: tuple[str, ...], *, clock: str | None = None, rate: float | None = None
) -> tuple[Recording, ...]:
    """Read several topics of a recording with one clock.

    Args:
        path: see `read_recording`.
        topics: see `read_recording`.
        clock: see `read_recording`.
        rate: see `read_recording`.

    Returns:
        The readings of each topic.

    Raises:
        InvalidInputError: the recording cannot be read, has no such topic or no messages on it, or has no such clock.
    """
    if clock not in {None, "header", "receive"}:
        raise InvalidInputError(f"clock: found {clock!r}, expected 'header' or 'receive'")
    if rate is not None and not 0 < rate < np.inf:
        raise InvalidInputError(f"rate: found {rate:g} Hz, expected a positive number of readings per second")
    file, wanted = Path(path), [_split_unit(topic) for topic in topics]
    if is_table(file):
        if clock is not None:
            raise InvalidInputError(
                f"clock: the CSV file {file.name} has only one clock, its time column; omit the option for the clock"
            )
        return tuple(_from_table(file, name, unit, rate) for name, unit in wanted)
    if rate is not None:
        raise InvalidInputError(f"rate: the messages of {file.name} have times, which show their rate; omit --rate")
    if not all(name for name, _ in wanted):
        names = ", ".join(topic.name for topic in read_contents(file, ()).counts)
        raise InvalidInputError(f"{path}: choose a topic with --topic: {names or 'there is none'}")
    contents = read_contents(file, [name for name, _ in wanted])
    decoded = [decode_topic(contents, name, file.name) for name, _ in wanted]
    used, remarks = _choose_clock(clock, [name for name, _ in wanted], decoded)
    notes = (*contents.notes, *remarks)
    return tuple(
        _recording(file, used, unit, messages=messages, decoded=each, notes=notes)
        for (_, unit), (messages, each) in zip(wanted, decoded, strict=True)
    )


def _choose_clock(
    clock: str | None, names: list[str], decoded: list[tuple[Messages, Decoded]]
) -> tuple[Clock, tuple[str, ...]]:
    """Return the clock of a recording, with remarks.

    Header stamps of several topics are used only if they are from one clock.

    Raises:
        InvalidInputError: header stamps are wanted, but messages lack one.
    """
    stamped = all(each.stamps.all() for _, each in decoded)
    if clock == "header" and not stamped:
        name, each = next((n, e) for n, (_, e) in zip(names, decoded, strict=True) if not e.stamps.all())
        share = "some" if each.stamps.any() else "all"
        raise InvalidInputError(
            f"{name}: {share} messages of this topic lack a header stamp; use the receive times with --clock receive"
        )
    if clock == "receive":
        return "receive", ()
    if not stamped:
        mixed = [n for n, (_, e) in zip(names, decoded, strict=True) if e.stamps.any() and not e.stamps.all()]
        return "receive", tuple(
            f"Some messages of {name} lack a header stamp: the receive times are used for all topics." for name in mixed
        )
    first, *others = (Transport(m.topic.name, each.received, each.stamps) for m, each in decoded)
    different = [each for each in (compare_clocks(first, other) for other in others) if each.is_large]
    if clock == "header" or not different:
        return "header", ()
    return "receive", tuple(f"{each.words}. The receive times are used for all topics." for each in different)


def _split_unit(text: str) -> tuple[str, str | None]:
    match = _WITH_UNIT.fullmatch(text.strip())
    return (match[1], match[2]) if match else (text.strip(), None)


def decode_topic(contents: Contents, name: str, source: str) -> tuple[Messages, Decoded]:
    """Decode one number per message of a topic.

    Args:
        contents: the contents of the recording.
        name: the topic, with a field if needed.
        source: name of the recording.

    Returns:
        The messages and the decoded numbers.

    Raises:
        InvalidInputError: there is no such topic, or no message on it.
    """
    parts = split_name(name, [topic.name for topic in contents.counts])
    if parts is None:
        refuse_unknown(name, contents.counts, source)
    messages = contents.messages.get(parts[0])
    if messages is None or not messages.data:
        why = "; ".join(note.rstrip(".") for note in contents.notes)
        raise InvalidInputError(
            f"{source}: the topic {parts[0]} has no messages{f' ({why})' if why else ''}; was the sensor running "
            "while the bag was recorded?"
        )
    return messages, decode(messages, parts[1])


def _recording(
    file: Path, clock: Clock, unit: str | None, *, messages: Messages, decoded: Decoded, notes: tuple[str, ...]
) -> Recording:
    transport = (decoded.received - decoded.stamps) / 1e9 if decoded.stamps.all() else np.empty(0)
    message_type = messages.topic.message_type or messages.topic.encoding
    is_range = bool(_RANGE.fullmatch(message_type) and _RANGE_FIELD.fullmatch(decoded.field))
    read = _in_unit(decoded.values, "m" if unit is None and is_range else unit)
    values, remarks = read.values, read.notes
    if decoded.damaged:
        total = decoded.damaged + len(values)
        remarks = (
            *remarks,
            f"{decoded.damaged:,} of {total:,} messages of {messages.topic.name} are damaged, for example too short; "
            "they count as missing readings.",
        )
    return Recording(
        source=file.name,
        topic=f"{messages.topic.name}.{decoded.field}" if decoded.field else messages.topic.name,
        message_type=message_type,
        stamps=decoded.stamps if clock == "header" else decoded.received,
        values=values,
        kind=read.kind,
        unit=read.unit,
        clock=clock,
        transport=transport,
        bounds=decoded.bounds if is_range and unit in {None, "m"} else UNBOUNDED,
        notes=(*notes, *remarks),
    )


class _Read(NamedTuple):
    """Readings with their kind and unit."""

    kind: Kind
    values: FloatArray
    unit: str
    notes: tuple[str, ...] = ()


def _in_unit(values: FloatArray, unit: str | None) -> _Read:
    """Convert readings with a unit of length to distances [m]."""
    if not unit:
        return _Read("reading", values, "")
    known = unit_in_words(unit) or unit
    try:
        parsed = parse_unit(known)
    except UnitError as error:
        raise InvalidInputError(f"--topic: {error}") from None
    if parsed.exponents == _LENGTH:
        return _Read("distance", values * parsed.factor, known)
    base, factor = output_unit(unit)
    if factor != 1.0:
        return _Read("reading", values * factor, base, (f"The readings are converted from {unit} to {base}.",))
    return _Read("reading", values, base)


def _from_table(file: Path, name: str, unit: str | None, rate: float | None) -> Recording:
    column = read_columns(file, name, rate)
    stated = column.unit if unit is None else unit
    if not stated and is_named(column.name, "distance"):
        _refuse_unstated(file, name or column.name, column)
    read = _in_unit(column.values, stated)
    clock: Clock = "column" if rate is None else "rate"
    fields: dict[str, Any] = {"source": file.name, "topic": column.name, "message_type": "column", "clock": clock}
    fields |= {"kind": read.kind, "values": read.values, "unit": read.unit}
    fields["bounds"] = column.bounds if unit in {None, "m"} else UNBOUNDED
    return Recording(stamps=column.stamps, notes=(*column.notes, *read.notes), read=column.read, **fields)


def _refuse_unstated(file: Path, topic: str, column: RecordedColumn) -> None:
    """Raise an error if a column with the name of a distance has no unit, but values like those of distances."""
    in_millimeters = has_codes_of_parts(column.values * 1e-3)
    # a lowest value to which the readings jump means that there is no object, for distances more often than for outputs
    if not in_millimeters and not are_like_distances(column.values) and not idle_codes(column.values):
        return
    wanted = f"{topic} [{'mm' if in_millimeters else 'UNIT'}]"
    place = "" if in_millimeters else ", with their unit in place of UNIT, such as mm"
    raise InvalidInputError(
        f"{file}: the column {column.name!r} has no unit, but its values look like distances. Add the unit: "
        f"--topic '{wanted}'{place}. If they are outputs of the sensor, write --topic '{topic} [counts]'",
        value=topic,
        remedy=wanted,
    )
