"""Chebyshev series of two functions at many places, side by side."""

from __future__ import annotations

from typing import Any

import numpy as np

from pretouch.motion.kernels.blocks import BLOCK
from pretouch.motion.kernels.compiler import block_kernel, kernel

__all__ = ["interpolate"]

_Z, _FIRST, _BEFORE, _SECOND, _SECOND_BEFORE = (k * BLOCK for k in range(5))


@block_kernel
def _step(data: Any, first: float, second: float, count: int) -> None:
    """Take one step of Clenshaw's recurrence for both functions."""
    for i in range(count):
        z = data[i + _Z]
        b, c = data[i + _FIRST], data[i + _SECOND]
        data[i + _FIRST] = (first - data[i + _BEFORE]) + z * b
        data[i + _SECOND] = (second - data[i + _SECOND_BEFORE]) + z * c
        data[i + _BEFORE], data[i + _SECOND_BEFORE] = b, c


@kernel
def interpolate(place: Any, low: float, high: float, coefficients: Any, out: Any) -> None:
    """Evaluate two Chebyshev series.

    Args:
        place: where, in [low, high], shape (n,).
        low: start of the interval.
        high: its end.
        coefficients: those of T_0, T_1 ... on the interval, shape (2, m).
        out: filled with both functions, shape (2, n).
    """
    data = np.empty(5 * BLOCK)
    by_half, middle = 2.0 / (high - low), 0.5 * (low + high)
    for start in range(0, place.size, BLOCK):
        count = min(BLOCK, place.size - start)
        part = place[start : start + count]
        for i in range(count):
            data[i + _Z] = 2.0 * by_half * (part[i] - middle)
        data[BLOCK:] = 0.0
        for k in range(coefficients.shape[1] - 1, 0, -1):
            _step(data, coefficients[0, k], coefficients[1, k], count)
        for i in range(count):
            half = 0.5 * data[i + _Z]
            out[0, start + i] = coefficients[0, 0] + half * data[i + _FIRST] - data[i + _BEFORE]
            out[1, start + i] = coefficients[1, 0] + half * data[i + _SECOND] - data[i + _SECOND_BEFORE]
