"""Read files in which a distance stands above or in front of its readings, such as `5 mm: 812 815 811`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from pretouch._core.errors import CalibrationDataError

from .cells import is_number, quoted
from .formed_lines import COLUMN, MOST, FormedLines
from .labels import labeled_cells
from .names import is_named, split_title
from .number_forms import WITHIN_LINE
from .unit_words import LENGTH, dimension, unit_in_words

_DISTANCE: Final = re.compile(
    rf"\s*(?:[-*•]\s+|\d{{1,3}}[.)]\s+)?(?:[^\W\d_][^\d:;,|>→]{{0,40}}?[\s=@(])?({WITHIN_LINE})\s*([^\s\d,;:=@|>→–—.-]+)"
    r"\s*(-+>|=+>|[:=@|;,→]|\.{2,}|[-–—](?=\s)|\s|$)\s*(.*)"
)
_READING: Final = re.compile(rf"({WITHIN_LINE})\s*([^\s\d,;:.+-][^\s\d,;]*)?(?:[\s;|]+|,\s*|$)")
_PACKED: Final = re.compile(r"[-+\d.,]*\d,\d[-+\d.,]*")
_HEADING: Final = re.compile(r"\s*(?:#+|={2,}|\*+|-{2,}|\[)\s*([^=*\[\]]+?)\s*(?:#+|={2,}|\*+|-{2,}|\])?\s*")
_LONGEST: Final = 4096  # characters of a line
_FEWEST: Final = 2  # distances
_WEAK: Final = frozenset({"", ",", ";"})  # separators that also stand between the cells of other tables


def may_have_blocks(texts: Sequence[str]) -> bool:
    """Return True if a line begins with a distance, or says a distance alone."""
    for text in texts:
        match = _match(text)
        if match is not None and dimension(match[2]) == LENGTH:
            return True
        cells = labeled_cells(text) if ":" in text or "=" in text else None
        if cells is not None and len(cells) == 1 and is_named(next(iter(cells)), "distance"):
            return True
    return False


def title_cells(text: str) -> dict[str, str] | None:
    """Return the distance of a line that only states it, such as `--- 5 mm ---` or `at 5 mm:`, with its label.

    Examples:
        >>> title_cells("--- 5 mm ---"), title_cells("at 5 mm:"), title_cells("5 mm: 812")
        ({'distance [mm]': '5'}, {'distance [mm]': '5'}, None)
    """
    match = _match(text)
    if match is None or match[4].strip() or dimension(match[2]) != LENGTH:
        return None
    return {f"distance [{unit_in_words(match[2])}]": match[1]}


def of_blocks(file: str, numbers: Sequence[int], texts: Sequence[str]) -> FormedLines | None:
    """Return the rows of a file in which a distance stands above or in front of its readings, or None.

    Args:
        file: name of the file, for messages.
        numbers: the numbers of the lines.
        texts: the lines.

    Raises:
        CalibrationDataError: a comma may be a decimal sign or separate two readings.
    """
    rows, lines, units, distances, others = [], [], set(), set(), 0
    output_units: set[str] = set()
    packed: tuple[int, str] | None = None
    place, is_weak = None, False
    for number, text in zip(numbers, texts, strict=True):
        match = _match(text)
        found = _readings(match[4], match[3].strip()) if match and dimension(match[2]) == LENGTH else None
        cells = labeled_cells(text) if found is None else None
        readings: list[str] = []
        if match is not None and found is not None:
            is_weak |= match[3].strip() in _WEAK
            place, (readings, unit) = match[1], found
            units.add(str(unit_in_words(match[2])))
            output_units |= {unit} if readings else set()
            text_of_readings = match[4]
        elif cells is not None and len(cells) == 1 and is_named(next(iter(cells)), "distance"):
            ((label, place),) = cells.items()
            text_of_readings = ""
            if place.casefold() not in {"inf", "none", "no object"}:
                units.add(split_title(label)[1] or "")
        elif all(map(is_number, text.split())) and place is not None:
            readings, text_of_readings = text.split(), text
            output_units.add("")
        else:
            others += 1
            if others > (1 - MOST) * len(texts):
                return None
            continue
        if packed is None and _PACKED.search(text_of_readings) and not re.search(r"\d\.\d", text_of_readings):
            packed = (number, text_of_readings)
        distances.add(place)
        rows += [f"{place}{COLUMN}{reading}" for reading in readings]
        lines += [number] * len(readings)
    if is_weak and others:
        return None  # such as a header, which the cells below it belong to
    if len(distances) < _FEWEST or len(units) != 1 or len(output_units) != 1 or len(rows) < len(distances):
        return None
    if packed is not None and not any("," in place for place in distances):
        line, shown = packed
        raise CalibrationDataError(
            f"{file}, line {line}: the commas in {quoted(shown)} may be decimal signs or separate readings. "
            "If they are decimal signs, write points instead; if they separate readings, write a blank after each one",
            problem=f"{file}, line {line}: found commas that can be read in two ways",
        )
    unit, output_unit = units.pop(), output_units.pop()
    header = f"distance [{unit}]" if unit else "distance"
    output = f"output [{output_unit}]" if output_unit else "output"
    note = "Each distance belongs to the readings behind it and below it."
    return FormedLines([lines[0], *lines], [f"{header}{COLUMN}{output}", *rows], (note,))


def _match(text: str) -> re.Match[str] | None:
    """Return the parts of a line that begins with a distance, or of a heading that is one, such as `== 5 mm ==`."""
    if len(text) >= _LONGEST:
        return None
    heading = _HEADING.fullmatch(text)
    return _DISTANCE.fullmatch(heading[1] if heading else text)


def _readings(text: str, separator: str) -> tuple[list[str], str] | None:
    """Return the readings behind a distance and their unit, or None if the text has anything else."""
    readings, units, position = [], set(), 0
    while position < len(text):
        match = _READING.match(text, position)
        if match is None:
            return None
        unit = unit_in_words(match[2]) if match[2] else ""
        if unit is None or (separator in _WEAK and dimension(unit) == LENGTH):
            return None
        readings.append(match[1])
        units.add(unit)
        position = match.end()
    if len(units) > 1 or (separator in _WEAK and len(readings) > 1 and separator != ""):
        return None
    return readings, units.pop() if units else ""
