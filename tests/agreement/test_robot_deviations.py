"""If a simulated robot deviates from its prediction by more than 5 %, a warning says so, and why if it is known."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from pretouch.robots import (
    ComputedTorque,
    OperationalSpace,
    PositionControl,
    RobotSimulation,
    SensorSite,
    SiteLaw,
    load_model,
    make_data,
    project_site,
    simulate_robot,
)
from refusals import refused
from robot_scenes import ARM, CURVE, SLIDE, controller, share, slide_with_ball, with_object

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

TIP, FINGERTIP = SensorSite("tip", CURVE), SensorSite("fingertip", CURVE)


def turning_base(inertia: float, height: float):
    """The floating slide, whose line of force passes its center of mass at a height: its recoil turns the base."""
    text = SLIDE.format(base="<freejoint/>", mass=1.0, gravity="0 0 0")
    text = text.replace('diaginertia="1 1 1"', f'diaginertia="{inertia} {inertia} {inertia}"')
    text = text.replace('pos="0.1 0 0"', f'pos="0.1 0 {height}"')
    return text, make_data(mujoco.MjModel.from_xml_string(text))


def deviation(result: RobotSimulation) -> float:
    (site,) = result.sites
    return share(result.simulated(site, "relative_velocity"), result.predicted(site, "relative_velocity"))


@pytest.mark.parametrize(("inertia", "height", "warns"), [(0.01, 0.0, False), (0.1, 0.1, False), (0.01, 0.1, True)])
def test_a_base_that_turns_is_reported(inertia: float, height: float, warns: bool) -> None:
    text, start = turning_base(inertia, height)
    projection = project_site(mujoco.MjModel.from_xml_string(text), start, TIP)
    scene = with_object(text, start, "tip", 0.6)
    result = simulate_robot(*scene, [SiteLaw(site=TIP, controller=controller())])
    contact = result.contacts[0][0]
    assert (deviation(result) > 0.05) == warns
    codes = [text[:5] for text in result.warnings]
    assert codes == ["PT507", "PT504", "PT504"] * warns  # of the comparison, of the projection, and of the simulation
    assert any("its axis" in text for text in projection.warnings) == warns
    # with the projection's rate at the start; it grows while the slide moves off the base
    assert contact.axis_turn == pytest.approx(projection.turning * contact.excursion, rel=0.3, abs=1e-6)
    if height:  # the lever of the sideways motion, 220 mm, shrinks by the excursion of 80 mm
        assert 0.5 < contact.sideways / (projection.sideways * contact.excursion) < 1.0


def arm_text(strength: float) -> str:
    def weaker(match: re.Match[str]) -> str:
        limit = strength * float(match[1])
        return f'ctrlrange="{-limit} {limit}"'

    text = ARM.read_text().replace('timestep="0.0005"', 'timestep="0.001"')
    return re.sub(r'ctrlrange="-(\d+) \1"', weaker, text)


def stretched_arm(elbow: float, *, speed: float = 0.3, strength: float = 1.0, shoulder: float = 0.0):
    model = load_model(ARM)
    posture = {"shoulder": shoulder - elbow / 2, "elbow": elbow, "wrist": -elbow / 2}
    return with_object(arm_text(strength), make_data(model, posture), "fingertip", speed)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("elbow", [-0.3, -0.2, -0.1])
@pytest.mark.parametrize("error", [0.0, 0.3, -0.3])
def test_a_posture_near_a_singularity_costs_nothing_with_strong_drives(elbow: float, error: float) -> None:
    """The reflected mass is 21, 47 and 185 kg."""
    scene = stretched_arm(elbow)
    assert project_site(*scene, FINGERTIP).reflected_mass > 20
    tracking = OperationalSpace(model_error=error)
    result = simulate_robot(*scene, [SiteLaw(site=FINGERTIP, controller=controller())], tracking=tracking)
    assert deviation(result) < 0.005
    # nothing but the projection's own warning; it says that drives decide
    assert [text[:5] for text in result.warnings] == ["PT501"]


@pytest.mark.parametrize("tracking", [ComputedTorque(), OperationalSpace()], ids=["torque", "impedance"])
def test_weak_drives_are_reported(tracking) -> None:
    """The shoulder leaves 1.8 m/s^2 along the axis, a tenth of what the law asks for."""
    scene = stretched_arm(-0.3, speed=0.6, strength=0.05, shoulder=-math.pi / 2)
    result = simulate_robot(*scene, [SiteLaw(site=FINGERTIP, controller=controller())], tracking=tracking, horizon=2.0)
    assert not deviation(result) < 0.05  # it may also be without contact
    assert "drive" in " ".join(text for text in result.warnings if text.startswith("PT505"))


def test_a_reference_that_reaches_a_joint_range_is_reported() -> None:
    model, data = slide_with_ball(1.0, 0.3, floats=False)
    model.jnt_range[0] = -0.03, 0.03
    result = simulate_robot(model, data, [SiteLaw(site=TIP, controller=controller())])
    assert deviation(result) > 0.05
    assert "joint range" in " ".join(result.warnings)
    assert result.warnings[-1].startswith("PT507")


def overlapping(geom: str, distance: float, offset: float = 0.0):
    text = arm_text(1.0)
    data = make_data(load_model(ARM), keyframe="bent")
    return with_object(text, data, "fingertip", 0.3, geom=geom, radius=0.035, distance=distance, offset=offset)


TOUCHING = '<geom name="ball" type="sphere" size="0.035" mass="0.5" contype="2" conaffinity="1"/>'


@pytest.mark.parametrize(
    ("distance", "offset", "overlap"),
    [(-0.002, 0.0, 2.0), (-0.067, 0.05, 5.0), (0.001, 0.0, None), (-0.067, 0.056, None)],
    ids=["on the axis", "beside the axis", "near", "near and beside"],
)
def test_an_object_that_overlaps_the_robot_is_refused(distance: float, offset: float, overlap: float | None) -> None:
    """Beside the axis, the centers of ball and finger are 50 mm apart, and their radii are 35 and 20 mm."""
    scene = overlapping(TOUCHING, distance, offset)
    laws = [SiteLaw(site=FINGERTIP, controller=controller())]
    if overlap is None:
        assert simulate_robot(*scene, laws, horizon=0.1).sites == ("fingertip",)
        return
    with refused("data") as error:
        simulate_robot(*scene, laws)
    assert float(re.search(r"by ([\d.]+) mm", str(error.value))[1]) == pytest.approx(overlap, rel=1e-3)


def test_ground_may_overlap_a_body_without_a_sensor_only() -> None:
    text, start = arm_text(1.0), make_data(load_model(ARM), keyframe="bent")

    def scene(place) -> tuple[object, object]:
        row = " ".join(map(str, place))
        ground = f'<geom name="ground" type="sphere" size="0.05" pos="{row}" contype="2" conaffinity="1"/>'
        return with_object(text.replace("<body", f"{ground}<body", 1), start, "fingertip", 0.3)

    laws = [SiteLaw(site=FINGERTIP, controller=controller())]
    assert simulate_robot(*scene(start.geom("upper link").xpos), laws, horizon=0.05).sites == ("fingertip",)
    with refused("data", value="ground"):
        simulate_robot(*scene(start.geom("finger").xpos), laws)


def test_the_warnings_of_the_projection_are_repeated_with_the_name_of_the_site() -> None:
    scene = stretched_arm(-0.2)
    result = simulate_robot(*scene, [SiteLaw(site=FINGERTIP, controller=controller())])
    (expected,) = project_site(*scene, FINGERTIP).warnings
    code, _, text = expected.partition(": ")
    assert result.warnings == (f"{code}: fingertip: {text}",)


def slide_scene(geom: str, **options):
    """The fixed slide, and an object that flies to its site."""
    text = SLIDE.format(base="", mass=1.0, gravity="0 0 0")
    return with_object(text, make_data(mujoco.MjModel.from_xml_string(text)), "tip", 0.3, geom=geom, **options)


def test_a_contact_that_is_harder_than_without_mitigation_is_said_first() -> None:
    """A positive gain pulls the robot toward the object; the object arrives at 0.3 m/s without it."""
    scene = slide_scene('<geom size="0.035" mass="0.5" contype="3" conaffinity="3"/>')
    harder = simulate_robot(*scene, [SiteLaw(site=TIP, controller=controller(0.7))])
    assert abs(harder.simulated("tip", "relative_velocity")[0]) > 0.31
    assert harder.unmitigated_speeds("tip") == pytest.approx([0.3], rel=1e-6)
    assert "harder than without mitigation (0.3 m/s)" in str(harder).splitlines()[0]
    assert "The object is a ball." in str(replace(harder, notes=("The object is a ball.",)))  # also in the full text
    assert "harder" not in str(simulate_robot(*scene, [SiteLaw(site=TIP, controller=controller())])).splitlines()[0]


def compared(result: RobotSimulation) -> str:
    """The warning that compares the simulation with the prediction; empty without one."""
    return next((text for text in result.warnings if text.startswith("PT507: At the site")), "")


@pytest.mark.parametrize("material", [False, True], ids=["geom", "material"])
def test_a_transparent_object_is_seen(material: bool) -> None:
    """MuJoCo's rays pass it. Geoms that cannot be touched stay invisible."""
    law = SiteLaw(site=TIP, controller=controller())
    ball = '<geom type="sphere" size="0.035" mass="0.5" {}/>'
    expected = simulate_robot(*slide_scene(ball.format("")), [law]).contacts[0][0]
    model, data = slide_scene(
        ball.format('rgba="1 0 0 0"')
        + '<geom type="sphere" size="0.039" mass="0" rgba="1 0 0 0" contype="0" conaffinity="0"/>'
    )
    if material:  # as of a geom with a transparent material
        model.geom_rgba[:, 3] = 0.0
    result = simulate_robot(model, data, [law])
    assert result.contacts[0][0].relative_velocity == pytest.approx(expected.relative_velocity, rel=1e-9)
    assert model.geom_rgba[-2, 3] == 0.0  # the model of the caller is not changed


@pytest.mark.parametrize(("margin", "gap"), [(0.0, 0.0), (0.006, 0.0), (0.006, 0.003), (0.0, 0.006)])
def test_a_contact_that_begins_at_the_margin_is_said(margin: float, gap: float) -> None:
    """The force begins ahead of the surfaces. In the time to contact this is more than in the speed."""
    ball = f'<geom name="ball" type="sphere" size="0.035" mass="0.5" margin="{margin}" gap="{gap}"/>'
    result = simulate_robot(*slide_scene(ball), [SiteLaw(site=TIP, controller=controller())])
    contact, predicted = result.contacts[0][0], result.predictions[0][0]
    early = margin > 0
    assert (contact.time < 0.9 * predicted.time) == early
    assert ("time to contact" in compared(result)) == early
    assert ("the margin of the geoms" in compared(result)) == early


@pytest.mark.parametrize(
    ("options", "cause"),
    [
        ({"offset": 0.028}, "beside the axis"),
        ({"offset": 0.01, "direction": np.array([1.0, 0.0, 0.2])}, "the object moves otherwise"),
    ],
)
def test_the_cause_of_a_deviation_is_named(options, cause: str) -> None:
    ball = '<geom type="sphere" size="0.035" mass="0.5"/>'
    result = simulate_robot(*slide_scene(ball, **options), [SiteLaw(site=TIP, controller=controller())], horizon=1.0)
    assert cause in compared(result)


def test_a_slow_joint_controller_is_a_cause() -> None:
    law = SiteLaw(site=TIP, controller=controller())
    ball = '<geom type="sphere" size="0.035" mass="0.5"/>'
    result = simulate_robot(*slide_scene(ball), [law], tracking=PositionControl(bandwidth=2.0))
    assert "does not follow its reference" in compared(result)
    assert compared(simulate_robot(*slide_scene(ball), [law])) == ""


def test_drives_that_push_during_the_impact_are_a_cause_of_the_force() -> None:
    """A contact at 150 Hz with a joint controller of 20 Hz, whose damping acts at once, and with one of 1 Hz."""
    law, frequency = SiteLaw(site=TIP, controller=controller()), 150.0
    for bandwidth, pushes in ((20.0, True), (1.0, False)):
        spring = (2 * math.pi * frequency) ** 2
        ball = f'<geom size="0.035" mass="0.5" solref="{-spring} -1" solimp="0.9999 0.9999" priority="1"/>'
        model, data = slide_scene(ball)
        model.opt.timestep = 1e-4
        mass, tracking = 1 / (1 / 0.25 + 1 / 0.5), ComputedTorque(bandwidth=bandwidth)
        result = simulate_robot(model, data, [law], tracking=tracking, contact_stiffness=spring * mass)
        assert ("the drives push against the impact" in compared(result)) == pushes
        wrong = simulate_robot(model, data, [law], tracking=tracking, contact_stiffness=4 * spring * mass)
        assert ("acts like a stiffness" in compared(wrong)) == (not pushes)


@pytest.mark.parametrize("alpha", [0, 1])
def test_a_ball_is_not_added_into_a_wall(alpha: int, tmp_path) -> None:
    """The wall stays where it is, and the robot does not approach, so that a ball is added, 40 mm ahead of the site."""
    from pretouch.robots.scene import Approach, make_scene

    for distance, inside in ((0.06, True), (0.2, False)):
        wall = f'<geom name="wall" type="box" size="0.01 1 1" pos="{0.23 + distance} 0 1" rgba="1 1 1 {alpha}"/>'
        path = tmp_path / "robot.xml"
        path.write_text(SLIDE.format(base="", mass=1.0, gravity="0 0 0").replace("<worldbody>", f"<worldbody>{wall}"))
        model = load_model(path)
        approach = Approach(distance=0.04, obstacle_velocity=-0.3, robot_velocity=0.0, mass=math.nan)
        if inside:
            with refused("obstacle position", value="wall"):
                make_scene(path, model, make_data(model), TIP, approach)
        else:
            assert "added ball" in make_scene(path, model, make_data(model), TIP, approach).note


def test_an_object_that_was_not_detected_is_said() -> None:
    law = SiteLaw(site=TIP, controller=controller())
    result = simulate_robot(*slide_scene('<geom size="0.035" mass="0.5"/>', offset=0.045), [law])
    assert [text[:5] for text in result.warnings] == ["PT559"]
