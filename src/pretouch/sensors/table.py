"""Define sensor curves that interpolate measured points."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite, positive

from .model import SensorModel, _limit


@dataclass(frozen=True, slots=True, kw_only=True)
class Table(SensorModel):
    """Sensor curve through measured points.

    The log output is interpolated by a monotone piecewise cubic. The interpolant (Fritsch and Butland 1984, SciPy's
    `PchipInterpolator`) has a continuous slope g, and falls with the distance like the table. The curve is valid
    between the first and the last distance of the table.

    Args:
        distances: l of the points [m], at least two, strictly increasing.
        outputs: xi of the points > 0, strictly decreasing, in the unit of the calibration.
        minimum_distance: smallest valid l [m]; at least the first distance.
        maximum_distance: largest valid l [m]; at most the last distance.

    Examples:
        >>> sensor = Table(distances=(0.0, 0.01, 0.02), outputs=(4.0, 2.0, 1.0))
        >>> round(sensor.output(0.01), 12)
        2.0
    """

    distances: tuple[float, ...] = field(metadata={"points": "m"})
    outputs: tuple[float, ...] = field(metadata={"points": "output"})
    minimum_distance: float = -np.inf

    name: ClassVar[str] = "table"

    def __post_init__(self) -> None:
        distances = _column(finite(self.distances, "distances", "m"), "distances")
        outputs = _column(positive(self.outputs, "outputs"), "outputs")
        if len(distances) != len(outputs):
            raise InvalidInputError(
                f"outputs: found {len(outputs)} values for {len(distances)} distances, expected one output for "
                "each distance"
            )
        for name, column, sign in (("distances", distances, 1), ("outputs", outputs, -1)):
            wrong = np.flatnonzero(sign * np.diff(column) <= 0)
            if len(wrong):
                i = int(wrong[0])
                order, remedy = "increasing", ""
                if sign < 0:
                    order, remedy = "decreasing", "; smooth the table or fit a curve first"
                raise InvalidInputError(
                    f"{name}: found the value {column[i]:g} followed by the value {column[i + 1]:g}, expected strictly "
                    f"{order} values{remedy}",
                    value=column[i],
                )
        low, high = (_limit(getattr(self, end), end) for end in ("minimum_distance", "maximum_distance"))
        object.__setattr__(self, "distances", tuple(map(float, distances)))
        object.__setattr__(self, "outputs", tuple(map(float, outputs)))
        object.__setattr__(self, "minimum_distance", max(low, self.distances[0]))
        object.__setattr__(self, "maximum_distance", min(high, self.distances[-1]))
        SensorModel.__post_init__(self)

    def _knots(self) -> Iterable[float]:
        return self.distances  # the second derivative of ln xi jumps there

    def _terms(self, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        starts, coefficients = _cubics(self.distances, self.outputs)
        at = np.maximum(np.searchsorted(starts, distance, side="right") - 1, 0)
        return coefficients[:, at], distance - starts[at]

    def _log_output(self, distance: FloatArray) -> FloatArray:
        (c0, c1, c2, c3), z = self._terms(distance)
        return np.asarray(c0 + z * (c1 + z * (c2 + z * c3)))  # exact at the points, except the last one

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        (_, c1, c2, c3), z = self._terms(distance)
        # At an end of the table the slope may be zero, and the polynomial may round to just above zero.
        return np.asarray(np.minimum(c1 + z * (2 * c2 + z * 3 * c3), 0.0))


def _column(values: ArrayLike, name: str) -> FloatArray:
    column = np.asarray(values, dtype=np.float64)
    if column.ndim != 1 or len(column) < 2:
        raise InvalidInputError(f"{name}: found {values!r}, expected a list of two or more numbers", value=values)
    return column


@lru_cache(maxsize=64)
def _cubics(distances: tuple[float, ...], outputs: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    """Return the near ends of the intervals of a table, and the coefficients of ln xi from there, shape (4, N - 1)."""
    places, levels = np.array(distances), np.log(outputs)
    slopes, width = monotone_slopes(places, levels), np.diff(places)
    secant = np.diff(levels) / width
    bend = (slopes[:-1] + slopes[1:] - 2 * secant) / width
    return places[:-1], np.array([levels[:-1], slopes[:-1], (secant - slopes[:-1]) / width - bend, bend / width])


def monotone_slopes(distance: FloatArray, values: FloatArray) -> FloatArray:
    """Return the slopes of a monotone piecewise cubic through points (Fritsch and Butland 1984).

    A slope is a weighted harmonic mean of the slopes to both neighbors, and 0 where they differ in sign. At the ends it
    is that of a parabola, limited so that the cubic is monotone. These are the slopes of SciPy's `PchipInterpolator`,
    which takes 0.2 s to import.

    Args:
        distance: distances of the points [m], at least two, strictly increasing, shape (N,).
        values: the values there, shape (N,).

    Returns:
        The slopes at the points, shape (N,).
    """
    width = np.diff(distance)
    secant = np.diff(values) / width
    if len(secant) == 1:
        return np.repeat(secant, 2)
    near, far = secant[:-1], secant[1:]
    same = near * far > 0
    first, last = 2 * width[1:] + width[:-1], width[1:] + 2 * width[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = (first + last) / (first / near + last / far)
    ends = [_end_slope(width[:2], secant[:2]), _end_slope(width[:-3:-1], secant[:-3:-1])]
    return np.concatenate([ends[:1], np.where(same, inner, 0.0), ends[1:]])


def _end_slope(width: FloatArray, secant: FloatArray) -> float:
    """Return the slope at an end, from the widths and slopes of the two intervals there, the outer one first."""
    slope = ((2 * width[0] + width[1]) * secant[0] - width[0] * secant[1]) / (width[0] + width[1])
    if slope * secant[0] <= 0:
        return 0.0
    if secant[0] * secant[1] < 0 and abs(slope) > 3 * abs(secant[0]):
        slope = 3 * secant[0]
    return float(slope)


@dataclass(frozen=True, slots=True, kw_only=True)
class PiecewiseCubic(SensorModel):
    """Piecewise cubic sensor curve through given points.

    The log output is a cubic polynomial between neighboring points. The slopes at both ends of each interval are
    arguments as well.

    The slope may jump at a point, and ln xi may rise with the distance: neither is checked. The curve is valid between
    its first and its last distance.

    Args:
        distances: l of the points [m], at least two, strictly increasing, shape (N,).
        log_outputs: ln xi of the points, shape (N,).
        slopes: g [1/m] at the near and the far end of each interval, shape (N - 1, 2).
        minimum_distance: smallest valid l [m]; at least the first distance.
        maximum_distance: largest valid l [m]; at most the last distance.

    Examples:
        >>> line = PiecewiseCubic(distances=(0.0, 0.01), log_outputs=(1.0, 0.0), slopes=((-100.0, -100.0),))
        >>> round(line.log_output(0.004), 12), round(line.log_slope(0.004), 9)
        (0.6, -100.0)
    """

    distances: tuple[float, ...] = field(metadata={"checked": False})  # checked by __post_init__, quicker
    log_outputs: tuple[float, ...] = field(metadata={"checked": False})
    slopes: tuple[tuple[float, float], ...] = field(metadata={"checked": False})
    minimum_distance: float = -np.inf

    name: ClassVar[str] = "piecewise-cubic"

    def __post_init__(self) -> None:
        distances, levels = (
            _column(finite(getattr(self, n), n, unit), n) for n, unit in (("distances", "m"), ("log_outputs", ""))
        )
        slopes = np.asarray(finite(self.slopes, "slopes", "1/m"))
        if len(levels) != len(distances) or slopes.shape != (len(distances) - 1, 2) or (np.diff(distances) <= 0).any():
            raise InvalidInputError(
                f"distances: found {len(distances)} distances and {len(levels)} log_outputs. The array of slopes has "
                f"the shape {slopes.shape}. The distances must increase strictly. Each distance needs one log_output. "
                "Each interval between two distances needs two slopes"
            )
        object.__setattr__(self, "distances", tuple(distances.tolist()))
        object.__setattr__(self, "log_outputs", tuple(levels.tolist()))
        object.__setattr__(self, "slopes", tuple(map(tuple, slopes.tolist())))
        object.__setattr__(self, "minimum_distance", max(self.minimum_distance, self.distances[0]))
        object.__setattr__(self, "maximum_distance", min(self.maximum_distance, self.distances[-1]))
        SensorModel.__post_init__(self)

    def _knots(self) -> Iterable[float]:
        return self.distances

    def coefficients(self) -> FloatArray:
        """Return the polynomial coefficients of the log output.

        There are four coefficients for each interval between points. In ln xi = sum c_k z^k, z is l minus the middle of
        the interval [m]. The result has the shape (N - 1, 4).
        """
        width = np.diff(self.distances)
        (near, far), slopes = np.array([self.log_outputs[:-1], self.log_outputs[1:]]), np.array(self.slopes)
        first, last = slopes[:, 0], slopes[:, 1]
        return np.column_stack(
            [
                (near + far) / 2 + width * (first - last) / 8,
                1.5 * (far - near) / width - (first + last) / 4,
                (last - first) / (2 * width),
                (first + last) / width**2 - 2 * (far - near) / width**3,
            ]
        )

    def points(self, low: float, high: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the points of the section between two valid distances [m], as the arguments of this class."""
        if low <= self.distances[0] and high >= self.distances[-1]:
            return np.array(self.distances), np.array(self.log_outputs), np.array(self.slopes)
        inside = [d for d in self.distances if low < d < high]
        edges = np.array([low, *inside, high])
        c0, c1, c2, c3 = (c := self.coefficients()).T
        knots = np.array(self.distances)
        at = np.clip(np.searchsorted(knots, (edges[:-1] + edges[1:]) / 2, side="right") - 1, 0, len(c) - 1)
        middle = (knots[at] + knots[at + 1]) / 2
        first, last = edges[:-1] - middle, edges[1:] - middle
        near, far = (c1[at] + z * (2 * c2[at] + z * 3 * c3[at]) for z in (first, last))
        levels = c0[at] + first * (c1[at] + first * (c2[at] + first * c3[at]))
        at, z = at[-1], last[-1]
        return edges, np.append(levels, c0[at] + z * (c1[at] + z * (c2[at] + z * c3[at]))), np.column_stack([near, far])

    def _terms(self, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        edges = np.array(self.distances)
        at = np.clip(np.searchsorted(edges, distance, side="right") - 1, 0, len(edges) - 2)
        return np.moveaxis(self.coefficients()[at], -1, 0), distance - (edges[at] + edges[at + 1]) / 2

    def _log_output(self, distance: FloatArray) -> FloatArray:
        (c0, c1, c2, c3), z = self._terms(distance)
        return np.asarray(c0 + z * (c1 + z * (c2 + z * c3)))

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        (_, c1, c2, c3), z = self._terms(distance)
        return np.asarray(c1 + z * (2 * c2 + z * 3 * c3))
