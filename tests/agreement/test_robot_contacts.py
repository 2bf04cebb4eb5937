"""Contacts of a simulated robot: all bodies, all forces, and the speed at the contact point, against the trace."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from pretouch.robots import (
    ComputedTorque,
    RobotSimulation,
    SensorSite,
    SiteLaw,
    load_model,
    make_data,
    simulate_robot,
)
from robot_scenes import CURVE, DISTANCE, SLIDE, controller, slide_with_ball, with_object

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

TIP = SensorSite("tip", CURVE)
LAW = SiteLaw(site=TIP, controller=controller())
STEP = 1e-3  # s, of the models
BALL = 0.5  # kg


def scene(part: str, **options):
    """The fixed slide with another part, and a ball that flies to its site."""
    text = SLIDE.format(base="", mass=1.0, gravity="0 0 0").replace('<site name="tip"', part + '<site name="tip"', 1)
    return with_object(text, make_data(mujoco.MjModel.from_xml_string(text)), "tip", 0.3, **options)


def force_on_the_ball(result: RobotSimulation) -> float:
    """The largest force by Newton's law from the recorded positions of the ball: m (v' - v) / h, with v = dx / h."""
    places = result.trace().configuration[:, -7:-4]
    return float(np.linalg.norm(BALL * np.diff(places, 2, axis=0) / STEP**2, axis=1).max())


PRONGS = "".join(
    f'<geom type="capsule" fromto="0.12 {y} 0 0.15 {y} 0" size="0.004" mass="0.005"/>' for y in (0.02, -0.02)
)


@pytest.mark.parametrize("part", [f'<body name="prongs">{PRONGS}</body>', PRONGS], ids=["own body", "body of the site"])
def test_prongs_ahead_of_the_sensor_are_said_to_be_hit(part: str) -> None:
    """They touch the ball 30 mm ahead of the site, so that no site touches it."""
    result = simulate_robot(*scene(part), [LAW], horizon=1.0)
    assert result.order() == ()
    ((touch,),) = result.touches
    assert (touch.site, touch.object) == ("", "object")
    assert touch.peak_force == pytest.approx(force_on_the_ball(result), rel=1e-3)
    assert result.robot_forces[0] == touch.peak_force > 2.0
    assert 0.05 < -touch.relative_velocity < 0.1
    assert [text[:5] for text in result.warnings] == ["PT548", "PT560"]  # the predicted contact does not happen
    headline = str(result).splitlines()[0]
    assert "hit" in headline
    assert "No site" not in headline
    assert result.to_dict()["touches"][0][0]["peak_force"] == touch.peak_force


@pytest.mark.parametrize(("ahead", "elsewhere"), [(0.5e-3, False), (5e-3, True)])
def test_the_force_on_the_robot_is_that_of_all_its_bodies(ahead: float, elsewhere: bool) -> None:
    """A plate touches two spheres of another body. They belong to the surface of the site if they are beside it."""
    plate = '<geom type="box" size="0.01 0.05 0.05" mass="0.5"/>'
    ears = "".join(f'<geom type="sphere" pos="{0.115 + ahead} {y} 0" size="0.005" mass="0.02"/>' for y in (0.03, -0.03))
    result = simulate_robot(*scene(f'<body name="ears">{ears}</body>', geom=plate, radius=0.01), [LAW], horizon=0.6)
    assert {(touch.body, touch.site) for touch in result.touches[0]} >= {("ears", "" if elsewhere else "tip")}
    assert result.robot_forces[0] == pytest.approx(force_on_the_ball(result), rel=1e-3)
    assert ("ears" in str(result).splitlines()[0]) == elsewhere
    if not elsewhere:
        assert result.order() == ("tip",)
        assert result.contacts[0][0].peak_force == pytest.approx(result.robot_forces[0], rel=1e-3)


def test_what_supports_the_robot_at_the_start_is_no_hit() -> None:
    """A foot that stands on the ground touches it all the time."""
    foot = '<geom type="sphere" size="0.02" pos="0 0 -0.3" mass="0.1"/></body></worldbody>'
    ground = '<worldbody><geom name="ground" type="plane" size="1 1 0.1" pos="0 0 0.68"/>'
    text = SLIDE.format(base='<joint name="lift" type="slide" axis="0 0 1"/>', mass=1.0, gravity="0 0 -9.81")
    text = re.sub(r"</body>\s*</worldbody>", foot, text).replace("<worldbody>", ground)
    start = make_data(mujoco.MjModel.from_xml_string(text), {"lift": "-0.01 mm"})
    result = simulate_robot(*with_object(text, start, "tip", 0.3), [LAW])
    assert [touch.site for touch in result.touches[0]] == ["tip"]


@pytest.mark.parametrize("lateral", [0.0, 0.15])
def test_beside_the_axis_the_speed_is_that_of_the_contact_point(lateral: float) -> None:
    """The gap is that of two spheres, finger tip and ball; its rate before the contact is the normal velocity."""
    way = np.array([1.0, 0.0, lateral / 0.3])
    result = simulate_robot(*slide_with_ball(1.0, 0.3, floats=False, offset=0.03, direction=way), [LAW])
    contact, trace = result.contacts[0][0], result.trace()
    slide, ball = trace.configuration[:, 0], trace.configuration[:, 1:4]
    center = np.stack([0.2 + slide, 0 * slide, 1 + 0 * slide], axis=1)
    gap = np.linalg.norm(ball - center, axis=1) - 0.035 - 0.02
    first = int(np.flatnonzero(gap < 0)[0])
    expected = float(np.diff(gap)[first - 1]) / STEP
    assert contact.relative_velocity == pytest.approx(expected, rel=0.02)  # it changes by 1 % per step
    assert contact.time == pytest.approx(trace.time[first], abs=STEP)


def test_an_object_that_no_ray_has_seen_touches_at_a_speed() -> None:
    result = simulate_robot(*slide_with_ball(1.0, 0.3, floats=False, offset=0.045), [LAW])
    contact = result.contacts[0][0]
    assert contact.detection is None
    # at the contact the normal has the slope 45 mm over the sum of the radii
    assert contact.relative_velocity == pytest.approx(-0.3 * math.sqrt(1 - (45 / 55) ** 2), rel=0.02)
    assert "nan" not in str(result)


LEG = Path(__file__).parents[2] / "examples/robots/leg.xml"


def landing(bandwidth: float = 20.0, **options) -> RobotSimulation:
    """A leg whose foot touches the ground at 30 ms."""
    model = load_model(LEG)
    data = make_data(model, {"height": "-140 mm"}, keyframe="crouched")
    data.qvel[0] = -0.5
    law = SiteLaw(site=SensorSite("sole", CURVE), controller=controller())
    return simulate_robot(model, data, [law], tracking=ComputedTorque(bandwidth=bandwidth), **options)


@pytest.mark.parametrize("bandwidth", [20.0, 2.0], ids=["stands", "collapses"])
def test_the_largest_force_is_followed_until_it_has_passed(bandwidth: float) -> None:
    """The longest run shows the whole landing; the leg with soft joints lands on its thigh after 0.2 s."""
    longest, default = landing(bandwidth, follow_time=1.0), landing(bandwidth)
    contact, trace = default.contacts[0][0], default.trace()
    assert contact.peak_force == longest.contacts[0][0].peak_force
    assert default.robot_forces == longest.robot_forces
    assert trace.time[-1] < longest.trace().time[-1] - 0.5
    assert trace.force[trace.time < contact.time + 0.02, 0].max() < 0.8 * contact.peak_force
    assert any("thigh" in text for text in default.warnings) == (bandwidth == 2.0)


@pytest.mark.parametrize(("horizon", "rising"), [(0.06, True), (5.0, False)])
def test_a_force_that_still_grows_at_the_end_is_said(horizon: float, rising: bool) -> None:
    result = landing(horizon=horizon)
    assert [text[:5] for text in result.warnings if "follow_time" in text] == ["PT549"] * rising


def test_a_contact_without_gravity_ends_soon() -> None:
    result = simulate_robot(*slide_with_ball(1.0, 0.3, floats=False), [LAW])
    assert result.trace().time[-1] < result.contacts[0][0].time + 0.2


@pytest.mark.parametrize("view", ["0 deg", "8 deg", "40 deg"])
@pytest.mark.parametrize("flange", ["", '<geom type="box" size="0.001 0.05 0.05" pos="0.119 0 0" mass="0.01"/>'])
def test_a_sensor_flush_with_its_own_robot_sees_past_it(view: str, flange: str) -> None:
    """The site is on a body of its own, at the surface of the finger or of a flange, which slant rays meet."""
    own = '<body pos="0.12 0 0"><joint axis="1 0 0" name="roll"/><geom size="0.001" mass="1e-3" pos="-0.01 0 0"/>'
    text = SLIDE.format(base="", mass=1.0, gravity="0 0 0").replace("</actuator>", '<motor joint="roll"/></actuator>')
    text = text.replace('<site name="tip" pos="0.12 0 0"/>', f'{flange}{own}<site name="tip"/></body>')
    start = make_data(mujoco.MjModel.from_xml_string(text))
    law = SiteLaw(site=SensorSite("tip", CURVE, field_of_view=view), controller=controller())
    result = simulate_robot(*with_object(text, start, "tip", 0.3), [law], horizon=0.6)
    contact = result.contacts[0][0]
    assert contact.detection.distance == pytest.approx(DISTANCE, rel=1e-9)
    assert contact.relative_velocity == pytest.approx(-0.0815, rel=0.01)
    assert not any("in the beam of the sensor" in text for text in result.warnings)


@pytest.mark.parametrize(("place", "named"), [("0.14 0 0", True), ("0.14 0.02 0", False), ("0.1 0.02 0", False)])
def test_what_the_robot_holds_into_the_beam_is_named(place: str, named: bool) -> None:
    lug = f'<geom name="lug" size="0.003" pos="{place}" mass="0.001"/>'
    result = simulate_robot(*scene(lug), [LAW], horizon=0.01)
    assert ["lug" in text for text in result.warnings if "PT547: tip" in text] == [True] * named
