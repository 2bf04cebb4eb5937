"""Convert times to nanoseconds, and determine the unit of times without one from their size and their steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pretouch._core.errors import CalibrationDataError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.units import format_quantity, parse_unit

from .cells import TextTable, quoted

_EPOCHS: Final = (("s", 1e9, 1e11), ("ms", 1e11, 1e14), ("us", 1e14, 1e17), ("ns", 1e17, 1e20))
"""Ranges of times since 1970, from 2001 on, in each unit."""
_PLAUSIBLE: Final = {"s": (5e-5, 2.0), "ms": (0.5, 2e3), "us": (50.0, 2e6), "ns": (5e4, 2e9)}
"""Time steps of sensors in each unit: from half a hertz to 2 kHz, or 20 kHz in seconds."""
_SECONDS_OF_DAY: Final = 86400
_DAY: Final = _SECONDS_OF_DAY * 10**9
_MILLISECOND: Final = 1e-3
_DAYS: Final = frozenset({"d", "day", "days", "tag", "tage"})
_STARTS: Final = (25569, 719529)
"""1970-01-01 in the days of spreadsheets and of MATLAB."""
_YEARS: Final = (-5000, 55000)
"""Days since 1970 in which recordings are made."""


def means_days(unit: str | None) -> bool:
    """Return True if a unit in a header means days."""
    return unit is not None and unit.casefold() in _DAYS


def are_days(numbers: FloatArray) -> bool:
    """Return True if numbers without a unit are the days of a spreadsheet or of MATLAB."""
    found = numbers[np.isfinite(numbers)]
    steps = np.diff(found)
    steps = steps[steps > 0]
    if not len(steps) or not _start_of_days(found):
        return False
    step = float(np.median(steps))
    low, high = _PLAUSIBLE["s"]
    return step < low <= step * _SECONDS_OF_DAY <= high


def are_millionths_of_days(numbers: FloatArray, unit: str) -> bool:
    """Return True if times in ms are days of a spreadsheet times a million, which exports of PLC programs call ms."""
    found = numbers[np.isfinite(numbers)] / 1e6
    steps = np.diff(found)
    steps = steps[steps > 0]
    if not len(steps) or parse_unit(unit).factor != _MILLISECOND or _start_of_days(found) != _STARTS[0]:
        return False
    step = float(np.median(steps))
    low, high = _PLAUSIBLE["s"]
    return (
        step * 1e6 < _PLAUSIBLE["ms"][0] and low <= step * _SECONDS_OF_DAY <= high and bool(np.min(found) > _STARTS[0])
    )


def _start_of_days(found: FloatArray) -> int:
    """Return 1970-01-01 in the days that numbers count; 0 if it is unknown."""
    low, high = (float(end) for end in (np.min(found, initial=np.inf), np.max(found, initial=-np.inf)))
    return next((start for start in _STARTS if start + _YEARS[0] <= low and high < start + _YEARS[1]), 0)


def stamps_of_days(numbers: FloatArray) -> tuple[IntArray, np.ndarray]:
    """Return stamps [ns] from days of a spreadsheet or of MATLAB, or from days after any other time."""
    start = _start_of_days(numbers[np.isfinite(numbers)])
    usable = np.isfinite(numbers) & (np.abs(numbers - start) < _YEARS[1])
    return np.round(np.where(usable, numbers - start, 0.0) * _DAY).astype(np.int64), usable


def stamps_in_unit(cells: Sequence[str], numbers: FloatArray, unit: str) -> tuple[IntArray, np.ndarray]:
    """Convert times to integers in nanoseconds; integers are converted exactly."""
    size = parse_unit(unit).factor * 1e9
    usable = np.isfinite(numbers) & (np.abs(numbers) < 2.0**62 / size)
    whole = np.where(usable, np.floor(numbers), 0)
    exact = whole.astype(np.int64)
    if cells and size >= 1 and np.any(np.abs(numbers[usable]) > 2.0**53):  # epochs in nanoseconds are no exact floats
        rows = zip(cells, whole, strict=True)
        exact = np.array([int(cell) if cell.isdigit() else int(number) for cell, number in rows])
    rest = np.where(usable, numbers - whole, 0)
    return exact * round(size) + np.round(rest * size).astype(np.int64), usable


def likely_unit(table: TextTable, title: str, numbers: FloatArray) -> str:
    """Return the unit of times that have none, from their size or their steps."""
    found = numbers[np.isfinite(numbers)]
    largest = float(np.max(np.abs(found), initial=0.0))
    epoch = next((unit for unit, low, high in _EPOCHS if low <= largest < high), None)
    steps = np.diff(found)
    steps = steps[steps > 0]
    if not len(steps):
        return epoch or "s"
    step, whole = float(np.median(steps)), bool(np.all(found == np.floor(found)))
    plausible = [unit for unit, (low, high) in _PLAUSIBLE.items() if low <= step <= high]
    if epoch is not None and (epoch in plausible or not plausible):
        return epoch  # a counter of microseconds also reaches such numbers, but with larger steps
    if not whole and "s" in plausible:
        return "s"
    if len(plausible) == 1:
        return plausible[0]
    rates = ", ".join(
        f"{format_quantity(1 / (step * parse_unit(u).factor), 'Hz')} if they are in {u}" for u in ("s", "ms", "us")
    )
    raise CalibrationDataError(
        f"{table.place}: the times in the column {quoted(title)} have no unit. The rate of the readings is {rates}. "
        f'Write the unit into the header: rename the column to "{title} [UNIT]", with s, ms or us in place of UNIT'
    )
