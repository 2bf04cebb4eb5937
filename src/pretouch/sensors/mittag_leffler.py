"""The one-parameter Mittag-Leffler curve, the generalization of the exponential that the letter cites [20]."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite, positive

from .exponential import _negative
from .model import SensorModel, parameter

__all__ = ["MittagLeffler", "mittag_leffler"]

# Weideman & Trefethen (2007), Math. Comp. 76, 1341-1356: on the parabola s(u) = mu (1 + i u)^2 with mu = pi N / 12
# and the step 3 / N, the 2 N nodes of the inverse Laplace transform leave an error of order 2.85^-2N for a function
# that is analytic off the negative real axis. N = 16 is at rounding; more would only amplify that by exp(mu).
_NODES: Final = 16


def mittag_leffler(order: float, argument: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Evaluate E_alpha(z) and its derivative for z <= 0 and 0 < alpha <= 1.

    E_alpha(z) is the inverse Laplace transform of s^(alpha-1) / (s^alpha - z) at time one, and dE_alpha/dz that
    of s^(alpha-1) / (s^alpha - z)^2; both are summed by the trapezoidal rule on a parabola around the branch cut.

    Args:
        order: alpha, in (0, 1].
        argument: z <= 0, any shape.

    Returns:
        E_alpha(z) and dE_alpha/dz, each of the shape of z.
    """
    z = np.asarray(argument, dtype=np.float64)
    if order == 1.0:
        return np.exp(z), np.exp(z)
    step, mu = 3.0 / _NODES, math.pi * _NODES / 12
    node = 1 + 1j * (np.arange(_NODES) + 0.5) * step  # the other half of the nodes is its complex conjugate
    s = mu * node**2
    weight = (mu * step / math.pi) * np.exp(s) * node * s ** (order - 1)
    pole = s**order - z[..., None]
    value = 2 * np.sum((weight / pole).real, axis=-1)
    derivative = 2 * np.sum((weight / pole**2).real, axis=-1)
    return value, derivative


@dataclass(frozen=True, slots=True, kw_only=True)
class MittagLeffler(SensorModel):
    """Mittag-Leffler curve xi = a E_alpha(c l), which is L(5) at alpha = 1 and decays algebraically below it.

    Args:
        scale: a > 0, in the unit of the output; it cancels from the motion.
        rate: c < 0 [1/m].
        order: alpha, in (0, 1].
        minimum_distance: smallest valid l [m], not negative.
        maximum_distance: largest valid l [m].

    Examples:
        >>> round(MittagLeffler(scale=1.0, rate=-60.0, order=0.9).output(0.01), 6)
        0.547465
    """

    scale: float = parameter("a", "")
    rate: float = parameter("c", "1/m")
    order: float = parameter("alpha", "")

    name: ClassVar[str] = "mittag-leffler"

    def __post_init__(self) -> None:
        SensorModel.__post_init__(self)
        positive(self.scale, "scale")
        _negative(self.rate, "rate")
        if not 0 < finite(self.order, "order") <= 1:
            raise InvalidInputError(f"order: found {self.order:g}, which must lie in (0, 1]")
        if self.minimum_distance < 0:
            raise InvalidInputError(
                f"minimum_distance: found {self.minimum_distance:g} m, which must not be negative for this curve"
            )

    @property
    def constant_log_slope(self) -> float | None:
        """The slope c [1/m] where alpha = 1, else None."""
        return self.rate if self.order == 1 else None

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
