"""The projection of a robot to an axis: against Pinocchio, against MuJoCo's simulation, and against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pretouch.errors import InvalidInputError
from pretouch.robots import SensorSite, load_model, make_data, project_site
from pretouch.robots.dynamics import RobotReducer, drivetrain_of, least_energy, posture_dynamics
from random_robots import random_robot
from robot_scenes import ARM

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")


def model_of(text: str):
    return mujoco.MjModel.from_xml_string(text)


def site_acceleration(model, data):
    """The acceleration of the site "tip" in the world frame, with gravity as an upward acceleration."""
    acceleration = np.zeros(6)
    mujoco.mj_rnePostConstraint(model, data)
    mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_SITE, model.site("tip").id, acceleration, 0)
    return acceleration[3:]


def test_the_reflected_mass_is_that_of_pinocchio() -> None:
    """100 random robots, half of them floating. Both libraries invert the same matrix; with condition numbers up to
    1e4 rounding is below 1e-11."""
    pin = pytest.importorskip("pinocchio", reason="needs the package 'pin'")
    worst = 0.0
    for seed in range(100):
        robot = random_robot(seed)
        model = model_of(robot.text)
        data = mujoco.MjData(model)
        data.qpos[:] = robot.mujoco_configuration()
        mujoco.mj_forward(model, data)
        drivetrain = drivetrain_of(model, data, model.site("tip").id)
        dynamics = posture_dynamics(model, data, drivetrain, np.array([1.0, 0.0, 0.0]))
        other, q, frame = robot.pinocchio(pin)
        state = other.createData()
        # a robot with one degree of freedom has a Jacobian without its second axis
        jacobian = np.reshape(pin.computeFrameJacobian(other, state, q, frame, pin.LOCAL), (6, other.nv))
        mass = np.reshape(pin.crba(other, state, q), (other.nv, other.nv))
        mass = np.triu(mass) + np.triu(mass, 1).T  # with the armature
        row = jacobian[0]
        expected = 1 / (row @ np.linalg.solve(mass, row))
        worst = max(worst, abs(dynamics.reflected_mass / expected - 1))
    assert worst < 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_a_motion_with_the_least_energy_is_that_of_the_pseudoinverse(seed: int) -> None:
    """With dependent rows and a row of zeros, M^(-1/2) (A M^(-1/2))^+ e. Condition numbers below 1e5 leave 1e-10."""
    rng = np.random.default_rng(seed)
    joints, count = int(rng.integers(2, 12)), int(rng.integers(1, 7))
    root = np.eye(joints) + np.tril(rng.normal(size=(joints, joints))) / 3
    rows = rng.normal(size=(min(count, joints), joints)) * 10.0 ** rng.uniform(-2, 2, (min(count, joints), 1))
    rows = np.vstack([rows, rows[-1] if len(rows) > 1 else 0 * rows[0], np.zeros(joints)])
    target = np.zeros((len(rows), 1))
    target[0] = 1.0
    solution = least_energy(rows, (0,), root @ root.T)
    assert solution is not None
    whitened = np.linalg.inv(root).T
    np.testing.assert_allclose(
        solution[0], whitened @ np.linalg.pinv(rows @ whitened, rcond=1e-10) @ target, rtol=1e-8, atol=1e-9
    )
    others = solution[1]
    assert others.shape == (joints, joints - np.linalg.matrix_rank(rows))
    np.testing.assert_allclose(others.T @ root @ root.T @ others, np.eye(others.shape[1]), atol=1e-10)
    np.testing.assert_allclose(rows @ others, 0.0, atol=1e-10 * np.abs(rows).max())


def test_rows_in_conflict_have_no_motion() -> None:
    assert least_energy(np.array([[1.0, 0.0], [2.0, 0.0]]), (0,), np.eye(2)) is None
    assert least_energy(np.zeros((1, 2)), (0,), np.eye(2)) is None


@pytest.mark.parametrize("seed", range(8))
def test_the_reduction_follows_its_equations(seed: int) -> None:
    """-G = P - B (B^T M_bb B)^-1 B^T (M_bb P + M_bq), with another number of constraints in the same memory.

    Condition numbers below 1e4 leave 1e-10.
    """
    model = model_of(random_robot(seed + 3).text)
    data = mujoco.MjData(model)
    data.qpos[:] = random_robot(seed + 3).mujoco_configuration()
    mujoco.mj_forward(model, data)
    rng, nv = np.random.default_rng(seed), model.nv
    order = rng.permutation(nv)
    base, joints = order[: nv // 2], order[nv // 2 :]
    reducer = RobotReducer(model, data, (base, joints))
    mass = np.zeros((nv, nv))
    mujoco.mj_fullM(model, data, mass)
    mass = mass[np.ix_(order, order)]
    m = len(base)
    for count in (0, 1, m // 2 + 1, 0):
        rows = rng.normal(size=(count, nv))
        rows /= np.linalg.norm(rows, axis=1, keepdims=True)
        robot = reducer.reduce(rows)
        rows = rows[:, order]
        of_base, of_joints = rows[:, :m], rows[:, m:]
        forced = -np.linalg.pinv(of_base, rcond=1e-8) @ of_joints if count and m else np.zeros((m, nv - m))
        _, values, right = np.linalg.svd(of_base) if count and m else (None, np.zeros(0), np.eye(m))
        free = right[int((values > 1e-8).sum()) :].T
        inner = free.T @ mass[:m, :m] @ free
        motion = forced - free @ np.linalg.solve(inner, free.T @ (mass[:m, :m] @ forced + mass[:m, m:]))
        together = np.vstack([motion, np.eye(nv - m)])
        scale = max(1.0, float(np.abs(motion).max(initial=0.0)))
        np.testing.assert_allclose(robot.reduction.forced, forced, atol=1e-10 * scale)
        np.testing.assert_allclose(robot.reduction.motion, motion, atol=1e-10 * scale)
        np.testing.assert_allclose(
            robot.inertia, together.T @ mass @ together, atol=1e-10 * scale**2 * np.abs(mass).max()
        )
        assert robot.reduction.loose.shape == free.shape
        coupling = robot.reduction.coupling
        assert len(coupling) == (np.linalg.norm(of_base @ forced + of_joints, axis=1) > 1e-8).sum()


@pytest.mark.parametrize(("hold", "said"), [("pose", True), ("position", True), ("axis", False)])
def test_a_retreat_that_a_singular_posture_prevents_is_said(hold: str, said: bool) -> None:
    """A stretched arm cannot move its tip sideways on a straight line; on an arc it can."""
    found = project_site((model := load_model(ARM)), make_data(model), SensorSite("fingertip", axis="+z", hold=hold))
    assert (found.retreat < 1e-3) == said
    assert any(text.startswith("PT622") for text in found.warnings) == said


FLOATING = """
<mujoco><compiler angle="radian"/><option gravity="{gravity}" timestep="1e-4" integrator="RK4"/>
<worldbody><body name="base" pos="0 0 1" euler="0.2 -0.4 0.3"><freejoint/>
  <inertial pos="0.02 -0.01 0.03" mass="{base}" diaginertia="0.05 0.04 0.06"/>
  <body pos="0.1 0 0.05"><joint name="a" axis="0 -1 0" range="-2 2"/>
    <inertial pos="0.1 0 0.02" mass="0.8" diaginertia="0.002 0.004 0.004"/>
    <body pos="0.25 0 0"><joint name="b" axis="0 -1 0" range="-2 2"/>
      <inertial pos="0.1 0.01 0" mass="0.5" diaginertia="0.001 0.002 0.002"/>
      <body pos="0.2 0 0"><joint name="c" type="slide" axis="1 0 0" range="-0.2 0.2"/>
        <inertial pos="0.05 0 0" mass="0.2" diaginertia="0.001 0.001 0.001"/>
        <site name="tip" pos="0.1 0.02 0"/>
</body></body></body></body></worldbody>
<actuator>
  <motor joint="a" ctrlrange="-9 9"/><motor joint="b" ctrlrange="-9 9"/><motor joint="c" ctrlrange="-9 9"/>
</actuator></mujoco>"""


@pytest.mark.parametrize("base", [1.0, 2.0, 5.0, 20.0])
@pytest.mark.parametrize("gravity", ["0 0 0", "0 0 -9.81"], ids=["without gravity", "in free fall"])
def test_the_recoil_share_is_that_of_a_floating_robot_in_simulation(base: float, gravity: str) -> None:
    """MuJoCo accelerates the joints by their own motors; the site moves by 1 - kappa of its motion in the base.

    The joint motion is imposed by inverse dynamics, so that it is q'' = (joint motion) * 1 m/s^2 at the first step.
    The accelerations at this instant are exact; no tolerance for a time step is needed.
    """
    model = model_of(FLOATING.format(base=base, gravity=gravity))
    data = make_data(model, {"a": 0.6, "b": -1.1, "c": 0.05})
    projection = project_site(model, data, SensorSite("tip", axis="+x"))
    assert projection.base == 6
    wanted = np.array([projection.joint_motion[n] for n in "abc"])

    # motor torques that give the wanted joint accelerations: q'' is affine in the torques
    def accelerations(torques):
        data.ctrl[:] = torques
        mujoco.mj_forward(model, data)
        return data.qacc[6:].copy()

    start = accelerations(np.zeros(3))
    slope = np.column_stack([accelerations(row) - start for row in np.eye(3)])
    accelerations(np.linalg.solve(slope, wanted - start))
    np.testing.assert_allclose(data.qacc[6:], wanted, rtol=1e-9, atol=1e-9)
    # MuJoCo counts gravity as an upward acceleration, so this is seen from the frame that falls with the robot
    along = projection.axis @ site_acceleration(model, data)
    assert along == pytest.approx(1 - projection.recoil_share, rel=1e-9, abs=1e-9)
    assert 0 < projection.recoil_share < 1


def test_a_slide_on_a_sliding_base_recoils_by_its_share_of_the_mass() -> None:
    """M_bq J^-1 u / M_bb = m / (m_b + m), over a whole motion: momentum is conserved."""
    model = model_of(
        """<mujoco><option gravity="0 0 0" timestep="1e-3"/><worldbody><body><joint name="base" type="slide"
        axis="1 0 0"/><geom size="0.1" mass="3"/><body pos="0.2 0 0"><joint name="leg" type="slide" axis="1 0 0"
        range="-0.1 0.1" limited="true"/><geom size="0.02" mass="1"/><site name="foot" pos="0.02 0 0"/></body></body>
        </worldbody><actuator><motor joint="leg" ctrlrange="-5 5"/></actuator></mujoco>"""
    )
    data = make_data(model)
    projection = project_site(model, data, SensorSite("foot"))
    assert projection.recoil_share == pytest.approx(1 / 4)
    assert projection.reflected_mass == pytest.approx(1.0)  # a blow on the foot does not move the base
    assert projection.moved_mass == pytest.approx(3 / 4)  # the reduced mass of base and leg
    before = float(data.site_xpos[0, 0])
    data.ctrl[:] = 1.0
    for _ in range(100):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    assert float(data.site_xpos[0, 0]) - before == pytest.approx((1 - 1 / 4) * data.qpos[1], rel=1e-9)


RECOILING = {
    "free base": """<body><freejoint/><geom size="0.05" mass="1" contype="0" conaffinity="0"/><body pos="0.1 0 0">
        <joint name="s" type="slide" axis="1 0 0" range="-0.1 0.1"/><geom size="0.02" mass="1"/>
        <site name="tip" pos="0.02 0 0"/></body></body>""",
    "passive hinge": """<body><joint name="s" type="slide" axis="1 0 0" range="-0.3 0.3"/><geom size="0.03" mass="1"/>
        <body pos="0.05 0 0"><joint name="h" axis="0 1 0" range="-1 1" stiffness="0.5"/>
        <inertial mass="0.2" pos="0 0 -0.1" diaginertia="0.0007 0.0007 0.0001"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01"/><site name="tip" pos="0.01 0 {height}"/>
        </body></body>""",
    "passive shoulder": """<body><joint name="h" axis="0 0 1"/>
        <inertial mass="2" pos="0.15 0 0" diaginertia="0.02 0.02 0.02"/><body pos="0.3 0 0">
        <joint name="s" axis="0 0 1" range="-0.5 0.5"/><inertial mass="1" pos="0.1 0 0" diaginertia="0.01 0.01 0.01"/>
        <site name="tip" pos="0.25 0 0" euler="0 0 90"/></body></body>""",
}


def recoiling(kind: str, height: float = -0.05) -> mujoco.MjModel:
    body = RECOILING[kind].format(height=height)
    return model_of(
        f"""<mujoco><option gravity="0 0 0"/><worldbody>{body}</worldbody>
        <actuator><motor joint="s" ctrlrange="-20 20"/></actuator></mujoco>"""
    )


@pytest.mark.parametrize("kind", RECOILING)
def test_limits_with_a_recoil_are_those_of_the_site_itself(kind: str) -> None:
    """MuJoCo accelerates the site, and presses it against what blocks it, with the motor at its limit."""
    model = recoiling(kind)
    data = make_data(model)
    projection = project_site(model, data, SensorSite("tip", hold="axis"))
    data.ctrl[:] = 20.0
    mujoco.mj_forward(model, data)
    free = projection.axis @ site_acceleration(model, data)
    assert projection.acceleration.ahead == pytest.approx(free, rel=1e-9)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, 0)
    data.qfrc_applied[:] = -projection.axis @ jacobian  # the obstacle pushes back with 1 N
    mujoco.mj_forward(model, data)
    pushed = projection.axis @ site_acceleration(model, data)
    assert projection.force.ahead == pytest.approx(free / (free - pushed), rel=1e-9)
    retreat = -float(model.jnt_range[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "s"), 0])
    if kind == "free base":
        assert projection.retreat == pytest.approx((1 - projection.recoil_share) * retreat, rel=1e-6)
    limits = {limit.name: limit.limit for limit in projection.constraints()}
    assert limits == {"excursion": projection.retreat, "acceleration": projection.acceleration.least}


def test_the_range_of_a_passive_joint_that_recoils_ends_the_retreat() -> None:
    """Momentum: the flap turns by m c / (I + m c^2) per motion of the slide, and its range ends at 1 deg."""
    model = recoiling("passive hinge")
    projection = project_site(model, make_data(model), SensorSite("tip"))
    turn = 0.2 * 0.1 / (0.0007 + 0.2 * 0.1**2)  # rad/m
    expected = (1 - 0.05 * turn) * math.radians(1) / turn
    assert projection.retreat == pytest.approx(expected, rel=1e-3)
    assert projection.excursion[1].passive == ("h",)
    assert any("PT503" in text and "recoil takes h to the end" in text for text in projection.warnings)
    wide = recoiling("passive hinge")
    wide.jnt_range[1] = (-9.0, 9.0)
    assert project_site(wide, make_data(wide), SensorSite("tip")).retreat > 20 * expected


def test_a_path_with_a_recoil_is_no_longer_than_that_of_momentum() -> None:
    """Momentum couples the passive shoulder to the elbow. The site moves until it would turn back, or to a range."""
    model = recoiling("passive shoulder")
    model.jnt_range[1] = (-2.5, 2.5)
    projection = project_site(model, make_data(model, {"s": -1.2}), SensorSite("tip", hold="axis"))
    mass, jacobian = np.zeros((2, 2)), np.zeros((3, 2))
    for path, way in zip(projection.excursion, (1.0, -1.0), strict=True):
        data, moved, step = make_data(model, {"s": -1.2}), 0.0, 2e-3
        while True:
            mujoco.mj_fullM(model, data, mass)
            mujoco.mj_jacSite(model, data, jacobian, None, 0)
            rates = np.array([-mass[0, 1] / mass[0, 0], 1.0]) * np.sign(projection.joint_motion["s"]) * way
            rate = way * float(projection.axis @ jacobian @ rates)
            if rate < 0 or abs(data.qpos[1]) > 2.5:
                break
            moved += step * rate
            data.qpos += step * rates
            mujoco.mj_forward(model, data)
        assert 0.8 * moved < path.length < 1.01 * moved


def test_a_floating_arm_presses_with_all_its_joints_while_its_site_is_blocked() -> None:
    """The torques that keep the blocked site at rest, by MuJoCo's inverse dynamics, are within their limits."""
    model = model_of(FLOATING.format(base=2.0, gravity="0 0 -9.81"))
    data = make_data(model, {"a": 0.6, "b": -1.1, "c": 0.05})
    projection = project_site(model, data, SensorSite("tip", axis="+x"))
    joints, jacobian = np.array([projection.joint_motion[n] for n in "abc"]), np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, 0)

    def response(values):  # accelerations of joints and site minus those wanted: torques and the rate of the joints
        data.ctrl[:] = values[:3]
        data.qfrc_applied[:] = -projection.force.ahead * projection.axis @ jacobian
        mujoco.mj_forward(model, data)
        return np.append(data.qacc[6:] - values[3] * joints, projection.axis @ site_acceleration(model, data))

    start = response(np.zeros(4))
    values = np.linalg.solve(np.column_stack([response(row) - start for row in np.eye(4)]), -start)
    assert np.abs(values[:3]).max() == pytest.approx(9.0, rel=1e-9)


def test_a_site_that_a_passive_joint_moves_the_other_way_has_no_numbers() -> None:
    """Below the center of percussion, the flap swings back by more than the slide pushes it ahead."""
    model = recoiling("passive hinge", -0.15)
    with pytest.raises(InvalidInputError, match=r'passive joint h .* other way .* joints = \["s"\]'):
        project_site(model, make_data(model), SensorSite("tip"))


TWO_LINKS = """
<mujoco><compiler angle="radian"/><option gravity="0 0 {gravity}"/><worldbody>
 <body><joint name="shoulder" axis="0 -1 0" range="-3 3"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"
   mass="1"/><body pos="0.3 0 0"><joint name="elbow" axis="0 -1 0" range="{elbow}"/><geom type="capsule"
   fromto="0 0 0 0.2 0 0" size="0.02" mass="0.5"/><site name="tip" pos="0.22 0 0" xyaxes="1 0 0 0 1 0"/></body></body>
</worldbody><actuator><motor joint="shoulder" ctrlrange="-20 20"/><motor joint="elbow" ctrlrange="-10 10"/></actuator>
</mujoco>"""


def test_the_excursion_ends_where_the_elbow_reaches_its_range() -> None:
    """The distance from shoulder to tip follows from the elbow angle by the law of cosines."""
    model = model_of(TWO_LINKS.format(gravity=0, elbow="-1.6 -0.4"))
    shoulder, elbow = 0.9, -1.3
    projection = project_site(model, make_data(model, {"shoulder": shoulder, "elbow": elbow}), SensorSite("tip"))
    assert projection.hold == "position"
    tip = 0.3 * np.array([math.cos(shoulder), math.sin(shoulder)])
    u = np.array([math.cos(shoulder + elbow), math.sin(shoulder + elbow)])
    tip = tip + 0.22 * u

    def reach(angle: float) -> float:
        return math.sqrt(0.3**2 + 0.22**2 + 2 * 0.3 * 0.22 * math.cos(angle))

    along, across = tip @ u, tip @ np.array([-u[1], u[0]])
    ahead, back = projection.excursion
    assert ahead.length == pytest.approx(math.sqrt(reach(-0.4) ** 2 - across**2) - along, rel=1e-6)
    assert "elbow" in ahead.reason
    # in the other direction the shoulder distance falls until the elbow is bent most
    assert back.length == pytest.approx(along - math.sqrt(reach(-1.6) ** 2 - across**2), rel=1e-6)
    assert "elbow" in back.reason


def test_a_joint_at_its_end_leaves_the_motion_to_the_others() -> None:
    """Two slides along the axis: the second one continues when the first one has reached its range."""
    model = model_of(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="a" type="slide" axis="1 0 0" limited="true"
        range="-0.01 0.03"/><geom size="0.05" mass="0.1"/><body><joint name="b" type="slide" axis="1 0 0" limited="true"
        range="-0.2 0.1"/><geom size="0.02" mass="2"/><site name="tip" pos="0.2 0 0"/></body></body></worldbody>
        <actuator><motor joint="a" ctrlrange="-5 5"/><motor joint="b" ctrlrange="-5 5"/></actuator></mujoco>"""
    )
    projection = project_site(model, make_data(model), SensorSite("tip"))
    assert [path.length for path in projection.excursion] == pytest.approx([0.13, 0.21], abs=1e-7)


def test_a_long_slide_with_a_small_body_moves_along_its_whole_range() -> None:
    """The size of the model says nothing about the travel of a slide."""
    model = model_of(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="a" type="slide" axis="1 0 0" limited="true"
        range="-1 1.5"/><geom size="0.05" mass="1"/><site name="tip" pos="0.05 0 0"/></body></worldbody>
        <actuator><motor joint="a" ctrlrange="-5 5"/></actuator></mujoco>"""
    )
    projection = project_site(model, make_data(model), SensorSite("tip"))
    assert [path.length for path in projection.excursion] == pytest.approx([1.5, 1.0], abs=1e-7)


@pytest.mark.parametrize("angle", [0.0, 0.5, -1.0])
def test_gravity_leaves_less_acceleration_upward(angle: float) -> None:
    """A pendulum with a point mass: J q'' = tau - m g r cos(angle), and the tip moves with r q''."""
    model = model_of(
        """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody><body><joint name="a"
        axis="0 -1 0" range="-2 2"/><inertial pos="0.4 0 0" mass="2" diaginertia="1e-9 1e-9 1e-9"/>
        <site name="tip" pos="0.4 0 0"/></body></worldbody>
        <actuator><motor joint="a" gear="2" ctrlrange="-8 8" forcerange="-6 7"/></actuator></mujoco>"""
    )
    projection = project_site(model, make_data(model, {"a": angle}), SensorSite("tip", axis="+z"))
    inertia, load = 2 * 0.4**2 + 1e-9, 2 * 9.81 * 0.4 * math.cos(angle)
    assert projection.acceleration.ahead == pytest.approx(0.4 * (2 * 7 - load) / inertia)
    assert projection.acceleration.back == pytest.approx(0.4 * (2 * 6 + load) / inertia)
    assert projection.force.ahead == pytest.approx((2 * 7 - load) / 0.4)
    assert projection.force.back == pytest.approx((2 * 6 + load) / 0.4)
    assert projection.speed.ahead == math.inf
    assert projection.reflected_mass == pytest.approx(2.0)


def test_damping_and_servos_limit_the_speed() -> None:
    """Constant speeds: force = (joint damping + servo damping) * speed, and a given joint speed."""
    model = model_of(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="a" type="slide" axis="1 0 0" damping="3"
        limited="true" range="-1 1"/><geom size="0.1" mass="1"/><site name="tip" pos="0.1 0 0"/></body></worldbody>
        <actuator><velocity joint="a" kv="5" ctrlrange="-2 4" forcerange="-100 12"/></actuator></mujoco>"""
    )
    data = make_data(model)
    projection = project_site(model, data, SensorSite("tip"))
    assert projection.speed.ahead == pytest.approx(5 * 4 / (3 + 5))
    assert projection.speed.back == pytest.approx(5 * 2 / (3 + 5))
    assert projection.acceleration.ahead == pytest.approx(12.0)  # the servo may ask for 5 * 4 N
    assert projection.acceleration.back == pytest.approx(10.0)
    slow = project_site(model, data, SensorSite("tip"), joint_speeds={"a": 0.5})
    assert (slow.speed.ahead, slow.speed.back) == pytest.approx((0.5, 0.5))


def test_the_acceleration_is_reached_and_not_exceeded_by_any_torques() -> None:
    """Among 2,000 random torques within the limits, none accelerates the tip more; the best corner comes close.

    With hold="axis" nothing else is held, so that every torque counts.
    """
    model = model_of(TWO_LINKS.format(gravity=-9.81, elbow="-2.2 -0.4"))
    data = make_data(model, {"shoulder": 0.9, "elbow": -1.3})
    projection = project_site(model, data, SensorSite("tip", hold="axis"))
    rng = np.random.default_rng(1)
    highest = np.array([20.0, 10.0])
    corners = [np.array([a, b]) for a in (-20, 20) for b in (-10, 10)]
    along = []
    for torques in (*corners, *rng.uniform(-highest, highest, (2000, 2))):
        data.ctrl[:] = torques
        mujoco.mj_forward(model, data)
        along.append(projection.axis @ (site_acceleration(model, data) + model.opt.gravity))
    assert max(along) == pytest.approx(projection.acceleration.ahead, rel=1e-9)
    assert -min(along) == pytest.approx(projection.acceleration.back, rel=1e-9)


def test_the_conditioning_falls_to_zero_as_the_arm_is_stretched() -> None:
    model = model_of(TWO_LINKS.format(gravity=0, elbow="-2.2 2.2"))
    values = [
        project_site(model, make_data(model, {"elbow": angle}), SensorSite("tip"))
        for angle in (-1.5, -0.5, -0.1, -0.03)
    ]
    conditioning = [p.conditioning for p in values]
    assert conditioning == sorted(conditioning, reverse=True)
    assert conditioning[-1] < 0.05
    assert ["singularity" in " ".join(p.warnings) for p in values] == [False, False, True, True]


@pytest.mark.parametrize(("friction", "acceleration", "speed"), [(0, 50, 50 / 3), (20, 30, 10), (60, 0, 0)])
def test_dry_friction_leaves_less_acceleration_and_speed(friction: float, acceleration: float, speed: float) -> None:
    """A motor of 50 N moves 1 kg against dry and viscous friction."""
    model = model_of(
        f"""<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="a" type="slide" axis="1 0 0" damping="3"
        frictionloss="{friction}" limited="true" range="-1 1"/><geom size="0.1" mass="1"/>
        <site name="tip" pos="0.1 0 0"/></body></worldbody>
        <actuator><motor joint="a" ctrlrange="-50 50"/></actuator></mujoco>"""
    )
    projection = project_site(model, make_data(model), SensorSite("tip"))
    for limits, expected in ((projection.acceleration, acceleration), (projection.speed, speed)):
        assert (limits.ahead, limits.back) == pytest.approx((expected, expected), rel=1e-9)


def slide_with(actuator: str, body: str = "") -> object:
    """A slide of 2 kg with an actuator."""
    return model_of(
        f"""<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="a" type="slide" axis="1 0 0" limited="true"
        range="-0.2 0.5"/><geom size="0.1" mass="2"/><site name="tip" pos="0.1 0 0"/>{body}</body></worldbody>
        <actuator>{actuator}</actuator></mujoco>"""
    )


@pytest.mark.parametrize(
    ("options", "ahead", "back", "reasons", "codes"),
    [
        ("", 1000 * 0.4, 1000 * 0.3, ("control range of s", "control range of s"), ["PT556"]),
        ('forcerange="-70 50"', 50, 70, ("force range of s", "force range of s"), []),
        ('forcerange="-900 50"', 50, 300, ("force range of s", "control range of s"), []),
        ('forcerange="-900 900" gear="2"', 2 * 1000 * (0.5 - 0.2), 2 * 1000 * 0.4, ("control range of s",) * 2, []),
    ],
)
def test_the_limit_of_a_position_servo_is_said(options, ahead, back, reasons, codes) -> None:
    """At 0.1 m, with kp = 1000 N/m and a control from -0.2 to 0.5: the force is kp times the range from there."""
    model = slide_with(f'<position name="s" joint="a" kp="1000" kv="5" ctrlrange="-0.2 0.5" {options}/>')
    projection = project_site(model, make_data(model, {"a": 0.1}), SensorSite("tip"))
    limits = projection.acceleration
    assert (limits.ahead, limits.back) == pytest.approx((ahead / 2, back / 2))
    assert limits.reasons == reasons
    assert [text[:5] for text in projection.warnings] == codes


def test_the_force_of_a_muscle_is_that_of_its_length_and_it_lags() -> None:
    """Against MuJoCo's own force at full activation."""
    model = slide_with(
        '<muscle name="m" joint="a" range="0.6 1.2" lengthrange="-0.5 0.5" force="80" timeconst="0.02 0.07"/>'
        '<motor joint="a" ctrlrange="-300 300" name="other"/>'
    )
    data = make_data(model, {"a": 0.1})
    projection = project_site(model, data, SensorSite("tip"))
    data.act[:], data.ctrl[:] = 1.0, (1.0, -300.0)
    mujoco.mj_forward(model, data)
    assert projection.acceleration.back == pytest.approx(-float(data.qfrc_actuator[0]) / 2)
    assert projection.lag == 0.07
    assert [text[:5] for text in projection.warnings] == ["PT557"]


@pytest.mark.parametrize(
    ("actuator", "lag"),
    [
        ('<general joint="a" dyntype="filter" dynprm="0.05" ctrlrange="-9 9"/>', 0.05),
        ('<general joint="a" dyntype="filterexact" dynprm="0.2" ctrlrange="-9 9"/>', 0.2),
        ('<intvelocity joint="a" kp="50" ctrlrange="-2 2" actrange="-0.2 0.5" forcerange="-9 9"/>', 0.35),
        ('<general joint="a" dyntype="user" dynprm="0.2" ctrlrange="-9 9"/>', math.nan),
        ('<motor joint="a" ctrlrange="-9 9"/>', 0.0),
    ],
)
def test_the_activation_of_an_actuator_is_a_lag(actuator: str, lag: float) -> None:
    model = slide_with(actuator)
    projection = project_site(model, make_data(model), SensorSite("tip"))
    assert projection.lag == pytest.approx(lag, nan_ok=True)
    assert [text[:5] for text in projection.warnings if "PT557" in text] == ["PT557"] * (lag != 0)


def test_a_tendon_drives_two_joints_together() -> None:
    """One tendon pulls two slides in series with coefficients 1 and 0.5: it accelerates them by M^-1 (1, 0.5) f.

    The motion of the tip is that of MuJoCo's forward dynamics, and no torques drive the joints on their own.
    """
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="a" type="slide" axis="1 0 0"
        limited="true" range="-1 1"/><geom size="0.05" mass="1"/><body><joint name="b" type="slide" axis="1 0 0"
        limited="true" range="-1 1"/><geom size="0.02" mass="2"/><site name="tip" pos="0.2 0 0"/></body></body>
        </worldbody>
        <tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="0.5"/></fixed></tendon>
        <actuator><motor tendon="t" ctrlrange="-30 30"/></actuator>{}</mujoco>"""
    model = model_of(text.format(""))
    data = make_data(model)
    projection = project_site(model, data, SensorSite("tip"))
    data.ctrl[:] = 30.0
    mujoco.mj_forward(model, data)
    free = abs(float(data.qacc.sum()))
    assert projection.acceleration.ahead == pytest.approx(free)
    data.qfrc_applied[:] = -1.0  # an obstacle pushes back at the tip
    mujoco.mj_forward(model, data)
    assert projection.force.ahead == pytest.approx(free / (free - abs(float(data.qacc.sum()))))
    data.qfrc_applied[:] = 0.0
    mujoco.mj_forward(model, data)
    assert [projection.joint_motion[n] for n in "ab"] == pytest.approx((data.qacc / data.qacc.sum()).tolist())
    assert [text[:5] for text in projection.warnings] == ["PT558"]
    coupled = model_of(text.format('<equality><joint joint1="b" joint2="a" polycoef="0 1 0 0 0"/></equality>'))
    projection = project_site(coupled, make_data(coupled), SensorSite("tip"))
    assert projection.moved_mass == pytest.approx((1 + 2 * 2**2) / 2**2)
    assert projection.acceleration.ahead == pytest.approx(30 * 1.5 / (1 + 2 * 2**2) * 2)
    assert projection.warnings == ()


def test_a_force_at_a_site_drives_all_joints_of_its_arm() -> None:
    """A transmission by a site: torques are the transposed Jacobian, as in MuJoCo's own forward dynamics."""
    model = model_of(
        TWO_LINKS.format(gravity=0, elbow="-2 2").replace(
            '<motor joint="shoulder" ctrlrange="-20 20"/>', '<motor site="tip" gear="1 0 0 0 0 0" ctrlrange="-5 5"/>'
        )
    )
    data = make_data(model, {"shoulder": 0.4, "elbow": -1.0})
    projection = project_site(model, data, SensorSite("tip", hold="axis"))
    best = 0.0
    for push in (-5, 5):
        for torque in (-10, 10):
            data.ctrl[:] = push, torque
            mujoco.mj_forward(model, data)
            best = max(best, float(projection.axis @ site_acceleration(model, data)))
    assert projection.acceleration.ahead == pytest.approx(best)
