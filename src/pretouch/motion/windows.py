"""A sensor curve as the block kernel reads it: ln xi as polynomials on windows that overlap.

An approach passes the curve downward. A step that starts anywhere in a window should find most of the window below it,
so each window starts inside the one above it, and a motion changes to the next as soon as that one holds it. At a
corner of the curve (a point of a table) windows end instead. Where 1 / g is linear in l, as in L(3), there is one
window and no polynomial: the kernel then knows that g l' = n q with q (l + l_0) = l'.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.chebyshev import chebyshev_extremes, chebyshev_nodes
from pretouch._core.numbers import FloatArray, IntArray
from pretouch.sensors import SensorModel
from pretouch.sensors.kept import kept_by_curve

from .scenario import Scenario

__all__ = [
    "EDGE",
    "HIGH_DEGREE",
    "LOW",
    "LOW_DEGREE",
    "MIDDLE",
    "SWITCH",
    "TERMS",
    "TOLERANCE",
    "TOP",
    "Curves",
    "alone",
    "curve_windows",
    "farthest",
    "line_windows",
    "polynomial_windows",
    "power_window",
    "reach_of",
]

Curves: TypeAlias = tuple[FloatArray, IntArray, IntArray]
"""Curves as the block kernel reads them: the windows of all, where those of each start, the curve of each encounter."""

EDGE, LOW, TOP, SWITCH, MIDDLE, TERMS = range(6)  # the columns of a window
HIGH_DEGREE: Final = 12
"""Of ln xi on a window where LOW_DEGREE would take many."""

LOW_DEGREE: Final = 4
"""Of ln xi on a window where a handful of such do."""

TOLERANCE: Final = 1e-13
"""Of the largest slope on a window."""

_OVERLAP: Final = 0.4
_SLACK: Final = 2e-7  # of a window: how far it is used beyond its border; the error is of second order in it
_MOST: Final = 2_000
_SMALLEST: Final = 1e-9


def reach_of(scenario: Scenario) -> float:
    """Return a distance [m] that no encounter exceeds at the start, one of few: a power of two."""
    distance = scenario.distance
    largest = distance if type(distance) is float else float(np.max(distance, initial=0.0))
    return 2.0 ** math.frexp(largest)[1]


def farthest(scenario: Scenario, sensor: SensorModel) -> float:
    """Return a distance [m] that no encounter exceeds at the start, one of few: a power of two or the curve's end."""
    return min(reach_of(scenario), sensor.valid_range[1])


@kept_by_curve(256)
def curve_windows(sensor: SensorModel, low: float, high: float) -> FloatArray:
    """Approximate ln xi on overlapping windows.

    Args:
        sensor: the curve.
        low: where the windows start [m], inside the valid range; contacts are found only where this is 0.
        high: where they end [m], inside the valid range.

    Returns:
        One row per window, ascending, with the columns EDGE (how far down it is used [m]), LOW and TOP [m], SWITCH (at
        and below this l the next window holds it [m]) and MIDDLE [m]; from TERMS on the coefficients of ln xi in
        l - middle [m^-k], 5 or 13 of them, whose slope meets g to 1e-13 of its largest magnitude in the window. A
        single coefficient is n with g = n / (l - middle). No row where the curve cannot be met.
    """
    power = power_window(sensor, low, high)
    if power is not None:
        return power
    knots = [k for k in sensor.knots if low < k < high]
    few = polynomial_windows(sensor.log_slope, [low, *knots, high], LOW_DEGREE, most=4)
    found = few if few is not None else polynomial_windows(sensor.log_slope, [low, *knots, high], HIGH_DEGREE)
    table = np.zeros((0, TERMS + HIGH_DEGREE + 1)) if found is None else found
    table.setflags(write=False)
    return table


def alone(table: FloatArray) -> Curves:
    """Return the one curve of all encounters as the block kernel reads it, of windows as from `curve_windows`."""
    return table, np.array([0, len(table)]), np.zeros(1, dtype=np.int64)


def line_windows(slope: float, top: float) -> FloatArray:
    """Return the one window, as in `curve_windows`, of a constant slope [1/m] up to a distance [m] or infinity."""
    row = np.array([[0.0, 0.0, top, 0.0, 0.0, 0.0, slope]])
    row.setflags(write=False)
    return row


def power_window(sensor: SensorModel, low: float, high: float) -> FloatArray | None:
    """Return the one window of a curve whose 1 / g is linear in l between two distances [m]; None for others."""
    if any(low < k < high for k in sensor.knots):
        return None
    distance = low + (high - low) * np.concatenate([[0.0], np.sin(np.pi / 4 * np.linspace(0, 1, 65)) ** 4, [1.0]])
    with np.errstate(all="ignore"):  # a curve that is not finite there is left to the guaranteed path
        slope = np.asarray(sensor.log_slope(distance))
    if not (np.isfinite(slope).all() and (slope < 0).all()):
        return None
    inverse = 1 / slope
    rise = (inverse[-1] - inverse[0]) / (high - low)
    if rise == 0 or not abs(inverse[0] - rise * low) > 0:
        return None
    n, middle = 1 / rise, low - inverse[0] / rise
    nearest = min(abs(low - middle), abs(high - middle))
    if low <= middle <= high or nearest < 1e-6 * (high - low):
        return None
    if not (np.abs(slope * (distance - middle) / n - 1) <= TOLERANCE).all():
        return None
    row = np.array([[low, low, high, low, middle, n]])
    row.setflags(write=False)
    return row


def polynomial_windows(
    slope: Callable[[FloatArray], FloatArray], edges: Sequence[float], degree: int, *, most: int | None = None
) -> FloatArray | None:
    """Return windows on each of which a polynomial of a degree meets a curve, or every one of some curves.

    Args:
        slope: g [1/m] of distances [m], shape (m,), or of each curve, shape (k, m).
        edges: where the windows start, the corners of the curve, and where they end [m], ascending.
        degree: of ln xi.
        most: how many windows are worth it, besides two for each corner; 2,000 where None.

    Returns:
        The windows as in `curve_windows`, with the polynomials of the first curve; None where more are needed.
    """
    low, high = edges[0], edges[-1]
    limit = _MOST if most is None else most + 2 * (len(edges) - 2)
    rows: list[FloatArray] = []
    smallest = _SMALLEST * (high - low)
    for left, right in zip(edges[-2::-1], edges[:0:-1], strict=True):
        top, size = right, right - left
        while top > left:
            bottom = max(left, top - size)
            terms = _fit(slope, bottom, top, degree)
            if terms is None:
                size = 0.75 * min(size, top - left)
                if size < smallest:
                    return None
                continue
            slack = _SLACK * (top - bottom)
            last = bottom == left
            following = left if last else bottom + _OVERLAP * (top - bottom)
            edge = bottom if last and left == low else bottom - slack
            rows.append(np.array([edge, bottom, top, max(following, bottom + slack), (bottom + top) / 2, *terms]))
            if len(rows) > limit:
                return None
            top, size = following, 2 * (top - bottom)
    return np.array(rows[::-1])


def _fit(slope: Callable[[FloatArray], FloatArray], low: float, high: float, degree: int) -> FloatArray | None:
    """Return the coefficients of ln xi in l - (low + high) / 2, or None where a degree does not meet every slope."""
    nodes, probes = chebyshev_nodes(degree), chebyshev_extremes(degree)
    middle, half = (low + high) / 2, (high - low) / 2
    with np.errstate(all="ignore"):
        slopes = np.atleast_2d(slope(np.clip(middle + half * np.concatenate([nodes, probes]), low, high)))
    if not np.isfinite(slopes).all():
        return None
    terms = np.linalg.solve(np.vander(nodes, increasing=True), slopes[:, :degree].T)
    error = np.abs(np.vander(probes, degree, increasing=True) @ terms - slopes[:, degree:].T).max(axis=0)
    if not (error <= TOLERANCE * np.abs(slopes).max(axis=1)).all():
        return None
    powers = np.arange(1, degree + 1)
    return np.concatenate([[0.0], terms[:, 0] / powers / half ** (powers - 1.0)])
