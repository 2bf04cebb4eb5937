"""Robots that stand on contacts: against the response of MuJoCo to a push, and closed forms.

The softness of MuJoCo's contacts is made small, see the tests of robots with constraints.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from pretouch.robots import SensorSite, SiteLaw, make_data, project_site, simulate_robot
from pretouch.robots.dynamics import constraint_rows, drivetrain_of, posture_dynamics
from pretouch.robots.projection import support_limit
from pretouch.robots.stance import holding_torques
from random_robots import standing_robot
from robot_scenes import CURVE, controller, share, with_object

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

TIP = SensorSite("tip", CURVE)
RIGID = 1e-6  # factor of the softness
PUSH = 0.1  # N


def standing(seed: int, softness: float = RIGID):
    text, q = standing_robot(seed)
    model = mujoco.MjModel.from_xml_string(text)
    for weights in (model.dof_invweight0, model.body_invweight0):
        weights[:] = softness * weights
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    drivetrain = drivetrain_of(model, data, model.site("tip").id)
    return model, data, drivetrain, posture_dynamics(model, data, drivetrain, np.array([1.0, 0.0, 0.0]))


def responses(model, data, drivetrain, forces):
    """The accelerations of the site along its axis x while the drives hold the robot, under forces on the site."""
    site = model.site("tip").id
    u, jacobian = data.site_xmat[site].reshape(3, 3)[:, 0].copy(), np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, site)
    torques = holding_torques(model, data, drivetrain.base, drivetrain.footholds, constraint_rows(model, data))
    result = []
    for force in forces:
        data.qfrc_applied[:] = torques + force * jacobian.T @ u
        mujoco.mj_forward(model, data)
        result.append(float(u @ jacobian @ data.qacc))
    return result


@pytest.mark.parametrize("seeds", [range(20), range(20, 40)])
def test_the_reflected_mass_of_a_standing_robot_is_that_of_a_push(seeds: range) -> None:
    """The mobility of MuJoCo is linear in the softness, which is extrapolated to 0."""
    compared = 0
    for seed in seeds:
        mobilities = []
        for softness in (RIGID, 2 * RIGID):
            model, data, drivetrain, dynamics = standing(seed, softness)
            if not drivetrain.footholds:
                break
            start, pushed = responses(model, data, drivetrain, (0.0, -PUSH))
            assert abs(start) < 1e-6  # the drives and the contacts hold it
            mobilities.append((start - pushed) / PUSH)
        if not mobilities:
            continue
        mobility = 2 * mobilities[0] - mobilities[1]
        if math.isinf(dynamics.reflected_mass):  # the contacts hold the site
            assert abs(mobility) * dynamics.mass_with(np.eye(model.nv)) < 1e-5
            continue
        compared += 1
        assert mobility * dynamics.reflected_mass == pytest.approx(1.0, rel=1e-7)
    assert compared > 10


def test_the_contacts_hold_up_to_the_limit_of_the_push() -> None:
    """Up to the limit, MuJoCo's response is linear; beyond, the site gives way more.

    For elliptic cones, the limit is a lower bound, because the pyramid is inside the cone.
    """
    compared = 0
    for seed in range(16):
        model, data, drivetrain, dynamics = standing(seed)
        limit = support_limit(model, data, drivetrain, dynamics)
        if not drivetrain.footholds or math.isinf(dynamics.reflected_mass) or not 1.0 < limit < 1e3:
            continue
        compared += 1
        start, below, above = responses(model, data, drivetrain, (0.0, -0.99 * limit, -1.2 * limit))
        assert (start - below) / (0.99 * limit) * dynamics.reflected_mass == pytest.approx(1.0, rel=1e-4)
        ratio = (start - above) / (1.2 * limit) * dynamics.reflected_mass
        assert ratio > 1 + 1e-6 * (model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL) - 1e-7
    assert compared >= 8


LEAP = """
<mujoco><option gravity="0 0 -9.81" timestep="0.001"/><worldbody><geom type="plane" size="1 1 1"
 friction="0.5" condim="3"/><body name="foot" pos="0 0 0.05"><freejoint/>
 <geom type="box" size="0.3 0.3 0.05" mass="{foot}" friction="0.5"/>
 <body name="trunk" pos="0 0 0.1"><joint name="leg" type="slide" axis="{axis}" range="-0.5 0.5" limited="true"/>
 <geom type="box" size="0.1 0.1 0.04" mass="{trunk}"/><site name="tip" pos="0.1 0 0.0" xyaxes="{frame}"/></body>
</body></worldbody><actuator><motor joint="leg" ctrlrange="-1000 1000"/></actuator></mujoco>"""


def test_the_ground_pushes_a_robot_up_but_does_not_pull_it_down() -> None:
    """Up: motor minus weight. Down: the motor pulls the trunk down until the foot lifts, (m + m_f) g / m."""
    model = mujoco.MjModel.from_xml_string(LEAP.format(foot=2, trunk=3, axis="0 0 1", frame="0 0 1 0 1 0"))
    projection = project_site(model, make_data(model), TIP)
    assert projection.support == ("foot on world",)
    assert (projection.base, projection.recoil_share) == (0, 0.0)
    assert (projection.reflected_mass, projection.moved_mass) == pytest.approx((3.0, 3.0))
    assert projection.acceleration.ahead == pytest.approx(1000 / 3 - 9.81)
    assert projection.acceleration.back == pytest.approx(5 * 9.81 / 3)
    assert projection.force.back == pytest.approx(5 * 9.81 * 0.3 / 0.4)  # the site is beside the center: the foot tips
    assert projection.unsupported_mass < 3.0  # beside the center of mass, the foot would turn
    assert projection.warnings == ()


def test_friction_limits_what_a_standing_robot_can_push_and_take() -> None:
    """The motor moves 3 kg sideways until the foot slides: 0.5 of 5 kg. Across the motor, the object pushes all."""
    text = LEAP.format(foot=2, trunk=3, axis="1 0 0", frame="1 0 0 0 1 0")
    model = mujoco.MjModel.from_xml_string(text)
    projection = project_site(model, make_data(model), TIP)
    friction = 0.5 * 5 * 9.81
    assert (projection.acceleration.ahead, projection.acceleration.back) == pytest.approx((friction / 3,) * 2)
    assert projection.force.ahead == pytest.approx(friction)
    across = LEAP.format(foot=2, trunk=3, axis="1 0 0.1", frame="1 0 0.1 0 1 0")
    model = mujoco.MjModel.from_xml_string(across)
    model.site_pos[0] = 0.0
    drivetrain = drivetrain_of(model, make_data(model), 0)
    dynamics = posture_dynamics(model, make_data(model), drivetrain, np.array([0.0, 1.0, 0.0]))
    assert math.isinf(dynamics.reflected_mass)
    assert support_limit(model, make_data(model), drivetrain, dynamics) == pytest.approx(friction)
    assert dynamics.mass_with(np.eye(7)) < 5.0


@pytest.mark.parametrize(("friction", "height", "stands"), [(1.0, 0.0, True), (0.1, 0.0, False), (1.0, 1e-3, False)])
def test_a_robot_that_slides_or_does_not_touch_falls(friction: float, height: float, stands: bool) -> None:
    """On a slope of 11 deg."""
    text = LEAP.format(foot=2, trunk=3, axis="0 0 1", frame="0 0 1 0 1 0").replace("0 0 -9.81", "2 0 -9.6")
    model = mujoco.MjModel.from_xml_string(text.replace('friction="0.5"', f'friction="{friction}"'))
    data = make_data(model)
    data.qpos[2] += height
    mujoco.mj_forward(model, data)
    projection = project_site(model, data, TIP)
    assert (projection.base, bool(projection.support)) == ((0, True) if stands else (6, False))
    assert [text[:5] for text in projection.warnings] == ["PT555"] * (not stands)
    assert [f"{1e3 * height:.2g} mm" in text for text in projection.warnings] == [height > 0] * (not stands)


def test_a_foot_stays_where_it_stands_along_the_path() -> None:
    """A leg with two joints crouches until its knee is bent most: the height follows from the law of cosines.

    The point of the foot that touches stays in place, 0.1 mm below the end of the shank: the foot does not roll.
    """
    text = """
    <mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody><geom type="plane" size="1 1 1"/>
    <body pos="0 0 0"><joint type="slide" axis="0 0 1" name="height"/><geom size="0.02" mass="2"/>
    <site name="tip" pos="0 0 0.02" xyaxes="0 0 1 0 1 0"/>
    <body><joint name="hip" axis="0 -1 0" range="-2 2"/><geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01"
    mass="0.2" contype="0" conaffinity="0"/><body pos="0 0 -0.2"><joint name="knee" axis="0 -1 0" range="-2 -0.5"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01" mass="0.1" contype="0" conaffinity="0"/>
    <geom size="1e-4" pos="0 0 -0.2" mass="0.01"/></body></body></body></worldbody>
    <actuator><motor joint="hip" ctrlrange="-90 90"/><motor joint="knee" ctrlrange="-90 90"/></actuator></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    hip, knee = 0.5, -1.0
    data = make_data(model, {"hip": hip, "knee": knee})
    data.qpos[0] = 0.2 * (math.cos(hip) + math.cos(hip + knee)) + 1e-4 - 1e-9
    mujoco.mj_forward(model, data)
    projection = project_site(model, data, TIP)
    assert projection.followers == ("height",)

    def reach(angle: float) -> float:
        return 0.2 * math.sqrt(2 + 2 * math.cos(angle))

    ahead, back = projection.excursion
    assert [ahead.length, back.length] == pytest.approx(
        [reach(-0.5) - reach(-1.0), reach(-1.0) - reach(-2.0)], abs=2e-5
    )
    assert "knee" in back.reason


def test_a_robot_that_stands_meets_its_prediction() -> None:
    """The arm of a standing robot retreats from a ball; its base does not recoil."""
    text = LEAP.format(foot=8, trunk=1, axis="1 0 0", frame="1 0 0 0 1 0").replace("-0.5 0.5", "-0.2 0.1")
    start = make_data(mujoco.MjModel.from_xml_string(text))
    scene = with_object(text.replace("<freejoint/>", '<joint type="free"/>'), start, "tip", 0.3)
    result = simulate_robot(*scene, [SiteLaw(site=TIP, controller=controller())])
    detection = result.contacts[0][0].detection
    assert (detection.reflected_mass, detection.recoil_share) == (
        pytest.approx(1.0, rel=1e-3),
        pytest.approx(0, abs=1e-9),
    )
    assert share(result.simulated("tip", "relative_velocity"), result.predicted("tip", "relative_velocity")) < 0.02
    moved = result.trace().configuration[:, 0]
    assert max(abs(b - a) for a, b in pairwise(moved)) < 1e-3
