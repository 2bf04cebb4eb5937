"""Store the readings and time stamps of a recorded topic.

The readings are distances or sensor outputs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.units import format_quantity, parse_unit
from pretouch._core.values import Value

from .clocks import Transport
from .no_object import NoObject

Kind: TypeAlias = Literal["reading", "distance"]
Clock: TypeAlias = Literal["header", "receive", "column", "rate"]

UNBOUNDED: Final = (float("-inf"), float("inf"))
"""Bounds of a sensor whose messages have none."""

CLOCKS: Final = {
    "header": "header stamps",
    "receive": "receive times",
    "column": "time column",
    "rate": "stated rate",
}
"""The clocks of a recording, in words."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Recording(Value):
    """Readings of one recorded topic, in the order of arrival.

    Args:
        source: name of the file or folder.
        topic: topic and field, such as "/proximity.range", or the header of a column.
        message_type: type of the messages; "column" for a CSV file.
        stamps: time of each reading, in nanoseconds of the chosen clock, shape (n,).
        values: the readings, shape (n,): in m if they are distances, otherwise as recorded.
        kind: "distance" or "reading" (of any other sensor output).
        clock: which clock the stamps are from.
        transport: receive time minus header stamp of each reading [s]; empty if only one clock was recorded.
        bounds: smallest and largest distance that the sensor can measure, according to its messages [m].
        no_object: values that were taken as "no object" by a replay: a distance without an object is then infinite.
        notes: remarks on the file, such as that it is truncated.
        unit: unit that the file or the user states: V or counts; for distances, that of the file, such as mm.
        read: how a table was understood: which time column, its unit and rate.

    Examples:
        >>> columns = {"stamps": [0, 10**7], "values": [0.5, 0.4]}
        >>> Recording(source="bag", topic="/range", message_type="", kind="distance", **columns)
        <Recording /range: 2 distances in 10 ms>
    """

    source: str
    topic: str
    message_type: str
    stamps: IntArray
    values: FloatArray
    kind: Kind = "reading"
    clock: Clock = "receive"
    transport: FloatArray = ()  # type: ignore[assignment]
    bounds: tuple[float, float] = UNBOUNDED
    no_object: tuple[NoObject, ...] = ()
    notes: tuple[str, ...] = ()
    read: tuple[str, ...] = ()
    unit: str = ""

    def __post_init__(self) -> None:
        for name, kind in (("stamps", np.int64), ("values", np.float64), ("transport", np.float64)):
            column = np.array(getattr(self, name), dtype=kind)
            column.setflags(write=False)
            object.__setattr__(self, name, column)
        if self.stamps.ndim != 1 or self.stamps.shape != self.values.shape:
            raise InvalidInputError(
                f"stamps, values: found stamps of the shape {self.stamps.shape} and values of the shape "
                f"{self.values.shape}, expected two columns of the same length"
            )

    @property
    def time(self) -> FloatArray:
        """Time of each reading [s], counted from the first reading."""
        return self.seconds_after(int(self.stamps[0]) if len(self.stamps) else 0)

    def seconds_after(self, stamp: int) -> FloatArray:
        """Return the reading times [s], counted from a time stamp.

        Args:
            stamp: nanoseconds of the same clock.
        """
        return np.asarray((self.stamps - stamp) / 1e9)

    @property
    def transports(self) -> Transport | None:
        """Receive times and header stamps; None if only one clock was recorded."""
        if not len(self.transport):
            return None
        taken = np.round(1e9 * self.transport).astype(np.int64)
        is_header = self.clock == "header"
        received, stamps = (self.stamps + taken, self.stamps) if is_header else (self.stamps, self.stamps - taken)
        return Transport(self.topic, received, stamps)

    def value_in_words(self, value: float) -> str:
        """Return one value of the readings with the unit in which it was recorded.

        Args:
            value: the value; a distance in m.
        """
        if self.kind == "reading":
            return f"{value:.6g} {self.unit}".rstrip()
        unit = self.unit or "m"
        return f"{value / parse_unit(unit).factor:.6g} {unit}"

    def part(self, kept: slice | IntArray) -> Recording:
        """Return the recording with only the selected readings.

        Args:
            kept: indices of the readings.
        """
        transport = self.transport[kept] if len(self.transport) else self.transport
        return replace(self, stamps=self.stamps[kept], values=self.values[kept], transport=transport)

    def __repr__(self) -> str:
        span = format_quantity(float(np.ptp(self.time)), "s") if len(self.stamps) else "0 s"
        return f"<Recording {self.topic}: {len(self.stamps):,} {self.kind}s in {span}>"
