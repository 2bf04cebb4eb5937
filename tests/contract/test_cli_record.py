"""`pretouch record`: a calibration through a pseudo terminal, standard input and DDS, and what it says of faults."""

from __future__ import annotations

import io
import json
import math
import os
import re
import shlex
import signal as signals
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_text import command

import pretouch as pt
from pretouch.calibration.averaging import MAD_TO_SIGMA
from pretouch.cli.record_display import LiveDisplay
from pretouch.recording.record_file import RecordFile
from recording_bench import OFFSET, SOURCE, PtySensor, signal
from refusals import refused

if os.name == "nt":
    pytest.skip("pseudo terminals need POSIX", allow_module_level=True)
pytest.importorskip("serial", reason="needs the extra 'record'")

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/how-to/record-a-calibration.md").read_text(encoding="utf-8")
LIST = "0, 3, 7, 12, 18, 26, 36, 52 mm"  # a twentieth of the signal is reached at 51 mm
STEP, CYCLE = 7919, 10007  # of numbers that look like noise, and show a lost line by another difference
SCENARIO = """
[sensor]
calibration = "sensor.csv"
recess = "2 mm"
[admittance]
mass = "1 kg"
damping = "10 N*s/m"
stiffness = "25 N/m"
[obstacle]
position = "30 mm"
velocity = "-0.3 m/s"
[objective]
kind = "excursion"
position_scale = "0.5 m"
velocity_scale = "0.3 m/s"
[gain]
bounds = ["-10 N*s", "-0.01 N*s"]
"""


@pytest.fixture
def sensor(tmp_path: Path) -> Iterator[PtySensor]:
    with PtySensor(tmp_path) as bench:
        yield bench


def words(sensor: PtySensor, *more: str) -> list[str]:
    quick = ["--dwell", "0.05 s", "--readings", "10"]
    return [sys.executable, "-m", "pretouch", "record", *quick, "--port", sensor.port, *more]


def record(
    sensor: PtySensor, folder: Path, *more: str, answers: str = "\n", timeout: float = 120.0
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        words(sensor, *more), input=answers, capture_output=True, text=True, check=False, cwd=folder, timeout=timeout
    )


def rows(path: Path) -> list[list[str]]:
    """Return the cells of a recorded file without comments and header."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return [line.split(",") for line in lines[1:]]


@pytest.mark.slow
def test_a_stage_records_a_calibration_that_fit_reads(sensor: PtySensor, tmp_path: Path) -> None:
    done = record(sensor, tmp_path, "sensor.csv", "--distances", LIST, "--stage", sensor.stage, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["status"], result["verdict"], result["no_object_readings"]) == ("enough", "usable", 10)
    curve = pt.read_calibration(tmp_path / "sensor.csv")
    assert (len(curve.outputs), len(curve.no_object)) == (result["readings"], 10)
    assert result["readings"] == 10 * len(result["distances"])
    assert curve.source is not None
    assert curve.source.label_columns == ()
    # the mean of ten readings is within five standard errors of the true output: chance 6e-7 for each distance
    for distance in curve.distinct_distances:
        mean = float(np.mean(curve.outputs[curve.distances == distance]))
        assert abs(mean - OFFSET - signal(distance)) < 5 * 6 / np.sqrt(10) + 0.5  # and half a count of rounding
    report = pt.fit(curve)
    assert report.best is not None
    middle = report.best.middle_slope
    distance = float(np.mean(report.best.sensor.valid_range))
    assert abs(middle.value + 3 / (SOURCE + distance)) < 5 * middle.standard_error
    raw = rows(tmp_path / "sensor-raw.csv")
    assert len(raw) == result["received"]
    moments = np.array([float(row[0]) for row in raw])
    assert (np.diff(moments) >= 0).all()


@pytest.mark.slow
def test_a_list_ends_early_if_the_slope_is_known_and_goes_on_if_asked(sensor: PtySensor, tmp_path: Path) -> None:
    far = LIST.replace(" mm", ", 70, 90 mm")
    options = ["--distances", far, "--stage", sensor.stage, "--json"]
    early = json.loads(record(sensor, tmp_path, "early.csv", *options).stdout)
    assert early["status"] == "enough"
    assert early["distances"][-1] == 0.052
    sensor.position.unlink()
    full = json.loads(record(sensor, tmp_path, "full.csv", *options, "--all").stdout)
    assert full["distances"][-1] == 0.09


@pytest.mark.slow
def test_a_person_types_distances_and_is_told_which_are_missing(sensor: PtySensor, tmp_path: Path) -> None:
    answers = iter(["", "0", "x", "4", "8 mm", "1.2 cm", "q"])
    with subprocess.Popen(
        words(sensor, "sensor.csv"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    ) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        text = ""
        for answer in answers:
            while not text.endswith(("press Enter: ", "to end: ")):
                character = process.stderr.read(1)
                assert character, text
                text += character
            if answer[:1].isdigit():
                sensor.position.write_text("12" if "cm" in answer else answer.removesuffix(" mm"))
                time.sleep(0.1)
            process.stdin.write(f"{answer}\n")
            process.stdin.flush()
            text += "\n"
        out, rest = process.communicate(timeout=60)
        text += rest
    assert process.returncode == 1
    assert sorted({float(row[0]) for row in rows(tmp_path / "sensor.csv")}) == [0.0, 4.0, 8.0, 12.0, np.inf]
    assert "found 'x'" in text
    assert text.count("Missing distances:") >= 4
    assert "missing distances" in out


@pytest.mark.slow
def test_an_interrupted_recording_is_continued(sensor: PtySensor, tmp_path: Path) -> None:
    options = ["--distances", LIST, "--stage", sensor.stage]
    before = signals.signal(signals.SIGINT, signals.default_int_handler)
    with subprocess.Popen(
        words(sensor, "sensor.csv", *options),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    ) as process:
        signals.signal(signals.SIGINT, before)
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
        path = tmp_path / "sensor.csv"
        while not path.exists() or len({row[0] for row in rows(path)}) < 4:
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(signals.SIGINT)
        out, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out.startswith("Interrupted.")
    kept = rows(path)
    with path.open("a") as file:
        file.write("11,41")  # a line that the end of the program cut off
    refused = record(sensor, tmp_path, "sensor.csv", *options)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "--resume" in refused.stderr
    done = record(sensor, tmp_path, "sensor.csv", *options, "--resume", "--all")
    assert done.returncode == 0, done.stderr
    assert "incomplete" in done.stdout
    continued = rows(path)
    assert continued[: len(kept)] == kept
    counts = {distance: [row[0] for row in continued].count(distance) for distance in {row[0] for row in continued}}
    assert counts == dict.fromkeys(["inf", *LIST.removesuffix(" mm").split(", ")], 10)
    assert sum(line.startswith("distance") for line in path.read_text().splitlines()) == 1


@pytest.mark.slow
def test_a_scenario_decides_what_is_enough(sensor: PtySensor, tmp_path: Path) -> None:
    (tmp_path / "approach.toml").write_text(SCENARIO)
    options = ["approach.toml", "--stage", sensor.stage, "--json"]
    short = json.loads(record(sensor, tmp_path, *options, "--distances", "2, 5, 9, 14, 20 mm").stdout)
    assert short["status"] == "not-enough"
    assert short["missing_distances"][-1] == pytest.approx(0.032)  # 30 mm and the recess
    more = ["--distances", "2, 5, 9, 14, 20, 26, 32, 45, 55 mm", "--resume"]
    done = record(sensor, tmp_path, *options, *more)
    result = json.loads(done.stdout)
    assert (done.returncode, result["status"]) == (0, "enough")
    assert result["distances"][-1] == pytest.approx(0.032)  # although the list goes on
    assert pt.design(pt.load_scenario(tmp_path / "approach.toml")).status == "optimal"


@pytest.mark.slow
def test_columns_on_standard_input_bring_their_distance_and_none_is_lost(tmp_path: Path) -> None:
    lines = ["mm,output", *(f"{d / 20:.2f},{OFFSET + signal(d / 20e3):.0f}" for d in range(1200))]
    lines += ["inf,600", "inf,603", ",598", "noise", "3.0,41"]
    text = "\n".join(lines)  # without a line end, so that the last number may be cut off
    flags = ["--stdin", "--distance-column", "mm", "--column", "output", "--unit", "counts", "--json"]
    words = [sys.executable, "-m", "pretouch", "record", "sensor.csv", *flags]
    done = subprocess.run(words, input=text, capture_output=True, text=True, check=False, cwd=tmp_path)
    result = json.loads(done.stdout)
    assert (done.returncode, result["status"]) == (0, "enough"), done.stderr
    assert (result["readings"], result["no_object_readings"], result["received"]) == (1200, 3, 1203)
    assert [float(row[0]) for row in rows(tmp_path / "sensor.csv")][:1200] == [d / 20 for d in range(1200)]
    assert pt.read_calibration(tmp_path / "sensor.csv").unit == "counts"
    assert len(result["notes"]) == 2  # a line without a reading, and the one that is cut off


# --- faults of the connection


def test_an_unplugged_sensor_is_one_sentence_and_the_readings_are_kept(sensor: PtySensor, tmp_path: Path) -> None:
    path = tmp_path / "sensor.csv"

    def unplug() -> None:
        while not path.exists() or len(rows(path)) < 35:
            time.sleep(0.01)
        sensor.unplug()

    thread = threading.Thread(target=unplug)
    thread.start()
    done = record(sensor, tmp_path, "sensor.csv", "--distances", LIST, "--stage", sensor.stage)
    thread.join()
    assert (done.returncode, done.stdout) == (2, "")
    message = done.stderr.splitlines()[-1]
    assert message.startswith(f"pretouch: {sensor.port}: ")
    assert "--resume" in message
    assert "Traceback" not in done.stderr
    assert len(rows(path)) >= 35
    assert len(rows(tmp_path / "sensor-raw.csv")) >= len(rows(path))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("data", "word"),
    [
        (bytes([0xFE, 0x06, 0x9E, 0x00, 0xF8, 0x66, 0x80, 0x0A]) * 16, "--baud"),
        (b"sensor failed\r\n" * 16, "sensor failed"),
        (b"12 " * 4, "line end"),
        (b"", "nothing"),
    ],
    ids=["wrong baud rate", "garbage", "no line ends", "silence"],
)
def test_a_source_without_readings_says_why_and_leaves_no_files(
    data: bytes, word: str, sensor: PtySensor, tmp_path: Path
) -> None:
    sensor.is_sending = False
    stop = threading.Event()

    def send() -> None:
        while not stop.wait(0.05):
            sensor.send(data)

    thread = threading.Thread(target=send)
    thread.start()
    done = record(sensor, tmp_path, "sensor.csv", "--timeout", "1.5 s")
    stop.set()
    thread.join()
    assert (done.returncode, done.stdout) == (2, "")
    assert word in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.glob("*.csv"))


def test_a_sensor_that_falls_silent_is_reported(sensor: PtySensor, tmp_path: Path) -> None:
    def silence() -> None:
        while not (tmp_path / "sensor.csv").exists() or len(rows(tmp_path / "sensor.csv")) < 25:
            time.sleep(0.01)
        sensor.is_sending = False

    thread = threading.Thread(target=silence)
    thread.start()
    done = record(sensor, tmp_path, "sensor.csv", "--distances", LIST, "--stage", sensor.stage, "--timeout", "1 s")
    thread.join()
    assert done.returncode == 2
    assert "no reading for 1 s" in done.stderr


@pytest.mark.slow
def test_lines_that_are_no_readings_are_skipped_and_counted(tmp_path: Path) -> None:
    def line(output: int, number: int) -> bytes:
        return b"\xff\x00?\n" if number % 50 == 7 else b"%d\n" % output

    with PtySensor(tmp_path, line=line) as sensor:
        options = ["--distances", "0, 5, 10, 15, 20 mm", "--stage", sensor.stage, "--json"]
        result = json.loads(record(sensor, tmp_path, "sensor.csv", *options).stdout)
    assert result["readings"] == 50
    (note,) = result["notes"]
    assert "skipped" in note
    outputs = [float(row[2]) for row in rows(tmp_path / "sensor-raw.csv")]
    assert min(outputs) > OFFSET - 60  # nothing of the skipped lines was read as a number


@pytest.mark.slow
def test_no_line_is_lost_at_1_khz(tmp_path: Path) -> None:
    """Two seconds and more; `python -m benchmarks.recording` does the same for a minute."""
    with PtySensor(tmp_path, rate=1000.0, line=lambda _, number: b"%d\n" % (number * STEP % CYCLE)) as sensor:
        options = ["--distances", "0 mm", "--readings", "10", "--dwell", "2 s", "--no-empty-scene"]
        done = record(sensor, tmp_path, "sensor.csv", *options, "--stage", sensor.stage)
    assert done.returncode == 1, done.stderr
    numbers = np.array([int(row[2]) for row in rows(tmp_path / "sensor-raw.csv")])
    assert set(np.diff(numbers) % CYCLE) == {STEP}
    assert len(numbers) > 1000


# --- faults of the request


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    monkeypatch.chdir(tmp_path)
    return command(monkeypatch, capsys)


class Port:
    """A port as pyserial lists it."""

    def __init__(self, device: str, description: str, hwid: str = "USB VID:PID=2341:0043") -> None:
        self.device, self.description, self.hwid = device, description, hwid


@pytest.mark.parametrize(
    ("ports", "words"),
    [
        (
            [Port("/dev/ttyACM0", "Arduino Uno"), Port("/dev/ttyUSB0", "CP2102")],
            ["/dev/ttyACM0 (Arduino Uno)", "CP2102"],
        ),
        ([Port("/dev/ttyS0", "n/a", "n/a")], ["no serial port"]),
    ],
    ids=["two devices", "none"],
)
def test_without_port_the_devices_are_listed(
    ports: list[Port], words: list[str], run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)
    code, out, err = run("record", "sensor.csv")
    assert (code, out) == (2, "")
    assert all(word in err for word in ["--port", *words])
    assert not list(Path().glob("*.csv"))


@pytest.mark.parametrize(
    ("number", "word"), [(13, "dialout"), (2, "connected devices"), (16, "another program"), (5, "cannot be opened")]
)
def test_a_port_that_cannot_be_opened_says_what_to_do(
    number: int, word: str, run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    import serial

    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(number, os.strerror(number))

    monkeypatch.setattr("serial.Serial", refuse)
    code, out, err = run("record", "sensor.csv", "--port", "/dev/ttyUSB7")
    assert (code, out) == (2, "")
    assert word in err
    assert err.count("\n") == 1


def test_a_port_that_does_not_exist_is_a_mistake(run: Any) -> None:
    code, _, err = run("record", "sensor.csv", "--port", "/dev/ttyNOTHING", "--json")
    assert code == 2
    assert "connected devices" in err


@pytest.mark.parametrize(
    ("module", "words", "extra"), [("serial", ["--port", "x"], "record"), ("cyclonedds", ["--topic", "/x"], "ros")]
)
def test_a_missing_package_is_one_sentence(
    module: str, words: list[str], extra: str, run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    code, _, err = run("record", "sensor.csv", *words)
    assert code == 2
    assert f"pretouch[{extra}]" in err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["exists.csv"], "exists.csv"),
        (["other.csv"], "other-raw.csv"),
        (["exists.csv", "--resume"], "not written by pretouch record"),
        (["no.csv", "--resume"], "does not exist"),
        (["no/sensor.csv"], "no/sensor.csv"),
        (["no.toml"], "no.toml"),
        (["curve.toml"], "calibration"),
        (["sensor.csv", "--stage", "move {mm}"], "--distances"),
        (["sensor.csv", "--stage", "move", "--distances", "5 mm"], "{mm}"),
        (["sensor.csv", "--distances", "5 kg"], "5 kg"),
        (["sensor.csv", "--distances", "-5 mm"], "-5 mm"),
        (["sensor.csv", "--distance-column", "2", "--distances", "5 mm"], "--distance-column"),
        (["sensor.csv", "--stdin", "--i2c", "VCNL4040"], "--stdin"),
        (["sensor.csv", "--i2c", "VL53L0X"], "VCNL4010"),
        (["sensor.csv", "--i2c", "VCNL4040", "--bus", "250"], "/dev/i2c-250"),
        (["sensor.csv", "--accuracy", "0 %"], "--accuracy"),
        (["sensor.csv", "--distance-column", "2", "--distance-unit", "kg"], "kg"),
    ],
)
def test_a_mistake_is_one_sentence_and_writes_nothing(words: list[str], told: str, run: Any, tmp_path: Path) -> None:
    Path("exists.csv").write_text("a,b\n1,2\n")
    Path("other-raw.csv").write_text("mine\n")
    Path("curve.toml").write_text(
        SCENARIO.replace('calibration = "sensor.csv"', 'model = "exponential-1"\nscale = 1\nrate = "-60 1/m"')
    )
    before = {path.name: path.read_text() for path in tmp_path.iterdir()}
    sensor = PtySensor(tmp_path)
    before |= {"stage.sh": (tmp_path / "stage.sh").read_text()}
    more = [] if "--i2c" in words else ["--port", sensor.port]
    code, out, err = run("record", *words, *more)
    os.close(sensor._slave)
    os.close(sensor._master)
    assert (code, out) == (2, "")
    assert err.startswith("pretouch: ")
    assert told in err
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == before


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("stage", "word"), [("false {mm}", "status 1"), ("no-such-command {mm}", "not found")], ids=["fails", "missing"]
)
def test_a_stage_that_fails_ends_the_recording(stage: str, word: str, sensor: PtySensor, tmp_path: Path) -> None:
    done = record(sensor, tmp_path, "sensor.csv", "--distances", "5 mm", "--stage", stage)
    assert (done.returncode, done.stdout) == (2, "")
    assert word in done.stderr


def test_a_file_of_another_unit_is_not_continued(tmp_path: Path) -> None:
    file = RecordFile(tmp_path / "sensor.csv", unit="V", origin="a test", resume=False)
    file.add(0.005, 1.25)
    file.add_raw(0.0, 0.005, 1.25)
    file.close()
    with refused("--unit"):
        RecordFile(tmp_path / "sensor.csv", unit="counts", origin="a test", resume=True)
    again = RecordFile(tmp_path / "sensor.csv", unit=None, origin="a test", resume=True)
    again.close()
    assert (again.unit, again.count(0.005), again.distances) == ("V", 1, (0.005,))


# --- the page, and the terminal


def page_rows() -> str:
    """Return the table of a bench that the page reads from standard input: 61 distances, then the empty scene."""
    random = np.random.default_rng(5)
    places = [*np.repeat(np.arange(61.0), 10), *[math.inf] * 20]
    outputs = [OFFSET + signal(d / 1000) + 6 * random.standard_normal() for d in places]
    return "".join(f"{d:g},{y:.0f}\n" for d, y in zip(places, outputs, strict=True))


@pytest.mark.slow
def test_the_sessions_of_the_page_run(sensor: PtySensor, tmp_path: Path) -> None:
    sessions = re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
    assert len(sessions) == 4
    for session in sessions:
        line, _, expected = session.partition("\n")
        words = shlex.split(line.partition(" < ")[0])[2:]
        if "--port" in words:
            words[words.index("--port") + 1] = sensor.port
            words += ["--stage", sensor.stage, "--dwell", "0.1 s"]
        done = subprocess.run(
            [sys.executable, "-m", "pretouch", *words],
            input=page_rows() if "<" in line else "\n",
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
        )
        assert done.returncode == 0, done.stderr
        pattern = re.escape(expected).replace("\\.\\.\\.\\\n", "(?s:.*)").replace(r"\.\.\.", r"\S+")
        assert re.fullmatch(pattern, done.stdout), done.stdout


def test_the_picture_of_the_page_is_what_the_terminal_shows() -> None:
    from rich.console import Console

    (picture,) = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
    display = LiveDisplay()
    rows = re.findall(r"^  (\d+ mm|empty scene) +(\S+) ± (\S+) +20$", picture, re.MULTILINE)
    for place, value, spread in rows:
        distance = math.inf if place == "empty scene" else float(place.removesuffix(" mm")) / 1000
        half = float(spread) / MAD_TO_SIGMA
        display.show_distance(distance, [float(value) - half] * 10 + [float(value) + half] * 10)
    display._now = picture.splitlines()[-1]
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(display._view())
    shown = [line.rstrip() for line in console.export_text().splitlines()]
    assert shown == picture.rstrip("\n").split("\n")


@pytest.mark.slow
def test_a_terminal_shows_the_live_value_and_the_curve(sensor: PtySensor, tmp_path: Path) -> None:
    master, slave = os.openpty()
    shown = bytearray()

    def follow() -> None:
        try:
            while data := os.read(master, 65536):
                shown.extend(data)
        except OSError:  # the other end is closed
            return

    thread = threading.Thread(target=follow)
    thread.start()
    options = ["sensor.csv", "--distances", "0, 5, 10 mm", "--stage", sensor.stage, "--dwell", "0.6 s"]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100", "LINES": "50"}
    subprocess.run(
        words(sensor, *options),
        input=b"\n",
        stdout=subprocess.DEVNULL,
        stderr=slave,
        check=False,
        cwd=tmp_path,
        env=environment,
    )
    os.close(slave)
    thread.join()
    os.close(master)
    text = shown.decode()
    assert "of 10 readings" in text
    assert "┤●" in text
    assert text.count("10 mm") > 1


# --- topics


DDS = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain>
</CycloneDDS>"""
PUBLISHER = """
import sys, time
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from pretouch.recording.sources.ros_messages import message_types
from pathlib import Path
from recording_bench import OFFSET, signal

stage, stop = map(Path, sys.argv[1:])
types = message_types()
participant = DomainParticipant(77)
writer = DataWriter(participant, Topic(participant, "rt/bench/proximity", types.Range))
number = 0
while not stop.exists():
    try:
        distance = float(stage.read_text()) / 1000
    except (OSError, ValueError):
        distance = float("inf")
    number += 1
    output = OFFSET + signal(distance) + (number * 7 % 11 - 5)  # repeats of a fixed spread
    header = types.Header(types.Time(number, 0), "sensor")
    writer.write(types.Range(header, 1, 0.1, 0.0, 1.0, output))
    time.sleep(0.005)
"""


@pytest.mark.slow
def test_a_live_topic_is_recorded_through_dds(tmp_path: Path) -> None:
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed (pip install pretouch[ros])")
    path = os.pathsep.join([str(ROOT / "tests"), str(ROOT / "src")])
    environment = {**os.environ, "CYCLONEDDS_URI": DDS, "ROS_DOMAIN_ID": "77", "PYTHONPATH": path}
    stage, stop = tmp_path / "stage.txt", tmp_path / "stop"
    script = tmp_path / "stage.py"
    script.write_text(f"import sys\nopen({str(stage)!r}, 'w').write(sys.argv[1])\n")
    publisher = subprocess.Popen([sys.executable, "-c", PUBLISHER, str(stage), str(stop)], env=environment)
    words = [sys.executable, "-m", "pretouch", "record", "sensor.csv", "--topic", "/bench/proximity"]
    words += ["--dwell", "0.1 s", "--readings", "10", "--unit", "counts", "--json", "--timeout", "2 s"]
    words += ["--distances", "0, 3, 6, 10 mm", "--stage", f"{sys.executable} {script} {{mm}}"]
    try:
        done = subprocess.run(
            words, input="\n", capture_output=True, text=True, check=False, cwd=tmp_path, env=environment
        )
        assert done.returncode == 1, done.stderr
        curve = pt.read_calibration(tmp_path / "sensor.csv")
        assert curve.distinct_distances.tolist() == [0.0, 0.003, 0.006, 0.01]
        for distance in curve.distinct_distances:
            outputs = curve.outputs[curve.distances == distance]
            assert np.abs(outputs - OFFSET - signal(distance)).max() < 5.01  # of the fixed spread, in single precision
        typed = ["silent.csv", "--distances", "0 mm", "--stage", f"touch {stop} {{mm}}", "--no-empty-scene"]
        silent = subprocess.run(
            [*words[:4], *typed, *words[5:-4]],
            input="",
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            env=environment,
        )
    finally:
        stop.touch()
        publisher.wait(timeout=30)
    assert silent.returncode == 2
    assert "no reading for 2 s" in silent.stderr
    assert "publisher" in silent.stderr


def test_a_topic_that_nobody_publishes_is_reported(tmp_path: Path) -> None:
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed (pip install pretouch[ros])")
    environment = {**os.environ, "CYCLONEDDS_URI": DDS, "ROS_DOMAIN_ID": "78"}
    words = [sys.executable, "-m", "pretouch", "record", "sensor.csv", "--topic", "/nothing"]
    done = subprocess.run(words, input="", capture_output=True, text=True, check=False, cwd=tmp_path, env=environment)
    assert (done.returncode, done.stdout) == (2, "")
    assert "rt/nothing" in done.stderr
