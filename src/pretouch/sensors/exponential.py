"""The exponential curves with a first-order L(5) and a second-order L(6) polynomial in the exponent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite, positive

from .change import CurveChange
from .model import SensorModel, parameter

__all__ = ["ExponentialFirstOrder", "ExponentialSecondOrder"]

_STRAIGHT: Final = 1e-6  # curvature over rate [1/m] that is not felt in a kilometer
_FEW_DIGITS: Final = 100.0  # how many times itself a difference of terms may be


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialFirstOrder(SensorModel):
    """First-order exponential curve xi = a_1 exp(c_1 l), L(5): the one with a constant slope.

    Args:
        scale: a_1 > 0, in the unit of the output; it cancels from the motion.
        rate: c_1 < 0 [1/m].
        minimum_distance: smallest valid l [m].
        maximum_distance: largest valid l [m].

    Examples:
        >>> ExponentialFirstOrder(scale=0.458, rate=-61.0).constant_log_slope
        -61.0
    """

    scale: float = parameter("a_1", "")
    rate: float = parameter("c_1", "1/m")

    name: ClassVar[str] = "exponential-1"

    def __post_init__(self) -> None:
        SensorModel.__post_init__(self)
        positive(self.scale, "scale")
        _negative(self.rate, "rate")

    @property
    def constant_log_slope(self) -> float | None:
        """The slope c_1 [1/m], the same at every distance."""
        return self.rate

    def _change_by(self, name: str) -> CurveChange | None:
        return {"scale": CurveChange(), "rate": CurveChange(output=1 / self.rate)}.get(name)

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(math.log(self.scale) + self.rate * distance)

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return np.full_like(distance, self.rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialSecondOrder(SensorModel):
    """Second-order exponential curve xi = a_2 exp(b_2 l^2 + c_2 l), L(6).

    With b_2 > 0 the curve turns around at l = -c_2 / (2 b_2): beyond it the modelled virtual force has the wrong
    sign, so the valid range ends there.

    Args:
        scale: a_2 > 0, in the unit of the output; it cancels from the motion.
        rate: c_2 < 0 [1/m].
        curvature: b_2 [1/m^2], of either sign.
        minimum_distance: smallest valid l [m].
        maximum_distance: largest valid l [m]; the turning point, where that is nearer.

    Examples:
        >>> sensor = ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)
        >>> round(sensor.turning_point, 5)
        0.07806
    """

    scale: float = parameter("a_2", "")
    rate: float = parameter("c_2", "1/m")
    curvature: float = parameter("b_2", "1/m^2")

    name: ClassVar[str] = "exponential-2"

    def __post_init__(self) -> None:
        SensorModel.__post_init__(self)
        positive(self.scale, "scale")
        _negative(self.rate, "rate")
        finite(self.curvature, "curvature", "1/m^2")
        low, high = self.valid_range
        if not low < high:
            raise InvalidInputError(
                f"minimum_distance: found {self.minimum_distance:g} m, which must lie below the turning point of "
                f"the curve at {self.turning_point:g} m, beyond which its slope has the wrong sign"
            )

    @property
    def turning_point(self) -> float:
        """The distance -c_2 / (2 b_2) [m] at which the slope vanishes; infinite where b_2 <= 0."""
        return -self.rate / (2 * self.curvature) if self.curvature > 0 else math.inf

    @property
    def valid_range(self) -> tuple[float, float]:
        """The distances [l_min, l_max] in m between which the curve holds, never beyond the turning point."""
        low = self.minimum_distance
        if self.curvature < 0:  # the slope is negative beyond the turning point, which lies at l < 0
            low = max(low, -self.rate / (2 * self.curvature))
        return low, min(self.maximum_distance, self.turning_point)

    @property
    def constant_log_slope(self) -> float | None:
        """The slope c_2 [1/m] where b_2 = 0, else None."""
        return self.rate if self.curvature == 0 else None

    def _change_by(self, name: str) -> CurveChange | None:
        if name == "scale":
            return CurveChange()
        if name == "rate":  # d ln xi/dc = l = (2 ln xi - l g) / c + constant
            return CurveChange(output=2 / self.rate, stretch=-1 / self.rate)
        if name == "curvature" and abs(self.curvature) < _STRAIGHT * abs(self.rate):
            return CurveChange(slope=lambda distance: 2 * distance)
        if name == "curvature":  # l^2 = (l g - ln xi) / b + constant, which cancels where b l is small beside c
            by_b, nearest = 1 / self.curvature, abs(self.rate / self.curvature) / _FEW_DIGITS
            return CurveChange(output=-by_b, stretch=by_b, slope=lambda distance: 2 * distance, nearest=nearest)
        return None

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(math.log(self.scale) + (self.curvature * distance + self.rate) * distance)

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        # at the turning point the sum may round to just above zero
        return np.asarray(np.minimum(2 * self.curvature * distance + self.rate, 0.0))


def _negative(value: float, name: str) -> None:
    checked = finite(value, name, "1/m")
    if not checked < 0:
        raise InvalidInputError(
            f"{name}: found {checked:g} 1/m, which must be negative: the output grows as the object comes near"
        )
