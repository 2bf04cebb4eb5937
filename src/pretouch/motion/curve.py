"""Any sensor curve as a piecewise polynomial of its slope, the one form that the compiled integrator knows."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel

__all__ = ["curve_pieces"]

_DEGREE: Final = 9
_TOLERANCE: Final = 1e-13  # of the largest slope on the piece
_ROUNDING: Final = 1e-9  # of the same: a larger error is one of the polynomial
_MAX_PIECES: Final = 20_000
_GROWTH: Final = 64.0

_NODES: Final = np.cos((np.arange(_DEGREE + 1) + 0.5) * np.pi / (_DEGREE + 1))
_PROBES: Final = np.cos(np.arange(1, _DEGREE + 1) * np.pi / (_DEGREE + 1))
_TO_COEFFICIENTS: Final = np.linalg.inv(np.vander(_NODES, increasing=True))
_AT_PROBES: Final = np.vander(_PROBES, _DEGREE + 1, increasing=True)


@lru_cache(maxsize=256)
def curve_pieces(sensor: SensorModel, low: float, high: float) -> FloatArray:
    """Approximate the slope g of a curve by polynomials on pieces that are halved until they fit.

    Args:
        sensor: the curve.
        low: where the pieces start [m], inside the valid range.
        high: where they end [m], inside the valid range.

    Returns:
        One row per piece, ascending: its middle [m], its half width [m] and the coefficients of g [1/m] in
        z = (l - middle) / half, ten of them. The slope is met to 1e-13 of its largest magnitude on the piece.

    Raises:
        InvalidInputError: the slope is not finite, or too rough to be a curve.
    """
    decades = high / _GROWTH ** np.arange(1, 8)  # a far end must not cost the near field its resolution
    edges = np.unique([low, *(e for e in (*sensor.knots, *decades) if low < e < high), high])
    pending = np.stack([edges[:-1], edges[1:], 1e-9 * np.diff(edges), np.full(len(edges) - 1, np.inf)], axis=1)
    done: list[FloatArray] = []
    while len(pending):
        middle, half, smallest = pending[:, :2].mean(axis=1), (pending[:, 1] - pending[:, 0]) / 2, pending[:, 2]
        slope = _slope(sensor, middle, half, _NODES)
        coefficients = slope @ _TO_COEFFICIENTS.T
        error = np.abs(coefficients @ _AT_PROBES.T - _slope(sensor, middle, half, _PROBES)).max(axis=1)
        largest = np.abs(slope).max(axis=1)
        # where the curve rounds its distances, as a recessed one near a flat end, halving a piece gains nothing
        rounded = (error > 0.25 * pending[:, 3]) & (error <= _ROUNDING * largest)
        fits = (error <= _TOLERANCE * largest) | rounded | (half < smallest)
        done.append(np.column_stack([middle, half, coefficients])[fits])
        left = pending[~fits]
        centers, rest = left[:, :2].mean(axis=1), np.column_stack([left[:, 2], error[~fits]])
        lower = np.column_stack([left[:, 0], centers, rest])
        pending = np.concatenate([lower, np.column_stack([centers, left[:, 1], rest])])
        if len(pending) + sum(map(len, done)) > _MAX_PIECES:
            raise InvalidInputError(
                f"sensor: the slope of the {sensor.name} curve needs more than {_MAX_PIECES} polynomials between "
                f"{low:g} m and {high:g} m; smooth it, or name its corners"
            )
    pieces = np.concatenate(done)
    pieces = pieces[np.argsort(pieces[:, 0])]
    pieces.setflags(write=False)
    return pieces


def _slope(sensor: SensorModel, middle: FloatArray, half: FloatArray, z: FloatArray) -> FloatArray:
    low, high = sensor.valid_range
    distance = np.clip(middle[:, None] + half[:, None] * z, low, high)
    slope = np.asarray(sensor.log_slope(distance))
    if not np.isfinite(slope).all():
        culprit = float(distance[~np.isfinite(slope)][0])
        raise InvalidInputError(f"sensor: the slope of the {sensor.name} curve is not finite at {culprit:g} m")
    return slope
