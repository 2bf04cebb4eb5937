"""Robots with coupled joints, loops, welds and passive joints: against the response of MuJoCo, and closed forms.

MuJoCo's constraints are soft: they give way in proportion to (1 - d) / d with their impedance d, at most 0.9999, and to
the inverse weights of the model. These are made small here.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pretouch.robots import SensorSite, SiteLaw, make_data, project_site, simulate_robot
from pretouch.robots.dynamics import drivetrain_of, falls, posture_dynamics
from random_robots import random_robot
from refusals import refused
from robot_scenes import CURVE, SLIDE, controller, share, with_object

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

TIP = SensorSite("tip", CURVE)
RIGID = 1e-7  # factor of the softness


def model_of(text: str):
    """Compile a model with rigid equality constraints."""
    spec = mujoco.MjSpec.from_string(text)
    for equality in spec.equalities:
        equality.solimp = [0.9999, 0.9999, 0.001, 0.5, 2]
    spec.option.tolerance, spec.option.iterations = 1e-16, 200
    model = spec.compile()
    for weights in (model.dof_invweight0, model.body_invweight0, model.tendon_invweight0):
        weights[:] = RIGID * weights
    return model


def pushed_mass(text: str, configuration) -> float:
    """The mass that a force along the axis x of the site "tip" meets, by the accelerations of MuJoCo."""
    model = model_of(text)
    data = mujoco.MjData(model)
    data.qpos[:] = configuration
    mujoco.mj_forward(model, data)
    site = model.site("tip").id
    u, jacobian = data.site_xmat[site].reshape(3, 3)[:, 0].copy(), np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, site)
    before = data.qacc.copy()
    data.qfrc_applied[:] = jacobian.T @ u
    mujoco.mj_forward(model, data)
    return 1 / float(u @ jacobian @ (data.qacc - before))


def coupled_robot(seed: int) -> tuple[str, np.ndarray]:
    """A random robot, some of whose joints have no motor and follow others, or a tendon; some bases are welded."""
    rng, robot = np.random.default_rng(seed), random_robot(seed)
    count, text, q = len(robot.links), robot.text, robot.mujoco_configuration()
    order = rng.permutation(count)
    rows = []
    for leader, follower in zip(order[::3], order[1::3], strict=False):
        ratio = rng.uniform(-2, 2)
        if rng.random() < 0.5:
            first, second = (
                float(q[7 * robot.floats + list(robot._depth_first()).index(j)]) for j in (leader, follower)
            )
            rows.append(
                f'<joint joint1="joint {follower}" joint2="joint {leader}" '
                f'polycoef="{second - ratio * first!r} {ratio!r} 0 0 0"/>'
            )
        else:
            coils = f'<joint joint="joint {leader}" coef="1"/><joint joint="joint {follower}" coef="{ratio!r}"/>'
            text = text.replace(
                "<actuator>", f'<tendon><fixed name="t{follower}">{coils}</fixed></tendon><actuator>', 1
            )
            rows.append(f'<tendon tendon1="t{follower}"/>')
        text = text.replace(f'<motor joint="joint {follower}" ctrlrange="-9 9"/>', "")
    if robot.floats and rng.random() < 0.5:
        text = text.replace("<body><freejoint/>", '<body name="base"><freejoint/>', 1)
        rows.append('<weld body1="base"/>')
    return text.replace("</mujoco>", f"<equality>{''.join(rows)}</equality></mujoco>"), q


@pytest.mark.parametrize("seeds", [range(20), range(20, 40)])
def test_the_reflected_mass_of_coupled_robots_is_that_of_a_push(seeds: range) -> None:
    compared = 0
    for seed in seeds:
        text, q = coupled_robot(seed)
        model = model_of(text)
        data = mujoco.MjData(model)
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        drivetrain = drivetrain_of(model, data, model.site("tip").id)
        dynamics = posture_dynamics(model, data, drivetrain, np.array([1.0, 0.0, 0.0]))
        if dynamics.reflected_mass > 1e6:  # the constraints hold the site
            continue
        compared += bool(model.neq)
        assert dynamics.reflected_mass == pytest.approx(pushed_mass(text, q), rel=1e-6)
    assert compared > 12


LOOP = """
<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
 <body><joint name="crank" axis="0 -1 0" range="-2 2"/><geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01"
   mass="0.3"/>
  <body pos="0.1 0 0"><joint name="rod" axis="0 -1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.01"
   mass="0.2"/>
 </body></body>
 <body name="piston" pos="0.4 0 0"><joint name="piston" type="slide" axis="1 0 0" range="-1 1"/>
  <geom size="0.02" mass="0.5"/><site name="tip" pos="0.02 0 0"/></body>
</worldbody>
<equality><connect body1="piston" body2="" anchor="0 0 0"/></equality>
<actuator><motor joint="crank" ctrlrange="-5 5"/></actuator></mujoco>""".replace('body2=""', 'body2="rod"').replace(
    '<body pos="0.1 0 0"><joint name="rod"', '<body name="rod" pos="0.1 0 0"><joint name="rod"'
)


def slider_crank(angle: float) -> tuple[float, float, float]:
    """Position of the piston relative to its start, and angle of the rod relative to the crank."""
    x, z = 0.1 * math.cos(angle), 0.1 * math.sin(angle)
    reach = math.sqrt(0.3**2 - z**2)
    return x + reach - 0.4, math.atan2(-z, reach) - angle, reach


def test_a_slider_crank_moves_as_its_geometry_says() -> None:
    angle = 0.9
    piston, rod, reach = slider_crank(angle)
    model = model_of(LOOP)
    data = make_data(model, {"crank": angle, "rod": rod, "piston": piston})
    projection = project_site(model, data, SensorSite("tip"))
    x, z = 0.1 * math.cos(angle), 0.1 * math.sin(angle)
    rate = -z - z * x / reach  # of the piston per angle
    assert projection.joint_motion["crank"] == pytest.approx(1 / rate, rel=1e-9)
    assert set(projection.followers) == {"rod", "piston"}
    assert (projection.base, projection.recoil_share) == (0, 0.0)
    assert projection.reflected_mass == pytest.approx(pushed_mass(LOOP, data.qpos), rel=1e-6)
    assert projection.moved_mass == pytest.approx(projection.reflected_mass, rel=1e-9)
    assert projection.force.ahead == pytest.approx(5 / abs(rate), rel=1e-9)
    # the piston moves ahead until the crank is nearly stretched, where the path ends, and back to the other dead center
    ahead, back = (path.length for path in projection.excursion)
    assert ahead == pytest.approx(-piston, rel=0.02)
    assert back < 0.2


FINGERS = """
<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody>
<body><joint name="a" type="slide" axis="1 0 0" range="-0.2 0.1" limited="true"/><geom type="capsule"
 fromto="0 0 0 0.1 0 0" size="0.02" mass="1"/><site name="tip" pos="0.12 0 0"/></body>
<body pos="0 1 0"><joint name="b" type="slide" axis="1 0 0"/><geom size="0.02" mass="1"/></body>
</worldbody><equality><joint joint1="b" joint2="a" polycoef="0 1 0 0 0" solimp="0.9999 0.9999"/></equality>
<actuator><motor joint="a" ctrlrange="-50 50"/></actuator></mujoco>"""


def test_the_drive_of_one_finger_moves_both() -> None:
    model = mujoco.MjModel.from_xml_string(FINGERS)
    projection = project_site(model, make_data(model), TIP)
    assert (projection.reflected_mass, projection.moved_mass) == pytest.approx((2.0, 2.0), rel=1e-12)
    assert projection.acceleration.ahead == pytest.approx(25.0, rel=1e-9)
    assert projection.followers == ("b",)
    assert projection.warnings == ()
    result = simulate_robot(
        *with_object(FINGERS, make_data(model), "tip", 0.3), [SiteLaw(site=TIP, controller=controller())]
    )
    assert share(result.simulated("tip", "relative_velocity"), result.predicted("tip", "relative_velocity")) < 0.01
    moved = result.trace().configuration
    assert np.abs(moved[:, 1] - moved[:, 0]).max() < 1e-4
    detection = result.contacts[0][0].detection
    assert (detection.reflected_mass, detection.recoil_share) == (pytest.approx(2.0), pytest.approx(0.0, abs=1e-12))


@pytest.mark.parametrize("ratio", [1.0, -2.0, 0.5])
@pytest.mark.parametrize("coupling", ["joint", "tendon"])
def test_the_range_of_a_follower_ends_the_path(ratio: float, coupling: str) -> None:
    """The joint b moves by the ratio of the motion of a, so that its range ends the motion of a."""
    text = FINGERS.replace(
        '<joint name="b" type="slide" axis="1 0 0"/>',
        '<joint name="b" type="slide" axis="1 0 0" limited="true" range="-0.03 0.04"/>',
    ).replace("0 1 0 0 0", f"0 {ratio} 0 0 0")
    if coupling == "tendon":
        coils = f'<joint joint="a" coef="{ratio}"/><joint joint="b" coef="-1"/>'
        fixed = f'<tendon><fixed name="t">{coils}</fixed></tendon><equality><tendon tendon1="t"'
        text = text.replace('<equality><joint joint1="b" joint2="a" polycoef="0 ' + f'{ratio} 0 0 0"', fixed)
    model = model_of(text)
    low, high = sorted((-0.03 / ratio, 0.04 / ratio))
    ahead, back = project_site(model, make_data(model), TIP).excursion
    assert [ahead.length, back.length] == pytest.approx([min(high, 0.1), -low], abs=1e-7)
    assert ahead.reason == "end of the range of b"
    scene = with_object(text, make_data(model), "tip", 0.3)
    law = SiteLaw(site=TIP, controller=controller())
    contact = simulate_robot(*scene, [law], horizon=0.5, follow_time=0.0).contacts[0][0]
    assert contact.obstacle == "joint range"
    assert contact.excursion > -low > 0


def test_two_motors_on_coupled_fingers_share_the_load() -> None:
    text = FINGERS.replace("</actuator>", '<motor joint="b" ctrlrange="-10 10"/></actuator>').replace(
        'type="slide" axis="1 0 0"/>', 'type="slide" axis="1 0 0" range="-1 1" limited="true"/>'
    )
    projection = project_site(model_of(text), make_data(model_of(text)), TIP)
    assert projection.moved_mass == pytest.approx(2.0)
    assert projection.acceleration.ahead == pytest.approx(60 / 2, rel=1e-6)
    assert projection.joint_motion == pytest.approx({"a": 1.0, "b": 1.0})


@pytest.mark.parametrize(("active", "base", "recoil"), [("true", 0, 0.0), ("false", 6, 0.25)])
def test_a_free_joint_that_is_welded_to_the_world_does_not_float(active: str, base: int, recoil: float) -> None:
    text = SLIDE.format(base="<freejoint/>", mass=0.75, gravity="0 0 -9.81").replace(
        "</mujoco>", f'<equality><weld body1="base" active="{active}"/></equality></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = make_data(model)
    projection = project_site(model, data, TIP)
    assert projection.base == base
    assert projection.recoil_share == pytest.approx(recoil, abs=1e-12)
    assert falls(model, data, drivetrain_of(model, data, model.site("tip").id)) == (active == "false")


DANGLING = SLIDE.format(base="", mass=1.0, gravity="0 0 -9.81").replace(
    '<site name="tip"',
    '<body pos="0.05 0 0"><joint name="hinge" axis="0 1 0"/>'
    '<geom type="capsule" fromto="0 0 -0.03 0 0 -0.1" size="0.005" mass="0.01"/></body><site name="tip"',
    1,
)


def test_a_passive_joint_on_a_fixed_base_does_not_fall() -> None:
    """A hinge dangles below the slide: neither the robot nor the object falls."""
    model = mujoco.MjModel.from_xml_string(DANGLING)
    data = make_data(model)
    drivetrain = drivetrain_of(model, data, model.site("tip").id)
    assert not falls(model, data, drivetrain)
    assert drivetrain.root.tolist() == []
    assert [text[:5] for text in project_site(model, data, TIP).warnings] == ["PT503"]
    result = simulate_robot(*with_object(DANGLING, data, "tip", 0.3), [SiteLaw(site=TIP, controller=controller())])
    contact = result.contacts[0][0]
    assert contact.detection.acceleration == pytest.approx(0.0, abs=0.01)
    assert contact.sideways < 1e-6
    assert share(result.simulated("tip", "relative_velocity"), result.predicted("tip", "relative_velocity")) < 0.02


@pytest.mark.parametrize("joins", ["equality", "tendon", "motor", ""])
def test_the_other_finger_of_a_gripper_is_no_object(joins: str, tmp_path) -> None:
    """The palm is fixed, so that the fingers are separate kinematic trees. A finger that nothing joins is an object."""
    from pretouch.robots.scene import Approach, make_scene

    parts = {
        "equality": '<equality><joint joint1="b" joint2="a"/></equality>',
        "tendon": '<tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="-1"/></fixed></tendon>'
        '<equality><tendon tendon1="t"/></equality>',
        "motor": '<actuator><motor joint="b"/></actuator>',
        "": "",
    }
    text = f"""<mujoco><option gravity="0 0 0"/><worldbody>
        <body pos="-0.05 0 0"><joint name="a" type="slide" axis="1 0 0" range="-0.04 0.04"/>
        <geom size="0.01" mass="0.1"/><site name="tip" pos="0.01 0 0"/></body>
        <body pos="0.05 0 0"><joint name="b" type="slide" axis="-1 0 0" range="-0.04 0.04"/>
        <geom name="other" size="0.01" mass="0.1"/></body></worldbody>
        <actuator><motor joint="a" ctrlrange="-9 9"/></actuator>{parts[joins]}</mujoco>"""
    path = tmp_path / "robot.xml"
    path.write_text(text)
    model, data = (m := mujoco.MjModel.from_xml_string(text)), make_data(m)
    approach = Approach(distance=0.02, obstacle_velocity=-0.3, robot_velocity=0.0, mass=math.nan, radius=0.01)
    made = make_scene(path, model, data, TIP, approach)
    assert ("added ball" in made.note) == bool(joins)
    assert ("'other'" in made.note) == (not joins)
    if joins:
        with refused("obstacle position", value="other") as error:
            make_scene(path, model, data, TIP, replace(approach, radius=0.05))
        assert "object_radius" in str(error.value)


def test_a_ball_falls_with_a_robot_that_falls_only(tmp_path) -> None:
    from pretouch.robots.scene import Approach, make_scene

    approach = Approach(distance=0.04, obstacle_velocity=-0.3, robot_velocity=0.0, mass=math.nan)
    floating = SLIDE.format(base="<freejoint/>", mass=1.0, gravity="0 0 -9.81")
    for text, lift in ((DANGLING, 1.0), (floating, 0.0)):
        path = tmp_path / "robot.xml"
        path.write_text(text)
        model = mujoco.MjModel.from_xml_string(text)
        made = make_scene(path, model, make_data(model), TIP, approach)
        assert made.model.body_gravcomp[made.model.body("pretouch ball").id] == lift
