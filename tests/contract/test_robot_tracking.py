"""How the joints of a robot follow, how large the object is and how long a run lasts: from a scenario file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import pretouch as pt
from pretouch.config.robot_encounter import simulate_robot_file
from pretouch.errors import ScenarioFileError
from pretouch.robots import ComputedTorque, OperationalSpace, PositionControl
from refusals import refused

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
