"""Parse sensor readings from lines of text.

Each line has one number, columns of a table, a JSON object or values with labels, such as `prox:5087,als:12`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from pretouch._core.errors import InvalidInputError, SourceError
from pretouch._core.units import parse_unit
from pretouch._core.values import Value
from pretouch.tables.cell_forms import plain_cell
from pretouch.tables.cells import float_of, is_no_object, is_number, unit_of
from pretouch.tables.dialect import BLANK, cells_of, delimiter_of_header, delimiter_of_row
from pretouch.tables.labels import labeled_cells
from pretouch.tables.line_prefixes import without_stamp
from pretouch.tables.names import is_length, split_title
from pretouch.tables.number_forms import from_fraction
from pretouch.tables.unit_words import unit_in_words

from .source import SourceReading, is_usable

_LONGEST: Final = 4096  # bytes without a line end, after which they are skipped
_SHOWN: Final = 40  # characters of a skipped line that a message shows
_NO_TEXT: Final = 0.2  # share of bytes that are no text, from which the baud rate is doubted
_FEW: Final = 16  # bytes from which this share is judged
_TEXT: Final = frozenset([9, 10, 13, *range(32, 127)])
_TWO_WHOLE: Final = re.compile(r"([-+]?\d+),(\d+)")
_MOST_UNKNOWN: Final = 4  # lines of pairs, until it must be known which line is the first one of a pair
_THOUSANDS: Final = re.compile(r"[-+]?[1-9]\d{0,2}(?:,\d{3})+")


@dataclass(frozen=True, slots=True, kw_only=True)
class LineFormat(Value):
    """Format of text lines with sensor readings.

    Args:
        column: number of the column from 1, its name in a header line, or a key of JSON objects; empty if each line
            has one number.
        distance_column: the same for the distance; empty if the lines have no distances.
        distance_unit: unit of these distances; empty for the unit that the lines state, or mm.
        decimal_mark: `.` or `,`, if the commas in the lines can be read in two ways; empty otherwise.
    """

    column: str = ""
    distance_column: str = ""
    distance_unit: str = ""
    decimal_mark: str = ""

    def __post_init__(self) -> None:
        if self.distance_unit and not is_length(self.distance_unit):
            raise InvalidInputError(
                f"distance unit: found {self.distance_unit!r}, expected a unit of length such as mm"
            )
        if self.decimal_mark not in {"", ".", ","}:
            raise InvalidInputError(f'decimal: found {self.decimal_mark!r}, expected "." or ","')


class _PairedLines:
    """Join two lines, of which one has the distance and the other the output.

    Args:
        name: the source, for messages.
        starts_inside: whether the first line may be the second one of a pair.
    """

    def __init__(self, name: str, *, starts_inside: bool) -> None:
        self._name, self._is_start_known = name, not starts_inside
        self._leader: bool | None = None  # whether a pair begins with the distance
        self._first: tuple[Mapping[str, str], bytes] | None = None
        self._unknown = 0
        self.single = 0

    def set_apart(self) -> None:
        """Note a line without a reading, which separates pairs."""
        self._is_start_known |= self._leader is None

    def add(self, cells: Mapping[str, str], line: bytes, place: str) -> tuple[Mapping[str, str] | None, bytes]:
        """Return both lines of a pair as one; None for its first line, and for a line without the other one.

        Raises:
            SourceError: it is unknown which line is the first one of a pair.
        """
        has_place = any(place in {label, split_title(label)[0]} for label in cells)
        if self._leader is None and self._is_start_known:
            self._leader = has_place
        if self._leader is None:
            self._unknown += 1
            self.single += 1
            if self._unknown > _MOST_UNKNOWN:
                raise SourceError(
                    f"{self._name}: lines with {place} and lines with the output alternate, and this recording began "
                    "between two lines, so a reading may belong to the distance before it or behind it. Nothing was "
                    "kept. Let the device write both numbers into one line, or a blank line before each pair"
                )
            return None, line
        if has_place == self._leader:
            self.single += self._first is not None
            self._first = cells, line
            return None, line
        if self._first is None:
            self.single += 1
            return None, line
        (first, before), self._first = self._first, None
        return {**first, **cells}, b" | ".join((before, line))


class LineParser:
    """Parser of sensor readings in lines of text.

    Lines without a reading are counted.

    Args:
        name: the source, for messages.
        layout: where a line has the output and the distance.
        from_middle: whether the first line may be incomplete, so that it is skipped.
    """

    def __init__(self, name: str, layout: LineFormat, *, from_middle: bool) -> None:
        self._name, self._format = name, layout
        self._factor = parse_unit(unit_in_words(layout.distance_unit or "mm") or "mm").factor
        self._is_assumed = bool(layout.distance_column) and not layout.distance_unit
        self._rest, self._skip_first, self._header = b"", from_middle, dict[str, int]()
        self._bytes = self._no_text = self._skipped = self._half = 0
        self._example = b""
        self._has_whole = False  # a line with both the distance and the output: then others are incomplete
        self._pairs = _PairedLines(name, starts_inside=from_middle)

    def feed(self, data: bytes) -> list[SourceReading]:
        """Return the readings in newly received bytes.

        An incomplete last line is kept until the rest of it arrives.
        """
        data = data.removeprefix(b"\xff\xfe").replace(b"\0", b"")  # some shells write text in UTF-16
        self._bytes += len(data)
        self._no_text += sum(byte not in _TEXT for byte in data)
        *lines, self._rest = (self._rest + data).replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > _LONGEST:
            self._skip(self._rest)
            self._rest = b""
        if lines and self._skip_first:
            self._skip_first = False
            lines = lines[1:]
        return [reading for line in lines if (reading := self._parse(line)) is not None]

    def finish(self) -> None:
        """Skip an incomplete last line at the end of input.

        Its number may be cut off, so the line is only counted.
        """
        self._half += bool(self._rest.strip())
        self._rest = b""

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the lines that were skipped."""
        notes = []
        if self._skipped:
            if self._skipped == 1:
                notes.append(f"{self._name}: skipped one line without a reading, the line {self._shown}.")
            else:
                notes.append(
                    f"{self._name}: skipped {self._skipped:,} lines without a reading. The first of these lines is "
                    f"{self._shown}."
                )
        if self._pairs.single:
            notes.append(f"{self._name}: skipped {self._pairs.single:,} lines of pairs whose other line is missing.")
        if self._is_assumed:
            notes.append(f"{self._name}: the lines have no unit of the distance, so mm was assumed (--distance-unit).")
        if self._half:
            notes.append(f"{self._name}: skipped the last line, because it is incomplete.")
        return tuple(notes)

    def why_silent(self) -> str:
        """Explain why the received bytes contain no readings."""
        if self._bytes >= _FEW and self._no_text > _NO_TEXT * self._bytes:
            return (
                f"{self._no_text} of {self._bytes} received bytes are not text, probably due to a wrong baud rate: set "
                "--baud (often 9600 or 115200)"
            )
        if self._skipped:
            return (
                f"{self._skipped} lines had no reading, for example the line {self._shown}: send one number per line, "
                "or choose a column or JSON key with --column"
            )
        if self._bytes:
            return f"{self._bytes} bytes arrived without a line end: send a line feed after each reading"
        return "nothing was received: check the device and its connection"

    @property
    def _shown(self) -> str:
        text = self._example.decode("ascii", "backslashreplace")
        return repr(text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}...")

    def _skip(self, line: bytes) -> None:
        self._skipped += 1
        self._example = self._example or line

    def _parse(self, line: bytes) -> SourceReading | None:
        """Return the reading in a line of text, or None."""
        text = without_stamp(line.strip().decode("utf-8", "replace"))[1].strip()
        if not text or text.startswith("#") or not text.strip("-=_*~"):
            self._pairs.set_apart()
            return None
        labeled: Mapping[str, str] | None = labeled_cells(text)
        if labeled is not None and self._has_half(labeled):
            labeled, line = self._pairs.add(labeled, line, self._format.distance_column)
            if labeled is None:
                return None
        reading = self._of_columns(text) if labeled is None else self._of_labels(labeled)
        if reading is None:
            self._skip(line)
            return None
        return reading._replace(line=line)

    def _has_half(self, labeled: Mapping[str, str]) -> bool:
        """Return True if a line has either the distance or the output, so that the next line has the other one."""
        place, column = self._format.distance_column, self._format.column
        names = {name for label in labeled for name in (label, split_title(label)[0])}
        others = [label for label in labeled if place not in {label, split_title(label)[0]}]
        has_output = column in names if column else bool(others)
        self._has_whole |= place in names and has_output
        return bool(place) and not self._has_whole and (place in names) != has_output

    def _of_labels(self, labeled: Mapping[str, str]) -> SourceReading | None:
        """Return the reading in a line whose values have labels, with or without a unit."""
        cells: dict[str, str] = {}
        for label, cell in labeled.items():
            name, unit = split_title(label)
            cells[label] = cells[name] = cell
            if unit and self._format.distance_column in {label, name}:
                self._take_unit(unit)
        plain = {split_title(label)[0] for label in labeled}
        return self._of_cells(cells, "keys", [name for name in cells if name in plain])

    def _of_columns(self, text: str) -> SourceReading | None:
        delimiter = self._delimiter(text)
        cells = cells_of(text, delimiter)
        if not any(self._number(cell) is not None for cell in cells):
            header = cells_of(text, delimiter_of_header(text))
            self._header = {name: i for i, cell in enumerate(header, start=1) for name in (cell, split_title(cell)[0])}
            chosen = (cell for i, cell in enumerate(header, start=1) if self._names_distance(cell, i))
            unit = next((split_title(cell)[1] for cell in chosen), None)
            if unit:
                self._take_unit(unit)
            return None
        named = {str(i): cell for i, cell in enumerate(cells, start=1)}
        numbers = list(named)
        named |= {name: named[str(i)] for name, i in self._header.items() if str(i) in named and name not in named}
        return self._of_cells(named, "columns", numbers)

    def _delimiter(self, text: str) -> str:
        """Return the delimiter of a line. A comma that may also be a decimal sign ends the recording."""
        delimiter = delimiter_of_row(text)
        if self._format.decimal_mark == "," and delimiter == ",":
            return BLANK
        whole = _TWO_WHOLE.fullmatch(text)
        is_open = not self._format.decimal_mark and not self._header
        if whole and is_open and not self._format.column and not self._format.distance_column:
            raise SourceError(
                f"{self._name}: the line {text!r} is one number, {whole[1]}.{whole[2]}, or two numbers, {whole[1]} and "
                f'{whole[2]}. The line was not kept. Choose --decimal "," for one number, or --column 1 or 2 for two'
            )
        if is_open and delimiter != "," and "," in text:
            cells = [cell for cell in cells_of(text, delimiter) if "," in cell]
            if cells and all(_THOUSANDS.fullmatch(cell) for cell in cells):
                cell = cells[0]
                raise SourceError(
                    f"{self._name}: the number {cell} in the line {text!r} is {cell.replace(',', '.')} or "
                    f'{cell.replace(",", "")}. The line was not kept. Choose --decimal "," for the first, or '
                    '--decimal "." for the second'
                )
        return delimiter

    def _names_distance(self, cell: str, number: int) -> bool:
        column = self._format.distance_column
        return bool(column) and column in {cell, split_title(cell)[0], str(number)}

    def _take_unit(self, unit: str) -> None:
        """Use the unit of the distances that the lines state, and refuse another one in the options."""
        if not is_length(unit):
            return
        if self._format.distance_unit and unit_in_words(self._format.distance_unit) != unit:
            raise SourceError(
                f"{self._name}: the lines give the distance in {unit}, but --distance-unit is "
                f"{self._format.distance_unit}. Omit --distance-unit, or correct the unit in the lines"
            )
        self._factor, self._is_assumed = parse_unit(unit).factor, False

    def _of_cells(self, cells: Mapping[str, str], kind: str, choice: Sequence[str]) -> SourceReading | None:
        """Return the reading from the cells of a line, or None."""
        distance = None
        if self._format.distance_column:
            cell = cells.get(self._format.distance_column)
            if cell is None:
                return None
            cell = from_fraction(cell) or cell
            unit = unit_of(cell)
            if unit:
                self._take_unit(unit)
            value = math.inf if is_no_object(cell) else self._number(cell)
            if value is None or value < 0:
                return None
            distance = value if math.isinf(value) else value * self._factor
        output = self._number(cells.get(self._format.column or self._only(cells, kind, choice), ""))
        return None if output is None else SourceReading(output, distance)

    def _only(self, cells: Mapping[str, str], kind: str, choice: Sequence[str]) -> str:
        """Return the name of the only numeric column besides the distance."""
        numbers = [name for name in choice if self._number(cells[name]) is not None]
        numbers = [name for name in numbers if name not in {self._distance_number, self._format.distance_column}]
        if len(numbers) > 1:
            raise SourceError(
                f"{self._name}: found {len(numbers)} numbers in each line, expected one number. Choose the number with "
                f"--column (possible {kind}: {', '.join(numbers)})"
            )
        return numbers[0] if numbers else ""

    def _number(self, cell: str) -> float | None:
        """Return the finite number in a table cell, with or without a unit, or None."""
        text = plain_cell(cell)
        if not is_number(text):
            return None
        if self._format.decimal_mark == ".":
            text = text.replace(",", "") if _THOUSANDS.fullmatch(text) else text
        value = float_of(text)
        return value if is_usable(value) else None

    @property
    def _distance_number(self) -> str:
        name = self._format.distance_column
        return str(self._header.get(name, name))
