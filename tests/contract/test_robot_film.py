"""`pretouch robot` and the film of a simulated robot: the scene of a file, its report, and what is refused."""

from __future__ import annotations

import base64
import json
import re
import shutil
import types
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_text import command

import pretouch as pt
from page_checks import parse
from pretouch.config.robot_encounter import simulate_robot_file
from pretouch.errors import InvalidInputError, ScenarioFileError
from pretouch.report import plots, report_html, robot_film
from pretouch.robots import SensorSite, make_data, rendering, view_robot
from refusals import refused
from robot_scenes import ARM, CURVE

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

EXAMPLES = ARM.parent
TEXT = (EXAMPLES / "arm.toml").read_text(encoding="utf-8")
IMAGE = re.compile(r"data:image/webp;base64,([A-Za-z0-9+/=]+)")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("arm.xml", "arm.toml", "leg.xml", "gripper.xml"):
        shutil.copy(EXAMPLES / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(folder, monkeypatch, capsys):
    return command(monkeypatch, capsys)


@pytest.fixture(scope="module")
def result():
    path = EXAMPLES / "arm.toml"
    return simulate_robot_file(path, pt.load_scenario(path))


def simulate(text: str, gain: float | None = None, **options):
    Path("scene.toml").write_text(text, encoding="utf-8")
    task = pt.load_scenario("scene.toml")
    return simulate_robot_file("scene.toml", task if gain is None else task.replace(gain=gain), **options)


def images(page: str):
    from PIL import Image

    return [Image.open(BytesIO(base64.b64decode(data))) for data in IMAGE.findall(page)]


# --- the command


def test_robot_prints_the_contact_next_to_its_prediction(run, folder) -> None:
    code, out, err = run("robot", "arm.toml", "--no-report")
    assert (code, err) == (0, "")
    assert len(out.splitlines()) <= 15
    task = pt.load_scenario("arm.toml")
    speed = abs(float(pt.find_contact(task.scenario, task.sensor, pt.design(task).gain).contact.relative_velocity))
    # 1 kHz: the sampled law deviates by less than 0.5 % from the law in continuous time
    assert float(re.search(r"touches the object at ([\d.]+) m/s", out)[1]) == pytest.approx(speed, rel=0.005)
    assert not (folder / "arm-robot.html").exists()


def test_robot_as_json_has_every_run(run) -> None:
    code, out, err = run("robot", "arm.toml", "--gain", "-0.4 N*s", "--runs", "2", "--json")
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert len(answer["sites"]["fingertip"]["simulated"]) == 2
    assert answer["order"] == [["fingertip"], ["fingertip"]]
    assert "35 mm" in answer["notes"][0]


@pytest.mark.slow
def test_robot_writes_a_report_without_scripts_and_addresses(run, folder) -> None:
    code, _, err = run("robot", "arm.toml", "--output", "film.html")
    assert (code, err) == (0, "")
    page = (folder / "film.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "http" not in re.sub(r"data:image[^\"]*", "", page).replace("http-equiv", "")
    assert "torque of the drives" in page or "<svg" in page
    (note,) = json.loads(run("robot", "arm.toml", "--json")[1])["notes"]
    assert parse(page).words.count(note) == 1
    assert run("robot", "arm.toml", "--verbose", "--no-report")[1].count(note[:40]) == 1


def test_a_viewer_without_a_display_is_refused(run, monkeypatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    code, _, err = run("robot", "arm.toml", "--view", "--no-report")
    assert code == 2
    assert len(err.splitlines()) == 1
    assert "display" in err


# --- scenes


def test_an_object_of_the_model_approaches_with_the_velocity_of_the_file(folder) -> None:
    """The object is 39 mm from the right finger; the 1-D encounter starts at this distance."""
    text = (
        TEXT.replace('"arm.xml"', '"gripper.xml"').replace('"fingertip"', '"right"').replace("keyframe", "# keyframe")
    )
    found = simulate(text.replace('mass = "1 kg"', 'mass = "0.2 kg"'))
    detection = found.contacts[0][0].detection
    assert (detection.distance, detection.relative_velocity) == pytest.approx((0.039, -0.3))
    assert "'object'" in found.notes[0]
    assert found.order() == ("right",)


def test_a_leg_falls_onto_the_ground_of_its_model(folder) -> None:
    robot = 'model = "leg.xml"\nsite = "sole"\nposture = { height = "-110 mm" }\n'
    text = re.sub(r"\[robot\]\n(.*\n)+?\n", f"[robot]\n{robot}\n", TEXT).replace(
        'site = "sole"', 'site = "sole"\nkeyframe = "crouched"'
    )
    found = simulate(text)
    detection = found.contacts[0][0].detection
    assert detection.relative_velocity == pytest.approx(-0.3)
    assert detection.acceleration == pytest.approx(-9.81)
    simulated, predicted = (f("sole", "relative_velocity") for f in (found.simulated, found.predicted))
    assert simulated == pytest.approx(predicted, rel=0.01)


def test_a_robot_approaches_a_fixed_object(folder) -> None:
    wall = (
        '<body pos="0.9 0 0.35"><geom name="wall" type="box" size="0.02 0.3 0.3" contype="2" conaffinity="1"/></body>'
    )
    text = (EXAMPLES / "arm.xml").read_text().replace("</worldbody>", f"{wall}</worldbody>")
    place = make_data(mujoco.MjModel.from_xml_string(text), keyframe="bent").site("fingertip").xpos
    text = text.replace('pos="0.9 0 0.35"', f'pos="{place[0] + 0.08} 0 {place[2]}"')
    Path("wall.xml").write_text(text)
    moved = TEXT.replace("arm.xml", "wall.xml").replace('"-0.3 m/s"', '"0 m/s"') + '[reference]\nvelocity = "0.2 m/s"\n'
    found = simulate(moved)
    assert "'wall'" in found.notes[0]
    assert found.contacts[0][0].detection.relative_velocity == pytest.approx(-0.2, rel=0.01)
    assert found.order() == ("fingertip",)


def test_the_step_of_the_model_is_divided_to_fit_the_controller(folder) -> None:
    Path("arm.xml").write_text((EXAMPLES / "arm.xml").read_text().replace('timestep="0.0005"', 'timestep="0.0006"'))
    assert simulate(TEXT).model.opt.timestep == pytest.approx(0.0005)


def test_the_loop_of_the_file_is_the_one_that_runs(folder) -> None:
    loop = '[chain]\nrate = "250 Hz"\nnoise = 1e-6\n[controller]\nrate = "500 Hz"\nfloor = 0.01\ngain = "-0.5 N*s"\n'
    found = simulate(TEXT + loop, runs=2)
    (law,) = found.laws
    assert (law.controller.period, law.controller.law.value, law.chain.rate) == (2e-3, -0.5, 250.0)
    speeds = found.simulated("fingertip", "relative_velocity")
    assert speeds[0] != speeds[1]  # each run has its own noise


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        (lambda text: re.sub(r"\[robot\]\n(.*\n)+?\n", "", text) + 'robot_mass = "1 kg"\n', {"argument": "scene.toml"}),
        (lambda text: text + '[plant]\nvelocity = "0.1 m/s"\n', {"argument": "scene.toml"}),
        (
            lambda text: text.replace("[objective]", '[[obstacle.course]]\nduration = "1 s"\n[objective]'),
            {"argument": "obstacle.course[0].until"},
        ),
        (
            lambda text: re.sub(r"\[gain\]\n.*\n", "", text) + '[law]\nkind = "virtual-drag"\nratio = 0.3\n',
            {"argument": "law"},
        ),
    ],
    ids=["no model", "moving robot", "course", "drag without loop"],
)
def test_encounters_that_the_robot_cannot_have_are_refused(folder, change, fields: dict[str, Any]) -> None:
    with refused(**fields, error=(InvalidInputError, ScenarioFileError)):
        simulate(change(TEXT))


# --- the film


@pytest.mark.slow
def test_the_film_has_an_animation_and_six_stills(result) -> None:
    page = report_html(result)
    still, moving, *stills = images(page)
    assert len(stills) == 6
    assert (still.size, moving.size) == ((480, 360), (480, 360))
    assert not getattr(still, "is_animated", False)  # for readers who ask for reduced motion
    assert moving.n_frames > 20
    assert moving.info["loop"] == 0
    assert "prefers-reduced-motion" in page
    assert sum(map(len, IMAGE.findall(page))) < 500_000
    assert re.findall(r">([^<]*), contact</li>", page) == ["463 ms"]
    first, last = (np.asarray(image.convert("RGB"), dtype=float) for image in (stills[0], stills[-1]))
    assert np.abs(first - last).max() > 50  # the arm has moved


@pytest.mark.slow
def test_without_opengl_the_frames_are_planar_drawings(result, monkeypatch) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("no OpenGL")

    monkeypatch.setattr(mujoco, "Renderer", broken)
    page = report_html(result)
    assert page.count("planar drawings") == 1
    camera = rendering.camera_for(result.model, result.trace().configuration, result.laws[0].site)
    drawn = robot_film._drawing(result.model, result.trace().configuration[0], camera).astype(int)
    orange = (drawn[:, :, 0] - drawn[:, :, 2] > 100).sum()
    expected = np.pi * (0.035 * 360 / camera.height) ** 2  # the ball has a radius of 35 mm
    assert orange == pytest.approx(
        expected, rel=0.07
    )  # a line of 0.8 pixels is drawn along the edge; the radius is 21 pixels


def test_opengl_and_the_drawing_show_the_ball_at_the_same_place(result) -> None:
    trace = result.trace()
    camera = rendering.camera_for(result.model, trace.configuration, result.laws[0].site)
    frames = rendering.render_frames(result.model, trace.configuration[:1], camera, width=480, height=360)
    if frames is None:
        pytest.skip("MuJoCo finds no OpenGL on this computer")
    places = []
    for frame in (frames[0], robot_film._drawing(result.model, trace.configuration[0], camera)):
        color = frame.astype(int)
        rows, columns = np.nonzero(color[:, :, 0] - color[:, :, 2] > 100)
        places.append((rows.mean(), columns.mean()))
    rendered, drawn = np.array(places) - (179.5, 239.5)
    perspective = camera.height / 2 / np.tan(np.radians(22.5)) / camera.distance  # 45 deg is MuJoCo's default
    # shading darkens one side of the ball, which moves its center by less than a quarter of its radius, 21 pixels
    assert rendered == pytest.approx(perspective * drawn, abs=5)


@pytest.mark.parametrize(
    ("geom", "area"),
    [
        ('type="sphere" size="0.1"', np.pi * 0.01),
        ('type="capsule" size="0.05 0.1"', np.pi * 0.0025 + 0.1 * 0.2),
        ('type="cylinder" size="0.05 0.1" euler="90 0 0"', np.pi * 0.0025),
        ('type="box" size="0.05 0.3 0.2"', 4 * 0.05 * 0.2),
        ('type="ellipsoid" size="0.1 0.2 0.05"', np.pi * 0.1 * 0.05),
        ('type="plane" size="1 1 0.1"', 0.0),
    ],
    ids=["sphere", "capsule", "cylinder", "box", "ellipsoid", "plane"],
)
def test_a_silhouette_has_the_area_of_the_body_in_the_view(geom: str, area: float, monkeypatch) -> None:
    """A circle of 24 corners has 98.9 % of the area of the circle, sin(2 pi/24) / (2 pi/24)."""
    monkeypatch.setattr(rendering, "_ELEVATION", 0.0)
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody><geom {geom}/></worldbody></mujoco>")
    camera = rendering.Camera(np.zeros(3), 1.0, 90.0, 1.0)
    total = 0.0
    for silhouette in rendering.silhouettes(model, np.zeros(0), camera):
        x, y = silhouette.outline.T
        total += 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))
    assert total == pytest.approx(area, rel=0.012)


def test_a_filmstrip_is_a_figure_too(result) -> None:
    figure = plots.robot_film(result)
    assert len(figure.axes) == 6
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert [title.partition(", ")[2] for title in titles[-2:]] == ["contact", "after contact"]
    assert titles[0] == "0 ms, 42.2 mm"


@pytest.mark.slow
def test_an_encounter_without_contact_has_a_film_as_well(folder, monkeypatch) -> None:
    short = partial(pt.robots.simulate_robot, horizon=1.0)  # s, instead of 10 s
    monkeypatch.setattr("pretouch.robots.simulate_robot", short)
    found = simulate(TEXT.replace('"-0.3 m/s"', '"0.3 m/s"'), gain=-0.5)
    assert found.order() == ()
    assert len(images(report_html(found))) == 8


def test_the_viewer_replays_the_run_until_its_window_is_closed(result, monkeypatch) -> None:
    shown = []

    class Window:
        def __enter__(self):
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def is_running(self) -> bool:
            return len(shown) < 60

        def sync(self) -> None:
            shown.append(float(self.data.qpos[0]))

    def launch(model, data):
        window = Window()
        window.data = data
        return window

    monkeypatch.setitem(__import__("sys").modules, "mujoco.viewer", types.SimpleNamespace(launch_passive=launch))
    monkeypatch.setattr("time.sleep", lambda _: None)
    monkeypatch.setenv("DISPLAY", ":0")
    view_robot(result)
    trace = result.trace()
    times = np.arange(60) / 500  # 50 frames per second, ten times slower
    assert shown == pytest.approx(np.interp(times, trace.time, trace.configuration[:, 0]), abs=5e-3)


def test_a_camera_sees_all_that_moves(result) -> None:
    trace = result.trace()
    camera = rendering.camera_for(result.model, trace.configuration, SensorSite("fingertip", CURVE))
    data = make_data(result.model)
    half = camera.height / 2
    for row in trace.configuration[[0, -1]]:
        data.qpos[:] = row
        mujoco.mj_kinematics(result.model, data)
        seen = (np.array([data.geom(n).xpos for n in ("finger", "upper link")]) - camera.target) @ camera.frame.T
        assert np.abs(seen[:, 0]).max() < half * 4 / 3
        assert np.abs(seen[:, 1]).max() < half


DRESSED = """<mujoco><asset><mesh name="skin" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset><worldbody><body>
<joint name="a" type="slide" axis="1 0 0" range="-1 1"/><geom name="hull" size="0.1" mass="1"/>
<geom name="visual" type="mesh" mesh="skin" contype="0" conaffinity="0" mass="0"/>
<site name="tip" pos="0.1 0 0"/></body>
<body name="bare" pos="0.5 0 0"><geom name="plain" size="0.05"/></body>
{wall}</worldbody></mujoco>"""
WALL = '<geom type="box" size="1 0.01 1" pos="0 {} 0"/>'


def test_collision_shapes_of_bodies_with_visual_meshes_are_not_drawn() -> None:
    model = mujoco.MjModel.from_xml_string(DRESSED.format(wall=""))
    shown = rendering.visual_model(model)
    alphas = {shown.geom(i).name: float(shown.geom_rgba[i, 3]) for i in range(shown.ngeom)}
    assert alphas == {"hull": 0.0, "visual": 1.0, "plain": 1.0}
    assert float(model.geom("hull").rgba[3]) == 1.0
    camera = rendering.camera_for(model, np.zeros((1, 1)), SensorSite("tip", CURVE))
    assert len(rendering.silhouettes(model, np.zeros(1), camera)) == 2


@pytest.mark.parametrize(("walls", "sides"), [((), {1}), ((-0.3,), {-1}), ((0.3,), {1}), ((-0.3, 0.3), {-1, 1})])
def test_the_camera_looks_from_where_nothing_hides_the_sensor(walls, sides: set[int]) -> None:
    """The camera looks along +y (side 1) unless a wall is there."""
    text = DRESSED.format(wall="".join(WALL.format(y) for y in walls))
    model = mujoco.MjModel.from_xml_string(text)
    camera = rendering.camera_for(model, np.zeros((1, 1)), SensorSite("tip", CURVE))
    assert int(np.sign(camera.frame[2][1])) in sides
