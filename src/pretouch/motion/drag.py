"""Compute motion and contact under the virtual drag.

The virtual drag is a force that acts only while the sensor output rises.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray, float_or_array, positive
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .contact import ContactResult, Motion, motion_of
from .curve import LARGEST_START, approach_windows, check_curve, reach_to, shared_curve
from .drag_demands import (
    impulse_residual,
    largest_acceleration,
    largest_force,
    largest_speed,
    largest_travel,
)
from .drag_gradients import DragRows
from .drag_path import DragPath
from .drag_request import DragRequest, make_drag_request
from .gradients import ContactGradients, ManyGradients
from .layout import RESOLUTION, ContactStatus
from .many_curves import ManyCurves
from .scenario import Scenario


class DragColumns(Value):
    """Results of encounters under the virtual drag.

    Each result, such as the contact time, is computed on first access. Two objects are equal if their requests are.

    Args:
        request: the encounters.

    Attributes:
        begins: start of each approach [s]; the law does not act before.
        lanes: indices of the encounters with an approach, in the order of the path.
        path: the approaches.
    """

    __slots__ = ("_cache", "_columns", "begins", "lanes", "path", "request")

    def __init__(self, request: DragRequest) -> None:
        self.request = request
        low, high = request.ends
        self.begins, status = _approach_start(request, high)
        self.lanes: IntArray = np.flatnonzero(status < 0)
        on = self.lanes
        self.path = DragPath(_path_inputs(request, self.begins, on), request.curves(on), request.horizon)
        time = self.begins.copy()
        distance = request.distance + (request.velocity + request.acceleration * time / 2) * time
        speed, force = request.velocity + request.acceleration * time, np.zeros_like(time)
        ends = self.path.rows
        status[on], time[on], distance[on] = self.path.status, ends["time"], ends["distance"]
        speed[on] = -np.sqrt(ends["square"])
        force[on] = -request.bodies["phi"][on] * ends["slope"] ** 2 * ends["square"]
        time[status == ContactStatus.HORIZON] = request.horizon
        end = {"time": time, "distance": distance, "relative_velocity": speed, "virtual_force": force}
        self._columns: dict[str, Any] = dict(end)
        self._columns["status"] = _final_status(request, status, end, low)
        self._cache: dict[str, Any] = {}

    def _compared(self) -> tuple[Any, ...]:
        r = self.request
        return (r.scenario, r.sensor, r.drag, r.horizon)

    def column(self, name: str) -> Any:
        """Return one result quantity, such as the contact time.

        Args:
            name: a quantity of ContactState or ContactResult; `quadrature_error`, the estimated relative error of the
                time; or `distance_of_largest_force` [m].

        Returns:
            The quantity, of the broadcast shape; a float for one encounter.
        """
        if name not in self._cache:
            values = self.raw(name)
            if self.request.shape == ():
                self._cache[name] = values[0].item()
            else:
                self._cache[name] = values.reshape(self.request.shape)
                self._cache[name].setflags(write=False)
        return self._cache[name]

    def raw(self, name: str) -> FloatArray:
        """Return one result quantity, such as the contact time, per encounter."""
        if name not in self._columns:
            self._columns[name] = np.asarray(_DERIVED[name](self))
        return np.asarray(self._columns[name])

    @property
    def status(self) -> IntArray:
        """How each encounter ended, as the integer value of ContactStatus."""
        return self._columns["status"]  # type: ignore[no-any-return]

    @property
    def settled_acceleration(self) -> FloatArray:
        """The robot's final acceleration relative to the reference position [m/s^2]."""
        return np.asarray(self.raw("virtual_force") / self.request.mass)

    def reference(self, derivative: int) -> FloatArray:
        """Return the final velocity or acceleration of the reference position.

        `derivative` is 1 for the velocity [m/s] and 2 for the acceleration [m/s^2].
        """
        b = self.request.bodies
        return b["r_a"] if derivative == 2 else np.asarray(b["r_v"] + b["r_a"] * self.raw("time"))

    @property
    def gradients(self) -> ContactGradients | ManyGradients:
        """Exact derivatives of the contact state under the virtual drag."""
        if self.request.many is None:
            return ContactGradients(self, DragRows(self))
        each = [DragColumns(self.request.with_curve(i)) for i in range(len(self.request.many))]
        return ManyGradients([ContactGradients(part, DragRows(part)) for part in each])


def _path_inputs(request: DragRequest, begins: FloatArray, on: IntArray) -> tuple[FloatArray, ...]:
    """Return the solver inputs for approaching objects."""
    b = request.bodies
    square = request.velocity**2
    # next to the speed that a push adds, an initial speed below rounding is none; it would take many tiny intervals
    slow = square < _NEGLIGIBLE * -request.acceleration * request.farthest
    square = np.where(request.returns | slow, 0.0, square)
    approach = (request.strength, request.acceleration, request.farthest, square, begins)
    obstacle = (b["p"] - b["x0"], b["v"] + b["r_v"], b["a"] + b["r_a"])
    return tuple(np.ascontiguousarray(c) if len(on) == len(c) else c[on] for c in (*approach, *obstacle))


def _approach_start(request: DragRequest, high: Any) -> tuple[FloatArray, IntArray]:
    """Find when each approach begins, and the status: -1, or that of an encounter without an approach."""
    a, v, count = request.acceleration, request.velocity, len(request.velocity)
    status = np.where((v < 0) | request.returns, -1, int(ContactStatus.NEVER))
    begins = np.zeros(count)
    if request.returns.any():
        with np.errstate(over="ignore"):  # an infinite result means that the approach never begins
            np.divide(-v, a, out=begins, where=request.returns)
    if (request.farthest > np.minimum(high, LARGEST_START)).any():
        far = (status < 0) & (request.farthest > LARGEST_START)
        begins[far], status[far] = 0.0, ContactStatus.UNRESOLVED
        lost = np.flatnonzero(request.farthest > high)
        room = np.broadcast_to(high, count)[lost] - request.distance[lost]
        begins[lost] = 2 * room / (v[lost] + np.sqrt(np.maximum(v[lost] ** 2 + 2 * a[lost] * room, 0.0)))
        status[lost] = ContactStatus.LEFT_RANGE
    late = begins >= request.horizon
    begins[late], status[late] = request.horizon, ContactStatus.HORIZON
    return begins, status


def _final_status(request: DragRequest, status: IntArray, end: dict[str, FloatArray], low: float) -> IntArray:
    """Return how each encounter under the virtual drag ended. Distance and l' of a touch are set to zero."""
    if low > 0:
        return np.where(status == ContactStatus.CONTACT, ContactStatus.LEFT_RANGE, status)
    turns = (request.velocity < 0) & (request.acceleration > 0)
    if not turns.any():
        return status
    b, time, distance, speed = request.bodies, end["time"], end["distance"], end["relative_velocity"]
    terms = np.abs(b["p"]) + (np.abs(b["v"]) + np.abs(b["a"]) * time / 2) * time
    beyond = np.full(len(time), np.inf)  # the distance beyond l = 0 at which the run would come to rest [m]
    with np.errstate(over="ignore"):  # an infinite result means that the acceleration is negligible
        np.divide(speed**2, 2 * request.acceleration, out=beyond, where=turns)
    near_touch = (status == ContactStatus.CONTACT) & (beyond <= RESOLUTION * terms)
    touches = near_touch | (turns & (status == ContactStatus.NEVER) & (distance <= RESOLUTION * terms))
    distance[touches], speed[touches] = 0.0, 0.0
    return np.where(touches, ContactStatus.CONTACT, status)


def _displacement(c: DragColumns) -> FloatArray:
    b, t = c.request.bodies, c.raw("time")
    return np.asarray(b["p"] + (b["v"] + b["a"] * t / 2) * t - c.raw("distance"))


def _displacement_velocity(c: DragColumns) -> FloatArray:
    b = c.request.bodies
    return np.asarray(b["v"] + b["a"] * c.raw("time") - c.raw("relative_velocity"))


def _position(c: DragColumns) -> FloatArray:
    b, t = c.request.bodies, c.raw("time")
    return np.asarray(c.raw("displacement") + b["r"] + (b["r_v"] + b["r_a"] * t / 2) * t)


def _settling(c: DragColumns) -> FloatArray:
    r = c.request
    return np.where((r.velocity == 0) & (r.acceleration == 0), r.distance, np.inf)


def _error(c: DragColumns) -> FloatArray:
    error = np.zeros(len(c.begins))
    error[c.lanes] = c.path.rows["error"]
    return error


_NEGLIGIBLE: Final = 1e-33  # of 2 a_o l, a squared initial speed that changes no digit of a motion
_DERIVED: Final[dict[str, Callable[[DragColumns], Any]]] = {
    "gain": lambda c: c.request.bodies["phi"],
    "displacement": _displacement,
    "displacement_velocity": _displacement_velocity,
    "position": _position,
    "velocity": lambda c: (
        c.raw("displacement_velocity") + c.request.bodies["r_v"] + c.request.bodies["r_a"] * c.raw("time")
    ),
    "acceleration": lambda c: c.raw("virtual_force") / c.request.mass + c.request.bodies["r_a"],
    "largest_excursion": lambda c: np.maximum(np.abs(c.request.bodies["x0"]), np.abs(c.raw("displacement"))),
    "largest_travel": largest_travel,
    "largest_speed": largest_speed,
    "largest_acceleration": largest_acceleration,
    "largest_virtual_force": lambda c: largest_force(c)[0],
    "distance_of_largest_force": lambda c: largest_force(c)[1],
    "closest_distance": lambda c: np.minimum(c.request.distance, c.raw("distance")),
    "settling_distance": _settling,
    "impulse_residual": impulse_residual,
    "quadrature_error": _error,
}


_HORIZON: Final = 600.0
_PROBES: Final = 257


def solve_drag(
    scenario: Scenario,
    sensor: SensorModel,
    drag: ArrayLike,
    *,
    horizon: float = _HORIZON,
    many: ManyCurves | None = None,
) -> ContactResult:
    """Solve encounters for given coefficients of the virtual drag.

    Args:
        scenario: the encounters.
        sensor: the sensor curve.
        drag: phi [N s^2].
        horizon: longest time to contact that is searched [s].
        many: one curve for each encounter along the last axis, made from `sensor`; None if all share `sensor`.

    Returns:
        The result.
    """
    return ContactResult(DragColumns(make_drag_request(scenario, sensor, drag, horizon, many)), "quadrature")


def sample_drag(
    scenario: Scenario,
    sensor: SensorModel,
    drag: ArrayLike,
    *,
    horizon: float = _HORIZON,
    samples: int = 200,
) -> Motion:
    """Return sampled motions of robot and obstacle under the virtual drag.

    The samples reach from the start to the end of each encounter.
    """
    columns = DragColumns(make_drag_request(scenario, sensor, drag, horizon))
    r, end = columns.request, columns.raw("time")
    times = end[:, None] * np.linspace(0.0, 1.0, samples)
    times[:, -1] = end
    since = np.maximum(times - columns.begins[:, None], 0.0)
    free = times - since
    distance = r.distance[:, None] + (r.velocity[:, None] + r.acceleration[:, None] * free / 2) * free
    speed = r.velocity[:, None] + r.acceleration[:, None] * free
    on = columns.lanes
    trace = np.full((len(on), samples, 2), np.nan)
    columns.path.sample(np.ascontiguousarray(times[on]), trace)
    filled = np.isfinite(trace[..., 0])
    distance[on] = np.where(filled, trace[..., 0], distance[on])
    speed[on] = np.where(filled, -trace[..., 1], speed[on])
    distance[:, -1], speed[:, -1] = columns.raw("distance"), columns.raw("relative_velocity")
    return _motion(columns, times, distance, speed)


def slope_integral(sensor: SensorModel, distance: ArrayLike) -> Any:
    """Integrate the squared sensor slope from contact to a given distance.

    With this integral G, the drag phi = M ln(1/rho) / G gives the speed ratio rho.

    Args:
        sensor: the sensor curve.
        distance: l [m], any shape.

    Returns:
        G [1/m], of the same shape: a float for a scalar.

    Raises:
        InvalidInputError: a distance is not positive, or too large (LARGEST_START).

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> round(slope_integral(ExponentialFirstOrder(scale=1.0, rate=-60.0), 0.04), 9)
        144.0
    """
    distances = np.asarray(positive(distance, "distance", "m"))
    flat = distances.reshape(-1)
    if flat.max(initial=0.0) > LARGEST_START:
        raise InvalidInputError(
            f"distance: found {flat.max():g} m, expected at most {LARGEST_START:g} m", limit=LARGEST_START
        )
    check_curve(sensor, flat)
    low = max(sensor.valid_range[0], 0.0)
    grid = np.linspace(low, flat.max(initial=0.0), _PROBES)
    steepest = float(np.abs(sensor.log_slope(grid)).max())
    strength = 1.0 / (steepest**2 * flat)  # small enough to resolve the exponential where g^2 is large
    none = np.zeros_like(flat)
    curves = shared_curve(approach_windows(sensor, low, min(reach_to(flat), sensor.valid_range[1])))
    path = DragPath((strength, none, flat, none + 1.0, none, none, none, none), curves, np.inf)
    total = path.rows["growth"]
    return float_or_array((total / (2 * strength)).reshape(distances.shape))


def _motion(columns: DragColumns, times: FloatArray, distance: FloatArray, speed: FloatArray) -> Motion:
    r = columns.request
    slope = np.asarray(r.sensor.log_slope(np.clip(distance, *r.sensor.valid_range)))
    pull = -r.strength[:, None] * (slope * np.minimum(speed, 0.0)) ** 2
    bodies = {name: column[:, None] for name, column in r.bodies.items()}
    course = {
        "time": times,
        "distance": distance,
        "relative_velocity": speed,
        "displacement": bodies["p"] + (bodies["v"] + bodies["a"] * times / 2) * times - distance,
        "displacement_velocity": bodies["v"] + bodies["a"] * times - speed,
        "displacement_acceleration": pull,
        "virtual_force": r.mass[:, None] * pull,
    }
    return motion_of(ContactResult(columns, "quadrature"), r.shape, bodies, course)
