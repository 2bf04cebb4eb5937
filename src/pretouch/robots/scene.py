"""Set up an encounter of a MuJoCo robot with an object.

An object is put in front of a sensor, and the initial velocities are set.
"""

from __future__ import annotations

import copy
import math
import os
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity

from .dynamics import drivetrain_of, falls, robot_trees
from .geometry import move_site, way_out
from .model import Data, Model, mujoco, names_of, site_index, with_opaque_geoms
from .obstruction import take_to_surface
from .robot_file import RobotFile, compile_robot, robot_file
from .sight import FARTHEST, Sight
from .site import SensorSite

RADIUS: Final = 0.035
"""Radius of the ball that is added to a model without an object [m]."""

MASS: Final = 0.5
"""Mass of this ball [kg], unless another one is given."""

_BOTH: Final = 3  # bits of contype and conaffinity: the ball touches everything that can touch
_HEAVY: Final = 1000.0  # kg: stands for an infinite mass
_NAME: Final = "pretouch ball"
_VERTICAL: Final = 0.9  # |vertical component| of an axis above which it counts as vertical
_INSIDE: Final = 1e-5  # m: rounding of models
_STRAIGHT: Final = 1e-9  # m/s or rad/s: rounding of the joint velocities


@dataclass(frozen=True, slots=True)
class RobotScene:
    """A robot model at the start of an encounter with an object.

    The object is in front of a sensor.

    Args:
        model: a `mujoco.MjModel`.
        data: its state at the start.
        note: sentence that says which object approaches.
        warnings: sentences about the site, if it was moved to the surface of the robot.
    """

    model: Model
    data: Data
    note: str
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """The initial distance and velocities of an object and a robot.

    They are measured along the sensor axis.

    Args:
        distance: of an added ball from the site at the start [m].
        obstacle_velocity: velocity of the object [m/s], negative toward the robot.
        robot_velocity: velocity of the robot [m/s], positive toward the object.
        mass: mass of an added ball [kg]; infinite for a heavy one, NaN for the default.
        radius: radius of an added ball [m]; NaN for the default.
    """

    distance: float
    obstacle_velocity: float
    robot_velocity: float
    mass: float
    radius: float = math.nan


def make_scene(
    robot: str | os.PathLike[str] | RobotFile, model: Model, data: Data, site: SensorSite, approach: Approach
) -> RobotScene:
    """Return the scene of a robot's encounter with an object.

    Without a suitable object on the sensor's axis, a ball is added. Parts of the robot are no objects, also those that
    constraints of the model join to it or actuators drive, such as the other finger of a gripper. An object of the
    model that can move gets its velocity along the axis. If the object is fixed, a robot on a floating base gets the
    opposite velocity. The ball is added if the sensor sees no object within 0.5 m, or only one that stays where it is
    although the robot does not approach. The ball moves without gravity; with a robot on a floating base, it falls.

    Args:
        robot: the file of the model.
        model: the model of this file.
        data: its state.
        site: the sensor, with its curve.
        approach: the distance and the velocities.

    Returns:
        The scene.
    """
    index, model = site_index(model, site.name), with_opaque_geoms(model)
    curve: Any = site.sensor
    model, data, warnings = take_to_surface(model, data, [site])
    sight = Sight(model, site, index, curve, FARTHEST)
    drivetrain = drivetrain_of(model, data, index)
    glance, axis, base = sight.glance(data), sight.axis(data), drivetrain.root
    tree = int(model.body_treeid[model.geom_bodyid[glance.geom]]) if glance.geom >= 0 else -1
    own = tree >= 0 and tree in robot_trees(model, data, drivetrain)
    moving = np.flatnonzero((np.asarray(model.dof_treeid) == tree) & (tree >= 0) & (not own))
    unseen = own or not 0 < glance.distance <= FARTHEST
    if unseen or not (len(moving) or len(base) or approach.robot_velocity):
        weight = MASS if math.isnan(approach.mass) else min(approach.mass, _HEAVY)
        radius = RADIUS if math.isnan(approach.radius) else approach.radius
        ball = Ball(distance=approach.distance, velocity=approach.obstacle_velocity, mass=weight, radius=radius)
        scene = put_ball(model_with_ball(robot, gravity=falls(model, data, drivetrain)), data, site, ball)
        _refuse_ball_inside(*scene, radius)
        sizes = f"radius {format_quantity(radius, 'm')} and mass {format_quantity(weight, 'kg')}"
        return RobotScene(*scene, f"The object is an added ball with {sizes}.", warnings)
    if len(moving):
        point = np.array(data.site_xpos[index]) + glance.distance * axis
        body, velocity = int(model.geom_bodyid[glance.geom]), approach.obstacle_velocity * axis
        data.qvel[moving] = _velocities(_jacobian(model, data, point, body)[:, moving], velocity)
    elif len(base):
        point, body = np.array(data.site_xpos[index]), int(model.site_bodyid[index])
        data.qvel[base] = _velocities(_jacobian(model, data, point, body)[:, base], -approach.obstacle_velocity * axis)
    mujoco().mj_forward(model, data)
    name = names_of(model, "geom")[glance.geom] or f"number {glance.geom}"
    start = format_quantity(glance.distance, "m")
    note = f"The object is the geom {name!r} of the model, at a distance of {start} from the sensor."
    if not math.isnan(approach.radius):
        note += " It has the size that the model says, so object_radius has no effect."
    return RobotScene(model, data, note, warnings)


def _refuse_ball_inside(model: Model, data: Data, radius: float) -> None:
    """Raise an error if the added ball overlaps something."""
    ball, names = model.geom(_NAME).id, names_of(model, "geom")
    for contact in data.contact:
        other = int(contact.geom[0] if contact.geom[1] == ball else contact.geom[1])
        if ball in contact.geom and contact.dist < -_INSIDE:
            fixed = int(model.body_treeid[model.geom_bodyid[other]]) < 0
            raise InvalidInputError(
                f"obstacle position: the ball of radius {format_quantity(radius, 'm')} that is added at this distance "
                f"overlaps the geom {names[other] or f'number {other}'} by "
                f"{format_quantity(-float(contact.dist), 'm', 2)}; choose a smaller object_radius in [robot], or "
                f"another distance or posture{', or let the robot approach this geom' if fixed else ''}",
                value=names[other],
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ball:
    """A ball in front of a sensor.

    Args:
        distance: from the site along the axis to the surface of the ball, for a ball on the axis [m].
        velocity: along the axis [m/s], negative toward the robot.
        radius: its radius [m].
        mass: its mass [kg].
        offset: distance of its center from the axis [m], upward, or along x for a vertical axis.
    """

    distance: float
    velocity: float
    radius: float = RADIUS
    mass: float = MASS
    offset: float = 0.0


def model_with_ball(robot: str | os.PathLike[str] | RobotFile, *, gravity: bool) -> Model:
    """Load a robot model from a file, and add a ball.

    Returns:
        The model, in which `put_ball` places the ball in front of a sensor.
    """
    return compile_robot(robot_file(robot), lambda spec: _add_ball(spec, gravity=gravity))


def _add_ball(spec: Any, *, gravity: bool) -> None:
    """Add the ball to the `mujoco.MjSpec` of a robot. Without gravity, the ball flies straight."""
    library = mujoco()
    for key in list(spec.keys):  # they lack the positions of the ball
        spec.delete(key)
    body = spec.worldbody.add_body(
        name=_NAME,
        gravcomp=0.0 if gravity else 1.0,
        mass=MASS,
        inertia=[0.4 * MASS * RADIUS**2] * 3,
        explicitinertial=True,  # models of URDF files compute no masses from geoms
    )
    body.add_freejoint()
    body.add_geom(
        name=_NAME,
        type=library.mjtGeom.mjGEOM_SPHERE,
        size=[RADIUS, 0, 0],
        mass=MASS,
        contype=_BOTH,
        conaffinity=_BOTH,
        rgba=[0.9, 0.6, 0.2, 1.0],
    )


def put_ball(model: Model, data: Data, site: SensorSite, ball: Ball) -> tuple[Model, Data]:
    """Place the ball of a model in front of a sensor site.

    Args:
        model: the model of `model_with_ball`, which is not changed.
        data: the state of the robot, of this model or of the model without the ball.
        site: the sensor.
        ball: the ball.

    Returns:
        A copy of the model with a ball of this size and mass, and its state.
    """
    library, copied = mujoco(), copy.copy(model)
    body, geom, radius = copied.body(_NAME).id, copied.geom(_NAME).id, ball.radius
    copied.body_mass[body], copied.body_inertia[body] = ball.mass, 0.4 * ball.mass * radius**2
    copied.geom_size[geom, 0] = copied.geom_rbound[geom] = radius
    box = [0.0, 0.0, 0.0, radius, radius, radius]
    copied.geom_aabb[geom] = box
    first = copied.body_bvhadr[body]
    copied.bvh_aabb[first : first + copied.body_bvhnum[body]] = box
    state = library.MjData(copied)
    library.mj_setConst(copied, state)
    joint = copied.body(_NAME).jntadr[0]
    place, speed = copied.jnt_qposadr[joint], copied.jnt_dofadr[joint]  # the ball is the last body
    state.qpos[:place], state.qvel[:speed] = data.qpos[:place], data.qvel[:speed]
    library.mj_kinematics(copied, state)
    index = site_index(copied, site.name)
    axis = np.array(state.site_xmat[index]).reshape(3, 3) @ site.direction
    move_site(copied, index, way_out(copied, state, index, axis)[0] * site.direction)
    library.mj_kinematics(copied, state)
    side = np.eye(3)[0 if abs(axis[2]) > _VERTICAL else 2]
    side = side - (side @ axis) * axis
    center = state.site_xpos[index] + (ball.distance + radius) * axis + ball.offset * side / np.linalg.norm(side)
    state.qpos[place : place + 7] = (*center, 1.0, 0.0, 0.0, 0.0)
    state.qvel[speed : speed + 3] = ball.velocity * axis
    library.mj_forward(copied, state)
    return copied, state


def _jacobian(model: Model, data: Data, point: FloatArray, body: int) -> FloatArray:
    """Return linear and angular velocity of a body at a point per joint velocity, shape (6, nv)."""
    jacobian = np.zeros((6, model.nv))
    mujoco().mj_jac(model, data, jacobian[:3], jacobian[3:], point, body)
    return jacobian


def _velocities(jacobian: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return joint velocities that give a body a requested velocity."""
    for rows in (6, 3):
        wanted = np.concatenate([velocity, np.zeros(3)])[:rows]
        rates: FloatArray = np.linalg.lstsq(jacobian[:rows], wanted, rcond=None)[0]
        if np.allclose(jacobian[:rows] @ rates, wanted, atol=_STRAIGHT):
            return rates
    raise InvalidInputError(
        "obstacle velocity: the joints of the object cannot move it along the axis of the site; add a joint to its "
        "body, or choose another axis"
    )
