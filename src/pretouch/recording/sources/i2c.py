"""Read the proximity sensors VCNL4040 and VCNL4010 from an I2C bus under Linux."""

from __future__ import annotations

import ctypes
import errno
import os
import time
from dataclasses import dataclass
from typing import Final, Protocol

from pretouch._core.errors import InvalidInputError, SourceError
from pretouch._core.values import Value

from .source import SourceReading

_I2C_RDWR: Final = 0x0707  # Linux, linux/i2c-dev.h: combined transfers without a stop between them
_READ_FLAG: Final = 0x0001  # Linux, linux/i2c.h: I2C_M_RD


class I2cBus(Protocol):
    """Interface of an I2C bus for write and read transfers."""

    def transfer(self, address: int, data: bytes, count: int = 0) -> bytes:
        """Write bytes to an I2C device, and read its answer.

        The answer of `count` bytes follows after a repeated start condition.
        """

    def close(self) -> None:
        """Release the I2C bus."""


@dataclass(frozen=True, slots=True, kw_only=True)
class I2cPart(Value):
    """Registers, address and settings of a proximity sensor on an I2C bus.

    Args:
        name: name of the part.
        address: its address, 7 bits.
        identity: what to write to read the identity.
        expected: the bytes of the identity.
        setup: the messages that start continuous measurements.
        result: what to write to read a result of two bytes.
        high_first: whether the high byte of the result comes first.
        rate: how often the part measures [1/s].
        source: the data sheet.
    """

    name: str
    address: int
    identity: bytes
    expected: bytes
    setup: tuple[bytes, ...]
    result: bytes
    high_first: bool
    rate: float
    source: str


I2C_PARTS: Final = {
    part.name: part
    for part in (
        I2cPart(
            name="VCNL4040",
            address=0x60,
            identity=b"\x0c",
            expected=b"\x86\x01",
            # registers of two bytes, low byte first. PS_CONF1 = 0: duty 1/40, pulse 1 T, on. PS_CONF2 = 8: 16 bits.
            # PS_CONF3 = 0, PS_MS = 7: emitter at 200 mA
            setup=(b"\x03\x00\x08", b"\x04\x00\x07"),
            result=b"\x08",
            high_first=False,
            rate=200.0,
            source="Vishay data sheet 84274, Rev. 1.4, tables 1, 4, 5, 6 and 14",
        ),
        I2cPart(
            name="VCNL4010",
            address=0x13,
            identity=b"\x81",
            expected=b"\x21",
            # stop; 250 readings per second; emitter at 20 times 10 mA; measure by itself
            setup=(b"\x80\x00", b"\x82\x07", b"\x83\x14", b"\x80\x03"),
            result=b"\x87",
            high_first=True,
            rate=250.0,
            source="Vishay data sheet 83462, Rev. 1.6, registers 0, 1, 2, 3, 7 and 8",
        ),
    )
}
"""The parts by name."""


class I2cSource:
    """A proximity sensor on an I2C bus: VCNL4040 or VCNL4010.

    Args:
        part: name of the part.
        bus: number of the bus, such as 1 for `/dev/i2c-1`, or an open bus.
        rate: readings per second; None for the rate of the part.
    """

    def __init__(self, part: str, bus: int | I2cBus, rate: float | None = None) -> None:
        if part.upper() not in I2C_PARTS:
            raise InvalidInputError(f"--i2c: found the part {part!r}, expected one of {', '.join(I2C_PARTS)}")
        self._part = I2C_PARTS[part.upper()]
        self._bus: I2cBus = LinuxBus(bus) if isinstance(bus, int) else bus
        self.name = f"{self._part.name} at address 0x{self._part.address:02x}"
        self.unit: str | None = "counts"
        self._period = 1 / (rate or self._part.rate)
        identity = self._transfer(self._part.identity, len(self._part.expected))
        if identity != self._part.expected:
            raise SourceError(
                f"{self.name}: found the device ID 0x{identity.hex()}, expected 0x{self._part.expected.hex()}; another "
                "kind of sensor is connected"
            )
        for message in self._part.setup:
            self._transfer(message)
        self._next = time.monotonic() + 2 * self._period

    def read(self) -> list[SourceReading] | None:
        """Wait until the next reading is due, and return it."""
        time.sleep(max(self._next - time.monotonic(), 0.0))
        self._next = max(self._next + self._period, time.monotonic())
        data = self._transfer(self._part.result, 2)
        return [SourceReading(float(int.from_bytes(data, "big" if self._part.high_first else "little")))]

    def close(self) -> None:
        """Release the I2C bus."""
        self._bus.close()

    def why_silent(self) -> str:
        """Explain why no readings arrive, and what to do."""
        return "the bus does not answer: check the wiring and the supply"

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on skipped input: always empty, because every transfer returns a reading."""
        return ()

    def _transfer(self, data: bytes, count: int = 0) -> bytes:
        try:
            return self._bus.transfer(self._part.address, data, count)
        except OSError as error:
            raise SourceError(
                f"{self.name}: the device does not answer ({error.strerror or error}); check wiring, supply, pull-up "
                "resistors and the number of the bus"
            ) from None


class _Message(ctypes.Structure):
    """One I2C message, in the layout of Linux `i2c_msg`."""

    _fields_ = (
        ("address", ctypes.c_uint16),
        ("flags", ctypes.c_uint16),
        ("length", ctypes.c_uint16),
        ("data", ctypes.c_void_p),
    )


class _Messages(ctypes.Structure):
    """A combined I2C transfer, with the layout of the Linux structure `i2c_rdwr_ioctl_data`."""

    _fields_ = (("messages", ctypes.POINTER(_Message)), ("count", ctypes.c_uint32))


class LinuxBus:
    """An I2C bus under Linux, with the device file `/dev/i2c-N`.

    Args:
        number: number of the bus.
    """

    def __init__(self, number: int) -> None:
        path = f"/dev/i2c-{number}"
        try:
            self._file = os.open(path, os.O_RDWR)
        except OSError as error:
            remedies = {
                errno.ENOENT: "there is no such bus; enable I2C, for example with dtparam=i2c_arm=on in the file "
                "config.txt of a Raspberry Pi, and load the module i2c-dev",
                errno.EACCES: "this user may not use the bus; add the user to the group i2c with sudo usermod -aG i2c "
                "$USER, then log in again",
            }
            raise InvalidInputError(f"{path}: {remedies.get(error.errno or 0, error.strerror)}") from None

    def transfer(self, address: int, data: bytes, count: int = 0) -> bytes:
        """Write bytes to an I2C device, and read its answer."""
        import fcntl  # noqa: PLC0415 - not on Windows

        sent, received = ctypes.create_string_buffer(data, len(data)), ctypes.create_string_buffer(max(count, 1))
        parts = [_Message(address, 0, len(data), ctypes.addressof(sent))]
        if count:
            parts.append(_Message(address, _READ_FLAG, count, ctypes.addressof(received)))
        messages = (_Message * len(parts))(*parts)
        fcntl.ioctl(self._file, _I2C_RDWR, _Messages(messages, len(parts)))
        return received.raw[:count]

    def close(self) -> None:
        """Close the device file of the I2C bus."""
        os.close(self._file)
