"""Evaluate the force function of a control law for arrays.

The function may accept only single numbers.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import short_repr
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

from .curve import curve_pieces, reach_to


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceLaw(Value):
    """The force of a control law for a given sensor curve.

    Args:
        kind: name of the law, for messages.
        force: function of the law's number, s and s' that returns F [N].
        vectorized: whether `force` takes and returns arrays; otherwise it is called for one state after the other.
        suspends_admittance: whether the admittance's pull is switched off in an approach.
        sensor: the sensor curve; outside its range, s and g are those at the nearest end.
    """

    kind: str
    force: Callable[[Any, Any, Any], Any]
    vectorized: bool
    suspends_admittance: bool
    sensor: SensorModel

    @property
    def valid_range(self) -> tuple[float, float]:
        """The smallest and largest usable distance [m] of the sensor curve."""
        low, high = self.sensor.valid_range
        return max(low, 0.0), high

    def at(self, value: FloatArray, distance: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the virtual force [N] at given distances and relative velocities.

        It uses the sensor curve itself, without polynomials.

        Args:
            value: the law's number at each state; it broadcasts.
            distance: l [m].
            speed: l' [m/s].
        """
        inside = np.clip(distance, *self.valid_range)
        rate = np.asarray(self.sensor.log_slope(inside)) * speed
        states = np.array(np.broadcast_to(value, rate.shape)), np.asarray(self.sensor.log_output(inside)), rate
        if self.vectorized:
            return self._checked(self.force(*(array.ravel() for array in states)), rate.shape)
        numbers = (array.ravel().tolist() for array in states)
        return np.array(list(map(self.force, *numbers)), dtype=np.float64).reshape(rate.shape)

    def of_one(self, value: float, start: float) -> Callable[[float, float], float]:
        """Return the force [N] as a function of one distance [m] and one relative velocity [m/s].

        At least up to the distance `start` [m], g is a polynomial of the compiled solvers with an error of 1e-13. The
        polynomials of ln xi are its integrals.
        """
        low, high = self.valid_range
        tops, rows = _polynomials(self.sensor, low, min(reach_to(np.array([start])), high))
        reach, force, vectorized = tops[-1] if tops else -math.inf, self.force, self.vectorized
        sensor, last = self.sensor, len(tops) - 1
        number = np.array([value])

        def at(distance: float, speed: float) -> float:
            inside = low if distance < low else min(distance, high)
            if inside <= reach:
                middle, by_half, base, slopes, levels = rows[min(bisect_left(tops, inside), last)]
                z = (inside - middle) * by_half
                slope = level = 0.0
                for g, s in zip(slopes, levels, strict=True):
                    slope = slope * z + g
                    level = level * z + s
                level = level * z + base
            else:
                slope, level = float(sensor.log_slope(inside)), float(sensor.log_output(inside))
            rate = slope * speed
            found: Any
            if vectorized:
                array = force(number, np.array([level]), np.array([rate]))
                if type(array) is not np.ndarray or array.shape != (1,) or array.dtype != np.float64:
                    array = self._checked(array, (1,))
                found = array.item()
            else:
                found = force(value, level, rate)
            if type(found) is float and -math.inf < found < math.inf:
                return found
            array = np.asarray(found)
            if array.shape != () or array.dtype.kind not in "iuf" or not np.isfinite(array):
                self._refuse(found, inside, rate)
            return float(array)

        return at

    def _checked(self, force: Any, shape: tuple[int, ...]) -> FloatArray:
        """Return the result of a vectorized force, flattened, as numbers of the expected shape."""
        array = np.asarray(force)
        if array.shape != (math.prod(shape),) or array.dtype.kind not in "iuf":
            raise InvalidInputError(
                f"force: the vectorized custom law {self.kind} returned {short_repr(force)}, expected an array of "
                f"forces in N. The number of forces must be {math.prod(shape)}, one per array element. If the function "
                "accepts only single numbers, set vectorized=False"
            )
        return array.astype(np.float64).reshape(shape)

    def _refuse(self, force: Any, distance: float, rate: float) -> None:
        raise InvalidInputError(
            f"force: the custom law {self.kind} returned {force!r}, expected a single finite force in N. Its "
            f"inputs were a distance of {distance:g} m and a rate d ln xi/dt of {rate:g} 1/s"
        )


_Polynomials: TypeAlias = tuple[list[float], list[tuple[float, float, float, list[float], list[float]]]]


@cache_by_curve(256)
def _polynomials(sensor: SensorModel, low: float, reach: float) -> _Polynomials:
    """Return the polynomials of g and ln xi on pieces of a sensor curve.

    Returns:
        The upper ends of the pieces [m]. For each piece: its middle, the inverse of its half width, ln xi in its
        middle, and the coefficients of g and of ln xi, highest power first.
    """
    tops, rows = [], []
    for row in curve_pieces(sensor, low, reach) if reach > low else ():
        middle, half, *terms = map(float, row)
        levels = [half * term / (j + 1) for j, term in enumerate(terms)]
        tops.append(middle + half)
        rows.append((middle, 1 / half, float(sensor.log_output(middle)), terms[::-1], levels[::-1]))
    return tops, rows
