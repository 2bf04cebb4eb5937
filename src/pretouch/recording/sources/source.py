"""Define the interface of a source of sensor readings, such as a serial port."""

from __future__ import annotations

from typing import NamedTuple, Protocol


class SourceReading(NamedTuple):
    """One sensor reading, with the distance of the object if the source reports distances.

    `distance` is in m, infinite without an object, and None if the source reports no distance.
    """

    output: float
    distance: float | None = None


class ReadingSource(Protocol):
    """Interface of a source of sensor readings, such as a serial port.

    `name` identifies the source in messages. `unit` is the unit of its outputs, or None if the source does not know it.
    """

    name: str
    unit: str | None

    def read(self) -> list[SourceReading] | None:
        """Wait up to a tenth of a second, and return the readings that have arrived; None after the last reading."""

    def close(self) -> None:
        """Release the device or file that the readings come from."""

    def why_silent(self) -> str:
        """Return a clause that explains why no readings arrive, and what to do."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on input that was skipped or lost."""
