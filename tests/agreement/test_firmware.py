"""The sketches of examples/firmware/ compile for an Arduino Uno, and print what their sensors measure at their rate."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pretouch.recording.sources.i2c import I2C_PARTS

ROOT = Path(__file__).parents[2]
FIRMWARE = ROOT / "examples/firmware"
BOARD = ROOT / "tests/firmware"
CORE = Path("/usr/share/arduino/hardware/arduino/avr")  # of Debian's package arduino-core-avr
SKETCHES = sorted(path.stem for path in FIRMWARE.glob("*/*.ino"))
WARNINGS = ["-std=gnu++11", "-Wall", "-Wextra", "-Werror", "-x", "c++", "-include", "Arduino.h"]


def test_every_folder_has_a_sketch_of_its_name_and_a_row_in_the_page() -> None:
    assert sorted(path.name for path in FIRMWARE.iterdir() if path.is_dir()) == SKETCHES
    assert len(SKETCHES) == 5
    page = (FIRMWARE / "README.md").read_text()
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == [
        "vcnl4040",
        "vcnl4010",
        "apds9960",
        "vl53l0x",
        "analog_pin",
    ]


@pytest.mark.parametrize("name", SKETCHES)
def test_a_sketch_compiles_for_an_arduino_uno(name: str, tmp_path: Path) -> None:
    if shutil.which("avr-g++") is None or not CORE.exists():
        pytest.skip("needs avr-gcc and the Arduino core (Debian: gcc-avr, avr-libc, arduino-core-avr)")
    flags = [
        "-mmcu=atmega328p",
        "-DF_CPU=16000000L",
        "-DARDUINO=10819",
        "-DARDUINO_AVR_UNO",
        "-DARDUINO_ARCH_AVR",
        "-Os",
    ]
    folders = [f"-I{CORE / folder}" for folder in ("cores/arduino", "variants/standard", "libraries/Wire/src")]
    command = ["avr-g++", *flags, *folders, *WARNINGS, "-fno-exceptions", "-fno-threadsafe-statics"]
    subprocess.run([*command, "-c", str(FIRMWARE / name / f"{name}.ino"), "-o", str(tmp_path / "sketch.o")], check=True)


def run(name: str, folder: Path, *words: str, status: int = 0) -> list[str]:
    """Run a sketch on a simulated board, and return the lines that it prints and the registers that it writes."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no compiler")
    program = folder / name
    sources = [str(FIRMWARE / name / f"{name}.ino"), "-include", "Arduino.h", str(BOARD / "board.cpp")]
    subprocess.run([compiler, f"-I{BOARD}", *WARNINGS, *sources, "-o", str(program)], check=True)
    done = subprocess.run([str(program), *words], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == status
    return done.stdout.splitlines()


VL53L0X = ["14=01", "1a=12", "1b=34", "1e=00", "1f=78"]  # complete, signal rate 0x1234, distance 0x78


@pytest.mark.parametrize(
    ("name", "address", "size", "registers", "reading", "period"),
    [
        ("vcnl4040", "60", 2, ["0c=0186", "08=fedc"], "65244", 5000),
        ("vcnl4010", "13", 1, ["81=21", "87=fe", "88=dc"], "65244", 4000),
        ("apds9960", "39", 1, ["92=ab", "9c=c8"], "200", 10000),
        ("vl53l0x", "29", 1, ["c0=ee", *VL53L0X], "4660,120", 40000),
    ],
)
def test_a_sketch_prints_what_its_sensor_measures_at_its_rate(
    name: str, address: str, size: int, registers: list[str], reading: str, period: int, tmp_path: Path
) -> None:
    lines = run(name, tmp_path, address, str(size), "100", *registers)
    assert lines[0] == "115200 baud"
    readings = [line.split(" @") for line in lines if " @" in line]
    assert [text for text, _ in readings] == [reading] * 100
    times = np.array([int(time) for _, time in readings])
    assert abs(times[-1] - times[0] - 99 * period) <= 8  # two steps of the clock


def test_the_analog_sketch_prints_one_conversion_a_millisecond(tmp_path: Path) -> None:
    readings = [line.split(" @") for line in run("analog_pin", tmp_path, "0", "1", "500")[1:]]
    assert [int(text) for text, _ in readings] == list(range(100, 600))
    assert abs(int(readings[-1][1]) - int(readings[0][1]) - 499 * 1000) <= 8


@pytest.mark.parametrize("name", ["vcnl4040", "vcnl4010", "apds9960", "vl53l0x"])
def test_a_sensor_that_does_not_answer_is_said(name: str, tmp_path: Path) -> None:
    lines = run(name, tmp_path, "01", "1", "1", status=3)
    assert len(lines) == 61  # the baud rate, then one line a second for a minute
    assert all("does not answer" in line for line in lines[1:])


@pytest.mark.parametrize(("name", "size"), [("vcnl4040", 2), ("vcnl4010", 1)])
def test_the_sketch_sets_the_registers_that_pretouch_sets_over_i2c(name: str, size: int, tmp_path: Path) -> None:
    part = I2C_PARTS[name.upper()]
    identity = f"{part.identity.hex()}={int.from_bytes(part.expected, 'little'):x}"
    lines = run(name, tmp_path, f"{part.address:x}", str(size), "1", identity)
    written = [line.removeprefix("write ").split() for line in lines if line.startswith("write")]
    assert written == [[f"{m[0]:02x}", f"{value:02x}"] for m in part.setup for value in m[1:]]
