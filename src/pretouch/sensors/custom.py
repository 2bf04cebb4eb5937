"""Define a sensor curve by two user-defined functions.

They compute the log output ln xi and its slope g.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from pretouch._core.numbers import FloatArray, finite

from .model import SensorModel


@dataclass(frozen=True, slots=True, kw_only=True)
class CustomSensor(SensorModel):
    """Sensor curve defined by two Python functions.

    They compute the log output ln xi(l) and its slope g(l). Each function maps an array of distances to an array of the
    same shape.

    `check_sensor` checks that g is the derivative of ln xi and that the curve obeys the laws of sensor curves.

    Args:
        log_output_function: ln xi of the distance l [m].
        log_slope_function: g = d ln xi / dl [1/m] of the distance l [m].
        corners: distances [m] at which a higher derivative of ln xi jumps, if any.
        minimum_distance: smallest valid l [m].
        maximum_distance: largest valid l [m].

    Examples:
        >>> gaussian = CustomSensor(
        ...     log_output_function=lambda l: -((l / 0.03) ** 2) - 40 * l,
        ...     log_slope_function=lambda l: -2 * l / 0.03**2 - 40,
        ... )
        >>> round(gaussian.log_slope(0.01), 3)
        -62.222
    """

    log_output_function: Callable[[FloatArray], FloatArray] = field()
    log_slope_function: Callable[[FloatArray], FloatArray] = field()
    corners: tuple[float, ...] = ()

    name: ClassVar[str] = "custom"

    def __post_init__(self) -> None:
        SensorModel.__post_init__(self)
        corners = np.atleast_1d(finite(self.corners, "corners", "m"))
        object.__setattr__(self, "corners", tuple(map(float, corners.ravel())))

    def _knots(self) -> Iterable[float]:
        return self.corners

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(self.log_output_function(distance), dtype=np.float64)

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return np.asarray(self.log_slope_function(distance), dtype=np.float64)
