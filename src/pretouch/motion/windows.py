"""A sensor curve as the block kernel reads it: ln xi as polynomials on windows that overlap.

An approach passes the curve downward. A step that starts anywhere in a window should find most of the window below it,
so each window starts inside the one above it, and a motion changes to the next as soon as that one holds it. At a
corner of the curve (a point of a table) windows end instead. Where 1 / g is linear in l, as in L(3), there is one
window and no polynomial: the kernel then knows that g l' = n q with q (l + l_0) = l'.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel

from .scenario import Scenario

__all__ = ["EDGE", "LOW", "MIDDLE", "SWITCH", "TERMS", "TOP", "curve_windows", "farthest", "line_windows"]

EDGE, LOW, TOP, SWITCH, MIDDLE, TERMS = range(6)  # the columns of a window
_HIGH_DEGREE: Final = 12
_LOW_DEGREE: Final = 4
_TOLERANCE: Final = 1e-13  # of the largest slope on the window
_OVERLAP: Final = 0.4
_SLACK: Final = 2e-7  # of a window: how far it is used beyond its border; the error is of second order in it
_MOST: Final = 2_000
_SMALLEST: Final = 1e-9


def farthest(scenario: Scenario, sensor: SensorModel) -> float:
    """Return a distance [m] that no encounter exceeds at the start, one of few: a power of two or the curve's end."""
    distance = scenario.distance
    largest = distance if type(distance) is float else float(np.max(distance, initial=0.0))
    return min(2.0 ** math.frexp(largest)[1], sensor.valid_range[1])


@lru_cache(maxsize=256)
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
    power = _power(sensor, low, high)
    if power is not None:
        return power
    knots = [k for k in sensor.knots if low < k < high]
    edges = [low, *knots, high]
    few = _windows(sensor, edges, _LOW_DEGREE, 4 + 2 * len(knots))
    found = few if few is not None else _windows(sensor, edges, _HIGH_DEGREE, _MOST)
    table = np.zeros((0, TERMS + _HIGH_DEGREE + 1)) if found is None else found
    table.setflags(write=False)
    return table


def line_windows(slope: float, top: float) -> FloatArray:
    """Return the one window of a constant slope.

    Args:
        slope: g [1/m].
        top: the largest distance at which it holds [m], which may be infinite.

    Returns:
        One row as in `curve_windows`, with two coefficients of ln xi in l.
    """
    row = np.array([[0.0, 0.0, top, 0.0, 0.0, 0.0, slope]])
    row.setflags(write=False)
    return row


def _power(sensor: SensorModel, low: float, high: float) -> FloatArray | None:
    """Return the one window of a curve whose 1 / g is linear in l."""
    if any(low < k < high for k in sensor.knots):
        return None
    distance = low + (high - low) * np.concatenate([[0.0], np.sin(np.pi / 4 * np.linspace(0, 1, 65)) ** 4, [1.0]])
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
    if not (np.abs(slope * (distance - middle) / n - 1) <= _TOLERANCE).all():
        return None
    row = np.array([[low, low, high, low, middle, n]])
    row.setflags(write=False)
    return row


def _windows(sensor: SensorModel, edges: list[float], degree: int, most: int) -> FloatArray | None:
    """Return the windows of a degree between corners, ascending, or None where more than most are needed."""
    rows: list[FloatArray] = []
    smallest = _SMALLEST * (edges[-1] - edges[0])
    for left, right in zip(edges[-2::-1], edges[:0:-1], strict=True):
        top, size = right, right - left
        while top > left:
            bottom = max(left, top - size)
            terms = _fit(sensor, bottom, top, degree)
            if terms is None:
                size = 0.75 * min(size, top - left)
                if size < smallest:
                    return None
                continue
            slack = _SLACK * (top - bottom)
            last = bottom == left
            following = left if last else bottom + _OVERLAP * (top - bottom)
            edge = bottom if last and left == edges[0] else bottom - slack
            rows.append(np.array([edge, bottom, top, max(following, bottom + slack), (bottom + top) / 2, *terms]))
            if len(rows) > most:
                return None
            top, size = following, 2 * (top - bottom)
    return np.array(rows[::-1])


def _fit(sensor: SensorModel, low: float, high: float, degree: int) -> FloatArray | None:
    """Return the coefficients of ln xi in l - (low + high) / 2, or None where a degree does not meet its slope."""
    nodes = np.cos((np.arange(degree) + 0.5) * np.pi / degree)
    probes = np.cos(np.arange(degree + 1) * np.pi / degree)
    middle, half = (low + high) / 2, (high - low) / 2
    z = np.concatenate([nodes, probes])
    slope = np.asarray(sensor.log_slope(np.clip(middle + half * z, low, high)))
    if not np.isfinite(slope).all():
        return None
    terms = np.linalg.solve(np.vander(nodes, increasing=True), slope[:degree])
    error = np.abs(np.vander(probes, degree, increasing=True) @ terms - slope[degree:]).max()
    if not error <= _TOLERANCE * np.abs(slope).max():
        return None
    powers = np.arange(1, degree + 1)
    return np.concatenate([[0.0], terms / powers / half ** (powers - 1.0)])
