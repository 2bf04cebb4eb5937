"""Record which bodies of a robot touch an object, how fast, and with which force."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray

from .dynamics import Drivetrain, actuator_moment
from .model import Data, Model, mujoco, names_of
from .obstruction import distance_to
from .result import BodyContact
from .site import SensorSite

_PATIENCE: Final = 0.1  # s: a force that has not grown for as long has passed its peak
_RESTING: Final = 0.01  # m/s: a robot that moves more slowly has come to rest on what it touches
_AT_SURFACE: Final = 2e-3  # m: a geom belongs to the surface of a site if the axis meets it this close to the site


@dataclass(frozen=True, slots=True)
class ContactPoint:
    """The force of one contact point.

    Args:
        geoms: the two geoms.
        bodies: their bodies.
        point: position of the contact in the world frame [m], shape (3,).
        normal: unit vector from the first geom to the second, shape (3,).
        force: contact force on the second geom in the world frame [N], shape (3,).
    """

    geoms: tuple[int, int]
    bodies: tuple[int, int]
    point: FloatArray
    normal: FloatArray
    force: FloatArray


def contact_points(model: Model, data: Data) -> list[ContactPoint]:
    """Return all contact points of a state that transmit a force."""
    library, wrench, result = mujoco(), np.zeros(6), []
    for number in range(data.ncon):
        contact = data.contact[number]
        library.mj_contactForce(model, data, number, wrench)
        if not wrench[:3].any():
            continue
        frame = np.array(contact.frame).reshape(3, 3)
        first, second = (int(geom) for geom in contact.geom)
        bodies = int(model.geom_bodyid[first]), int(model.geom_bodyid[second])
        result.append(ContactPoint((first, second), bodies, np.array(contact.pos), frame[0], frame.T @ wrench[:3]))
    return result


def approach_velocity(model: Model, data: Data, push: ContactPoint, velocity: FloatArray) -> float:
    """Return the normal relative velocity at a contact point [m/s], negative if both bodies approach.

    Args:
        model: the model.
        data: its state, for the positions.
        push: the contact.
        velocity: velocities of all joints before the contact, shape (nv,).
    """
    jacobians = np.zeros((2, 3, model.nv))
    for jacobian, body in zip(jacobians, push.bodies, strict=True):
        mujoco().mj_jac(model, data, jacobian, None, push.point, body)
    return float(push.normal @ ((jacobians[1] - jacobians[0]) @ velocity))


class SiteSurface:
    """The contact surface of a sensor site: the part of its body at which the distance is 0.

    It consists of the geoms that the axis meets at the site, and of the points of all other geoms of the same rigid
    body that are next to the site. Without any geom at the site, it is the whole body of the site.

    Args:
        model: the model.
        data: a state of it.
        site: the sensor.
        index: index of its site.
    """

    __slots__ = ("_body", "_direction", "_geoms", "_index", "_rigid")

    def __init__(self, model: Model, data: Data, site: SensorSite, index: int) -> None:
        self._index, self._direction = index, site.direction
        self._body = int(model.site_bodyid[index])
        weld, bodies = np.asarray(model.body_weldid), np.asarray(model.geom_bodyid)
        self._rigid = frozenset(np.flatnonzero(weld[bodies] == weld[self._body]).tolist())
        axis = np.array(data.site_xmat[index]).reshape(3, 3) @ site.direction
        ahead = np.array(data.site_xpos[index]) + _AT_SURFACE * axis
        met = {g for g in self._rigid if 0 <= distance_to(model, data, g, ahead, -axis) <= 2 * _AT_SURFACE}
        touchable = np.asarray(model.geom_contype).astype(bool) | np.asarray(model.geom_conaffinity).astype(bool)
        self._geoms = frozenset(g for g in met if touchable[g])
        if not self._geoms:
            self._geoms = frozenset(np.flatnonzero(bodies == self._body).tolist())

    def side(self, data: Data, push: ContactPoint) -> int | None:
        """Return which of the two geoms of a contact is the surface, 0 or 1; None if neither is."""
        for side, geom in enumerate(push.geoms):
            if geom in self._geoms:
                return side
            if geom in self._rigid:
                turn = np.array(data.site_xmat[self._index]).reshape(3, 3)
                ahead = (push.point - np.array(data.site_xpos[self._index])) @ (turn @ self._direction)
                if abs(float(ahead)) <= _AT_SURFACE:
                    return side
        return None


class Touches:
    """The contacts of all bodies of a robot with other bodies in one simulated run.

    What touches the robot at the start, such as the ground on which it stands, does not count, unless it touches the
    surface of a site.

    Args:
        model: the model.
        data: its state at the start, after `mj_forward`.
        drivetrains: the degrees of freedom of the robot.
        surfaces: the surface of each site.
        sites: the name of each site.
    """

    __slots__ = (
        *("_first", "_last", "_model", "_moving", "_own", "_records", "_sites", "_still", "_support", "_surfaces"),
        *("_floats", "_pair", "_returns", "_summit", "force", "peak"),
    )

    def __init__(
        self,
        model: Model,
        data: Data,
        drivetrains: Sequence[Drivetrain],
        surfaces: Sequence[SiteSurface],
        sites: Sequence[str],
    ) -> None:
        self._model, self._surfaces, self._sites = model, surfaces, sites
        carriers = [int(model.site_bodyid[d.site]) for d in drivetrains]
        self._moving, self._still, self._own = _robot_bodies(model, data, drivetrains, carriers)
        bodies = np.asarray(model.geom_bodyid)
        self._support = {frozenset(bodies[contact.geom].tolist()) for contact in data.contact}
        self._records: dict[tuple[int, int, str], list[float]] = {}
        self.force = self.peak = 0.0
        self._first = self._last = self._summit = math.nan
        self._floats = bool(len(drivetrains[0].root))
        self._returns = self._floats or bool(np.any(model.opt.gravity))
        self._pair = 0, 0, np.zeros(3)  # bodies and direction of the largest force of the last step with a contact

    def watch(self, data: Data, points: Sequence[ContactPoint], velocity: FloatArray, now: float) -> None:
        """Record the contacts of one time step.

        Args:
            data: the state.
            points: the contact points with a force.
            velocity: velocities of all joints before the step, shape (nv,).
            now: time at which the contacts began [s].
        """
        total: dict[tuple[int, int, str], FloatArray] = {}
        robot = np.zeros(3)
        for push in points:
            side = self._robot_side(push.bodies)
            if side is None:
                continue
            site = next(
                (
                    name
                    for name, surface in zip(self._sites, self._surfaces, strict=True)
                    if surface.side(data, push) == side
                ),
                "",
            )
            if not site and frozenset(push.bodies) in self._support:
                continue
            force = push.force if side == 1 else -push.force
            key = push.bodies[side], push.bodies[1 - side], site
            total[key] = total.get(key, np.zeros(3)) + force
            robot = robot + force
            if key not in self._records:
                self._records[key] = [now, approach_velocity(self._model, data, push, velocity), 0.0]
        for key, force in total.items():
            self._records[key][2] = max(self._records[key][2], float(np.linalg.norm(force)))
        self.force = float(np.linalg.norm(robot))
        if self.force > 0:
            body, other, _ = max(total, key=lambda key: float(np.linalg.norm(total[key])))
            self._pair = body, other, robot / self.force
            self._last = now
            self._first = now if math.isnan(self._first) else self._first
        if self.force > self.peak:
            self.peak, self._summit = self.force, now

    def has_passed_peak(self, data: Data, now: float, follow_time: float) -> bool:
        """Return True if the force on the robot has passed its largest value.

        Then it has not grown for 0.1 s, and not for as long as it took from the first contact to its peak, and a robot
        that moves as a whole no longer approaches what it touches. If nothing brings robot and object together again
        after they have parted, the follow time without contact is enough.

        Args:
            data: the state.
            now: the time [s].
            follow_time: time to continue after contacts [s].
        """
        if math.isnan(self._first):
            return True
        if not self._returns and self.force == 0 and now - self._last >= follow_time:
            return True
        if now - self._summit < max(_PATIENCE, self._summit - self._first):
            return False
        return not (self._floats and self._approach(data) > _RESTING)

    def _approach(self, data: Data) -> float:
        """Return the speed [m/s] at which the centers of mass of robot and object approach along the last force."""
        body, other, along = self._pair
        mujoco().mj_subtreeVel(self._model, data)
        roots = self._model.body_rootid
        moves = int(self._model.body_treeid[other]) >= 0
        own = np.array(data.subtree_linvel[roots[body]])
        met = np.array(data.subtree_linvel[roots[other]]) if moves else np.zeros(3)
        return float((met - own) @ along)

    def contacts(self) -> tuple[BodyContact, ...]:
        """Return the contacts in their order."""
        names = names_of(self._model, "body")
        return tuple(
            BodyContact(_label(names, body), _label(names, other), site, time, speed, peak)
            for (body, other, site), (time, speed, peak) in sorted(self._records.items(), key=lambda item: item[1][0])
        )

    def _robot_side(self, bodies: tuple[int, int]) -> int | None:
        """Return which of two bodies in contact is the robot's, 0 or 1; None if the robot touches nothing else."""
        own = [body in self._own for body in bodies]
        if own[0] != own[1]:
            return own.index(True)
        if all(own):  # a part that moves hits one that stays where it is
            for side in (0, 1):
                if bodies[side] in self._moving and bodies[1 - side] in self._still:
                    return side
        return None


def _robot_bodies(
    model: Model, data: Data, drivetrains: Sequence[Drivetrain], carriers: Sequence[int]
) -> tuple[frozenset[int], frozenset[int], frozenset[int]]:
    """Return the bodies of a robot: those that move, those that are fixed next to it, and all of them.

    All bodies under the same root belong to the robot, such as a palm that is fixed to the world, with fingers without
    a sensor. A body that other joints move, which no actuator drives, is an object.
    """
    trees, roots = np.asarray(model.body_treeid), np.asarray(model.body_rootid)
    drivetrain = drivetrains[0]
    degrees = np.concatenate([drivetrain.driven, drivetrain.base])
    robot_trees = set(np.asarray(model.dof_treeid)[degrees].tolist())
    moving = frozenset(np.flatnonzero(np.isin(trees, list(robot_trees))).tolist())
    ancestors = {body for carrier in carriers for body in _ancestors(model, carrier)}
    own_roots = {int(roots[carrier]) for carrier in carriers}
    driven_trees = robot_trees | set(np.asarray(model.dof_treeid)[actuator_moment(model, data).any(axis=0)].tolist())
    own = {
        body
        for body in range(1, model.nbody)
        if int(roots[body]) in own_roots and (trees[body] < 0 or int(trees[body]) in driven_trees)
    }
    still = frozenset(body for body in own if trees[body] < 0 and body not in ancestors)
    return moving, still, frozenset(own | moving | ancestors)


def _ancestors(model: Model, body: int) -> Iterator[int]:
    while body > 0:
        yield body
        body = int(model.body_parentid[body])


def _label(names: Sequence[str], body: int) -> Any:
    return names[body] or f"number {body}"
