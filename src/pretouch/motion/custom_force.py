"""Evaluate the force function of a control law for arrays.

The function may accept only single numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import short_repr
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel


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

    def at(self, value: FloatArray, distance: FloatArray, speed: FloatArray, *, trial: bool = False) -> FloatArray:
        """Return the virtual force [N] at given distances and relative velocities.

        Args:
            value: the law's number at each state; it broadcasts.
            distance: l [m].
            speed: l' [m/s].
            trial: whether the states are trial states of an iteration, at which the force may be infinite or NaN.
        """
        inside = np.clip(distance, *self.valid_range)
        rate = np.asarray(self.sensor.log_slope(inside)) * speed
        states = np.array(np.broadcast_to(value, rate.shape)), np.asarray(self.sensor.log_output(inside)), rate
        force = self._of_arrays(states) if self.vectorized else self._of_numbers(states, inside, trial=trial)
        if not trial and not (finite := np.isfinite(force)).all():
            self._refuse(float(force[~finite][0]), float(inside[~finite][0]), float(rate[~finite][0]))
        return force

    def _of_arrays(self, states: tuple[FloatArray, ...]) -> FloatArray:
        """Call the user's force function once for all states."""
        shape = states[0].shape
        force = self.force(*(array.ravel() for array in states))
        array = np.asarray(force)
        if array.shape != (math.prod(shape),) or array.dtype.kind not in "iuf":
            raise InvalidInputError(
                f"force: the vectorized custom law {self.kind} returned {short_repr(force)}, expected an array of "
                f"forces in N. The number of forces must be {math.prod(shape)}, one per array element. If the function "
                "accepts only single numbers, set vectorized=False"
            )
        return array.astype(np.float64).reshape(shape)

    def _of_numbers(self, states: tuple[FloatArray, ...], distance: FloatArray, *, trial: bool) -> FloatArray:
        """Call the user's force function separately for each state."""
        numbers = [array.ravel().tolist() for array in states]
        try:
            forces = list(map(self.force, *numbers))
        except ArithmeticError:  # such as an overflow far from the motion
            if not trial:
                raise
            forces = [self._number_or_nan(*state) for state in zip(*numbers, strict=True)]
        if set(map(type, forces)) != {float}:
            for force, at, rate in zip(forces, distance.ravel().tolist(), numbers[2], strict=True):
                array = np.asarray(force)
                if array.shape != () or array.dtype.kind not in "iuf":
                    self._refuse(force, at, rate)
        return np.array(forces, dtype=np.float64).reshape(distance.shape)

    def _number_or_nan(self, *state: float) -> Any:
        try:
            return self.force(*state)
        except ArithmeticError:
            return math.nan

    def _refuse(self, force: Any, distance: float, rate: float) -> None:
        raise InvalidInputError(
            f"force: the custom law {self.kind} returned {force!r}, expected a single finite force in N. Its "
            f"inputs were a distance of {distance:g} m and a rate d ln xi/dt of {rate:g} 1/s"
        )
