"""A sensor curve as the kernels read it: ln xi as polynomials on windows that overlap, or g on pieces side by side.

An approach passes the curve downward. A step that starts anywhere in a window should find most of the window below it,
so each window starts inside the one above it, and a motion changes to the next as soon as that one holds it. At a
corner of the curve (a point of a table) windows end instead. Where 1 / g is linear in l, as in L(3), there is one
window and no polynomial: the kernel then knows that g l' = n q with q (l + l_0) = l'. The guaranteed path takes pieces,
in any direction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray, chebyshev_extremes, chebyshev_nodes
from pretouch.sensors import SensorModel
from pretouch.sensors.conformance import refuse_invalid_curve
from pretouch.sensors.model import cache_by_curve, is_built_in

from .scenario import Scenario

Curves: TypeAlias = tuple[FloatArray, IntArray, IntArray]
"""Curves as the block kernel reads them: the windows of all, where those of each start, the curve of each encounter."""

EDGE, LOW, TOP, SWITCH, MIDDLE, TERMS = range(6)  # the columns of a window
HIGH_DEGREE: Final = 12
"""Of ln xi on a window where LOW_DEGREE would take many."""

LOW_DEGREE: Final = 4
"""Of ln xi on a window where a handful of such do."""

TOLERANCE: Final = 1e-13
"""Of the largest slope on a window or a piece."""

_OVERLAP: Final = 0.4
SLACK: Final = 2e-7
"""Of a window: how far it is used beyond its border; the error is of second order in it."""

_MOST: Final = 2_000
_SMALLEST: Final = 1e-9

_DEGREE: Final = 9
_ROUNDING: Final = 1e-9  # of the largest slope from there outward: a larger error is one of the polynomial
_IN_VAIN: Final = 3  # halvings
_MAX_PIECES: Final = 20_000
_GROWTH: Final = 64.0
_FARTHEST: Final = 1e12

FOLLOWED: Final = 2.0**43
"""Largest distance [m] at the start from which an encounter is integrated; the pieces of a curve reach 4 times as far.

Beyond it a distance has fewer digits than a millimeter needs. Such an encounter is unresolved.
"""

_NODES: Final = chebyshev_nodes(_DEGREE + 1)
_PROBES: Final = chebyshev_extremes(_DEGREE + 1)[1:-1]
_TO_COEFFICIENTS: Final = np.linalg.inv(np.vander(_NODES, increasing=True))
_AT_PROBES: Final = np.vander(_PROBES, _DEGREE + 1, increasing=True)


def reach_of(scenario: Scenario) -> float:
    """Return a distance [m] that no encounter exceeds at the start, one of few: a power of two.

    Encounters that start beyond FOLLOWED do not count among others: they must not change how those are solved.
    """
    distance = scenario.distance
    largest = distance if type(distance) is float else float(np.max(distance, initial=0.0))
    if largest > FOLLOWED:
        largest = _largest_followed(distance) or largest
    return 2.0 ** math.frexp(largest)[1]


def _largest_followed(distance: Any) -> float:
    """Return the largest of some distances [m] up to FOLLOWED; 0 where there is none."""
    return float(np.max(distance, initial=0.0, where=np.asarray(distance) <= FOLLOWED))


def check_curve(sensor: SensorModel, distance: Any) -> None:
    """Refuse a user's curve that breaks a law of sensors nearer than where encounters start [m], of any shape."""
    if not is_built_in(sensor):
        near = type(distance) is float and distance <= FOLLOWED
        refuse_invalid_curve(sensor, distance if near else _largest_followed(distance))


def farthest(scenario: Scenario, sensor: SensorModel) -> float:
    """Return a distance [m] that no encounter exceeds at the start, one of few: a power of two or the curve's end."""
    return min(reach_of(scenario), sensor.valid_range[1])


@cache_by_curve(256)
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
            slack = SLACK * (top - bottom)
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


class CurveError(InvalidInputError):
    """A curve cannot be approximated.

    Args:
        message: what was found, what must hold, what to try.
        culprit: the smallest distance looked at where the slope is not finite [m]; None where it is too rough.
    """

    def __init__(self, message: str, culprit: float | None = None) -> None:
        super().__init__(message)
        self.culprit = culprit


@cache_by_curve(256)
def curve_pieces(sensor: SensorModel, low: float, high: float) -> FloatArray:
    """Approximate the slope g of a curve between two of its distances [m] by polynomials on pieces, halved to fit.

    Returns:
        One row per piece, ascending: its middle [m], its half width [m] and the coefficients of g [1/m] in
        z = (l - middle) / half, ten of them. The slope is met to 1e-13 of its largest magnitude on the piece, or as
        well as the curve itself rounds.

    Raises:
        CurveError: the slope is not finite, or too rough to be a curve.
    """
    decades = high / _GROWTH ** np.arange(1, 8)  # a far end must not cost the near field its resolution
    edges = np.unique([low, *(e for e in (*sensor.knots, *decades) if low < e < high), high])
    look = partial(_slope, sensor)
    whole, _, _ = interpolate(look, (edges[:-1] + edges[1:]) / 2, np.diff(edges) / 2)
    beyond = np.maximum.accumulate(np.abs(whole).max(axis=1)[::-1])[::-1]  # what an approach has felt on its way
    none = np.zeros(len(beyond))
    pending = np.stack([edges[:-1], edges[1:], 1e-9 * np.diff(edges), none + np.inf, beyond, none])
    done: list[FloatArray] = []
    while pending.size:
        left, right, smallest, before, beyond, in_vain = pending
        middle, half = (left + right) / 2, (right - left) / 2
        slope, coefficients, error = interpolate(look, middle, half)
        # where the curve rounds its distances, as a recessed one near a flat end, halving a piece gains nothing; once
        # is no proof of that, since a wide piece may not see what is narrow
        in_vain = np.where(error > 0.25 * before, in_vain + 1, 0)
        rounded = (in_vain >= _IN_VAIN) & (error <= _ROUNDING * beyond)
        fits = (error <= TOLERANCE * np.abs(slope).max(axis=1)) | rounded | (half < smallest)
        done.append(np.column_stack([middle, half, coefficients])[fits])
        lower = np.stack([left, middle, smallest, error, beyond, in_vain])[:, ~fits]
        upper = np.stack([middle, right, smallest, error, beyond, in_vain])[:, ~fits]
        pending = np.concatenate([lower, upper], axis=1)
        if pending.shape[1] + sum(map(len, done)) > _MAX_PIECES:
            raise CurveError(
                f"sensor: the slope of the {sensor.name} curve needs more than {_MAX_PIECES} polynomials between "
                f"{low:g} m and {high:g} m; smooth it, name its corners, or end it by maximum_distance where it ceases "
                "to be smooth"
            )
    pieces = np.concatenate(done)
    pieces = pieces[np.argsort(pieces[:, 0])]
    pieces.setflags(write=False)
    return pieces


def interpolate(
    look: Callable[[FloatArray], FloatArray], middle: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values at the nodes of pieces, coefficients of powers of (l - middle) / half, and their largest error."""
    values, probed = (look(middle[:, None] + half[:, None] * z) for z in (_NODES, _PROBES))
    coefficients = values @ _TO_COEFFICIENTS.T
    return values, coefficients, np.abs(coefficients @ _AT_PROBES.T - probed).max(axis=-1)


def _slope(sensor: SensorModel, distance: FloatArray) -> FloatArray:
    """Return g [1/m] at distances [m], brought into the valid range."""
    distance = np.clip(distance, *sensor.valid_range)
    with np.errstate(all="ignore"):  # what is not finite is looked for
        slope = np.asarray(sensor.log_slope(distance))
    if not np.isfinite(slope).all():
        culprit = float(distance[~np.isfinite(slope)].min())
        raise CurveError(
            f"sensor: the slope of the {sensor.name} curve is not finite at {culprit:g} m; end it by maximum_distance, "
            "or start it by minimum_distance, where it ceases to hold",
            culprit,
        )
    return slope


@cache_by_curve(256)
def curve_reach(sensor: SensorModel, low: float, start: float, high: float) -> float:
    """Find how far out a curve can be followed: one of a user's, without a largest distance, may end somewhere.

    It is followed from `low`, at least to `start` and at most to `high`, all in m, inside the valid range.

    Returns:
        The largest distance [m]: high where it holds all along, else where the slope ceases to be finite, or a power of
        two below high from which on it is rough.

    Raises:
        CurveError: the slope is not finite, or too rough, even before the start.
    """
    while True:
        try:
            curve_pieces(sensor, low, high)
        except CurveError as found:
            if high <= start:
                raise
            high = max(start, high / 2 if found.culprit is None else _last_finite(sensor, start, found.culprit))
        else:
            return high


def curve_tops(sensor: SensorModel, low: float, start: float, reach: float) -> Iterator[tuple[float, bool]]:
    """Yield how far out [m] a curve is to be followed from `low`, each time farther, and whether it may go on beyond.

    A motion may outgrow what is known of its curve, and come back. The first distance is `reach` [m]; `start` [m] is
    how far the curve is needed at least.
    """
    end, goes_on = sensor.valid_range[1], True
    while goes_on and reach <= _GROWTH * _FARTHEST:
        wanted = min(end, reach)
        top = curve_reach(sensor, low, min(wanted, max(reach / _GROWTH, start)), wanted)
        goes_on = top == wanted < end
        yield top, goes_on
        reach *= _GROWTH


def _last_finite(sensor: SensorModel, good: float, bad: float) -> float:
    """Return the last distance before a bad one, not below a good one, at which the slope is finite."""
    while good < bad:
        middle = 0.5 * (good + bad)
        if not good < middle < bad:
            break
        with np.errstate(all="ignore"):
            finite = math.isfinite(sensor.log_slope(middle))
        good, bad = (middle, bad) if finite else (good, middle)
    return good
