"""Compute joint motions so that sensor sites follow their references."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

from .dynamics import (
    Drivetrain,
    PostureDynamics,
    RobotReducer,
    axis_motion,
    close_loops,
    dynamics_along,
    held_rows,
    least_energy,
    posture_dynamics,
    update_posture,
)
from .model import Data, Model, mujoco
from .path import check_posture, limited_followers, ranges_of
from .site import SensorSite

SPACING: Final = 1e-3
"""Distance between two anchors [m]: the joint motion per motion of the sites is computed again after as much."""

_MARGIN: Final = 1e-9  # rad or m: a joint counts as at the end of its range
_FAR: Final = 4096  # anchors on each side of the start that all runs share


class JointPath:
    """Conversion of site positions along sensor axes to joint positions.

    The axes are those of the start; they stay fixed relative to the base. The joints move with the least kinetic energy
    and hold the other directions. The reference stops where a joint would leave its range.

    Args:
        model: the model.
        data: its state at the start.
        drivetrains: the degrees of freedom, the same robot for all sites.
        sites: the sensors.
    """

    __slots__ = (
        *("_axes", "_drivetrains", "_first", "_followers", "_holds", "_model", "_passive", "_places", "_reducers"),
        "_scratch",
        *("direction", "ends", "inside", "joints", "motions", "points", "ranges", "start", "table", "turn"),
    )

    def __init__(
        self, model: Model, data: Data, drivetrains: Sequence[Drivetrain], sites: Sequence[SensorSite]
    ) -> None:
        self._model, self._drivetrains = model, drivetrains
        check_posture(model, data, drivetrains[0])
        self.ranges = np.ascontiguousarray(ranges_of(model, drivetrains[0]))
        self._followers, self.ends = limited_followers(model, drivetrains[0]), False
        self._places = np.asarray(model.jnt_qposadr)[drivetrains[0].joints]
        self._set_scratch(mujoco().MjData(model))
        self._scratch.qpos[:] = data.qpos
        self._passive = np.array(data.qpos)[self._followers.places]
        self._axes = [
            np.array(data.site_xmat[d.site]).reshape(3, 3) @ s.direction
            for d, s in zip(drivetrains, sites, strict=True)
        ]
        self.start = np.array(data.qpos)[self._places]
        self._holds = [""] * len(sites)
        parts = self._parts(self.start)
        for i, (part, site) in enumerate(zip(parts, sites, strict=True)):
            motion = axis_motion(part, site.hold)
            if motion is None:
                raise InvalidInputError(
                    f"site {site.name!r}: the joints cannot move the site along its axis {site.axis}"
                )
            self._holds[i] = motion.hold
        solution = self._solve(parts)
        while solution is None and any(hold != "axis" for hold in self._holds):  # sites that share joints hold less
            self._holds = ["position" if hold == "pose" else "axis" for hold in self._holds]
            solution = self._solve(parts)
        if solution is None:
            raise InvalidInputError(
                "laws: the sites cannot move independently of each other, because they share joints"
            )
        self._first = solution
        count, number = solution.shape
        self.joints, self.inside, self.motions = self.start.copy(), self.start.copy(), np.ascontiguousarray(solution)
        self.turn, self.direction, self.points = np.zeros((count, number)), np.zeros(number), np.zeros(number)
        # anchors of a single site, which all runs share, from -_FAR to _FAR: known, joints, motions, turn, direction,
        # point
        self.table = np.zeros((2 * _FAR + 1 if number == 1 else 0, 3 * count + 3))

    def _set_scratch(self, scratch: Data) -> None:
        """Set the state in which postures are computed."""
        self._scratch = scratch
        self._reducers = [RobotReducer(self._model, scratch, (d.base, d.driven), d.site) for d in self._drivetrains]

    def restart(self) -> None:
        """Return to the start. The points of the path that were already computed are kept."""
        self.joints[:] = self.inside[:] = self.start
        self.motions[:], self.turn[:] = self._first, 0.0
        self.points[:] = self.direction[:] = 0.0

    def fork(self) -> JointPath:
        """Return a path with the same start and separate memory, for another thread."""
        forked = copy.copy(self)
        for name in ("joints", "inside", "motions", "turn", "direction", "points", "table"):
            setattr(forked, name, np.array(getattr(self, name)))
        forked._set_scratch(copy.copy(self._scratch))
        return forked

    def adopt(self, other: JointPath) -> None:
        """Take over the anchors that a fork of this path has computed, so that they are not computed again."""
        new = (self.table[:, 0] == 0) & (other.table[:, 0] != 0)
        self.table[new] = other.table[new]

    @property
    def holds(self) -> tuple[str, ...]:
        """The `hold` option in use at each sensor site.

        Each value is "pose", "position" or "axis".
        """
        return tuple(self._holds)

    def velocity_of(self, velocities: FloatArray) -> FloatArray:
        """Return the joint velocities at the start for velocities of the sites [m/s], shape (n,)."""
        return np.asarray(self._first @ velocities)

    def motion_of(self, site: int) -> FloatArray:
        """Return the joint velocities per unit velocity of one site.

        They belong to the last anchor. The shape is (n,).
        """
        return self.motions[:, site].copy()

    def held(self, data: Data) -> FloatArray:
        """Return the Jacobian of the moved and fixed directions at all sites."""
        rows = []
        for drivetrain, axis, hold in zip(self._drivetrains, self._axes, self._holds, strict=True):
            turn = np.array(data.site_xmat[drivetrain.site]).reshape(3, 3)
            rows.append(held_rows(posture_dynamics(self._model, data, drivetrain, turn.T @ axis), hold))
        return np.vstack(rows)

    def extend(self, points: FloatArray) -> bool:
        """Add anchors until the last one is within 1 mm of the points that the sites have to reach.

        Compiled code computes the joint reference from the last anchor. Between two anchors on the path, it
        extrapolates the joint motion per motion of the sites linearly. The joint positions then have errors of the
        third order in the spacing of the anchors.

        Args:
            points: positions of the sites along their axes, relative to the start [m], shape (m,).

        Returns:
            False if a singularity, or the range of a joint that follows the others, prevents it. In the second case,
            `ends` is True.
        """
        step, self.ends = points - self.points, False
        if len(step) == 1:  # the path is a line, on which all runs have the same anchors
            for _ in range(int(abs(step[0]) / SPACING)):
                if not self._follow(math.copysign(SPACING, step[0]) * np.ones(1)):
                    return False
            return True
        pieces = int(np.ceil(np.linalg.norm(step) / SPACING))
        return all(self._follow(step / pieces) for _ in range(pieces))

    def _follow(self, part: FloatArray) -> bool:
        """Compute the next path point by the midpoint rule.

        Returns:
            False if a singularity or the range of a joint that follows prevents the next point.
        """
        row = round(float(self.points[0] + part[0]) / SPACING) + _FAR
        kept = 0 <= row < len(self.table)
        if not kept or not self.table[row, 0]:
            middle = self._solve(self._parts(self.joints + self.motions @ part / 2))
            end = self.joints + (self.motions if middle is None else middle) @ part
            after = self._solve(self._parts(end))
            if middle is None or after is None:
                return False  # a singularity: the joint motion of the last anchor remains
            if self._leaves_range():
                self.ends = True
                return False
            length = float(np.linalg.norm(part))
            anchor: tuple[FloatArray, ...] = (
                end,
                after,
                (after - self.motions) / length,
                part / length,
                self.points + part,
            )
            if kept:
                self.table[row] = np.concatenate([np.ones(1), *(array.ravel() for array in anchor)])
        else:
            count = len(self.joints)
            anchor = tuple(np.split(self.table[row, 1:], np.cumsum([count, count, count, 1])))
        for own, new in zip((self.joints, self.motions, self.turn, self.direction, self.points), anchor, strict=True):
            own[:] = new.reshape(own.shape)
        return True

    def _leaves_range(self) -> bool:
        """Return True if a joint without an actuator that follows the others has moved out of its range."""
        now = np.array(self._scratch.qpos)[self._followers.places]
        beyond = [
            np.maximum(self._followers.ranges[:, 0] - q, q - self._followers.ranges[:, 1]) for q in (now, self._passive)
        ]
        return bool(np.any(beyond[0] > np.maximum(beyond[1], 0.0) + _MARGIN))

    def _parts(self, joints: FloatArray) -> list[PostureDynamics]:
        self._scratch.qpos[self._places] = joints
        update_posture(self._model, self._scratch)
        close_loops(self._model, self._scratch, self._drivetrains[0])
        return [
            dynamics_along(self._model, self._scratch, drivetrain, axis, reducer)
            for drivetrain, axis, reducer in zip(self._drivetrains, self._axes, self._reducers, strict=True)
        ]

    def _solve(self, parts: Sequence[PostureDynamics]) -> FloatArray | None:
        rows = [held_rows(part, hold) for part, hold in zip(parts, self._holds, strict=True)]
        first = np.cumsum([0, *(len(block) for block in rows[:-1])])
        solution = least_energy(np.vstack(rows), tuple(map(int, first)), parts[0].inertia)
        return None if solution is None else solution[0]
