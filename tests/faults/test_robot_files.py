"""Robot files of other people: URDF, packages, meshes, sites on bodies, motors and bases."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

from pretouch.report.pages import page_of
from pretouch.robots import (
    RobotFile,
    SensorSite,
    SiteLaw,
    load_model,
    make_data,
    project,
    project_site,
    simulate_robot,
    site_on_body,
)
from pretouch.robots.model import notes_of
from pretouch.robots.scene import Ball, model_with_ball, put_ball
from refusals import refused
from robot_scenes import CURVE, controller

ROOT = Path(__file__).parents[2]
ARM = ROOT / "examples/robots/arm.xml"


def link(name: str, mass: float = 1.0, shape: str = "") -> str:
    tensor = f'<inertia ixx="{0.02 * mass}" iyy="{0.02 * mass}" izz="{0.02 * mass}" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><origin xyz="0.2 0 0"/><mass value="{mass}"/>{tensor}</inertial>' if mass else ""
    return f'<link name="{name}">{inertial}{shape}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", x: float = 0.0, more: str = "") -> str:
    limit = '<limit lower="-2" upper="2" effort="50" velocity="3"/>' if kind in {"revolute", "prismatic"} else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{x} 0 0"/>'
        f'<axis xyz="0 1 0"/>{limit}{more}</joint>'
    )


def mesh(uri: str, tag: str = "collision") -> str:
    return f'<{tag}><geometry><mesh filename="{uri}"/></geometry></{tag}>'


BOX = '<collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.1 0.1"/></geometry></collision>'


def urdf(*parts: str, name: str = "two links") -> str:
    return f'<robot name="{name}">{"".join(parts)}</robot>'


TWO_LINKS = urdf(
    link("base", 2.0),
    link("upper", 1.0, BOX),
    link("lower", 0.5, BOX),
    link("tool", 0.0),
    joint("shoulder", "base", "upper"),
    joint("elbow", "upper", "lower", x=0.4),
    joint("flange", "lower", "tool", "fixed", x=0.5),
)
BENT = {"shoulder": 0.3, "elbow": -1.2}


def write_stl(path: Path) -> None:
    """Write a tetrahedron with edges of 0.1 m along the axes."""
    corners = 0.1 * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    path.parent.mkdir(parents=True, exist_ok=True)
    data = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[list(face)].astype(np.float32).ravel(), 0) for face in faces)
    path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + data)


@pytest.fixture
def model_file(tmp_path: Path):
    def write(text: str, name: str = "robot.urdf") -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


def at_tool(model: Any, text: str = "tool:+x", **options: Any) -> Any:
    site = site_on_body(text)
    assert site is not None
    return project_site(model, make_data(model, BENT), SensorSite(site.name, axis=site.axis), **options)


def codes(result: Any) -> list[str]:
    """The codes of warnings about the file, the posture and the site."""
    return [text[:5] for text in result.warnings if text.startswith("PT54")]


# --- sites on bodies


@pytest.mark.parametrize(
    ("text", "name", "position"),
    [
        ("tool:+x", "tool:+x", (0.0, 0.0, 0.0)),
        ("tool:-z:50mm", "tool:-z:0.05 m", (0.0, 0.0, -0.05)),
        ("a/b:c:+y:0.1", "a/b:c:+y:0.1 m", (0.0, 0.1, 0.0)),
        ("tool:+x:0,-20,50mm", "tool:+x:0,-0.02,0.05 m", (0.0, -0.02, 0.05)),
        ("tool:+x:1cm, 0, 2 mm", "tool:+x:0.01,0,0.002 m", (0.01, 0.0, 0.002)),
    ],
)
def test_a_site_on_a_body_is_a_text(text: str, name: str, position: tuple[float, ...]) -> None:
    site = site_on_body(text)
    assert site is not None
    assert site.name == name
    assert site.position == pytest.approx(position)
    assert site_on_body(site.name) == site


@pytest.mark.parametrize("text", ["fingertip", "tool:x", "tool:+w:5mm", ":+x"])
def test_other_texts_are_no_sites_on_bodies(text: str) -> None:
    assert site_on_body(text) is None


@pytest.mark.parametrize(("text", "argument"), [("tool:+x:5 kg", "offset"), ("tool:+x:1,2mm", "offset")])
def test_a_wrong_offset_is_refused(text: str, argument: str) -> None:
    with refused(argument):
        site_on_body(text)


def test_an_unknown_body_is_refused_with_all_bodies(model_file) -> None:
    with refused("body", value="hand") as caught:
        load_model(model_file(TWO_LINKS), sites=["hand:+x"])
    assert "tool" in str(caught.value)
    with refused("sites", value="hand"):
        load_model(model_file(TWO_LINKS), sites=["hand"])


def test_a_site_on_a_body_is_the_same_as_a_site_of_the_model() -> None:
    site = load_model(ARM).site("fingertip")
    body = load_model(ARM).body(site.bodyid[0]).name
    place = ",".join(f"{v:.12g}" for v in site.pos)
    model = load_model(ARM, sites=[f"{body}:+x:{place} m"])
    mine, theirs = (
        project_site(model, make_data(model, keyframe="bent"), SensorSite(name))
        for name in (model.site(model.nsite - 1).name, "fingertip")
    )
    assert mine.to_dict() | {"site": "", "warnings": []} == theirs.to_dict() | {"site": "", "warnings": []}


def test_without_an_offset_a_site_is_at_the_outermost_surface(model_file) -> None:
    model = load_model(model_file(TWO_LINKS), sites=["lower:+x", "upper:-x", "tool:+x"])
    distances = [float(np.linalg.norm(model.site(name).pos)) for name in ("lower:+x", "upper:-x", "tool:+x")]
    assert distances == pytest.approx([0.4, 0.0, 0.0])  # the tool is 0.1 m ahead of the box of its rigid body


# --- what the file says


def test_a_urdf_arm_has_the_masses_of_its_equations_of_motion(model_file) -> None:
    """The independent mass matrix of a planar arm with two links."""
    projection = at_tool(load_model(model_file(TWO_LINKS), sites=["tool:+x"]))
    (m1, m2), (a, b, c, d), i = (1.0, 0.5), (0.4, 0.2, 0.2, 0.5), (0.02, 0.01)
    shoulder, elbow = BENT["shoulder"], BENT["elbow"]
    coupling = m2 * a * c * np.cos(elbow)
    own = m2 * c * c + i[1]
    mass = np.array([[m1 * b * b + i[0] + m2 * a * a + own + 2 * coupling, own + coupling], [own + coupling, own]])

    def arm(angle: float) -> np.ndarray:  # a turn about +y moves x to -z
        return np.array([np.cos(angle), -np.sin(angle)])

    def turned(v: np.ndarray) -> np.ndarray:  # its derivative
        return np.array([v[1], -v[0]])

    first, second = a * arm(shoulder), d * arm(shoulder + elbow)
    jacobian = np.column_stack([turned(first + second), turned(second)])
    row = arm(shoulder + elbow) @ jacobian
    assert projection.reflected_mass == pytest.approx(1 / (row @ np.linalg.solve(mass, row)), rel=1e-9)
    assert codes(projection) == ["PT542"]
    assert projection.posture == BENT
    assert projection.speed.least < 3.0 * 1.0  # the file limits both joints to 3 rad/s
    assert 0 < projection.force.least < np.inf  # and their efforts to 50 N m
    assert at_tool(load_model(model_file(TWO_LINKS), sites=["tool:+x"]), joint_speeds={"elbow": 0.3}).speed.least < (
        projection.speed.least
    )


def test_a_joint_that_follows_gets_no_motor(model_file) -> None:
    mimic = '<mimic joint="shoulder" multiplier="-2"/>'
    text = TWO_LINKS.replace(
        joint("elbow", "upper", "lower", x=0.4), joint("elbow", "upper", "lower", x=0.4, more=mimic)
    )
    model = load_model(model_file(text), sites=["tool:+z"])
    assert model.nu == 1
    site = SensorSite("tool:+z", axis="+z")
    projection = project_site(model, make_data(model, {"shoulder": 0.2, "elbow": -0.4}), site)
    assert projection.followers == ("elbow",)


def test_the_speed_limit_of_a_joint_that_follows_limits_the_joint_that_it_follows(model_file) -> None:
    """The elbow turns twice as fast as the shoulder, and its limit of 3 rad/s ends at 1.5 rad/s of the shoulder."""
    mimic = '<mimic joint="shoulder" multiplier="-2"/>'
    text = TWO_LINKS.replace(
        joint("elbow", "upper", "lower", x=0.4), joint("elbow", "upper", "lower", x=0.4, more=mimic)
    )
    model = load_model(model_file(text), sites=["tool:+z"])
    site, posture = SensorSite("tool:+z", axis="+z", hold="axis"), {"shoulder": 0.2, "elbow": -0.4}
    projection = project_site(model, make_data(model, posture), site)
    rate = abs(projection.joint_motion["shoulder"])
    assert projection.speed.least == pytest.approx(1.5 / rate)
    assert projection.speed.reasons[0] == "speed of elbow"
    slow = project_site(model, make_data(model, posture), site, joint_speeds={"elbow": 0.5})
    assert slow.speed.least == pytest.approx(0.25 / rate)


def test_an_effort_of_zero_is_taken_as_unlimited_and_said_below_the_table(model_file) -> None:
    text = TWO_LINKS.replace('effort="50"', 'effort="0"', 1)
    model = load_model(model_file(text), sites=["tool:+x"])
    table = project(model, [SensorSite("tool:+x")], BENT)
    (effort, limits) = (w for w in table.projections[0][1].warnings if w.startswith("PT502"))
    assert "Effort 0 of shoulder is taken as unlimited" in effort
    assert {effort.partition(": ")[2], limits.partition(": ")[2]} <= set(page_of(table).findings)


def test_links_without_inertial_have_no_mass_and_their_joints_are_held(model_file) -> None:
    wheel = link("wheel", 0.0, BOX) + joint("roll", "lower", "wheel", "continuous")
    model = load_model(model_file(TWO_LINKS.replace("</robot>", wheel + "</robot>")), sites=["tool:+x"])
    projection = at_tool(model)
    assert codes(projection) == ["PT542", "PT542"]
    assert "roll" in projection.warnings[0]
    assert projection.reflected_mass == at_tool(load_model(model_file(TWO_LINKS), sites=["tool:+x"])).reflected_mass


@pytest.mark.parametrize(
    ("tensor", "balanced"),
    [
        ('ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"', False),  # a point mass
        ('ixx="0.01" iyy="0.01" izz="0.05" ixy="0" ixz="0" iyz="0"', True),
        ('ixx="0.01" iyy="0.01" izz="0.01" ixy="0.02" ixz="0" iyz="0"', True),  # a negative principal moment
    ],
)
def test_an_impossible_inertia_is_balanced_and_said(model_file, tensor: str, balanced: bool) -> None:
    good = 'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"'
    model = load_model(model_file(TWO_LINKS.replace(good, tensor)), sites=["tool:+x"])
    projection = at_tool(model)
    assert codes(projection) == ["PT541"] * balanced + ["PT542"]
    moments = sum(float(part.split('"')[1]) for part in tensor.split()[:3]) / 3
    assert model.body("lower").inertia == pytest.approx(moments if balanced else 0.0, abs=1e-8)


def test_an_impossible_inertia_of_an_mjcf_file_is_balanced_too(model_file) -> None:
    body = (
        '<body><joint name="a" type="slide" axis="1 0 0" range="-1 1"/><inertial pos="0 0 0" mass="1" '
        'diaginertia="0.01 0.01 0.05"/><site name="tip"/></body>'
    )
    motor = '<actuator><motor joint="a" ctrlrange="-5 5"/></actuator>'
    model = load_model(model_file(f"<mujoco><worldbody>{body}</worldbody>{motor}</mujoco>", "robot.xml"))
    assert codes(project_site(model, make_data(model), SensorSite("tip"))) == ["PT541"]


def test_prefixes_without_a_declaration_are_read(model_file) -> None:
    text = TWO_LINKS.replace('effort="50"', 'effort="50" drake:acceleration="2"')
    assert load_model(model_file(text)).nu == 2


@pytest.mark.parametrize("text", ["<robot", "<robot><link></robot>", urdf(link("a") + link("a"))])
def test_a_broken_urdf_file_is_refused(model_file, text: str) -> None:
    with refused("model"):
        load_model(model_file(text))


# --- meshes and packages


@pytest.mark.parametrize(
    ("uri", "place", "options"),
    [
        ("meshes/a.stl", "robots/urdf/meshes/a.stl", {}),
        ("package://arm/meshes/a.stl", "robots/arm/meshes/a.stl", {}),  # from the folder of the file upward
        ("package://other/meshes/a.stl", "robots/meshes/a.stl", {}),  # the package has another name
        ("package://named/meshes/a.stl", "elsewhere/folder/meshes/a.stl", {"packages": ["elsewhere/folder"]}),
        ("package://arm/meshes/a.stl", "elsewhere/arm/meshes/a.stl", {"packages": ["elsewhere"]}),
        ("package://arm/meshes/a.stl", "ros/arm/meshes/a.stl", {"ROS_PACKAGE_PATH": "ros"}),
        ("package://arm/meshes/a.stl", "ament/share/arm/meshes/a.stl", {"AMENT_PREFIX_PATH": "ament"}),
        ("model://arm/meshes/a.stl", "gazebo/arm/meshes/a.stl", {"GAZEBO_MODEL_PATH": "gazebo"}),
    ],
)
def test_a_mesh_is_found(
    model_file, tmp_path: Path, monkeypatch, uri: str, place: str, options: dict[str, Any]
) -> None:
    write_stl(tmp_path / place)
    if options.get("packages") == ["elsewhere/folder"]:
        (tmp_path / "elsewhere/folder/package.xml").write_text("<package><name> named </name></package>")
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "GAZEBO_MODEL_PATH"):
        monkeypatch.delenv(variable, raising=False)
        if variable in options:
            monkeypatch.setenv(variable, f"/nowhere:{tmp_path / options[variable]}")
    text = TWO_LINKS.replace("</link><link", f"{mesh(uri)}</link><link", 1)
    path = model_file(text, "robots/urdf/robot.urdf")
    model = load_model(path, packages=[tmp_path / folder for folder in options.get("packages", ())], sites=["tool:+x"])
    assert model.nmesh == 1
    assert codes(at_tool(model)) == ["PT542"]


@pytest.mark.parametrize("tag", ["collision", "visual"])
@pytest.mark.parametrize(("uri", "exists"), [("package://gone/a.stl", False), ("a.dae", True), ("a.stl", True)])
def test_a_mesh_that_cannot_be_read_is_left_out_and_said(
    model_file, tmp_path: Path, tag: str, uri: str, exists: bool
) -> None:
    if exists:
        (tmp_path / uri).write_text("nothing")
    text = TWO_LINKS.replace("</link><link", f"{mesh(uri, tag)}</link><link", 1)
    model = load_model(model_file(text), sites=["tool:+x"])
    projection = at_tool(model)
    assert (model.nmesh, codes(projection)[0]) == (0, "PT540")
    assert projection.reflected_mass == at_tool(load_model(model_file(TWO_LINKS), sites=["tool:+x"])).reflected_mass


def test_meshes_with_equal_names_in_two_folders_are_both_read(model_file, tmp_path: Path) -> None:
    for folder in ("a", "b"):
        write_stl(tmp_path / folder / "part.stl")
    shapes = mesh("a/part.stl", "visual") + mesh("b/part.stl")
    model = load_model(model_file(TWO_LINKS.replace("</link><link", f"{shapes}</link><link", 1)), sites=["tool:+x"])
    assert codes(at_tool(model)) == ["PT542"]
    assert int((model.geom_contype > 0).sum()) == 3


def test_a_missing_mesh_of_an_mjcf_file_is_left_out_unless_a_mass_needs_it(model_file) -> None:
    text = """<mujoco><asset><mesh name="part" file="part.stl"/></asset><worldbody><body><joint name="a" type="slide"
        axis="1 0 0" range="-1 1"/>{}<geom type="mesh" mesh="part"/><site name="tip"/></body></worldbody>
        <actuator><motor joint="a" ctrlrange="-5 5"/></actuator></mujoco>"""
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
    model = load_model(model_file(text.format(inertial), "robot.xml"))
    assert codes(project_site(model, make_data(model), SensorSite("tip"))) == ["PT540"]
    with refused("model", value="part.stl"):
        load_model(model_file(text.format(""), "robot.xml"))
    scenery = text.format(inertial).replace("<worldbody>", '<worldbody><geom type="mesh" mesh="part"/>')
    assert load_model(model_file(scenery, "robot.xml")).nmesh == 0


# --- bases and joints


def test_a_free_base_recoils_as_in_a_model_with_a_free_joint(model_file) -> None:
    fixed, free = (
        at_tool(load_model(model_file(TWO_LINKS), base=base, sites=["tool:+x"])) for base in ("fixed", "free")
    )
    assert (fixed.base, free.base) == (0, 6)
    assert fixed.recoil_share == 0
    assert free.recoil_share > 0
    assert free.reflected_mass < fixed.reflected_mass
    with refused("base", value="loose"):
        load_model(model_file(TWO_LINKS), base="loose")


FLOATING = """<mujoco><worldbody><body name="root" pos="0 0 1">{}<geom size="0.1" mass="3"/>
  <body name="a" pos="0.1 0 0"><joint name="a" axis="0 1 0" range="-120 120"/>
  <geom pos="0.2 0 0" size="0.05" mass="1"/><body name="b" pos="0.4 0 0">
  <joint name="b" axis="0 1 0" range="-120 120"/><geom pos="0.2 0 0" size="0.05" mass="1"/>
  <site name="tip" pos="0.25 0 0"/></body></body></body></worldbody><actuator>
  <motor joint="a" ctrlrange="-50 50"/><motor joint="b" ctrlrange="-50 50"/></actuator>
  <keyframe><key name="bent" qpos="{} .4 -.8"/></keyframe></mujoco>"""
FREE = FLOATING.format("<freejoint/>", ".1 .2 .9 1 0 0 0")
STANDING = FLOATING.format("", "")


@pytest.mark.parametrize("keyframe", [None, "bent"])
@pytest.mark.parametrize(("text", "other", "base"), [(FREE, STANDING, "fixed"), (STANDING, FREE, "free")])
def test_a_changed_base_is_that_of_the_other_model(model_file, text: str, other: str, base: str, keyframe: Any) -> None:
    changed = load_model(model_file(text, "a.xml"), base=base)
    own = load_model(model_file(other, "b.xml"))
    found, expected = (
        project_site(model, make_data(model, None if keyframe else {"b": 0.7}, keyframe=keyframe), SensorSite("tip"))
        for model in (changed, own)
    )
    for name in ("reflected_mass", "moved_mass", "recoil_share", "conditioning"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-9, abs=1e-12)
    for a, b in zip(found.excursion, expected.excursion, strict=True):
        assert a.length == pytest.approx(b.length, abs=1e-6)
    assert found.acceleration.least == pytest.approx(expected.acceleration.least, rel=1e-6)


def test_other_joints_are_held_in_their_posture(model_file) -> None:
    """An arm whose elbow is held at an angle is an arm with one joint and a bent link."""
    robot = RobotFile(
        str(model_file(TWO_LINKS)), joints=("shoulder",), posture={"elbow": "-1.2"}, sites=(site_on_body("tool:+z"),)
    )
    model = load_model(robot)
    assert model.nu == 1
    data = make_data(model, {"shoulder": 0.3})
    assert data.joint("elbow").qpos[0] == pytest.approx(-1.2)
    found = project_site(model, data, SensorSite("tool:+z", axis="+z"))
    assert tuple(found.posture) == ("shoulder",)
    whole = load_model(model_file(TWO_LINKS), sites=["tool:+z"])
    state = make_data(whole, BENT)
    import mujoco

    mass, jacobian = np.zeros((2, 2)), np.zeros((3, 2))
    mujoco.mj_fullM(whole, state, mass)
    mujoco.mj_jacSite(whole, state, jacobian, None, 0)
    assert found.reflected_mass == pytest.approx(mass[0, 0] / (found.axis @ jacobian[:, 0]) ** 2, rel=1e-9)
    with refused("joints", value="knee"):
        load_model(model_file(TWO_LINKS), joints=["knee"])


# --- names and xacro


def test_a_name_that_nobody_knows_is_refused() -> None:
    with refused("model", value="no_such_robot_description"):
        load_model("no_such_robot_description")


@pytest.fixture
def packages_of_others(tmp_path: Path, monkeypatch):
    """Stand-ins for robot_descriptions and mujoco_menagerie with the interfaces of 3.3 and 2026.10."""
    folder = tmp_path / "packages"
    descriptions = folder / "robot_descriptions"
    descriptions.mkdir(parents=True)
    (descriptions / "__init__.py").write_text("")
    (descriptions / "_cache.py").write_text(
        "import os\n\n\ndef clone_to_directory(url, target, commit=None):\n    raise AssertionError('download')\n\n\n"
        "def clone_to_cache(name, commit=None):\n"
        "    return clone_to_directory('', os.path.join(os.environ['CACHE'], name), commit=commit).working_dir\n"
    )
    (descriptions / "two_links_description.py").write_text(
        "from os import path\n\nfrom ._cache import clone_to_cache\n\n"
        "URDF_PATH = path.join(clone_to_cache('two_links'), 'robot.urdf')\n"
    )
    (descriptions / "macro_description.py").write_text(
        "from os import path\n\nfrom ._cache import clone_to_cache\n\nFOLDER = clone_to_cache('macro')\n"
        "XACRO_PATH = path.join(FOLDER, 'robot.xacro')\nXACRO_ARGS = {'size': '0.1'}\n"
        "XACRO_PACKAGE_PATHS = {'arm': path.join(path.dirname(FOLDER), 'other', 'arm')}\n"
    )
    menagerie = folder / "mujoco_menagerie"
    menagerie.mkdir()
    (menagerie / "__init__.py").write_text(
        "import os, pathlib\n\ndef names():\n    return ['two_links_menagerie']\n\nclass Cache:\n    root = None\n"
        "    def is_cached(self, robot):\n        return pathlib.Path(os.environ['CACHE'], 'two_links').is_dir()\n\n\n"
        "class Robot:\n    default_model = 'robot'\n\n    def xml(self, entry, cache):\n"
        "        return pathlib.Path(os.environ['CACHE'], 'two_links', 'robot.urdf')\n\n\n"
        "def get(name):\n    return Robot()\n"
    )
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("CACHE", str(tmp_path / "cache"))
    import sys

    before = set(sys.modules)
    yield tmp_path / "cache"
    for name in set(sys.modules) - before:
        if name.startswith(("robot_descriptions", "mujoco_menagerie")):
            del sys.modules[name]


@pytest.mark.parametrize("name", ["two_links_description", "two_links_menagerie"])
def test_a_name_is_found_in_the_packages_without_a_download(packages_of_others: Path, name: str) -> None:
    with refused("model", value=name) as caught:
        load_model(name)
    assert name in caught.value.remedy
    (packages_of_others / "two_links").mkdir(parents=True)
    (packages_of_others / "two_links/robot.urdf").write_text(TWO_LINKS)
    assert load_model(name).nu == 2
    with refused("model") as caught:
        load_model("two_lins_description")
    assert "two_links_description" in str(caught.value)


def test_a_xacro_file_needs_xacro(model_file, monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "xacro", None)
    text = TWO_LINKS.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    assert load_model(model_file(text)).nu == 2  # a declaration without any macro
    with refused("model", remedy="pip install xacro"):
        load_model(model_file(text.replace("</robot>", '<xacro:property name="a" value="1"/></robot>')))
    with refused("model", remedy="pip install xacro"):
        load_model(model_file(text, "robot.urdf.xacro"))


def stand_in_for_xacro(monkeypatch) -> None:
    """Replace xacro by a stand-in that knows $(find arm) and $(arg NAME)."""
    import sys
    import types

    def process_file(name: str, mappings: dict[str, str]) -> Any:
        from ament_index_python.packages import get_package_share_directory

        package = "gone" if "gone" in name else "arm"
        text = Path(name).read_text()
        if "$(find " in text:
            text = text.replace(f"$(find {package})", get_package_share_directory(package))
        for key in re.findall(r"\$\(arg (\w+)\)", text):
            if key not in mappings:
                raise ValueError(f"Undefined substitution argument {key}")
            text = text.replace(f"$(arg {key})", mappings[key])
        return types.SimpleNamespace(toxml=lambda: text)

    monkeypatch.setitem(sys.modules, "xacro", types.SimpleNamespace(process_file=process_file))


def test_xacro_finds_packages_in_our_folders(model_file, tmp_path: Path, monkeypatch) -> None:
    import sys

    stand_in_for_xacro(monkeypatch)
    write_stl(tmp_path / "arm/a.stl")
    text = TWO_LINKS.replace("</link><link", f"{mesh('$(find arm)/a.stl')}</link><link", 1)
    assert load_model(model_file(text, "files/robot.xacro")).nmesh == 1
    assert "ament_index_python" not in sys.modules
    with refused("model", value=str(tmp_path / "files/gone.xacro")):
        load_model(model_file(text, "files/gone.xacro"))


def test_arguments_of_a_xacro_file_follow_its_path(model_file, monkeypatch) -> None:
    stand_in_for_xacro(monkeypatch)
    text = TWO_LINKS.replace("<robot ", '<robot version="$(arg name)$(arg kind)" ')
    path = model_file(text, "a folder/robot.xacro")
    with refused("model", value=str(path)):
        load_model(f"{path} name:=arm")
    robot = RobotFile(f"{path} name:=arm kind:=a/b.c")
    assert robot.file == path
    assert robot.arguments == {"name": "arm", "kind": "a/b.c"}
    assert load_model(robot).nu == 2
    strange = model_file(text, "robot name:=arm kind:=b.xacro")  # a file of this name
    assert RobotFile(str(strange)).file == strange
    assert not RobotFile(str(strange)).arguments
    with refused("model", value=str(path.with_name("gone.xacro"))):
        load_model(f"{path.with_name('gone.xacro')} name:=arm")


def test_a_name_of_a_xacro_file_brings_its_arguments_and_packages(
    packages_of_others: Path, model_file, monkeypatch
) -> None:
    """Like the UR5e of robot_descriptions, which is a type of one file for all robots of its maker."""
    stand_in_for_xacro(monkeypatch)
    folder = packages_of_others / "macro"
    folder.mkdir(parents=True)
    with refused("model", value="macro_description", remedy="robot_descriptions pull macro_description"):
        load_model("macro_description")
    write_stl(packages_of_others / "other/arm/a.stl")
    text = TWO_LINKS.replace("</link><link", f"{mesh('$(find arm)/a.stl')}</link><link", 1)
    text = (
        text.replace('"0.0', '"$(arg size)', 1)
        if '"0.0' in text
        else text.replace("<robot ", '<robot a="$(arg size)" ')
    )
    (folder / "robot.xacro").write_text(text.replace("<robot ", '<robot version="$(arg size)" '))
    assert load_model("macro_description").nmesh == 1
    assert load_model("macro_description size:=0.2").nmesh == 1


def test_xacro_itself_expands_macros_and_arguments(model_file, tmp_path: Path) -> None:
    pytest.importorskip("xacro", reason="needs the package 'xacro'")
    write_stl(tmp_path / "arm/a.stl")
    text = TWO_LINKS.replace("</link><link", f"{mesh('$(find arm)/a.stl')}</link><link", 1)
    text = text.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', 1).replace(
        "</robot>",
        '<xacro:arg name="gripper" default="false"/><xacro:if value="$(arg gripper)"><link name="pad"/>'
        '<joint name="pad" type="fixed"><parent link="tool"/><child link="pad"/></joint></xacro:if></robot>',
    )
    path = model_file(text, "files/robot.urdf.xacro")
    plain, gripper = load_model(path), load_model(f"{path} gripper:=true")
    assert (plain.nmesh, gripper.nbody) == (1, plain.nbody + 1)


@pytest.mark.parametrize("end", ["parent", "child"])
def test_a_joint_of_a_missing_link_is_named(model_file, end: str) -> None:
    ends = {"parent": "tool", "child": "tool", end: "gone"}
    connected = "".join(f'<{side} link="{name}"/>' for side, name in ends.items())
    joint = f'<joint name="hand" type="fixed">{connected}</joint>'
    with refused("model", value="hand") as caught:
        load_model(model_file(TWO_LINKS.replace("</robot>", f"{joint}</robot>")))
    assert "'gone'" in str(caught.value)


def test_the_inertia_of_a_thin_rod_stays(model_file) -> None:
    """MuJoCo refuses moments of inertia below 1e-14 kg m^2; the others stay, and nothing is to be warned about."""
    rod = (
        '<link name="rod"><inertial><mass value="0.003"/><inertia ixx="1.1e-7" iyy="1e-15" izz="1.1e-7" ixy="0" '
        'ixz="0" iyz="1e-12"/></inertial></link><joint name="rod" type="fixed"><parent link="tool"/><child link="rod"/>'
        "</joint>"
    )
    model = load_model(model_file(TWO_LINKS.replace("</robot>", f"{rod}</robot>")))
    np.testing.assert_allclose(sorted(model.body("rod").inertia)[1:], 1.1e-7, rtol=1e-6)
    assert sorted(model.body("rod").inertia)[0] < 1e-13
    assert not any(note.startswith("PT541") for note in notes_of(model))


def test_what_mujoco_ignores_in_a_file_is_a_warning(model_file, capfd) -> None:
    """Equal limits, and a coupling to a joint that does not exist. Nothing is printed, and no file is written."""
    import mujoco

    before = mujoco.MjLogConfig.get().logfile
    stuck = re.sub(r'lower="[^"]*" upper="[^"]*"', 'lower="0" upper="0"', TWO_LINKS, count=1)
    for text, named in (
        (stuck, "equal lower and upper limits"),
        (TWO_LINKS.replace("</joint>", '<mimic joint="gone"/></joint>', 1), "'gone'"),
    ):
        (note,) = (n for n in notes_of(load_model(model_file(text))) if n.startswith("PT621"))
        assert named in note
    named = '<visual name="a"><geometry><box size="1 1 1"/></geometry></visual>'
    twice = TWO_LINKS.replace("</link><link", f"{named}{named}</link><link", 1)
    for text in (TWO_LINKS, twice):
        assert not any(n.startswith("PT621") for n in notes_of(load_model(model_file(text))))
    assert capfd.readouterr() == ("", "")
    assert mujoco.MjLogConfig.get().logfile == before


@pytest.mark.parametrize(("place", "touches"), [("tool0:+x", True), ("tool0:+x:60mm", False)])
def test_a_robot_of_a_urdf_file_meets_an_added_ball(place: str, touches: bool) -> None:
    """The ball has its mass, although a URDF file has no masses by geoms. Ahead of all shapes, it touches nothing."""
    robot = RobotFile(str(ARM.with_name("arm.urdf")), sites=(site_on_body(place),))
    site = SensorSite(robot.sites[0].name, CURVE)
    state = make_data(load_model(robot), {"shoulder": -0.7, "elbow": 1.4})
    ball = Ball(distance=0.04, velocity=-0.3, mass=0.3)
    model, data = put_ball(model_with_ball(robot, gravity=False), state, site, ball)
    model.opt.timestep = 1e-3
    assert model.body("pretouch ball").mass[0] == 0.3
    result = simulate_robot(model, data, [SiteLaw(site=site, controller=controller())], contact_stiffness=1e4)
    (contact,) = result.contacts[0]
    assert contact.detection.obstacle_mass == pytest.approx(0.3)
    assert (contact.peak_force > 0) == touches
    assert any("no shape of the model" in text for text in result.warnings) != touches


# --- the table


def test_sites_that_cannot_be_projected_do_not_fail_a_model() -> None:
    text = ARM.read_text().replace("<worldbody>", '<worldbody><site name="floor mark"/>', 1)
    path = ARM.with_name("arm.xml")
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    table = project(model)
    assert {row.site for row, _ in table.projections} == {"fingertip"}
    reasons = {row.reason for row in table.rows if row.site == "floor mark"}
    assert len(reasons) == 1
    assert "fixed to the world" in str(table)
    assert path.is_file()


def test_a_table_of_chosen_sites_has_their_axis_only(model_file) -> None:
    model = load_model(model_file(TWO_LINKS), sites=["tool:-z", "lower:+z:10mm"])
    sites = [SensorSite("tool:-z", axis="-z"), SensorSite("lower:+z:0.01 m", axis="+z")]
    rows = project(model, sites).rows
    assert [(row.site, row.axis, row.posture) for row in rows] == [
        ("tool:-z", "-z", "reference"),
        ("lower:+z:0.01 m", "+z", "reference"),
    ]
    assert [row.posture for row in project(model, sites, BENT).rows] == ["given"] * 2
    with refused("site") as caught:
        project(load_model(model_file(TWO_LINKS)))
    assert "tool:+z" in str(caught.value)


def test_joints_outside_their_ranges_stand_in_the_middle(model_file) -> None:
    text = TWO_LINKS.replace('lower="-2" upper="2"', 'lower="-2.5" upper="-0.5"')
    model = load_model(model_file(text), sites=["tool:+z"])
    (row,) = project(model, [SensorSite("tool:+z", axis="+z")]).rows
    assert row.posture == "mid-range"
    assert row.projection is not None
    assert row.projection.posture == {"shoulder": -1.5, "elbow": -1.5}
    assert codes(row.projection)[0] == "PT543"
