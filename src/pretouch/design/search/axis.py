"""The coordinate in which gains are searched, with its bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, finite

__all__ = ["GainAxis"]

_ROUNDING = 16 * np.finfo(np.float64).eps  # of u: its inverse function is good to 4 units by whichever processor

_AT_END = 1e-9  # of the range of u


@dataclass(frozen=True, slots=True, kw_only=True)
class GainAxis:
    """The coordinate u = asinh(D_p / s) in which gains are searched: logarithmic far from zero, linear through it.

    Args:
        low: lower bound of the gain [N s].
        high: upper bound of the gain [N s].
    """

    low: float
    high: float

    @classmethod
    def between(cls, bounds: Sequence[float]) -> GainAxis:
        """Make the axis between two bounds [N s], and refuse what is no interval."""
        low, high = bounds
        low, high = finite(low, "bounds", "N*s"), finite(high, "bounds", "N*s")
        if not low < high:
            raise InvalidInputError(f"bounds: found [{low:g}, {high:g}] N*s, expected the smaller gain first")
        return cls(low=low, high=high)

    @property
    def scale(self) -> float:
        """The gain s [N s] around which the axis goes over from linear to logarithmic."""
        small, large = sorted((abs(self.low), abs(self.high)))
        return small if self.low * self.high > 0 else 1e-3 * large

    @property
    def ends(self) -> tuple[float, float]:
        """Both bounds [N s], the lower one first."""
        return self.low, self.high

    @property
    def span(self) -> tuple[float, float]:
        """The coordinates of both bounds."""
        low, high = self.coordinate(np.array(self.ends))
        return float(low), float(high)

    def coordinate(self, gain: FloatArray | float) -> FloatArray:
        """Return u of a gain [N s]."""
        return np.asarray(np.arcsinh(np.asarray(gain) / self.scale))

    def gain(self, coordinate: FloatArray | float) -> FloatArray:
        """Return the gain [N s] at u: a bound itself where u is that bound's to rounding, never one outside."""
        gain = np.clip(self.scale * np.sinh(coordinate), self.low, self.high)
        for bound, end in zip(self.ends, self.span, strict=True):
            gain = np.where(np.abs(coordinate - end) <= _ROUNDING * max(1.0, abs(end)), bound, gain)
        return gain

    def is_end(self, coordinate: FloatArray | float) -> BoolArray:
        """Tell which u are those of a bound, to 1e-9 of the range."""
        low, high = self.span
        return np.asarray(np.minimum(np.abs(coordinate - low), np.abs(coordinate - high)) <= _AT_END * (high - low))

    def stretch(self, gain: float) -> float:
        """Return d D_p / du [N s] at a gain."""
        return math.hypot(gain, self.scale)
