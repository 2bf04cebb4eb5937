"""Check the inputs of the solver for the virtual drag."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError, OutOfRangeError
from pretouch._core.numbers import BoolArray, FloatArray, IntArray, nonnegative, positive
from pretouch._core.units import MAGNITUDES
from pretouch._core.values import Value
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

from .curve import LARGEST_START, Curves, approach_windows, check_curve, reach_to, shared_curve
from .layout import Relative
from .many_curves import ManyCurves
from .scenario import Scenario, map_fields

_PROBES: Final = 257
_ROUNDING: Final = 1e-12
_LEAST: Final = 1e-100  # smaller values count as zero, since their squares underflow


@dataclass(frozen=True, kw_only=True, eq=False)
class DragRequest(Value):
    """Checked inputs for solving encounters under the virtual drag.

    Args:
        scenario: the encounters.
        sensor: the sensor curve.
        drag: phi [N s^2].
        horizon: longest time to contact that is searched [s].
        shape: the broadcast shape.
        many: one curve for each encounter along the last axis; `sensor` is then the curve from which they are made.
    """

    scenario: Scenario
    sensor: SensorModel
    drag: Any
    horizon: float
    shape: tuple[int, ...]
    many: ManyCurves | None = None

    @property
    def size(self) -> int:
        """The number of encounters."""
        return math.prod(self.shape)

    @cached_property
    def bodies(self) -> dict[str, FloatArray]:
        """The inputs of each encounter by name.

        The inputs are admittance, drag, and the motions of obstacle, robot and reference.
        """
        names = ("mass", "damping", "stiffness", "x0", "u0", "p", "v", "a", "r_v", "r_a")
        columns = (*self.scenario.relative_columns(), self.scenario.reference.position, self.drag)
        flat = np.empty((len(columns), self.size))
        for row, column in zip(flat, columns, strict=True):
            row[:] = column if np.ndim(column) == 0 else np.broadcast_to(column, self.shape).reshape(-1)
        return dict(zip((*names, "r", "phi"), flat, strict=True))

    @property
    def mass(self) -> FloatArray:
        """The virtual mass M of each encounter [kg]."""
        return self.bodies["mass"]

    @cached_property
    def relative(self) -> Relative:
        """The inputs of all encounters relative to the reference position."""
        names = ("mass", "damping", "stiffness", "x0", "u0", "p", "v", "a", "phi", "r_v", "r_a")
        return Relative(*(self.bodies[name] for name in names))

    @cached_property
    def strength(self) -> FloatArray:
        """The drag coefficient divided by the virtual mass [m]."""
        return self.bodies["phi"] / self.mass

    @cached_property
    def distance(self) -> FloatArray:
        """The initial distance between robot and object [m]."""
        return self.bodies["p"] - self.bodies["x0"]

    @cached_property
    def velocity(self) -> FloatArray:
        """The initial velocity of the object relative to the robot [m/s]."""
        return _flush_underflow(self.bodies["v"] - self.bodies["u0"])

    @cached_property
    def acceleration(self) -> FloatArray:
        """The acceleration of the obstacle relative to the reference position [m/s^2]."""
        return _flush_underflow(self.bodies["a"])

    @cached_property
    def returns(self) -> Any:
        """Whether the object rests or recedes first and approaches later."""
        return (self.velocity >= 0) & (self.acceleration < 0)

    @cached_property
    def farthest(self) -> FloatArray:
        """The distance [m] between robot and object where the approach begins."""
        rise = np.zeros_like(self.distance)
        with np.errstate(over="ignore"):  # infinite: farther than any sensor range
            np.divide(-(self.velocity**2), 2 * self.acceleration, out=rise, where=self.returns)
        return np.asarray(self.distance + rise)

    @cached_property
    def reach(self) -> float:
        """The largest distance [m] where an approach begins, rounded up.

        It is a power of two. Distances above LARGEST_START count as LARGEST_START.
        """
        return reach_to(np.minimum(self.farthest, LARGEST_START))

    @cached_property
    def ends(self) -> tuple[float, Any]:
        """The smallest and largest valid distance [m] of the sensor curves.

        The smallest distance is at least 0.
        """
        if self.many is None:
            low, high = self.sensor.valid_range
            return max(low, 0.0), high
        ends = np.array([sensor.valid_range[1] for sensor in self.many.sensors])
        return 0.0, np.broadcast_to(ends, self.shape).reshape(-1)

    def curves(self, which: IntArray) -> Curves:
        """Return the polynomials that approximate the sensor curves of selected encounters."""
        if self.many is None:
            low, high = self.sensor.valid_range
            return shared_curve(approach_windows(self.sensor, max(low, 0.0), min(self.reach, high)))
        windows = self.many.complete_windows(self.reach)
        return windows.table, windows.starts, self.curve_of(which)

    def curve_of(self, which: IntArray) -> IntArray:
        """Return the index of the sensor curve that each selected encounter uses."""
        return np.ascontiguousarray(which % (1 if self.many is None else len(self.many)))

    def at_curves(
        self, function: Callable[[SensorModel, FloatArray], FloatArray], distance: FloatArray, which: IntArray
    ) -> FloatArray:
        """Return a function of sensor curve and distance at selected encounters.

        Each encounter uses its own sensor curve. Distances [m] are limited to the valid range of the curve.
        """
        if self.many is None:
            return function(self.sensor, np.clip(distance, *self.sensor.valid_range))
        values, curve_of = np.empty_like(distance), self.curve_of(which)
        for i in np.unique(curve_of):
            rows, sensor = curve_of == i, self.many.sensors[i]
            values[rows] = function(sensor, np.clip(distance[rows], *sensor.valid_range))
        return values

    def with_curve(self, index: int) -> DragRequest:
        """Return the inputs of all encounters with a given sensor curve.

        `index` is the position of the curve along the last axis.
        """
        if self.many is None:
            return self
        scenario = map_fields(self.scenario, lambda v: v[..., min(index, v.shape[-1] - 1)] if np.ndim(v) else v)
        drag = np.broadcast_to(self.drag, self.shape)[..., index]
        return make_drag_request(scenario, self.many.sensors[index], drag, self.horizon)


def _flush_underflow(values: FloatArray) -> FloatArray:
    """Replace numbers by 0 if their squares would underflow."""
    return np.where(np.abs(values) < _LEAST, 0.0, values)


_BEYOND: Final = (
    f"expected a magnitude of at most {MAGNITUDES[1]:g} in SI units, because the square of a larger number overflows"
)


def make_drag_request(
    scenario: Scenario, sensor: SensorModel, drag: ArrayLike, horizon: float, many: ManyCurves | None = None
) -> DragRequest:
    """Check the inputs for solving encounters under the virtual drag.

    Args:
        scenario: the encounters.
        sensor: the sensor curve.
        drag: phi [N s^2].
        horizon: longest time to contact that is searched [s].
        many: one curve for each encounter along the last axis, made from `sensor`.

    Returns:
        The request.

    Raises:
        InvalidInputError: an assumption of the solution does not hold.
        OutOfRangeError: an encounter starts outside the range of the curve.
    """
    phi = nonnegative(drag, "drag", "N*s^2")
    try:
        shape = np.broadcast_shapes(scenario.shape, np.shape(phi))
    except ValueError:
        raise InvalidInputError(
            f"drag: the shape {np.shape(phi)} of the drag values does not broadcast with the shape "
            f"{scenario.shape} of the scenario"
        ) from None
    request = DragRequest(
        scenario=scenario, sensor=sensor, drag=phi, horizon=positive(horizon, "horizon", "s"), shape=shape, many=many
    )
    for name, values in (("position", request.distance), ("velocity", request.velocity)):
        _refuse(np.abs(values) > MAGNITUDES[1], values, f"obstacle {name}: found {{0:g}}, {_BEYOND}")
    if many is not None:
        many.check(scenario)
    low, high = sensor.valid_range
    start = request.distance
    outside = (start < low) | (start > high)
    if many is None and outside.any():
        raise OutOfRangeError(
            f"obstacle position: the encounter starts at a distance of {start[outside][0]:g} m, outside the sensor "
            f"range. The sensor curve ({sensor.name}) is valid only from {low:g} m to {high:g} m. Start the encounter "
            "when the object enters this range",
            value=float(start[outside][0]),
            limit=(low, high),
        )
    check_curve(sensor, request.farthest)
    _check_plant(request)
    falls = many.windows(request.reach).falling if many else _falls(sensor, max(low, 0.0), min(high, request.reach))
    if not falls:  # up to the reach; but only the range that encounters pass must fall
        for curve in (sensor,) if many is None else many.sensors:
            low, high = curve.valid_range
            _check_curve(curve, max(low, 0.0), float(min(high, request.farthest.max(initial=0.0))))
    return request


@cache_by_curve(256)
def _falls(sensor: SensorModel, low: float, high: float) -> bool:
    """Return True if the sensor output never rises with distance."""
    with np.errstate(all="ignore"):
        slope = np.asarray(sensor.log_slope(np.linspace(low, high, _PROBES)))
    return bool((np.isfinite(slope) & (slope <= 0)).all())


def _check_plant(request: DragRequest) -> None:
    """Raise an error if the admittance would act during an approach."""
    b = request.bodies
    ahead, advance = b["x0"], b["u0"]
    _refuse(
        ahead > _ROUNDING * request.distance,
        ahead,
        "plant position: found the plant {0:g} m ahead of its reference, expected it at its reference or behind it, "
        "since the solution for a drag assumes that the admittance does not act",
    )
    _refuse(
        advance > _ROUNDING * np.abs(request.velocity),
        advance,
        "plant velocity: found the plant moving toward the object {0:g} m/s faster than its reference, expected the "
        "same velocity or less, since the admittance would brake it; give the reference the same velocity",
    )
    stays = (b["stiffness"] * ahead == 0) & (b["stiffness"] * advance == 0) & (b["damping"] * advance == 0)
    _refuse(
        (request.velocity >= 0) & ~stays,
        request.velocity,
        "obstacle velocity: found a relative velocity of {0:g} m/s at the start, expected an approach (negative), "
        "since the admittance moves a plant that is not at rest at its reference; start at rest or with an approach",
    )


def _check_curve(sensor: SensorModel, low: float, high: float) -> None:
    """Raise an error if the sensor output rises with distance."""
    distance = np.linspace(low, high, _PROBES)
    slope = np.asarray(sensor.log_slope(distance))
    # the slope of a table on a level part is zero up to rounding, of either sign
    falls = slope <= _ROUNDING * np.abs(slope).max(initial=0.0, where=np.isfinite(slope))
    if not (np.isfinite(slope) & falls).all():
        wrong = float(distance[~(np.isfinite(slope) & falls)][0])
        raise InvalidInputError(
            f"sensor: the slope of the curve is {float(sensor.log_slope(wrong)):g} 1/m at a distance of {wrong:g} m, "
            "but must not be positive; set maximum_distance to the distance with the smallest output. The virtual drag "
            "interprets a rising output as an approach"
        )


def _refuse(wrong: BoolArray, values: FloatArray, message: str) -> None:
    if np.any(wrong):
        raise InvalidInputError(message.format(float(np.asarray(values)[wrong][0])))
