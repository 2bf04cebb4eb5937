"""The virtual drag, F = -phi s'^2 while s = ln xi grows: the motion, and the contact that it leads to."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, float_or_array, positive
from pretouch.sensors import SensorModel

from .contact import ContactResult, Motion
from .drag_columns import DragColumns
from .drag_path import DragApproach, at, follow, where_reached
from .drag_request import make_drag_request
from .scenario import Scenario

_HORIZON: Final = 600.0
_PROBES: Final = 257
_ROUNDING: Final = 1e-9


def solve_drag(
    scenario: Scenario, sensor: SensorModel, coefficient: ArrayLike, *, horizon: float = _HORIZON
) -> ContactResult:
    """Find the contact of an encounter under the virtual drag F = -phi s'^2 while s' = g(l) l' > 0, and 0 otherwise.

    The admittance's pull toward the object is held off during an approach: M x~'' = F - max(K x~ + D x~', 0). From rest
    at the reference, or behind it, that is M l'' = M a_o + phi g^2 l'^2, solved by quadrature for any curve
    (docs/drag.md). With a uniform obstacle the contact speed is the same share rho = exp(-(phi/M) int g^2 dl) of every
    approach speed, and the excursion is the same at every speed.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve; its scale is of no consequence.
        coefficient: phi >= 0 [kg m], that is N s^2, broadcast with the scenario.
        horizon: how long to wait for contact [s].

    Returns:
        Status and state at the end of each run, as `find_contact` has them, by the method "quadrature". `gain` is NaN:
        a drag has no D_p. `impulse_residual` is that of M l' = M l'(0) + M a_o t + phi int s' ds and of its moment,
        which certifies the time as well; s is the sensor's ln xi, which the quadrature never sees. A run that comes to
        rest relative to the object ends there, NEVER in contact: a_o > 0 then takes the object away.

    Valid for:
        A plant that follows the virtual object exactly, at rest at its reference or giving way from behind it, and a
        sensor without delay that sees the object from the farthest distance of the encounter on. What is beyond that
        raises InvalidInputError: a plant ahead of its reference, or faster than it toward the object; one that is not
        at rest while the object does not approach; a curve whose ln xi rises with the distance.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=np.array([-0.05, -0.3, -1.0])),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> contact = solve_drag(scenario, sensor, 0.01437).contact
        >>> contact.relative_velocity / scenario.relative_velocity
        array([0.15003894, 0.15003894, 0.15003894])
        >>> np.round(contact.displacement, 6)
        array([-0.059604, -0.059604, -0.059604])
    """
    return ContactResult(DragColumns(make_drag_request(scenario, sensor, coefficient, horizon)), "quadrature")


def sample_drag(
    scenario: Scenario,
    sensor: SensorModel,
    coefficient: ArrayLike,
    *,
    horizon: float = _HORIZON,
    samples: int = 200,
) -> Motion:
    """Solve an encounter under the virtual drag and sample its whole motion.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve.
        coefficient: phi >= 0 [kg m], broadcast with the scenario.
        horizon: how long to wait for contact [s].
        samples: how many instants, from 0 to the end of each run, ends included; at least 2.

    Returns:
        The motion; its arrays have the broadcast shape with the samples as a last axis.

    Raises:
        InvalidInputError: there are too few samples.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> motion = sample_drag(scenario, ExponentialFirstOrder(scale=0.458, rate=-61.0), 0.012, samples=3)
        >>> motion.relative_velocity
        array([-0.3       , -0.07913646, -0.04557996])
    """
    if samples < 2:
        raise InvalidInputError(f"samples: found {samples}, which must be at least 2")
    columns = DragColumns(make_drag_request(scenario, sensor, coefficient, horizon))
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
    r, shape = columns.request, (*columns.request.shape, times.shape[1])
    slope = np.asarray(r.sensor.log_slope(np.clip(distance, *r.sensor.valid_range)))
    pull = -r.strength[:, None] * (slope * np.minimum(speed, 0.0)) ** 2
    body = {name: column[:, None] for name, column in r.bodies.items()}
    displacement = body["p"] + (body["v"] + body["a"] * times / 2) * times - distance
    displacement_velocity = body["v"] + body["a"] * times - speed
    found = {
        "time": times,
        "distance": distance,
        "position": displacement + body["r"] + (body["r_v"] + body["r_a"] * times / 2) * times,
        "velocity": displacement_velocity + body["r_v"] + body["r_a"] * times,
        "acceleration": pull + body["r_a"],
        "displacement": displacement,
        "relative_velocity": speed,
        "virtual_force": r.mass[:, None] * pull,
    }
    plain = {name: values.reshape(shape) for name, values in found.items()}
    return Motion(**plain, result=ContactResult(columns, "quadrature"))
