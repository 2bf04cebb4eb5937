"""Draw a robot model with MuJoCo's renderer or as a planar drawing."""

from __future__ import annotations

import copy
import math
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module, reload
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .geometry import touchable
from .model import Data, Model, mujoco, site_index
from .site import SensorSite

Frame: TypeAlias = NDArray[np.uint8]
"""An image of shape (height, width, 3)."""

_ELEVATION: Final = -10.0  # deg: the camera looks slightly down, so that the ground is visible
_UPRIGHT: Final = 0.9  # |vertical component| of an axis above which the axis counts as vertical
_AIR: Final = 1.12  # size of the view, in sizes of what moves
PAPER: Final = (238, 240, 243)
"""Color of the background of frames: red, green and blue, from 0 to 255."""
_SAMPLES: Final = 5  # configurations from which the size of the view is computed
_TURNS: Final = (0.0, 180.0, 30.0, -30.0, 210.0, 150.0, 60.0, -60.0, 240.0, 120.0)  # deg: views that are tried
_LOOKED_AT: Final = np.array([0.0, 0.25, 0.5, 0.75, 0.95])  # points from sensor to object that have to be seen
_CLEARANCE: Final = 1e-3  # m: the first of them is as far ahead of the site
_NEAR: Final = 0.05  # m: an object that is farther ahead need not be seen from the side
_INVISIBLE: Final = 1e-3  # opacity
_CIRCLE: Final = np.column_stack([f(np.linspace(0, 2 * math.pi, 25)[:-1]) for f in (np.cos, np.sin)])


@dataclass(frozen=True, slots=True)
class Camera(Value):
    """A camera with a side view of a robot's sensor axis.

    Args:
        target: the point in the middle of the view [m], shape (3,).
        distance: from the camera to this point [m].
        azimuth: horizontal direction of the view [deg].
        height: height of the view at the target [m].
    """

    target: FloatArray
    distance: float
    azimuth: float
    height: float

    @property
    def frame(self) -> FloatArray:
        """The camera's right, up and forward unit vectors as rows.

        The shape is (3, 3).
        """
        azimuth, elevation = math.radians(self.azimuth), math.radians(_ELEVATION)
        forward = np.array(
            [
                math.cos(azimuth) * math.cos(elevation),
                math.sin(azimuth) * math.cos(elevation),
                math.sin(elevation),
            ]
        )
        right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
        return np.array([right, np.cross(right, forward), forward])


@dataclass(frozen=True, slots=True)
class Silhouette(Value):
    """The outline of one geometry in the view of a camera.

    Args:
        outline: corners of the outline relative to the target of the camera [m], shape (n, 2).
        color: red, green, blue and opacity, from 0 to 1.
    """

    outline: FloatArray
    color: tuple[float, ...]


def visual_model(model: Model) -> Model:
    """Return a copy of a model in which collision shapes of bodies with visual meshes are invisible."""
    copied = copy.copy(model)
    bodies, solid = np.asarray(model.geom_bodyid), touchable(model)
    meshes = np.asarray(model.geom_type) == int(mujoco().mjtGeom.mjGEOM_MESH)
    seen = np.array([_color_of(model, geom)[3] > _INVISIBLE for geom in range(model.ngeom)], dtype=bool)
    dressed = np.isin(bodies, bodies[meshes & ~solid & seen])
    for geom in np.flatnonzero(dressed & solid):
        copied.geom_matid[geom], copied.geom_rgba[geom, 3] = -1, 0.0
    return copied


def camera_for(model: Model, configurations: FloatArray, site: SensorSite, *, aspect: float = 4 / 3) -> Camera:
    """Choose a camera with a side view of a sensor's axis.

    The camera sees everything that moves. Of several directions, it is the first from which nothing hides the sensor
    and what is ahead of it at the start, or the one from which least is hidden.

    Args:
        model: the model.
        configurations: positions of all joints over time, shape (n, nq).
        site: the sensor, whose robot is in the view as well.
        aspect: width of the view divided by its height.

    Returns:
        The camera.
    """
    data, index = mujoco().MjData(model), site_index(model, site.name)
    data.qpos[:] = configurations[0]
    mujoco().mj_kinematics(model, data)
    axis = np.array(data.site_xmat[index]).reshape(3, 3) @ site.direction
    side = np.array([0.0, 1.0, 0.0]) if abs(axis[2]) > _UPRIGHT else np.cross(axis, [0.0, 0.0, 1.0])
    side = side if side[1] >= 0 else -side
    azimuth = _clear_azimuth(model, data, index, axis, math.degrees(math.atan2(side[1], side[0])))
    bodies = np.asarray(model.geom_bodyid)
    roots = np.asarray(model.body_rootid)
    own = roots[bodies] == roots[model.site_bodyid[index]]
    moving = (np.asarray(model.body_treeid)[bodies] >= 0) | (own & (bodies > 0))
    shown = np.flatnonzero(moving & (np.asarray(model.geom_rbound) > 0))
    frame = Camera(np.zeros(3), 1.0, azimuth, 1.0).frame
    spans = []
    for row in configurations[np.linspace(0, len(configurations) - 1, _SAMPLES).astype(int)]:
        data.qpos[:] = row
        mujoco().mj_kinematics(model, data)
        turns = frame @ np.array(data.geom_xmat)[shown].reshape(-1, 3, 3)
        boxes = np.asarray(model.geom_aabb)[shown]  # center and half size in the frame of the geometry
        places = np.array(data.geom_xpos)[shown] @ frame.T + np.einsum("nij,nj->ni", turns, boxes[:, :3])
        halves = np.einsum("nij,nj->ni", np.abs(turns), boxes[:, 3:])
        spans.append([(places - halves).min(axis=0), (places + halves).max(axis=0)])
    low, high = np.min([s[0] for s in spans], axis=0), np.max([s[1] for s in spans], axis=0)
    width, height, depth = (float(v) for v in high - low)
    tall = _AIR * max(height, width / aspect)
    half_angle = math.radians(float(model.vis.global_.fovy)) / 2
    return Camera((low + high) / 2 @ frame, tall / 2 / math.tan(half_angle) + depth / 2, azimuth, tall)


def _clear_azimuth(model: Model, data: Data, index: int, axis: FloatArray, azimuth: float) -> float:
    """Return the direction of view [deg] near an azimuth from which least hides a sensor and what is ahead of it."""
    shown, geom, normal = visual_model(model), np.zeros(1, dtype=np.int32), np.zeros(3)
    surface = np.array(data.site_xpos[index]) + _CLEARANCE * axis
    body = int(model.site_bodyid[index])
    ahead = float(mujoco().mj_ray(shown, data, surface, axis, None, True, body, geom, normal))
    depths = _LOOKED_AT * (ahead if 0 < ahead < _NEAR else _NEAR)
    points = surface + np.outer(depths, axis)

    def hidden(turn: float) -> int:
        toward = -Camera(np.zeros(3), 1.0, azimuth + turn, 1.0).frame[2]
        hits = (mujoco().mj_ray(shown, data, p, toward, None, True, -1, geom, normal) for p in points)
        return sum(hit >= 0 for hit in hits)

    counts = {turn: hidden(turn) for turn in _TURNS}
    return azimuth + min(counts, key=lambda turn: counts[turn])


def render_frames(
    model: Model, configurations: FloatArray, camera: Camera, *, width: int, height: int
) -> list[Frame] | None:
    """Render a model with MuJoCo and OpenGL, also without a display.

    Args:
        model: the model.
        configurations: positions of all joints, one row for each frame, shape (n, nq).
        camera: the camera.
        width: width of a frame in pixels.
        height: height of a frame in pixels.

    Returns:
        The frames as a list of arrays of shape (height, width, 3); None if OpenGL cannot render.
    """
    library, bright = mujoco(), visual_model(model)
    bright.vis.headlight.ambient[:], bright.vis.headlight.diffuse[:] = 0.3, 0.4
    bright.vis.global_.offwidth = max(int(bright.vis.global_.offwidth), width)
    bright.vis.global_.offheight = max(int(bright.vis.global_.offheight), height)
    renderer = _open_renderer(bright, height, width)
    if renderer is None:
        return None
    try:
        view = library.MjvCamera()
        view.lookat[:], view.distance = camera.target, camera.distance
        view.azimuth, view.elevation = camera.azimuth, _ELEVATION
        return list(_frames(renderer, bright, configurations, view))
    finally:
        renderer.close()


def _open_renderer(model: Model, height: int, width: int) -> Any:
    """Open MuJoCo's renderer with the first working OpenGL backend.

    Returns:
        The renderer; None if no backend works.
    """
    linux = sys.platform.startswith("linux")
    kinds = ("egl", "osmesa", "glfw") if linux and not os.environ.get("MUJOCO_GL") else ("",)
    for kind in kinds:
        with suppress(Exception):  # each OpenGL driver raises errors of its own
            if kind:
                _choose_opengl(kind)
            return mujoco().Renderer(model, height, width)
    return None


def _choose_opengl(kind: str) -> None:
    """Make MuJoCo use another OpenGL backend. By itself, MuJoCo chooses the backend only once, at its import."""
    os.environ["MUJOCO_GL"] = kind
    try:
        reload(import_module("mujoco.rendering.classic.gl_context"))
    finally:
        del os.environ["MUJOCO_GL"]


def _frames(renderer: Any, model: Model, configurations: FloatArray, view: Any) -> Iterator[Frame]:
    """Yield an image with a light background for each configuration. MuJoCo's own background is black."""
    data = mujoco().MjData(model)
    for row in configurations:
        data.qpos[:] = row
        mujoco().mj_forward(model, data)
        renderer.update_scene(data, view)
        frame = renderer.render().copy()
        renderer.enable_segmentation_rendering()
        frame[renderer.render()[:, :, 0] < 0] = PAPER
        renderer.disable_segmentation_rendering()
        yield frame


def silhouettes(model: Model, configuration: FloatArray, camera: Camera) -> list[Silhouette]:
    """Return the outlines of all geometries in a parallel projection.

    The order is from the farthest to the nearest.

    Args:
        model: the model.
        configuration: positions of all joints, shape (nq,).
        camera: the camera.

    Returns:
        The outlines, without infinite planes and invisible geometries.
    """
    model = visual_model(model)
    data = mujoco().MjData(model)
    data.qpos[:] = configuration
    mujoco().mj_kinematics(model, data)
    drawn = []
    for geom in range(model.ngeom):
        points = _points_of(model, data, geom, camera.frame)
        color = _color_of(model, geom)
        if len(points) and color[3] > 0:
            flat = (points - camera.target) @ camera.frame.T
            drawn.append((float(flat[:, 2].mean()), Silhouette(_hull(flat[:, :2]), color)))
    return [silhouette for _, silhouette in sorted(drawn, key=lambda item: -item[0])]


def _hull(points: FloatArray) -> FloatArray:
    """Return the corners of the convex hull of points in a plane."""
    from scipy.spatial import ConvexHull  # noqa: PLC0415 - slow to import

    corners: FloatArray = points[ConvexHull(points, qhull_options="QJ").vertices]  # QJ: also of points on a line
    return corners


def _color_of(model: Model, geom: int) -> tuple[float, ...]:
    material = int(model.geom_matid[geom])
    return tuple(float(v) for v in (model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]))


def _points_of(model: Model, data: Data, geom: int, frame: FloatArray) -> FloatArray:
    """Return world points whose convex hull is a geometry's visible outline; none for a plane."""
    kinds, kind, size = mujoco().mjtGeom, int(model.geom_type[geom]), np.array(model.geom_size[geom])
    place, turn = np.array(data.geom_xpos[geom]), np.array(data.geom_xmat[geom]).reshape(3, 3)
    rim = np.column_stack([_CIRCLE, np.zeros(len(_CIRCLE))])
    if kind in {int(kinds.mjGEOM_SPHERE), int(kinds.mjGEOM_CAPSULE)}:
        half = size[1] * turn[:, 2] if kind == int(kinds.mjGEOM_CAPSULE) else np.zeros(3)
        circle = place + size[0] * (_CIRCLE @ frame[:2])
        return np.concatenate([circle + half, circle - half])
    if kind == int(kinds.mjGEOM_CYLINDER):
        local = np.concatenate([rim * size[0] + (0, 0, sign * size[1]) for sign in (1, -1)])
    elif kind == int(kinds.mjGEOM_BOX):
        local = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
    elif kind == int(kinds.mjGEOM_ELLIPSOID):
        stretched = frame[:2] @ turn * size  # of all points of the surface, these are on the outline
        outline: FloatArray = place + (_CIRCLE @ np.linalg.svd(stretched)[2][:2] * size) @ turn.T
        return outline
    elif kind == int(kinds.mjGEOM_MESH):
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        local = np.array(model.mesh_vert[first : first + count])
    else:
        return np.zeros((0, 3))
    points: FloatArray = place + local @ turn.T
    return points
