"""Check that nothing covers a sensor and no object overlaps the robot."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution

from .model import Data, Model, mujoco, names_of
from .sight import FARTHEST, FLUSH, Sight
from .site import SensorSite

_TOLERANCE: Final = 1e-5  # m: a site on a surface may be below it by this much, because models have rounded numbers


def refuse_covered_sensor(model: Model, data: Data, site: SensorSite, index: int) -> None:
    """Raise an error if a sensor site is inside a solid body.

    The geometries of a body are taken as convex: a point is inside if the surface is found both ahead and behind it.

    Args:
        model: the model.
        data: its state after `mj_forward`.
        site: the sensor.
        index: index of its site.

    Raises:
        InvalidInputError: the site is inside a body.
    """
    point = np.array(data.site_xpos[index])
    axis = np.array(data.site_xmat[index]).reshape(3, 3) @ site.direction
    touchable = np.asarray(model.geom_contype).astype(bool) | np.asarray(model.geom_conaffinity).astype(bool)
    for geom in np.flatnonzero(touchable):
        depths = [distance_to(model, data, int(geom), point, sign * axis) for sign in (1.0, -1.0)]
        if min(depths) > _TOLERANCE:
            name = _name_of(model, int(geom))
            raise InvalidInputError(
                f"site {site.name!r}: the site is inside the geom {name}, so the sensor cannot see objects. Move the "
                f"site to the contact surface. The surface of the geom is {format_quantity(depths[0], 'm')} away",
                value=names_of(model, "geom")[int(geom)],
            )


def refuse_overlap(model: Model, data: Data, site: SensorSite, index: int, distance: float) -> None:
    """Raise an error if an object overlaps the robot.

    The robot is the one that carries the sensor. The world, such as the ground, may overlap bodies that carry no
    sensor.

    Args:
        model: the model.
        data: its state after `mj_forward`.
        site: the sensor.
        index: index of its site.
        distance: of the first object on the axis of the sensor [m], negative if it presses into the contact surface.

    Raises:
        InvalidInputError: an object overlaps the robot.
    """
    deepest, what, culprit = -distance, "an object", ""
    trees, carrier = np.asarray(model.body_treeid), int(model.site_bodyid[index])
    for contact in data.contact:
        bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom]
        for body, other, geom in zip(bodies, bodies[::-1], contact.geom[::-1], strict=True):
            foreign = trees[other] != trees[body] and (trees[other] >= 0 or body == carrier)
            if trees[body] == trees[carrier] and foreign and -contact.dist > deepest:
                deepest, what = -float(contact.dist), f"the geom {_name_of(model, int(geom))}"
                culprit = names_of(model, "geom")[int(geom)]
    if deepest > _TOLERANCE:
        raise InvalidInputError(
            f"data: at the start, {what} overlaps the robot by {format_quantity(deepest, 'm')}; move the object away "
            f"from the robot. This robot carries the site {site.name!r}",
            value=culprit,
        )


def _name_of(model: Model, geom: int) -> str:
    name = names_of(model, "geom")[geom]
    return repr(name) if name else f"number {geom}"


def beam_warnings(model: Model, data: Data, index: int, sight: Sight) -> Iterator[str]:
    """Yield a warning about each geom of the robot itself that is in the beam of a sensor.

    Rays pass the body of the site, and meet all other bodies of the robot.

    Args:
        model: the model.
        data: its state after `mj_forward`.
        index: index of the site.
        sight: its beam.
    """
    carrier, bodies = int(model.site_bodyid[index]), np.asarray(model.geom_bodyid)
    trees = np.asarray(model.body_treeid)
    start, rays = np.array(data.site_xpos[index]) + FLUSH * sight.axis(data), sight.rays(data)
    for geom in np.flatnonzero(trees[bodies] == trees[carrier]):
        hits = [distance_to(model, data, int(geom), start, ray) for ray in rays]
        near = min((hit for hit in hits if hit >= 0), default=FARTHEST) + FLUSH
        if near >= FARTHEST:
            continue
        seen = (
            "The simulated sensor does not see it, a real one may"
            if bodies[geom] == carrier
            else "The sensor takes it for an object"
        )
        yield caution(
            "PT507",
            f"The geom {_name_of(model, int(geom))} of the robot itself is in the beam of the sensor, "
            f"{format_quantity(near, 'm', 2)} ahead of the site: move the site, or choose another axis or a narrower "
            f"field of view. {seen}.",
        )


def distance_to(model: Model, data: Data, geom: int, point: FloatArray, direction: FloatArray) -> float:
    """Return the distance [m] along a ray to a geometry's surface. It is negative if the ray misses the surface."""
    library = mujoco()
    kinds, kind = library.mjtGeom, int(model.geom_type[geom])
    if kind in {int(kinds.mjGEOM_PLANE), int(kinds.mjGEOM_HFIELD)}:
        return -1.0  # ground has no inside that a ray can leave
    if kind == int(kinds.mjGEOM_MESH):
        return float(library.mj_rayMesh(model, data, geom, point, direction))
    where = data.geom_xpos[geom], data.geom_xmat[geom], model.geom_size[geom]
    return float(library.mju_rayGeom(*where, point, direction, kind))
