"""Check the arguments of a solver call, and choose the solution method."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError, OutOfRangeError
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import FloatArray, IntArray, finite, positive
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .curve import check_curve
from .layout import Relative
from .many_curves import ManyCurves
from .scenario import Scenario, map_fields

Which: TypeAlias = slice | IntArray
"""A slice of the encounters, or an array of their indices."""

METHODS: Final = ("auto", "closed-form", "integration", "uniform-motion")


@dataclass(frozen=True, slots=True, kw_only=True)
class Request(Value):
    """Checked inputs of a solver call.

    Args:
        scenario: the encounters.
        sensor: the sensor curve.
        shape: the broadcast shape of scenario and gain.
        columns: the columns of Relative, flat; length 1 if all encounters share a value, else one value per encounter.
        horizon: longest time to contact that is searched [s].
        method: the chosen method, never "auto".
        many: one curve for each encounter along the last axis; `sensor` is then the curve from which they are made.
        degree: exponent of d(ln xi)/dt in the virtual force: 1 for the virtual damper, 2 for the virtual drag.
    """

    scenario: Scenario
    sensor: SensorModel
    shape: tuple[int, ...]
    columns: tuple[FloatArray, ...]
    horizon: float
    method: str
    many: ManyCurves | None = None
    degree: int = 1

    @property
    def size(self) -> int:
        """The number of encounters that the solver has to solve."""
        return math.prod(self.shape)

    @property
    def relative(self) -> Relative:
        """The inputs of all encounters relative to the reference position."""
        return Relative._make(self.columns)

    @property
    def gain(self) -> FloatArray:
        """The coefficient of the control law in each encounter, such as D_p [N s]."""
        return np.broadcast_to(self.relative.gain, self.size)

    def some(self, which: Which) -> Relative:
        """Return the inputs of selected encounters.

        Columns of length 1 keep this length.
        """
        return Relative._make(c if len(c) == 1 else c[which] for c in self.columns)

    def part(self, which: Which) -> tuple[FloatArray, FloatArray]:
        """Return the inputs and gains of selected encounters as contiguous arrays.

        The quantities are those of Scenario.relative, shape (m, 10). The gains have the shape (m,).
        """
        count = len(range(self.size)[which]) if isinstance(which, slice) else len(which)
        columns, values, gains = self.some(which), np.empty((count, 10)), np.empty(count)
        for i, column in enumerate((*columns[:8], *columns[9:])):
            values[:, i] = column
        gains[:] = columns.gain
        return values, gains

    def with_curve(self, index: int) -> Request:
        """Return the inputs of all encounters that use a given sensor curve.

        `index` is the position of the curve along the last axis.
        """
        if self.many is None:
            return self
        scenario = map_fields(self.scenario, lambda v: v[..., min(index, v.shape[-1] - 1)] if np.ndim(v) else v)
        gain, sensor = self.gain.reshape(self.shape)[..., index], self.many.sensors[index]
        options: dict[str, Any] = {"with_course": bool(scenario.obstacle.course), "degree": self.degree}
        return make_request(scenario, sensor, gain, self.method, self.horizon, **options)

    @property
    def slope(self) -> float:
        """The slope g [1/m] of a sensor curve with constant slope.

        It is 0 for any other curve.
        """
        return self.sensor.constant_log_slope or 0.0

    @property
    def slope_at_contact(self) -> Any:
        """The sensor slope g [1/m] at contact.

        It is an array if each encounter has its own sensor curve.
        """
        if self.many is None:
            return float(self.sensor.log_slope(0.0))
        return np.broadcast_to(self.many.slope_at_contact(), self.shape).reshape(-1)

    def log_output(self, distance: FloatArray) -> FloatArray:
        """Return the log output ln xi at one distance [m] per encounter.

        Distances are limited to the sensor range.
        """
        if self.many is None:
            return np.asarray(self.sensor.log_output(np.clip(distance, *self.sensor.valid_range)))
        return self.many.log_output(distance.reshape(self.shape)).reshape(-1)


def choose_method(scenario: Scenario, sensor: SensorModel, method: str) -> str:
    """Choose the solution method, and check the starting distances.

    A method other than "auto" is kept. Encounters must start in the sensor range.

    Returns:
        The method, never "auto".

    Raises:
        InvalidInputError: the method is unknown or not applicable to the curve.
        OutOfRangeError: an encounter starts outside the range of the curve.
    """
    if method not in METHODS:
        raise InvalidInputError(**not_one_of("method", method, METHODS))
    if method == "closed-form" and sensor.constant_log_slope is None:
        raise InvalidInputError(
            "method: the method 'closed-form' needs a sensor curve of constant slope, but the slope of the curve "
            f"{sensor.name} varies; use method='integration' or 'auto'"
        )
    if method == "auto":
        method = "integration" if sensor.constant_log_slope is None else "closed-form"
    distance = scenario.distance
    low, high = sensor.valid_range
    if not (low <= distance <= high if type(distance) is float else np.all((distance >= low) & (distance <= high))):
        inside = sensor.contains(distance)
        distance = np.asarray(distance)
        raise OutOfRangeError(
            f"obstacle position: the encounter starts at a distance of {float(distance[~inside].flat[0]):g} m, "
            f"outside the sensor range. The sensor curve ({sensor.name}) is valid only from {low:g} m to {high:g} m. "
            "Start the encounter when the object enters this range",
            value=float(distance[~inside].flat[0]),
            limit=(low, high),
        )
    check_curve(sensor, distance)
    return method


COURSE: Final = "an obstacle with a course"


def check_integration(method: str, needed_for: str) -> str:
    """Return the method "integration", which is the only one for some encounters.

    Raises:
        InvalidInputError: another method is chosen.
    """
    if method not in {"auto", "integration"}:
        raise InvalidInputError(
            f"method: found {method!r}, expected 'auto' or 'integration', because only these methods support "
            f"{needed_for}",
            value=method,
        )
    return "integration"


def make_request(
    scenario: Scenario,
    sensor: SensorModel,
    gain: ArrayLike,
    method: str,
    horizon: float,
    *,
    many: ManyCurves | None = None,
    with_course: bool = False,
    degree: int = 1,
) -> Request:
    """Check the inputs of a solver call, choose its method, and convert arrays to one dimension.

    A force of the degree 2 is that of the virtual drag.

    Returns:
        The checked inputs.

    Raises:
        InvalidInputError: an input does not fit, or the obstacle has a course and `with_course` is not set.
    """
    if many is not None:
        many.check(scenario)
        check_curve(sensor, scenario.distance)
    gains = finite(gain, "gain", "N*s")
    shape: tuple[int, ...] = ()
    if scenario.shape != () or type(gains) is not float:
        try:
            shape = np.broadcast_shapes(scenario.shape, np.shape(gains))
        except ValueError:
            raise InvalidInputError(
                f"gain: the array of gains has the shape {np.shape(gains)}, but the scenario has the shape "
                f"{scenario.shape}. Use two shapes that NumPy can broadcast together"
            ) from None
    relative = scenario.relative_columns(with_course=with_course)
    return Request(
        scenario=scenario,
        sensor=sensor,
        shape=shape,
        columns=_flatten((*relative[:8], gains, *relative[8:]), shape),
        horizon=positive(horizon, "horizon", "s"),
        method=choose_method(scenario, sensor, method) if many is None else "integration",
        many=many,
        degree=degree,
    )


def _flatten(columns: tuple[Any, ...], shape: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """Convert the inputs to one-dimensional arrays; a number that all encounters share gets the length 1."""
    if shape == ():
        numbers = np.array(columns, dtype=np.float64)
        return tuple(numbers[i : i + 1] for i in range(len(columns)))
    arrays = (np.asarray(column, dtype=np.float64) for column in columns)
    return tuple(
        np.ascontiguousarray(a if a.size == 1 or a.shape == shape else np.broadcast_to(a, shape)).reshape(-1)
        for a in arrays
    )
