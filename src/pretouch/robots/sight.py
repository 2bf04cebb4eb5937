"""Compute what a proximity sensor sees in a MuJoCo model.

Rays are cast into the scene.
"""

from __future__ import annotations

import ctypes
import math
from ctypes import byref
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.native import DOUBLE, INTEGER, POINTER, Structure, address, kernel, numbers
from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel
from pretouch.simulation.native_loop import curve_structure

from .engine import address_of, engine
from .model import Data, Model
from .site import SensorSite

FARTHEST: Final = 0.5
"""Largest distance at which sensors see objects [m], unless their curves end earlier."""

BEHIND: Final = 0.01
"""How far behind the contact surface rays start [m], so that an object that presses into the surface is still seen."""

_RINGS: Final = (6, 12)  # rays around the central one, so that each ray stands for the same part of the beam
_BYTE: Final = np.dtype(np.uint8)
_INTEGER: Final = np.dtype(np.int32)

FLUSH: Final = 1e-3
"""Height up to which a surface of the robot in front of a site counts as flush with it, so that rays pass it [m]."""


_glance: Final = kernel("sight_glance", POINTER, POINTER, POINTER, POINTER, POINTER)
_distance: Final = kernel("sight_distance", POINTER, POINTER, POINTER, POINTER, result=DOUBLE)


class NativeSight(Structure):
    """The beam of a sensor as a C structure."""

    _fields_ = (
        *numbers("engine", "model", "rays", "cosines", "own", "curve", "scratch", "geoms", kind=POINTER),
        *numbers("count", "body", kind=ctypes.c_int32),
        *numbers("farthest", "behind", "flush", "lowest", "first_slope"),
    )


class NativeGlance(Structure):
    """The first object on the axis of a sensor as a C structure."""

    _fields_ = (("distance", ctypes.c_double), ("normal", ctypes.c_double * 3), ("geom", INTEGER))


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

    Compiled code casts the rays, here and in simulated runs.

    Args:
        model: the model.
        site: the sensor.
        index: index of its site.
        curve: its curve.
        farthest: largest distance at which objects are seen [m].
    """

    __slots__ = ("_direction", "_held", "_index", "_rays", "native")

    def __init__(self, model: Model, site: SensorSite, index: int, curve: SensorModel, farthest: float) -> None:
        self._index, self._direction = index, site.direction
        farthest, low = min(farthest, curve.valid_range[1]), curve.valid_range[0]
        body, trees = int(model.site_bodyid[index]), np.asarray(model.body_treeid)
        own = (trees[np.asarray(model.geom_bodyid)] == trees[body]).astype(np.uint8)
        self._rays = _beam(site.direction, site.field_of_view / 2)
        cosines, count = self._rays @ site.direction, len(self._rays)
        scratch, geoms = np.zeros(7 * count), np.zeros(count, dtype=np.int32)
        # without a farthest distance, only the axis is used
        native, table = curve_structure(curve, farthest) if math.isfinite(farthest) else (None, None)
        self.native = NativeSight(
            *(ctypes.addressof(engine()), model._address, address(self._rays), address(cosines)),
            *(address(own, _BYTE), None if native is None else ctypes.addressof(native), address(scratch)),
            *(address(geoms, _INTEGER), count, body, farthest, BEHIND, FLUSH, low, float(curve.log_slope(low))),
        )
        self._held = model, cosines, own, native, table, scratch, geoms

    def axis(self, data: Data) -> FloatArray:
        """Return the direction of the sensor axis in the world frame."""
        axis: FloatArray = np.array(data.site_xmat[self._index]).reshape(3, 3) @ self._direction
        return axis

    def glance(self, data: Data) -> Glance:
        """Return the first object on the axis of the sensor."""
        native = NativeGlance()
        _glance(byref(self.native), *self._places(data), byref(native))
        return Glance(native.distance, native.geom, np.array(native.normal))

    def rays(self, data: Data) -> FloatArray:
        """Return the directions of all rays in the world frame, the axis first, shape (n, 3)."""
        turn = np.array(data.site_xmat[self._index]).reshape(3, 3)
        return np.ascontiguousarray(self._rays @ turn.T)

    def equivalent_distance(self, data: Data) -> float:
        """Return the distance [m] at which a plane causes the same output.

        The plane faces the sensor, and causes the same output as the scene. The distance is infinite if nothing is
        visible.
        """
        return float(_distance(byref(self.native), *self._places(data)))

    def _places(self, data: Data) -> tuple[int, int, int]:
        """Return the addresses of a state, and of position and orientation of the site in it."""
        points, frames = address_of(data.site_xpos), address_of(data.site_xmat)
        return data._address, points + 24 * self._index, frames + 72 * self._index


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
