"""Parse sensor readings from lines of text.

Each line has one number, columns of a table, or a JSON object.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from pretouch._core.errors import InvalidInputError, SourceError
from pretouch._core.units import parse_unit
from pretouch._core.values import Value
from pretouch.tables.headers import is_no_object

from .source import SourceReading

_LONGEST: Final = 4096  # bytes without a line end, after which they are skipped
_SHOWN: Final = 40  # characters of a skipped line that a message shows
_NO_TEXT: Final = 0.2  # share of bytes that are no text, from which the baud rate is doubted
_FEW: Final = 16  # bytes from which this share is judged
_TEXT: Final = frozenset([9, 10, 13, *range(32, 127)])
_NUMBER: Final = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class LineFormat(Value):
    """Format of text lines with sensor readings.

    Args:
        column: number of the column from 1, its name in a header line, or a key of JSON objects; empty if each line
            has one number.
        distance_column: the same for the distance; empty if the lines have no distances.
        distance_unit: unit of these distances.
    """

    column: str = ""
    distance_column: str = ""
    distance_unit: str = "mm"

    def __post_init__(self) -> None:
        if parse_unit(self.distance_unit).exponents != parse_unit("m").exponents:
            raise InvalidInputError(
                f"distance unit: found {self.distance_unit!r}, expected a unit of length such as mm"
            )


class LineParser:
    """Parser of sensor readings in lines of text.

    Lines without a reading are counted.

    Args:
        name: the source, for messages.
        layout: where a line has the output and the distance.
        from_middle: whether the first line may be incomplete, so that it is skipped.
    """

    def __init__(self, name: str, layout: LineFormat, *, from_middle: bool) -> None:
        self._name, self._format, self._factor = name, layout, parse_unit(layout.distance_unit).factor
        self._rest, self._skip_first, self._header = b"", from_middle, dict[str, int]()
        self._bytes = self._no_text = self._skipped = self._half = 0
        self._example = b""

    def feed(self, data: bytes) -> list[SourceReading]:
        """Return the readings in newly received bytes.

        An incomplete last line is kept until the rest of it arrives.
        """
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
        text = line.strip().decode("utf-8", "replace")
        if not text or text.startswith("#"):
            return None
        reading = self._of_json(text) if text.startswith("{") else self._of_columns(text)
        if reading is None:
            self._skip(line)
        return reading

    def _of_json(self, text: str) -> SourceReading | None:
        try:
            content = json.loads(text)
        except ValueError:
            return None
        if not isinstance(content, dict):
            return None
        cells = {str(key): _cell(value) for key, value in content.items()}
        return self._of_cells(cells, "keys")

    def _of_columns(self, text: str) -> SourceReading | None:
        parts = re.split(r"[,;\t]", text)
        cells = [cell.strip().strip('"') for cell in (parts if len(parts) > 1 else text.split())]
        if not any(_number(cell) is not None for cell in cells):
            self._header = {cell: i + 1 for i, cell in enumerate(cells)}
            return None
        named = {str(i): cell for i, cell in enumerate(cells, start=1)}
        named |= {name: named[str(i)] for name, i in self._header.items() if str(i) in named and name not in named}
        return self._of_cells(named, "columns")

    def _of_cells(self, cells: Mapping[str, str], kind: str) -> SourceReading | None:
        """Return the reading from the cells of a line, or None."""
        distance = None
        if self._format.distance_column:
            cell = cells.get(self._format.distance_column)
            if cell is None:
                return None
            value = math.inf if is_no_object(cell) else _number(cell)
            if value is None or value < 0:
                return None
            distance = value if math.isinf(value) else value * self._factor
        output = _number(cells.get(self._format.column or self._only(cells, kind), ""))
        return None if output is None else SourceReading(output, distance)

    def _only(self, cells: Mapping[str, str], kind: str) -> str:
        """Return the name of the only numeric column besides the distance."""
        numbers = [name for name, cell in cells.items() if _number(cell) is not None and name not in self._header]
        numbers = [name for name in numbers if name != self._distance_number]
        if len(numbers) > 1:
            raise SourceError(
                f"{self._name}: found {len(numbers)} numbers in each line, expected one number. Choose the number with "
                f"--column (possible {kind}: {', '.join(numbers)})"
            )
        return numbers[0] if numbers else ""

    @property
    def _distance_number(self) -> str:
        name = self._format.distance_column
        return str(self._header.get(name, name))


def _cell(value: Any) -> str:
    """Return a JSON value as the text of a table cell."""
    return "" if value is None else str(value)


def _number(cell: str) -> float | None:
    """Return the finite number in a table cell, or None."""
    return float(cell) if _NUMBER.fullmatch(cell) and math.isfinite(float(cell)) else None
