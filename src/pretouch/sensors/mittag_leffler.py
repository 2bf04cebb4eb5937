"""Define the Mittag-Leffler sensor curve, a generalization of the exponential curve."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import FloatArray

from .family import Family
from .model import SensorModel, parameter
from .sensitivity import CurveSensitivity

_ACCURACY: Final = 1e-9  # relative, sufficient for a fit

_evaluate: Final = kernel("mittag_leffler", POINTER, INTEGER, POINTER, INTEGER, DOUBLE, POINTER, POINTER)


def mittag_leffler(
    order: float | FloatArray, argument: FloatArray, *, accuracy: float = 1e-13
) -> tuple[FloatArray, FloatArray]:
    """Evaluate the Mittag-Leffler function E_alpha(z) and its derivative.

    The function is evaluated for z <= 0 and 0 < alpha <= 1. With the default accuracy, the relative error is about
    1e-13.

    Args:
        order: alpha, in (0, 1]; or one order for each row of the arguments, shape (b,).
        argument: z <= 0, any shape; shape (b, n) for several orders.
        accuracy: largest allowed relative error; a larger value avoids the slower of two algorithms more often.

    Returns:
        E_alpha(z) and dE_alpha/dz, each of the shape of z.

    Raises:
        InvalidInputError: an order lies outside (0, 1], or an argument is positive or no number.

    Examples:
        >>> value, derivative = mittag_leffler(0.5, np.array(-1.0))
        >>> round(float(value), 12), round(float(derivative), 12)
        (0.427583576156, 0.273212014784)
    """
    z, orders = np.asarray(argument, dtype=np.float64), np.atleast_1d(np.asarray(order, dtype=np.float64))
    if not ((orders > 0) & (orders <= 1)).all():
        wrong = orders[~((orders > 0) & (orders <= 1))][0]
        raise InvalidInputError(f"order: found {wrong:g}, which must lie in (0, 1]", value=wrong)
    if not (z <= 0).all():
        raise InvalidInputError(
            f"argument: found {float(z[~(z <= 0)].flat[0]):g}, but this function is defined only for 0 and negative "
            "numbers"
        )
    rows = np.ascontiguousarray(z.reshape(len(orders), -1))
    orders, value, derivative = np.ascontiguousarray(orders), np.empty_like(rows), np.empty_like(rows)
    outputs = address(value), address(derivative)
    _evaluate(address(orders), len(orders), address(rows), rows.shape[1], accuracy, *outputs)
    exponential = orders == 1
    value[exponential] = derivative[exponential] = np.exp(rows[exponential])  # the same bits as NumPy
    return value.reshape(z.shape), derivative.reshape(z.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class _MittagLefflerFamily(Family):
    """Family of Mittag-Leffler sensor curves.

    The fit parameters are u = (ln xi(l_m), ln -c, alpha), where l_m is the middle of the calibration window.
    """

    compiled: ClassVar[int] = 3
    informs: ClassVar[bool] = True
    quick: ClassVar[bool] = False

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        reach = -math.log(self.span)
        # outside these bounds, rate and scale cannot be identified
        return np.array([-np.inf, reach - 6, 0.05]), np.array([np.inf, reach + 6, 1.0])

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        bend = max(curvature, 0.0) * self.span / -slope
        return np.array([log_middle, math.log(-slope * (1 + bend)), 1 / (1 + 0.2 * bend)])

    def _relative(self, u: FloatArray, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the logarithm of the Mittag-Leffler function. Also return the derivative of this logarithm."""
        argument = -np.exp(u[..., 1, None]) * distance
        order = np.minimum(u[..., 2], 1.0).ravel()
        value, derivative = mittag_leffler(order, argument, accuracy=_ACCURACY)
        value = np.clip(value, 1e-300, 1.0)  # the curve may underflow at trial steps
        return np.log(value), derivative / value

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        relative, _ = self._relative(u, np.append(distance, self.middle))
        return np.asarray(u[..., 0, None] + relative[..., :-1] - relative[..., -1:])

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        return np.asarray(-np.exp(u[..., 1, None]) * self._relative(u, distance)[1])

    def coordinates(self, u: FloatArray) -> FloatArray:
        at_middle, _ = self._relative(u, np.array([self.middle]))
        return np.concatenate([u[..., :1] - at_middle, u[..., 1:]], axis=-1)

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            return np.array([np.exp(coordinates[0]), -np.exp(coordinates[1]), coordinates[2]])

    def written(self, u: FloatArray) -> FloatArray:
        scale, rate, order = self.parameters(self.coordinates(u))
        return np.array([scale, rate, min(order, 1.0)])

    def identifiability_remarks(self, parameters: Mapping[str, Any], slope: Any, *, runaway: bool) -> tuple[str, ...]:  # noqa: ARG002
        order = parameters["order"]
        if order.high < 1:
            return ()
        return (
            f"The fitted order does not differ significantly from 1 (95 % interval from {order.low:.3g} to 1). "
            "A curve of order 1 is a first-order exponential curve.",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class MittagLeffler(SensorModel):
    """Sensor curve given by the Mittag-Leffler function.

    The output is xi = a E_alpha(c l), a generalization of the exponential curve of equation L(5). For alpha < 1 the
    curve decays algebraically.

    Args:
        scale: a > 0, in the unit of the output; it does not affect the motion.
        rate: c < 0 [1/m].
        order: alpha, in (0, 1].
        minimum_distance: smallest valid l [m], not negative.
        maximum_distance: largest valid l [m].

    Examples:
        >>> round(MittagLeffler(scale=1.0, rate=-60.0, order=0.9).output(0.01), 6)
        0.547465
    """

    scale: float = parameter("a", "", sign="positive", example="1.0", of_output="")
    rate: float = parameter("c", "1/m", sign="negative", example='"-61 1/m"')
    order: float = parameter("alpha", "", sign="positive", example="0.9", largest=1.0)

    name: ClassVar[str] = "mittag-leffler"
    family: ClassVar[type[Family]] = _MittagLefflerFamily

    def __post_init__(self) -> None:
        SensorModel.__post_init__(self)
        if self.minimum_distance < 0:
            raise InvalidInputError(
                f"minimum_distance: found {self.minimum_distance:g} m, but the Mittag-Leffler curve cannot start "
                "at a negative distance",
                value=self.minimum_distance,
            )

    @property
    def constant_log_slope(self) -> float | None:
        """The constant slope c of the sensor curve [1/m].

        It is None unless the order alpha is 1.
        """
        return self.rate if self.order == 1 else None

    def _sensitivity_to(self, name: str) -> CurveSensitivity | None:
        return {"scale": CurveSensitivity(), "rate": CurveSensitivity(stretch=1 / self.rate)}.get(name)

    def _log_output(self, distance: FloatArray) -> FloatArray:
        if self.order == 1:
            return np.asarray(math.log(self.scale) + self.rate * distance)
        value, _ = mittag_leffler(self.order, self.rate * distance)
        return np.asarray(math.log(self.scale) + np.log(value))

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        if self.order == 1:
            return np.full_like(distance, self.rate)
        value, derivative = mittag_leffler(self.order, self.rate * distance)
        return np.asarray(self.rate * derivative / value)
