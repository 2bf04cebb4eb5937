"""Compute joint motions so that sensor sites follow their references."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

from .dynamics import (
    Drivetrain,
    PostureDynamics,
    axis_motion,
    close_loops,
    held_rows,
    least_energy,
    posture_dynamics,
    update_posture,
)
from .model import Data, Model, mujoco
from .path import check_posture, limited_followers, ranges_of
from .site import SensorSite

_SPACING: Final = 1e-3  # m: the joint motion per motion of the sites is computed again after as much
_MARGIN: Final = 1e-9  # rad or m: a joint counts as at the end of its range


@dataclass(frozen=True, slots=True)
class JointReference:
    """Reference position, velocity and acceleration of the driven joints at one moment.

    Args:
        position: q [rad or m], shape (n,).
        velocity: q', shape (n,).
        acceleration: q'', shape (n,).
        obstacle: what keeps the reference from following the sites, such as "joint range"; empty if nothing does.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    obstacle: str = ""


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
        *(
            "_anchors",
            "_axes",
            "_direction",
            "_first",
            "_drivetrains",
            "_ends",
            "_followers",
            "_holds",
            "_inside",
            "_joints",
            "_model",
            "_motions",
            "_passive",
            "_places",
        ),
        *("_points", "_ranges", "_scratch", "_turn", "start"),
    )

    def __init__(
        self, model: Model, data: Data, drivetrains: Sequence[Drivetrain], sites: Sequence[SensorSite]
    ) -> None:
        self._model, self._drivetrains = model, drivetrains
        check_posture(model, data, drivetrains[0])
        self._ranges, self._followers = ranges_of(model, drivetrains[0]), limited_followers(model, drivetrains[0])
        self._ends = False
        self._places = np.asarray(model.jnt_qposadr)[drivetrains[0].joints]
        self._scratch = mujoco().MjData(model)
        self._scratch.qpos[:] = data.qpos
        self._passive = np.array(data.qpos)[self._followers.places]
        self._axes = [
            np.array(data.site_xmat[d.site]).reshape(3, 3) @ s.direction
            for d, s in zip(drivetrains, sites, strict=True)
        ]
        self.start = self._joints = self._inside = np.array(data.qpos)[self._places]
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
        self._motions, self._points = solution, np.zeros(len(sites))
        self._turn, self._direction = np.zeros_like(solution), np.zeros(len(sites))
        self._first = solution
        self._anchors: dict[int | None, tuple[FloatArray, ...]] = {}
        if len(sites) == 1:
            self._anchors[0] = self._joints, solution, self._turn, self._direction, self._points

    def restart(self) -> JointPath:
        """Return the joint path, reset to its start.

        The points of the path that were already computed are kept.
        """
        self._joints, self._inside, self._ends = self.start, self.start, False
        self._motions, self._turn = self._first, np.zeros_like(self._first)
        self._points, self._direction = np.zeros(self._first.shape[1]), np.zeros(self._first.shape[1])
        return self

    @property
    def holds(self) -> tuple[str, ...]:
        """The `hold` option in use at each sensor site.

        Each value is "pose", "position" or "axis".
        """
        return tuple(self._holds)

    def motion_of(self, site: int) -> FloatArray:
        """Return the joint velocities per unit velocity of one site.

        They belong to the last computed path point. The shape is (n,).
        """
        motion: FloatArray = self._motions[:, site]
        return motion

    def held(self, data: Data) -> FloatArray:
        """Return the Jacobian of the moved and fixed directions at all sites."""
        rows = []
        for drivetrain, axis, hold in zip(self._drivetrains, self._axes, self._holds, strict=True):
            turn = np.array(data.site_xmat[drivetrain.site]).reshape(3, 3)
            rows.append(held_rows(posture_dynamics(self._model, data, drivetrain, turn.T @ axis), hold))
        return np.vstack(rows)

    def at(self, points: FloatArray, velocities: FloatArray, accelerations: FloatArray) -> JointReference:
        """Return the joint reference for given reference motions of the sites.

        Between two anchors on the path, the joint motion per motion of the sites is extrapolated linearly. The joint
        positions then have errors of the third order in the spacing of the anchors.

        Args:
            points: positions of the sites along their axes, relative to the start [m], shape (m,).
            velocities: their velocities [m/s], shape (m,).
            accelerations: their accelerations [m/s^2], shape (m,).

        Returns:
            The reference, at rest in the last possible position if a joint would leave its range.
        """
        step = points - self._points
        if float(step @ step) >= _SPACING**2:
            self._ends = False
            self._anchor(step)
            step = points - self._points
        along = float(step @ self._direction)
        motions = self._motions + along * self._turn
        position = self._joints + (self._motions + along / 2 * self._turn) @ step
        low, high = self._ranges.T
        if self._ends or np.any((position < low - _MARGIN) | (position > high + _MARGIN)):
            return JointReference(self._inside, np.zeros(len(position)), np.zeros(len(position)), "joint range")
        self._inside = position
        turning = float(velocities @ self._direction) * self._turn
        obstacle = "singularity" if float(step @ step) >= (2 * _SPACING) ** 2 else ""  # the path has no further anchors
        return JointReference(position, motions @ velocities, motions @ accelerations + turning @ velocities, obstacle)

    def _anchor(self, step: FloatArray) -> None:
        """Extend the joint path until the sites have moved by a given step. The steps are at most 1 mm long."""
        if len(step) == 1:  # the path is a line, on which all runs have the same anchors
            for _ in range(int(abs(step[0]) / _SPACING)):
                if not self._follow(math.copysign(_SPACING, step[0]) * np.ones(1)):
                    return
            return
        pieces = int(np.ceil(np.linalg.norm(step) / _SPACING))
        for _ in range(pieces):
            if not self._follow(step / pieces):
                return

    def _follow(self, part: FloatArray) -> bool:
        """Compute the next path point by the midpoint rule.

        Returns:
            False if a singularity prevents the next point.
        """
        key = round(float(self._points[0] + part[0]) / _SPACING) if len(part) == 1 else None
        anchor = self._anchors.get(key)
        if anchor is None:
            middle = self._solve(self._parts(self._joints + self._motions @ part / 2))
            end = self._joints + (self._motions if middle is None else middle) @ part
            after = self._solve(self._parts(end))
            if middle is None or after is None:
                return False  # a singularity: the joint motion of the last anchor remains
            if self._leaves_range():
                self._ends = True
                return False
            length = float(np.linalg.norm(part))
            anchor = end, after, (after - self._motions) / length, part / length, self._points + part
            if key is not None:
                self._anchors[key] = anchor
        self._joints, self._motions, self._turn, self._direction, self._points = anchor
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
        parts = []
        for drivetrain, axis in zip(self._drivetrains, self._axes, strict=True):
            turn = np.array(self._scratch.site_xmat[drivetrain.site]).reshape(3, 3)
            parts.append(posture_dynamics(self._model, self._scratch, drivetrain, turn.T @ axis))
        return parts

    def _solve(self, parts: Sequence[PostureDynamics]) -> FloatArray | None:
        rows = [held_rows(part, hold) for part, hold in zip(parts, self._holds, strict=True)]
        first = np.cumsum([0, *(len(block) for block in rows[:-1])])
        solution = least_energy(np.vstack(rows), tuple(map(int, first)), parts[0].inertia)
        return None if solution is None else solution[0]
