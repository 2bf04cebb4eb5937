"""The virtual drag, F = -phi s'^2 while s = ln xi grows: the motion, and the contact that it leads to."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.numbers import FloatArray, float_or_array, positive
from pretouch.sensors import SensorModel

from .contact import ContactResult, Motion, motion_of
from .drag_columns import DragColumns
from .drag_path import DragApproach, at, follow, where_reached
from .drag_request import make_drag_request
from .scenario import Scenario

_HORIZON: Final = 600.0
_PROBES: Final = 257
_ROUNDING: Final = 1e-9


def solve_drag(scenario: Scenario, sensor: SensorModel, drag: ArrayLike, *, horizon: float = _HORIZON) -> ContactResult:
    """Find the contact of an encounter under the virtual drag of phi [N s^2]; see `Drag` in laws.py."""
    return ContactResult(DragColumns(make_drag_request(scenario, sensor, drag, horizon)), "quadrature")


def sample_drag(
    scenario: Scenario,
    sensor: SensorModel,
    drag: ArrayLike,
    *,
    horizon: float = _HORIZON,
    samples: int = 200,
) -> Motion:
    """Sample the whole motion of an encounter under the virtual drag; see `Drag` in laws.py."""
    columns = DragColumns(make_drag_request(scenario, sensor, drag, horizon))
    r, end = columns.request, columns.raw("time")
    times = end[:, None] * np.linspace(0.0, 1.0, samples)
    times[:, -1] = end
    since = np.maximum(times - columns.begins[:, None], 0.0)
    free = times - since
    distance = r.distance[:, None] + (r.velocity[:, None] + r.acceleration[:, None] * free / 2) * free
    speed = r.velocity[:, None] + r.acceleration[:, None] * free
    for cells, nodes in columns.path.walk():
        own = columns.lanes[cells.lane]
        last = cells.time + nodes.duration * (1 + _ROUNDING)  # what the next cell holds it overwrites
        inside = (times[own] >= cells.time[:, None]) & (times[own] <= last[:, None])
        row, which = np.nonzero(inside & (times[own] > columns.begins[own, None]))
        passed = np.clip(times[own[row], which] - cells.time[row], 0.0, nodes.duration[row])
        z = where_reached(nodes.pace[row], passed)
        distance[own[row], which] = cells.start[row] - cells.width[row] * cells.some(row).share(z)
        speed[own[row], which] = -at(np.sqrt(nodes.square[row]), z)
    distance[:, -1], speed[:, -1] = columns.raw("distance"), columns.raw("relative_velocity")
    return _motion(columns, times, distance, speed)


def slope_integral(sensor: SensorModel, distance: ArrayLike) -> Any:
    """Integrate g^2 from contact to a distance, G: with it, the drag of the ratio rho is phi = M ln(1/rho) / G.

    Args:
        sensor: the sensor curve.
        distance: l [m], any shape.

    Returns:
        G [1/m], of the same shape: a float for a scalar.

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> round(slope_integral(ExponentialFirstOrder(scale=1.0, rate=-60.0), 0.04), 9)
        144.0
    """
    given = np.asarray(positive(distance, "distance", "m"))
    flat = given.reshape(-1)
    grid = np.linspace(max(sensor.valid_range[0], 0.0), flat.max(initial=0.0), _PROBES)
    steepest = float(np.abs(sensor.log_slope(grid)).max())
    strength = 1.0 / (steepest**2 * flat)  # so that its exponential is resolved where g^2 is
    none = np.zeros_like(flat)
    path = follow(sensor, DragApproach(strength, none, flat, none + 1.0, none), float(grid[0]), np.inf)
    total = np.zeros_like(flat)
    for cells, nodes in path.walk():
        total[cells.lane] += nodes.whole_growth
    return float_or_array((total / (2 * strength)).reshape(given.shape))


def _motion(columns: DragColumns, times: FloatArray, distance: FloatArray, speed: FloatArray) -> Motion:
    r = columns.request
    slope = np.asarray(r.sensor.log_slope(np.clip(distance, *r.sensor.valid_range)))
    pull = -r.strength[:, None] * (slope * np.minimum(speed, 0.0)) ** 2
    bodies = {name: column[:, None] for name, column in r.bodies.items()}
    course = {
        "time": times,
        "distance": distance,
        "relative_velocity": speed,
        "displacement_velocity": bodies["v"] + bodies["a"] * times - speed,
        "displacement_acceleration": pull,
        "virtual_force": r.mass[:, None] * pull,
    }
    return motion_of(ContactResult(columns, "quadrature"), r.shape, bodies, course)
