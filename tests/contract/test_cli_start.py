"""`pretouch init`, `pretouch compare` and `pretouch doctor`: what a new user runs first."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from command_text import command, curve
from command_text import in_this_process as run

import pretouch as pt
from pretouch.cli import doctor
from pretouch.config.parts import load_with_parts, tasks_of_parts
from pretouch.simulation import PARTS
from pretouch.simulation.detection import detection_distance
from pretouch.studio import page_file
from pretouch.verification import VerdictStatus, compare
from refusals import refused

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
pytestmark = pytest.mark.usefixtures("short_rest")


def in_a_process(*words: object, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pretouch", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, stdin=subprocess.DEVNULL)


CALIBRATED = [EXAMPLES / "sensor.csv", "--recess", "5 mm"]

# --- init


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("law", [[], ["--drag"]], ids=["damper", "drag"])
@pytest.mark.parametrize("part", [*PARTS, "other", "csv"])
def test_a_first_scenario_is_read_designed_and_commented(part: str, law: list[str], tmp_path: Path) -> None:
    words = CALIBRATED if part == "csv" else ["--part", part]
    answer = run("init", *words, *law, folder=tmp_path)
    assert answer.returncode == 0, answer.stderr
    task = pt.load_scenario(tmp_path / "scenario.toml")
    design = pt.design(task)
    assert design.holds if law else design.status == "optimal"
    assert task.loop is not None
    assert task.uncertainty
    text = (tmp_path / "scenario.toml").read_text(encoding="utf-8")
    assert text.count("#") > 15
    assert max(map(len, text.splitlines())) <= 130
    needs_calibration = part != "csv" and not part.startswith("VL53")
    assert ("NOT your sensor" in text) == needs_calibration


@pytest.mark.slow
def test_a_first_scenario_of_a_calibration_passes_every_command(tmp_path: Path) -> None:
    assert run("init", *CALIBRATED, "--rate", "200 Hz", folder=tmp_path).returncode == 0
    for verb in (["design"], ["simulate"], ["verify", "--runs", "50", "--no-changes"]):
        answer = run(verb[0], "scenario.toml", *verb[1:], "--no-report", folder=tmp_path)
        assert answer.returncode == 0, answer.stdout + answer.stderr
    words = ["replay", "scenario.toml", EXAMPLES / "approaches.csv", "--topic", "reading", "--no-report"]
    answer = run(*words, folder=tmp_path)  # of another sensor: the detections do not matter here
    assert answer.returncode in {0, 1}, answer.stderr
    assert "detections in 16 s" in answer.stdout


@pytest.mark.slow
def test_a_drag_is_designed_on_curves_with_a_level_part(tmp_path: Path) -> None:
    """Some curves that the readings allow are tables whose slope is zero up to rounding, of either sign."""
    run("init", *CALIBRATED, "--drag", folder=tmp_path)
    answer = run("design", "scenario.toml", "--no-report", folder=tmp_path)
    assert answer.returncode == 0, answer.stderr


def test_the_options_are_the_values_of_the_file(tmp_path: Path) -> None:
    options = {"speed": "0.5 m/s", "distance": "60 mm", "excursion": "80 mm", "contact-speed": "0.2 m/s"}
    words = [word for name, value in options.items() for word in (f"--{name}", value)]
    answer = run(
        "init", *words, "--robot-mass", "7 kg", "--part", "vcnl4040", "-o", "a.toml", "--json", folder=tmp_path
    )
    assert json.loads(answer.stdout)["file"] == "a.toml"
    task = pt.load_scenario(tmp_path / "a.toml")
    assert (task.scenario.distance, task.scenario.relative_velocity) == (0.06, -0.5)
    assert {c.name: c.limit for c in task.limits} == {"excursion": 0.08, "relative_velocity": 0.2}
    assert task.impact.robot_mass == 7.0
    assert task.sensor_part.name == "VCNL4040"


@pytest.mark.slow
def test_every_value_of_the_first_encounter_has_an_option(tmp_path: Path) -> None:
    """A landing leg: without gravity, its optimal gain was half as strong."""
    options = {"speed": "0.8 m/s", "acceleration": "-9.81 m/s^2", "distance": "80 mm", "impact-force": "400 N"}
    options |= {"stiffness": "30 kN/m", "latency": "5 ms", "control-rate": "500 Hz", "rate": "100 Hz"}
    words = [word for name, value in options.items() for word in (f"--{name}", value)]
    assert run("init", "--part", "VCNL4010", *words, folder=tmp_path).returncode == 0
    task = pt.load_scenario(tmp_path / "scenario.toml")
    assert task.scenario.obstacle.acceleration == -9.81
    assert {c.name: c.limit for c in task.limits} == {"excursion": 0.2, "impact_force": 400.0}
    assert task.impact.stiffness == 30e3
    assert (task.loop.chain.rate, task.loop.chain.delay, task.loop.law.period) == (100.0, 5e-3, 2e-3)
    words = ["--effective-modulus", "2 MPa", "--radius", "20 mm", "--force"]
    assert run("init", *words, folder=tmp_path).returncode == 0
    impact = pt.load_scenario(tmp_path / "scenario.toml").impact
    assert (impact.effective_modulus, impact.radius) == (2e6, 0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "rate", "control"),
    [
        (["csv", "--rate", "2 kHz"], 2000.0, 2000.0),
        (["csv", "--rate", "2 kHz", "--control-rate", "1 kHz"], 1000.0, 1000.0),
        (["--part", "VCNL4040", "--rate", "250 Hz"], 250.0, 1000.0),
        (["--part", "VL53L0X", "--rate", "100 Hz"], 100.0, 1000.0),
        (["--part", "RPR-220"], 1000.0, 1000.0),
        (["--part", "RPR-220", "--control-rate", "5 kHz"], 5000.0, 5000.0),
    ],
)
def test_the_rates_of_sensor_and_controller_fit_together(
    words: list[str], rate: float, control: float, tmp_path: Path
) -> None:
    answer = run(
        "init", *(CALIBRATED if "csv" in words else []), *(word for word in words if word != "csv"), folder=tmp_path
    )
    assert answer.returncode == 0, answer.stderr
    loop = pt.load_scenario(tmp_path / "scenario.toml").loop
    assert (loop.chain.rate, 1 / loop.law.period) == pytest.approx((rate, control))


CHOICES = {
    "rate": ("20 Hz", "250 Hz", "2 kHz", "5 kHz"),
    "control-rate": ("100 Hz", "1 kHz", "4 kHz"),
    "latency": ("0", "2 ms", "100 ms"),
    "distance": ("20 mm", "40 mm"),
    "recess": ("6 mm", "10 mm"),
    "speed": ("0.05 m/s", "0.5 m/s", "2 m/s"),
    "acceleration": ("-9.81 m/s^2", "0.1 m/s^2"),
    "excursion": ("20 mm", "300 mm"),
    "contact-speed": ("0.1 m/s",),
    "impact-force": ("20 N", "100 N"),
    "robot-mass": ("0.3 kg", "20 kg"),
    "radius": ("30 mm",),
}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_whatever_is_chosen_the_file_runs_and_starts_where_its_floor_detects(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    words: list[object] = [*CALIBRATED]
    if rng.random() < 0.7:
        words = ["--part", str(rng.choice([*PARTS, "other"]))]
    for name, values in CHOICES.items():
        if rng.random() < 0.4:
            words += [f"--{name}", str(rng.choice(values))]
    drag = rng.random() < 0.3
    answer = run("init", *words, *(["--drag"] if drag else []), folder=tmp_path)
    assert answer.returncode == 0, answer.stderr
    task = pt.load_scenario(tmp_path / "scenario.toml")
    assert task.start_warnings(None) == ()
    task = task.replace(verify=pt.designs.VerifyOptions(runs=3))
    if not drag:
        task = task.replace(gain=pt.design(task).gain or -0.1)
    for answer in (pt.simulate(task), pt.verify(task, changes=False)):
        assert not any(text.startswith("PT421") for text in answer.warnings)


@pytest.mark.slow
def test_raw_counts_are_counts(tmp_path: Path) -> None:
    text = (EXAMPLES / "sensor.csv").read_text(encoding="utf-8")
    (tmp_path / "raw.csv").write_text(text.replace("[counts]", "[raw counts]"), encoding="utf-8")
    assert "raw counts" in (tmp_path / "raw.csv").read_text(encoding="utf-8")
    answer = run("init", "raw.csv", "--recess", "5 mm", "--part", "VCNL4010", folder=tmp_path)
    assert answer.returncode == 0, answer.stderr
    assert pt.load_scenario(tmp_path / "scenario.toml").sensor_part.name == "VCNL4010"


def write_two_curves(path: Path) -> None:
    rows = [*curve(label="a,"), *curve(rate=-50.0, label="b,", seed=2)]
    path.write_text("\n".join(["unit,distance [mm],output [V]", *rows]) + "\n")


def write_equal_headers(path: Path) -> None:
    rows = [row.replace(",", f",{i % 7},") for i, row in enumerate(curve())]
    path.write_text("\n".join(["distance,output,output", *rows]) + "\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options", "keys"),
    [
        ("two.csv", ["--select", "unit=b"], {"select": {"unit": "b"}}),
        (
            "equal.csv",
            ["--columns", "distance=1 [mm], output=3 [V]", "--labels", "none"],
            {"columns": {"distance": "1 [mm]", "output": "3 [V]"}, "labels": []},
        ),
        ("repeats.csv", ["--labels", "none"], {"labels": []}),
    ],
)
def test_the_options_on_a_calibration_are_keys_of_the_file(
    name: str, options: list[str], keys: dict[str, object], tmp_path: Path
) -> None:
    write_two_curves(tmp_path / "two.csv")
    write_equal_headers(tmp_path / "equal.csv")
    rows = [row for day in (1, 2) for row in curve(label=f"{day},", seed=day)]
    (tmp_path / "repeats.csv").write_text("\n".join(["day,distance [mm],output [V]", *rows]) + "\n")
    assert run("init", name, folder=tmp_path).returncode == 2
    answer = run("init", name, *options, folder=tmp_path)
    assert answer.returncode == 0, answer.stderr
    section = tomllib.loads((tmp_path / "scenario.toml").read_text(encoding="utf-8"))["sensor"]
    assert {key: section[key] for key in ("select", "columns", "labels") if key in section} == keys
    assert pt.design(pt.load_scenario(tmp_path / "scenario.toml")).status == "optimal"


class Answers(StringIO):
    """Typed answers, which look like a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_wrong_answer_is_asked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", Answers("VCNL\nVCNL4040\n300\n0.4 m/s\n200\n200 mm\n\n"))
    code, _, err = command(monkeypatch, capsys)("init")
    assert code == 0, err
    assert "RPR-220" in err
    assert "found 300" in err
    assert "found 200" in err
    task = pt.load_scenario("scenario.toml")
    assert (task.sensor_part.name, task.scenario.relative_velocity) == ("VCNL4040", -0.4)
    assert {c.name: c.limit for c in task.limits} == {"excursion": 0.2}
    assert task.impact.robot_mass == 4.0


def test_only_the_user_knows_the_recess(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The usable range of the example starts at 5 mm, so without a recess the sensor does not reach contact."""
    answer = run("init", EXAMPLES / "sensor.csv", folder=tmp_path)
    assert answer.returncode == 2
    assert "--recess: the usable range of the sensor starts at 5 mm" in answer.stderr
    assert not (tmp_path / "scenario.toml").exists()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", Answers("other\n12 mm\n\n\n\n\n\n"))
    code, _, err = command(monkeypatch, capsys)("init", EXAMPLES / "sensor.csv")
    assert code == 0, err
    assert "How far is the sensor behind the contact surface (its usable range starts at 5 mm)" in err
    assert tomllib.loads(Path("scenario.toml").read_text(encoding="utf-8"))["sensor"]["recess"] == "12 mm"


def test_values_that_belong_together_say_so(tmp_path: Path) -> None:
    assert run("init", folder=tmp_path).returncode == 0
    text = (tmp_path / "scenario.toml").read_text(encoding="utf-8")
    assert re.search(r"^velocity = .*# .*also change the mean in \[uncertainty\]$", text, re.MULTILINE)
    assert re.search(r"^# .*together with velocity in \[obstacle\]\nobstacle.velocity", text, re.MULTILINE)
    assert re.search(r"^robot_mass = .*# .*together with mass in \[robot\]$", text, re.MULTILINE)
    assert re.search(r"^mass = .*# .*together with robot_mass in \[impact\]$", text, re.MULTILINE)


def test_the_spread_of_the_speeds_is_given_or_marked_as_assumed(tmp_path: Path) -> None:
    def velocity(*options: str) -> tuple[str, dict[str, list[str]]]:
        assert run("init", "--speed", "0.2 m/s", *options, "--force", folder=tmp_path).returncode == 0
        text = (tmp_path / "scenario.toml").read_text(encoding="utf-8")
        return text, tomllib.loads(text)["uncertainty"]["obstacle"]["velocity"]

    text, assumed = velocity()
    assert re.search(r"^# ASSUMED: .* --speed-spread", text, re.MULTILINE)
    assert assumed == {"normal": ["-0.2 m/s", "0.04 m/s"], "between": ["-0.32 m/s", "-0.08 m/s"]}
    text, given = velocity("--speed-spread", "0.01 m/s")
    assert "ASSUMED" not in text
    assert given == {"normal": ["-0.2 m/s", "0.01 m/s"], "between": ["-0.23 m/s", "-0.17 m/s"]}
    _, wide = velocity("--speed-spread", "0.1 m/s")
    assert wide["between"] == ["-0.5 m/s", "-0.01 m/s"]


def test_the_typical_curve_has_the_signal_of_the_part(tmp_path: Path) -> None:
    run("init", "--part", "VCNL4010", folder=tmp_path)
    at, output = PARTS["VCNL4010"].signal
    assert pt.load_scenario(tmp_path / "scenario.toml").sensor.output(at) == pytest.approx(output, rel=1e-3)


LABELED = {
    "a remark": ("comment", [""] * 9 + ["bumped the table"] + [""] * 5, 1),
    "remarks on surfaces": ("comment", ["white, matt"] * 15 + [""] * 15, 2),
    "texts on single rows": ("state", [""] * 9 + ["bumped the table"] + [""] * 5, 2),
    "surfaces": ("surface", ["black"] * 15 + ["white, matt"] * 15, 2),
}


@pytest.mark.slow(keep=2)
@pytest.mark.parametrize("name", LABELED)
def test_each_way_to_choose_a_curve_that_init_names_leads_to_a_scenario(name: str, tmp_path: Path) -> None:
    column, texts, curves = LABELED[name]
    rows = [(d, round(3000 / (1 + d / 20) ** 2 + 57 + d % 3)) for d in range(0, 60, 4)] * (len(texts) // 15)
    cells = [f'{d},{count},"{text}"' for (d, count), text in zip(rows, texts, strict=True)]
    (tmp_path / "own.csv").write_text(f"distance [mm],prox [counts],{column}\n" + "\n".join(cells) + "\n")
    assert len(pt.calibration.read_calibrations(tmp_path / "own.csv")) == curves
    answer = run("init", "own.csv", "--recess", "5 mm", folder=tmp_path)
    ways = [[]] if curves == 1 else []
    if curves > 1:
        assert answer.returncode == 2
        ways = [shlex.split(re.search(r"--select (?:'[^']*'|[^ .]*)", answer.stderr)[0])]
        ways += [["--labels", "none"]] if "--labels none" in answer.stderr else []
        assert len(ways) == 2
    for way in ways:
        answer = run("init", "own.csv", "--recess", "5 mm", "--force", *way, folder=tmp_path)
        assert answer.returncode == 0, answer.stderr
        assert pt.load_scenario(tmp_path / "scenario.toml").calibration.best is not None


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--output", "old.toml"], "already exists"),
        (["old.csv", "--output", "old.csv", "--force"], "old.csv"),
        (["--output", "no/a.toml"], "no: "),
        (["--part", "VCNL9999"], "--part: found 'VCNL9999'"),
        (["--speed", "3 m"], "--speed: found 3 m"),
        (["--speed", "300"], "--speed: found 300"),
        (["--excursion", "200"], "--excursion: found 200"),
        (["--distance", "50"], "--distance: found 50"),
        (["--robot-mass", "4"], "--robot-mass: found 4"),
        (
            ["--part", "other", "--rate", "100"],
            "--rate: found 100",
        ),
        (["--contact-speed", "0.1"], "--contact-speed: found 0.1"),
        (["--recess", "5"], "--recess: found 5"),
        (["--recess", "inf m"], "--recess: found inf m"),
        (["--columns", "distance=1,output=2"], "--columns: "),
        (["--speed", "-3 m/s"], "--speed: "),
        (["missing.csv"], "missing.csv"),
        (["old.csv", "--recess", "5 mm", "--part", "RPR-220"], "--part: "),
        (["--part", "VCNL4010", "--distance", "250 mm"], "--distance: found 0.25 m"),
        (["--stiffness", "1 kN/m", "--radius", "1 mm"], "--stiffness: "),
        (["--acceleration", "-9.81"], "--acceleration: found -9.81"),
        (["--latency", "-1 s"], "--latency: found -1 s"),
        (["--impact-force", "5"], "--impact-force: found 5"),
        (["old.csv", "--recess", "1 m"], "--recess"),
        (["two.csv"], "--select unit=a"),
        (["two.csv", "--select", "unit=c"], "unit=a"),
        (["equal.csv"], '--columns "output=2"'),
    ],
)
def test_a_mistake_of_init_writes_nothing(words: list[str], told: str, tmp_path: Path) -> None:
    (tmp_path / "old.toml").write_text("mine")
    (tmp_path / "old.csv").write_bytes((EXAMPLES / "sensor.csv").read_bytes())
    write_two_curves(tmp_path / "two.csv")
    write_equal_headers(tmp_path / "equal.csv")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    answer = run("init", *words, folder=tmp_path)
    assert answer.returncode == 2
    assert answer.stdout == ""
    assert told in answer.stderr
    assert ".toml, line " not in answer.stderr  # of a file that was not written
    assert "Traceback" not in answer.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_force_replaces_an_existing_file(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text("mine")
    assert run("init", "--force", folder=tmp_path).returncode == 0
    assert pt.load_scenario(tmp_path / "scenario.toml").loop is not None


# --- compare


def test_the_parts_get_their_own_chain_floor_and_scale() -> None:
    tasks = load_with_parts(EXAMPLES / "loop.toml")
    assert list(tasks) == list(PARTS)
    for name, task in tasks.items():
        part = PARTS[name]
        assert task.loop.chain.rate == min(part.chain.rate, 1000.0)
        assert task.loop.chain.noise == part.chain.noise
        at, output = part.signal or (0.1266, 1.0)
        assert task.sensor.output(at) == pytest.approx(output, rel=1e-9)
        law = task.loop.law.conditioning
        if law.floor > 1.001 * max(3 * part.chain.noise, 1e-12):  # else the signal is lost in the noise at the start
            found = detection_distance(task.sensor, task.loop.chain, law)
            assert found == pytest.approx(0.0422, rel=0.05)
        slope = pt.load_scenario(EXAMPLES / "loop.toml").sensor.log_slope(0.02)
        assert task.sensor.log_slope(0.02) == pytest.approx(slope)


@pytest.mark.slow
def test_the_parts_take_the_shape_of_a_fitted_curve_and_say_so() -> None:
    fitted = pt.load_scenario(EXAMPLES / "fingertip.toml")
    tasks, notes = tasks_of_parts(EXAMPLES / "fingertip.toml")
    assert set(tasks) == set(PARTS)
    assert "inverse-power curve that was fitted to sensor.csv" in notes[0]
    assert ["[controller]" in notes[1], "[robot]" in notes[2]] == [True, True]
    distances = np.linspace(0.0, 0.04, 9)
    farthest, recess = 0.08, 0.01
    for name, task in tasks.items():
        part = PARTS[name]
        assert task.calibration is None
        assert np.allclose(task.sensor.log_slope(distances), fitted.sensor.log_slope(distances))
        if part.signal is None:
            continue
        at, output = part.signal  # beyond the calibrated distances, the output falls with the square of the distance
        known = min(at, farthest)
        beyond = ((known + recess) / (at + recess)) ** 2
        assert task.sensor.output(known) * beyond == pytest.approx(output)


def test_the_parts_scale_the_points_of_a_curve_and_need_no_loop(tmp_path: Path) -> None:
    text = (EXAMPLES / "approach.toml").read_text(encoding="utf-8")
    points = [f"{d} mm" for d in range(0, 301, 20)]
    outputs = [4.0 / (1 + d / 40) ** 2 for d in range(0, 301, 20)]
    table = f"[sensor]\nmodel = 'table'\ndistances = {points}\noutputs = {outputs}\n[admittance]"
    (tmp_path / "points.toml").write_text(table + text.split("[admittance]", 1)[1], encoding="utf-8")
    for path in (tmp_path / "points.toml", EXAMPLES / "approach.toml"):
        tasks, notes = tasks_of_parts(path)
        assert len(notes) == 2
        for name, task in tasks.items():
            if PARTS[name].signal is not None:
                at, output = PARTS[name].signal
                assert task.sensor.output(at) == pytest.approx(output, rel=1e-6)
            assert task.loop.law.conditioning.floor > 1e-9


@pytest.mark.slow(keep=0)
def test_which_part_for_a_calibrated_encounter_is_answered(tmp_path: Path) -> None:
    answer = run("compare", EXAMPLES / "fingertip.toml", "--parts", "--runs", 5, folder=tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")
    assert "fitted to sensor.csv" in answer.stdout
    assert "<svg" in (tmp_path / "fingertip-compare.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_better_verdict_is_better_than_a_lower_speed() -> None:
    """The stronger gain meets the limit in 95 % of the runs; the weaker one and the ideal one do not."""
    loop = pt.load_scenario(EXAMPLES / "loop.toml")
    gains = {"weak": -0.3, "ideal": None, "strong": -0.86}
    result = compare({name: loop.replace(gain=gain) for name, gain in gains.items()}, runs=200)
    assert [c.name for c in result.candidates] == ["strong", "ideal", "weak"]
    assert result.best is result.candidates[0]
    assert not result.warnings
    assert result.candidates[0].status in {VerdictStatus.HOLDS, VerdictStatus.HOLDS_NARROWLY}
    speeds = [c.contact_speed for c in result.candidates]
    assert speeds == sorted(speeds)
    assert all(c.high_contact_speed > c.contact_speed for c in result.candidates)
    assert np.isclose(result.candidates[1].verdict.gain, -0.7463, atol=1e-4)


@pytest.mark.slow
def test_a_gain_that_avoids_every_contact_is_best() -> None:
    task = pt.load_scenario(EXAMPLES / "loop.toml").replace(constraints=(), uncertainty={}, gain=-0.5)
    obstacle = pt.Obstacle(position=0.0422, velocity=-0.3, acceleration=1.0)
    turning = task.replace(scenario=replace(task.scenario, obstacle=obstacle))
    result = compare({"approaching": task, "turning": turning}, runs=20)
    assert [c.name for c in result.candidates] == ["turning", "approaching"]
    assert result.headline == (
        "Candidate turning is best of 2 and holds: no simulated run ends in contact. 2 candidates hold."
    )
    assert repr(result.candidates[0]) == "<Candidate: turning, holds, no contact>"
    assert [text.partition(": use")[0] for text in result.warnings] == [
        "PT417: The candidates differ in the motion of the object"
    ]


@pytest.mark.slow
def test_files_are_ranked_in_a_table_and_a_report(tmp_path: Path) -> None:
    drag, loop = EXAMPLES / "drag.toml", EXAMPLES / "loop.toml"
    answer = run("compare", loop, drag, "--runs", 50, folder=tmp_path)
    assert answer.returncode == 0, answer.stderr
    rows = re.findall(r"^(drag|loop) +(?:holds|does)", answer.stdout, re.MULTILINE)
    assert rows == ["drag", "loop"]
    assert "drag" in answer.stdout.splitlines()[0]
    assert len(answer.stdout.splitlines()) <= 20
    page = (tmp_path / "loop-compare.html").read_text(encoding="utf-8")
    assert page.index("<svg") < page.index("<table")
    told = json.loads(run("compare", drag, loop, "--runs", 50, "--json", folder=tmp_path).stdout)
    assert (told["status"], told["best"]) == ("found", "drag")
    assert [c["name"] for c in told["candidates"]] == ["drag", "loop"]


@pytest.mark.slow
def test_parts_in_which_nothing_holds_end_with_1(tmp_path: Path) -> None:
    answer = run("compare", EXAMPLES / "loop.toml", "--parts", "--runs", 20, "--json", folder=tmp_path)
    assert answer.returncode == 1, answer.stderr
    told = json.loads(answer.stdout)
    assert (told["status"], told["best"], len(told["candidates"])) == ("none-holds", None, 8)
    slow = next(c for c in told["candidates"] if c["name"] == "VL53L5CX-8x8")
    assert (slow["status"], slow["rate"]) == ("no-gain", 15.0)
    assert slow["reason"]


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([EXAMPLES / "loop.toml"], "--parts"),
        ([EXAMPLES / "loop.toml", EXAMPLES / "loop.toml"], "twice"),
        ([EXAMPLES / "loop.toml", EXAMPLES / "approach.toml"], "[chain]"),
        ([EXAMPLES / "loop.toml", "no.toml"], "no.toml"),
    ],
)
def test_a_mistake_of_compare_is_one_sentence(words: list[object], told: str, tmp_path: Path) -> None:
    answer = run("compare", *words, folder=tmp_path)
    assert answer.returncode == 2
    assert told in answer.stderr
    assert "Traceback" not in answer.stderr
    assert not list(tmp_path.iterdir())


def test_a_candidate_alone_is_refused() -> None:
    with refused("tasks"):
        compare({"one": pt.load_scenario(EXAMPLES / "loop.toml")})


# --- doctor


def test_the_doctor_names_versions_and_what_is_missing(tmp_path: Path) -> None:
    from importlib.metadata import version

    answer = in_a_process("doctor", folder=tmp_path)
    assert answer.returncode == 0, answer.stdout
    assert f"pretouch {version('pretouch')}" in answer.stdout
    assert f"numpy {version('numpy')}" in answer.stdout
    assert len(answer.stdout.splitlines()) <= 15
    told = json.loads(in_a_process("doctor", "--json", folder=tmp_path).stdout)
    assert told["status"] == "works"
    assert told["core"]["variant"] in {"base", "avx2", "avx512"}
    for name, missing in told["missing_of_extras"].items():
        assert (f"pip install -U 'pretouch[{name}]'" in answer.stdout) == bool(missing)
    assert told["missing"] == []


def test_the_doctor_tells_which_versions_are_too_old(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = {"matplotlib": "0.9.4", "xarray": "0.1.0", "scipy": None}
    known = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: found[name] if name in found else known(name))
    pretouch = command(monkeypatch, capsys)
    code, out, _ = pretouch("doctor")
    assert code == 1
    listed = next(line for line in out.splitlines() if line.startswith("  MISSING or too old: "))
    assert "scipy" in listed
    assert "(found 0.9.4)" in listed
    line = next(line for line in out.splitlines() if line.startswith("  extra sweep"))
    assert "(found 0.1.0)" in line
    told = json.loads(pretouch("doctor", "--json")[1])
    assert told["status"] == "broken"
    assert {name.partition(">")[0] for name in told["missing"]} == {"scipy", "matplotlib"}


@pytest.mark.parametrize("is_there", [True, False])
def test_the_doctor_tells_whether_the_studio_has_the_core_of_its_page(
    is_there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    core = tmp_path / "core.wasm"
    if is_there:
        core.write_bytes(b"")
    monkeypatch.setattr(page_file, "CORE", core)
    pretouch = command(monkeypatch, capsys)
    code, out, _ = pretouch("doctor")
    line = next(line for line in out.splitlines() if line.startswith("  extra studio"))
    assert code == 0
    assert ("make page" in line) == (not is_there)
    assert json.loads(pretouch("doctor", "--json")[1])["page_core"] == is_there


def test_the_doctor_knows_all_extras_of_users() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert set(doctor._EXTRAS) == set(project["optional-dependencies"]) - {"dev", "docs", "benchmarks"}


def test_the_doctor_tells_that_the_core_does_not_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PRETOUCH_VARIANT", "quantum")
    answer = in_a_process("doctor", folder=tmp_path)
    assert answer.returncode == 1
    assert "PRETOUCH_VARIANT" in answer.stdout


@pytest.mark.slow
def test_a_landing_foot_without_a_gain_is_not_sent_to_limits_that_only_the_ideal_design_keeps(tmp_path: Path) -> None:
    """The ideal design keeps 13.7 mm instead of 5 mm; on the loop, no gain does."""
    options = {"speed": "0.8 m/s", "acceleration": "-9.81 m/s^2", "distance": "80 mm", "impact-force": "400 N"}
    options |= {"stiffness": "30 kN/m", "latency": "5 ms", "control-rate": "500 Hz", "rate": "100 Hz"}
    words = [word for name, value in options.items() for word in (f"--{name}", value)]
    assert run("init", "--part", "VCNL4010", *words, "--excursion", "5 mm", folder=tmp_path).returncode == 0
    task = pt.load_scenario(tmp_path / "scenario.toml")
    task = task.replace(verify=replace(task.verify, runs=20))
    advice = pt.verify(task).advice
    assert (advice.kind, advice.settings) == ("none", {})
    raised = re.findall(r"raise the limit of (\w+) from \S+ \w+ to (\S+ \w+)", advice.sentence)
    assert [name for name, _ in raised] == ["impact_force", "excursion"]
    for name, limit in raised:
        value = float(limit.split()[0]) * (1e-3 if limit.endswith("mm") else 1.0)
        limits = [replace(c, limit=value) if c.name == name else c for c in task.limits]
        changed = task.replace(constraints=limits)
        assert pt.design(changed).gain is not None
        assert not pt.verify(changed, changes=False).status.is_passed
