"""Split what programs write in front of a line, such as `10:12:33.000 -> 27`, from the rest of the line."""

from __future__ import annotations

import re
from typing import Final

TIME_OF_LINE: Final = "time of the line"
"""Header of the column with the times that a serial monitor or a log writes in front of each line."""
_STAMP: Final = re.compile(
    r"\s*(\[?)((?:\d{4}-\d\d-\d\d[T ])?\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?|\d{1,3}:\d\d[.,]\d{1,9})"
    r"(\]?)\s*(->|>|)\s*(.*)",
    re.DOTALL,
)
_LEVEL: Final = r"(?:TRACE|DEBUG|INFO|NOTICE|WARN|WARNING|ERROR|FATAL|CRITICAL)"
_OF_NODE: Final = re.compile(rf"\s*\[\s*{_LEVEL}\s*\]\s*\[(\d+\.\d+)\]\s*(?:\[[^\[\]]*\])?\s*:?\s*(.*)", re.DOTALL)
_OF_TASK: Final = re.compile(r"\s*[EWIDV] \((\d+)\) [\w.-]+: (.*)", re.DOTALL)
_OF_LOGGER: Final = re.compile(
    rf"\s*(\d{{4}}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:[.,]\d{{1,9}})?)\s*[-|:]?\s*(?:[\w.]+\s*[-|:]\s*)?"
    rf"\[?{_LEVEL}\]?\s*[-|:]?\s*(?:[\w.]+\s*[-|]\s+)?(.*)",
    re.DOTALL,
)
_OF_TERMINAL: Final = re.compile(
    r"\s*\[\w{3} (\w{3}) +(\d{1,2}) (\d\d:\d\d:\d\d(?:[.,]\d+)?) (\d{4})\]\s*(.*)", re.DOTALL
)
_MONTHS: Final = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


def without_stamp(line: str) -> tuple[str, str]:
    """Split the time that a serial monitor or a log puts in front of a line from the rest.

    Returns:
        The time, empty if there is none, and the rest of the line.

    Examples:
        >>> without_stamp("10:12:33.000 -> 27")
        ('10:12:33.000', '27')
        >>> without_stamp("I (1023) sensor: adc=27")
        ('1.023', 'adc=27')
        >>> without_stamp("27")
        ('', '27')
    """
    if ":" not in line:
        return "", line
    logged = _of_log(line)
    if logged is not None:
        return logged
    match = _STAMP.fullmatch(line) if ":" in line[:24] else None
    if match is None or not (match[4] or (match[1] and match[3])):
        return "", line
    return match[2], match[5]


def _of_log(line: str) -> tuple[str, str] | None:
    """Split the time and the origin that a program for logs puts in front of a line, or return None."""
    start = line.lstrip()[:1]
    if start.isdigit():
        match = _OF_LOGGER.fullmatch(line)
    elif start and start in "EWIDV":
        match = _OF_TASK.fullmatch(line)
        return (f"{int(match[1]) / 1000:.3f}", match[2]) if match else None
    else:
        match = _OF_NODE.fullmatch(line) if start == "[" else None
    if match is not None:
        return match[1], match[2]
    match = _OF_TERMINAL.fullmatch(line) if start == "[" else None
    if match is None or match[1] not in _MONTHS:
        return None
    return f"{match[4]}-{_MONTHS.index(match[1]) + 1:02d}-{int(match[2]):02d} {match[3]}", match[5]
