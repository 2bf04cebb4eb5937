"""A robot in a task: from Python, from a scenario file, and `pretouch project`."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_text import command

import pretouch as pt
from pretouch.errors import ScenarioFileError
from pretouch.report.pages import page_of
from pretouch.robots import SensorSite, load_model, make_data, project_site
from refusals import refused

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

ROOT = Path(__file__).parents[2]
ARM = ROOT / "examples/robots/arm.xml"
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
FILE = """
[sensor]
model = "inverse-power"
scale = 1.30e-5
distance_offset = "41.9 mm"
exponent = 3.32
[robot]
{robot}
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
[impact]
stiffness = "10 kN/m"
"""
BENT = f'model = "{ARM.as_posix()}"\nsite = "fingertip"\nkeyframe = "bent"\n'
FLOATING = """<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/><geom size="0.1" mass="3"/>
<body pos="0.2 0 0"><joint name="leg" type="slide" axis="1 0 0" range="-0.1 0.1" limited="true"/>
<geom size="0.02" mass="1"/><site name="foot" pos="0.02 0 0"/></body></body></worldbody>
<actuator><motor joint="leg" ctrlrange="-5 5"/></actuator></mujoco>"""


class CustomLaw:
    """A sampled law of a user."""

    period = 1e-3

    def step(self, _: Any, state: Any, __: Any) -> Any:
        return state, None

    def parameters(self) -> Any:
        return None

    def start(self, **_: float) -> Any:
        return None

    def with_value(self, _: float) -> Any:
        return self


@pytest.fixture
def read(tmp_path: Path):
    def load(robot: str, text: str = FILE) -> pt.Task:
        path = tmp_path / "arm.toml"
        path.write_text(text.format(robot=robot))
        return pt.load_scenario(path)

    return load


def arm_projection(**options):
    model = load_model(ARM)
    return project_site(model, make_data(model, keyframe="bent"), SensorSite("fingertip", SENSOR), **options)


def test_a_task_has_the_limits_of_the_robot() -> None:
    projection = arm_projection(joint_speeds={"wrist": "90 deg/s"})
    task = projection.task(SCENARIO, OBJECTIVE, bounds=(-10.0, -0.01))
    assert {limit.name: limit.limit for limit in task.limits} == {
        "excursion": projection.retreat,
        "speed": projection.speed.least,
        "acceleration": projection.acceleration.least,
    }
    assert projection.speed.least < 2.0
    assert task.sensor == SENSOR
    assert task.scenario == SCENARIO  # a fixed base does not recoil
    assert pt.design(task).gain == pytest.approx(-0.7463, abs=1e-4)


def test_an_infeasible_design_names_what_in_the_robot_model_limits_it() -> None:
    model = load_model(ARM)
    model.actuator_forcerange[:], model.actuator_ctrlrange[:] = (-0.01, 0.01), (-0.01, 0.01)
    model.opt.gravity[:] = 0.0
    projection = project_site(model, make_data(model, keyframe="bent"), SensorSite("fingertip", SENSOR))
    task = projection.task(SCENARIO, OBJECTIVE, bounds=(-10.0, -1.0))
    (limit,) = (limit for limit in task.limits if limit.name == "acceleration")
    assert limit.source == projection.acceleration.reason != ""
    design = pt.design(task)
    assert design.status == "infeasible"
    (raised,) = (one for relaxation in design.relaxations for one in relaxation.limits if one.name == "acceleration")
    assert raised.source == limit.source
    assert f"(limit: {limit.source})" in page_of(design).next_step
    assert "raise the limit" not in page_of(design).next_step
    tighter = pt.Constraint(name="acceleration", limit=limit.limit / 2)
    own = pt.design(projection.task(SCENARIO, OBJECTIVE, bounds=(-10.0, -1.0), constraints=[tighter]))
    assert "raise the limit of acceleration" in page_of(own).next_step


def test_the_tighter_one_of_two_limits_remains() -> None:
    projection = arm_projection()
    limits = [pt.Constraint(name="excursion", limit=0.05), pt.Constraint(name="acceleration", limit=1e4)]
    task = projection.task(SCENARIO, OBJECTIVE, bounds=(-10.0, -0.01), constraints=limits)
    found = {limit.name: limit.limit for limit in task.limits}
    assert found["excursion"] == 0.05
    assert found["acceleration"] == projection.acceleration.least


def test_a_floating_base_divides_the_admittance_by_one_minus_its_recoil() -> None:
    """The controller moves the foot relative to the base, which recoils by a quarter of it."""
    model = mujoco.MjModel.from_xml_string(FLOATING)
    projection = project_site(model, make_data(model), SensorSite("foot", SENSOR))
    task = projection.task(SCENARIO, OBJECTIVE, bounds=(-10.0, -0.01))
    a = task.scenario.admittance
    assert (a.mass, a.damping, a.stiffness) == pytest.approx((4 / 3, 40 / 3, 100 / 3))
    assert {limit.name: limit.limit for limit in task.limits}["excursion"] == pytest.approx(0.75 * 0.1)
    # the same encounter, with the controller's motion s integrated independently: x = 0.75 s
    motion = pt.find_contact(task.scenario, SENSOR, -0.7)
    assert motion.contact.relative_velocity == pytest.approx(_contact_speed_with_recoil(0.25, -0.7), rel=1e-7)


def _contact_speed_with_recoil(share: float, gain: float) -> float:
    """Integrate M s'' + D s' + K s = F_p for the encounter seen by a site that moves by (1 - share) s."""
    from scipy.integrate import solve_ivp

    def rates(t, y):
        s, v = y
        distance = 0.0422 - 0.3 * t - (1 - share) * s
        slope = -3.32 / (distance + 0.0419)
        force = gain * slope * (-0.3 - (1 - share) * v)
        return [v, force - 10.0 * v - 25.0 * s]

    def touch(t, y):
        return 0.0422 - 0.3 * t - (1 - share) * y[0]

    touch.terminal = True
    end = solve_ivp(rates, (0, 5), [0.0, 0.0], events=touch, rtol=1e-11, atol=1e-13)
    return -0.3 - (1 - share) * end.y[1, -1]


def test_a_custom_sampled_law_on_a_floating_base_is_refused() -> None:
    """Its admittance is unknown, so the recoil of the base has an unknown effect."""
    model = mujoco.MjModel.from_xml_string(FLOATING)
    projection = project_site(model, make_data(model), SensorSite("foot"))
    task = pt.load_scenario(ROOT / "examples/loop.toml")
    with refused("loop"):
        projection.apply(task.replace(loop=dataclasses.replace(task.loop, law=CustomLaw())))


def test_a_file_gives_the_task_of_the_robot(read) -> None:
    task = read(BENT + 'posture = { elbow = "-80 deg" }\njoint_speeds = { wrist = "90 deg/s" }')
    model = load_model(ARM)
    data = make_data(model, {"elbow": -80 * np.pi / 180}, keyframe="bent")
    projection = project_site(model, data, SensorSite("fingertip"), joint_speeds={"wrist": np.pi / 2})
    assert task.limits == projection.constraints()
    assert task.impact.robot_mass == projection.reflected_mass
    assert ARM in task.source.inputs
    assert task.loop is None


def test_a_mass_in_the_file_is_kept(read) -> None:
    task = read(BENT, FILE.replace("[impact]\n", '[impact]\nrobot_mass = "3 kg"\n'))
    assert task.impact.robot_mass == 3.0


@pytest.mark.parametrize(
    ("robot", "fields"),
    [
        ('model = "no.xml"\nsite = "tip"', {"argument": "robot.model", "value": "no.xml"}),
        ('model = "arm.toml"\nsite = "tip"', {"argument": "robot.model", "value": "arm.toml"}),
        (BENT.replace("fingertip", "thumb"), {"argument": "robot.site", "value": "thumb"}),
        (BENT.replace("bent", "folded"), {"argument": "robot.keyframe", "value": "folded"}),
        (BENT + "posture = { elbow = true }", {"argument": "robot.posture"}),
        (BENT + 'posture = { elbow = "8 mm" }', {"argument": "robot"}),
        (BENT + 'axis = "up"', {"argument": "robot.axis", "value": "up"}),
        (BENT + "axis = 3", {"argument": "robot.axis", "value": 3}),
        (BENT + 'hold = "all"', {"argument": "robot.hold", "value": "all"}),
        (BENT + 'mass = "3 kg"', {"argument": "robot.mass", "value": "3 kg"}),
        (BENT.replace('site = "fingertip"\n', ""), {"argument": "robot.site"}),
    ],
)
def test_a_mistake_in_the_file_is_one_sentence_with_its_line(read, robot: str, fields: dict[str, Any]) -> None:
    with refused(**fields, error=ScenarioFileError) as caught:
        read(robot)
    assert str(caught.value).count("\n") == 0
    assert "line " in str(caught.value)


@pytest.mark.parametrize(
    ("robot", "fields"), [('kind = "model"', {"argument": "robot"}), ('site = "fingertip"', {"argument": "robot.kind"})]
)
def test_a_robot_is_a_model_or_a_plant(read, robot: str, fields: dict[str, Any]) -> None:
    with refused(**fields, error=ScenarioFileError):
        read(robot)


def test_an_impact_without_a_mass_needs_a_robot_model(read) -> None:
    with refused("impact.robot_mass", error=ScenarioFileError):
        read("", FILE.replace("[robot]\n", ""))


def test_a_loop_with_a_robot_model_runs_with_its_limits(read) -> None:
    chain = '[chain]\nrate = "250 Hz"\n[controller]\nrate = "1 kHz"\nfloor = 0.0455\n'
    task = read(BENT, FILE + chain)
    assert task.loop is not None
    assert "excursion" in {limit.name for limit in task.limits}


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["design", "verify"])
def test_the_answers_repeat_the_warnings_about_the_robot(verb, tmp_path, read) -> None:
    chain = '[chain]\nrate = "250 Hz"\n[controller]\nrate = "1 kHz"\nfloor = 0.0455\n[verify]\nruns = 5\n'
    task = read(BENT.replace("bent", "stretched"), FILE + chain)
    assert any("singularity" in text for text in task.warnings)
    answer = pt.design(task) if verb == "design" else pt.verify(task, changes=False)
    assert set(task.warnings) <= set(answer.warnings)
    assert "singularity" in str(answer)
    assert "singularity" in pt.report.report_html(answer)
    assert not read(BENT, FILE).warnings


def run(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pretouch", "project", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)


@pytest.mark.slow
def test_the_command_prints_a_table_and_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run_here = command(monkeypatch, capsys)
    code, short, err = run_here("project", ARM)
    assert code == 0, err
    lines = short.splitlines()
    assert "1 site." in lines[0]
    assert "e-" not in short
    assert "joint_speeds" in short  # the model limits no speed
    assert len(lines) <= 20
    assert max(map(len, lines)) <= 120
    rows = json.loads(run_here("project", ARM, "--json")[1])["rows"]
    assert len(rows) == 4 * 3  # the posture of the model and three keyframes, three axes
    (bent,) = [row for row in rows if (row["keyframe"], row["site_axis"]) == ("bent", "+x")]
    assert bent["reflected_mass"] == pytest.approx(arm_projection().reflected_mass, rel=1e-12)
    assert [row["keyframe"] for row in rows if row.get("site_axis") == "+y" and "error" in row]
    verbose = run_here("project", ARM, "--verbose")[1]
    assert "singularity" in verbose
    assert "joint_speeds" in verbose


def test_the_command_refuses_with_one_sentence(tmp_path: Path) -> None:
    answer = run("no.xml", "--json", folder=tmp_path)
    assert answer.returncode == 2
    assert json.loads(answer.stdout)["status"] == "error"
    assert answer.stderr.startswith("pretouch: ")
    assert answer.stderr.count("\n") == 1


# --- models of other people

PLANAR = (
    '<robot name="planar"><link name="base">{0}</link><link name="upper"><visual><geometry>'
    '<mesh filename="package://arm/a.stl"/></geometry></visual>{0}</link><link name="lower">{0}</link>'
    '<link name="tool"/>{1}{2}<joint name="flange" type="fixed">'
    '<parent link="lower"/><child link="tool"/><origin xyz="0.4 0 0"/></joint></robot>'
)
INERTIAL = (
    '<inertial><origin xyz="0.2 0 0"/><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    "</inertial>"
)
HINGE = (
    '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="{} 0 0"/><axis xyz="0 1 0"/>'
    '<limit lower="-2" upper="2" effort="50" velocity="3"/></joint>'
)


@pytest.fixture
def planar(tmp_path: Path) -> Path:
    path = tmp_path / "planar.urdf"
    hinges = HINGE.format("shoulder", "base", "upper", 0), HINGE.format("elbow", "upper", "lower", 0.4)
    path.write_text(PLANAR.format(INERTIAL, *hinges))
    return path


def test_the_command_takes_a_site_a_posture_a_base_and_packages(planar: Path, monkeypatch, capsys) -> None:
    run = command(monkeypatch, capsys)
    posture = ("--posture", "elbow=-80deg", "--posture", "shoulder=0.2")
    code, out, err = run("project", str(planar), "--site", "tool:+x:50mm", *posture, "--json")
    assert (code, err) == (0, "")
    (row,) = json.loads(out)["rows"]
    assert row["posture"] == pytest.approx({"shoulder": 0.2, "elbow": np.radians(-80)})
    assert [text[:5] for text in row["warnings"]][:2] == ["PT540", "PT542"]
    code, out, err = run("project", str(planar), "--site", "tool:+z", "--joint", "shoulder", *posture, "--json")
    (row,) = json.loads(out)["rows"]
    assert list(row["posture"]) == ["shoulder"]
    assert run("project", str(planar), "--site", "tool:+x", "--base", "free", *posture, "--json")[0] == 0
    code, out, err = run("project", str(planar), "--site", "tool:+x", "--posture", "elbow")
    assert code == 2
    assert err.startswith("pretouch: --posture")


def test_a_file_with_a_body_gives_the_task_of_the_robot(read, planar: Path) -> None:
    place = f'model = "{planar.as_posix()}"\nbody = "tool"\naxis = "+x"\n'
    posture = 'posture = { shoulder = "20 deg", elbow = "-70 deg" }\n'
    task = read(place + 'offset = "50 mm"\n' + posture)
    model = load_model(planar, sites=["tool:+x:50mm"])
    data = make_data(model, {"shoulder": "20 deg", "elbow": "-70 deg"})
    projection = project_site(model, data, SensorSite("tool:+x:0.05 m"))
    assert task.impact.robot_mass == projection.reflected_mass
    limits = {limit.name: limit.limit for limit in task.limits}
    assert limits["speed"] == projection.speed.least
    for more in (
        'offset = ["50 mm", 0, 0]\n',
        'base = "fixed"\n',
        'packages = ["."]\njoints = ["shoulder", "elbow"]\n',
    ):
        other = read(place + more + posture)
        assert other.impact.robot_mass == pytest.approx(task.impact.robot_mass, rel=1e-9)  # on one axis


@pytest.mark.parametrize(
    ("place", "argument"),
    [
        ('site = "tool"\nbody = "tool"\n', "robot.site"),
        ("", "robot.site"),
        ('site = "tool"\noffset = "5 mm"\n', "robot.offset"),
        ('body = "tool"\naxis = [1, 0, 0]\n', "robot.axis"),
        ('body = "tool"\noffset = ["5 mm", 0]\n', "robot.offset"),
        ('body = "hand"\n', "robot.body"),
        ('body = "tool"\nbase = "loose"\n', "robot.base"),
        ('body = "tool"\njoints = "elbow"\n', "robot.joints"),
    ],
)
def test_a_wrong_place_of_the_sensor_is_one_sentence(read, planar: Path, place: str, argument: str) -> None:
    with refused(argument, error=ScenarioFileError):
        read(f'model = "{planar.as_posix()}"\n{place}')
