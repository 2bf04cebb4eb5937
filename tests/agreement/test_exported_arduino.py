"""The exported Arduino sketch commands what the law computes on a simulated board, and compiles for real processors."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from cortex_m import BOARDS, HERE, IS_INSTALLED, TOOLS, code_size, counts, run_on_board, target
from exported_designs import DESIGNS
from pretouch.control import Arrival, Limits, Status
from pretouch.errors import InvalidInputError
from pretouch.exports import export
from pretouch.exports.arduino import DRIVERS, measuring_period
from pretouch.exports.law_source import SOURCE, law_text
from pretouch.recording import read_recording, replay
from pretouch.verification.verdict import chosen_gain

ROOT = Path(__file__).parents[2]
BOARD = ROOT / "tests/firmware"
FIRMWARE = ROOT / "examples/firmware"
WARNINGS = "-Wall -Wextra -Werror"
CHECKS = 128  # steps with which the sketch measures their time before it starts
VCNL4010 = ["13", "1", "0", "81=21"]
FILLED_IN = """
  int32_t values[2];
  memcpy(values, bytes, 8);
  printf("frame %x %d %d %d\\n", (unsigned)id, (int)length, (int)values[0], (int)values[1]);
  return true;
}
"""
OWN_SENSOR = """extern float own_reading;
bool pretouch_start_sensor() { return true; }
bool pretouch_read_sensor(uint32_t, pretouch_reading &reading) {
  reading.value = own_reading;
  reading.is_new = true;
  return true;
}
#endif
"""


def ranging(path: Path) -> pt.Task:
    """The loop example with a sensor of distances."""
    text = (ROOT / "examples/loop.toml").read_text()
    start, end = text.index("[chain]"), text.index("[controller]")
    text = text[:start] + '[chain]\npart = "VL53L0X"\nrate = "25 Hz"\n' + text[end:]
    path.write_text(text)
    return pt.load_scenario(path).replace(gain=-0.86)


@pytest.fixture(scope="module")
def compiler() -> None:
    """What `board` calls."""
    if shutil.which("gcc") is None or shutil.which("g++") is None:
        pytest.skip("gcc or g++ is not installed")


@pytest.fixture(scope="module")
def libraries(compiler: None, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[pt.Task, Path]]:
    """Exports of the examples as libraries. Tests change copies only."""
    root = tmp_path_factory.mktemp("libraries")
    tasks = {"damper": DESIGNS["damper"](), "drag": DESIGNS["drag"](), "ranging": ranging(root / "ranging.toml")}
    for name, task in tasks.items():
        assert export(task, root / name, "arduino", verify=False).is_written
    return {name: (task, root / name) for name, task in tasks.items()}


def sketch(folder: Path) -> Path:
    (path,) = (folder / "examples").glob("*/*.ino")
    return path


def filled_in(folder: Path) -> str:
    """The text of the sketch with the functions that a user fills in."""
    text = sketch(folder).read_text()
    empty = "\n  (void)id, (void)bytes, (void)length;\n  return false;\n}\n"
    assert text.count(empty) == 1
    text = text.replace(empty, FILLED_IN)
    start = text.index("// Fill in: set up your sensor")
    end = text.index("#endif\n", start) + len("#endif\n")
    return text[:start] + OWN_SENSOR + text[end:]


def board(folder: Path, made: Path, *defines: str) -> Path:
    """Build the sketch for the simulated board, on which each step of the law is printed."""
    program, source = made / "program", made / "sketch.cpp"
    source.write_text("#include <Arduino.h>\n" + filled_in(folder))
    include = [f"-I{BOARD}", f"-I{folder / 'src'}"]
    c_files = [str(folder / "src/pretouch_law.c"), str(BOARD / "recorded_step.c")]
    objects = []
    for path in c_files:
        objects.append(str(made / f"{Path(path).stem}.o"))
        subprocess.run(["gcc", "-std=gnu11", "-O2", *include, "-c", path, "-o", objects[-1]], check=True)
    options = ["-std=gnu++11", "-O2", *WARNINGS.split(), *(f"-D{each}" for each in defines), *include]
    wrap = ["-Wl,--wrap=pretouch_step"]
    subprocess.run(
        ["g++", *options, str(source), str(BOARD / "board.cpp"), *objects, *wrap, "-o", str(program)], check=True
    )
    return program


@pytest.fixture(scope="module")
def can_board(libraries: dict[str, tuple[pt.Task, Path]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The damper on the simulated board, with the sensor of its scenario and CAN frames."""
    return board(libraries["damper"][1], tmp_path_factory.mktemp("board"), "REFERENCE=PRETOUCH_CAN")


@dataclass
class Run:
    """What a sketch printed: each step of the law, each frame with the number of steps before it, and its log."""

    steps: np.ndarray
    frames: np.ndarray
    lines: list[str]

    @property
    def log(self) -> str:
        return "\n".join(self.lines[1:]) + "\n"  # without the baud rate

    def counted(self, name: str) -> int:
        return sum(int(number) for number in re.findall(rf"{name} (\d+)", "\n".join(self.lines)))


def run(program: Path, words: list[str], events: str, status: int = 0, **environment: str) -> Run:
    done = subprocess.run(
        [str(program), *words], input=events, capture_output=True, text=True, check=False, env=environment, timeout=60
    )
    assert done.returncode == status, done.stderr
    steps, frames, lines = [], [], []
    for line in done.stdout.splitlines():
        kind, *values = line.split()
        if kind == "step":
            steps.append([float(value) for value in values])
        elif kind == "frame":
            assert values[:2] == ["100", "8"]
            frames.append([len(steps), *map(int, values[2:])])
        else:
            lines.append(line.partition(" @")[0])
    return Run(np.array(steps), np.array(frames), lines)


def approach(folder: Path, more: str = "", until: int | None = None) -> str:
    """Events of the simulated approach of the test vectors: its readings in the result register of the VCNL4010."""
    text = [line for line in (folder / "extras/vectors.csv").read_text().splitlines() if not line.startswith("#")]
    rows = [row for row in csv.DictReader(text) if row["case"] == "0"]
    events = [(1000 * k, f"word87 {float(row['reading']):.0f}") for k, row in enumerate(rows) if row["fresh"] == "1"]
    events += [(int(line.split()[0]), line.split(maxsplit=1)[1]) for line in more.splitlines()]
    events.sort(key=lambda event: event[0])
    return "\n".join(f"{at} {what}" for at, what in events) + f"\n{until or 1000 * len(rows)} end 0\n"


def expected(task: pt.Task, steps: np.ndarray) -> np.ndarray:
    """Position and velocity that the law of the package computes in double precision, from the same samples."""
    controller: Any = task.loop.law
    law = controller.with_value(chosen_gain(task)).begin()
    outputs = [law.step(reading, fresh == 1, age) for reading, age, fresh in steps[:, :3]]
    return np.array([[out.position, out.velocity, float(out.status)] for out in outputs])


def check_against_the_law(task: pt.Task, seen: Run) -> np.ndarray:
    """Compare steps and frames with the law, and return the steps after the sketch began."""
    steps = seen.steps[CHECKS:]
    reference = expected(task, steps)
    for column, of in ((0, 3), (1, 4)):
        largest = np.max(np.abs(reference[:, column]))
        assert np.max(np.abs(steps[:, of] - reference[:, column])) <= 1e-4 * largest
    np.testing.assert_array_equal(steps[:, 6], reference[:, 2])
    moving = seen.frames[seen.frames[:, 0] < len(seen.steps)]
    at = moving[:, 0] - 1  # the step before each frame
    np.testing.assert_allclose(moving[:, 1], 1e6 * seen.steps[at, 3], atol=1)
    np.testing.assert_allclose(moving[:, 2], 1e6 * seen.steps[at, 4], atol=1)
    return steps


def test_the_references_are_those_of_the_law_on_a_simulated_approach(
    can_board: Path, libraries: dict[str, tuple[pt.Task, Path]]
) -> None:
    task, folder = libraries["damper"]
    events = approach(folder)
    seen = run(can_board, VCNL4010, events)
    steps = check_against_the_law(task, seen)
    assert len(seen.frames) == len(steps)  # one frame per period
    assert abs(len(steps) - int(events.splitlines()[-1].split()[0]) / 1000) <= 1
    fresh = steps[steps[:, 2] == 1]
    assert abs(len(fresh) - len(steps) / 4) <= 1  # 250 readings at 1 kHz
    latency = task.loop.chain.latency
    assert np.all((fresh[:, 1] >= latency * (1 - 1e-6)) & (fresh[:, 1] <= latency + 0.001))
    assert np.min(steps[:, 3]) < -0.005  # it retreats
    assert seen.counted("late periods") == 0
    assert not any("stopped" in line for line in seen.lines)


def test_missed_periods_are_made_up_for_and_said(can_board: Path, libraries: dict[str, tuple[pt.Task, Path]]) -> None:
    task, folder = libraries["damper"]
    events = approach(folder, "20500 late 3700\n60200 late 900\n90900 late 12000\n", until=1_500_000)
    seen = run(can_board, VCNL4010, events)
    steps = check_against_the_law(task, seen)
    assert abs(len(steps) - 1500) <= 1  # as many as periods
    missed = len(steps) - len(seen.frames)
    assert 12 <= missed <= 17
    assert seen.counted("late periods") == missed


def test_the_time_of_the_board_may_restart(can_board: Path, libraries: dict[str, tuple[pt.Task, Path]]) -> None:
    """`micros` restarts at 2^32; the same approach gives the same steps."""
    events = approach(libraries["damper"][1])
    plain = run(can_board, VCNL4010, events)
    wrapped = run(can_board, VCNL4010, events, START_US=str(2**32 - 300_000))
    np.testing.assert_allclose(wrapped.steps, plain.steps, rtol=1e-5, atol=1e-9)
    assert wrapped.counted("late periods") == 0


@pytest.mark.usefixtures("compiler")
@pytest.mark.parametrize("rate", ["1 kHz", "250 Hz"], ids=["fast", "slow"])
def test_every_reading_counts_if_the_law_is_as_fast_as_the_sensor(rate: str, tmp_path: Path) -> None:
    """A reading that arrives while the next period is due already does not replace the one that this period takes."""
    text = (ROOT / "examples/loop.toml").read_text().replace('part = "VCNL4010"', f'rate = "{rate}"')
    path = tmp_path / "loop.toml"
    path.write_text(text.replace('rate = "1 kHz"\nfloor', f'rate = "{rate}"\nfloor'))
    task = pt.load_scenario(path).replace(gain=-0.86)
    assert export(task, tmp_path / "law", "arduino", verify=False).is_written
    program = board(tmp_path / "law", tmp_path, "REFERENCE=PRETOUCH_CAN", "READING_PER_COUNT=1")
    events = "".join(f"{700 * k} analog {200 + 10 * k}\n" for k in range(800))
    seen = run(program, ["0", "1", "0"], events + "560000 end 0\n")
    steps = check_against_the_law(task, seen)
    assert np.mean(steps[:, 2]) > 0.98
    assert np.all(steps[:, 1] < task.loop.chain.latency + 1.2 * task.loop.law.period)


@pytest.mark.parametrize("limit", [None, 2.0], ids=["no-limit", "limited"])
def test_a_sensor_that_stops_answering_holds_the_reference(
    limit: float | None, can_board: Path, libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path
) -> None:
    task, folder = libraries["damper"]
    if limit is not None:
        controller = task.loop.law
        limits = Limits(force=60.0, acceleration=limit, excursion=0.25)
        task = task.replace(loop=replace(task.loop, law=replace(controller, limits=limits)))
        folder = tmp_path / "law"
        assert export(task, folder, "arduino", verify=False).is_written
        can_board = board(folder, tmp_path, "REFERENCE=PRETOUCH_CAN")
    events = approach(folder, "80000 silent 0\n", until=1_600_000)
    seen = run(can_board, VCNL4010, events)
    steps = check_against_the_law(task, seen)
    timeout = 0.04
    assert int(steps[-1, 6]) & Status.LOST
    assert abs(len(steps) - 80 - 1000 * timeout) <= 6
    after = seen.frames[len(steps) - 1 :]
    assert len(seen.frames) > 1500  # the reference is still written
    speed = np.abs(after[:, 2])
    assert speed[0] > 0
    assert speed[-1] == 0
    assert np.all(np.diff(speed) <= 0)
    stopped = int(np.argmax(speed == 0))
    if limit is None:
        assert stopped == 1
    else:
        assert np.all(np.abs(np.diff(speed[:stopped])) <= 1000 * limit + 1)
        assert stopped > 1
    assert np.all(after[stopped:, 1] == after[stopped, 1])
    assert sum("# stopped: no usable reading for 40 ms" in line for line in seen.lines) == 1
    assert any("VCNL4010 does not answer" in line for line in seen.lines)


def test_a_sensor_that_is_missing_at_the_start_is_said_and_nothing_is_commanded(can_board: Path) -> None:
    seen = run(can_board, ["55", "1", "0"], "", status=3)
    assert len(seen.steps) == CHECKS
    assert len(seen.frames) == 0
    assert sum("VCNL4010 does not answer: check wiring and supply" in line for line in seen.lines) == 60


def test_a_board_that_is_too_slow_does_not_start(can_board: Path) -> None:
    seen = run(can_board, VCNL4010, "", status=3, STEP_US="1100")
    assert len(seen.frames) == 0
    assert seen.lines[1] == "# a step takes up to 1104 us of a period of 1000 us"
    assert seen.lines[2].startswith("# too slow")


def test_a_slow_board_keeps_the_time(can_board: Path, libraries: dict[str, tuple[pt.Task, Path]]) -> None:
    """Steps of 700 us leave too little time for each reading, so some periods are late; none is lost."""
    task, folder = libraries["damper"]
    events = approach(folder, until=1_200_000)
    seen = run(can_board, VCNL4010, events, STEP_US="700")
    steps = check_against_the_law(task, seen)
    assert abs(len(steps) - 1200) <= 2


def test_readings_that_are_not_a_number_are_refused(libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path) -> None:
    task, folder = libraries["damper"]
    program = board(folder, tmp_path, "REFERENCE=PRETOUCH_CAN", "SENSOR=PRETOUCH_OWN_SENSOR")
    events = approach(folder, "60000 own nan\n90000 own inf\n").replace("word87", "own")
    brief = re.sub(r"^(6\d|7\d|8\d)000 own \d+$", "", events, flags=re.MULTILINE)
    brief = re.sub(r"^9\d000 own inf\n", "", brief, flags=re.MULTILINE)
    seen = run(program, ["0", "1", "0"], brief)
    steps = check_against_the_law(task, seen)
    assert np.isnan(steps[:, 0]).sum() >= 5
    assert any(int(status) & Status.INVALID for status in steps[:, 6])
    assert not any("stopped" in line for line in seen.lines)
    forever = "0 own 200\n100000 own nan\n1500000 end 0\n"
    seen = run(program, ["0", "1", "0"], forever)
    assert any("# stopped" in line for line in seen.lines)
    assert np.all(np.isfinite(seen.steps[:, 3:6]))


def test_replay_reads_the_log(can_board: Path, libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path) -> None:
    task, folder = libraries["damper"]
    before = "".join(f"{1000 * k} word87 160\n" for k in range(0, 400, 4))
    shifted = [line.split(maxsplit=1) for line in approach(folder).splitlines()]
    shifted.insert(20, ["70500", "late 2600"])
    events = before + "".join(f"{int(at) + 400_000} {what}\n" for at, what in shifted)
    seen = run(can_board, VCNL4010, events.replace(events.splitlines()[-1], "1500000 end 0"))
    assert sum(line.startswith("#") for line in seen.lines) == 2  # before the header, and late periods
    log = tmp_path / "log.csv"
    log.write_text(seen.log)
    recording = read_recording(str(log), "reading")
    result = replay(task, recording)
    fresh = seen.steps[CHECKS:][seen.steps[CHECKS:, 2] == 1]
    missing = len(fresh) - len(recording.values)
    assert missing <= 1  # there may be no room for a line after the one on late periods
    np.testing.assert_array_equal(recording.values[:240], fresh[:240, 0])
    np.testing.assert_array_equal(recording.values[-100:], fresh[-100:, 0])
    assert result.timing.rate == pytest.approx(250.0, rel=1e-3)
    (first, *_) = result.detections
    detecting = np.flatnonzero(seen.steps[CHECKS:, 6].astype(int) & Status.DETECTING)
    assert first.start == pytest.approx(1e-3 * detecting[0], abs=0.005)


@pytest.mark.parametrize("part", DRIVERS)
def test_a_driver_has_the_lines_of_its_sketch_for_recording(
    part: str, libraries: dict[str, tuple[pt.Task, Path]]
) -> None:
    header = (libraries["damper"][1] / "src" / DRIVERS[part]).read_text()
    name = DRIVERS[part].removeprefix("pretouch_").removesuffix(".h")
    recording = (FIRMWARE / name / f"{name}.ino").read_text()
    driver = header.partition("for recording ----\n")[2].partition("// ---- end of the driver")[0]
    assert driver.count("\n") > 20
    assert driver.strip() in recording
    source = header.split("//\n", 1)[1].partition("#pragma")[0]
    assert source in recording
    period = re.search(r"PERIOD_US = (\d+);", recording)
    assert period is not None
    assert int(period[1]) == round(1e6 * measuring_period(part))


@pytest.mark.slow(keep=3)
@pytest.mark.parametrize("design", ["damper", "ranging"])
@pytest.mark.parametrize("sensor", ["VCNL4040", "VCNL4010", "APDS9960", "VL53L0X", "ANALOG_PIN", "OWN_SENSOR"])
def test_every_sensor_and_output_compiles_or_is_refused(
    sensor: str, design: str, libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path
) -> None:
    _, folder = libraries[design]
    source = tmp_path / "sketch.cpp"
    source.write_text("#include <Arduino.h>\n" + filled_in(folder))
    outputs = ["LOG_ONLY", "STEP_DIRECTION", "SERVO", "SERIAL", "CAN"]
    for output in outputs if sensor in {"VL53L0X", "OWN_SENSOR"} else outputs[:1]:
        flags = [f"-DSENSOR=PRETOUCH_{sensor}", f"-DREFERENCE=PRETOUCH_{output}", "-DREADING_PER_COUNT=1"]
        command = ["g++", "-std=gnu++11", *WARNINGS.split(), "-fsyntax-only", f"-I{BOARD}", f"-I{folder / 'src'}"]
        done = subprocess.run([*command, *flags, str(source)], capture_output=True, text=True, check=False)
        too_slow = design == "damper" and sensor in {"VCNL4040", "APDS9960", "VL53L0X"}  # 250 readings per second
        no_distance = design == "ranging" and sensor not in {"VL53L0X", "OWN_SENSOR"}
        assert ("needs longer for a reading" in done.stderr) == too_slow
        assert ("readings of this design are distances" in done.stderr) == no_distance
        assert (done.returncode == 0) != (too_slow or no_distance), done.stderr


@pytest.mark.usefixtures("compiler")
def test_an_analog_sensor_needs_the_unit_of_its_counts(tmp_path: Path) -> None:
    """Without a part or a calibration, nobody knows whether the readings of the file are counts."""
    text = (ROOT / "examples/loop.toml").read_text().replace('part = "VCNL4010"', 'rate = "250 Hz"')
    path = tmp_path / "loop.toml"
    path.write_text(text)
    assert export(pt.load_scenario(path).replace(gain=-0.86), tmp_path / "law", "arduino", verify=False).is_written
    source = sketch(tmp_path / "law")
    assert "#define SENSOR PRETOUCH_ANALOG_PIN" in source.read_text()
    assert "#define READING_DIGITS 5" in source.read_text()  # a reading in V has digits in the log
    command = ["g++", "-std=gnu++11", "-fsyntax-only", f"-I{BOARD}", f"-I{tmp_path / 'law/src'}", "-x", "c++"]
    command += ["-include", "Arduino.h", str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "Define READING_PER_COUNT" in done.stderr
    subprocess.run([*command, "-DREADING_PER_COUNT=3.3f / 4095"], check=True)


def test_a_rate_that_the_driver_does_not_reach_is_refused_before_the_simulation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pretouch.exports.law_design.verdict_on", lambda *_, **__: pytest.fail("verified"))
    path = tmp_path / "fast.toml"
    ranging(path)
    path.write_text(path.read_text().replace('rate = "25 Hz"\n', ""))  # 50 Hz, as in the data sheet
    with pytest.raises(InvalidInputError, match="25 Hz") as refused:
        export(pt.load_scenario(path).replace(gain=-0.86), tmp_path / "law", "arduino")
    assert refused.value.value == 50
    assert "fast.toml" in str(refused.value)
    assert not (tmp_path / "law").exists()


def test_distances_are_converted_by_the_sensor_curve(
    libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path
) -> None:
    """An object that vanishes within the range causes no force toward it."""
    task, folder = libraries["ranging"]
    program = board(folder, tmp_path, "REFERENCE=PRETOUCH_CAN")
    distances = [8190, 60, 40, 30, 25, 22, 8190, 8190, 8190, 26, 24]
    events = "".join(f"{80_000 * k} word1e {mm}\n" for k, mm in enumerate(distances)) + "880000 end 0\n"
    seen = run(program, ["29", "1", "0", "c0=ee", "14=01"], events)
    steps = seen.steps[CHECKS:]
    fresh = steps[steps[:, 2] == 1]
    sensor, offset = task.sensor, task.loop.law.conditioning.offset
    read = dict.fromkeys(np.round(fresh[:, 0] - offset, 3))
    curve = [float(np.exp(sensor.log_output(mm * 1e-3))) for mm in (40, 30, 25, 22)]
    assert all(min(abs(value / each - 1) for value in read if value > 0) < 2e-3 for each in curve)
    seen_distances = len(distances) - distances.count(8190)
    assert abs(len(fresh) - 2 * seen_distances) <= 2
    assert abs(np.sum(steps[:, 2] == Arrival.NO_OBJECT) - 2 * distances.count(8190)) <= 2
    assert np.min(steps[:, 4]) < 0
    assert not any("stopped" in line for line in seen.lines)  # the sensor works although it sees nothing
    pushes = steps[np.diff(steps[:, 4], prepend=0) > 0]
    assert np.all(pushes[:, 3] < 0)  # it comes back to its reference, and is never pulled beyond it
    assert "time_us,distance_mm,position_um" in seen.log


def printed_by(program: Path, events: str) -> list[list[str]]:
    """The words of each line that a sketch prints after it began."""
    done = subprocess.run([str(program), *VCNL4010], input=events, capture_output=True, text=True, check=True)
    return [line.split() for line in done.stdout.partition("time_us,")[2].splitlines()[1:]]


def test_pulses_of_a_stepper_follow_the_position(libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path) -> None:
    """They are at most two periods behind, as pulses wait for the bus of the sensor."""
    task, folder = libraries["damper"]
    lines = printed_by(board(folder, tmp_path, "REFERENCE=PRETOUCH_STEP_DIRECTION"), approach(folder))
    steps = pulses = 0
    direction, behind, position, fastest = 0, 0.0, 0.0, 0.0
    for words in lines:
        if words[0] == "step":
            behind = max(behind, abs(steps - 80_000 * position))
            position = float(words[4])
            fastest = max(fastest, abs(float(words[5])))
        elif words[:2] == ["pin", "3"]:
            direction = 1 if words[2] == "1" else -1
        elif words[:3] == ["pin", "2", "1"]:
            steps += direction
            pulses += 1
    assert pulses > 1000
    assert behind <= 2 + 80_000 * fastest * 2 * task.loop.law.period
    assert position < -0.01


def test_a_servo_gets_the_pulse_of_the_position_within_its_limits(
    libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path
) -> None:
    _, folder = libraries["damper"]
    position, pulses = 0.0, 0
    for words in printed_by(board(folder, tmp_path, "REFERENCE=PRETOUCH_SERVO"), approach(folder)):
        if words[0] == "step":
            position = float(words[4])
        elif words[0] == "pulse":
            pulses += 1
            assert abs(int(words[1]) - min(max(1500 + 5000 * position, 1000), 2000)) <= 1
    assert pulses > 100
    assert position < -0.01


def test_the_serial_reference_has_a_line_of_position_and_velocity(
    libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path
) -> None:
    """At 115200 baud, there is no room for a line of every period; lines that are left out are counted."""
    _, folder = libraries["damper"]
    program = board(folder, tmp_path, "REFERENCE=PRETOUCH_SERIAL")
    output, written, left_out, steps = (0.0, 0.0), 0, 0, 0
    for words in printed_by(program, approach(folder, until=1_050_000)):
        if words[0] == "step":
            output, steps = (float(words[4]), float(words[5])), steps + 1
        elif re.fullmatch(r"-?\d+,-?\d+", words[0]):
            written += 1
            np.testing.assert_allclose([int(each) for each in words[0].split(",")], 1e6 * np.array(output), atol=1)
        elif words[0] == "#":
            left_out += int(words[words.index("written") + 1].rstrip(","))
    assert written > 400
    assert left_out > 100
    assert 0 <= steps - written - left_out <= 50  # those of the last 50 ms are not yet counted


def documented(board: str, design: str) -> dict[str, int]:
    """What the page promises at most for this processor and law."""
    page = (ROOT / "docs/how-to/export/arduino.md").read_text(encoding="utf-8")
    row = re.search(
        rf"^\| [^|]*\| {re.escape(board)} \| {design} \|([^|]*)\|([^|]*)\|([^|]*)\|([^|]*)\|", page, re.MULTILINE
    )
    assert row is not None
    cells = [re.sub(r"\D", "", cell) for cell in row.groups()]
    return {name: int(cell) for name, cell in zip(("code", "memory", "stack", "step"), cells, strict=True) if cell}


@pytest.mark.slow(keep=2)
@pytest.mark.skipif(not IS_INSTALLED, reason=f"one of {', '.join(TOOLS)} is not installed")
@pytest.mark.parametrize("design", ["damper", "drag"])
@pytest.mark.parametrize("processor", BOARDS)
def test_the_law_of_the_library_computes_its_vectors_on_cortex_m(
    processor: str, design: str, libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path
) -> None:
    """With the options of Arduino, which cannot be chosen for a library: optimized for size, and in GNU's C."""
    _, folder = libraries[design]
    options, law = ["-std=gnu11", "-Os", *WARNINGS.split(), f"-I{folder / 'src'}"], tmp_path / "law.o"
    compile_law = ["arm-none-eabi-gcc", *options, *target(processor), "-c", str(folder / "src" / SOURCE)]
    subprocess.run([*compile_law, "-o", str(law)], check=True)
    extras = folder / "extras"
    said = run_on_board(processor, options, extras / "test_law.c", law, extras, tmp_path / "test.elf")
    assert said.splitlines()[-1].endswith("0 with other status flags; passed"), said
    counted = counts(run_on_board(processor, options, HERE / "count_steps.c", law, extras, tmp_path / "count.elf"))
    most = documented(processor, design)
    assert counted["steps"] > 1000
    assert 0.8 * most["step"] <= counted["most"] <= most["step"]
    assert counted["state"] + counted["parameters"] <= most["memory"]
    assert counted["stack"] <= most["stack"]
    assert code_size(law) <= most["code"]
    compile_sketch = [
        "arm-none-eabi-g++",
        "-std=gnu++17",
        "-Os",
        *WARNINGS.split(),
        f"-I{folder / 'src'}",
        f"-I{BOARD}",
    ]
    compile_sketch += [*target(processor), "-DREADING_PER_COUNT=1", "-x", "c++", "-include", "Arduino.h", "-c"]
    subprocess.run([*compile_sketch, str(sketch(folder)), "-o", str(tmp_path / "sketch.o")], check=True)


def test_products_and_sums_are_not_fused(libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path) -> None:
    """Fused operations would round in another way than the simulation and the proof of the limits."""
    if shutil.which("arm-none-eabi-objdump") is None:
        pytest.skip("arm-none-eabi-gcc is not installed")
    _, folder = libraries["damper"]
    fused = []
    for name in ("as_exported", "without_the_line"):
        source = tmp_path / name / SOURCE
        shutil.copytree(folder / "src", source.parent)
        if name == "without_the_line":
            source.write_text(law_text(SOURCE))
        command = ["arm-none-eabi-gcc", "-std=gnu11", "-Os", *target("Cortex-M4F"), "-c", str(source)]
        subprocess.run([*command, "-o", str(tmp_path / "law.o")], check=True)
        listing = ["arm-none-eabi-objdump", "-d", str(tmp_path / "law.o")]
        text = subprocess.run(listing, capture_output=True, text=True, check=True).stdout
        fused.append(len(re.findall(r"\bvfn?m[as]", text)))
    assert fused[0] == 0
    assert fused[1] > 0


AVR = ["-mmcu=atmega328p", "-DF_CPU=16000000L", "-Os"]


@pytest.mark.parametrize("design", ["damper", "drag"])
def test_the_law_of_the_library_runs_on_an_atmega328p(
    design: str, libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path
) -> None:
    if shutil.which("avr-gcc") is None or shutil.which("simavr") is None:
        pytest.skip("needs avr-gcc and simavr (Debian: gcc-avr, avr-libc, simavr)")
    _, folder = libraries[design]
    text = [line for line in (folder / "extras/vectors.csv").read_text().splitlines() if not line.startswith("#")]
    rows = [row for row in csv.DictReader(text) if row["case"] == "0"][:450]
    cells = ("reading", "age", "contact_force", "fresh"), ("position", "velocity")
    lines = (
        f"{{{{{', '.join(r[n] for n in cells[0])}}}, {{{', '.join(r[n] for n in cells[1])}}}, {r['status']}}},"
        for r in rows
    )
    (tmp_path / "avr_rows.h").write_text("\n".join(lines))
    image, source = tmp_path / "law.elf", ROOT / "tests/embedded/count_avr.c"
    options = ["-std=gnu11", *WARNINGS.split(), f"-I{folder / 'src'}", f"-I{tmp_path}"]
    command = ["avr-gcc", *AVR, *options, str(source), str(folder / "src" / SOURCE), "-lm", "-o", str(image)]
    subprocess.run(command, check=True)
    simulate = ["simavr", "-m", "atmega328p", "-f", "16000000", str(image)]
    done = subprocess.run(simulate, capture_output=True, text=True, check=False, timeout=60)
    counted = counts(done.stdout + done.stderr)
    assert counted["steps"] == len(rows)
    assert counted["flags"] == 0
    largest = [max(abs(float(row[name])) for row in rows) for name in ("position", "velocity")]
    assert counted["position_nm"] <= 1e9 * 1e-4 * largest[0]
    assert counted["velocity_nm_s"] <= 1e9 * 1e-4 * largest[1]
    most = documented("ATmega328P", design)
    assert 0.8 * most["step"] <= counted["most"] <= most["step"]


CORE = Path("/usr/share/arduino/hardware/arduino/avr")  # of Debian's package arduino-core-avr


def uno(folder: Path, made: Path, *defines: str) -> Path:
    """Build the whole sketch for an Arduino Uno, with its real core."""
    if shutil.which("avr-g++") is None or not CORE.exists():
        pytest.skip("needs avr-gcc and the Arduino core (Debian: gcc-avr, avr-libc, arduino-core-avr)")
    parts = ("cores/arduino", "variants/standard", "libraries/Wire/src", "libraries/Wire/src/utility")
    options = [*AVR, "-DARDUINO=10819", "-DARDUINO_AVR_UNO", "-DARDUINO_ARCH_AVR", "-flto", "-ffunction-sections"]
    options += ["-fdata-sections", *(f"-I{CORE / part}" for part in parts), f"-I{folder / 'src'}"]
    core = [path for part in parts for path in (CORE / part).glob("*.c*") if path.stem != "WString"]
    own = [sketch(folder), folder / "src" / SOURCE]
    objects = []
    for path in [*core, *own]:
        is_c = path.suffix == ".c"
        compiler = ["avr-gcc", "-std=gnu11"] if is_c else ["avr-g++", "-std=gnu++11", "-fno-exceptions"]
        compiler += ["-fno-threadsafe-statics"] * (not is_c)
        language = ["-x", "c++", "-include", "Arduino.h"] if path.suffix == ".ino" else []
        objects.append(str(made / f"{path.name}.o"))
        warnings = [*WARNINGS.split(), *(f"-D{each}" for each in defines)] if path in own else ["-w"]
        command = [*compiler, *options, *warnings, *language, "-c", str(path), "-o", objects[-1]]
        subprocess.run(command, check=True)
    image = made / "uno.elf"
    link = ["avr-gcc", *AVR, "-flto", "-fuse-linker-plugin", "-Wl,--gc-sections", *objects, "-lm", "-o", str(image)]
    subprocess.run(link, check=True)
    return image


@pytest.mark.slow
def test_the_whole_sketch_fits_on_an_arduino_uno(libraries: dict[str, tuple[pt.Task, Path]], tmp_path: Path) -> None:
    image = uno(libraries["damper"][1], tmp_path)
    sizes = subprocess.run(["avr-size", str(image)], capture_output=True, text=True, check=True).stdout
    text, data, bss = map(int, sizes.splitlines()[1].split()[:3])
    page = (ROOT / "docs/how-to/export/arduino.md").read_text(encoding="utf-8")
    promised = re.search(r"takes ([\d,]+) bytes of flash and ([\d,]+) bytes of RAM", page)
    assert promised is not None
    flash, ram = (int(number.replace(",", "")) for number in promised.groups())
    assert 0.9 * flash <= text + data <= flash
    assert 0.9 * ram <= data + bss <= ram


@pytest.mark.slow
@pytest.mark.parametrize("rate", ["1 kHz", "250 Hz"])
def test_the_whole_sketch_runs_on_an_arduino_uno_if_its_period_is_long_enough(rate: str, tmp_path: Path) -> None:
    """With the core of the Uno in an emulator: every period is in time, and every reading is in the log."""
    if shutil.which("simavr") is None:
        pytest.skip("needs simavr")
    text = (ROOT / "examples/loop.toml").read_text().replace('part = "VCNL4010"', 'rate = "250 Hz"')
    path = tmp_path / "loop.toml"
    path.write_text(text.replace('rate = "1 kHz"', f'rate = "{rate}"'))
    task = pt.load_scenario(path).replace(gain=-0.86)
    assert export(task, tmp_path / "law", "arduino", verify=False).is_written
    image = uno(tmp_path / "law", tmp_path, "READING_PER_COUNT=1")
    command = ["simavr", "-m", "atmega328p", "-f", "16000000", str(image)]
    lines = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as running:
        assert running.stdout is not None
        for line in running.stdout:
            lines.append(re.sub(r"\x1b\[\d*m", "", line).strip().rstrip("."))
            if len(lines) == 400 or "too slow" in line:
                break
        running.kill()
    if rate == "1 kHz":
        assert any("too slow" in line for line in lines)
        return
    times = np.array([int(line.partition(",")[0]) for line in lines if re.fullmatch(r"\d+,[\d.]+(,-?\d+){3}", line)])
    assert len(times) > 390
    assert np.all(np.abs(np.diff(times) - 4000) < 500)
    assert not any("late" in line or "stopped" in line for line in lines)
