"""Read messages that were written as YAML documents or as CSV without a header, as by `ros2 topic echo`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Final

from .cells import is_number
from .formed_lines import LOOKED_AT, MOST, FormedLines, share
from .labels import rows_of

_END: Final = "---"
_KEY: Final = re.compile(r"(\s*)([\w/.-]+):(?:\s+(.*?))?\s*")
_ITEM: Final = re.compile(r"(\s*)- (.*?)\s*")
_FEWEST: Final = 2  # documents
_STAMPED: Final = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id")
_RANGE: Final = ("radiation_type", "field_of_view", "min_range", "max_range", "range", "variance")
_KINDS: Final = frozenset({"0", "1"})  # of sensor_msgs/Range: ultrasound and infrared
_EARLIEST: Final = 10**9  # s since 1970 of a stamp: the year 2001
_SECOND: Final = 10**9


def of_documents(numbers: Sequence[int], texts: Sequence[str]) -> FormedLines | None:
    """Return YAML documents as rows, with the paths of their keys as header, or None if the file has none.

    Args:
        numbers: the numbers of the lines.
        texts: the lines.

    Returns:
        A row for each document. A last document that ends early is left out.
    """
    first = texts[:LOOKED_AT]
    marks = [text.strip() == _END for text in first]
    if (
        not any(marks)
        or share(m or _KEY.fullmatch(t) or _ITEM.fullmatch(t) for m, t in zip(marks, first, strict=True)) < MOST
    ):
        return None
    documents: list[dict[str, str]] = []
    starts: list[int] = []
    others, begin = [], 0
    for i in range(len(texts) + 1):
        if i < len(texts) and texts[i].strip() != _END:
            continue
        document = _document(numbers[begin:i], texts[begin:i])
        if document is None:
            return None
        cells, unread = document
        others += unread
        if cells:
            documents.append(cells)
            starts.append(numbers[begin])
        begin = i + 1
    if len(documents) < _FEWEST:
        return None
    usual = Counter(tuple(cells) for cells in documents[:-1]).most_common(1)[0][0]
    lost = (
        [f"Lines that are no keys, which are not read: {len(others):,}. The first is line {others[0]}."]
        if others
        else []
    )
    if texts[-1].strip() != _END and not set(usual) <= set(documents[-1]):
        lost.append(f"The last document, from line {starts[-1]} on, ends early, and is not read.")
        documents, starts = documents[:-1], starts[:-1]
    rows = rows_of(documents)
    note = "The file has YAML documents, and each of them is a row."
    return FormedLines([starts[0], *starts], rows, (note,), tuple(lost)) if rows else None


def _document(numbers: Sequence[int], texts: Sequence[str]) -> tuple[dict[str, str], list[int]] | None:
    """Return the values of one document by the paths of their keys, and the numbers of lines that are not read.

    The result is None if a key occurs twice.
    """
    cells: dict[str, str] = {}
    parents: list[tuple[int, str]] = []
    counts = Counter[str]()
    others = []
    for number, text in zip(numbers, texts, strict=True):
        item, key = _ITEM.fullmatch(text), _KEY.fullmatch(text)
        if item is not None:
            parents = [parent for parent in parents if parent[0] <= len(item[1])]
            path = ".".join(name for _, name in parents)
            cells[f"{path}[{counts[path]}]"] = item[2].strip("'\"")
            counts[path] += 1
        elif key is not None:
            indent, name, value = len(key[1]), key[2], key[3]
            parents = [parent for parent in parents if parent[0] < indent]
            path = ".".join([*(parent for _, parent in parents), name])
            if path in cells:
                return None
            if value:
                cells[path] = value.strip("'\"")
            else:
                parents.append((indent, name))
        else:
            others.append(number)
    return cells, others


def of_stamped_messages(numbers: Sequence[int], texts: list[str]) -> FormedLines | None:
    """Return the rows of stamped messages in CSV without a header, or None.

    Each row begins with seconds, nanoseconds and frame of the message header. Messages of the type sensor_msgs/Range
    have known columns behind them.

    Args:
        numbers: the numbers of the lines.
        texts: the lines.
    """
    cells = [text.split(",") for text in texts[:LOOKED_AT]]
    width = len(cells[0]) if cells else 0
    if width <= len(_STAMPED) or any(len(row) != width or not _is_stamped(row) for row in cells):
        return None
    rest = [row[len(_STAMPED) :] for row in cells]
    is_range = len(_RANGE) - 1 <= len(rest[0]) <= len(_RANGE) and {row[0] for row in rest} <= _KINDS
    names = _RANGE[: len(rest[0])] if is_range else [f"column {i + 1}" for i in range(len(_STAMPED), width)]
    kind = "sensor_msgs/Range" if is_range else "an unknown type"
    note = f"The rows are stamped messages of {kind}, so the first columns are the time in s and ns, and the frame."
    return FormedLines([numbers[0], *numbers], [",".join([*_STAMPED, *names]), *texts], (note,))


def _is_stamped(row: Sequence[str]) -> bool:
    seconds, nanoseconds, frame, *rest = row
    is_time = seconds.isdigit() and nanoseconds.isdigit()
    return (
        is_time
        and int(seconds) >= _EARLIEST
        and int(nanoseconds) < _SECOND
        and not is_number(frame)
        and any(map(is_number, rest))
    )
