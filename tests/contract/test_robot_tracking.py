"""How the joints of a robot follow, how large the object is and how long a run lasts: from a scenario file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import pretouch as pt
from pretouch.config.robot_encounter import simulate_robot_file
from pretouch.control import Limits
from pretouch.errors import ScenarioFileError
from pretouch.exports.law_design import law_design
from pretouch.robots import ComputedTorque, OperationalSpace, PositionControl
from refusals import refused
from robot_scenes import SLIDE, controller

pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

ROOT = Path(__file__).parents[2]
ARM = ROOT / "examples/robots/arm.xml"
FILE = (ROOT / "examples/robots/arm.toml").read_text(encoding="utf-8").replace('"arm.xml"', f'"{ARM.as_posix()}"')


@pytest.fixture
def file(tmp_path: Path):
    def write(more_of_robot: str, more: str, text: str = FILE) -> Path:
        path = tmp_path / "arm.toml"
        path.write_text(text.replace("[admittance]", f"{more_of_robot}\n[admittance]", 1) + more, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("section", "tracking"),
    [
        ('kind = "computed-torque"\nmodel_error = 0.3', ComputedTorque(model_error=0.3)),
        ('kind = "impedance"\nnull_bandwidth = 1.0', OperationalSpace(null_bandwidth=1.0)),
        ('kind = "position"\nrate = "125 Hz"\ndelay = "8 ms"', PositionControl(rate=125.0, delay=8e-3)),
    ],
)
def test_a_file_says_how_the_joints_follow(file, section: str, tracking: Any) -> None:
    path = file('object_radius = "50 mm"\nfollow_time = "5 ms"', f"[tracking]\n{section}\n")
    scene = simulate_robot_file(path, pt.load_scenario(path).replace(gain=-3.0)).trace_of.scene
    assert scene.tracking == tracking
    assert scene.follow_time == 5e-3
    assert scene.model.geom("pretouch ball").size[0] == 0.05


def test_a_slow_position_controller_changes_the_contact(file) -> None:
    speeds = []
    for section in ("", '[tracking]\nkind = "position"\nbandwidth = "12 Hz"\nrate = "125 Hz"\ndelay = "16 ms"\n'):
        path = file("", section)
        result = simulate_robot_file(path, pt.load_scenario(path))
        speeds.append(float(result.simulated("fingertip", "relative_velocity")[0]))
        assert bool(section) == any(warning.startswith("PT507") for warning in map(str, result.warnings))
    assert abs(speeds[1] / speeds[0] - 1) > 0.05


@pytest.mark.parametrize(
    ("more_of_robot", "more", "argument"),
    [
        ("", '[tracking]\nkind = "servo"\n', "tracking.kind"),
        ("", "[tracking]\nrate = 3\n", "tracking.kind"),
        ("", '[tracking]\nkind = "impedance"\nrate = "125 Hz"\n', "tracking.rate"),
        ("", '[tracking]\nkind = "computed-torque"\nmodel_error = -2\n', "tracking.model_error"),
        ('object_radius = "-1 mm"', "", "robot.object_radius"),
        ('follow_time = "-1 s"', "", "robot.follow_time"),
    ],
)
def test_a_mistake_names_its_key(file, more_of_robot: str, more: str, argument: str) -> None:
    with refused(argument, error=ScenarioFileError):
        pt.load_scenario(file(more_of_robot, more))


def test_tracking_needs_a_robot_model(file) -> None:
    text = FILE.replace(FILE[FILE.index("[robot]") : FILE.index("[admittance]")], "").replace(
        "[impact]", '[impact]\nrobot_mass = "1 kg"'
    )
    with refused("tracking", error=ScenarioFileError):
        pt.load_scenario(file("", '[tracking]\nkind = "position"\n', text))


SLIDE_FILE = """
[sensor]
model = "inverse-power"
scale = 1.30e-5
distance_offset = "41.9 mm"
exponent = 3.32
[robot]
model = "slide.xml"
site = "tip"
[admittance]
mass = "1 kg"
damping = "10 N*s/m"
stiffness = "25 N/m"
[obstacle]
position = "42.2 mm"
velocity = "-0.3 m/s"
[objective]
kind = "excursion"
position_scale = "0.5 m"
velocity_scale = "0.3 m/s"
[gain]
bounds = ["-10 N*s", "-0.01 N*s"]
[chain]
rate = "500 Hz"
phase = "0 ms"
[controller]
rate = "1 kHz"
floor = 0.02
offset = 0.0
largest_excursion = "150 mm"
"""


@pytest.fixture
def floating(tmp_path: Path) -> Path:
    (tmp_path / "slide.xml").write_text(SLIDE.format(base="<freejoint/>", mass=1.0, gravity="0 0 0"))
    path = tmp_path / "slide.toml"
    path.write_text(SLIDE_FILE, encoding="utf-8")
    return path


@pytest.mark.parametrize("drag", [False, True])
def test_a_sampled_chain_on_a_floating_base_predicts_the_whole_robot(floating: Path, drag: bool) -> None:
    """The base of 1 kg takes back a fifth of the motion of the slide of 0.25 kg."""
    value = -0.7
    if drag:
        value = 0.0144
        text = SLIDE_FILE.replace('bounds = ["-10 N*s", "-0.01 N*s"]', 'bounds = ["1 mN*s^2", "0.1 N*s^2"]')
        law = '[law]\nkind = "virtual-drag"\nnoise = 1e-6\nown_advance = "-0.2 N*s"\n'
        floating.write_text(text + law, encoding="utf-8")
    task = pt.load_scenario(floating).replace(gain=value)
    assert task.loop.recoil_share == pytest.approx(0.2)
    predicted = float(task.loop.run(task.scenario, task.sensor, value).relative_velocity)
    result = simulate_robot_file(floating, task)
    simulated = float(result.simulated("tip", "relative_velocity")[0])
    assert simulated == pytest.approx(predicted, rel=5e-3)
    ignored = replace(task.loop, law=task.loop.robot_law, recoil_share=0.0)  # as if the base did not recoil
    scenario = replace(task.scenario, admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0))
    assert abs(simulated / float(ignored.run(scenario, task.sensor, value).relative_velocity) - 1) > 0.04


def test_what_runs_on_the_robot_keeps_its_own_admittance(floating: Path) -> None:
    """The exported law and that of a replay move the site relative to the base."""
    task = pt.load_scenario(floating).replace(gain=-0.7)
    own = task.loop.robot_law
    a = own.admittance
    assert (a.mass, a.damping, a.stiffness) == pytest.approx((1.0, 10.0, 25.0))
    assert own.limits.excursion == pytest.approx(0.15)
    assert task.loop.law.admittance.mass == pytest.approx(1 / 0.8)
    assert task.loop.law.limits.excursion == pytest.approx(0.8 * 0.15)
    exported = law_design(task, verify=False)
    assert exported.controller.admittance.mass == pytest.approx(1.0)
    assert simulate_robot_file(floating, task).laws[0].controller.admittance.mass == pytest.approx(1.0)


@pytest.mark.parametrize("factor", [0.5, 0.8])
def test_a_scaled_controller_moves_by_its_factor(factor: float) -> None:
    """Also at its limits of speed and excursion."""
    limits = Limits(force=30.0, speed=0.3, acceleration=20.0, excursion=0.02)
    own = replace(controller(-3.0), limits=limits)
    runs = own.begin(), own.scale_motion(factor).begin()
    for i in range(300):
        reading = 0.03 * (1 + 0.01 * i) if i < 150 else 0.02
        one, other = (run.step(reading) for run in runs)
        assert other.position == pytest.approx(factor * one.position, rel=1e-9, abs=1e-15)
        assert other.velocity == pytest.approx(factor * one.velocity, rel=1e-9, abs=1e-13)
    assert abs(one.position) > 1e-3
