"""Define the interface of a source of sensor readings, such as a serial port."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol


class SourceReading(NamedTuple):
    """One sensor reading and the distance of the object.

    `distance` is in m, infinite without an object, and None if the source reports no distance. `line` is the line of
    text as it came, without its end; None if the source sends no text.
    """

    output: float
    distance: float | None = None
    line: bytes | None = None


class ReadingSource(Protocol):
    """Interface of a source of sensor readings, such as a serial port.

    `name` identifies the source in messages. `unit` is the unit of its outputs, or None if the source does not know it.
    """

    name: str
    unit: str | None

    def read(self) -> list[SourceReading] | None:
        """Return the readings that have arrived.

        The call waits up to a tenth of a second. The result is None after the last reading.
        """

    def close(self) -> None:
        """Release the device or file that the readings come from."""

    def why_silent(self) -> str:
        """Explain why no readings arrive, and what to do."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on input that was skipped or lost."""


def is_usable(output: float) -> bool:
    """Return True if a calibration can use a sensor output: it is finite.

    All sources skip and count the others.

    Args:
        output: the sensor output.
    """
    return math.isfinite(output)
