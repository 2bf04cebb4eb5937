"""How a sensor curve changes with its parameters, as the compiled core reads it: polynomials on its pieces."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.sensors import SensorModel
from pretouch.sensors.change import SlopeChange

from .curve import AT_PROBES, NODES, PROBES, TO_COEFFICIENTS, curve_pieces, curve_reach
from .windows import MIDDLE, TERMS, curve_windows

__all__ = ["bend_at_contact", "changed_pieces"]

_TOLERANCE: Final = 1e-10  # of the largest change of slope: one taken by differences is not smoother
_HALVINGS: Final = 12
_COUNT: Final = len(NODES)  # coefficients of a piece


def changed_pieces(sensor: SensorModel, slopes: tuple[SlopeChange, ...], high: float) -> tuple[FloatArray, FloatArray]:
    """Approximate the slope of a curve and changes of it on common pieces.

    Args:
        sensor: the curve, valid down to l = 0.
        slopes: changes of its slope, functions of the distance.
        high: where the pieces end [m], inside the valid range.

    Returns:
        Pieces as `curve_pieces` has them, from 0 upward, and the coefficients of the changes in the same variable,
        shape (pieces, changes, 10); they meet the changes to 1e-10 of their largest value.
    """
    pieces = curve_pieces(sensor, 0.0, high)
    if not slopes:
        return pieces, np.zeros((len(pieces), 0, _COUNT))
    for _ in range(_HALVINGS):
        middle, half = pieces[:, :1], pieces[:, 1:2]
        values = _sampled(sensor, slopes, middle + half * NODES)
        terms = values @ TO_COEFFICIENTS.T
        error = np.abs(terms @ AT_PROBES.T - _sampled(sensor, slopes, middle + half * PROBES)).max(axis=2)
        poor = (error > _TOLERANCE * np.abs(values).max(axis=(0, 2))).any(axis=1)
        if not poor.any():
            break
        pieces = _halved(pieces, poor)
    return pieces, np.ascontiguousarray(terms)


def _sampled(sensor: SensorModel, slopes: tuple[SlopeChange, ...], distance: FloatArray) -> FloatArray:
    low, high = sensor.valid_range
    inside = np.clip(distance, low, high)
    return np.stack([np.asarray(slope(inside), dtype=np.float64) for slope in slopes], axis=1)


def _halved(pieces: FloatArray, poor: BoolArray) -> FloatArray:
    """Cut pieces in two; their polynomials stay what they are."""
    parts = [pieces[~poor]]
    for side in (-0.5, 0.5):
        change = np.array([[_binomial(j, i) * side ** (j - i) * 0.5**i for j in range(_COUNT)] for i in range(_COUNT)])
        old = pieces[poor]
        parts.append(np.column_stack([old[:, 0] + side * old[:, 1], old[:, 1] / 2, old[:, 2:] @ change.T]))
    both = np.concatenate(parts)
    return both[np.argsort(both[:, 0])]


def _binomial(n: int, k: int) -> float:
    return float(np.prod([(n - i) / (i + 1) for i in range(k)])) if k <= n else 0.0


def bend_at_contact(sensor: SensorModel) -> float:
    """Return dg/dl at l = 0.

    Args:
        sensor: the curve, valid down to l = 0.

    Returns:
        The derivative [1/m^2], of the polynomial that meets g beside the surface; good to some 1e-11 of g over the
        distance in which the curve changes.
    """
    if sensor.constant_log_slope is not None:
        return 0.0
    reach = min(1.0, sensor.valid_range[1])
    windows = curve_windows(sensor, 0.0, reach)
    if len(windows):
        z, terms = -windows[0, MIDDLE], windows[0, TERMS:]
        if len(terms) == 1:
            return float(-terms[0] / z**2)
        return float(sum(j * (j - 1) * terms[j] * z ** (j - 2) for j in range(2, len(terms))))
    piece = curve_pieces(sensor, 0.0, curve_reach(sensor, 0.0, 0.0, reach))[0]
    z = -piece[0] / piece[1]
    return float(sum(j * piece[2 + j] * z ** (j - 1) for j in range(1, _COUNT)) / piece[1])
