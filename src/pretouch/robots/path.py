"""Find how far joint ranges let a sensor move along its axis."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value

from .dynamics import (
    AxisMotion,
    Drivetrain,
    PostureDynamics,
    RobotReducer,
    axis_motion,
    close_loops,
    dynamics_along,
    update_posture,
)
from .model import (
    Data,
    Model,
    describe_position,
    is_scalar_joint,
    joint_label,
    mujoco,
    range_of,
    unit_of_joint,
)

SINGULAR: Final = 0.02
"""Conditioning below which a path ends: there, the joints move fifty times as much as in the best direction."""

_BECOMES_SINGULAR: Final = "the posture becomes singular"
_IS_SINGULAR: Final = "the posture is singular"
_SINGULAR_REASONS: Final = _BECOMES_SINGULAR, _IS_SINGULAR
_TOLERANCE: Final = 1e-9  # of the joint positions along a path [rad or m]
_ACCURACY: Final = 1e-6  # of the integration of a path, so that its length is right to 10 micrometers
_SHORTEST: Final = 1e-6  # m: shorter paths are rounding of the joint positions
_STEP: Final = 0.05  # longest step, as a share of the size of the robot
_STILL: Final = 1e-9  # of the velocity of a joint: rounding
_REACH: Final = 2.0  # longest path, in sizes of the robot, as far as hinges move it


@dataclass(frozen=True, slots=True)
class Excursion(Value):
    """The longest path of a sensor site along its axis.

    The path leads in one of the two directions.

    Args:
        length: the distance [m].
        reason: what ends the path, such as the range of a joint.
        joints: positions of the driven joints at the end [rad or m], shape (n,).
        passive: joints without an actuator that recoil, if the end of their range ends the path.
        own: motion [m] of the site itself along the path; the recoil of the robot takes the rest.
    """

    length: float
    reason: str
    joints: FloatArray
    passive: tuple[str, ...] = ()
    own: float = math.inf

    @property
    def is_singular(self) -> bool:
        """Whether no joint range, but a singular posture ends the path."""
        return self.reason in _SINGULAR_REASONS

    def of_site(self, share: float) -> Excursion:
        """Return the path with the length that the site itself moves.

        A prediction assumes the share at the start on the whole path. Where the share falls, the motion ends earlier.

        Args:
            share: motion of the site itself per motion relative to the base at the start; 1 without a recoil.
        """
        return self if share == 1.0 else replace(self, length=min(share * self.length, self.own))


def excursion(
    model: Model,
    data: Data,
    drivetrain: Drivetrain,
    direction: FloatArray,
    *,
    hold: str,
    ahead: bool,
    enough: float = math.inf,
) -> Excursion:
    """Find the longest path of a sensor site along its axis.

    The path ends where the joint ranges allow no further motion. The path starts in the posture of `data` and is a
    solution of q' = (joint motion along the axis), with the least kinetic energy. A joint that reaches the end of its
    range stays there, and the others continue if they can. Every point of the path is inside the ranges, also those of
    joints without an actuator that constraints move with the others. A passive joint recoils along the path, which ends
    at the end of its range. Collisions of the robot with itself or its
    surroundings are not considered.

    Args:
        model: the model.
        data: its state, which is not changed.
        drivetrain: the degrees of freedom.
        direction: axis of the sensor in the frame of the site.
        hold: what the joints hold: pose, position or axis.
        ahead: whether the site moves toward objects; otherwise it retreats.
        enough: length [m] at which the path may end, because it does not matter how much longer it is.

    Returns:
        The length of the path, relative to the base of the robot, and what ends it.
    """
    check_posture(model, data, drivetrain)
    ranges, followers = ranges_of(model, drivetrain), limited_followers(model, drivetrain)
    scratch = mujoco().MjData(model)
    scratch.qpos[:] = data.qpos
    places = np.asarray(model.jnt_qposadr)[drivetrain.joints]
    u = np.array(data.site_xmat[drivetrain.site]).reshape(3, 3) @ direction
    reducer = RobotReducer(model, scratch, (drivetrain.base, drivetrain.driven), drivetrain.site)
    path = _Path(model, scratch, drivetrain, reducer, places, u if ahead else -u, ranges, hold, followers)
    path = replace(path, recoiling=_recoiling(model, drivetrain, path.dynamics_at(np.array(data.qpos)[places])))
    places = np.concatenate([places, path.recoiling.places])
    if model.neq:  # a loop at its dead center is as heavy in every direction
        start = path.moved_mass(np.array(data.qpos)[places])
        path = replace(path, heaviest=start / SINGULAR**2)
    reference = path.follow(np.array(data.qpos)[places], enough)
    return reference if reference.length > _SHORTEST else replace(reference, length=0.0)


def ranges_of(model: Model, drivetrain: Drivetrain) -> FloatArray:
    """Return the ranges of all driven joints [rad or m].

    The shape is (n, 2).
    """
    return np.array([range_of(model, int(joint)) for joint in drivetrain.joints])


def _travel(model: Model, drivetrain: Drivetrain) -> tuple[float, int]:
    """Return how far all driven slides with a range can move a site [m], and the number of driven hinges."""
    slides = [int(joint) for joint in drivetrain.joints if unit_of_joint(model, int(joint)) == "m"]
    ranges = (range_of(model, joint) for joint in slides if model.jnt_limited[joint])
    return math.fsum(high - low for low, high in ranges), len(drivetrain.joints) - len(slides)


@dataclass(frozen=True, slots=True)
class Followers:
    """The joints with a range that no actuator moves.

    Args:
        joints: their indices.
        places: where their positions are in the configuration.
        degrees: their place among the degrees of freedom of the base.
        ranges: their ranges [rad or m], shape (n, 2).
    """

    joints: IntArray
    places: IntArray
    degrees: IntArray
    ranges: FloatArray


def limited_followers(model: Model, drivetrain: Drivetrain) -> Followers:
    """Return the joints of the base that have a range."""
    of_degree = np.asarray(model.dof_jntid)[drivetrain.base]
    degrees = np.flatnonzero(np.asarray(model.jnt_limited)[of_degree] & np.isin(of_degree, _scalar_joints(model)))
    joints = of_degree[degrees].astype(np.int64)
    ranges = np.asarray(model.jnt_range, dtype=np.float64)[joints].reshape(-1, 2)
    return Followers(joints, np.asarray(model.jnt_qposadr)[joints].astype(np.int64), degrees, ranges)


def _recoiling(model: Model, drivetrain: Drivetrain, dynamics: PostureDynamics) -> Followers:
    """Return the passive joints of the base that recoil along a path, with a range or without one."""
    of_degree = np.asarray(model.dof_jntid)[drivetrain.base]
    loose = np.abs(dynamics.reduction.loose).max(axis=1, initial=0.0) > _STILL
    degrees = np.flatnonzero(loose & np.isin(of_degree, _scalar_joints(model)))
    joints = of_degree[degrees].astype(np.int64)
    ranges = np.array([range_of(model, int(joint)) for joint in joints]).reshape(-1, 2)
    return Followers(joints, np.asarray(model.jnt_qposadr)[joints].astype(np.int64), degrees, ranges)


_NONE: Final = Followers(*(np.zeros(0, dtype=np.int64),) * 3, np.zeros((0, 2)))


def _scalar_joints(model: Model) -> list[int]:
    return [joint for joint in range(model.njnt) if is_scalar_joint(model, joint)]


def check_posture(model: Model, data: Data, drivetrain: Drivetrain) -> None:
    """Raise an error if a driven joint is outside its range."""
    values = np.array(data.qpos)[np.asarray(model.jnt_qposadr)[drivetrain.joints]]
    for joint, value, (low, high) in zip(drivetrain.joints, values, ranges_of(model, drivetrain), strict=True):
        if not low - _TOLERANCE <= value <= high + _TOLERANCE:
            unit = unit_of_joint(model, int(joint))
            found, least, most = (describe_position(v, unit) for v in (value, low, high))
            raise InvalidInputError(
                f"posture {joint_label(model, int(joint))}: found {found}, expected a joint position within the range "
                f"of this joint, from {least} to {most}",
                value=float(value),
                limit=(float(low), float(high)),
            )


@dataclass(frozen=True, slots=True)
class _Path:
    """A path of a sensor site along a fixed direction in space.

    Joints are locked by their number: driven joints first, then the followers with a range. Arrays called `joints` have
    the positions of the driven joints, then those of the passive joints that recoil.
    """

    model: Model
    data: Data
    drivetrain: Drivetrain
    reducer: RobotReducer
    places: Any
    direction: FloatArray
    ranges: FloatArray
    hold: str
    followers: Followers
    recoiling: Followers = _NONE
    heaviest: float = math.inf
    last: dict[bytes, PostureDynamics] = field(default_factory=dict)

    def moved_mass(self, joints: FloatArray) -> float:
        """Return the mass that the drives move along the path [kg]; infinite if they cannot."""
        motion = self._motion(joints, ())
        return math.inf if motion is None else float(motion.moved_mass)

    def dynamics_at(self, joints: FloatArray) -> PostureDynamics:
        """Return the dynamics of the robot at a point of the path. Its arrays change with the next one."""
        return self._posture(joints)

    def follow(self, joints: FloatArray, enough: float) -> Excursion:
        """Integrate the path from one joint limit to the next."""
        from scipy.integrate import solve_ivp  # noqa: PLC0415 - slow to import

        own, count, limits = 0.0, len(self.ranges), np.vstack([self.ranges, self.recoiling.ranges]).T
        size, length, locked = float(self.model.stat.extent), 0.0, self._blocked(joints, ())
        travel, hinges = _travel(self.model, self.drivetrain)
        farthest, longest = min(_REACH * size + travel, enough), _STEP * (size if hinges else size + travel)
        while True:
            if locked is None or self._motion(joints, locked) is None:
                return Excursion(length, self._reason(joints), joints[:count], own=own)
            ends = self._recoil_ends(joints, locked)
            if ends.any():
                passive = tuple(joint_label(self.model, int(joint)) for joint in self.recoiling.joints[ends])
                return Excursion(length, f"end of the range of {', '.join(passive)}", joints[:count], passive, own)
            solution = solve_ivp(
                lambda _, q, locked=locked: self._rates(q, locked),
                (length, farthest),
                joints,
                rtol=_ACCURACY,
                atol=_ACCURACY,
                max_step=longest,
                events=(
                    self._event(lambda q, locked=locked: self._slack(q, locked)),
                    self._event(lambda q, locked=locked: self._conditioning(q, locked) - SINGULAR),
                ),
            )
            own += self._own_motion(solution, locked)
            length, joints = float(solution.t[-1]), np.clip(solution.y[:, -1], *limits)
            if solution.status != 1:
                return Excursion(length, "longer than the robot can reach", joints[:count], own=own)
            if len(solution.t_events[1]):
                return Excursion(length, _BECOMES_SINGULAR, joints[:count], own=own)
            locked = self._blocked(joints, locked)

    def _posture(self, joints: FloatArray) -> PostureDynamics:
        """Return the dynamics of the robot in a posture, with its base as constraints and contacts place it."""
        key = joints.tobytes()
        if key not in self.last:  # rates and events ask for the same posture
            self.last.clear()
            self.last[key] = self._dynamics(joints)
        return self.last[key]

    def _dynamics(self, joints: FloatArray) -> PostureDynamics:
        self.data.qpos[self.places] = joints[: len(self.ranges)]
        self.data.qpos[self.recoiling.places] = joints[len(self.ranges) :]
        update_posture(self.model, self.data)
        close_loops(self.model, self.data, self.drivetrain)
        return dynamics_along(self.model, self.data, self.drivetrain, self.direction, self.reducer)

    def _motion(self, joints: FloatArray, locked: tuple[int, ...]) -> AxisMotion | None:
        """Return the joint motion along the path; None if none exists or the posture is singular."""
        return self._motion_in(self._posture(joints), locked)

    def _motion_in(self, dynamics: PostureDynamics, locked: tuple[int, ...]) -> AxisMotion | None:
        count = len(dynamics.inertia)
        if not any(i >= count for i in locked):
            motion = axis_motion(dynamics, self.hold, locked)
            return None if motion is None or self._share(motion) <= SINGULAR else motion
        still = self._following(dynamics)[[i - count for i in locked if i >= count]]
        reduction = replace(dynamics.reduction, coupling=np.vstack([dynamics.reduction.coupling, still]))
        motion = axis_motion(replace(dynamics, reduction=reduction), self.hold, [i for i in locked if i < count])
        return None if motion is None or self._share(motion) <= SINGULAR else motion

    def _following(self, dynamics: PostureDynamics) -> FloatArray:
        """Return the velocities of the followers per velocity of the driven joints, shape (k, n)."""
        rows = dynamics.reduction.forced[self.followers.degrees]
        return np.where(np.abs(rows) > _STILL, rows, 0.0)

    def _positions(self, joints: FloatArray) -> FloatArray:
        """Return the positions of driven joints and followers in the last posture."""
        return np.concatenate([joints[: len(self.ranges)], np.array(self.data.qpos)[self.followers.places]])

    def _rates(self, joints: FloatArray, locked: tuple[int, ...]) -> FloatArray:
        motion = self._motion(joints, locked)
        if motion is None:
            return np.zeros(len(joints))
        return np.concatenate([motion.joints, self._recoil(self._posture(joints)) @ motion.joints])

    def _own_motion(self, solution: Any, locked: tuple[int, ...]) -> float:
        """Return how far the site itself moves along a part of the path [m]."""
        if not self._posture(solution.y[:, -1]).reduction.loose.size:
            return float(np.ptp(solution.t))
        motions = [self._motion(joints, locked) for joints in np.ascontiguousarray(solution.y.T)]
        shares = [0.0 if motion is None else 1 - motion.recoil_share for motion in motions]
        return float(np.trapezoid(shares, solution.t))

    def _recoil(self, dynamics: PostureDynamics) -> FloatArray:
        """Return the velocities of the passive joints that recoil per velocity of the driven joints, shape (k, n)."""
        rows = dynamics.reduction.motion[self.recoiling.degrees]
        return np.where(np.abs(rows) > _STILL, rows, 0.0)

    def _recoil_ends(self, joints: FloatArray, locked: tuple[int, ...]) -> BoolArray:
        """Return which of the passive joints that recoil are at the end of their range and would leave it."""
        rates, (low, high) = self._rates(joints, locked)[len(self.ranges) :], self.recoiling.ranges.T
        positions = joints[len(self.ranges) :]
        return np.asarray(
            ((positions <= low + 2 * _TOLERANCE) & (rates < -_STILL))
            | ((positions >= high - 2 * _TOLERANCE) & (rates > _STILL))
        )

    def _conditioning(self, joints: FloatArray, locked: tuple[int, ...]) -> float:
        motion = self._motion(joints, locked)
        return 0.0 if motion is None else self._share(motion)

    def _share(self, motion: AxisMotion) -> float:
        """Return the conditioning of a motion.

        It also falls where a loop becomes singular, and where the recoil of the robot takes back the whole motion.
        """
        loop = SINGULAR * math.sqrt(self.heaviest / motion.moved_mass)
        return min(float(motion.conditioning), loop, 1 - float(motion.recoil_share))

    def _slack(self, joints: FloatArray, locked: tuple[int, ...]) -> float:
        """Return the smallest distance [rad or m] to a joint limit. Only moving joints count."""
        moves = self._moving(self._posture(joints))
        moves[list(locked)] = False
        q = np.concatenate([self._positions(joints)[moves], joints[len(self.ranges) :]])
        low, high = np.vstack([self._every_range[moves], self.recoiling.ranges]).T
        return float(np.minimum(q - low, high - q).min(initial=math.inf) + _TOLERANCE)

    def _blocked(self, joints: FloatArray, locked: tuple[int, ...]) -> tuple[int, ...] | None:
        """Find the joints that would leave their ranges along the path."""
        dynamics, (low, high) = self._posture(joints), self._every_range.T
        positions = self._positions(joints)
        while True:
            motion = self._motion_in(dynamics, locked)
            if motion is None:
                return locked if len(locked) < len(positions) else None
            rates = np.concatenate([motion.joints, self._following(dynamics) @ motion.joints])
            out = ((positions <= low + 2 * _TOLERANCE) & (rates < -_STILL)) | (
                (positions >= high - 2 * _TOLERANCE) & (rates > _STILL)
            )
            new = tuple(int(i) for i in np.flatnonzero(out) if i not in locked)
            if not new:
                return locked
            locked = (*locked, *new)

    @property
    def _every_range(self) -> FloatArray:
        return np.vstack([self.ranges, self.followers.ranges])

    def _moving(self, dynamics: PostureDynamics) -> BoolArray:
        """Return which of driven joints and followers move; passive joints that follow nothing do not."""
        return np.concatenate([np.ones(len(self.ranges), dtype=bool), self._following(dynamics).any(axis=1)])

    def _reason(self, joints: FloatArray) -> str:
        """Describe why the path ends."""
        moves, (low, high) = self._moving(self._posture(joints)), self._every_range.T
        positions = self._positions(joints)
        ends = (positions <= low + 2 * _TOLERANCE) | (positions >= high - 2 * _TOLERANCE)
        numbers = np.concatenate([self.drivetrain.joints, self.followers.joints])
        names = [joint_label(self.model, int(joint)) for joint in numbers[ends & moves]]
        return f"end of the range of {', '.join(names)}" if names else _IS_SINGULAR

    @staticmethod
    def _event(function: Any) -> Any:
        """Make an event that ends the integration at a zero crossing."""

        def event(_: float, joints: FloatArray) -> float:
            return float(function(joints))

        event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        return event
