"""Any sensor curve as a piecewise polynomial of its slope, the one form that the compiled integrator knows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from pretouch._core.chebyshev import chebyshev_extremes, chebyshev_nodes
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel
from pretouch.sensors.kept import kept_by_curve

__all__ = ["AT_PROBES", "NODES", "PROBES", "TO_COEFFICIENTS", "curve_pieces", "curve_reach", "curve_tops"]

_DEGREE: Final = 9
_TOLERANCE: Final = 1e-13  # of the largest slope on the piece
_ROUNDING: Final = 1e-9  # of the largest slope from there outward: a larger error is one of the polynomial
_IN_VAIN: Final = 3  # halvings
_MAX_PIECES: Final = 20_000
_GROWTH: Final = 64.0
_FARTHEST: Final = 1e12

NODES: Final = chebyshev_nodes(_DEGREE + 1)
"""Where a piece is interpolated, in z."""

PROBES: Final = chebyshev_extremes(_DEGREE + 1)[1:-1]
"""Where it is put to the test."""

TO_COEFFICIENTS: Final = np.linalg.inv(np.vander(NODES, increasing=True))
"""From values at the nodes to coefficients of powers of z."""

AT_PROBES: Final = np.vander(PROBES, _DEGREE + 1, increasing=True)
"""From coefficients to values at the probes."""


class CurveError(InvalidInputError):
    """A curve cannot be approximated.

    Args:
        message: what was found, what must hold, what to try.
        culprit: the smallest distance looked at where the slope is not finite [m]; None where it is too rough.
    """

    def __init__(self, message: str, culprit: float | None = None) -> None:
        super().__init__(message)
        self.culprit = culprit


@kept_by_curve(256)
def curve_pieces(sensor: SensorModel, low: float, high: float) -> FloatArray:
    """Approximate the slope g of a curve by polynomials on pieces that are halved until they fit.

    Args:
        sensor: the curve.
        low: where the pieces start [m], inside the valid range.
        high: where they end [m], inside the valid range.

    Returns:
        One row per piece, ascending: its middle [m], its half width [m] and the coefficients of g [1/m] in
        z = (l - middle) / half, ten of them. The slope is met to 1e-13 of its largest magnitude on the piece, or as
        well as the curve itself rounds.

    Raises:
        CurveError: the slope is not finite, or too rough to be a curve.
    """
    decades = high / _GROWTH ** np.arange(1, 8)  # a far end must not cost the near field its resolution
    edges = np.unique([low, *(e for e in (*sensor.knots, *decades) if low < e < high), high])
    whole = _slope(sensor, (edges[:-1] + edges[1:]) / 2, np.diff(edges) / 2, NODES)
    beyond = np.maximum.accumulate(np.abs(whole).max(axis=1)[::-1])[::-1]  # what an approach has felt on its way
    none = np.zeros(len(beyond))
    pending = np.stack([edges[:-1], edges[1:], 1e-9 * np.diff(edges), none + np.inf, beyond, none], axis=1)
    done: list[FloatArray] = []
    while len(pending):
        middle, half, smallest = pending[:, :2].mean(axis=1), (pending[:, 1] - pending[:, 0]) / 2, pending[:, 2]
        slope = _slope(sensor, middle, half, NODES)
        coefficients = slope @ TO_COEFFICIENTS.T
        error = np.abs(coefficients @ AT_PROBES.T - _slope(sensor, middle, half, PROBES)).max(axis=1)
        largest = np.abs(slope).max(axis=1)
        # where the curve rounds its distances, as a recessed one near a flat end, halving a piece gains nothing; once
        # is no proof of that, since a wide piece may not see what is narrow
        in_vain = np.where(error > 0.25 * pending[:, 3], pending[:, 5] + 1, 0)
        rounded = (in_vain >= _IN_VAIN) & (error <= _ROUNDING * pending[:, 4])
        fits = (error <= _TOLERANCE * largest) | rounded | (half < smallest)
        done.append(np.column_stack([middle, half, coefficients])[fits])
        left = pending[~fits]
        centers, rest = (
            left[:, :2].mean(axis=1),
            np.column_stack([left[:, 2], error[~fits], left[:, 4], in_vain[~fits]]),
        )
        lower = np.column_stack([left[:, 0], centers, rest])
        pending = np.concatenate([lower, np.column_stack([centers, left[:, 1], rest])])
        if len(pending) + sum(map(len, done)) > _MAX_PIECES:
            raise CurveError(
                f"sensor: the slope of the {sensor.name} curve needs more than {_MAX_PIECES} polynomials between "
                f"{low:g} m and {high:g} m; smooth it, name its corners, or end it by maximum_distance where it ceases "
                "to be smooth"
            )
    pieces = np.concatenate(done)
    pieces = pieces[np.argsort(pieces[:, 0])]
    pieces.setflags(write=False)
    return pieces


def _slope(sensor: SensorModel, middle: FloatArray, half: FloatArray, z: FloatArray) -> FloatArray:
    low, high = sensor.valid_range
    distance = np.clip(middle[:, None] + half[:, None] * z, low, high)
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


@kept_by_curve(256)
def curve_reach(sensor: SensorModel, low: float, start: float, high: float) -> float:
    """Find how far out a curve can be followed: one of a user's, without a largest distance, may end somewhere.

    Args:
        sensor: the curve.
        low: where it is needed from [m], inside the valid range.
        start: how far it is needed at least [m].
        high: how far it is wanted [m], inside the valid range.

    Returns:
        The largest distance: high where it holds all along, else where the slope ceases to be finite, or a power of
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
    """Yield how far out a curve is to be followed, each time farther, for motions that outgrow it and may come back.

    Args:
        sensor: the curve.
        low: where it is needed from [m], inside the valid range.
        start: how far it is needed at least [m].
        reach: how far it is wanted at first [m].

    Yields:
        A distance [m], and whether the curve may go on beyond it.
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
