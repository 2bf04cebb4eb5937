"""Approximate a sensor curve by piecewise polynomials for the compiled solvers.

The fast vectorized solver uses windows: polynomials of ln xi on overlapping intervals. In an approach the distance
decreases, and a step that starts in a window should have most of that window below it. Each window therefore overlaps
the next nearer window, and a motion switches to the nearer window as soon as it is inside. Windows end at the corners
of a curve, such as the points of a table. If 1 / g is linear in l, as for the inverse power L(3), one window without a
polynomial suffices: the kernel then uses g l' = n q with q (l + l_0) = l'.

The solver for single encounters (`guaranteed`) uses pieces instead: polynomials of g on adjacent intervals, for motions
in both directions.
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
"""Curves for the block kernel: windows of all curves, first row of each curve, and the curve of each encounter."""

EDGE, LOW, TOP, SWITCH, MIDDLE, TERMS = range(6)  # columns of a window
HIGH_DEGREE: Final = 12
"""Degree of ln xi on a window if LOW_DEGREE would need many windows."""

LOW_DEGREE: Final = 4
"""Degree of ln xi on a window if a few windows suffice."""

TOLERANCE: Final = 1e-13
"""Approximation error of g, relative to the largest slope on a window or piece."""

_OVERLAP: Final = 0.4  # share of a window that the next one overlaps
SLACK: Final = 2e-7
"""Share of its length by which a window may be used beyond its border; the error is of second order in this share."""

_MAX_WINDOWS: Final = 2_000
_SMALLEST: Final = 1e-9  # smallest window, relative to the whole range

_DEGREE: Final = 9
_ROUNDING: Final = 1e-9  # relative to the largest slope from there outward; larger errors are not rounding
_IN_VAIN: Final = 3  # halvings without progress after which the error counts as rounding
_MAX_PIECES: Final = 20_000
_GROWTH: Final = 64.0  # ratio of successive ranges of a curve
_FARTHEST: Final = 1e12  # [m]
_TINY: Final = 1e-280  # powers of a width that are smaller: the terms they belong to change no digit

LARGEST_START: Final = 2.0**43
"""Largest initial distance [m] from which an encounter is integrated; the pieces of a curve reach 4 times as far.

At larger distances floating-point numbers do not resolve a millimeter, so the encounter is reported as unresolved.
"""

_NODES: Final = chebyshev_nodes(_DEGREE + 1)
_PROBES: Final = chebyshev_extremes(_DEGREE + 1)[1:-1]
_TO_COEFFICIENTS: Final = np.linalg.inv(np.vander(_NODES, increasing=True))
_AT_PROBES: Final = np.vander(_PROBES, _DEGREE + 1, increasing=True)


def reach_of(scenario: Scenario) -> float:
    """Return a power of two above the largest starting distance [m].

    Encounters that start beyond LARGEST_START are ignored, since they must not change how the others are solved.
    Rounding limits how many different values occur.
    """
    return reach_to(scenario.distance)


def reach_to(distance: Any) -> float:
    """Return the next power of two above the largest distance [m].

    Distances above LARGEST_START are ignored. If all distances exceed LARGEST_START, the largest of them counts.
    """
    largest = distance if type(distance) is float else float(np.max(distance, initial=0.0))
    if largest > LARGEST_START:
        largest = _largest_start(distance) or largest
    return 2.0 ** math.frexp(largest)[1]


def _largest_start(distance: Any) -> float:
    """Return the largest starting distance [m] that a solver can integrate. It is 0 if there is none."""
    return float(np.max(distance, initial=0.0, where=np.asarray(distance) <= LARGEST_START))


def check_curve(sensor: SensorModel, distance: Any) -> None:
    """Raise an error for an invalid custom sensor curve.

    The curve is checked from contact to the given starting distances [m].
    """
    if not is_built_in(sensor):
        near = type(distance) is float and distance <= LARGEST_START
        refuse_invalid_curve(sensor, distance if near else _largest_start(distance))


def farthest(scenario: Scenario, sensor: SensorModel) -> float:
    """Return the largest starting distance [m], rounded up within the sensor range.

    The result is a power of two, or the end of the sensor range.
    """
    return min(reach_of(scenario), sensor.valid_range[1])


@cache_by_curve(256)
def curve_windows(sensor: SensorModel, low: float, high: float) -> FloatArray:
    """Approximate a sensor curve by polynomials on overlapping distance intervals.

    The compiled solvers need this approximation. The polynomials describe ln xi.

    Args:
        sensor: the curve.
        low: lower end of the windows [m], inside the valid range; contacts are found only if it is 0.
        high: upper end of the windows [m], inside the valid range.

    Returns:
        One row per window, ascending. Columns: EDGE (down to which the window is used [m]), LOW and TOP [m], SWITCH
        (at and below this l the next window is used [m]) and MIDDLE [m]. From TERMS on: 5 or 13 coefficients of ln xi
        in l - middle [m^-k]. Their slope equals g within 1e-13 of its largest magnitude in the window. A single
        coefficient is n with g = n / (l - middle). There are no rows if the curve cannot be approximated.
    """
    power = power_window(sensor, low, high)
    if power is not None:
        return power
    knots = [k for k in sensor.knots if low < k < high]
    windows = polynomial_windows(sensor.log_slope, [low, *knots, high], LOW_DEGREE, most=4)
    if windows is None:
        windows = polynomial_windows(sensor.log_slope, [low, *knots, high], HIGH_DEGREE)
    table = np.zeros((0, TERMS + HIGH_DEGREE + 1)) if windows is None else windows
    table.setflags(write=False)
    return table


def shared_curve(table: FloatArray) -> Curves:
    """Assign the polynomials of one sensor curve to all encounters."""
    return table, np.array([0, len(table)]), np.zeros(1, dtype=np.int64)


def line_windows(slope: float, top: float) -> FloatArray:
    """Return the polynomials of a sensor curve with constant slope [1/m]."""
    row = np.array([[0.0, 0.0, top, 0.0, 0.0, 0.0, slope]])
    row.setflags(write=False)
    return row


@cache_by_curve(256)
def approach_windows(sensor: SensorModel, low: float, high: float) -> FloatArray:
    """Return the polynomial approximation of a sensor curve for the drag solver.

    The polynomials are those of `curve_windows` if there are any, else those of `curve_pieces`. The latter may raise a
    CurveError.
    """
    slope = sensor.constant_log_slope
    if slope is not None:
        table = np.array([[low, low, high, low, low, 0.0, slope]])
    else:
        table = curve_windows(sensor, low, high)
        table = table if len(table) else windows_of_pieces(sensor, low, high)
    table.setflags(write=False)
    return table


def windows_of_pieces(sensor: SensorModel, low: float, high: float) -> FloatArray:
    """Return polynomials that approximate a sensor curve on adjacent distance intervals.

    The table has the format of `curve_windows`.
    """
    pieces = curve_pieces(sensor, low, high)
    middle, half = pieces[:, :1], pieces[:, 1:2]
    table = np.zeros((len(pieces), TERMS + HIGH_DEGREE + 1))
    borders = np.append((middle - half)[:, 0], pieces[-1, 0] + pieces[-1, 1])
    table[:, EDGE] = table[:, LOW] = table[:, SWITCH] = borders[:-1]
    table[:, TOP], table[:, MIDDLE] = borders[1:], pieces[:, 0]
    powers = np.arange(1, pieces.shape[1] - 1)
    scales = half ** (powers - 1.0)
    terms = table[:, TERMS + 1 : TERMS + 1 + len(powers)]
    np.divide(pieces[:, 2:] / powers, scales, out=terms, where=scales > _TINY)
    return table


def power_window(sensor: SensorModel, low: float, high: float) -> FloatArray | None:
    """Return the polynomial table of an inverse power curve.

    The result is None for other curves. For the inverse power curve, 1 / g is linear in l.
    """
    if any(low < k < high for k in sensor.knots):
        return None
    distance = low + (high - low) * np.concatenate([[0.0], np.sin(np.pi / 4 * np.linspace(0, 1, 65)) ** 4, [1.0]])
    with np.errstate(all="ignore"):  # curves with values that are not finite take the most robust solver
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
    """Approximate sensor curves by polynomials on overlapping distance intervals.

    Args:
        slope: function from distances [m], shape (m,), to g [1/m], shape (m,), or (k, m) for k curves.
        edges: lower end, corners of the curve, and upper end [m], ascending.
        degree: degree of ln xi.
        most: largest number of windows, plus two per corner; None: 2,000.

    Returns:
        The windows as in `curve_windows`, with the polynomials of the first curve; None if more are needed.
    """
    low, high = edges[0], edges[-1]
    limit = _MAX_WINDOWS if most is None else most + 2 * (len(edges) - 2)
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
    """Fit a polynomial in l - (low + high) / 2 to the log output ln xi; None if the error is too large."""
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
    with np.errstate(all="ignore"):  # powers of an extreme width overflow
        coefficients = terms[:, 0] / powers / half ** (powers - 1.0)
    return np.concatenate([[0.0], coefficients]) if np.isfinite(coefficients).all() else None


class CurveError(InvalidInputError):
    """Error that is raised if polynomials cannot approximate a sensor curve.

    Args:
        message: what was found, what is expected, what to do.
        culprit: smallest probed distance at which the slope is not finite [m]; None if the slope is too rough.
    """

    def __init__(self, message: str, culprit: float | None = None) -> None:
        super().__init__(message)
        self.culprit = culprit


@cache_by_curve(256)
def curve_pieces(sensor: SensorModel, low: float, high: float) -> FloatArray:
    """Approximate the slope of a sensor curve by polynomials on short intervals.

    The curve is approximated between two valid distances [m].

    Returns:
        One row per piece, ascending: its middle [m], its half width [m] and the coefficients of g [1/m] in
        z = (l - middle) / half, ten of them. The error is below 1e-13 of the largest slope on the piece, or at the
        rounding level of the curve.

    Raises:
        CurveError: the slope is not finite, or too rough.
    """
    decades = high / _GROWTH ** np.arange(1, 8)  # keep the resolution of the near field if the end is far away
    edges = np.unique([low, *(e for e in (*sensor.knots, *decades) if low < e < high), high])
    evaluate = partial(_slope, sensor)
    whole, _, _ = interpolate(evaluate, (edges[:-1] + edges[1:]) / 2, np.diff(edges) / 2)
    beyond = np.maximum.accumulate(np.abs(whole).max(axis=1)[::-1])[
        ::-1
    ]  # the largest slope at this and all larger distances
    none = np.zeros(len(beyond))
    pending = np.stack([edges[:-1], edges[1:], 1e-9 * np.diff(edges), none + np.inf, beyond, none])
    done: list[FloatArray] = []
    while pending.size:
        left, right, smallest, before, beyond, in_vain = pending
        middle, half = (left + right) / 2, (right - left) / 2
        slope, coefficients, error = interpolate(evaluate, middle, half)
        # If the curve itself is at its rounding level, as a recessed one near a flat end, halving gains nothing. One
        # failed halving does not prove this, since a wide piece may miss a narrow feature.
        in_vain = np.where(error > 0.25 * before, in_vain + 1, 0)
        rounded = (in_vain >= _IN_VAIN) & (error <= _ROUNDING * beyond)
        fits = (error <= TOLERANCE * np.abs(slope).max(axis=1)) | rounded | (half < smallest)
        done.append(np.column_stack([middle, half, coefficients])[fits])
        lower = np.stack([left, middle, smallest, error, beyond, in_vain])[:, ~fits]
        upper = np.stack([middle, right, smallest, error, beyond, in_vain])[:, ~fits]
        pending = np.concatenate([lower, upper], axis=1)
        if pending.shape[1] + sum(map(len, done)) > _MAX_PIECES:
            raise CurveError(
                f"sensor: the {sensor.name} curve is too rough; smooth the curve, declare its corners, or set a "
                f"smaller maximum_distance. The interpolation from {low:g} m to {high:g} m needs more than "
                f"{_MAX_PIECES} polynomials"
            )
    pieces = np.concatenate(done)
    pieces = pieces[np.argsort(pieces[:, 0])]
    pieces.setflags(write=False)
    return pieces


def interpolate(
    function: Callable[[FloatArray], FloatArray], middle: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return polynomials that interpolate a function, one on each of several intervals.

    The result holds the values at the nodes, the coefficients of (l - middle) / half, and the largest error.
    """
    values, probed = (function(middle[:, None] + half[:, None] * z) for z in (_NODES, _PROBES))
    coefficients = values @ _TO_COEFFICIENTS.T
    return values, coefficients, np.abs(coefficients @ _AT_PROBES.T - probed).max(axis=-1)


def _slope(sensor: SensorModel, distance: FloatArray) -> FloatArray:
    """Return the sensor slope [1/m] at given distances [m]."""
    distance = np.clip(distance, *sensor.valid_range)
    with np.errstate(all="ignore"):  # values that are not finite are found below
        slope = np.asarray(sensor.log_slope(distance))
    if not np.isfinite(slope).all():
        culprit = float(distance[~np.isfinite(slope)].min())
        raise CurveError(
            f"sensor: the slope of the {sensor.name} curve is not finite at a distance of {culprit:g} m; exclude this "
            "distance by minimum_distance or maximum_distance",
            culprit,
        )
    return slope


@cache_by_curve(256)
def curve_reach(sensor: SensorModel, low: float, start: float, high: float) -> float:
    """Find the largest distance at which a sensor curve is usable.

    Up to this distance, polynomials can approximate the curve. A custom curve may fail below its `maximum_distance`.

    The search covers the distances from `low` to `high`. The curve must be usable at least up to `start`, all in m.

    Returns:
        The largest usable distance [m]: `high` if the whole curve is usable, else the last distance with a finite
        slope, or `high` halved until the curve is smooth.

    Raises:
        CurveError: the slope is not finite, or too rough, below `start`.
    """
    while True:
        try:
            curve_pieces(sensor, low, high)
        except CurveError as error:
            if high <= start:
                raise
            high = max(start, high / 2 if error.culprit is None else _last_finite(sensor, start, error.culprit))
        else:
            return high


def curve_tops(sensor: SensorModel, low: float, start: float, reach: float) -> Iterator[tuple[float, bool]]:
    """Yield increasing end distances [m] for approximating a sensor curve.

    Each distance comes with True if the curve continues beyond it. The curve starts at `low`.

    A motion may leave the approximated range and come back. The first end is `reach` [m]; the curve is needed at least
    up to `start` [m].
    """
    end, goes_on = sensor.valid_range[1], True
    while goes_on and reach <= _GROWTH * _FARTHEST:
        wanted = min(end, reach)
        top = curve_reach(sensor, low, min(wanted, max(reach / _GROWTH, start)), wanted)
        goes_on = top == wanted < end
        yield top, goes_on
        reach *= _GROWTH


def _last_finite(sensor: SensorModel, good: float, bad: float) -> float:
    """Find the largest distance with a finite sensor slope by bisection."""
    while good < bad:
        middle = 0.5 * (good + bad)
        if not good < middle < bad:
            break
        with np.errstate(all="ignore"):
            finite = math.isfinite(sensor.log_slope(middle))
        good, bad = (middle, bad) if finite else (good, middle)
    return good
