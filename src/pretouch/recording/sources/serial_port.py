"""Read a sensor from a serial port."""

from __future__ import annotations

import errno
from typing import Any, Final

from pretouch._core.errors import InvalidInputError, SourceError, require

from .lines import LineFormat, LineParser
from .source import SourceReading

_WAIT: Final = 0.1  # s, longest time of one call of `read`


class SerialSource:
    """A sensor that sends lines of text to a serial port.

    Args:
        port: name of the port, such as `/dev/ttyUSB0`; None for the only port of this machine.
        baud: baud rate [1/s].
        layout: where a line has the output and the distance.
    """

    def __init__(self, port: str | None, baud: int, layout: LineFormat) -> None:
        serial = require("serial", extra="record")
        self.name = port or _only_port()
        self.unit: str | None = None
        self._parser = LineParser(self.name, layout, from_middle=True)
        try:
            self._port = serial.Serial(self.name, baud, timeout=_WAIT, exclusive=True)
        except (OSError, ValueError) as error:
            raise _cannot_open(self.name, baud, error) from None

    def read(self) -> list[SourceReading] | None:
        """Return the readings that have arrived.

        The call waits up to a tenth of a second.

        Raises:
            SourceError: the connection was lost.
        """
        try:
            return self._parser.feed(self._port.read(max(self._port.in_waiting, 1)))
        except (OSError, TypeError) as error:  # pyserial raises TypeError if the port is closed while it reads
            self._parser.finish()
            raise SourceError(
                f"{self.name}: the serial connection was lost ({getattr(error, 'strerror', None) or error}); check the "
                "plug"
            ) from None

    def close(self) -> None:
        """Close the serial port."""
        self._port.close()

    def why_silent(self) -> str:
        """Explain why no readings arrive, and what to do."""
        return self._parser.why_silent()

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the lines that were skipped."""
        return self._parser.notes


def _ports() -> list[tuple[str, str]]:
    """Return the names and descriptions of all connected serial ports."""
    listed: Any = require("serial.tools.list_ports", extra="record").comports()
    return sorted((port.device, port.description) for port in listed if port.hwid != "n/a")


def _only_port() -> str:
    """Return the name of the only serial port."""
    ports = _ports()
    if len(ports) == 1:
        return ports[0][0]
    if not ports:
        raise InvalidInputError(
            "--port: this machine has no serial port with a device; connect the sensor, or choose another source with "
            "--topic, --i2c or --stdin"
        )
    raise InvalidInputError(
        f"--port: {len(ports)} serial devices are connected; choose one of these devices with --port. The devices are "
        f"{_listed(ports)}"
    )


def _listed(ports: list[tuple[str, str]]) -> str:
    return ", ".join(f"{name} ({description})" for name, description in ports) or "none"


def _cannot_open(name: str, baud: int, error: Exception) -> InvalidInputError:
    """Return an error for a serial port that cannot be opened."""
    number = getattr(error, "errno", None)
    if number == errno.EACCES:
        remedy = (
            "this user may not read the port; add the user to the group dialout with sudo usermod -aG dialout $USER, "
            "then log in again"
        )
    elif number == errno.ENOENT:
        remedy = f"there is no such port; connected devices: {_listed(_ports())}"
    elif number in {errno.EAGAIN, errno.EBUSY}:
        remedy = "another program uses the port; close that program, for example a serial monitor"
    elif isinstance(error, ValueError):
        remedy = (
            f"the port does not support the baud rate {baud}; set --baud to the baud rate of the device, such as "
            "9600 or 115200"
        )
    else:
        remedy = f"the port cannot be opened ({getattr(error, 'strerror', None) or error}); check --port and --baud"
    return InvalidInputError(f"{name}: {remedy}")
