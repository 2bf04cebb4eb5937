"""Describe families of sensor curves by parameters that suit a numerical fit.

The first fit parameter is ln xi in the middle of the calibration window, l_m, where the readings determine it best.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Final, Self

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

_NO_CURVE: Final = -1e3  # ln xi for invalid parameters; it is so far from any reading that no fit goes there
_WIDE: Final = 30.0  # bound of the logarithm of a parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class Family(ABC):
    """Base class of families of sensor curves.

    The parameters of a family suit a numerical fit.

    Args:
        curve: the class of the curve.
        first: first distance of the window [m].
        last: last distance of the window [m].
    """

    curve: Any
    first: float
    last: float

    informs: ClassVar[bool] = False
    """Whether offset, noise and slope are estimated with the family, because its three parameters allow many shapes."""

    quick: ClassVar[bool] = True
    """Whether many fits of the family take little time."""

    compiled: ClassVar[int] = -1
    """Number of the family in native/core/curve_fits.cpp; -1 for a family that is evaluated in Python. A subclass with
    other curves does not inherit it."""

    @classmethod
    def at_large(cls, curve: Any, first: float, last: float) -> Self:
        """Create the curve family with the widest parameter bounds."""
        return cls(curve=curve, first=first, last=last)

    @property
    def name(self) -> str:
        """The name of the kind of sensor curve, such as `inverse-power`."""
        return str(self.curve.name)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The names of the sensor curve's own parameters, with the scale first."""
        return tuple(f.name for f in self.curve._declared())

    @property
    def size(self) -> int:
        """The number of fit parameters of the curve family."""
        return _count_parameters(self.curve)

    @property
    def number(self) -> int:
        """The number of the family in the compiled core; -1 if it is evaluated in Python."""
        return int(vars(type(self)).get("compiled", -1))

    @property
    def middle(self) -> float:
        """The distance [m] at the middle of the calibrated range."""
        return (self.first + self.last) / 2

    @property
    def span(self) -> float:
        """The length of the calibrated distance range [m]."""
        return self.last - self.first

    @abstractmethod
    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        """Return initial parameters for a curve fit.

        Log output, slope and curvature are given in the middle of the range.
        """

    @property
    @abstractmethod
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The lower and upper bounds of the fit parameters."""

    @abstractmethod
    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        """Return the log outputs of several sensor curves.

        They are ln xi at several distances [m]. Parameters of shape (..., p) and distances of shape (n,) give the shape
        (..., n).
        """

    @abstractmethod
    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        """Return the slopes of several sensor curves [1/m].

        They are g at several distances [m]. The shape is that of `log_output`.
        """

    @abstractmethod
    def coordinates(self, u: FloatArray) -> FloatArray:
        """Transform fit parameters to numbers that are always finite.

        Examples are logarithms. Each is a monotonic function of one of the curve's own parameters. Parameters of shape
        (..., p) give coordinates of the same shape.
        """

    @abstractmethod
    def parameters(self, coordinates: FloatArray) -> FloatArray:
        """Convert transformed fit parameters to curve parameters.

        Curve parameters are in SI units, and may be infinite.
        """

    def written(self, u: FloatArray) -> FloatArray:
        """Convert fit parameters to the sensor curve's own parameters in SI units."""
        return self.parameters(self.coordinates(u))

    def sensor(self, u: FloatArray, low: float, high: float) -> Any:
        """Return the sensor curve with given fit parameters.

        It is valid between two distances [m].
        """
        parameters = dict(zip(self.parameter_names, map(float, self.written(u)), strict=True))
        return self.curve(**parameters, minimum_distance=low, maximum_distance=high)

    def easing(self, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return parameter bounds that keep the slope from steepening with distance."""
        return low, high

    def prior(self, u: FloatArray) -> FloatArray:
        """Return an extra fit cost for implausible parameters.

        The cost expresses prior knowledge. Each curve has one cost, in units of a squared residual.
        """
        return np.zeros(len(u))

    def runs_away(self, ends: Any) -> bool:  # noqa: ARG002 - for subclasses
        """Return True if fit parameters can grow without limit.

        Then several parameters can grow together within their confidence intervals.
        """
        return False

    def identifiability_remarks(self, parameters: Mapping[str, Any], slope: Any, *, runaway: bool) -> tuple[str, ...]:  # noqa: ARG002
        """Return remarks on parameters that the sensor readings do not determine.

        With `runaway`, some parameters diverge.
        """
        return ()

    def remarks(self, parameters: Mapping[str, Any], *, at_bound: bool) -> tuple[str, ...]:  # noqa: ARG002
        """Return remarks on the fitted parameters.

        For example, a parameter reached its bound.
        """
        return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainFamily(Family):
    """Curve family for any class with a method `fit_start`.

    The curves are evaluated one at a time. u = (ln xi(l_m), the other parameters; those with a prescribed sign as
    logarithms of their magnitudes).
    """

    quick: ClassVar[bool] = False

    @property
    def _signs(self) -> list[str]:
        return [f.metadata["sign"] for f in self.curve._declared()[1:]]

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The bounds of the fit parameters.

        They are wide for parameters of prescribed sign, and infinite for all others.
        """
        ends = np.array([np.inf, *(np.inf if sign == "any" else _WIDE for sign in self._signs)])
        return -ends, ends

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        """Return the start parameters of the sensor curve.

        The curve defines them by its method `fit_start`.
        """
        start = self.curve.fit_start(slope, curvature, self.middle)
        pairs = zip(self.parameter_names[1:], self._signs, strict=True)
        return np.array([log_middle, *(_encoded(float(start[name]), sign) for name, sign in pairs)])

    def _curve(self, u: FloatArray) -> Any:
        """Return the curve of scale 1 with given fit parameters; None if they are invalid."""
        values = [_decoded(float(v), sign) for v, sign in zip(u[1:], self._signs, strict=True)]
        try:
            parameters = dict(zip(self.parameter_names, [1.0, *values], strict=True))
            return self.curve(**parameters, minimum_distance=self.first, maximum_distance=self.last)
        except InvalidInputError:
            return None

    def _rows(self, u: FloatArray, distance: FloatArray, method: str) -> FloatArray:
        rows = u.reshape(-1, u.shape[-1])
        places = np.clip(distance, self.first, self.last)
        result = np.full((len(rows), len(places)), _NO_CURVE)
        for i, row in enumerate(rows):
            curve = self._curve(row)
            if curve is not None:
                values = getattr(curve, method)(places)
                level = 0.0 if method == "log_slope" else row[0] - curve.log_output(self.middle)
                result[i] = values + level
        return result.reshape(*u.shape[:-1], len(places))

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        """Return the log outputs of several sensor curves.

        The curves are evaluated one at a time.
        """
        return self._rows(u, distance, "log_output")

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        """Return the slopes of several sensor curves [1/m].

        The curves are evaluated one at a time.
        """
        return self._rows(u, distance, "log_slope")

    def coordinates(self, u: FloatArray) -> FloatArray:
        """Replace the first fit parameter by the logarithmic scale."""
        curves = [self._curve(row) for row in u.reshape(-1, u.shape[-1])]
        levels = [0.0 if curve is None else float(curve.log_output(self.middle)) for curve in curves]
        return np.concatenate([u[..., :1] - np.reshape(levels, (*u.shape[:-1], 1)), u[..., 1:]], axis=-1)

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        """Convert transformed fit parameters to the sensor curve's own parameters."""
        with np.errstate(over="ignore"):
            values = [_decoded(float(v), sign) for v, sign in zip(coordinates[1:], self._signs, strict=True)]
            return np.array([np.exp(coordinates[0]), *values])


@cache
def _count_parameters(curve: Any) -> int:
    return len(curve._declared())


def _encoded(value: float, sign: str) -> float:
    return value if sign == "any" else math.log(abs(value))


def _decoded(value: float, sign: str) -> float:
    if sign == "any":
        return value
    size = math.exp(min(value, 700.0))
    return size if sign == "positive" else -size
