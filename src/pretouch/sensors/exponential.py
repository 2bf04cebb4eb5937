"""Define exponential sensor curves of first and second order."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

from .family import Family
from .model import SensorModel, parameter
from .sensitivity import CurveSensitivity, CurveSimilarity

_STRAIGHT: Final = 1e-6  # |b_2 / c_2| [1/m] below which the curvature is negligible up to a kilometer
_FEW_DIGITS: Final = 100.0  # largest accepted ratio of two terms to their difference


@dataclass(frozen=True, slots=True, kw_only=True)
class _FirstOrderFamily(Family):
    """Family of first-order exponential sensor curves.

    The fit parameters are u = (ln xi(l_m), ln -c_1), where l_m is the middle of the calibration window.
    """

    compiled: ClassVar[int] = 0

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        reach = -math.log(self.span)
        return np.array([-np.inf, reach - 12]), np.array([np.inf, reach + 7])

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:  # noqa: ARG002
        return np.array([log_middle, math.log(-slope)])

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        return np.asarray(u[..., 0, None] - np.exp(u[..., 1, None]) * (distance - self.middle))

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        return np.asarray(-np.exp(u[..., 1, None]) + np.zeros_like(distance))

    def coordinates(self, u: FloatArray) -> FloatArray:
        rate = np.exp(u[..., 1])
        return np.stack([u[..., 0] + rate * self.middle, -rate], axis=-1)

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            return np.array([np.exp(coordinates[0]), coordinates[1]])


@dataclass(frozen=True, slots=True, kw_only=True)
class _SecondOrderFamily(Family):
    """Family of second-order exponential sensor curves.

    The fit parameters are u = (ln xi(l_m), ln -g at the first distance, ln of the ratio of -g at the last to the first
    distance), where l_m is the middle of the calibration window.

    The curve falls over the whole window for every u. The upper bound of the last parameter keeps c_2, which is the
    slope at l = 0, negative.
    """

    compiled: ClassVar[int] = 1
    informs: ClassVar[bool] = True

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        reach = -math.log(self.span)
        steepest = math.log(self.last / self.first) - 1e-6 if self.first > 0 else 5.0
        return np.array([-np.inf, reach - 12, -9.0]), np.array([np.inf, reach + 7, min(5.0, steepest)])

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        first = min(slope - curvature * self.span / 2, 0.2 * slope)
        last = min(slope + curvature * self.span / 2, 0.2 * slope)
        return np.array([log_middle, math.log(-first), math.log(last / first)])

    def _columns(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        first = -np.exp(u[..., 1])
        b = first * np.expm1(u[..., 2]) / (2 * self.span)
        c = first - 2 * b * self.first
        return u[..., 0] - (b * self.middle + c) * self.middle, c, b

    def coordinates(self, u: FloatArray) -> FloatArray:
        return np.stack(self._columns(u), axis=-1)

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        log_scale, c, b = self._columns(u)
        return np.asarray(log_scale[..., None] + (b[..., None] * distance + c[..., None]) * distance)

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        _, c, b = self._columns(u)
        return np.asarray(2 * b[..., None] * distance + c[..., None])

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            return np.array([np.exp(coordinates[0]), coordinates[1], coordinates[2]])

    def easing(self, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        return low, np.where(np.arange(len(high)) == 2, np.minimum(high, 0.0), high)

    def identifiability_remarks(self, parameters: Mapping[str, Any], slope: Any, *, runaway: bool) -> tuple[str, ...]:  # noqa: ARG002
        if not parameters["curvature"].low <= 0 <= parameters["curvature"].high:
            return ()
        return ("The curvature does not differ significantly from 0, the value of a first-order exponential.",)

    def remarks(self, parameters: Mapping[str, Any], *, at_bound: bool) -> tuple[str, ...]:  # noqa: ARG002
        if not at_bound:
            return ()
        return (
            "The curvature is at its limit; with a larger one the output would rise with the distance in the window.",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialFirstOrder(SensorModel):
    """First-order exponential sensor curve.

    The output is xi = a_1 exp(c_1 l), equation L(5). The slope c_1 is equal at all distances l.

    Args:
        scale: a_1 > 0, in the unit of the output; it does not affect the motion.
        rate: c_1 < 0 [1/m].
        minimum_distance: smallest valid l [m].
        maximum_distance: largest valid l [m].

    Examples:
        >>> ExponentialFirstOrder(scale=0.458, rate=-61.0).constant_log_slope
        -61.0
    """

    scale: float = parameter("a_1", "", sign="positive", example="1.0", of_output="")
    rate: float = parameter("c_1", "1/m", sign="negative", example='"-61 1/m"')

    name: ClassVar[str] = "exponential-1"
    family: ClassVar[type[Family]] = _FirstOrderFamily

    @property
    def constant_log_slope(self) -> float | None:
        """The slope c_1 of the sensor curve [1/m].

        It is equal at all distances.
        """
        return self.rate

    def _sensitivity_to(self, name: str) -> CurveSensitivity | None:
        return {"scale": CurveSensitivity(), "rate": CurveSensitivity(output=1 / self.rate)}.get(name)

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(math.log(self.scale) + self.rate * distance)

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return np.full_like(distance, self.rate)

    def _similarity(
        self,
        values: Mapping[str, FloatArray],
        recess: FloatArray,  # noqa: ARG002
        distance: Any,  # noqa: ARG002
    ) -> CurveSimilarity | None:
        """Return factors that convert first-order exponential curves to one reference curve. They scale the gain."""
        rate = np.asarray(values.get("rate", self.rate))
        if not np.all(rate < 0):
            return None
        return CurveSimilarity(
            curve=replace(self, minimum_distance=0.0, maximum_distance=np.inf),
            length=1.0,
            gain=rate / self.rate,
            parameters={"rate": (0.0, 1 / rate)},
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialSecondOrder(SensorModel):
    """Second-order exponential sensor curve.

    The output is xi = a_2 exp(b_2 l^2 + c_2 l), equation L(6), with the distance l. With b_2 > 0 the output has its
    minimum at the turning point l = -c_2 / (2 b_2). Beyond the turning point, the modeled virtual force would have the
    wrong sign, so the valid range ends at the turning point.

    Args:
        scale: a_2 > 0, in the unit of the output; it does not affect the motion.
        rate: c_2 < 0 [1/m].
        curvature: b_2 [1/m^2], of either sign.
        minimum_distance: smallest valid l [m].
        maximum_distance: largest valid l [m]; at most the turning point.

    Examples:
        >>> sensor = ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)
        >>> round(sensor.turning_point, 5)
        0.07806
    """

    scale: float = parameter("a_2", "", sign="positive", example="1.0", of_output="")
    rate: float = parameter("c_2", "1/m", sign="negative", example='"-61 1/m"')
    curvature: float = parameter("b_2", "1/m^2", example='"474 1/m^2"')

    name: ClassVar[str] = "exponential-2"
    family: ClassVar[type[Family]] = _SecondOrderFamily

    def __post_init__(self) -> None:
        SensorModel.__post_init__(self)
        low, high = self.valid_range
        if not low < high:
            raise InvalidInputError(
                f"minimum_distance: found {self.minimum_distance:g} m, expected less than {self.turning_point:g} "
                "m, the turning point of the curve. Beyond the turning point, the output rises with the distance",
                value=self.minimum_distance,
                limit=self.turning_point,
            )

    @property
    def turning_point(self) -> float:
        """The distance with zero sensor slope [m].

        It is infinite if the curvature b_2 is not positive.
        """
        return -self.rate / (2 * self.curvature) if self.curvature > 0 else math.inf

    @property
    def valid_range(self) -> tuple[float, float]:
        """The smallest and largest valid distance of the curve [m].

        The range ends where the sensor slope is zero.
        """
        low = self.minimum_distance
        if self.curvature < 0:  # the turning point is at l < 0, and the slope is negative beyond it
            low = max(low, -self.rate / (2 * self.curvature))
        return low, min(self.maximum_distance, self.turning_point)

    @property
    def constant_log_slope(self) -> float | None:
        """The constant slope c_2 of the sensor curve [1/m].

        It is None unless the curvature b_2 is 0.
        """
        return self.rate if self.curvature == 0 else None

    def _sensitivity_to(self, name: str) -> CurveSensitivity | None:
        if name == "scale":
            return CurveSensitivity()
        if name == "rate":  # d ln xi/dc = l = (2 ln xi - l g) / c + constant
            return CurveSensitivity(output=2 / self.rate, stretch=-1 / self.rate)
        if name == "curvature" and abs(self.curvature) < _STRAIGHT * abs(self.rate):
            return CurveSensitivity(slope=lambda distance: 2 * distance)
        if name == "curvature":  # l^2 = (l g - ln xi) / b + constant; digits cancel if b l << c
            by_b, nearest = 1 / self.curvature, abs(self.rate / self.curvature) / _FEW_DIGITS
            return CurveSensitivity(output=-by_b, stretch=by_b, slope=lambda distance: 2 * distance, nearest=nearest)
        return None

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(math.log(self.scale) + (self.curvature * distance + self.rate) * distance)

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        # at the turning point the sum may round to just above zero
        return np.asarray(np.minimum(2 * self.curvature * distance + self.rate, 0.0))

    def _similarity(
        self,
        values: Mapping[str, FloatArray],
        recess: FloatArray,
        distance: Any,
    ) -> CurveSimilarity | None:
        """Return factors that convert second-order exponential curves to one reference curve.

        They scale length and gain. The slope g = c + 2 b (l + recess) = 2 b (l - l*) is scaled by lengths s = L* / l*.
        """
        if self.curvature == 0:
            return None
        b = np.asarray(values.get("curvature", self.curvature))
        c = np.asarray(values.get("rate", self.rate)) + 2 * b * recess
        if not (np.all(b * self.curvature > 0) and np.all(c < 0) and np.all(c + 2 * b * np.asarray(distance) < 0)):
            return None
        reference = float(np.median(-c / (2 * b)))  # L*, the turning point of the reference curve
        rate = -2 * self.curvature * reference
        return CurveSimilarity(
            curve=replace(self, rate=rate, minimum_distance=0.0, maximum_distance=np.inf),
            length=reference * (-2 * b / c),
            gain=c / rate,
            parameters={
                "rate": (-1 / c, 1 / c),
                "curvature": (1 / b - 2 * recess / c, 2 * recess / c),
                "recess": (-2 * b / c, 2 * b / c),
            },
        )
