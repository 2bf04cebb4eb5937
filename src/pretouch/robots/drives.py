"""Compute a robot's largest acceleration, speed and force along an axis.

Linear programs yield these limits. The unknowns are the motion or force along the axis, the joint motion in the null
space of what the joints hold, and the forces and controls of the actuators.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value

from .dynamics import (
    AxisMotion,
    Drivetrain,
    PostureDynamics,
    Reduction,
    RobotReducer,
    actuator_moment,
    constraint_rows,
    free_motions,
    null_space,
)
from .model import Data, Model, joint_label, mujoco
from .stance import forces_of

_OPTIMAL: Final = 0  # status of linprog
_ENDLESS: Final = 1e6  # m/s^2 or N: no robot reaches as much, so that it counts as no limit
_PRICE: Final = 1e-9  # share of the largest price of a limit, below which it is rounding
_IMPORTANT: Final = 1e3  # weight of the torques that are missing at joints that move the site
_ROUNDING: Final = 1e-7  # of missing torques, relative to the largest one
_STILL: Final = 1e-9  # velocity relative to the fastest joint, below which a joint rests
_FASTEST: Final = 30.0  # m/s: likewise; models with torques but without speed limits allow hundreds of m/s


class HoldError(InvalidInputError):
    """Raised if the drives cannot hold a robot at rest."""


@dataclass(frozen=True, slots=True)
class AxisLimits(Value):
    """The largest acceleration, speed or force in both directions along an axis.

    Args:
        ahead: toward objects; infinite without a limit.
        back: away from objects; infinite without a limit.
        reasons: what limits both, such as "force range of elbow"; empty without a limit.
    """

    ahead: float
    back: float
    reasons: tuple[str, str] = ("", "")

    @property
    def least(self) -> float:
        """The smaller of the limits toward and away from objects."""
        return min(self.ahead, self.back)

    @property
    def reason(self) -> str:
        """What limits the smaller one of both directions."""
        return self.reasons[0 if self.ahead <= self.back else 1]

    def scaled(self, factor: float) -> AxisLimits:
        """Return the limits multiplied by a positive factor."""
        return AxisLimits(factor * self.ahead, factor * self.back, self.reasons)


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
        lags: times by which the force follows the control [s], shape (rows,); infinite for an unknown one.
        names: names of the actuators.
        joint_names: names of the driven joints.
        speed_names: names of the joints of base and driven joints.
        torques: smallest and largest torque of all actuators at each joint, shape (n, 2).
        load: generalized forces that hold the robot at rest against gravity and springs, shape (n + k,).
        friction: viscous damping of the joints, shape (n, n).
        speeds: largest speeds of base and joints, shape (m + n,). Those of the base limit what constraints move.
        reactions: generalized forces of the constraints and of the edges of the friction cones of the contacts on which
            the robot stands, shape (r, n + k). The drives need not apply them.
        pushes: whether each reaction can only push, as contacts do, shape (r,).
        tests: virtual velocities of base and joints whose power has to balance: one for each driven joint, which moves
            the base along, and k of the base that its contacts hold, shape (m + n, n + k).
        following: velocities of base and joints per velocity of the joints, as far as constraints cause them.
        dry_friction: friction loss of base and joints [N m or N], in the same order.
        servo: whether the force of an actuator falls with its position or velocity, shape (rows,).
    """

    moment: FloatArray
    lowest: FloatArray
    highest: FloatArray
    gain: FloatArray
    constant: FloatArray
    damping: FloatArray
    controls: FloatArray
    lags: FloatArray
    names: tuple[str, ...]
    joint_names: tuple[str, ...]
    speed_names: tuple[str, ...]
    torques: FloatArray
    load: FloatArray
    friction: FloatArray
    speeds: FloatArray
    reactions: FloatArray
    pushes: BoolArray
    tests: FloatArray
    following: FloatArray
    dry_friction: FloatArray
    servo: BoolArray

    @property
    def has_force_limits(self) -> bool:
        """Whether the model limits the force of every actuator."""
        by_control = (self.gain != 0) & np.isfinite(self.controls).all(axis=1)
        by_force = np.isfinite(self.lowest) & np.isfinite(self.highest)
        by_torque = np.isfinite(self.torques).all()
        return bool((by_control | by_force).all() or by_torque)

    @property
    def bare_servos(self) -> FloatArray:
        """Largest forces [N or N m] of servos that only their control limits, and 0 for all other actuators.

        A servo is an actuator whose force falls with its position or velocity. Its largest force is its gain times the
        range of its control from the present position.
        """
        ends = np.abs(self.gain[:, None] * self.controls + self.constant[:, None]).max(axis=1)
        endless = ~(np.isfinite(self.lowest) & np.isfinite(self.highest))
        joints = (self.moment != 0) @ (~np.isfinite(self.torques).all(axis=1)) > 0
        return np.where(self.servo & endless & joints & np.isfinite(ends), ends, 0.0)


def drives_of(model: Model, data: Data, drivetrain: Drivetrain, speeds: Mapping[str, float]) -> Drives:
    """Read a robot's actuator limits, and compute its joint load at rest.

    Args:
        model: the model.
        data: its state at rest, after `mj_forward`.
        drivetrain: its degrees of freedom.
        speeds: largest speeds of joints by name [rad/s or m/s], also of those that follow by constraints.

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
    muscles = (kinds == int(gains.mjGAIN_MUSCLE)) & (biases == int(bias_kinds.mjBIAS_MUSCLE))
    supported = (affine_gain | (kinds == int(gains.mjGAIN_FIXED))) & (
        affine_bias | (biases == int(bias_kinds.mjBIAS_NONE))
    )
    gain = np.where(supported, gain_of[:, 0] + np.where(affine_gain, gain_of[:, 1] * length, 0.0), 0.0)
    bias = np.where(affine_bias & supported, bias_of[:, 0] + bias_of[:, 1] * length, 0.0)
    for i in np.flatnonzero(muscles):  # at rest, the force is affine in the activation
        muscle = np.asarray(model.actuator_lengthrange)[rows[i]], float(model.actuator_acc0[rows[i]])
        gain[i] = library.mju_muscleGain(length[i], 0.0, *muscle, gain_of[i, :9])
        bias[i] = library.mju_muscleBias(length[i], *muscle, bias_of[i, :9])
    torque_limited = np.asarray(model.jnt_actfrclimited).astype(bool)[joints]
    torques = np.where(torque_limited[:, None], np.asarray(model.jnt_actfrcrange)[joints], (-math.inf, math.inf))
    every = np.concatenate([base, driven])
    robot = RobotReducer(model, data, (base, driven)).reduce(constraint_rows(model, data, drivetrain.footholds))
    mass, reduction = robot.mass, robot.reduction
    tests, reactions, pushes = _reactions(model, data, drivetrain, reduction)
    following = np.vstack([reduction.forced, np.eye(len(driven))])
    speed_names = tuple(joint_label(model, int(joint)) for joint in np.asarray(model.dof_jntid)[every])
    return Drives(
        moment=moment,
        lowest=forces[:, 0],
        highest=forces[:, 1],
        gain=gain,
        constant=bias,
        damping=np.where(affine_bias & supported, -bias_of[:, 2], 0.0),
        controls=np.where(muscles[:, None], (0.0, 1.0), _controls(model, rows, supported)),
        lags=_lags(model, rows),
        names=tuple(library.mj_id2name(model, library.mjtObj.mjOBJ_ACTUATOR, i) or f"number {i}" for i in rows),
        joint_names=tuple(joint_label(model, int(joint)) for joint in joints),
        servo=affine_bias & supported & (bias_of[:, 1:3] != 0).any(axis=1),
        torques=torques,
        load=tests.T @ _weight(mass, reduction, np.array(data.qfrc_bias - data.qfrc_passive)[every]),
        friction=tests.T @ (np.asarray(model.dof_damping)[every, None] * following),
        speed_names=speed_names,
        speeds=np.array([speeds.get(name, math.inf) for name in speed_names]),
        reactions=reactions,
        pushes=pushes,
        tests=tests,
        following=following,
        dry_friction=np.asarray(model.dof_frictionloss)[every],
    )


def _reactions(
    model: Model, data: Data, drivetrain: Drivetrain, reduction: Reduction
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return virtual velocities, the power of all constraint forces along them, and which forces can only push.

    Constraints can push and pull. Then their power along the joint motions suffices. Contacts only push, so that their
    forces have to balance what they hold of the base, too.
    """
    every, count = np.concatenate([drivetrain.base, drivetrain.driven]), len(drivetrain.base)
    joints = np.vstack([reduction.motion, np.eye(len(every) - count)])
    if not drivetrain.footholds:
        return joints, reduction.coupling, np.zeros(len(reduction.coupling), dtype=bool)
    loose = reduction.loose
    held = np.linalg.svd(loose, full_matrices=True)[0][:, loose.shape[1] :] if loose.size else np.eye(count)
    tests = np.hstack([joints, np.vstack([held, np.zeros((len(every) - count, held.shape[1]))])])
    free = constraint_rows(model, data)[:, every]
    edges = forces_of(model, data, drivetrain.footholds)[:, every]
    return tests, np.vstack([free, edges]) @ tests, np.arange(len(free) + len(edges)) >= len(free)


def _weight(mass: FloatArray, reduction: Reduction, force: FloatArray) -> FloatArray:
    """Return the force that holds a robot at rest, with its base as far as constraints and contacts hold it."""
    loose, count = reduction.loose, len(reduction.loose)
    if not loose.size:
        return force
    falling = loose @ np.linalg.solve(loose.T @ mass[:count, :count] @ loose, -loose.T @ force[:count])
    return np.asarray(force + mass[:, :count] @ falling)


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


def _lags(model: Model, rows: Any) -> FloatArray:
    """Return the time [s] by which the force of each actuator follows its control."""
    library = mujoco()
    kinds, parameters = np.asarray(model.actuator_dyntype)[rows], np.asarray(model.actuator_dynprm)[rows]
    limited = np.asarray(model.actuator_ctrllimited).astype(bool)[rows]
    most = np.abs(np.asarray(model.actuator_ctrlrange)[rows]).max(axis=1)
    widths = np.ptp(np.asarray(model.actuator_actrange)[rows], axis=1)
    lags = np.where(kinds == int(library.mjtDyn.mjDYN_NONE), 0.0, math.inf)
    for kind in (library.mjtDyn.mjDYN_FILTER, library.mjtDyn.mjDYN_FILTEREXACT):
        lags = np.where(kinds == int(kind), parameters[:, 0], lags)
    lags = np.where(kinds == int(library.mjtDyn.mjDYN_MUSCLE), parameters[:, :2].max(axis=1), lags)
    # an integrator crosses its range at the largest control; one without a range of its control is as fast as wanted
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.where(limited, widths / most, 0.0)
    return np.asarray(np.where(kinds == int(library.mjtDyn.mjDYN_INTEGRATOR), crossing, lags), dtype=np.float64)


def acceleration_limits(drives: Drives, dynamics: PostureDynamics, motion: AxisMotion) -> AxisLimits:
    """Return the largest accelerations of a sensor site along its axis [m/s^2].

    The site starts from rest, and accelerates relative to the robot's base. The torques are (inertia) q'' + load, with
    q'' along the axis plus any motion in the null space.
    """
    velocities = np.vstack([dynamics.reduction.motion, np.eye(len(motion.joints))]) @ np.column_stack(
        [motion.joints, free_motions(dynamics, motion)]
    )
    columns = drives.tests.T @ dynamics.mass @ velocities
    return _span(drives, columns, np.zeros((len(motion.joints), 0)), _friction_torques(drives, motion))


def _friction_torques(drives: Drives, motion: AxisMotion) -> FloatArray:
    """Return the torques [N m or N] that dry friction takes from the drives while a site moves ahead, shape (n,)."""
    velocities = drives.following @ motion.joints
    signs = np.sign(np.where(np.abs(velocities) > _STILL * np.abs(velocities).max(), velocities, 0.0))
    return np.asarray(drives.tests.T @ (drives.dry_friction * signs))


def speed_limits(drives: Drives, dynamics: PostureDynamics, motion: AxisMotion) -> AxisLimits:
    """Return the largest constant speeds of a sensor site along its axis.

    The speeds [m/s] are relative to the robot's base. The actuators overcome gravity and the damping of joints and
    actuators; torques that grow with the square of the speed are neglected. Without given joint speeds or damping that
    keeps the speed plausible, there is no limit.
    """
    velocities = np.column_stack([motion.joints, free_motions(dynamics, motion)])
    span = _span(drives, drives.friction @ velocities, velocities, _friction_torques(drives, motion))
    fast = [speed >= _FASTEST for speed in (span.ahead, span.back)]
    ahead, back = (math.inf if over else speed for over, speed in zip(fast, (span.ahead, span.back), strict=True))
    first, second = ("" if over else reason for over, reason in zip(fast, span.reasons, strict=True))
    return AxisLimits(ahead, back, (first, second))


def force_limits(drives: Drives, dynamics: PostureDynamics, motion: AxisMotion) -> AxisLimits:
    """Return the largest forces [N] with which a site at rest presses along its axis against what blocks it.

    The force accelerates what neither drives nor constraints hold away from the site, such as a floating base. The
    driven joints follow along the axis, so that the blocked site does not accelerate. Without such a part, no joint
    moves.
    """
    push, reduction, joints = dynamics.axis @ dynamics.full[:3], dynamics.reduction, len(motion.joints)
    following = np.vstack([reduction.motion, np.eye(joints)])
    undriven = null_space(np.vstack([drives.moment, drives.reactions[~drives.pushes, :joints]]))
    base = np.vstack([reduction.loose, np.zeros((joints, reduction.loose.shape[1]))])
    free = np.hstack([base, following @ undriven])
    accelerations = np.zeros(len(push))  # of base and joints, per force
    if free.size:
        accelerations = -free @ np.linalg.solve(free.T @ dynamics.mass @ free, free.T @ push)
        along = following @ motion.joints
        accelerations -= (push @ accelerations) / (push @ along) * along
    columns = drives.tests.T @ (push + dynamics.mass @ accelerations)
    return _span(drives, columns[:, None], np.zeros((joints, 0)))


def missing_torques(drives: Drives, matter: BoolArray) -> FloatArray:
    """Return the smallest generalized forces that are missing to hold a robot at rest.

    Args:
        drives: the drives.
        matter: whether each of these forces matters, shape (n + k,). Where there is a choice, others are missing.

    Returns:
        The forces [N m or N], first those of the driven joints, shape (n + k,).

    Raises:
        HoldError: no forces of the actuators are possible at all.
    """
    from scipy.optimize import linprog  # noqa: PLC0415 - slow to import

    (rows, joints), size, reactions = drives.moment.shape, len(drives.load), len(drives.reactions)
    # unknowns: the forces, the controls, the reactions, then what is missing upward and downward
    acting = np.vstack([drives.moment.T, np.zeros((size - joints, rows))])
    balance = np.hstack([acting, np.zeros((size, rows)), drives.reactions.T, np.eye(size), -np.eye(size)])
    coupled = np.flatnonzero(drives.gain != 0)
    law = np.hstack([np.eye(rows), -np.diag(drives.gain), np.zeros((rows, reactions + 2 * size))])[coupled]
    torques = np.hstack([drives.moment.T, np.zeros((joints, rows + reactions + 2 * size))])
    bounds = np.concatenate([drives.torques[:, 1], -drives.torques[:, 0]])
    finite = np.isfinite(bounds)
    weights = np.where(matter, _IMPORTANT, 1.0)
    result = linprog(
        np.concatenate([np.zeros(2 * rows + reactions), weights, weights]),
        A_ub=np.vstack([torques, -torques])[finite] if finite.any() else None,
        b_ub=bounds[finite] if finite.any() else None,
        A_eq=np.vstack([balance, law]),
        b_eq=np.concatenate([drives.load, drives.constant[coupled]]),
        bounds=[
            *zip(drives.lowest, drives.highest, strict=True),
            *drives.controls,
            *((0.0 if only_pushes else None, None) for only_pushes in drives.pushes),
            *[(0.0, None)] * (2 * size),
        ],
        method="highs",
    )
    if result.status != _OPTIMAL:
        raise HoldError(
            "actuators: the smallest and largest forces of the actuators contradict each other; correct forcerange and "
            "ctrlrange of the actuators"
        )
    missing = np.asarray(result.x[-2 * size : -size] - result.x[-size:])
    return np.where(np.abs(missing) > _ROUNDING * max(1.0, float(np.abs(drives.load).max())), missing, 0.0)


def _span(
    drives: Drives, columns: FloatArray, velocities: FloatArray, friction: FloatArray | None = None
) -> AxisLimits:
    """Return the largest acceleration, speed or force that the drives allow.

    This quantity is x[0]. Drives and reactions apply the generalized forces columns @ x + load.

    Args:
        drives: the drives.
        columns: generalized forces per variable, shape (n + k, v).
        velocities: joint velocities per variable if the variables are velocities, else without columns.
        friction: generalized forces of dry friction during motion ahead, shape (n + k,); None for none. The limit is 0
            if the drives cannot overcome it.

    Returns:
        The largest magnitudes of x[0] in both directions.

    Raises:
        HoldError: the limits exclude zero.
    """
    from scipy.optimize import linprog  # noqa: PLC0415 - slow to import

    own, (rows, joints) = columns.shape[1], drives.moment.shape
    columns = np.hstack([columns, -drives.reactions.T])
    velocities = np.hstack([velocities, np.zeros((joints, len(drives.reactions) * bool(velocities.shape[1])))])
    count, beyond = columns.shape[1], np.zeros((len(columns) - joints, rows))
    moving = velocities if velocities.shape[1] else np.zeros((joints, count))
    # unknowns: x, then the forces, then the controls
    balance = np.hstack([columns, np.vstack([-drives.moment.T, beyond]), np.zeros((len(columns), rows))])
    coupled = np.flatnonzero(drives.gain != 0)
    law = np.hstack([drives.damping[:, None] * (drives.moment @ moving), np.eye(rows), -np.diag(drives.gain)])[coupled]
    torques = np.hstack([np.zeros((joints, count)), drives.moment.T, np.zeros((joints, rows))])
    followed = drives.following @ moving
    speeds = np.hstack([followed, np.zeros((len(followed), 2 * rows))])
    limits = np.vstack([torques, -torques, speeds, -speeds])
    bounds = np.concatenate([drives.torques[:, 1], -drives.torques[:, 0], drives.speeds, drives.speeds])
    finite = np.isfinite(bounds)
    reactions = [(0, None) if only_pushes else (None, None) for only_pushes in drives.pushes]
    box = [(-_ENDLESS, _ENDLESS), *[(None, None)] * (own - 1), *reactions] + [
        (low if math.isfinite(low) else None, high if math.isfinite(high) else None)
        for low, high in (*zip(drives.lowest, drives.highest, strict=True), *drives.controls)
    ]
    ends, reasons = [], []

    def largest(sign: float, load: FloatArray) -> tuple[float, str]:
        """Return the largest x[0] in one direction, and what limits it; -1 if the drives cannot bear the load."""
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
        if result.status != _OPTIMAL:
            return -1.0, ""
        prices = result.ineqlin.marginals if finite.any() else np.zeros(0)
        return float(sign * result.x[0]), _limiting(drives, result, count, np.flatnonzero(finite), prices)

    for sign in (1.0, -1.0):
        end, reason = largest(sign, drives.load)
        if end < 0:
            raise HoldError(
                "actuators: the drives cannot hold the robot at rest in this posture against gravity and springs; "
                "choose another posture, or raise forcerange or ctrlrange of the actuators"
            )
        if friction is not None and friction.any():
            end, reason = largest(sign, drives.load + sign * friction)
            end, reason = (end, reason) if end > 0 else (0.0, "dry friction")
        endless = end >= _ENDLESS * (1 - 1e-6)
        ends.append(math.inf if endless else end)
        reasons.append("" if endless else reason)
    return AxisLimits(ends[0], ends[1], (reasons[0], reasons[1]))


def _limiting(drives: Drives, result: Any, count: int, bounds: IntArray, prices: FloatArray) -> str:
    """Name the limits that a linear program is at: those whose change would change its result."""
    rows, joints = drives.moment.shape
    price = np.abs(np.asarray(result.lower.marginals)) + np.abs(np.asarray(result.upper.marginals))
    least = _PRICE * max(float(price.max(initial=0.0)), float(np.abs(prices).max(initial=0.0)))
    ends = price > least
    forces, controls = ends[count : count + rows], ends[count + rows :]
    names = [f"force range of {drives.names[i]}" for i in np.flatnonzero(forces)]
    names += [f"control range of {drives.names[i]}" for i in np.flatnonzero(controls)]
    for bound in bounds[np.abs(prices) > least]:
        if bound < 2 * joints:
            names.append(f"torque range of {drives.joint_names[int(bound) % joints]}")
        else:
            names.append(f"speed of {drives.speed_names[int(bound - 2 * joints) % len(drives.speeds)]}")
    if ends[count - int(drives.pushes.sum()) : count].any():
        names.append("contacts that only push and rub")
    return ", ".join(dict.fromkeys(names))
