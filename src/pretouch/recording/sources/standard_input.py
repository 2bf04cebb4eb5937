"""Read sensor readings from standard input."""

from __future__ import annotations

import os
import select
import sys
from typing import Final

from .lines import LineFormat, LineParser
from .source import SourceReading

_WAIT: Final = 0.1  # s, longest time of one call of `read`
_CHUNK: Final = 65536


class StandardInput:
    """Source of sensor readings from standard input.

    The lines of text are, for example, the output of another program.

    Args:
        layout: where a line has the output and the distance.
    """

    def __init__(self, layout: LineFormat) -> None:
        self.name = "standard input"
        self.unit: str | None = None
        self._parser = LineParser(self.name, layout, from_middle=False)
        self._file = sys.stdin.fileno()

    def read(self) -> list[SourceReading] | None:
        """Return the readings that have arrived.

        The call waits up to a tenth of a second. The result is None at the end of the input.
        """
        if os.name != "nt" and not select.select([self._file], [], [], _WAIT)[0]:
            return []
        data = os.read(self._file, _CHUNK)
        if not data:
            self._parser.finish()
            return None
        return self._parser.feed(data)

    def close(self) -> None:
        """Do nothing, because standard input stays open."""

    def why_silent(self) -> str:
        """Explain why no readings arrive, and what to do."""
        return self._parser.why_silent()

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the lines that were skipped."""
        return self._parser.notes
