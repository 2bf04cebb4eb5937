"""Read raw messages from MCAP files and ROS 2 bags.

The files of a ROS 2 bag are MCAP or sqlite3 files. The messages are not decoded here.
"""

from __future__ import annotations

import io
import os
import re
import sqlite3
import struct
import tempfile
from collections.abc import Callable, Collection, Iterator
from itertools import compress
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from pretouch._core.errors import InvalidInputError, MissingExtraError, require

from .messages import Contents, Topic, split_name

EXTRA: Final = "ros"
"""The extra of pretouch that installs the libraries for bags."""

_ENDINGS: Final = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
_MCAP: Final = b"\x89MCAP0\r\n"
_ZSTD: Final = b"\x28\xb5\x2f\xfd"
_SQLITE: Final = b"SQLite format 3\0"
_ROS1: Final = b"#ROSBAG V"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _STATISTICS = 2, 3, 4, 5, 6, 11  # opcodes of MCAP records
_RECORD: Final = struct.Struct("<BQ")
_CHUNK_HEAD: Final = struct.Struct(
    "<QQQII"
)  # first and last time, size, checksum, length of the name of the compression
_MESSAGE_HEAD: Final = struct.Struct("<xQH4xQ8x")  # opcode, length, channel, sequence, receive time, publish time
_LEAST: Final = _MESSAGE_HEAD.size - _RECORD.size  # length of a message without content
_YAML_COUNT: Final = re.compile(r"^  message_count:\s*(\d+)", re.MULTILINE)  # of all topics
_YAML_FILES: Final = re.compile(r"relative_file_paths:\s*\n((?:\s*-\s*.+\n?)*)")


def read_contents(path: Path, wanted: Collection[str]) -> Contents:
    """Read the wanted topics of a recording.

    The messages of all topics are counted.

    Args:
        path: an MCAP file, a sqlite3 file of a ROS 2 bag, or the folder of a bag.
        wanted: topics, each with or without a field.

    Returns:
        The messages.

    Raises:
        InvalidInputError: the path does not exist, cannot be read, or is not a recording.
    """
    contents = Contents()
    try:
        files = _files_of(path, contents) if path.is_dir() else [path]
        for file in files:
            _read_file(file, wanted, contents)
        if path.is_dir():
            _compare_with_metadata(path, contents)
    except FileNotFoundError:
        raise InvalidInputError(f"{path}: this file or folder does not exist") from None
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror or error})") from None
    return contents


def _files_of(folder: Path, contents: Contents) -> list[Path]:
    """Return the files of a ROS 2 bag in recording order."""
    present = sorted((f for f in folder.iterdir() if f.name.endswith(_ENDINGS)), key=_natural)
    if not present:
        raise InvalidInputError(
            f"{folder}: this folder contains no recording; expected a file whose name ends with .mcap or .db3"
        )
    metadata = folder / "metadata.yaml"
    if not metadata.exists():
        contents.notes.append(
            "The bag has no file metadata.yaml: pretouch read the files of the bag in the order of their names (number "
            f"of files: {len(present)})."
        )
        return present
    listed = _YAML_FILES.search(metadata.read_text(encoding="utf-8", errors="replace"))
    names = [] if listed is None else [line.strip(" -\"'\r").rsplit("/", 1)[-1] for line in listed[1].splitlines()]
    files = [folder / name for name in names if name and (folder / name).exists()]
    if missing := [name for name in names if name and not (folder / name).exists()]:
        contents.notes.append(f"Files of the bag are missing: {', '.join(missing)}.")
    return files or present


def _compare_with_metadata(folder: Path, contents: Contents) -> None:
    """Add a remark if a bag has fewer messages than its metadata say, and no other remark says so."""
    metadata = folder / "metadata.yaml"
    if contents.notes or not metadata.exists():
        return
    listed = _YAML_COUNT.search(metadata.read_text(encoding="utf-8", errors="replace"))
    count = sum(contents.counts.values())
    if listed is not None and count < int(listed[1]):
        contents.notes.append(_describe_loss(folder.name, count, int(listed[1])))


def _natural(path: Path) -> list[tuple[int, str]]:
    """Return a sort key that places bag_10 after bag_9."""
    return [(int(part) if part.isdigit() else -1, part) for part in re.split(r"(\d+)", path.name)]


def _read_file(path: Path, wanted: Collection[str], contents: Contents) -> None:
    with path.open("rb") as stream:
        start = stream.read(16)
        stream.seek(0)
        if start.startswith(_ZSTD):
            _read_compressed(path, stream, wanted, contents)
        elif start.startswith(_MCAP):
            _read_mcap(path.name, stream, wanted, contents)
        elif start.startswith(_SQLITE):
            _read_sqlite(path, path.name, wanted, contents)
        elif not start:
            raise InvalidInputError(f"{path}: this file is empty; was the recorder stopped before it wrote anything?")
        elif start.startswith(_ROS1):
            raise InvalidInputError(
                f"{path}: found a ROS 1 bag, expected a ROS 2 bag; convert it with: rosbags-convert "
                f"--src {path.name} --dst {path.stem}"
            )
        else:
            raise InvalidInputError(
                f"{path}: found another file format, expected an MCAP file, a ROS 2 bag (sqlite3) or a CSV file"
            )


def _read_compressed(path: Path, stream: Any, wanted: Collection[str], contents: Contents) -> None:
    """Decompress a recording file, and read its messages."""
    zstandard = require("zstandard", extra=EXTRA)
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder, path.stem)
        try:
            with plain.open("wb") as out:
                zstandard.ZstdDecompressor().copy_stream(stream, out)
        except zstandard.ZstdError:
            contents.notes.append(f"The file {path.name} is truncated or damaged; pretouch read only its beginning.")
        _read_file(plain, wanted, contents)


def _read_mcap(name: str, stream: Any, wanted: Collection[str], contents: Contents) -> None:
    """Read the messages of an MCAP file. Of a truncated or damaged file, the messages that are whole are kept."""
    records = require("mcap.records", extra=EXTRA)
    state, before = _Channels(wanted, contents), sum(contents.counts.values())
    size = stream.seek(0, os.SEEK_END)
    place, complete, damaged, expected = len(_MCAP), False, False, 0
    while place + _RECORD.size <= size and not complete:
        stream.seek(place)
        opcode, length = _RECORD.unpack(stream.read(_RECORD.size))
        place += _RECORD.size + length
        try:
            if place > size:
                if opcode == _CHUNK:
                    _read_records(_start_of_chunk(stream.read()), state)
                break
            if opcode == _CHUNK:
                _read_chunk(stream.read(length), state)
            elif opcode == _STATISTICS:
                expected = int(records.Statistics.read(_fields(stream.read(length))).message_count)
            elif opcode in {_SCHEMA, _CHANNEL, _MESSAGE}:
                _read_records(_RECORD.pack(opcode, length) + stream.read(length), state)
        except Exception as error:  # each library for compression has errors of its own
            if isinstance(error, MemoryError | InvalidInputError | MissingExtraError):
                raise
            damaged = True  # the records after it may be whole
        complete = opcode == _FOOTER  # indexes are not read
    count = sum(contents.counts.values()) - before
    if complete and count < expected:
        contents.notes.append(_describe_loss(name, count, expected))
    elif not complete or damaged:
        contents.notes.append(f"The file {name} is truncated or damaged; pretouch found {count:,} messages in it.")


def _read_chunk(content: bytes, state: _Channels) -> None:
    """Read a chunk of an MCAP file, if its checksum is right."""
    chunk = require("mcap.records", extra=EXTRA).Chunk.read(_fields(content))
    reader = require("mcap.stream_reader", extra=EXTRA)
    data, _ = reader.get_chunk_data_stream(chunk, validate_crc=True)
    _read_records(data.read(chunk.uncompressed_size), state)


def _start_of_chunk(content: bytes) -> bytes:
    """Return the records of a chunk whose end is missing; nothing if the chunk is compressed."""
    _, _, _, _, compression = _CHUNK_HEAD.unpack_from(content)
    return b"" if compression else content[_CHUNK_HEAD.size + 8 :]  # the size of the records precedes them


def _describe_loss(name: str, count: int, expected: int) -> str:
    """Say that a recording has fewer messages than it should have."""
    return (
        f"The recording {name} is damaged: it should have {expected:,} messages, but pretouch found only {count:,} "
        "messages."
    )


def _fields(data: bytes) -> Any:
    """Wrap the bytes of an MCAP record in a data stream."""
    return require("mcap.data_stream", extra=EXTRA).ReadDataStream(io.BytesIO(data))


class _Channels:
    """All channels and the wanted messages of one MCAP file."""

    def __init__(self, wanted: Collection[str], contents: Contents) -> None:
        self.wanted, self.contents = wanted, contents
        self.schemas: dict[int, Any] = {}
        self.topics: dict[int, Topic] = {}
        self.kept: dict[int, tuple[Callable[[int], None], Callable[[bytes], None]]] = {}

    def add(self, channel: Any) -> None:
        """Add an MCAP channel; ignore repeated records of the same channel."""
        if channel.id in self.topics:
            return
        schema = self.schemas.get(channel.schema_id)
        parts = ("", "", "") if schema is None else (schema.name, schema.data.decode(errors="replace"), schema.encoding)
        topic = Topic(channel.topic, parts[0], channel.message_encoding, parts[1], parts[2])
        self.topics[channel.id] = topic
        self.contents.counts.setdefault(topic, 0)
        if is_wanted(topic.name, self.wanted):
            messages = self.contents.messages_of(topic)
            self.kept[channel.id] = messages.received.append, messages.data.append


def _read_records(data: bytes, state: _Channels) -> None:
    """Read the schemas, channels and messages of an MCAP chunk.

    This loop runs once per message, so it reads only what is needed.
    """
    records = require("mcap.records", extra=EXTRA)
    counts: dict[int, int] = {}
    place, end, unpack = 0, len(data), _MESSAGE_HEAD.unpack_from
    while place + _RECORD.size <= end:
        if data[place] == _MESSAGE and place + _MESSAGE_HEAD.size <= end:
            length, channel, received = unpack(data, place)
            following = place + _RECORD.size + length
            if following > end:  # the end of the chunk is missing
                break
            if length >= _LEAST:  # otherwise, the message is damaged
                counts[channel] = counts.get(channel, 0) + 1
                if channel in state.kept:
                    add_time, add_data = state.kept[channel]
                    add_time(received)
                    add_data(data[place + _MESSAGE_HEAD.size : following])
            place = following
            continue
        opcode, length = _RECORD.unpack_from(data, place)
        following = place + _RECORD.size + length
        if opcode == _SCHEMA:
            schema = records.Schema.read(_fields(data[place + _RECORD.size : following]))
            state.schemas[schema.id] = schema
        elif opcode == _CHANNEL:
            state.add(records.Channel.read(_fields(data[place + _RECORD.size : following])))
        place = following
    for channel, number in counts.items():
        if channel in state.topics:  # otherwise, the message is damaged
            state.contents.counts[state.topics[channel]] += number


def is_wanted(name: str, wanted: Collection[str]) -> bool:
    """Return True if a topic is wanted.

    Args:
        name: the topic.
        wanted: topics, each with or without a field.
    """
    return any(split_name(text, (name,)) is not None for text in wanted)


def _read_sqlite(path: Path, name: str, wanted: Collection[str], contents: Contents) -> None:
    """Read a sqlite3 file of a ROS 2 bag."""
    journal = path.with_name(f"{path.name}-wal")
    fixed = "&immutable=1" if not journal.exists() or not journal.stat().st_size else ""
    connection = sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro{fixed}", uri=True)
    connection.text_factory = lambda data: data.decode(errors="replace")  # a damaged name is no reason to stop
    try:
        _read_database(connection, wanted, contents)
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:  # also of its own error message
        if not contents.counts:
            raise InvalidInputError(f"{name}: this database is not a ROS 2 bag, or it is damaged ({error})") from None
        contents.notes.append(
            f"The file {name} is truncated or damaged ({error}); pretouch read only the messages before the damage."
        )
    finally:
        connection.close()


def _read_database(connection: sqlite3.Connection, wanted: Collection[str], contents: Contents) -> None:
    definitions: dict[str, tuple[str, str]] = {}
    if connection.execute("SELECT name FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
        rows = connection.execute("SELECT topic_type, encoded_message_definition, encoding FROM message_definitions")
        definitions = {kind: (text, encoding) for kind, text, encoding in rows}
    columns = "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
    topics = {i: Topic(n, k, f, *definitions.get(k, ("", ""))) for i, n, k, f in connection.execute(columns)}
    for topic in topics.values():
        contents.counts.setdefault(topic, 0)
    counted = connection.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id").fetchall()
    for i, topic in topics.items():
        count = dict(counted).get(i, 0)
        contents.counts[topic] += count
        if not is_wanted(topic.name, wanted):
            continue
        kept = contents.messages_of(topic)
        pairs: list[tuple[Any, Any]] = []
        try:
            pairs.extend(_rows(connection, i))
        finally:  # of a damaged database, the rows before the damage
            usable = [isinstance(received, int) and isinstance(data, bytes) for received, data in pairs]
            whole = pairs if all(usable) else list(compress(pairs, usable))
            kept.received += [received for received, _ in whole]
            kept.data += [data for _, data in whole]
            kept.damaged += count - len(whole)


def _rows(connection: sqlite3.Connection, topic: int) -> Iterator[tuple[Any, Any]]:
    """Return the receive time and content of each recorded message."""
    return iter(connection.execute("SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY id", (topic,)))
