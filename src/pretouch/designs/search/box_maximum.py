"""Find the maximum of a smooth function on a box by branch and bound.

Each box is evaluated at its middle and its corners. The only assumption: in a box, the gradient changes at most by its
change between these points, increased by half. The smaller the box, the better this assumption holds. Then

- a coordinate in which the gradient keeps its sign is fixed at its better end, and the box loses a dimension;
- a box is dropped if its middle value plus the largest possible increase stays below the best value;
- every other box is halved in the coordinate in which the gradient changes most.

For a function that is monotone in every coordinate, one box suffices, and its maximum at a corner is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray

_BEYOND: Final = 0.5  # the observed range of a gradient is extended by this share of its change on each side
_MOST: Final = 200_000  # largest number of boxes
_AT_ONCE: Final = 4096
_NOISE: Final = 1e-9  # a gradient times the box width must exceed this share of the largest value to have a sign

Function: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Function that maps points, shape (n, d), to values, shape (n,), and gradients, shape (n, d)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedMaximum:
    """The largest value of a function, with a proven bound.

    The inputs of the function vary within ranges. Value and bound are infinite if the function is infinite somewhere.
    """

    point: FloatArray  # location of the maximum, shape (d,)
    value: float
    bound: float  # upper bound of the function on the box
    boxes: int  # number of boxes that were evaluated
    signs: tuple[int, ...]  # 1 or -1 for each coordinate in which the function grows or falls on the whole box, else 0


def maximize_on_box(function: Function, low: FloatArray, high: FloatArray, *, tolerance: float) -> CertifiedMaximum:
    """Maximize a function within ranges of its inputs.

    Returns:
        The maximum, with a proven upper bound.
    """
    d = len(low)
    upper = np.array(list(product((False, True), repeat=d))).reshape(-1, d)
    waiting = [(low[None].astype(np.float64), high[None].astype(np.float64))]
    best, where, boxes = -np.inf, low, 0
    whole: tuple[int, ...] = (0,) * d
    bound = -np.inf  # upper bound of all dropped boxes
    while waiting and boxes < _MOST:
        lows, highs = waiting.pop()
        if len(lows) > _AT_ONCE:
            waiting.append((lows[_AT_ONCE:], highs[_AT_ONCE:]))
            lows, highs = lows[:_AT_ONCE], highs[:_AT_ONCE]
        middle, half = 0.5 * (lows + highs), 0.5 * (highs - lows)
        corners = np.where(upper, highs[:, None], lows[:, None])
        points = np.concatenate([middle[:, None], corners], axis=1)
        values, slopes = function(points.reshape(-1, d))
        values, slopes = values.reshape(points.shape[:2]), slopes.reshape(points.shape)
        at = np.unravel_index(np.argmax(values), values.shape)
        if values[at] > best:
            best, where = float(values[at]), points[at]
        if not np.isfinite(best) or not np.isfinite(slopes).all():
            return CertifiedMaximum(point=where, value=best, bound=np.inf, boxes=boxes + len(lows), signs=whole)
        least, most, change = _range_of(slopes)
        noise = _NOISE * abs(best)
        grows, falls = least * half > noise, most * half < -noise
        flat = half == 0
        if boxes == 0:
            whole = tuple(int(g) - int(f) for g, f in zip(grows[0], falls[0], strict=True))
        boxes += len(lows)
        settled = (grows | falls | flat).all(axis=1)  # the maximum is at a corner, which has been evaluated
        reach = values[:, 0] + ((np.abs(slopes[:, 0]) + 0.5 * (1 + _BEYOND) * change) * half).sum(axis=1)
        over = ~settled & (reach > best + tolerance * abs(best))
        bound = max(bound, float(reach[~settled & ~over].max(initial=-np.inf)))
        if over.any():
            lows, highs = np.where(grows, highs, lows)[over], np.where(falls, lows, highs)[over]
            waiting.append(_halve(lows, highs, change[over], (grows | falls)[over]))
    remaining = np.inf if waiting else -np.inf
    return CertifiedMaximum(point=where, value=best, bound=max(best, bound, remaining), boxes=boxes, signs=whole)


def _range_of(slopes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Estimate the range of the gradient in each box."""
    change = np.abs(slopes[:, 1:] - slopes[:, :1]).max(axis=1)
    beyond = _BEYOND * change
    return slopes.min(axis=1) - beyond, slopes.max(axis=1) + beyond, change


def _halve(
    lows: FloatArray, highs: FloatArray, change: FloatArray, collapsed: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Halve each box of inputs along one input. Boxes that have just lost a dimension stay whole."""
    width = highs - lows
    axis = np.argmax(change * width, axis=1)
    rows = np.arange(len(lows))
    middle = 0.5 * (lows + highs)[rows, axis]
    again = collapsed.any(axis=1) | (width[rows, axis] == 0)
    upper_of_first, lower_of_second = highs.copy(), lows.copy()
    upper_of_first[rows, axis] = np.where(again, highs[rows, axis], middle)
    lower_of_second[rows, axis] = middle
    return np.concatenate([lows, lower_of_second[~again]]), np.concatenate([upper_of_first, highs[~again]])
