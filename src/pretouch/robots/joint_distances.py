"""Compute object distances ahead of a sensor from recorded joint positions.

The computation needs a model of the robot and of the object.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch.sensors import InversePower

from .model import Model, describe_position, is_scalar_joint, make_data, mujoco, names_of, site_index, unit_of_joint
from .obstruction import refuse_covered_sensor, take_to_surface
from .sight import Sight
from .site import SensorSite

_TOLERANCE: Final = 0.02  # share of its range by which a recorded position may lie outside of the range of its joint

_ANY_CURVE: Final = InversePower(scale=1.0, distance_offset=1.0, exponent=1.0)  # a distance on the axis needs no curve


def distances_ahead(model: Model, site: SensorSite, joints: Mapping[str, FloatArray]) -> FloatArray:
    """Return the distances ahead of a sensor for recorded joint positions.

    Each distance is measured along the axis of the sensor to the first object.

    Args:
        model: the model of the robot and of the object, which is fixed to the world.
        site: the sensor; its curve is not used.
        joints: positions of joints by name [rad or m], each of shape (n,). Joints that do not move the sensor may be
            missing; names that the model does not have are ignored.

    Returns:
        Distances [m], shape (n,): infinite without an object on the axis, NaN where a position is NaN.

    Raises:
        InvalidInputError: a joint that moves the sensor is missing, is not a hinge or a slide, or leaves its range;
            or no posture has an object on the axis.
    """
    index = site_index(model, site.name)
    model, data, _ = take_to_surface(model, make_data(model), [site])
    moving = _joints_between(model, index)
    columns = np.column_stack([_column(model, joint, joints) for joint in moving])
    places = np.asarray(model.jnt_qposadr)[moving]
    sight = Sight(model, site, index, _ANY_CURVE, math.inf)
    distances = np.full(len(columns), np.nan)
    for i in np.flatnonzero(np.isfinite(columns).all(axis=1)):
        data.qpos[places] = columns[i]
        mujoco().mj_kinematics(model, data)
        distances[i] = sight.glance(data).distance
        if i == 0:
            refuse_covered_sensor(model, data, site, index)
    if not np.isfinite(distances).any():
        raise InvalidInputError(
            f"site {site.name!r}: no object lies on the sensor axis {site.axis} in any recorded posture. Choose "
            "another axis, or add the object to the model at its position during the recording"
        )
    return distances


def _joints_between(model: Model, site: int) -> IntArray:
    """Return the joints that move a sensor site."""
    body, joints = int(model.site_bodyid[site]), []
    while body > 0:
        first = int(model.body_jntadr[body])
        joints += [*range(first, first + int(model.body_jntnum[body]))][::-1]
        body = int(model.body_parentid[body])
    if not joints:
        raise InvalidInputError(
            f"site: no joint moves the site {names_of(model, 'site')[site]!r}, so joint positions do not determine "
            "its distance to an object"
        )
    return np.array(joints[::-1])


def _column(model: Model, joint: int, joints: Mapping[str, FloatArray]) -> FloatArray:
    """Check and return the recorded positions of a joint."""
    name = names_of(model, "joint")[joint]
    if not is_scalar_joint(model, joint):
        raise InvalidInputError(
            f"joint {name!r}: this joint is neither a hinge nor a slide, so joint states do not contain its position. "
            "Use a model whose base is fixed"
        )
    if name not in joints:
        listed = ", ".join(joints) or "none"
        raise InvalidInputError(
            f"joint {name!r}: this joint moves the sensor, but was not recorded; recorded joints: {listed}"
        )
    values = np.asarray(joints[name], dtype=np.float64)
    if model.jnt_limited[joint]:
        low, high = map(float, model.jnt_range[joint])
        outside = np.maximum(low - values, values - high)
        worst = int(np.argmax(np.where(np.isfinite(outside), outside, -np.inf)))
        if outside[worst] > _TOLERANCE * (high - low):
            unit = unit_of_joint(model, joint)
            ends = " to ".join(describe_position(end, unit) for end in (low, high))
            raise InvalidInputError(
                f"joint {name!r}: found the recorded position {values[worst]:g} {unit}, expected a position in the "
                f"joint range of the model ({ends}). Record the joint states of the same robot, in rad or m",
                value=values[worst],
            )
    return values
