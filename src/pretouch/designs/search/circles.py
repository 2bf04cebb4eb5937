"""Improve a design by comparing the admittances around it, each with its best gain."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray

from .trials import Trials

_NODES: Final = np.linspace(-1.0, 1.0, 17)
_ZOOMS: Final = 5  # a gain is known to 1/65536 of the first interval then
_STEEP: Final = 8.0  # largest change of the best gain, per distance of admittances, both as shares of their ranges
_FIRST: Final = 0.1  # radius of the first circle, as a share of the ranges; the grid is about as fine
_FINEST: Final = 1e-7  # radius at which the search ends
_COARSEST: Final = 1e-3  # the same for encounters on a sampled loop, whose quantities have ripples
_SHRINK: Final = 0.3
_DIRECTIONS: Final = 16
_TURNS: Final = 4  # refinements of the two best directions, each by a factor of 4
_APART: Final = 0.15  # smallest difference of these two, in turns
_ENOUGH: Final = 1e-4  # smallest improvement, in radii and relative to the value, for another circle of this radius
_MOST: Final = 60  # largest number of circles


def best_gains(
    trials: Trials, admittances: FloatArray, middle: FloatArray, half: float, zooms: int
) -> tuple[FloatArray, FloatArray]:
    """Find the best gain of each of several admittances by narrowing an interval of gains.

    Args:
        trials: the free parameters, with one objective.
        admittances: search coordinates of the admittances, shape (n, size - 1).
        middle: search coordinate of a gain in the middle of each interval, shape (n,).
        half: half the width of the intervals.
        zooms: number of evaluations of 17 gains, each in an interval of an eighth of the width.

    Returns:
        The coordinates of the gains, and the objectives; these are infinite where no evaluated gain is feasible.
    """
    best = np.full(len(admittances), np.inf)
    for _ in range(zooms):
        gains = np.clip(middle + half * _NODES[:, None], 0.0, 1.0)
        same = np.broadcast_to(admittances, (len(gains), *admittances.shape))
        points = np.concatenate([gains[..., None], same], axis=-1).reshape(-1, trials.freedom.size)
        values = trials.values(points)[:, 0].reshape(gains.shape)
        lowest = values.argmin(axis=0)[None]
        value = np.take_along_axis(values, lowest, axis=0)[0]
        middle = np.where(value < best, np.take_along_axis(gains, lowest, axis=0)[0], middle)
        best, half = np.minimum(best, value), 2 * half / (len(_NODES) - 1)
    return middle, best


def follow_kinks(trials: Trials, at: FloatArray, value: float) -> tuple[FloatArray, float]:
    """Improve a point at which a search by derivatives stopped.

    The largest value of a quantity over time has kinks, at which its derivatives jump. So does the boundary of the
    feasible points. A search by derivatives can stop there, although better points lie along the kink. This search
    needs no derivatives. It compares the admittances on a circle around the point, each with its best gain. A zoom
    along the circle finds the two directions of the kink. The circle shrinks when nothing on it is better.

    Args:
        trials: the free parameters, with one objective.
        at: a feasible point, shape (size,).
        value: its objective.

    Returns:
        The best point and its objective; the given ones if nothing is better.
    """
    radius, finest = _FIRST, _FINEST if trials.encounters.is_continuous else _COARSEST
    for _ in range(_MOST):
        if radius < finest:
            break
        better, lower = _best_around(trials, at, radius)
        goes_on = value - lower > _ENOUGH * radius * abs(value) and np.abs(better - at)[1:].max() > 0.5 * radius
        if lower < value:
            at, value = better, lower
        if not goes_on:
            radius *= _SHRINK
    return at, value


def _best_around(trials: Trials, at: FloatArray, radius: float) -> tuple[FloatArray, float]:
    """Return the best point among the admittances on a circle and in its center, each with its best gain."""
    count = len(at) - 1

    def compare(turns: FloatArray) -> tuple[FloatArray, FloatArray]:
        around = np.stack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)], axis=1)[:, :count]
        admittances = np.clip(at[1:] + radius * np.concatenate([np.zeros((1, count)), around]), 0.0, 1.0)
        gains, values = best_gains(trials, admittances, np.full(len(admittances), at[0]), _STEEP * radius, _ZOOMS)
        return np.column_stack([gains, admittances]), values

    turns = np.arange(_DIRECTIONS if count > 1 else 2) / (_DIRECTIONS if count > 1 else 2)
    points, values = compare(turns)
    best, lowest = points[int(values.argmin())], float(values.min())
    if count == 1 or not np.isfinite(values[1:]).any():
        return best, lowest
    first = turns[int(values[1:].argmin())]
    apart = np.abs((turns - first + 0.5) % 1.0 - 0.5)
    second = turns[int(np.where(apart > _APART, values[1:], np.inf).argmin())]
    middles = np.array([first, second])  # a kink leaves the circle at two points
    for zoom in range(_TURNS):
        windows = middles[:, None] + _NODES[::2] / (_DIRECTIONS * 4**zoom)
        points, values = compare(windows.reshape(-1))
        middles = np.take_along_axis(windows, values[1:].reshape(windows.shape).argmin(axis=1)[:, None], axis=1)[:, 0]
        if values.min() < lowest:
            best, lowest = points[int(values.argmin())], float(values.min())
    return best, lowest
