"""Map gains to a search coordinate.

The coordinate is logarithmic far from zero and linear around zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, finite
from pretouch._core.units import pretty_unit
from pretouch.motion import LawNumber

from .jumps import RESERVE

_ROUNDING = 16 * np.finfo(np.float64).eps  # relative rounding of u: sinh(asinh) is exact to 4 units on every processor

_AT_END = 1e-9  # distance from a bound, as a share of the range of u, within which u counts as the bound


@dataclass(frozen=True, slots=True, kw_only=True)
class GainAxis:
    """The search variable of a gain design.

    It is linear for weak gains, and logarithmic for strong gains. The coordinate is u = asinh(gain / s) with a gain s.

    A gain is the law's number, such as D_p [N s].

    Args:
        low: lower bound of the gain.
        high: upper bound of the gain.
    """

    low: float
    high: float

    @classmethod
    def between(cls, bounds: Sequence[float], number: LawNumber | None = None) -> GainAxis:
        """Make the search variable for gains between two bounds.

        Returns:
            The search variable.

        Raises:
            InvalidInputError: the bounds are not in ascending order, or all gains between them are not mitigating.
        """
        unit = "N*s" if number is None else number.unit
        low, high = bounds
        low, high = finite(low, "bounds", unit), finite(high, "bounds", unit)
        if not low < high:
            raise InvalidInputError(
                f"bounds: found [{low:g}, {high:g}] {unit}, expected two gains in ascending order",
                value=(low, high),
            )
        if number is not None and max(number.sign * low, number.sign * high) <= 0:
            shown = pretty_unit(unit)
            raise InvalidInputError(
                f"bounds: no {number.name} from {low:g} to {high:g} {shown} mitigates the impact. "
                f"The sign of a mitigating {number.name} is {number.mitigating}. Did you mean "
                f"{0.0 - high:g} to {0.0 - low:g} {shown}?",
                value=(low, high),
                limit=(0.0 - high, 0.0 - low),
            )
        return cls(low=low, high=high)

    @property
    def scale(self) -> float:
        """The magnitude of the gain above which the search variable is logarithmic.

        The search variable is linear for weaker gains.
        """
        small, large = sorted((abs(self.low), abs(self.high)))
        return small if self.low * self.high > 0 else 1e-3 * large

    @property
    def ends(self) -> tuple[float, float]:
        """The two bounds of the gain, the lower bound first."""
        return self.low, self.high

    @property
    def span(self) -> tuple[float, float]:
        """The bounds of the gain, converted to the search variable.

        The lower bound comes first.
        """
        low, high = self.coordinate(np.array(self.ends))
        return float(low), float(high)

    def coordinate(self, gain: FloatArray | float) -> FloatArray:
        """Convert a gain to the search variable."""
        return np.asarray(np.arcsinh(np.asarray(gain) / self.scale))

    def gain(self, coordinate: FloatArray | float) -> FloatArray:
        """Convert a value of the search variable to a gain.

        It is exactly a bound if the coordinate is that of the bound up to rounding.

        Returns:
            The gain, which never lies outside the bounds.
        """
        gain = np.clip(self.scale * np.sinh(coordinate), self.low, self.high)
        for bound, end in zip(self.ends, self.span, strict=True):
            gain = np.where(np.abs(coordinate - end) <= _ROUNDING * max(1.0, abs(end)), bound, gain)
        return gain

    def is_end(self, coordinate: FloatArray | float) -> BoolArray:
        """Return True for search values that equal a bound of the gain."""
        low, high = self.span
        return np.asarray(np.minimum(np.abs(coordinate - low), np.abs(coordinate - high)) <= _AT_END * (high - low))

    def reserve(self, coordinate: float) -> float:
        """Return the distance in u that stands for the reserve of a gain from a jump."""
        gain = float(self.gain(coordinate))
        return RESERVE * abs(gain) / self.stretch(gain)

    def stretch(self, gain: float) -> float:
        """Return the derivative of the gain with respect to the search variable."""
        return math.hypot(gain, self.scale)
