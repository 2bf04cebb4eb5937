"""A curve in the parameters in which it is fitted well, and the way back to those in which it is written.

A curve is pinned in the middle of the window, l_m, where the readings know it best.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Self

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

_NO_CURVE: Final = -1e3  # ln xi where parameters make no curve: no fit goes there
_WIDE: Final = 30.0  # of a logarithm, to either side


@dataclass(frozen=True, slots=True, kw_only=True)
class Family(ABC):
    """A parametric curve on a window.

    Args:
        curve: the class of the curve.
        first: first distance [m].
        last: last distance [m].
    """

    curve: Any
    first: float
    last: float

    informs: ClassVar[bool] = False
    """Whether it is one of those over which offset, noise and slope are told: three parameters, of many shapes."""

    quick: ClassVar[bool] = True
    """Whether many fits of it take little time."""

    @classmethod
    def at_large(cls, curve: Any, first: float, last: float) -> Self:
        """Return the family in the widest form in which it may inform."""
        return cls(curve=curve, first=first, last=last)

    @property
    def name(self) -> str:
        """The name of the curve."""
        return str(self.curve.name)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The written parameters, the scale first."""
        return tuple(f.name for f in self.curve._declared())

    @property
    def size(self) -> int:
        """How many parameters there are."""
        return len(self.parameter_names)

    @property
    def middle(self) -> float:
        """The distance l_m [m] at which the curve is pinned."""
        return (self.first + self.last) / 2

    @property
    def span(self) -> float:
        """The length of the window [m]."""
        return self.last - self.first

    @abstractmethod
    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        """Return parameters near a curve of that ln xi, slope and second derivative of ln xi at l_m."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The lower and upper bounds of the parameters."""

    @abstractmethod
    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        """Return ln xi of curves at distances: parameters of shape (..., p), distances (n,), ln xi (..., n)."""

    @abstractmethod
    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        """Return g [1/m] of curves at distances, of the shape of log_output."""

    @abstractmethod
    def coordinates(self, u: FloatArray) -> FloatArray:
        """Return, per written parameter, a function that grows or falls with it and stays finite."""

    @abstractmethod
    def parameters(self, coordinates: FloatArray) -> FloatArray:
        """Return the written parameters of these coordinates, in SI; infinite where they run away."""

    def written(self, u: FloatArray) -> FloatArray:
        """Return the written parameters of a curve, all of them finite."""
        return self.parameters(self.coordinates(u))

    def sensor(self, u: FloatArray, low: float, high: float) -> Any:
        """Return the sensor, valid on [low, high] in m."""
        given = dict(zip(self.parameter_names, map(float, self.written(u)), strict=True))
        return self.curve(**given, minimum_distance=low, maximum_distance=high)

    def easing(self, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return bounds within which no curve gets steeper farther away."""
        return low, high

    def prior(self, u: FloatArray) -> FloatArray:
        """Return what curves cost beforehand, shape (b,), in units of a squared residual."""
        return np.zeros(len(u))

    def runs_away(self, ends: Any) -> bool:  # noqa: ARG002 - for subclasses
        """Tell whether parameters may grow together without bound, by their intervals' ends, and which were reached."""
        return False

    def identifiability_remarks(self, parameters: Mapping[str, Any], slope: Any, *, runaway: bool) -> tuple[str, ...]:  # noqa: ARG002
        """Say which parameters readings cannot tell apart; `slope` is g at l_m, and a runaway is of some together."""
        return ()

    def remarks(self, parameters: Mapping[str, Any], *, at_bound: bool) -> tuple[str, ...]:  # noqa: ARG002
        """Say what a user should know of the parameters that were found, one of them maybe at a bound of the search."""
        return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainFamily(Family):
    """Any curve that says where a fit starts, one at a time, which is slower than a family of its own.

    u = (ln xi(l_m), the other parameters, as logarithms where they have a sign).
    """

    quick: ClassVar[bool] = False

    @property
    def _signs(self) -> list[str]:
        return [f.metadata["sign"] for f in self.curve._declared()[1:]]

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Those of the logarithms are wide, all others have none."""
        ends = np.array([np.inf, *(np.inf if sign == "any" else _WIDE for sign in self._signs)])
        return -ends, ends

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        """Return what the curve says of itself."""
        given = self.curve.fit_start(slope, curvature, self.middle)
        pairs = zip(self.parameter_names[1:], self._signs, strict=True)
        return np.array([log_middle, *(_encoded(float(given[name]), sign) for name, sign in pairs)])

    def _curve(self, u: FloatArray) -> Any:
        """Return the curve with the scale 1; None where there is none."""
        values = [_decoded(float(v), sign) for v, sign in zip(u[1:], self._signs, strict=True)]
        try:
            given = dict(zip(self.parameter_names, [1.0, *values], strict=True))
            return self.curve(**given, minimum_distance=self.first, maximum_distance=self.last)
        except InvalidInputError:
            return None

    def _rows(self, u: FloatArray, distance: FloatArray, method: str) -> FloatArray:
        rows = u.reshape(-1, u.shape[-1])
        places = np.clip(distance, self.first, self.last)
        found = np.full((len(rows), len(places)), _NO_CURVE)
        for i, row in enumerate(rows):
            curve = self._curve(row)
            if curve is not None:
                own = getattr(curve, method)(places)
                level = 0.0 if method == "log_slope" else row[0] - curve.log_output(self.middle)
                found[i] = own + level
        return found.reshape(*u.shape[:-1], len(places))

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        """Return ln xi, row by row."""
        return self._rows(u, distance, "log_output")

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        """Return g [1/m], row by row."""
        return self._rows(u, distance, "log_slope")

    def coordinates(self, u: FloatArray) -> FloatArray:
        """Return ln scale, and the others as they are."""
        curve = self._curve(u)
        level = 0.0 if curve is None else float(curve.log_output(self.middle))
        return np.array([u[0] - level, *u[1:]])

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        """Return the written parameters."""
        with np.errstate(over="ignore"):
            values = [_decoded(float(v), sign) for v, sign in zip(coordinates[1:], self._signs, strict=True)]
            return np.array([np.exp(coordinates[0]), *values])


def _encoded(value: float, sign: str) -> float:
    return value if sign == "any" else math.log(abs(value))


def _decoded(value: float, sign: str) -> float:
    if sign == "any":
        return value
    size = math.exp(min(value, 700.0))
    return size if sign == "positive" else -size
