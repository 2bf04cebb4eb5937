"""Read times that are written as a date and a time of day, such as `2024-05-01 10:12:33.5` or `10:12:33 PM`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import Final

import numpy as np

from pretouch._core.numbers import IntArray

_CLOCK: Final = re.compile(
    r"(?:(\d{4})-(\d\d?)-(\d\d?)[T ]+|(\d{1,2}[./]\d{1,2}[./]\d{2,4})[T ,]+)?"
    r"(?:(\d{1,2}):)?(\d{1,2}):(\d{1,2}(?:[.,]\d+)?)\s*(AM|PM)?\s*(?:Z|UTC|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
_LOOKED_AT: Final = 200  # cells in which dates are looked for
_EPOCH: Final = date(1970, 1, 1).toordinal()
_SECOND: Final = 10**9
_DAY: Final = 86400 * _SECOND


def has_dates(cells: Sequence[str]) -> bool:
    """Return True if most cells are dates with a time of day."""
    matches = [_CLOCK.fullmatch(cell.strip()) for cell in cells[:_LOOKED_AT]]
    return 2 * sum(match is not None and bool(match[1] or match[4]) for match in matches) > len(cells)


def stamps_of_clock(cells: Sequence[str]) -> tuple[IntArray, np.ndarray]:
    """Return stamps [ns] from dates and times of day; a time of day before the one above it is of the next day."""
    stamps, usable = np.zeros(len(cells), dtype=np.int64), np.zeros(len(cells), dtype=bool)
    days, last, first = 0, -1, ""
    for i, cell in enumerate(cells):
        match = _CLOCK.fullmatch(cell.strip())
        if match is None:
            continue
        year, month, day, other, hours, minutes, seconds, half = match.groups()
        whole, _, fraction = seconds.replace(",", ".").partition(".")
        hour = int(hours or 0) % 12 + 12 * (half.upper() == "PM") if half else int(hours or 0)
        of_day = (3600 * hour + 60 * int(minutes) + int(whole)) * _SECOND + int(f"{fraction:0<9}"[:9])
        if year:
            try:
                days = date(int(year), int(month), int(day)).toordinal() - _EPOCH
            except ValueError:
                continue
        elif of_day < last - _DAY // 2 or (other and first and other != first and of_day < last):
            days += 1
        first, last = other or first, of_day
        stamps[i], usable[i] = days * _DAY + of_day, True
    return stamps, usable
