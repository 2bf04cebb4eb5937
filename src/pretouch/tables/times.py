"""Choose the columns of a table that have the times of its rows, and read them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.errors import CalibrationDataError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.units import format_quantity, parse_unit

from .cells import TextTable, is_number, join_first, quoted
from .clock_texts import has_dates, stamps_of_clock
from .labels import FIRST
from .line_prefixes import TIME_OF_LINE
from .names import is_named, split_title
from .time_steps import are_intervals, continued, far_stamps, is_coarse, readings_per_stamp, without_settings
from .time_units import are_days, are_millionths_of_days, likely_unit, means_days, stamps_in_unit, stamps_of_days
from .unit_words import TIME, dimension, unit_in_words

_NANOSECONDS: Final = re.compile(r"(.*?)(?:nanosec|nanosecs|nsec|nsecs|nanoseconds|nanos)", re.IGNORECASE)
_SECONDS: Final = re.compile(r"(.*?)(?:sec|secs|seconds|s)", re.IGNORECASE)
_MOSTLY: Final = 0.9  # share of the steps in one direction
_SLOW: Final = 2.0
_QUICK: Final = 2e-5
"""Time steps [s] beyond which the unit is doubted."""
_SECOND: Final = 10**9  # ns
_UNSTEADY: Final = 0.2  # mean difference of steps from their median, relative to it: readings came in batches
_COARSEST: Final = 2e-3  # s between readings that milliseconds tell apart
_SHOWN: Final = 5
_RATE: Final = (
    '. If the file has no times, but the readings have a constant rate, state it, such as with --rate "100 Hz"'
)


class Times(NamedTuple):
    """Times of the rows of a table.

    `stamps` are in nanoseconds; `usable` tells in which rows there is a time. `columns` are the indices of the columns
    with times. `read` says which column was read and in which unit, `notes` what was doubted.
    """

    stamps: IntArray
    usable: np.ndarray
    columns: tuple[int, ...]
    read: str
    notes: tuple[str, ...]


def read_times(table: TextTable) -> Times:
    """Read the times of a table.

    The time column has a usual name, such as `time`, or a unit of time. Its unit is that of the header; without one,
    times since 1970 are told by their size, and other times by the only unit that gives a plausible rate.

    Returns:
        The times.

    Raises:
        CalibrationDataError: there is no time column, its unit is unknown, it has no valid time, or no times but
            intervals.
    """
    candidates = _candidates(table)
    if is_without_header(table):
        raise CalibrationDataError(
            f"{table.place}: the first row has numbers, but a header is expected; {_header_to_write(table)}{_RATE}",
            problem=f"{table.place}: the first row contains numbers, but a header is expected",
        )
    if not candidates:
        titles = ", ".join(quoted(title) for title in table.header)
        raise CalibrationDataError(
            f"{table.place}: found no time column among the columns {titles}; rename the column with the times to "
            '"time [UNIT]", with the unit of the times in place of UNIT, such as s, ms or us; if the times are dates '
            f'and times of day, rename it to "time"{_RATE}'
        )
    pair = _pair(table)
    if pair is not None:
        whole, part = (table.numbers(i) for i in pair)
        usable = np.isfinite(whole) & np.isfinite(part)
        stamps = np.where(usable, whole, 0).astype(np.int64) * 10**9 + np.where(usable, part, 0).astype(np.int64)
        titles = " and ".join(table.title(i) for i in pair)
        return _checked(table, Times(stamps, usable, tuple(candidates), "", ()), f"columns {titles}", "s and ns")
    times, where, unit = _best(table, candidates)
    if _is_coarse(times):
        finer = _with_fraction(table, times, candidates) or _by_unit(table, candidates)
        times, where, unit = finer or (times, where, unit)
    elif (spread := _spread(times)) > _UNSTEADY:
        steadier = _by_unit(table, candidates)
        if steadier is not None and _spread(steadier[0]) < spread / 2:
            note = f"The times are from {steadier[1]}, because they are steadier than those of {where}."
            times, where, unit = steadier[0]._replace(notes=(*steadier[0].notes, note)), *steadier[1:]
    return _checked(table, times, where, unit)


def times_at_rate(table: TextTable, rate: float) -> Times:
    """Return the times of readings that were taken at a constant rate, which the user states.

    A column that counts the readings shows which of them are missing.

    Args:
        table: the table, without times that can be read.
        rate: readings per second [Hz].

    Raises:
        CalibrationDataError: the table has times, so that the rate is known.
    """
    try:
        found = read_times(table)
        refuse_coarse(table, found, np.flatnonzero(found.usable))
    except CalibrationDataError:
        found = None
    if found is not None:
        raise CalibrationDataError(
            f"{table.place}: the rate is given, but the table has times ({found.read}); omit --rate",
            problem=f"{table.place}: the rate is given, but the table has times",
        )
    counter = next((i for i in range(len(table.header)) if _counts_readings(table, i)), None)
    index = np.arange(len(table.lines)) if counter is None else table.numbers(counter).astype(np.int64)
    stamps = np.round((index - index[0]) * (_SECOND / rate)).astype(np.int64)
    where = "the number of the row" if counter is None else f"the number in the column {table.title(counter)}"
    columns = tuple(_candidates(table)) if counter is None else (*_candidates(table), counter)
    read = f"{where} at the stated rate: {format_quantity(rate, 'Hz', 3)}"
    return Times(stamps, np.ones(len(stamps), dtype=bool), columns, read, ())


def _counts_readings(table: TextTable, index: int) -> bool:
    """Return True if a column counts the readings, with gaps where some are missing."""
    numbers = table.numbers(index)
    steps = np.diff(numbers)
    is_count = is_named(table.header[index], "count") and bool(np.isfinite(numbers).all() and len(steps))
    return is_count and bool(np.all(steps % 1 == 0) and np.all(steps >= 1) and np.median(steps) == 1)


def is_without_header(table: TextTable) -> bool:
    """Return True if the first row of a table is no header, but has numbers."""
    return all(map(is_number, table.header))


def _header_to_write(table: TextTable) -> str:
    """Return what to write above a table without a header: a name for each column, and a unit for the times."""
    columns = [table.numbers(i) for i in range(len(table.header))]
    rising = [i for i, numbers in enumerate(columns) if _is_counter(numbers)]
    titles = ["time [UNIT]" if rising[:1] == [i] else f"column {i + 1}" for i in range(len(columns))]
    if len(columns) == 1:
        return "it has one column of numbers, and no times"
    line = f'write the line "{table.delimiter.join(titles)}" above it'
    if not rising:
        return f"{line}, with time [UNIT] in place of the column with the times, and their unit, such as s, ms or us"
    return f"{line}, with the unit of the times in place of UNIT, such as s, ms or us"


def _best(table: TextTable, candidates: Sequence[int]) -> tuple[Times, str, str]:
    """Read the best of several columns with times; also return its name and its unit in words."""
    read = [_read(table, i) for i in candidates]

    def rank(k: int) -> tuple[bool, bool, bool, int]:
        return _is_rising(read[k][0]), not _is_coarse(read[k][0]), table.header[candidates[k]] != TIME_OF_LINE, -k

    best = max(range(len(read)), key=rank)
    times, unit = read[best]
    return times._replace(columns=tuple(candidates)), f"column {table.title(candidates[best])}", unit


def _is_coarse(times: Times) -> bool:
    stamps = times.stamps[times.usable]
    return len(stamps) > 1 and is_coarse(stamps)


def _spread(times: Times) -> float:
    """Return how much the steps of times differ from their median, relative to it."""
    steps = np.diff(times.stamps[times.usable])
    middle = float(np.median(steps)) if len(steps) else 0.0
    return float(np.mean(np.abs(steps - middle))) / middle if middle > 0 else 0.0


def _with_fraction(table: TextTable, times: Times, candidates: Sequence[int]) -> tuple[Times, str, str] | None:
    """Add a column with the fraction of the second, such as `ms` next to `Time`, to times in whole seconds."""
    if np.any(times.stamps[times.usable] % _SECOND):
        return None
    for i, title in enumerate(table.header):
        unit = split_title(title)[1]
        size = round(parse_unit(str(unit_in_words(unit))).factor * 1e9) if unit and dimension(unit) == TIME else 0
        numbers = table.numbers(i) if 0 < size < _SECOND else np.empty(0)
        usable = times.usable & np.isfinite(numbers) if len(numbers) else times.usable[:0]
        part = numbers[usable]
        if not len(part) or np.any((part < 0) | (part * size >= _SECOND) | (part != np.floor(part))):
            continue
        stamps = times.stamps.copy()
        stamps[usable] += part.astype(np.int64) * size
        finer = times._replace(stamps=stamps, usable=usable, columns=(*candidates, i))
        restarts = bool(np.any(np.diff(part) < 0)) or not np.any(np.diff(times.stamps[usable]))
        if restarts and _is_rising(finer) and not _is_coarse(finer):
            whole = next(k for k in candidates if k != i)
            return (
                finer,
                f"columns {table.title(whole)} and {table.title(i)}",
                f"seconds and {unit_in_words(unit or '')}",
            )
    return None


def _by_unit(table: TextTable, candidates: Sequence[int]) -> tuple[Times, str, str] | None:
    """Read another column with a unit of time, if it has finer times."""
    others = [i for i, title in enumerate(table.header) if dimension(split_title(title)[1]) == TIME]
    others = [i for i in others if i not in candidates and np.isfinite(table.numbers(i)).any()]
    if not others:
        return None
    found = _best(table, others)
    is_finer = _is_rising(found[0]) and not _is_coarse(found[0])
    return (found[0]._replace(columns=(*candidates, *others)), *found[1:]) if is_finer else None


def refuse_coarse(table: TextTable, times: Times, kept: IntArray) -> None:
    """Raise an error if several readings have the same time.

    Args:
        table: the table.
        times: its times.
        kept: the rows with readings.

    Raises:
        CalibrationDataError: most times belong to several readings.
    """
    if not len(kept) or not is_coarse(times.stamps[kept]):
        return
    stamps = np.unique(times.stamps[kept])
    if len(stamps) < 2:
        return
    step = float(np.median(np.diff(stamps))) / 1e9
    each = readings_per_stamp(times.stamps[kept])
    unit = "milliseconds" if step / each >= _COARSEST else "microseconds"
    raise CalibrationDataError(
        f"{table.place}: the times have steps of {format_quantity(step, 's', 3)}, with {each:.0f} readings each, so "
        f"the time of each reading and the rate of the sensor are unknown; log the time of each reading in {unit}, "
        'or state a rate that you know to be constant, such as with --rate "100 Hz"'
    )


def _candidates(table: TextTable) -> list[int]:
    """Return the columns with times: those with such a name, else those with a unit of time, else those with dates."""
    named = [i for i, title in enumerate(table.header) if is_named(title, "time") or _of_stamp(title)]
    with_unit = [i for i, title in enumerate(table.header) if dimension(split_title(title)[1]) == TIME]
    dates = [i for i, cells in enumerate(table.columns) if has_dates(cells)]
    first = [0] if table.header[0] == FIRST and len(table.header) > 1 and _is_counter(table.numbers(0)) else []
    return named or with_unit or dates or first  # a number in front of the labels of a line is its time, if it rises


def _is_counter(numbers: FloatArray) -> bool:
    return len(numbers) > 2 and bool(np.all(np.diff(numbers) > 0))


def in_order(table: TextTable) -> tuple[TextTable, tuple[str, ...]]:
    """Turn a table whose newest row is the first.

    Args:
        table: the table.

    Returns:
        The table with its oldest row first, and a remark if it was turned.
    """
    if all(map(is_number, table.header)) or not any(_is_falling(table, i) for i in _candidates(table)):
        return table, ()
    turned = replace(
        table,
        columns=tuple(column[::-1] for column in table.columns),
        lines=table.lines[::-1],
        floats=tuple(None if floats is None else floats[::-1] for floats in table.floats),
    )
    return turned, ("The newest row was the first: the rows were sorted by their times.",)


def _is_falling(table: TextTable, index: int) -> bool:
    """Return True if the times of a column run backwards."""
    numbers = table.numbers(index)
    if not np.isfinite(numbers).any():
        stamps, usable = stamps_of_clock(table.columns[index])
        numbers = np.where(usable, stamps, np.nan)
    numbers = numbers[np.isfinite(numbers)]
    steps = np.diff(numbers)
    falling, rising = (int(np.count_nonzero(side)) for side in (steps < 0, steps > 0))  # past midnight, one step rises
    return falling > 1 and falling > _MOSTLY * (falling + rising)


def _of_stamp(title: str) -> bool:
    return bool(re.fullmatch(r".*stamp[./ _](?:sec|secs|nsec|nsecs|nanosec)", title, re.IGNORECASE))


def _pair(table: TextTable) -> tuple[int, int] | None:
    """Return the columns of seconds and nanoseconds of one stamp, or None."""
    for i, title in enumerate(table.header):
        match = _NANOSECONDS.fullmatch(title)
        if match is None:
            continue
        for k, other in enumerate(table.header):
            seconds = _SECONDS.fullmatch(other)
            if k != i and seconds is not None and seconds[1] == match[1]:
                return k, i
    return None


def _read(table: TextTable, index: int) -> tuple[Times, str]:
    """Return the times of a column, and their unit in words."""
    title, cells = table.header[index], table.columns[index]
    numbers = table.numbers(index)
    if np.isfinite(numbers).sum() < np.count_nonzero([bool(cell) for cell in cells[:1000]]) / 2:
        return Times(*stamps_of_clock(cells), (), "", ()), "hours, minutes and seconds"
    unit = split_title(title)[1]
    days = unit is not None and means_days(unit)
    if unit is not None and dimension(unit) != TIME and not days:
        raise CalibrationDataError(
            f"{table.place}: the time column {quoted(title)} has the unit {unit!r}, which is no unit of time; "
            "write the unit of the times into its header, such as time [ms]"
        )
    if days or are_days(numbers):
        if not days and unit is not None:
            raise CalibrationDataError(
                f"{table.place}: the times in the column {quoted(title)} look like the days of a spreadsheet, not like "
                f'times in {unit}; rename the column to "{split_title(title)[0]} [d]"'
            )
        return Times(*stamps_of_days(numbers), (), "", ()), "days"
    if unit is not None and are_millionths_of_days(numbers, unit):
        return Times(*stamps_of_days(numbers / 1e6), (), "", ()), "millionths of days, as some PLC programs write"
    counted, count = continued(numbers)
    unit = unit or likely_unit(table, title, counted)
    times = Times(*stamps_in_unit(cells if count is None else (), counted, unit), (), "", ())
    if count is not None:
        times = times._replace(
            notes=(f"The counter of the times restarted after {count:,.0f} {unit}: pretouch continued the times.",)
        )
    return times, unit


def _is_rising(times: Times) -> bool:
    stamps = times.stamps[times.usable]
    return len(stamps) > 1 and bool(np.mean(np.diff(stamps) >= 0) > _MOSTLY) and stamps[-1] > stamps[0]


def _checked(table: TextTable, times: Times, where: str, unit: str) -> Times:
    """Add notes on the source, the unit and the rate of times."""
    stamps = times.stamps[times.usable]
    if not len(stamps):
        raise CalibrationDataError(f"{table.place}: no row has a valid time in {where}")
    if len(stamps) > 1 and (not np.ptp(stamps) or are_intervals(stamps)):
        middle = format_quantity(float(np.median(stamps)) / 1e9, "s")
        found = f"are all equal ({middle})" if not np.ptp(stamps) else f"do not rise, but scatter around {middle}"
        raise CalibrationDataError(
            f"{table.place}: the {len(stamps):,} times in {where} {found}, so they are no times of the readings; log "
            "the time of each reading. If they are the time between readings, write their running sum into a column "
            '"time [UNIT]", with their unit in place of UNIT'
        )
    notes = list(times.notes)
    far = np.flatnonzero(times.usable)[far_stamps(stamps)]
    if len(far):
        times.usable[far] = False
        lines = join_first([str(table.lines[i]) for i in far], _SHOWN)
        notes.append(f"Readings whose time is far from those before and after it, which are left out: line {lines}.")
        stamps = times.stamps[times.usable]
    continuous, settings = without_settings(stamps)
    if len(settings):
        rows = np.flatnonzero(times.usable)
        times.stamps[rows] = stamps = continuous
        lines = join_first([str(table.lines[rows[i]]) for i in settings], _SHOWN)
        notes.append(
            f"The clock was set by most of a year or more before line {lines}: the times before it were shifted, so "
            "that the step is as long as others."
        )
    missing = int((~times.usable).sum()) - len(far)
    steps = np.diff(stamps)
    steps = steps[steps > 0]
    if not len(steps):
        return times._replace(read=f"{where}, {unit}", notes=tuple(notes))
    step = float(np.median(steps)) / 1e9
    rate = format_quantity(1 / step, "Hz", 3)
    if not _QUICK <= step <= _SLOW:
        notes.append(
            f"A rate of {rate} is unusual for a sensor. Check the unit of the times, here {unit}. If it is "
            "another one, write it into the header, such as time [ms]."
        )
    if missing:
        notes.append(f"Rows without a time, which are not read: {missing:,}.")
    return times._replace(read=f"{where}, {unit}: {rate}", notes=tuple(notes))
