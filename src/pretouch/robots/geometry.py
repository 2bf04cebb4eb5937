"""Find where a line leaves the shapes of a robot, so that a sensor site can be taken to their surface."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

from .model import Data, Model, mujoco, names_of

TOLERANCE: Final = 1e-5
"""Depth below a surface up to which a site counts as on it [m], because models have rounded numbers."""

_PAST: Final = 1e-9  # m: the search for the next surface starts as far beyond the last one
_SURFACES: Final = 100  # of one shape along a line


def touchable(model: Model) -> BoolArray:
    """Return whether each geometry of a model can touch anything."""
    return np.asarray((np.asarray(model.geom_contype) != 0) | (np.asarray(model.geom_conaffinity) != 0))


def geom_label(model: Model, geom: int) -> str:
    """Return the quoted name of a geometry, or its number and body if it is unnamed."""
    name = names_of(model, "geom")[geom]
    if name:
        return repr(name)
    body = names_of(model, "body")[int(model.geom_bodyid[geom])]
    return f"number {geom}" + (f" of the body {body!r}" if body and body != "world" else "")


def distance_to(model: Model, data: Data, geom: int, point: FloatArray, direction: FloatArray) -> float:
    """Return the distance [m] along a ray to a geometry's surface. It is negative if the ray misses the surface."""
    library = mujoco()
    kinds, kind = library.mjtGeom, int(model.geom_type[geom])
    if kind in {int(kinds.mjGEOM_PLANE), int(kinds.mjGEOM_HFIELD)}:
        return -1.0  # ground has no inside that a ray can leave
    if kind == int(kinds.mjGEOM_SDF):
        return -1.0
    if kind == int(kinds.mjGEOM_MESH):
        return float(library.mj_rayMesh(model, data, geom, point, direction))
    where = data.geom_xpos[geom], data.geom_xmat[geom], model.geom_size[geom]
    return float(library.mju_rayGeom(*where, point, direction, kind))


def _last_surface(model: Model, data: Data, geom: int, point: FloatArray, direction: FloatArray) -> float:
    """Return the distance [m] along a ray to the last surface of a geometry; it is negative without any."""
    last = -1.0
    for _ in range(_SURFACES):
        start = max(last, 0.0) + (_PAST if last >= 0 else 0.0)
        distance = distance_to(model, data, geom, point + start * direction, direction)
        if distance < 0:
            break
        last = start + distance
    return last


def covering(model: Model, data: Data, point: FloatArray, axis: FloatArray) -> IntArray:
    """Return the geometries that can touch, and contain a point.

    Geometries are taken as convex, as MuJoCo does: a point is inside if there are surfaces ahead and behind.
    """
    inside = []
    for geom in np.flatnonzero(touchable(model)):
        if np.linalg.norm(point - data.geom_xpos[geom]) > model.geom_rbound[geom] > 0:
            continue
        depths = (distance_to(model, data, int(geom), point, sign * axis) for sign in (1.0, -1.0))
        if all(depth > TOLERANCE for depth in depths):
            inside.append(int(geom))
    return np.array(inside, dtype=np.int64)


def way_out(model: Model, data: Data, index: int, axis: FloatArray) -> tuple[float, IntArray]:
    """Return how far a site is below the surface of its robot.

    Args:
        model: the model.
        data: its state after `mj_kinematics`.
        index: index of the site.
        axis: axis of the sensor in the world frame.

    Returns:
        The distance [m] along the axis to the point where the axis leaves all shapes of the robot around the site, and
        these geometries. It is 0 if none contains the site.
    """
    trees, bodies = np.asarray(model.body_treeid), np.asarray(model.geom_bodyid)
    welds, body = np.asarray(model.body_weldid), int(model.site_bodyid[index])
    own = (trees[bodies] == trees[body]) & (trees[bodies] >= 0) | (welds[bodies] == welds[body])
    distance, shapes = 0.0, []
    for _ in range(int(own.sum())):
        point = np.array(data.site_xpos[index]) + distance * axis
        around = [geom for geom in covering(model, data, point, axis) if own[geom] and geom not in shapes]
        if not around:
            break
        shapes += around
        distance += max(_last_surface(model, data, int(geom), point, axis) for geom in around)
    return distance, np.array(shapes, dtype=np.int64)


def farthest_surface(model: Model, data: Data, index: int, axis: FloatArray) -> float:
    """Return the distance [m] along an axis to the outermost surface of the rigid body of a site; 0 without any."""
    welds = np.asarray(model.body_weldid)
    own = welds[np.asarray(model.geom_bodyid)] == welds[model.site_bodyid[index]]
    point = np.array(data.site_xpos[index])
    shapes = np.flatnonzero(touchable(model) & own)
    return max(0.0, *(_last_surface(model, data, int(geom), point, axis) for geom in shapes)) if len(shapes) else 0.0


def move_site(model: Model, index: int, shift: Any) -> None:
    """Move a site in a model by a vector in the frame of the site [m]."""
    if not np.any(shift):
        return
    turned = np.zeros(3)
    mujoco().mju_rotVecQuat(turned, np.asarray(shift, dtype=np.float64), model.site_quat[index])
    model.site_pos[index] += turned
    model.site_sameframe[index] = 0  # MuJoCo otherwise takes the frame of the body
