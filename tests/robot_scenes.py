"""Robots in MuJoCo with objects that approach their sensors."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
from pretouch.robots import load_model, make_data

ARM = Path(__file__).parents[1] / "examples/robots/arm.xml"
CURVE = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
DISTANCE = 0.0422
SLIDE = """
<mujoco><option timestep="0.001" gravity="{gravity}"/><worldbody><body name="base" pos="0 0 1">{base}
  <inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
  <body pos="0.1 0 0"><joint name="slide" type="slide" axis="1 0 0" limited="true" range="-0.2 0.1"/>
    <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.02" mass="0.25"/><site name="tip" pos="0.12 0 0"/></body></body>
</worldbody><actuator><motor joint="slide" ctrlrange="-50 50"/></actuator></mujoco>"""
SIX_AXIS = """
<mujoco model="six-axis arm"><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast"/>
<default><default class="arm"><joint armature="0.1" damping="1"/><geom type="capsule" contype="1" conaffinity="0"/>
</default></default>
<worldbody><geom name="floor" type="plane" size="2 2 0.1" contype="0" conaffinity="1"/>
<body name="base" childclass="arm"><geom fromto="0 0 0.02 0 0 0.08" size="0.075" mass="4"/>
 <body name="shoulder" pos="0 0 0.16"><joint name="pan" axis="0 0 1" range="-6.28 6.28"/>
  <inertial pos="0 0.01 0" mass="3.7" diaginertia="0.011 0.011 0.01"/><geom fromto="0 -0.05 0 0 0.05 0" size="0.06"/>
  <body name="upper arm" pos="0 0.14 0"><joint name="lift" axis="0 1 0" range="-6.28 6.28"/>
   <inertial pos="0 -0.02 0.21" mass="8.4" diaginertia="0.23 0.23 0.02"/><geom fromto="0 0 0 0 0 0.42" size="0.05"/>
   <body name="forearm" pos="0 -0.13 0.425"><joint name="elbow" axis="0 1 0" range="-3.14 3.14"/>
    <inertial pos="0 0 0.2" mass="2.3" diaginertia="0.05 0.05 0.004"/><geom fromto="0 0 0 0 0 0.39" size="0.04"/>
    <body name="wrist 1" pos="0 0 0.39"><joint name="wrist 1" axis="0 1 0" range="-6.28 6.28"/>
     <inertial pos="0 0.12 0" mass="1.2" diaginertia="0.003 0.003 0.002"/><geom fromto="0 0 0 0 0.1 0" size="0.04"/>
     <body name="wrist 2" pos="0 0.13 0"><joint name="wrist 2" axis="0 0 1" range="-6.28 6.28"/>
      <inertial pos="0 0 0.1" mass="1.2" diaginertia="0.003 0.003 0.002"/><geom fromto="0 0 0 0 0 0.08" size="0.04"/>
      <body name="wrist 3" pos="0 0 0.1"><joint name="wrist 3" axis="0 1 0" range="-6.28 6.28"/>
       <inertial pos="0 0.08 0" mass="0.3" diaginertia="0.0002 0.0002 0.0002"/>
       <geom type="cylinder" fromto="0 0.04 0 0 0.1 0" size="0.035"/>
       <site name="flange" pos="0 0.1 0" xyaxes="0 1 0 1 0 0"/>
      </body></body></body></body></body></body></body></worldbody>
<actuator><motor joint="pan" ctrlrange="-150 150"/><motor joint="lift" ctrlrange="-150 150"/>
 <motor joint="elbow" ctrlrange="-150 150"/><motor joint="wrist 1" ctrlrange="-28 28"/>
 <motor joint="wrist 2" ctrlrange="-28 28"/><motor joint="wrist 3" ctrlrange="-28 28"/></actuator></mujoco>"""
BALL = '<geom type="sphere" size="0.035" mass="0.5" contype="3" conaffinity="3"/>'  # touches whatever can be touched


def controller(gain: float = -0.7, rate: float | None = None, **options: Any) -> Controller:
    period = None if rate is None else 1 / rate
    return Controller(
        period=1e-3,
        conditioning=Conditioning(floor=1e-6, sensor_period=period),
        law=VirtualDamper(gain=gain, **options),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )


def with_object(
    text: str,
    data: Any,
    site: str,
    speed: float,
    *,
    geom: str = BALL,
    radius: float = 0.035,
    offset: float = 0.0,
    distance: float = DISTANCE,
    direction: Any = None,
) -> tuple[Any, Any]:
    """Add a free object that approaches a site of a model along its axis +x, and return model and state.

    `distance` is from the site to the nearest point of a ball on the axis; `offset` moves the object sideways.
    """
    import mujoco

    place, turn = data.site(site).xpos.copy(), data.site(site).xmat.reshape(3, 3)
    u, side = turn[:, 0], turn[:, 2]
    center = place + (distance + radius) * u + offset * side
    row = " ".join(repr(float(v)) for v in center)
    frame = " ".join(repr(float(v)) for v in (*turn[:, 0], *turn[:, 1]))
    body = f'<body name="object" pos="{row}" xyaxes="{frame}" gravcomp="{{}}"><freejoint/>{geom}</body></worldbody>'
    floats = "<freejoint/>" in text
    scene = re.sub(r"<keyframe>.*</keyframe>", "", text, flags=re.DOTALL)
    model = mujoco.MjModel.from_xml_string(scene.replace("</worldbody>", body.format(0 if floats else 1), 1))
    state = mujoco.MjData(model)
    count = len(data.qpos)
    state.qpos[:count] = data.qpos
    state.qvel[len(data.qvel) : len(data.qvel) + 3] = -speed * (u if direction is None else direction)
    mujoco.mj_forward(model, state)
    return model, state


def arm_with_ball(posture: str, speed: float, *, timestep: float = 1e-3, **options: Any) -> tuple[Any, Any]:
    model = load_model(ARM)
    text = ARM.read_text().replace('timestep="0.0005"', f'timestep="{timestep!r}"')
    return with_object(text, make_data(model, keyframe=posture), "fingertip", speed, **options)


def six_axis_with_ball(speed: float, **options: Any) -> tuple[Any, Any]:
    """An arm of the size and mass of a UR5e in a bent posture, with a ball ahead of its flange."""
    import mujoco

    joints = {"lift": -1.2, "elbow": 1.9, "wrist 1": -0.7}
    data = make_data(mujoco.MjModel.from_xml_string(SIX_AXIS), joints)
    return with_object(SIX_AXIS, data, "flange", speed, **options)


def slide_with_ball(mass: float, speed: float, *, floats: bool = True, gravity: float = 0.0, **options: Any) -> Any:
    import mujoco

    text = SLIDE.format(base="<freejoint/>" if floats else "", mass=mass, gravity=f"0 0 {-gravity}")
    return with_object(text, make_data(mujoco.MjModel.from_xml_string(text)), "tip", speed, **options)


def continuous_speed(speed: float, gain: float = -0.7) -> float:
    """The contact speed of the letter's encounter with another approach speed, in continuous time [m/s]."""
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=DISTANCE, velocity=-speed),
    )
    return float(pt.find_contact(scenario, CURVE, gain).contact.relative_velocity)


def share(simulated: Any, predicted: Any) -> float:
    """The largest relative deviation of a simulation from its prediction."""
    return float(np.max(np.abs(np.asarray(simulated) / np.asarray(predicted) - 1)))


def speed_by_shape(scene: Any, site: Any, number: float, law: str, coordinate: int) -> float:
    """The continuous contact speed with the ln xi that the beam of a site reads from the shape of an object [m/s].

    The object is moved along the axis x of the world, by a coordinate of the model, while the robot stays.
    """
    import mujoco

    from pretouch.robots.sight import Sight

    model, data = scene
    sight = Sight(model, site, model.site(site.name).id, CURVE, 0.5)
    start, place = sight.glance(data).distance, float(data.qpos[coordinate])
    distances = np.linspace(0.0, start, 200)
    outputs = []
    for distance in distances:
        data.qpos[coordinate] = place - start + distance
        mujoco.mj_kinematics(model, data)
        outputs.append(float(CURVE.output(sight.equivalent_distance(data))))
    data.qpos[coordinate] = place
    mujoco.mj_forward(model, data)
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=start, velocity=float(data.qvel[model.jnt_dofadr[-1]])),
    )
    table = pt.Table(distances=tuple(distances), outputs=tuple(outputs))
    return abs(float(pt.find_contact(scenario, table, number, law=law).contact.relative_velocity))
