"""Each curve in the parameters in which it is fitted well, and the way back to those in which it is written.

A curve is pinned in the middle of the window, l_m, where the readings know it best. The inverse power is then
g = -1 / (r + kappa (l - l_m)) with kappa = 1 / n and r = (l_m + l_0) / n, which contains the exponential as kappa -> 0.
"""

# ruff: noqa: D102 - what each method does is said once, in `Family`

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import (
    ExponentialFirstOrder,
    ExponentialSecondOrder,
    InversePower,
    MittagLeffler,
    SensorModel,
    mittag_leffler,
)

_ACCURACY: Final = 1e-9  # of a curve that is fitted

__all__ = ["FAMILIES", "Family", "InversePowerFamily"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Family(ABC):
    """A parametric curve on a window.

    Args:
        first: first distance [m].
        last: last distance [m].
    """

    first: float
    last: float

    name: ClassVar[str] = ""
    parameter_names: ClassVar[tuple[str, ...]] = ()

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

    @abstractmethod
    def sensor(self, u: FloatArray, low: float, high: float) -> SensorModel:
        """Return the sensor, valid on [low, high] in m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InversePowerFamily(Family):
    """u = (ln xi(l_m), ln r_1, kappa), r_1 = -1 / g at the first distance."""

    kappa_max: float = 10.0
    kappa_floor: float = 0.0

    name: ClassVar[str] = "inverse-power"
    parameter_names: ClassVar[tuple[str, ...]] = ("scale", "distance_offset", "exponent")

    @property
    def kappa_min(self) -> float:
        """The smallest 1 / n: below, the curve is an exponential, and its scale would overflow if it were asked for."""
        return self.kappa_floor or next(
            (1 / n for n in (200, 100, 50) if n * abs(math.log(n * self.span)) < 500), 1 / 20
        )

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        reach = math.log(self.span)
        low = [-np.inf, reach - 12, self.kappa_min]
        return np.array(low), np.array([np.inf, reach + 6, self.kappa_max])

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        kappa = min(max(curvature / slope**2, 0.05), 0.9 * self.kappa_max)
        first = max(-1 / slope - kappa * (self.middle - self.first), 0.1 * self.span)
        return np.array([log_middle, math.log(first), kappa])

    def _radius(self, u: FloatArray) -> FloatArray:
        return np.asarray(np.exp(u[..., 1]) + u[..., 2] * (self.middle - self.first))

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        kappa, radius = u[..., 2, None], self._radius(u)[..., None]
        return np.asarray(u[..., 0, None] - np.log1p(kappa * (distance - self.middle) / radius) / kappa)

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        return np.asarray(-1 / (self._radius(u)[..., None] + u[..., 2, None] * (distance - self.middle)))

    def coordinates(self, u: FloatArray) -> FloatArray:
        inverse = float(u[2] / self._radius(u))  # 1 / (l_m + l_0)
        return np.array([u[0] - math.log(inverse) / u[2], math.log(inverse), math.log(u[2])])

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        q = np.asarray(coordinates, dtype=np.float64)
        with np.errstate(over="ignore", divide="ignore"):
            return np.array([np.exp(q[0]), np.exp(-q[1]) - self.middle, np.exp(-q[2])])

    def sensor(self, u: FloatArray, low: float, high: float) -> SensorModel:
        q = self.coordinates(u)
        while abs(q[0]) > 600 and q[2] < 0:  # a nearly constant slope far beyond the window: keep g(l_m), raise kappa
            kappa = 2 * math.exp(q[2])
            radius = float(self._radius(u)) - kappa * (self.middle - self.first)
            u = np.array([u[0], math.log(max(radius, 1e-3 * self.span)), kappa])
            q = self.coordinates(u)
        scale, offset, exponent = (float(p) for p in self.parameters(q))
        return InversePower(
            scale=scale, distance_offset=offset, exponent=exponent, minimum_distance=low, maximum_distance=high
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstOrderFamily(Family):
    """u = (ln xi(l_m), ln -c_1)."""

    name: ClassVar[str] = "exponential-1"
    parameter_names: ClassVar[tuple[str, ...]] = ("scale", "rate")

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
        return np.array([u[0] + math.exp(u[1]) * self.middle, -math.exp(u[1])])

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            return np.array([np.exp(coordinates[0]), coordinates[1]])

    def sensor(self, u: FloatArray, low: float, high: float) -> SensorModel:
        scale, rate = (float(p) for p in self.parameters(self.coordinates(u)))
        return ExponentialFirstOrder(scale=scale, rate=rate, minimum_distance=low, maximum_distance=high)


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOrderFamily(Family):
    """u = (ln xi(l_m), ln -g at the first distance, ln of the ratio of -g at the last to the first distance).

    The curve falls over the whole window whatever u is, and c_2, its slope at l = 0, stays negative by the upper bound.
    """

    name: ClassVar[str] = "exponential-2"
    parameter_names: ClassVar[tuple[str, ...]] = ("scale", "rate", "curvature")

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        reach = -math.log(self.span)
        steepest = math.log(self.last / self.first) - 1e-6 if self.first > 0 else 5.0
        return np.array([-np.inf, reach - 12, -9.0]), np.array([np.inf, reach + 7, min(5.0, steepest)])

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        first = min(slope - curvature * self.span / 2, 0.2 * slope)
        last = min(slope + curvature * self.span / 2, 0.2 * slope)
        return np.array([log_middle, math.log(-first), math.log(last / first)])

    def coordinates(self, u: FloatArray) -> FloatArray:
        first = -np.exp(u[..., 1])
        b = first * np.expm1(u[..., 2]) / (2 * self.span)
        c = first - 2 * b * self.first
        return np.stack([u[..., 0] - (b * self.middle + c) * self.middle, c, b], axis=-1)

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        log_scale, c, b = np.moveaxis(self.coordinates(u), -1, 0)[..., None]
        return np.asarray(log_scale + (b * distance + c) * distance)

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        _, c, b = np.moveaxis(self.coordinates(u), -1, 0)[..., None]
        return np.asarray(2 * b * distance + c)

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            return np.array([np.exp(coordinates[0]), coordinates[1], coordinates[2]])

    def sensor(self, u: FloatArray, low: float, high: float) -> SensorModel:
        scale, rate, curvature = (float(p) for p in self.parameters(self.coordinates(u)))
        return ExponentialSecondOrder(
            scale=scale, rate=rate, curvature=curvature, minimum_distance=low, maximum_distance=high
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class MittagLefflerFamily(Family):
    """u = (ln xi(l_m), ln -c, alpha)."""

    name: ClassVar[str] = "mittag-leffler"
    parameter_names: ClassVar[tuple[str, ...]] = ("scale", "rate", "order")

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        reach = -math.log(self.span)
        return np.array([-np.inf, reach - 6, 0.05]), np.array([np.inf, reach + 6, 1.0])  # beyond, c is lost in a

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        bend = max(curvature, 0.0) * self.span / -slope
        return np.array([log_middle, math.log(-slope * (1 + bend)), 1 / (1 + 0.2 * bend)])

    def _relative(self, u: FloatArray, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ln E_alpha(c l) and its derivative by c l."""
        argument = -np.exp(u[..., 1, None]) * distance
        order = np.minimum(u[..., 2], 1.0).ravel()
        value, derivative = mittag_leffler(order, argument, accuracy=_ACCURACY)
        value = np.clip(value, 1e-300, 1.0)  # trial steps may go where the curve underflows
        return np.log(value), derivative / value

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        relative, _ = self._relative(u, np.append(distance, self.middle))
        return np.asarray(u[..., 0, None] + relative[..., :-1] - relative[..., -1:])

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        return np.asarray(-np.exp(u[..., 1, None]) * self._relative(u, distance)[1])

    def coordinates(self, u: FloatArray) -> FloatArray:
        at_middle, _ = self._relative(u, np.array([self.middle]))
        return np.array([u[0] - float(at_middle[0]), u[1], u[2]])

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            return np.array([np.exp(coordinates[0]), -np.exp(coordinates[1]), coordinates[2]])

    def sensor(self, u: FloatArray, low: float, high: float) -> SensorModel:
        scale, rate, order = (float(p) for p in self.parameters(self.coordinates(u)))
        return MittagLeffler(scale=scale, rate=rate, order=min(order, 1.0), minimum_distance=low, maximum_distance=high)


FAMILIES: dict[str, type[Family]] = {
    family.name: family for family in (FirstOrderFamily, SecondOrderFamily, InversePowerFamily, MittagLefflerFamily)
}
