"""Find the bodies of a robot and the contact surfaces of its sensor sites."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import IntArray

from .dynamics import Drivetrain, robot_trees
from .geometry import distance_to
from .model import Data, Model
from .result import BodyContact
from .site import SensorSite

PATIENCE: Final = 0.1
"""A force that has not grown for as long has passed its peak [s]."""

RESTING: Final = 0.01
"""A robot that moves more slowly has come to rest on what it touches [m/s]."""

_AT_SURFACE: Final = 2e-3  # m: a geom belongs to the surface of a site if the axis meets it this close to the site
_SURFACE, _RIGID = 1, 2


def surface_geoms(model: Model, data: Data, site: SensorSite, index: int) -> NDArray[np.uint8]:
    """Return which geoms form the contact surface of a site: the part of its body at which the distance is 0.

    It consists of the geoms that the axis meets at the site, and of the points of all other geoms of the same rigid
    body that are next to the site. Without any geom at the site, it is the whole body of the site.

    Args:
        model: the model.
        data: a state of it.
        site: the sensor.
        index: index of its site.

    Returns:
        1 for a geom of the surface, 2 for another geom of the same rigid body, 0 for all others, shape (ngeom,).
    """
    body = int(model.site_bodyid[index])
    weld, bodies = np.asarray(model.body_weldid), np.asarray(model.geom_bodyid)
    rigid = weld[bodies] == weld[body]
    axis = np.array(data.site_xmat[index]).reshape(3, 3) @ site.direction
    ahead = np.array(data.site_xpos[index]) + _AT_SURFACE * axis
    touchable = np.asarray(model.geom_contype).astype(bool) | np.asarray(model.geom_conaffinity).astype(bool)
    kinds = np.where(rigid, _RIGID, 0).astype(np.uint8)
    for geom in np.flatnonzero(rigid & touchable):
        if 0 <= distance_to(model, data, int(geom), ahead, -axis) <= 2 * _AT_SURFACE:
            kinds[geom] = _SURFACE
    if not np.any(kinds == _SURFACE):
        kinds[bodies == body] = _SURFACE
    return kinds


@dataclass(frozen=True, slots=True)
class RobotBodies:
    """Which bodies belong to a robot, for compiled code.

    What touches the robot at the start, such as the ground on which it stands, does not count as a contact, unless it
    touches the surface of a site.

    Args:
        moving: 1 for bodies of the robot that move, shape (nbody,).
        still: 1 for bodies that are fixed next to it.
        own: 1 for all bodies of the robot.
        support: pairs of bodies that touch at the start, each as low * nbody + high.
        floats: whether the robot moves as a whole.
        returns: whether something can bring robot and object together again after they have parted.
    """

    moving: NDArray[np.uint8]
    still: NDArray[np.uint8]
    own: NDArray[np.uint8]
    support: IntArray
    floats: bool
    returns: bool

    @classmethod
    def of(cls, model: Model, data: Data, drivetrains: Sequence[Drivetrain]) -> RobotBodies:
        """Find the bodies of a robot.

        Args:
            model: the model.
            data: its state at the start, after `mj_forward`.
            drivetrains: the degrees of freedom of the robot.

        Returns:
            The bodies.
        """
        carriers = [int(model.site_bodyid[d.site]) for d in drivetrains]
        flags = []
        for bodies in _robot_bodies(model, data, drivetrains, carriers):
            flag = np.zeros(model.nbody, dtype=np.uint8)
            flag[list(bodies)] = 1
            flags.append(flag)
        geoms = np.array([contact.geom for contact in data.contact], dtype=np.int64).reshape(-1, 2)
        pairs = np.sort(np.asarray(model.geom_bodyid)[geoms], axis=1)
        support = np.unique(pairs[:, 0].astype(np.int64) * model.nbody + pairs[:, 1])
        floats = bool(len(drivetrains[0].root))
        return cls(flags[0], flags[1], flags[2], support, floats, floats or bool(np.any(model.opt.gravity)))


def body_contact(
    names: Sequence[str], pair: tuple[int, int], site: str, *, time: float, speed: float, peak: float
) -> BodyContact:
    """Return the contacts of a body of the robot with another body.

    Args:
        names: names of all bodies.
        pair: the body of the robot and the other one.
        site: the site at whose surface they are; empty for none.
        time: when they began [s].
        speed: normal relative velocity then [m/s].
        peak: largest force [N].
    """
    return BodyContact(_label(names, pair[0]), _label(names, pair[1]), site, time, speed, peak)


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
    own_trees = np.asarray(model.dof_treeid)[degrees]
    moving = frozenset(np.flatnonzero(np.isin(trees, own_trees)).tolist())
    ancestors = {body for carrier in carriers for body in _ancestors(model, carrier)}
    own_roots = {int(roots[carrier]) for carrier in carriers}
    driven_trees = robot_trees(model, data, drivetrain)
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
