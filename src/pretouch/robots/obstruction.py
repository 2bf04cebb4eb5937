"""Check that nothing covers a sensor and no object overlaps the robot."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution

from .dynamics import drivetrain_of, robot_trees
from .geometry import TOLERANCE, covering, distance_to, geom_label, move_site, way_out
from .model import Data, Model, mujoco, names_of, site_index
from .sight import FARTHEST, FLUSH, Sight
from .site import SensorSite


def take_to_surface(model: Model, data: Data, sites: Sequence[SensorSite]) -> tuple[Model, Data, tuple[str, ...]]:
    """Take sensor sites that are inside bodies of their robots to the surface along their axes.

    Args:
        model: the model, which is not changed.
        data: its state after `mj_kinematics`.
        sites: the sensors.

    Returns:
        Model and state with the sites at the surface, and a warning for each site that was moved. Without any, model
        and state are the given ones.
    """
    warnings: list[str] = []
    moved = model
    for site in sites:
        index = site_index(model, site.name)
        axis = np.array(data.site_xmat[index]).reshape(3, 3) @ site.direction
        distance, shapes = way_out(model, data, index, axis)
        if not distance:
            continue
        moved = copy.copy(model) if moved is model else moved
        move_site(moved, index, distance * site.direction)
        around = ", ".join(geom_label(model, int(geom)) for geom in shapes)
        warnings.append(
            caution(
                "PT544",
                f"The site {site.name} is inside the geom{'s' if len(shapes) > 1 else ''} {around}, so pretouch takes "
                f"it to the surface, {format_quantity(distance, 'm', 3)} along its axis: check that the sensor looks "
                "out there. The reflected mass is the same on the whole axis.",
            )
        )
    if moved is model:
        return model, data, ()
    state = mujoco().MjData(moved)
    state.qpos[:], state.qvel[:] = data.qpos, data.qvel
    mujoco().mj_forward(moved, state)
    return moved, state, tuple(warnings)


def covering_object(model: Model, data: Data, site: SensorSite, index: int) -> str:
    """Return the label of a geometry that contains a sensor site; empty if there is none."""
    point = np.array(data.site_xpos[index])
    axis = np.array(data.site_xmat[index]).reshape(3, 3) @ site.direction
    around = covering(model, data, point, axis)
    return geom_label(model, int(around[0])) if len(around) else ""


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
    label = covering_object(model, data, site, index)
    if label:
        raise InvalidInputError(
            f"site {site.name!r}: in this posture, the site is inside the geom {label}, so the sensor cannot see "
            "objects. Choose another posture, or move the geom",
            value=label.strip("'"),
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
                deepest, what = -float(contact.dist), f"the geom {geom_label(model, int(geom))}"
                culprit = names_of(model, "geom")[int(geom)]
    if deepest > TOLERANCE:
        raise InvalidInputError(
            f"data: at the start, {what} overlaps the robot by {format_quantity(deepest, 'm')}; move the object away "
            f"from the robot. This robot carries the site {site.name!r}",
            value=culprit,
        )


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
    trees, own = np.asarray(model.body_treeid), robot_trees(model, data, drivetrain_of(model, data, index))
    start, rays = np.array(data.site_xpos[index]) + FLUSH * sight.axis(data), sight.rays(data)
    for geom in np.flatnonzero((trees[bodies] == trees[carrier]) | np.isin(trees[bodies], list(own))):
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
            "PT547",
            f"The geom {geom_label(model, int(geom))} of the robot itself is in the beam of the sensor, "
            f"{format_quantity(near, 'm', 2)} ahead of the site: move the site, or choose another axis or a narrower "
            f"field of view. {seen}.",
        )
