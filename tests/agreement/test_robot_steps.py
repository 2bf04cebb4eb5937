"""Compare every step of the compiled robot loop with a plain loop in Python."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from pretouch.robots import ComputedTorque, PositionControl, SensorSite, SiteLaw, make_data, simulate_robot
from pretouch.robots.sight import Sight
from pretouch.robots.tracking import JointState, Tracking
from pretouch.simulation import SensorChain
from pretouch.simulation.sensing import SensorRun
from robot_scenes import CURVE, SLIDE, controller, slide_with_ball, with_object

mujoco = pytest.importorskip("mujoco")

CHAIN = SensorChain(rate=400.0, exposure=5e-4, delay=3e-4, noise=1e-5)
BEHIND = 0.01  # m: rays start as far behind the contact surface
FARTHEST = 0.5  # m


def cast(model: Any, data: Any, site: int, ray: Any, axis: Any) -> tuple[float, float]:
    """The distance along the axis to what a ray meets [m], and the cosine of the angle to its surface."""
    normal, geom = np.zeros(3), np.zeros(1, dtype=np.int32)
    start, body = data.site_xpos[site] - BEHIND * axis, int(model.site_bodyid[site])
    length = mujoco.mj_ray(model, data, start, ray, None, True, body, geom, normal)
    return (length * float(ray @ axis) - BEHIND, abs(float(normal @ ray))) if length >= 0 else (math.inf, 0.0)


def beam_distance(model: Any, data: Any, site: int, rays: Any, axis: Any) -> float:
    """The distance of a facing plane that causes the same output as the scene [m]."""
    hits = [cast(model, data, site, ray, axis) for ray in rays]
    near = [(distance, facing) for distance, facing in hits if distance <= FARTHEST]
    if not near:
        return math.inf
    slope = float(CURVE.log_slope(0.0))  # the curve continues straight below 0
    outputs = [facing * float(CURVE.output(max(d, 0.0))) * math.exp(slope * min(d, 0.0)) for d, facing in near]
    output = sum(outputs) / float((rays @ axis).sum())
    if not float(CURVE.output(FARTHEST)) < output < float(CURVE.output(0.0)):
        return 0.0 if output > float(CURVE.output(FARTHEST)) else math.inf
    return float(brentq(lambda d: float(CURVE.log_output(d)) - math.log(output), 0.0, FARTHEST, xtol=1e-15))


def plain_torque(model: Any, data: Any, tracking: Any, wanted: tuple[float, float, float], q: float) -> float:
    """The torque of the only joint, which has moved by q, for a wanted position, velocity and acceleration."""
    w, rate = 2 * math.pi * tracking.bandwidth, float(data.qvel[0])
    pull = w * w * (wanted[0] - q) - 2 * tracking.damping_ratio * w * rate
    if isinstance(tracking, ComputedTorque):
        pull += wanted[2] + 2 * tracking.damping_ratio * w * wanted[1]
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return float(np.clip(mass[0, 0] * pull + data.qfrc_bias[0] - data.qfrc_passive[0], -50.0, 50.0))


def plain_trace(scene: Any, law: SiteLaw, tracking: ComputedTorque | PositionControl, count: int, seed: int) -> Any:
    """Time series of a slide with a sensor: distance, reference, force, torque and positions in each step."""
    model, start = scene
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start.qpos, start.qvel
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    mujoco.mj_forward(model, data)
    site, ball = model.site("tip").id, model.body("object").id
    sight = Sight(model, law.site, site, CURVE, FARTHEST)
    h, period = model.opt.timestep, law.controller.period
    axis = np.array([1.0, 0.0, 0.0])
    rays = sight.rays(data)
    first = beam_distance(model, data, site, rays, axis)
    sensor = SensorRun(CHAIN, CURVE, distance=first, farthest=FARTHEST, period=period, seed=seed)
    run, distance, force = law.running.begin(), cast(model, data, site, axis, axis)[0], 0.0
    rows, x, v, origin = [], 0.0, 0.0, float(data.qpos[0])
    taken: list[tuple[float, Any]] = []  # references, with the time from which the joint follows them
    steps = round(period / h)
    for step in range(count):
        i = step % steps
        t, at = (step // steps) * period, i * h
        if i == 0:
            fresh = sensor.deliver(t)
            before = x, v
            output = run.step(sensor.reading, fresh, max(t - sensor.measured, 0.0), contact_force=-force)
            x, v = output.position, output.velocity
            course = np.polynomial.Polynomial(
                [
                    before[0],
                    before[1],
                    (3 * (x - before[0]) / period - 2 * before[1] - v) / period,
                    (before[1] + v - 2 * (x - before[0]) / period) / period**2,
                ]
            )
        mujoco.mj_step1(model, data)
        wanted = course(at), course.deriv()(at), course.deriv(2)(at)
        interval, delay = getattr(tracking, "rate", None), getattr(tracking, "delay", 0.0)
        if interval is None or t + at >= len(taken) / interval - 1e-12:
            taken.append((t + at + delay, wanted))
        wanted = next((held for ready, held in reversed(taken) if ready <= t + at + 1e-12), taken[0][1])
        torque = plain_torque(model, data, tracking, wanted, float(data.qpos[0]) - origin)
        data.qfrc_applied[0] = torque
        rows.append((distance, x, force, torque, *data.qpos))
        mujoco.mj_step2(model, data)
        mujoco.mj_kinematics(model, data)
        now, last = t + (i + 1) * h, distance
        distance = cast(model, data, site, axis, axis)[0]
        while sensor.next <= now + 1e-12:
            seen = beam_distance(model, data, site, rays, axis)
            shift = -(distance - last) * (now - sensor.next) / h
            sensor.look(max(seen + shift, 0.0) if math.isfinite(seen) else 2 * FARTHEST)
        force = 0.0
        for number, contact in enumerate(data.contact):
            wrench = np.zeros(6)
            mujoco.mj_contactForce(model, data, number, wrench)
            sign = -1.0 if int(model.geom_bodyid[contact.geom[0]]) == ball else 1.0
            force += sign * float((np.array(contact.frame).reshape(3, 3).T @ wrench[:3])[0])
    return np.array(rows)


@pytest.mark.parametrize("angle", [0.0, math.radians(8)])
@pytest.mark.parametrize(
    "tracking",
    [ComputedTorque(), PositionControl(bandwidth=15.0), PositionControl(bandwidth=15.0, rate=125.0, delay=4e-3)],
)
def test_every_step_is_that_of_a_plain_loop(angle: float, tracking: ComputedTorque | PositionControl) -> None:
    scene = slide_with_ball(1.0, 0.3, floats=False, offset=0.005)
    site = SensorSite("tip", CURVE, field_of_view=angle)
    law = SiteLaw(site=site, controller=controller(-0.1, rate=400.0), chain=CHAIN)
    result = simulate_robot(*scene, [law], tracking=tracking, seed=4)
    trace = result.trace()
    compiled = np.column_stack([trace.distance, trace.reference, trace.force, trace.torque, trace.configuration])
    count = min(len(trace.time), 300)
    assert np.nanmax(trace.force[:count]) > 0.1
    plain = plain_trace(scene, law, tracking, count, 4)
    # the table of the curve has an error of 1e-12 of ln xi, and a stiff contact magnifies differences of the positions
    assert np.array_equal(np.isfinite(compiled[:count]), np.isfinite(plain))
    difference = np.abs(np.where(np.isfinite(plain), compiled[:count] - plain, 0.0)).max(axis=0)
    assert np.all(difference[[0, 1, *range(4, len(difference))]] < 1e-10)
    assert np.all(difference[2:4] < 1e-6)


class _Held(Tracking):
    """A custom tracking in Python with the torques of another one."""

    def __init__(self, tracking: Tracking) -> None:
        self._tracking = tracking

    def torques(self, state: JointState) -> Any:
        return self._tracking.torques(state)


@pytest.mark.parametrize("floats", [False, True])
def test_torques_of_python_are_those_of_compiled_code(floats: bool) -> None:
    law = SiteLaw(site=SensorSite("tip", CURVE), controller=controller())
    traces = [
        simulate_robot(*slide_with_ball(2.0, 0.3, floats=floats), [law], tracking=tracking, horizon=0.1).trace()
        for tracking in (ComputedTorque(model_error=0.2), _Held(ComputedTorque(model_error=0.2)))
    ]
    assert len(traces[0].time) == 100
    assert np.allclose(traces[0].torque, traces[1].torque, rtol=0, atol=1e-9)
    assert np.allclose(traces[0].configuration, traces[1].configuration, rtol=0, atol=1e-12)


EXTRA = (
    '<body name="extra" pos="0 0.03 0"><joint name="extra" type="slide" axis="1 0 0"/><geom size="0.01" mass="0.1"/>'
    "</body>"
)
DANGLING = '<body pos="0 -0.03 0"><joint axis="0 1 0"/><geom size="0.01" pos="0 0 -0.05" mass="0.1"/></body>'
CRANK = """<body pos="0 0.05 0"><joint axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 0 0.1 0" size="0.01" mass="0.1"/>
<body name="rod" pos="0 0.1 0"><joint axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 -0.05 0 0" size="0.01" mass="0.1"/></body></body>"""
COUPLED = '<joint joint1="extra" joint2="slide" polycoef="0 1 0 0 0"/>'


@pytest.mark.parametrize(
    ("base", "part", "equality"),
    [
        ("", EXTRA, COUPLED),
        ("", EXTRA, COUPLED + '<joint joint1="slide" joint2="extra" polycoef="0 1 0 0 0"/>'),  # the same twice
        ("", CRANK, '<connect body1="rod" anchor="-0.05 0 0"/>'),
        ("<freejoint/>", EXTRA + DANGLING, COUPLED),
        ("<freejoint/>", DANGLING, '<weld body1="base"/>'),
    ],
)
def test_torques_under_constraints_are_those_of_python(base: str, part: str, equality: str) -> None:
    """Compiled code decomposes the constraints of the base by itself; Python uses pseudoinverses of NumPy."""
    text = SLIDE.format(base=base, mass=1.0, gravity="0 0 0").replace('<site name="tip"', f'{part}<site name="tip"')
    text = text.replace("</worldbody>", f"</worldbody><equality>{equality}</equality>")
    scene = with_object(text, make_data(mujoco.MjModel.from_xml_string(text)), "tip", 0.3)
    law = SiteLaw(site=SensorSite("tip", CURVE), controller=controller())
    traces = [
        simulate_robot(*scene, [law], tracking=tracking, horizon=0.1).trace()
        for tracking in (ComputedTorque(model_error=0.1), _Held(ComputedTorque(model_error=0.1)))
    ]
    assert len(traces[0].time) == 100
    assert np.abs(traces[1].torque).max() > 1.0
    assert np.allclose(traces[0].torque, traces[1].torque, rtol=0, atol=1e-9)
    assert np.allclose(traces[0].configuration, traces[1].configuration, rtol=0, atol=1e-12)
