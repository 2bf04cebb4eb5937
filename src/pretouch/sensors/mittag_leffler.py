"""Define the Mittag-Leffler sensor curve, a generalization of the exponential curve."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray

from .family import Family
from .model import SensorModel, parameter
from .sensitivity import CurveSensitivity

# Weideman & Trefethen (2007), Math. Comp. 76, 1341-1356: the inverse Laplace transform is evaluated at 2 N nodes on the
# parabola s(u) = mu (1 + i u)^2 with mu = pi N / 12 and the step 3 / N. Its error is of order 2.85^-2N for a function
# that is analytic off the negative real axis. With N = 18 the relative error of the derivative at zero, which converges
# most slowly, is 1e-14. A larger N would only amplify rounding by exp(mu).
_NODES: Final = 18
_STEP_S: Final = 3.0 / _NODES
_MU: Final = math.pi * _NODES / 12
_NODE: Final = 1 + 1j * (np.arange(_NODES) + 0.5) * _STEP_S
_LOG_S: Final = np.log(_MU * _NODE**2)
_WEIGHT: Final = (2 * _MU * _STEP_S / math.pi) * np.exp(_MU * _NODE**2) * _NODE / (_MU * _NODE**2)
# The absolute rounding error of the sum on the parabola is constant, while E falls like exp(z). For orders near one and
# large |z|, an integral of positive terms over a line (variable v) is used instead. The poles of its integrand at
# |Im v| = pi (1 - alpha) lie inside the strip |Im v| <= d = alpha pi / 2 only for alpha > 2 / 3.
_NEAR_ONE: Final = 0.68  # order above which the integral over the line is used
_ROUNDING: Final = 1e-13 / math.e  # absolute error of the sum on the parabola; the relative error of E(-1) is 1e-13
_STEP: Final = 0.15  # step on the line; the error exp(-2 pi d / step) is below 1e-19, as the integrand is bounded there
_ROUGH: Final = 1e-11  # accuracy from which on a larger step suffices
_ROUGH_STEP: Final = 0.2  # its error is below 3e-15 of the integral
_ACCURACY: Final = 1e-9  # relative, sufficient for a fit
_CHUNK: Final = 1024  # arguments per call, to limit memory, since each needs about 350 nodes


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
    rows = z.reshape(len(orders), -1)
    value, derivative = np.empty_like(rows), np.empty_like(rows)
    count = max(1, _CHUNK // max(rows.shape[1], 1))
    for top in range(0, len(rows), count):
        for left in range(0, rows.shape[1], _CHUNK):
            part = np.s_[top : top + count, left : left + _CHUNK]
            value[part], derivative[part] = _on_parabola(orders[top : top + count, None, None], rows[part])
    far = (rows < -math.log(accuracy / _ROUNDING)) & (orders > _NEAR_ONE)[:, None]
    if far.any():
        row, column = np.nonzero(far)
        for start in range(0, len(row), _CHUNK):
            i, k = row[start : start + _CHUNK], column[start : start + _CHUNK]
            value[i, k], derivative[i, k] = _on_line(orders, i, rows[i, k], accuracy)
    exponential = orders == 1
    value[exponential] = derivative[exponential] = np.exp(rows[exponential])
    return value.reshape(z.shape), derivative.reshape(z.shape)


def _on_parabola(order: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the Mittag-Leffler function and its derivative by an inverse Laplace transform along a parabola.

    The sum inverts s^(alpha-1) / (s^alpha - z) at time one, and its derivative by z. Orders have the shape (b, 1, 1),
    arguments (b, n). Half of the nodes suffice; the others are complex conjugates.
    """
    pole = np.exp(_LOG_S * order)  # s^alpha
    weight = _WEIGHT * pole
    along, aside = pole.real - z[..., None], pole.imag
    size = 1 / (along * along + aside * aside)
    real, imaginary = along * size, -aside * size  # of 1 / (s^alpha - z)
    a, b = weight.real[..., 0, :, None], weight.imag[..., 0, :, None]
    value = (real @ a - imaginary @ b)[..., 0]
    square, twice = real * real - imaginary * imaginary, 2 * real * imaginary
    return value, (square @ a - twice @ b)[..., 0]


def _on_line(orders: FloatArray, row: IntArray, z: FloatArray, accuracy: float) -> tuple[FloatArray, FloatArray]:
    """Return small values of the Mittag-Leffler function and its derivative accurately, from an integral.

    `row` has the index of the order of each argument z, in increasing order.

    E_alpha(-x) = sin(delta) / (pi alpha) int exp(-(x e^v)^(1/alpha)) / (2 (cosh v - cos delta)) dv. This is the
    transform on its branch cut at r = (x e^v)^(1/alpha), with delta = pi (1 - alpha). All terms are positive, so the
    sum keeps its relative accuracy for any small E. The trapezoidal rule at half-integers has an error due to the poles
    at v = +-i delta: their residues over 1 + exp(2 pi delta / step), which are added. At alpha = 1 only the residues
    remain, exp(-x).
    """
    starts = np.diff(row, prepend=-1) > 0
    order, row = orders[row[starts], None], np.cumsum(starts) - 1
    delta = math.pi * (1 - order)
    exact = accuracy < _ROUGH
    step, lowest = (_STEP, 1e-17) if exact else (_ROUGH_STEP, 1e-6 * accuracy)
    # below, e^v < lowest / x; above, exp(-750) = 0
    left, right = math.log(lowest) - math.log(-z.min()), float(order.max()) * math.log(750)
    v = step * (np.arange(math.floor(left / step), math.ceil(right / step)) + 0.5)
    weight = step * np.sin(delta) / (math.pi * order) / (4 * (np.sinh(v / 2) ** 2 + np.sin(delta / 2) ** 2))
    root, turn = np.exp(v / order), np.exp(1j * delta / order)[row, 0]
    order, delta = order[row, 0], delta[row, 0]
    power = (-z) ** (1 / order)
    decay = np.exp(-power[:, None] * root[row])
    residue = 2 / order / (1 + np.exp(2 * math.pi * delta / step)) * np.exp(-power * turn)
    value = np.einsum("mv,mv->m", decay, weight[row]) + residue.real
    slope = np.einsum("mv,mv->m", decay, (weight * root)[row]) + (residue * turn).real
    return value, slope * power / (-z * order)


@dataclass(frozen=True, slots=True, kw_only=True)
class _MittagLefflerFamily(Family):
    """Family of Mittag-Leffler sensor curves.

    The fit parameters are u = (ln xi(l_m), ln -c, alpha), where l_m is the middle of the calibration window.
    """

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
