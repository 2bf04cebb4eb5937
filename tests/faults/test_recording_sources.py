"""Sources of readings: lines of text, an I2C bus and messages, as they are and as they should not be."""

from __future__ import annotations

import errno
import math
import struct

import pytest

from pretouch.errors import InvalidInputError, SourceError
from pretouch.recording.sources.i2c import I2cSource, LinuxBus
from pretouch.recording.sources.lines import LineFormat, LineParser
from pretouch.recording.sources.source import SourceReading


def parser(column: str = "", distance: str = "", unit: str = "mm", *, from_middle: bool = False) -> LineParser:
    layout = LineFormat(column=column, distance_column=distance, distance_unit=unit)
    return LineParser("a sensor", layout, from_middle=from_middle)


@pytest.mark.parametrize(
    ("text", "column", "outputs"),
    [
        (b"1023\n1022\r\n\n-1.5e3\r", "", [1023, 1022, -1500]),
        (b"# hello\n12\n", "", [12]),
        (b"1,2.5,3\n", "2", [2.5]),
        (b"7;8\n", "1", [7]),
        (b"7\t8\n", "2", [8]),
        (b" 7   8 \n", "2", [8]),
        (b"time,prox\n0.1,40\n0.2,41\n", "prox", [40, 41]),
        (b'{"prox": 40, "name": "left"}\n', "", [40]),
        (b'{"prox": 40, "light": 3}\n', "prox", [40]),
        (b"VCNL4040 found\n55\n", "", [55]),
    ],
)
def test_numbers_columns_and_json_lines_are_read(text: bytes, column: str, outputs: list[float]) -> None:
    assert [reading.output for reading in parser(column).feed(text)] == outputs


def test_every_split_of_the_bytes_gives_the_same_readings() -> None:
    text = b"10\r\n20\r\n30\n40\r50\n6"
    for i in range(len(text)):
        each = parser()
        assert [r.output for part in (text[:i], text[i:]) for r in each.feed(part)] == [10, 20, 30, 40, 50]
        each.finish()
        assert len(each.notes) == 1  # the 6 may be the start of 60


def test_distances_of_a_column_are_in_meters_and_infinite_without_an_object() -> None:
    each = parser("2", "1")
    readings = each.feed(b"5,100\ninf,20\n,21\nno object,22\n-3,90\nx,80\n")
    assert readings[0] == SourceReading(100, 0.005, b"5,100")
    assert [r.distance for r in readings[1:]] == [math.inf] * 3
    assert "2 lines" in each.notes[0]
    assert parser("", "1", "cm").feed(b"5,100\n") == [SourceReading(100, 0.05, b"5,100")]
    assert parser("", "gap").feed(b'{"gap": 5, "y": 7}\n{"gap": null, "y": 6}\n')[1][:2] == (6, math.inf)


@pytest.mark.parametrize(
    "line",
    [b"nan", b"inf", b"1_000", b"{}", b'{"y": true}', b"[1]", b"{", b"\xff\xfe", b"1e999"],
)
def test_a_line_without_a_finite_number_is_no_reading(line: bytes) -> None:
    each = parser("1")
    assert each.feed(line + b"\n") == []


def test_several_numbers_need_a_choice() -> None:
    with pytest.raises(SourceError, match="--column"):
        parser().feed(b"1,2\n")
    with pytest.raises(SourceError, match="a, b"):
        parser().feed(b'{"a": 1, "b": 2}\n')


def test_the_first_line_of_a_running_device_may_be_cut_off() -> None:
    assert [r.output for r in parser(from_middle=True).feed(b"23\n1023\n")] == [1023]


def test_input_without_line_ends_does_not_grow_without_bound() -> None:
    each = parser()
    for _ in range(100):
        each.feed(b"7" * 1000)
    assert len(each._rest) <= 5096
    assert each.feed(b"\n12\n")[-1].output == 12


# --- I2C


class FakeBus:
    """An I2C bus with one sensor: registers of one byte, or of two bytes with the low byte first."""

    def __init__(self, address: int, registers: dict[int, int], *, words: bool) -> None:
        self.address, self.registers, self.words = address, registers, words
        self.written: list[tuple[int, int]] = []
        self.is_open = True

    def transfer(self, address: int, data: bytes, count: int = 0) -> bytes:
        if address != self.address:
            raise OSError(errno.EREMOTEIO, "Remote I/O error")
        register, *values = data
        if values:
            value = struct.unpack("<H", bytes(values))[0] if self.words else values[0]
            self.written.append((register, value))
            self.registers[register] = value
        if self.words:
            return struct.pack("<H", self.registers.get(register, 0))[:count]
        return bytes(self.registers.get(register + i, 0) for i in range(count))

    def close(self) -> None:
        self.is_open = False


def test_a_vcnl4040_measures_with_16_bits_and_its_low_byte_comes_first() -> None:
    bus = FakeBus(0x60, {0x0C: 0x0186, 0x08: 0x1234}, words=True)
    source = I2cSource("vcnl4040", bus, rate=1000.0)
    assert dict(bus.written) == {0x03: 0x0800, 0x04: 0x0700}  # PS on, 16 bits; 200 mA
    assert (source.read(), source.unit) == ([SourceReading(0x1234)], "counts")
    source.close()
    assert not bus.is_open


def test_a_vcnl4010_measures_by_itself_and_its_high_byte_comes_first() -> None:
    bus = FakeBus(0x13, {0x81: 0x21, 0x87: 0x12, 0x88: 0x34}, words=False)
    source = I2cSource("VCNL4010", bus, rate=1000.0)
    assert bus.written == [(0x80, 0), (0x82, 7), (0x83, 20), (0x80, 3)]  # the rate is set while it stands still
    assert source.read() == [SourceReading(0x1234)]


def test_another_part_no_part_and_no_bus_are_reported() -> None:
    with pytest.raises(SourceError, match="another kind of sensor"):
        I2cSource("VCNL4010", FakeBus(0x13, {0x81: 0x15}, words=False))
    with pytest.raises(SourceError, match="wiring"):
        I2cSource("VCNL4040", FakeBus(0x13, {}, words=False))
    with pytest.raises(InvalidInputError, match="VCNL4010"):
        I2cSource("VL53L0X", FakeBus(0x29, {}, words=False))
    with pytest.raises(InvalidInputError, match="no such bus"):
        LinuxBus(250)


def test_the_kernel_sees_one_transfer_with_a_repeated_start(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    import ctypes

    fcntl = pytest.importorskip("fcntl", reason="needs Linux")
    seen: list[tuple[int, int, int]] = []

    def ioctl(file: int, request: int, messages: object) -> int:
        assert request == 0x0707
        for i in range(messages.count):  # type: ignore[attr-defined]
            message = messages.messages[i]  # type: ignore[attr-defined]
            seen.append((message.address, message.flags, message.length))
            if message.flags:
                ctypes.memmove(message.data, b"\x34\x12", 2)
        return 0

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    monkeypatch.setattr("os.open", lambda *_: 3)
    assert LinuxBus(1).transfer(0x60, b"\x08", 2) == b"\x34\x12"
    assert seen == [(0x60, 0, 1), (0x60, 1, 2)]


# --- messages


def test_messages_are_decoded_as_ros_encodes_them() -> None:
    """The bytes are CDR, little endian: stamp and frame, radiation type, four floats, and a later member."""
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed (pip install pretouch[ros])")
    from pretouch.recording.sources.ros_messages import NUMBERS, message_types, reading_types

    types = message_types()
    body = struct.pack("<iII7sB4f", 5, 6, 7, b"sensor\0", 1, 0.25, 0.5, 2.0, 1.5)
    for later in (b"", struct.pack("<f", 0.125)):  # Range has a variance since ROS 2 Jazzy
        message = types.Range.deserialize(b"\x00\x01\x00\x00" + body + later)
        assert (message.header.stamp.sec, message.header.frame_id) == (5, "sensor")
        assert (message.radiation_type, message.min_range, message.range) == (1, 0.5, 1.5)
    assert types.Float64.deserialize(b"\x00\x01\x00\x00" + struct.pack("<d", 2.5)).data == 2.5
    assert types.Float32.deserialize(b"\x00\x01\x00\x00" + struct.pack("<f", 2.5)).data == 2.5
    names = {name: kind.member for name, kind in reading_types().items()}
    assert names == {
        "sensor_msgs::msg::dds_::Range_": "range",
        **{f"std_msgs::msg::dds_::{name}_": "data" for name in NUMBERS},
    }
