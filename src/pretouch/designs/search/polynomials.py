"""Minimize smooth functions that are approximated by Chebyshev polynomials."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, chebyshev_basis, chebyshev_sum

NODE_COUNT: Final = 17
FIT: Final = 1e-7  # largest error of a polynomial at the nodes, relative to the range of values
_SMOOTH: Final = chebyshev_basis(NODE_COUNT, 8)  # few terms, for a derivative with little rounding error
_TO_MISS: Final = (_SMOOTH.values @ _SMOOTH.to_terms - np.eye(NODE_COUNT)).T
_ENDS: Final = np.concatenate([[1.0], _SMOOTH.nodes, [-1.0]])
_ORDERS: Final = np.arange(8.0)[:, None]
_THROUGH: Final = chebyshev_basis(NODE_COUNT)  # all terms, for the value
NODES: Final = _SMOOTH.nodes
"""Nodes in [-1, 1] at which a bracket is sampled for its polynomial."""


def minimize_polynomials(values: FloatArray, fit: float = FIT, *, steps: int = 8) -> tuple[FloatArray, BoolArray]:
    """Fit polynomials to sampled functions, and return their minima.

    The functions are sampled at NODES, shape (m, 17). Newton's method solves df/dz = 0 between the neighbors of the
    lowest node. Bisection replaces steps that leave this interval, as at minima flatter than a parabola. A polynomial
    must fit the values to `fit` of their range.

    Returns:
        The minima, and which of them are certain.
    """
    lowest = np.argmin(values, axis=1)
    z, low, high = NODES[lowest], _ENDS[lowest + 2], _ENDS[lowest]
    settled: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
    values = np.where(settled[:, None], values, 0.0)
    values = values - values.min(axis=1, keepdims=True)  # exact, and it reduces the rounding error of the sums
    allowed = fit * np.ptp(values, axis=1)
    settled &= np.abs(values @ _TO_MISS).max(axis=1) <= allowed
    if not settled.any():
        return z, settled
    terms, slopes, bends = (to @ values.T for to in (_SMOOTH.to_terms, _SMOOTH.to_slope, _SMOOTH.to_bend))
    first = chebyshev_sum(terms, z)
    with np.errstate(all="ignore"):
        for _ in range(steps):
            powers = np.cos(_ORDERS * np.arccos(z))  # the Chebyshev polynomials at z
            slope = (slopes * powers).sum(axis=0)
            falls = slope < 0
            low, high = np.where(falls, z, low), np.where(falls, high, z)
            at = z - slope / (bends * powers[:-1]).sum(axis=0)
            at = np.where((at >= low) & (at <= high), at, 0.5 * (low + high))
            step, z = np.abs(at - z), at
            if (step < 1e-13).all():
                break
    return z, settled & (step < 1e-10) & (np.abs(z) < 1) & (chebyshev_sum(terms, z) <= first + allowed)


def interpolate(values: FloatArray, z: FloatArray) -> FloatArray:
    """Interpolate several functions between Chebyshev nodes.

    Returns:
        The value of each function at its own point.
    """
    with np.errstate(invalid="ignore"):  # a function that is undefined at some node is NaN
        return chebyshev_sum(_THROUGH.to_terms @ values.T, z)
