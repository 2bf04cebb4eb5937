"""One call of the solver in its broadcast, flattened form, checked before anything is solved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError, OutOfRangeError
from pretouch._core.numbers import FloatArray, IntArray, finite, positive
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .scenario import Scenario

__all__ = ["METHODS", "Request", "SeveralCurves", "Which", "checked_method", "make_request"]

Which: TypeAlias = slice | IntArray
"""A stretch of encounters, or the indices of some."""

METHODS: Final = ("auto", "closed-form", "integration", "uniform-motion")


class SeveralCurves(Protocol):
    """A sensor curve for each encounter along the last axis: ManyCurves, as a request sees them."""

    def __len__(self) -> int:
        """Return how many curves there are."""

    def slope_at_contact(self) -> FloatArray:
        """Return g of each curve at l = 0 [1/m]."""

    def log_output(self, distance: FloatArray) -> FloatArray:
        """Return ln xi of each curve at distances [m]."""

    def check(self, scenario: Scenario) -> None:
        """Refuse encounters that a curve does not cover."""

    def windows(self, reach: float) -> Any:
        """Return the tables of the curves up to a distance [m]."""

    def alone(self, request: Any, index: int) -> Any:
        """Return the request of the encounters of one curve."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request(Value):
    """One call of the solver.

    Args:
        scenario: the encounters as they were given.
        sensor: the sensor curve.
        shape: the broadcast shape of scenario and gain.
        columns: the relative quantities of Scenario.relative_columns and the gain D_p [N s], 11 in all: each flat, of
            length 1 where all encounters share it, else one number per encounter.
        horizon: how long to wait for contact [s].
        method: the method chosen, never "auto".
        many: the curves, where each encounter along the last axis has one of its own; `sensor` is then the one that
            they are made from.
    """

    scenario: Scenario
    sensor: SensorModel
    shape: tuple[int, ...]
    columns: tuple[FloatArray, ...]
    horizon: float
    method: str
    many: SeveralCurves | None = None

    @property
    def size(self) -> int:
        """How many encounters there are."""
        return math.prod(self.shape)

    @property
    def values(self) -> FloatArray:
        """The relative quantities of every encounter, shape (n, 10)."""
        return self.part(slice(None))[0]

    @property
    def gain(self) -> FloatArray:
        """The gain of every encounter [N s], shape (n,)."""
        return self.column(10)

    def column(self, index: int) -> FloatArray:
        """Return one column with a number for every encounter."""
        return np.broadcast_to(self.columns[index], self.size)

    def part(self, which: Which) -> tuple[FloatArray, FloatArray]:
        """Return relative quantities, shape (m, 10), and gains, shape (m,), of some encounters.

        Args:
            which: a stretch of encounters, or the indices of some.

        Returns:
            Both, contiguous.
        """
        count = len(range(self.size)[which]) if isinstance(which, slice) else len(which)
        values = np.empty((count, 10))
        for i in range(10):
            values[:, i] = self.columns[i][0] if len(self.columns[i]) == 1 else self.columns[i][which]
        return values, self.column(10)[which].copy()

    @property
    def slope(self) -> float:
        """The one slope g [1/m] of a curve of constant slope; 0 for any other."""
        return self.sensor.constant_log_slope or 0.0

    @property
    def holds_at_contact(self) -> bool:
        """Whether all curves hold down to l = 0."""
        return self.many is not None or self.sensor.valid_range[0] <= 0

    @property
    def slope_at_contact(self) -> Any:
        """The slope g [1/m] at l = 0: a number, or one for each encounter, shape (n,)."""
        if self.many is None:
            return float(self.sensor.log_slope(0.0))
        return np.broadcast_to(self.many.slope_at_contact(), self.shape).reshape(-1)

    def log_output(self, distance: FloatArray) -> FloatArray:
        """Return ln xi at a distance [m] of each encounter, brought into the range of its curve, shape (n,)."""
        if self.many is None:
            return np.asarray(self.sensor.log_output(np.clip(distance, *self.sensor.valid_range)))
        return self.many.log_output(distance.reshape(self.shape)).reshape(-1)

    def block(self, start: int, stop: int) -> tuple[FloatArray, ...]:
        """Return the columns of a stretch of encounters without a copy; those of length 1 as they are."""
        if stop - start == self.size:
            return self.columns
        return tuple(c if len(c) == 1 else c[start:stop] for c in self.columns)

    def inputs(self, start: int, stop: int) -> tuple[FloatArray, ...]:
        """Return the columns of a stretch in the order of the kernels: what drives l, D_p, then the reference."""
        c = self.block(start, stop)
        return (*c[:8], c[10], c[8], c[9])


def checked_method(scenario: Scenario, sensor: SensorModel, method: str) -> str:
    """Check that a curve holds where encounters start, and choose their method where that is left open.

    Args:
        scenario: the encounters.
        sensor: the sensor curve.
        method: one of METHODS.

    Returns:
        The method, never "auto".

    Raises:
        InvalidInputError: there is no such method, or not for this curve.
        OutOfRangeError: an encounter starts outside the range of the curve.
    """
    if method not in METHODS:
        raise InvalidInputError(f"method: found {method!r}, expected one of {', '.join(METHODS)}")
    if method == "closed-form" and sensor.constant_log_slope is None:
        raise InvalidInputError(
            f"method: the closed form L(10) holds for a constant slope only, not for the {sensor.name} curve; "
            "use method='integration' or 'auto'"
        )
    if method == "auto":
        method = "integration" if sensor.constant_log_slope is None else "closed-form"
    distance = scenario.distance
    low, high = sensor.valid_range
    if not (low <= distance <= high if type(distance) is float else np.all((distance >= low) & (distance <= high))):
        inside = sensor.contains(distance)
        distance = np.asarray(distance)
        raise OutOfRangeError(
            f"obstacle position: found a distance of {float(distance[~inside].flat[0]):g} m at the start, outside the "
            f"{low:g} m to {high:g} m in which the {sensor.name} curve holds: the encounter starts when the object "
            "enters the detection range"
        )
    return method


def make_request(
    scenario: Scenario,
    sensor: SensorModel,
    gain: ArrayLike,
    method: str,
    horizon: float,
    *,
    many: SeveralCurves | None = None,
) -> Request:
    """Check a call and flatten it; choose its method where that is left open."""
    if many is not None:
        many.check(scenario)
    gains = finite(gain, "gain", "N*s")
    shape: tuple[int, ...] = ()
    if scenario.shape != () or type(gains) is not float:
        try:
            shape = np.broadcast_shapes(scenario.shape, np.shape(gains))
        except ValueError:
            raise InvalidInputError(f"gain: shape {np.shape(gains)} does not broadcast with {scenario.shape}") from None
    return Request(
        scenario=scenario,
        sensor=sensor,
        shape=shape,
        columns=_flattened((*scenario.relative_columns(), gains), shape),
        horizon=positive(horizon, "horizon", "s"),
        method=checked_method(scenario, sensor, method) if many is None else "integration",
        many=many,
    )


def _flattened(columns: tuple[Any, ...], shape: tuple[int, ...]) -> tuple[FloatArray, ...]:
    if shape == ():
        numbers = np.array(columns, dtype=np.float64)
        return tuple(numbers[i : i + 1] for i in range(len(columns)))
    return tuple(_flat(column, shape) for column in columns)


def _flat(column: Any, shape: tuple[int, ...]) -> FloatArray:
    """Flatten a column over the broadcast shape; a number shared by all stays one."""
    array = np.asarray(column, dtype=np.float64)
    if array.size != 1 and array.shape != shape:
        array = np.broadcast_to(array, shape)
    return np.ascontiguousarray(array).reshape(-1)
