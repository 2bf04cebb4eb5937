"""Compute a robot's largest acceleration, speed and force along an axis.

Linear programs yield these limits. The unknowns are the motion or force along the axis, the joint motion in the null
space of what the joints hold, and the forces and controls of the actuators.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .dynamics import AxisMotion, Drivetrain, PostureDynamics, actuator_moment, constraint_rows, reduce_base
from .model import Data, Model, mujoco

_OPTIMAL: Final = 0  # status of linprog
_ENDLESS: Final = 1e6  # m/s^2 or N: no robot reaches as much, so that it counts as no limit
_STILL: Final = 1e-9  # velocity relative to the fastest joint, below which a joint rests
_FASTEST: Final = 30.0  # m/s: likewise; models with torques but without speed limits allow hundreds of m/s


@dataclass(frozen=True, slots=True)
class AxisLimits(Value):
    """The largest acceleration, speed or force in both directions along an axis.

    Args:
        ahead: toward objects; infinite without a limit.
        back: away from objects; infinite without a limit.
    """

    ahead: float
    back: float

    @property
    def least(self) -> float:
        """The smaller of the limits toward and away from objects."""
        return min(self.ahead, self.back)


@dataclass(frozen=True, slots=True)
class Drives:
    """The actuators of a robot at rest in one posture.

    The force of an actuator output is gain * control + constant - damping * (velocity of the actuator).

    Args:
        moment: joint torques per actuator force, shape (rows, n).
        lowest: smallest forces [N or N m], shape (rows,).
        highest: largest forces, shape (rows,).
        gain: force per control, shape (rows,); 0 for a force that does not depend on its control in a known way.
        constant: force at rest without control, shape (rows,).
        damping: loss of force per velocity of the actuator, shape (rows,).
        controls: smallest and largest control, shape (rows, 2).
        torques: smallest and largest torque of all actuators at each joint, shape (n, 2).
        load: torques that hold the robot at rest against gravity and springs, shape (n,).
        friction: viscous damping of the joints, shape (n, n).
        speeds: largest joint speeds, shape (n,).
        coupling: rows of the constraints that couple driven joints, whose forces the drives need not apply, shape
            (r, n).
        following: velocities of base and joints per velocity of the joints, as far as constraints cause them.
        dry_friction: friction loss of base and joints [N m or N], in the same order.
    """

    moment: FloatArray
    lowest: FloatArray
    highest: FloatArray
    gain: FloatArray
    constant: FloatArray
    damping: FloatArray
    controls: FloatArray
    torques: FloatArray
    load: FloatArray
    friction: FloatArray
    speeds: FloatArray
    coupling: FloatArray
    following: FloatArray
    dry_friction: FloatArray

    @property
    def has_force_limits(self) -> bool:
        """Whether the model limits the force of every actuator."""
        by_control = (self.gain != 0) & np.isfinite(self.controls).all(axis=1)
        by_force = np.isfinite(self.lowest) & np.isfinite(self.highest)
        by_torque = np.isfinite(self.torques).all()
        return bool((by_control | by_force).all() or by_torque)


def drives_of(model: Model, data: Data, drivetrain: Drivetrain, speeds: FloatArray) -> Drives:
    """Read a robot's actuator limits, and compute its joint load at rest.

    Args:
        model: the model.
        data: its state at rest, after `mj_forward`.
        drivetrain: its degrees of freedom.
        speeds: largest speeds of the driven joints [rad/s or m/s], shape (n,); infinite for none.

    Returns:
        The drives. In free fall, gravity accelerates base and joints alike and loads no joint.
    """
    rows, joints, driven, base = drivetrain.rows, drivetrain.joints, drivetrain.driven, drivetrain.base
    library, moment = mujoco(), actuator_moment(model, data)[np.ix_(drivetrain.rows, drivetrain.driven)]
    limited = np.asarray(model.actuator_forcelimited).astype(bool)[rows]
    forces = np.where(limited[:, None], np.asarray(model.actuator_forcerange)[rows], (-math.inf, math.inf))
    gain_of, bias_of = np.asarray(model.actuator_gainprm)[rows], np.asarray(model.actuator_biasprm)[rows]
    kinds, biases = np.asarray(model.actuator_gaintype)[rows], np.asarray(model.actuator_biastype)[rows]
    length, gains, bias_kinds = np.array(data.actuator_length)[rows], library.mjtGain, library.mjtBias
    affine_gain, affine_bias = kinds == int(gains.mjGAIN_AFFINE), biases == int(bias_kinds.mjBIAS_AFFINE)
    supported = (affine_gain | (kinds == int(gains.mjGAIN_FIXED))) & (
        affine_bias | (biases == int(bias_kinds.mjBIAS_NONE))
    )
    gain = np.where(supported, gain_of[:, 0] + np.where(affine_gain, gain_of[:, 1] * length, 0.0), 0.0)
    bias = np.where(affine_bias & supported, bias_of[:, 0] + bias_of[:, 1] * length, 0.0)
    torque_limited = np.asarray(model.jnt_actfrclimited).astype(bool)[joints]
    torques = np.where(torque_limited[:, None], np.asarray(model.jnt_actfrcrange)[joints], (-math.inf, math.inf))
    every, mass = np.concatenate([base, driven]), np.zeros((model.nv, model.nv))
    library.mj_fullM(model, data, mass)
    reduction = reduce_base(mass[np.ix_(every, every)], constraint_rows(model, data)[:, every], len(base))
    together = np.vstack([reduction.motion, np.eye(len(driven))])
    following = np.vstack([reduction.forced, np.eye(len(driven))])
    return Drives(
        moment=moment,
        lowest=forces[:, 0],
        highest=forces[:, 1],
        gain=gain,
        constant=bias,
        damping=np.where(affine_bias & supported, -bias_of[:, 2], 0.0),
        controls=_controls(model, rows, supported),
        torques=torques,
        load=together.T @ np.array(data.qfrc_bias - data.qfrc_passive)[every],
        friction=following.T @ (np.asarray(model.dof_damping)[every, None] * following),
        speeds=speeds,
        coupling=reduction.coupling,
        following=following,
        dry_friction=np.asarray(model.dof_frictionloss)[every],
    )


def _controls(model: Model, rows: Any, known: Any) -> FloatArray:
    """Return the range of the control of each actuator, or of its activation if it integrates its control."""
    integrates = np.asarray(model.actuator_dyntype)[rows] == int(mujoco().mjtDyn.mjDYN_INTEGRATOR)
    limited = np.where(
        integrates, np.asarray(model.actuator_actlimited)[rows], np.asarray(model.actuator_ctrllimited)[rows]
    ).astype(bool)
    ranges = np.where(
        integrates[:, None], np.asarray(model.actuator_actrange)[rows], np.asarray(model.actuator_ctrlrange)[rows]
    )
    return np.where((limited & known)[:, None], ranges, (-math.inf, math.inf))


def acceleration_limits(drives: Drives, dynamics: PostureDynamics, motion: AxisMotion) -> AxisLimits:
    """Return the largest accelerations of a sensor site along its axis [m/s^2].

    The site starts from rest, and accelerates relative to the robot's base. The torques are (inertia) q'' + load, with
    q'' along the axis plus any motion in the null space.
    """
    columns = dynamics.inertia @ np.column_stack([motion.joints, motion.free])
    return _span(drives, columns, np.zeros((len(motion.joints), 0)), _friction_torques(drives, motion))


def _friction_torques(drives: Drives, motion: AxisMotion) -> FloatArray:
    """Return the torques [N m or N] that dry friction takes from the drives while a site moves ahead, shape (n,)."""
    velocities = drives.following @ motion.joints
    signs = np.sign(np.where(np.abs(velocities) > _STILL * np.abs(velocities).max(), velocities, 0.0))
    return np.asarray(drives.following.T @ (drives.dry_friction * signs))


def speed_limits(drives: Drives, motion: AxisMotion) -> AxisLimits:
    """Return the largest constant speeds of a sensor site along its axis.

    The speeds [m/s] are relative to the robot's base. The actuators overcome gravity and the damping of joints and
    actuators; torques that grow with the square of the speed are neglected. Without given joint speeds or damping that
    keeps the speed plausible, there is no limit.
    """
    velocities = np.column_stack([motion.joints, motion.free])
    span = _span(drives, drives.friction @ velocities, velocities, _friction_torques(drives, motion))
    ahead, back = (speed if speed < _FASTEST else math.inf for speed in (span.ahead, span.back))
    return AxisLimits(ahead, back)


def force_limits(drives: Drives, dynamics: PostureDynamics) -> AxisLimits:
    """Return the largest static forces [N] along the axis of a sensor.

    On a floating base, the force accelerates base and joints together, without motion between them.
    """
    return _span(drives, (dynamics.axis @ dynamics.relative[:3])[:, None], np.zeros((len(dynamics.inertia), 0)))


def _span(
    drives: Drives, columns: FloatArray, velocities: FloatArray, friction: FloatArray | None = None
) -> AxisLimits:
    """Return the largest acceleration, speed or force that the drives allow.

    This quantity is x[0]. The drives apply the joint torques columns @ x + load.

    Args:
        drives: the drives.
        columns: joint torques per variable, shape (n, k).
        velocities: joint velocities per variable if the variables are velocities, else without columns.
        friction: torques of dry friction during motion ahead, shape (n,); None for none. The limit is 0 if the drives
            cannot overcome it.

    Returns:
        The largest magnitudes of x[0] in both directions.

    Raises:
        InvalidInputError: the limits exclude zero.
    """
    from scipy.optimize import linprog  # noqa: PLC0415 - slow to import

    columns = np.hstack([columns, drives.coupling.T])
    velocities = np.hstack([velocities, np.zeros((len(columns), len(drives.coupling) * bool(velocities.shape[1])))])
    count, rows = columns.shape[1], len(drives.moment)
    joints = len(columns)
    moving = velocities if velocities.shape[1] else np.zeros((joints, count))
    # unknowns: x, then the forces, then the controls
    balance = np.hstack([columns, -drives.moment.T, np.zeros((joints, rows))])
    coupled = np.flatnonzero(drives.gain != 0)
    law = np.hstack([drives.damping[:, None] * (drives.moment @ moving), np.eye(rows), -np.diag(drives.gain)])[coupled]
    torques = np.hstack([np.zeros((joints, count)), drives.moment.T, np.zeros((joints, rows))])
    speeds = np.hstack([moving, np.zeros((joints, 2 * rows))])
    limits = np.vstack([torques, -torques, speeds, -speeds])
    bounds = np.concatenate([drives.torques[:, 1], -drives.torques[:, 0], drives.speeds, drives.speeds])
    finite = np.isfinite(bounds)
    box = [(-_ENDLESS, _ENDLESS), *[(None, None)] * (count - 1)] + [
        (low if math.isfinite(low) else None, high if math.isfinite(high) else None)
        for low, high in (*zip(drives.lowest, drives.highest, strict=True), *drives.controls)
    ]
    ends = []

    def largest(sign: float, load: FloatArray) -> float:
        """Return the largest x[0] in one direction; -1 if the drives cannot bear the load."""
        cost = np.zeros(count + 2 * rows)
        cost[0] = -sign
        result = linprog(
            cost,
            A_ub=limits[finite] if finite.any() else None,
            b_ub=bounds[finite] if finite.any() else None,
            A_eq=np.vstack([balance, law]),
            b_eq=np.concatenate([-load, drives.constant[coupled]]),
            bounds=box,
            method="highs",
        )
        return float(sign * result.x[0]) if result.status == _OPTIMAL else -1.0

    for sign in (1.0, -1.0):
        end = largest(sign, drives.load)
        if end < 0:
            raise InvalidInputError(
                "actuators: the drives cannot hold the robot at rest in this posture against gravity and springs; "
                "choose another posture, or raise forcerange or ctrlrange of the actuators"
            )
        if friction is not None and friction.any():
            end = max(largest(sign, drives.load + sign * friction), 0.0)
        ends.append(end if end < _ENDLESS * (1 - 1e-6) else math.inf)
    return AxisLimits(*ends)
