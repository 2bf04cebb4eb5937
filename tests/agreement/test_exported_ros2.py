"""The exported ros2_control controller computes what the law computes, and says clearly what it refuses.

The controller is compiled against stub headers of our own, because ROS 2 cannot be installed from here.
"""

from __future__ import annotations

import ast
import csv
import dataclasses
import math
import re
import runpy
import shutil
import struct
import subprocess
import sys
import types
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import pretouch as pt
from pretouch.exports import export
from pretouch.exports.ros2 import yaml_number
from pretouch.verification.verdict import chosen_gain
from ros2_harness import HEADERS, PARAMETERS, STUBS, build, drive, leaves

EXAMPLES = Path(__file__).parents[2] / "examples"
DESIGNS = {"damper": ("loop.toml", -0.86), "drag": ("drag.toml", None), "course": ("course.toml", -0.7)}
INTERFACES = ("proximity/reading", "proximity/count", "proximity/age", "contact/force", "slide/position")
STATES = [f"state {name} 0" for name in (*INTERFACES, "slide/velocity")]
COUNTED = ["param reading.new_when count", "param reading.count_interface proximity/count"]
WIRED = [
    "param joint slide",
    *COUNTED,
    "param reading.age_interface proximity/age",
    "param contact_force.interface contact/force",
    *STATES,
]
TOPIC = ["param joint slide", "command slide/position", *STATES, "param reading.delay 0"]
NUMBERS = [*TOPIC, "param reading.source number_topic", "configure 1000", "activate"]
MS = 1_000_000  # ns


def task(design: str) -> pt.Task:
    name, gain = DESIGNS[design]
    scenario = pt.load_scenario(EXAMPLES / name)
    if design == "damper":  # the readings of these tests are above this floor
        law = scenario.loop.law
        law = replace(law, conditioning=replace(law.conditioning, floor=100.0))
        scenario = scenario.replace(loop=replace(scenario.loop, law=law))
    return scenario if gain is None else scenario.replace(gain=gain)


@pytest.fixture(scope="module", params=DESIGNS)
def design(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folders = {name: tmp_path_factory.mktemp(name) / "package" for name in DESIGNS}
    for name, folder in folders.items():
        assert export(task(name), folder, "ros2", verify=False).is_written
    return folders


@pytest.fixture(scope="module")
def package(design: str, packages: dict[str, Path]) -> Path:
    return packages[design]


@pytest.fixture(scope="module")
def damper(packages: dict[str, Path]) -> Path:
    """The harness with the damper; the package lies next to it."""
    return build(packages["damper"], packages["damper"].parent)


def played_rows(vectors: Path) -> list[str]:
    """The rows that the harness plays: an interface of sensor outputs cannot say that there is no object."""
    rows = [line.split(",") for line in vectors.read_text().splitlines() if line[0].isdigit()]
    unseen = {row[0] for row in rows if row[7] == "2"}
    assert len(unseen) == 1
    return [",".join(row) for row in rows if row[0] not in unseen]


@pytest.fixture(scope="module")
def program(design: str, packages: dict[str, Path], request: pytest.FixtureRequest) -> Path:
    """The harness with a design: one of them compiled by clang with optimization, if clang is installed."""
    if design == "damper":
        return Path(request.getfixturevalue("damper"))
    choice = ("clang++", "-O1") if design == "course" and shutil.which("clang++") else ("g++", "-O0")
    return build(packages[design], packages[design].parent, *choice)


# ---- equal to the law ----


@pytest.mark.slow
@pytest.mark.parametrize("chained", [0, 1], ids=["reference from a topic", "chained"])
@pytest.mark.parametrize(("output", "column"), [("position", 0), ("velocity", 1), ("wrench", 3)])
def test_commands_equal_the_vectors_in_every_bit(
    output: str, column: int, chained: int, package: Path, program: Path
) -> None:
    vectors = package / "law/vectors.csv"
    written = [] if output == "wrench" else [f"command slide/{output}"]
    start = ["configure 1000"] if output == "wrench" else []  # prepares the receiver of the wrench
    lines = [*WIRED, f"param output {output}", *written, *start, f"replay {column} 1000 {chained} {vectors}", "counts"]
    answers = drive(program, *lines)[len(start) :]
    rows = played_rows(vectors)
    assert answers == [f"{len(rows)} 0", "0 0"]  # steps, differences; allocations, blocking locks


def test_the_harness_notices_another_law_an_allocation_and_a_lock(damper: Path) -> None:
    vectors = damper.parent / "package/law/vectors.csv"
    lines = [*WIRED, "command slide/position", "param law.gain -0.8599", f"replay 0 1000 1 {vectors}", "count_check"]
    replay, counts = drive(damper, *lines)
    assert int(replay.split()[1]) > 100
    assert counts.split()[:3] == ["1", "1", "1"]


def test_effort_is_the_impedance_of_the_scenario_in_units_of_the_joint(damper: Path) -> None:
    """tau = F / r for q = r x, with F = D (x_v' - x') + K (x_v - x); at rest, x_v is the reference."""
    robot = task("damper").loop.plant
    setup = [*WIRED, "param output effort", "param joint_units_per_meter -4", "command slide/effort"]
    lines = [*setup, "state slide/position 0.2", "configure 1000", "chained 1", "activate"]
    moved = ["state slide/position 0.3", "state slide/velocity 0.5", "update"]
    *_, answer = drive(damper, *lines, *moved)
    x, v = (0.3 - 0.2) / -4, 0.5 / -4
    wanted = (robot.stiffness * (0 - x) + robot.damping * (0 - v)) / -4
    assert float(answer.split()[1]) == pytest.approx(wanted, rel=1e-12)


def test_a_wrench_points_along_its_axis_and_ends_with_the_controller(damper: Path) -> None:
    setup = [*WIRED, "param output wrench", "param wrench.axis 0.6,0,0.8", "configure 1000", "activate"]
    readings = [f"state proximity/reading {r}" for r in (2000, 2100, 2200)]
    steps = [line for i, r in enumerate(readings) for line in (r, f"state proximity/count {i + 1}", "update 4")]
    answers = drive(damper, *setup, *steps, "wrench", "deactivate", "wrench")
    x, y, z = map(float, answers[-3].split())
    assert x < 0  # an approach pushes the robot away from the object
    assert (x / 0.6, y) == (pytest.approx(z / 0.8), 0)
    assert [float(value) for value in answers[-1].split()] == [0, 0, 0]


def test_scale_and_sign_of_the_joint(damper: Path) -> None:
    """A joint that counts away from the object in mm gets the same motion with the opposite sign, times 1000."""
    steps = [
        line
        for i, r in enumerate((2000, 2200, 2500))
        for line in (f"state proximity/reading {r}", f"state proximity/count {i + 1}", "update 4")
    ]
    found = []
    for scale in (1, -1000):
        lines = [*WIRED, "command slide/position", f"param joint_units_per_meter {scale}", "configure 1000", "activate"]
        found.append(float(drive(damper, *lines, *steps)[-1].split()[1]))
    assert found[0] < 0
    assert found[1] == pytest.approx(-1000 * found[0], rel=1e-12)


# ---- readings of topics ----


def updates(values: list[float]) -> list[str]:
    """Lines that send readings 4 ms apart, and update after each."""
    return [line for i, value in enumerate(values, 1) for line in (f"time {i * 4 * MS}", f"number {value}", "update 4")]


def law_outputs(values: list[float], age: float) -> list[float]:
    """Positions of the law after each reading and three periods without one."""
    run = task("damper").loop.law.with_value(-0.86).begin()
    out = []
    for value in values:
        run.step(value, True, age)
        for _ in range(3):
            last = run.step(value, False, 0.0)
        out.append(last.position)
    return out


def test_readings_of_a_topic_are_used_once_with_their_age(damper: Path) -> None:
    values = [2000.0, 2100.0, 2250.0, 2400.0]
    lines = [*TOPIC, "param reading.source number_topic", "param reading.delay 0.001", "configure 1000", "activate"]
    *_, a, b, c, d = drive(damper, *lines, *updates(values))
    found = [float(line.split()[1]) for line in (a, b, c, d)]
    # the age is a difference of nanoseconds, so its rounding only matters for the check of the order of readings
    assert found == law_outputs(values, 0.001)


RANGES = [*TOPIC, "param reading.source range_topic", "param diagnostics.period 0.001", "configure 1000", "activate"]


def ranges(values: list[float | str], age: float = 0.001, limits: str = "0.02 4.0", start: int = 0) -> list[str]:
    """Lines that send ranges [m] 4 ms apart, each measured an age [s] ago, and update after each."""
    lines = []
    for i, value in enumerate(values, start + 1):
        lines += [f"time {i * 4 * MS}", f"range {value} {int(i * 4 * MS - age * 1e9)} {limits}", "update 4"]
    return lines


def shown_by(program: Path, lines: list[str]) -> dict[str, str]:
    """The entries of the last diagnostic message."""
    return dict(entry.split("=", 1) for entry in drive(program, *lines, "diagnose")[-1].split("\t")[2:])


def test_a_range_topic_is_a_distance_with_the_age_of_its_stamp(damper: Path) -> None:
    """Without an option, also for a design whose sensor reports its raw output."""
    distances = [struct.unpack("f", struct.pack("f", d))[0] for d in (0.06, 0.057, 0.053, 0.05)]
    *_, a, b, c, d = drive(damper, *RANGES, *ranges([repr(d) for d in distances]))
    found = [float(line.split()[1]) for line in (a, b, c, d)]
    outputs = [150 + math.exp(task("damper").sensor.log_output(distance)) for distance in distances]
    # the table of the curve has a relative error of some 1e-6 in xi
    assert found == pytest.approx(law_outputs(outputs, 0.001), rel=1e-3)
    assert found[-1] < -1e-6


@pytest.mark.parametrize("value", ["inf", "4.0", "9.5", "-1.0"])
def test_an_object_that_vanishes_causes_no_motion_toward_it(value: str, damper: Path) -> None:
    """A jump from 0.1 m to "no object" is no motion; the sensor works, and a new distance is a new start."""
    near = [*RANGES, *ranges([0.1, 0.1, 0.1])]
    gone = [*near, *ranges([value] * 30, start=3)]
    moved = [float(line.split()[1]) for line in drive(damper, *gone) if line.startswith("ok")]
    assert max(moved) == 0
    shown = shown_by(damper, gone)
    assert (shown["object detected"], shown["refused inputs"], shown["status flags"]) == ("no", "0", "0")
    back = shown_by(damper, [*gone, *ranges([0.1], start=33)])
    assert (back["object detected"], back["refused inputs"], back["virtual force [N]"]) == ("yes", "0", "0")


@pytest.mark.parametrize(
    ("value", "reason"),
    [("0.0", "nearer"), ("0.019", "nearer"), ("-inf", "nearer"), ("nan", "not a finite number")],
)
def test_a_range_that_does_not_count_is_refused_and_moves_nothing(value: str, reason: str, damper: Path) -> None:
    lines = [*RANGES, *ranges([0.1, 0.1, value])]
    shown = shown_by(damper, lines)
    assert shown["refused inputs"] == "1"
    (line,) = [text for key, text in shown.items() if key.startswith("refused at")]
    assert reason in line
    lost = [*lines, *ranges([value] * 20, start=3)]
    assert float(drive(damper, *lost)[-1].split()[1]) == 0
    assert drive(damper, *lost, "diagnose")[-1].startswith("2\t")


@pytest.mark.parametrize(("value", "limits", "detected"), [("0.0", "0 0", "yes"), ("0.019", "0.01 4", "yes")])
def test_a_near_range_counts_within_its_limits(value: str, limits: str, detected: str, damper: Path) -> None:
    """A message without limits has none."""
    lines = [*RANGES, *ranges([value], limits=limits)]
    assert shown_by(damper, lines)["object detected"] == detected


def test_diagnostics_keep_the_last_reading_between_readings(damper: Path) -> None:
    first = shown_by(damper, [*RANGES, f"time {MS}", f"range 0.1 {MS}", "update"])["reading"]
    later = [*RANGES, f"time {MS}", f"range 0.1 {MS}", "update 3"]
    assert shown_by(damper, later)["reading"] == first
    assert shown_by(damper, [*RANGES, "update"])["reading"] == "nan"


def test_a_distance_is_converted_by_the_sensor_curve(damper: Path) -> None:
    """The table is finer than the error that its header states; beyond its end nothing is detected."""
    header = (damper.parent / "package/src/sensor_curve.hpp").read_text()
    (stated,) = (float(x) for x in re.findall(r"of at most (\S+)\.", header))
    sensor = task("damper").sensor
    distances = np.random.default_rng(3).uniform(0.001, 0.2, 40)
    for distance in [struct.unpack("f", struct.pack("f", d))[0] for d in distances]:
        lines = [*TOPIC, "param reading.source range_topic", "param reading.quantity distance", "configure 1000"]
        answers = drive(damper, *lines, "activate", f"time {MS}", f"range {distance!r} {MS}", "update", "diagnose")
        shown = dict(entry.split("=", 1) for entry in answers[-1].split("\t")[2:])
        # diagnostics show 9 digits
        assert math.log(float(shown["reading"]) - 150) == pytest.approx(sensor.log_output(distance), abs=stated + 1e-8)
    far = drive(damper, *lines, "activate", f"time {MS}", f"range inf {MS}", "update", "diagnose")
    assert "object detected=no" in far[-1]
    assert "refused inputs=0" in far[-1]


def test_an_old_reading_is_refused_and_a_lost_sensor_is_reported(damper: Path) -> None:
    lines = [*TOPIC, "param reading.source range_topic", "configure 1000", "activate"]
    old = drive(damper, *lines, "time 1000000000", f"range 0.1 {1000 * MS - 41 * MS}", "update", "diagnose")[-1]
    assert "age of 0.041 s" in old
    assert "refused inputs=1" in old
    lost = drive(damper, "param diagnostics.period 0.001", *lines, "update 41", "diagnose")[-1]
    assert lost.startswith("2\t")
    assert "lost" in lost


# ---- failures ----


def outcome(program: Path, *lines: str) -> tuple[str, str]:
    """The result of the last lifecycle step, and the log."""
    *_, result, log = drive(program, *lines, "log")
    return result, log


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ((*WIRED, "configure 500"), "update_rate"),
        (("configure 1000",), "joint"),
        ((*WIRED, "param reading.count_interface ", "configure 1000"), "count_interface"),
        ((*WIRED, "param law.saturation 200", "configure 1000"), "saturation"),
        ((*WIRED, "param joint_units_per_meter 0", "configure 1000"), "joint_units_per_meter"),
        ((*WIRED, "param output wrench", "param wrench.axis 0,0,2", "configure 1000"), "wrench.axis"),
        (
            (*WIRED, "param output effort", "param effort.stiffness 0", "param effort.damping 0", "configure 1000"),
            "effort.stiffness",
        ),
    ],
    ids=["rate", "no joint", "no count", "saturation", "scale", "axis", "no impedance"],
)
def test_a_wrong_parameter_prevents_the_configuration(lines: tuple[str, ...], told: str, damper: Path) -> None:
    result, log = outcome(damper, *lines)
    assert result == "failure"
    assert told in log
    assert log.count("error:") == 1


@pytest.mark.parametrize("missing", ["slide/position command", *INTERFACES])
def test_a_missing_interface_prevents_the_activation_and_is_named(missing: str, damper: Path) -> None:
    name, _, is_command = missing.partition(" ")
    wired = [line for line in WIRED if is_command or not line.startswith(f"state {name} ")]
    commands = [] if is_command else ["command slide/position"]
    result, log = outcome(damper, *wired, *commands, "configure 1000", "activate")
    assert result == "failure"
    assert name in log


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("state slide/position nan", "position"),
        ("state proximity/reading nan", "NaN"),
        ("wrong_type proximity/reading", "double"),
    ],
)
def test_a_value_that_is_no_number_prevents_the_activation(line: str, told: str, damper: Path) -> None:
    result, log = outcome(damper, *WIRED, "command slide/position", line, "configure 1000", "activate")
    assert result == "failure"
    assert told in log


def test_a_topic_without_reading_warns_or_prevents_the_activation(damper: Path) -> None:
    lines = [*TOPIC, "param reading.source number_topic"]
    assert outcome(damper, *lines, "configure 1000", "activate")[0] == "success"
    result, log = outcome(damper, *lines, "param reading.required true", "configure 1000", "activate")
    assert (result, "No reading" in log) == ("failure", True)
    required = [*lines, "param reading.required true", "configure 1000", "number 2000"]
    assert outcome(damper, *required, f"time {39 * MS}", "activate")[0] == "success"
    result, log = outcome(damper, *required, f"time {41 * MS}", "activate")
    assert (result, "timeout" in log) == ("failure", True)


@pytest.mark.parametrize(
    ("reading", "reason"),
    [("nan", "not a finite number"), ("inf", "not a finite number"), ("65535", "saturated"), ("20000", "largest rate")],
)
def test_each_refused_reading_is_reported_with_its_reason(reading: str, reason: str, damper: Path) -> None:
    first = ["state proximity/reading 2000", "state proximity/count 1", "update 4", "diagnose"]
    second = [f"state proximity/reading {reading}", "state proximity/count 2", "time 7000000000", "update", "diagnose"]
    lines = [*WIRED, "command slide/position", "configure 1000", "activate", *first, *second]
    answer = drive(damper, *lines)[-1].split("\t")
    assert answer[0] == "1"
    (line,) = [entry for entry in answer if entry.startswith("refused at")]
    assert line.startswith("refused at 7.000 s=")
    assert reason in line


def test_diagnostics_show_xi_detection_and_force(damper: Path) -> None:
    readings = [(f"state proximity/reading {r}", f"state proximity/count {i}") for i, r in enumerate((2000, 2150), 1)]
    lines = [*WIRED, "command slide/position", "configure 1000", "activate", "param diagnostics.period 0.001"]
    lines = ["param diagnostics.period 0.001", *lines[:-1]]
    for pair in readings:
        lines += [*pair, "update 4", "diagnose"]
    shown = dict(entry.split("=", 1) for entry in drive(damper, *lines)[-1].split("\t")[2:])
    run = task("damper").loop.law.with_value(-0.86).begin()
    for reading in (2000.0, 2150.0):
        out = run.step(reading, True, 0.0)
        for _ in range(3):
            out = run.step(reading, False, 0.0)
    assert float(shown["xi"]) == pytest.approx(100 * math.exp(out.log_level), rel=1e-8)  # nine digits are shown
    assert float(shown["virtual force [N]"]) == pytest.approx(out.virtual_force, rel=1e-8)
    assert shown["object detected"] == "yes"
    assert shown["as exported"] == "yes"


def test_changed_numbers_are_shown_as_not_exported(damper: Path) -> None:
    lines = [
        *WIRED,
        "param law.gain -0.5",
        "command slide/position",
        "configure 1000",
        "activate",
        "update",
        "diagnose",
    ]
    *_, shown, log = drive(damper, *lines, "log")
    assert "as exported=no" in shown
    assert log.startswith("warning:")


def test_a_lost_sensor_stops_the_controller_on_request_only(damper: Path) -> None:
    """The timeout is 40 periods; in the first 40 updates nothing is lost."""
    wired = [*WIRED, "command slide/position", "configure 1000", "activate", "update 40", "update"]
    stopped = drive(damper, "param reading.stop_when_lost true", *wired)
    assert [line.split()[0] for line in stopped[-2:]] == ["ok", "error"]
    assert [line.split()[0] for line in drive(damper, *wired)[-2:]] == ["ok", "ok"]


def test_a_blocked_command_is_an_error_only_if_it_lasts(damper: Path) -> None:
    lines = [*WIRED, "command slide/position", "configure 1000", "activate", "block slide/position 1"]
    last = drive(damper, *lines, "update 39", "update", "block slide/position 0", "update", "diagnose")
    assert [line.split()[0] for line in last[-4:-1]] == ["ok", "error", "ok"]
    assert (
        "commands not written=40"
        in drive(damper, *lines, "update 40", "block slide/position 0", "update 200", "diagnose")[-1]
    )


def test_a_blocked_reading_is_taken_in_the_next_period(damper: Path) -> None:
    lines = [*WIRED, "command slide/position", "configure 1000", "activate"]
    new = ["state proximity/reading 2000", "state proximity/count 1"]
    blocked = [*new, "block proximity/reading 1", "update", "block proximity/reading 0", "update"]
    late = drive(damper, "param diagnostics.period 0.001", *lines, *blocked, "diagnose")[-1]
    assert "object detected=yes" in late
    assert "interfaces not read=1" in late


def test_without_a_reference_the_joint_holds_its_position(damper: Path) -> None:
    lines = [*WIRED, "command slide/position", "state slide/position 0.3", "configure 1000", "activate"]
    assert drive(damper, *lines, "update 10")[-1] == "ok 0.29999999999999999"
    # a reference that is no number does not move it either
    assert drive(damper, *lines, "reference nan", "update 10")[-1] == "ok 0.29999999999999999"


def test_the_velocity_of_an_old_reference_counts_as_zero(damper: Path) -> None:
    lines = [*WIRED, "param output velocity", "command slide/velocity", "configure 1000", "activate", "time 0"]
    sent = [*lines, "reference 0.1 0.2"]
    assert drive(damper, *sent, f"time {499 * MS}", "update")[-1] == "ok 0.20000000000000001"
    assert drive(damper, *sent, f"time {501 * MS}", "update")[-1] == "ok 0"
    assert drive(damper, *sent, "update", "deactivate")[-1] == "success 0"


def test_an_earlier_reference_or_reading_does_not_survive_a_restart(damper: Path) -> None:
    lines = [*NUMBERS, "reference 0.5", "update", "deactivate", "number 2000", "activate", "update"]
    assert drive(damper, *lines)[-1] == "ok 0"
    state = drive(damper, "param diagnostics.period 0.001", *lines, "diagnose")[-1]
    assert "object detected=no" in state


def test_a_constant_reading_is_no_lost_sensor_unless_noise_never_lets_it_repeat(damper: Path) -> None:
    """An equal reading counts once per sensor period of 4 ms; the time without a change is shown."""
    wired = ["param joint slide", *STATES, "param reading.new_when change", "command slide/position"]
    start = ["param diagnostics.period 0.001", "configure 1000", "activate"]
    steps = [*start, "state proximity/reading 200", "update 100", "diagnose"]
    working = drive(damper, *wired, "param reading.constant_is_lost false", *steps)[-1]
    assert working.startswith("0\t")
    assert "reading unchanged for [s]=0.099" in working
    lost = drive(damper, *wired, "param reading.constant_is_lost true", *steps)[-1]
    assert lost.startswith("2\t")
    approach = ["configure 1000", "activate"]
    for value in (2000, 2100, 2250):
        approach += [f"state proximity/reading {value}", "update 4"]
    found = drive(damper, *wired, "param reading.constant_is_lost false", *approach)[-1]
    assert float(found.split()[1]) == law_outputs([2000.0, 2100.0, 2250.0], 0.0)[-1]


@pytest.mark.parametrize(
    ("chain", "lost"),
    [
        ({"noise": 40.0, "resolution": 1.0, "offset": 400.0, "lowest": 0.0}, True),
        ({"noise": 40.0, "resolution": 0.0, "offset": 400.0, "lowest": 0.0}, True),
        ({"noise": 0.0, "resolution": 1.0, "offset": 400.0, "lowest": 0.0}, False),
        ({"noise": 0.2, "resolution": 1.0, "offset": 400.0, "lowest": 0.0}, False),
        ({"noise": 40.0, "resolution": 1.0, "offset": 20.0, "lowest": 0.0}, False),
    ],
    ids=["noisy", "continuous", "without noise", "coarse", "clipped"],
)
def test_whether_a_constant_reading_is_a_fault_follows_from_the_noise(
    chain: dict[str, float], lost: bool, tmp_path: Path
) -> None:
    made = task("damper")
    loop = replace(made.loop, chain=replace(made.loop.chain, relative_noise=0.0, crosstalk=0.0, **chain))
    export(made.replace(loop=loop), tmp_path / "package", "ros2", verify=False)
    ((_, tree),) = yaml.safe_load((tmp_path / "package" / PARAMETERS).read_text()).items()
    assert dict(leaves(tree))["reading.constant_is_lost"]["default_value"] is lost


@pytest.mark.parametrize(("rule", "usable"), [("change", 2), ("every_period", 4)])
def test_new_readings_are_recognized_without_a_count(rule: str, usable: int, damper: Path) -> None:
    """Of four periods with two values, `change` takes two readings and `every_period` four (each one refused here)."""
    wired = ["param joint slide", *STATES, f"param reading.new_when {rule}", "command slide/position"]
    lines = [*wired, "configure 1000", "activate"]
    steps = ["state proximity/reading inf", "update 2", "state proximity/reading -inf", "update 2", "diagnose"]
    assert f"refused inputs={usable}" in drive(damper, *lines, *steps)[-1]


def test_late_periods_are_counted(damper: Path) -> None:
    lines = [*WIRED, "command slide/position", "configure 1000", "activate", "update 3 0.0016", "update 5 0.0014"]
    assert "late periods=3" in drive(damper, "param diagnostics.period 0.001", *lines, "diagnose")[-1]


def test_late_periods_are_made_up_for_so_that_ages_fit(damper: Path) -> None:
    """After an update that is three periods late, the law is where it is without the delay, and takes the reading."""
    lines = [*WIRED, "command slide/position", "configure 1000", "activate"]
    for count, value in enumerate((2000, 2100, 2200, 2300, 2400), 1):
        lines += [f"state proximity/reading {value}", f"state proximity/count {count}", "update 4"]
    new = ["state proximity/reading 2500", "state proximity/count 6"]
    on_time = drive(damper, *lines, "update 3", *new, "update")[-1]
    late = [*lines, *new, "update 1 0.004"]
    assert drive(damper, *late)[-1] == on_time
    assert on_time != drive(damper, *lines, *new, "update")[-1]
    assert "refused inputs=0" in drive(damper, *late, "update 200", "diagnose")[-1]
    assert drive(damper, *late, "counts")[-1] == "0 0"


def test_a_chained_reference_that_is_not_written_any_more_stops(damper: Path) -> None:
    lines = [*WIRED, "param output velocity", "command slide/velocity", "configure 1000", "chained 1", "activate"]
    moving = [*lines, "set_reference 0.1 0.2", "update 500"]
    assert drive(damper, *moving)[-1] == "ok 0.20000000000000001"
    assert drive(damper, *moving, "update 2")[-1] == "ok 0"
    assert drive(damper, *moving, "update 2", "set_reference 0.1001 0.2", "update")[-1] == "ok 0.20000000000000001"


def test_a_command_that_the_manager_changes_is_reported(damper: Path) -> None:
    wired = ["param joint slide", *STATES, "param reading.new_when every_period", "command slide/position"]
    lines = [*wired, "configure 1000", "activate", "update", "diagnose"]
    assert "commands changed by others=0" in drive(damper, *lines)[-1]
    clipped = [*lines[:-1], "set_command slide/position 0.01", "update 100", "diagnose"]
    answer = drive(damper, *clipped)[-1]
    assert answer.startswith("1\t")
    assert "commands changed by others=1" in answer


@pytest.mark.parametrize(("output", "warns"), [("position", True), ("velocity", True), ("wrench", False)])
def test_a_joint_with_tighter_limits_than_the_law_warns(output: str, warns: bool, damper: Path) -> None:
    lines = [*WIRED, f"param output {output}", "largest_velocity slide 0.001", "largest_velocity other 1e-6"]
    result, log = outcome(damper, *lines, "configure 1000")
    assert result == "success"
    assert ("law.largest_speed" in log) == warns
    enough = [*lines[:-2], "largest_velocity slide 1e12", "configure 1000"]
    assert "largest_speed" not in outcome(damper, *enough)[1]


def test_activation_and_deactivation_wait_for_nothing_and_rest_is_sent_later(damper: Path) -> None:
    """While the thread that publishes is busy: the last force is replaced by 0 as soon as it can be sent."""
    lines = [*WIRED, "param output wrench", "configure 1000", "activate"]
    for count, value in enumerate((2000, 2100, 2200), 1):
        lines += [f"state proximity/reading {value}", f"state proximity/count {count}", "update 4"]
    stopped = [*lines, "busy 1", "deactivate", "wrench", "timers", "wrench", "busy 0", "timers", "wrench"]
    *_, before, still, after = drive(damper, *stopped)
    assert float(before.split()[2]) < 0
    assert still == before
    assert after == "0 0 0"
    again = drive(damper, *lines, "busy 1", "deactivate", "busy 0", "activate", "timers", "wrench")
    assert again[-1] == "0 0 0"
    assert drive(damper, *lines, "busy 1", "time_states 5")[-1].split()[-1] == "0"  # no sleep


NUMBERS_OF = [
    *("joint_units_per_meter", "reference_timeout", "reading.delay", "contact_force.scale", "effort.stiffness"),
    *("effort.damping", "effort.mass", "wrench.axis", "diagnostics.period", "law.gain", "law.offset", "law.floor"),
    *("law.saturation", "law.timeout", "law.largest_rate", "law.largest_force", "law.contact_gain"),
    *("law.contact_threshold", "law.largest_speed", "law.largest_acceleration", "law.largest_excursion"),
]


def test_every_number_is_tried(damper: Path) -> None:
    ((_, tree),) = yaml.safe_load((damper.parent / "package" / PARAMETERS).read_text()).items()
    assert [name for name, leaf in leaves(tree) if leaf["type"].startswith("double")] == NUMBERS_OF


@pytest.mark.slow(keep=30)
@pytest.mark.parametrize("name", NUMBERS_OF)
@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e300", "-1e300", "x"])
def test_a_number_that_is_none_is_refused_with_its_name(name: str, value: str, damper: Path) -> None:
    given = ",".join([value] * 3) if name == "wrench.axis" else value
    if value == "x" and name == "wrench.axis":
        pytest.skip("the harness reads text in an array as 0, which is no unit vector")
    lines = [*WIRED, "param output wrench", f"param {name} {given}"]
    *answers, log = drive(damper, *lines, "configure 1000", "log")
    assert answers[-1] == "failure" or f"refused {name}" in answers
    assert name in " ".join([*answers, log])


ZERO_IS_DEFINED = {
    *("reading.delay", "effort.stiffness", "effort.damping", "effort.mass", "law.gain", "law.offset"),
    *("law.contact_gain",),
}


@pytest.mark.parametrize("name", NUMBERS_OF)
@pytest.mark.parametrize("value", ["0", "-0.0", "5e-324"])
def test_zero_is_refused_with_its_name_or_gives_finite_commands(name: str, value: str, damper: Path) -> None:
    """No gain is no force; no offset and no delay are those of an ideal sensor; other zeros are mistakes."""
    given, output = (",".join([value] * 3), "wrench") if name == "wrench.axis" else (value, "effort")
    written = [] if output == "wrench" else [f"command slide/{output}"]
    lines = [*WIRED, f"param output {output}", *written, f"param {name} {given}", "configure 1000"]
    *answers, log = drive(damper, *lines, "log")
    is_refused = f"refused {name}" in answers or (answers[-1] == "failure" and name in log)
    assert float(value) != 0 or is_refused == (name not in ZERO_IS_DEFINED), (answers, log)
    if is_refused:
        return
    inputs = [
        line
        for i, reading in enumerate((2000, 2200, 2500, 2900, 2900), 1)
        for line in (f"state proximity/reading {reading}", f"state proximity/count {i}", f"state contact/force {-i}")
    ]
    steps = [line for i in range(5) for line in (*inputs[3 * i : 3 * i + 3], "update 4")]
    answers = [answer.split() for answer in drive(damper, *lines, "activate", *steps)[-5:]]
    assert all(result == "ok" and np.isfinite(float(command)) for result, command in answers)
    if float(value) == 0 and name != "law.gain":
        assert any(float(command) < 0 for _, command in answers)


@pytest.mark.parametrize(
    ("name", "told"),
    [("law.gian", "law.gain"), ("readng.delay", "reading.delay"), ("wrench.axes", "wrench.axis"), ("jiont", "joint")],
)
def test_a_misspelled_parameter_is_named_with_the_right_one(name: str, told: str, damper: Path) -> None:
    result, log = outcome(damper, *WIRED, f"param {name} 1", "configure 1000")
    assert result == "failure"
    assert name in log
    assert told in log


def test_parameters_of_ros_are_known_and_others_are_named(damper: Path) -> None:
    lines = [*WIRED, "param use_sim_time true", "param qos_overrides./clock.depth 1", "configure 1000"]
    assert outcome(damper, *lines) == ("success", "")
    result, log = outcome(damper, *lines[:-1], "param robot_color red", "configure 1000")
    assert result == "success"
    assert "robot_color" in log


def test_interfaces_that_the_controller_asks_for(damper: Path) -> None:
    line = drive(damper, *WIRED, "param output effort", "configure 1000", "interfaces")[-1]
    commands, states, references = (part.split() for part in line.split("|"))
    assert commands == ["slide/effort"]
    assert states == [*INTERFACES[-1:], "slide/velocity", *INTERFACES[:4]]
    assert references == [f"pretouch_controller/slide/{n}" for n in ("position", "velocity", "acceleration")]


# ---- the files of the package ----


AMENT = """
add_library(${name}_stub INTERFACE)
target_include_directories(${name}_stub INTERFACE "${STUBS}")
add_library(${name}::${name} ALIAS ${name}_stub)
set(${name}_TARGETS ${name}::${name})
set(${name}_FOUND TRUE)
"""
MACROS = """
macro(generate_parameter_library target file)
  if(NOT EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${file}")
    message(FATAL_ERROR "${file} is missing")
  endif()
  add_library(${target} INTERFACE)
endmacro()
function(pluginlib_export_plugin_description_file base file)
  if(NOT EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${file}")
    message(FATAL_ERROR "${file} is missing")
  endif()
endfunction()
function(ament_package)
endfunction()
"""


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("cmake") is None or shutil.which("g++") is None, reason="cmake or g++ is not installed"
)
def test_cmake_builds_the_plugin_tests_the_law_and_installs_everything(damper: Path, tmp_path: Path) -> None:
    """Empty packages with the names of the dependencies stand in for ROS 2."""
    package = damper.parent / "package"
    for name in ET.parse(package / "package.xml").getroot().iter():  # noqa: S314
        if name.tag in {"depend", "buildtool_depend"}:
            macros = MACROS if name.text == "ament_cmake" else ""
            (tmp_path / f"Find{name.text}.cmake").write_text(f"set(name {name.text})\n{AMENT}{macros}")
    build_folder, prefix = tmp_path / "build", tmp_path / "install"
    stubs = f"{damper.parent / 'include'};{STUBS}"
    configure = ["cmake", "-S", package, "-B", build_folder, f"-DCMAKE_MODULE_PATH={tmp_path}", f"-DSTUBS={stubs}"]
    for command in (
        [*configure, f"-DCMAKE_INSTALL_PREFIX={prefix}"],
        ["cmake", "--build", build_folder],
        ["ctest", "--test-dir", build_folder, "--no-tests=error"],
        ["cmake", "--install", build_folder],
    ):
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning" not in done.stderr.lower()
    installed = {path.relative_to(prefix).as_posix() for path in prefix.rglob("*") if path.is_file()}
    share = "share/pretouch_controller"
    assert installed == {
        "lib/libpretouch_controller.so",
        "lib/pretouch_controller/play_vectors.py",
        f"{share}/config/admittance_controller.yaml",
        f"{share}/config/controllers.yaml",
        f"{share}/launch/mock_robot.launch.py",
        f"{share}/urdf/mock_robot.urdf",
        f"{share}/vectors.csv",
    }


@pytest.mark.slow(keep=2)
@pytest.mark.skipif(
    shutil.which("cmake") is None or shutil.which("g++") is None, reason="cmake or g++ is not installed"
)
@pytest.mark.parametrize(
    ("name", "found", "needed"),
    [
        ("controller_interface", "5.12.0", "5.13"),
        ("controller_interface", "5.13.0", ""),
        ("controller_interface", "4.43.0", "4.44"),
        ("controller_interface", "4.44.0", ""),
        ("controller_interface", "6.4.9", "6.5"),
        ("controller_interface", "6.8.0", ""),
        ("realtime_tools", "3.6.0", "3.7"),
        ("realtime_tools", "3.7.0", ""),
        ("realtime_tools", "4.3.0", "4.4"),
        ("realtime_tools", "5.0.0", ""),
    ],
)
def test_cmake_names_the_version_that_is_needed(
    name: str, found: str, needed: str, damper: Path, tmp_path: Path
) -> None:
    """Of each distribution, the first versions with what the controller uses, and those before them."""
    package = damper.parent / "package"
    for element in ET.parse(package / "package.xml").getroot().iter():  # noqa: S314
        if element.tag in {"depend", "buildtool_depend"}:
            text = f"set(name {element.text})\n{AMENT}{MACROS if element.text == 'ament_cmake' else ''}"
            text += f"set({name}_VERSION {found})\n" if element.text == name else ""
            (tmp_path / f"Find{element.text}.cmake").write_text(text)
    command = ["cmake", "-S", package, "-B", tmp_path / "build", f"-DCMAKE_MODULE_PATH={tmp_path}", f"-DSTUBS={STUBS}"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert (done.returncode != 0) == bool(needed), done.stderr
    assert not needed or f"needs {needed}" in done.stderr


def test_package_and_plugin_description_are_well_formed(package: Path) -> None:
    root = ET.parse(package / "package.xml").getroot()  # noqa: S314 - our own file
    assert (root.tag, root.get("format")) == ("package", "3")
    names = [child.tag for child in root]
    for name in ("name", "version", "description", "maintainer", "license", "buildtool_depend"):
        assert name in names
    assert re.fullmatch(r"[a-z][a-z0-9_]*", root.findtext("name", ""))
    assert "@" in root.find("maintainer").get("email")  # type: ignore[union-attr,operator]
    plugin = ET.parse(package / "pretouch_controller.xml").getroot()  # noqa: S314
    (entry,) = plugin.findall("class")
    exported = f"PLUGINLIB_EXPORT_CLASS({entry.get('type')}, {entry.get('base_class_type')})"
    assert exported in (package / "src/pretouch_controller.cpp").read_text()
    controllers = yaml.safe_load((package / "config/controllers.yaml").read_text())
    manager = controllers["controller_manager"]["ros__parameters"]
    assert manager["pretouch_controller"]["type"] == entry.get("name")
    assert plugin.get("path") == root.findtext("name")


def test_every_file_and_package_that_cmake_names_exists(package: Path) -> None:
    text = (package / "CMakeLists.txt").read_text()
    root = ET.parse(package / "package.xml").getroot()  # noqa: S314
    (block,) = re.findall(r"set\(DEPENDENCIES\n(.*?)\)", text, re.DOTALL)
    assert sorted(block.split()) == sorted(e.text for e in root.findall("depend") if e.text)
    for path in re.findall(r"[\w/]+\.(?:cpp|yaml|xml|csv|py)\b", text):
        assert (package / path).is_file(), path
    for folder in re.findall(r"DIRECTORY ([\w ]+) DESTINATION", text)[0].split():
        assert any((package / folder).iterdir())
    assert (package / "law/CMakeLists.txt").is_file()
    assert "add_library(pretouch_law " in (package / "law/CMakeLists.txt").read_text()
    included = {
        name
        for source in (package / "src").glob("*.[ch]pp")
        for name in re.findall(r'#include "([\w/]+\.hpp)"', source.read_text())
        if not (package / "src" / name).exists() and not name.startswith("pretouch_controller/")
    }
    assert included == set(HEADERS)
    for name in included:
        assert name.split("/")[0] in block.split()


def test_parameters_have_the_values_of_the_design_inside_their_ranges(design: str, package: Path) -> None:
    ((_, tree),) = yaml.safe_load((package / PARAMETERS).read_text()).items()
    found: dict[str, Any] = dict(leaves(tree))
    numbers = task(design).loop.law.with_value(chosen_gain(task(design))).parameters()
    name = "drag" if design == "drag" else "gain"
    wanted = {
        name: getattr(numbers.law, name),
        **{n: getattr(numbers.sensing, n) for n in ("offset", "floor", "saturation", "timeout", "largest_rate")},
        **{n: getattr(numbers.drive, n) for n in ("largest_force", "contact_gain", "contact_threshold")},
        **{f"largest_{n}": getattr(numbers.drive.limits, n) for n in ("speed", "acceleration", "excursion")},
    }
    assert {
        n.removeprefix("law."): leaf["default_value"] for n, leaf in found.items() if n.startswith("law.")
    } == wanted
    assert found[f"law.{name}"]["validation"]["bounds<>"] == sorted((wanted[name], 0.0))  # weaker, never stronger
    for parameter, leaf in found.items():
        assert leaf["description"]
        assert leaf["read_only"] is True
        value = leaf["default_value"]
        assert type(value) is {"string": str, "double": float, "bool": bool, "double_array": list}[leaf["type"]]
        for rule, limits in leaf.get("validation", {}).items():
            assert rule in {"one_of<>", "fixed_size<>"} or all(isinstance(limit, float) for limit in limits), parameter
            assert _holds(rule, value, limits), parameter


def _holds(rule: str, value: Any, limits: Any) -> bool:
    checks = {
        "bounds<>": lambda: limits[0] <= value <= limits[1],
        "gt<>": lambda: value > limits[0],
        "gt_eq<>": lambda: value >= limits[0],
        "lt_eq<>": lambda: value <= limits[0],
        "one_of<>": lambda: value in limits[0],
        "fixed_size<>": lambda: len(value) == limits,
    }
    return bool(checks[rule]())


@pytest.mark.parametrize("value", [1.0, -0.86, 1e-5, 1e12, 1e15, 1e300, 5e-324, 0.1 + 0.2, 2.0**70])
def test_numbers_survive_yaml(value: float) -> None:
    assert yaml.safe_load(yaml_number(value)) == value
    assert "." in yaml_number(value)


def test_mock_robot_has_the_interfaces_of_the_controllers(package: Path) -> None:
    """The URDF, the parameters and the scripts name the same joint, sensor and rate."""
    robot = ET.parse(package / "urdf/mock_robot.urdf").getroot()  # noqa: S314
    (system,) = robot.findall("ros2_control")
    assert system.findtext("hardware/plugin") == "mock_components/GenericSystem"
    states = {
        f"{part.get('name')}/{state.get('name')}"
        for part in [*system.findall("joint"), *system.findall("sensor")]
        for state in part.findall("state_interface")
    }
    config = yaml.safe_load((package / "config/controllers.yaml").read_text())
    used = config["pretouch_controller"]["ros__parameters"]
    feed = config["sensor_feed"]["ros__parameters"]
    reading = used["reading"]
    assert {reading["interface"], reading["count_interface"], reading["age_interface"]} <= states
    assert {f"{feed['joint']}/{name}" for name in feed["interface_names"]} <= states
    assert f"{used['joint']}/position" in states
    assert {joint.get("name") for joint in robot.findall("joint")} == {used["joint"]}
    period = task("damper").loop.law.period  # that of all three examples
    assert config["controller_manager"]["ros__parameters"]["update_rate"] * period == pytest.approx(1)
    ((_, tree),) = yaml.safe_load((package / PARAMETERS).read_text()).items()
    known = {name for name, _ in leaves(tree)}
    flat = {f"reading.{name}" for name in reading} | (set(used) - {"reading"})
    assert flat <= known
    for source in ("launch/mock_robot.launch.py", "scripts/play_vectors.py"):
        ast.parse((package / source).read_text())


PLAYED = """
import runpy, sys, types
said, waited = [], [0]
class Publisher:
    def get_subscription_count(self): return int(waited[0] >= 3)
    def publish(self, message): said.append((waited[0], message.data))
class Node:
    def create_publisher(self, kind, topic, depth): return Publisher()
    def create_timer(self, period, call): self.call = call
running = [True]
def spin_once(node, timeout_sec): waited[0] += 1
def spin(node):
    while running[0]: node.call()
rclpy = types.ModuleType("rclpy")
rclpy.init, rclpy.create_node, rclpy.spin, rclpy.spin_once = (lambda: None), (lambda name: Node()), spin, spin_once
rclpy.try_shutdown = lambda: running.__setitem__(0, False)
messages = types.ModuleType("std_msgs.msg")
messages.Float64MultiArray = types.SimpleNamespace
sys.modules |= {"rclpy": rclpy, "std_msgs": types.ModuleType("std_msgs"), "std_msgs.msg": messages}
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
for when, data in said: print(when, *map(repr, data))
"""


def test_the_player_waits_for_the_controller_and_plays_the_first_case(package: Path) -> None:
    """ROS 2 drops messages that are sent before a subscriber is connected: with stand-ins for its Python modules."""
    vectors, script = package / "law/vectors.csv", package / "scripts/play_vectors.py"
    command = [sys.executable, "-c", PLAYED, str(script), str(vectors), "1000"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = [line.split() for line in done.stdout.splitlines()]
    lines = [line for line in vectors.read_text().splitlines() if not line.startswith("#")]
    rows = [row for row in csv.DictReader(lines) if row["case"] == "0"]
    assert {when for when, *_ in said} == {"3"}
    assert [(float(reading), float(age)) for _, reading, _, age in said] == [
        (float(row["reading"]), float(row["age"])) for row in rows
    ]
    assert [float(count) for _, _, count, _ in said] == np.cumsum([int(row["fresh"]) for row in rows]).tolist()


def test_the_launch_file_plays_only_to_active_controllers(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With stand-ins for the modules of launch: their classes keep their arguments."""

    class Kept:
        def __init__(self, *args: Any, **named: Any) -> None:
            self.args, self.named = args, named

    share = package.parent / "share"
    for name in ("config/controllers.yaml", "urdf/mock_robot.urdf"):
        (share / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(package / name, share / name)
    classes = {
        "ament_index_python.packages": {"get_package_share_directory": lambda _: str(share)},
        "launch": {"LaunchDescription": Kept},
        "launch.actions": {"RegisterEventHandler": Kept},
        "launch.event_handlers": {"OnProcessExit": Kept},
        "launch_ros.actions": {"Node": Kept},
    }
    for name, members in {**classes, "ament_index_python": {}, "launch_ros": {}}.items():
        module = types.ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    made = runpy.run_path(str(package / "launch/mock_robot.launch.py"))["generate_launch_description"]()
    handler = made.args[0][-1].args[0].named
    executables = [node.named["executable"] for node in made.args[0][:-1]]
    assert executables == ["robot_state_publisher", "ros2_control_node", "spawner"]
    assert handler["target_action"] is made.args[0][2]
    play = handler["on_exit"]
    assert play(types.SimpleNamespace(returncode=1), None) == []
    (player,) = play(types.SimpleNamespace(returncode=0), None)
    assert player.named["arguments"] == [str(share / "vectors.csv"), "1000"]


def test_a_distance_sensor_and_an_admittance_without_stiffness(tmp_path: Path) -> None:
    """The sensor curve converts by default, and the package says that an admittance_controller lacks the damping."""
    made = task("damper")
    law = made.loop.law
    chain = pt.simulation.sensor_part("VL53L5CX-4x4").chain
    conditioning = dataclasses.replace(law.conditioning, sensor_period=chain.period, timeout=None)
    soft = dataclasses.replace(law.admittance, stiffness=0.0)
    slow = dataclasses.replace(law, conditioning=conditioning, admittance=soft)
    loop = dataclasses.replace(made.loop, chain=chain, law=slow)
    scenario = dataclasses.replace(
        made.scenario, admittance=dataclasses.replace(made.scenario.admittance, stiffness=0.0)
    )
    export(made.replace(loop=loop, scenario=scenario), tmp_path / "package", "ros2", verify=False)
    ((_, tree),) = yaml.safe_load((tmp_path / "package" / PARAMETERS).read_text()).items()
    found = dict(leaves(tree))
    assert found["reading.quantity"]["default_value"] == "distance"
    assert found["reading.delay"]["default_value"] == chain.latency
    assert found["law.timeout"]["default_value"] == pytest.approx(10 / 60)
    assert "computes its damping from the stiffness" in (tmp_path / "package/README.md").read_text()


def test_numbers_for_an_admittance_controller(package: Path, design: str) -> None:
    """Its damping is 2 zeta sqrt(M K), which has to be that of the design."""
    text = (package / "config/admittance_controller.yaml").read_text()
    theirs = yaml.safe_load(text)["admittance_controller"]["ros__parameters"]
    ours = yaml.safe_load(text)["pretouch_controller"]["ros__parameters"]
    found = theirs["admittance"]
    # one frame and one axis for both
    assert ours["wrench"]["frame"] == theirs["ft_sensor"]["frame"]["id"] == theirs["control"]["frame"]["id"]
    assert [bool(part) for part in ours["wrench"]["axis"]] == found["selected_axes"][:3]
    assert not any(found["selected_axes"][3:])
    ((_, tree),) = yaml.safe_load((package / PARAMETERS).read_text()).items()
    known = dict(leaves(tree))
    assert ours["output"] == "wrench"
    assert {f"wrench.{name}" for name in ours["wrench"]} <= set(known)
    assert known["wrench.axis"]["default_value"] == ours["wrench"]["axis"]
    wanted = task(design).loop.law.admittance
    mass, ratio, stiffness = (found[name][2] for name in ("mass", "damping_ratio", "stiffness"))
    assert (mass, stiffness) == (wanted.mass, wanted.stiffness)
    assert 2 * ratio * math.sqrt(mass * stiffness) == pytest.approx(wanted.damping, rel=1e-15)
