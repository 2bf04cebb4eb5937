"""Compute what a proximity sensor sees in a MuJoCo model.

Rays are cast into the scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel

from .model import Data, Model, mujoco
from .site import SensorSite

FARTHEST: Final = 0.5
"""Largest distance at which sensors see objects [m], unless their curves end earlier."""

BEHIND: Final = 0.01
"""How far behind the contact surface rays start [m], so that an object that presses into the surface is still seen."""

_RINGS: Final = (6, 12)  # rays around the central one, so that each ray stands for the same part of the beam
_CLOSE: Final = 1e-13  # of ln xi: Newton's method for the equivalent distance ends there
_STEPS: Final = 50
_PAST: Final = 1e-9  # m: a ray that passes a body of the robot continues as far beyond its surface

FLUSH: Final = 1e-3
"""Height up to which a surface of the robot in front of a site counts as flush with it, so that rays pass it [m]."""


@dataclass(frozen=True, slots=True)
class Glance:
    """The first object on the axis of a sensor.

    Args:
        distance: from the contact surface along the axis to the first object [m]; infinite without one, negative if
            the object presses into the surface.
        geom: index of the geometry, -1 for none.
        normal: outward normal of its surface there, in the world frame, shape (3,).
    """

    distance: float
    geom: int
    normal: FloatArray


class Sight:
    """The beam of a proximity sensor as a bundle of rays.

    A ray that meets a surface at the angle a to its normal contributes cos(a) times the output of the curve, after
    Lambert, at the distance along the axis. The sum is normalized to a plane that faces the sensor: there, the output
    is that of the curve. Rays start behind the contact surface and pass through the body that carries the sensor. Other
    bodies of the robot are seen in front of the surface only, from 1 mm on, because they may be joined to that body.

    Args:
        model: the model.
        site: the sensor.
        index: index of its site.
        curve: its curve.
        farthest: largest distance at which objects are seen [m].
    """

    __slots__ = (
        *("_body", "_cosines", "_curve", "_direction", "_distances", "_farthest", "_first_slope"),
        *("_geom", "_geoms", "_index", "_model", "_normal", "_normals", "_own", "_rays"),
    )

    def __init__(self, model: Model, site: SensorSite, index: int, curve: SensorModel, farthest: float) -> None:
        self._model, self._index, self._curve = model, index, curve
        self._farthest = min(farthest, curve.valid_range[1])
        self._direction = site.direction
        self._first_slope = float(curve.log_slope(curve.valid_range[0]))
        self._body = int(model.site_bodyid[index])
        self._rays = _beam(site.direction, site.field_of_view / 2)
        self._cosines = self._rays @ site.direction
        count = len(self._rays)
        self._geoms, self._distances = np.zeros(count, dtype=np.int32), np.zeros(count)
        self._normals, self._normal = np.zeros(3 * count), np.zeros(3)
        self._geom = np.zeros(1, dtype=np.int32)
        trees = np.asarray(model.body_treeid)
        self._own = trees[np.asarray(model.geom_bodyid)] == trees[self._body]

    def axis(self, data: Data) -> FloatArray:
        """Return the direction of the sensor axis in the world frame."""
        axis: FloatArray = np.array(data.site_xmat[self._index]).reshape(3, 3) @ self._direction
        return axis

    def glance(self, data: Data) -> Glance:
        """Return the first object on the axis of the sensor."""
        u = self.axis(data)
        start = np.array(data.site_xpos[self._index]) - BEHIND * u
        depth = self._cast(data, start, u, 1.0, passed=0.0, geom=self._geom, normal=self._normal)
        if depth < 0:
            return Glance(math.inf, -1, np.zeros(3))
        return Glance(depth - BEHIND, int(self._geom[0]), self._normal.copy())

    def rays(self, data: Data) -> FloatArray:
        """Return the directions of all rays in the world frame, the axis first, shape (n, 3)."""
        turn = np.array(data.site_xmat[self._index]).reshape(3, 3)
        return np.ascontiguousarray(self._rays @ turn.T)

    def _cast(
        self,
        data: Data,
        start: FloatArray,
        ray: FloatArray,
        cosine: float,
        *,
        passed: float,
        geom: Any,
        normal: FloatArray,
    ) -> float:
        """Return the distance [m] along a ray to the first object. Only objects beyond the length `passed` count.

        The distance is negative if there is none. Other bodies of the robot are passed unless they are in front of the
        contact surface. The cosine is that of the angle between ray and axis.
        """
        while True:
            beyond = start + passed * ray
            distance = float(mujoco().mj_ray(self._model, data, beyond, ray, None, True, self._body, geom, normal))
            if distance < 0 or (passed + distance) * cosine > BEHIND + FLUSH or not self._own[geom[0]]:
                return distance if distance < 0 else passed + distance
            passed += distance + _PAST

    def equivalent_distance(self, data: Data) -> float:
        """Return the distance [m] at which a plane causes the same output.

        The plane faces the sensor, and causes the same output as the scene. The distance is infinite if nothing is
        visible.
        """
        turn = np.array(data.site_xmat[self._index]).reshape(3, 3)
        rays, count = self.rays(data), len(self._rays)
        surface = np.array(data.site_xpos[self._index])
        start = surface - BEHIND * (turn @ self._direction)
        mujoco().mj_multiRay(
            *(self._model, data, start, rays.ravel(), None, True, self._body, self._geoms, self._distances),
            *(self._normals, count, math.inf),
        )
        behind = (self._distances >= 0) & (self._distances * self._cosines <= BEHIND + FLUSH)
        for i in np.flatnonzero(behind & self._own[self._geoms]):
            passed, geom, normal = self._distances[i] + _PAST, self._geoms[i : i + 1], self._normals[3 * i : 3 * i + 3]
            cosine = float(self._cosines[i])
            self._distances[i] = self._cast(data, start, rays[i], cosine, passed=passed, geom=geom, normal=normal)
        in_sight = self._distances >= 0
        if not in_sight.any():
            return math.inf
        distances = self._distances[in_sight] * self._cosines[in_sight] - BEHIND
        facing = np.abs(np.einsum("ij,ij->i", self._normals.reshape(count, 3)[in_sight], rays[in_sight]))
        near = distances <= self._farthest
        if not near.any():
            return math.inf
        low = self._curve.valid_range[0]
        distances, facing = distances[near], facing[near]
        # A tilted surface may be nearer than the contact surface next to the axis; there, the curve continues straight.
        inside = np.maximum(distances, low)
        logs = np.asarray(self._curve.log_output(inside)) + self._first_slope * (distances - inside)
        level = float(logs.max())
        target = level + math.log(float(np.exp(logs - level) @ facing) / float(self._cosines.sum()))
        return self._invert(target, max(float(distances.min()), low), low)

    def _invert(self, target: float, start: float, low: float) -> float:
        """Find the distance at which the sensor curve has a given output."""
        distance = start
        for _ in range(_STEPS):
            error = target - float(self._curve.log_output(distance))
            if abs(error) <= _CLOSE * (1 + abs(target)):
                break
            distance = max(distance + error / float(self._curve.log_slope(distance)), low)
            if distance > self._farthest:
                return math.inf
        return distance


def _beam(direction: FloatArray, half_angle: float) -> FloatArray:
    """Return rays that represent equal parts of a conical beam. The rays are unit vectors, shape (n, 3)."""
    if half_angle <= 0:
        return direction[None].copy()
    first, second = np.linalg.svd(direction[None])[2][1:]
    total = 1 + sum(_RINGS)
    rays, inner = [direction], 1
    for count in _RINGS:
        radius = math.sqrt((inner + (inner + count)) / 2 / total)
        tangent = radius * math.tan(half_angle)
        for angle in 2 * math.pi * (np.arange(count) + 0.5) / count:
            ray = direction + tangent * (math.cos(angle) * first + math.sin(angle) * second)
            rays.append(ray / np.linalg.norm(ray))
        inner += count
    return np.array(rays)
