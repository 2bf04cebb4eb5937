"""Provide points and matrices of ten-point Radau collocation.

The functions apply them to many integration steps.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.polynomial import legendre

from pretouch._core.native import POINTER, address, kernel
from pretouch._core.numbers import BoolArray, FloatArray

POINTS: Final = 10
"""Number of collocation points of a step; they lie in (0, 1], and 1 is the last."""


_ROOT_STEPS: Final = 8


class Tables(NamedTuple):
    """Points and matrices of Radau collocation for one integration step.

    The step reaches from 0 to 1. The Gauss points serve to check the impulse balance.
    """

    nodes: FloatArray  # (POINTS + 1,)
    integrals: FloatArray  # (POINTS, POINTS): integrals of the Lagrange polynomials from 0 to each collocation point
    twice: FloatArray  # its square
    to_legendre: FloatArray  # (POINTS + 1, POINTS + 1): Legendre coefficients from values at the nodes
    at_start: FloatArray  # (POINTS,): value at 0 from values at the collocation points
    at_gauss: FloatArray  # (POINTS, POINTS + 1): values at the Gauss points from values at the nodes
    gauss: FloatArray  # (POINTS,): Gauss points
    weights: FloatArray  # (POINTS,): weights of the Gauss points


@lru_cache(maxsize=1)
def tables() -> Tables:
    """Return the points and matrices of Radau collocation."""
    core = np.zeros(POINTS + 4 * POINTS**2)
    kernel("radau_points", POINTER)(address(core))
    integrals = core[POINTS:].reshape(4, POINTS, POINTS)[0].copy()
    nodes = np.concatenate([[0.0], core[:POINTS]])
    to_legendre = np.linalg.inv(legendre.legvander(2 * nodes - 1, POINTS))
    gauss, weights = legendre.leggauss(POINTS)
    return Tables(
        nodes=nodes,
        integrals=integrals,
        twice=integrals @ integrals,
        to_legendre=to_legendre,
        at_start=legendre.legvander([-1.0], POINTS - 1)[0]
        @ np.linalg.inv(legendre.legvander(2 * nodes[1:] - 1, POINTS - 1)),
        at_gauss=legendre.legvander(gauss, POINTS) @ to_legendre,
        gauss=(gauss + 1) / 2,
        weights=weights / 2,
    )


def apply(matrix: FloatArray, values: FloatArray) -> FloatArray:
    """Multiply a matrix by each row of an array."""
    # The result of a row does not depend on the other rows. A single product of two matrices would round differently
    # for different numbers of rows.
    return np.asarray(np.matmul(matrix, values[..., None])[..., 0])


def evaluate(coefficients: FloatArray, at: FloatArray) -> FloatArray:
    """Evaluate the Legendre series in each row of an array."""
    # The points of a series are in the same row of `at`. The coefficients have the shape (n, k). The points lie between
    # 0 and 1 and have the shape (n, m).
    return np.asarray(legendre.legval(2 * at - 1, coefficients.T[:, :, None], tensor=False))


def first_root(values: FloatArray, passed: BoolArray) -> FloatArray:
    """Find the first zero crossing of the interpolated values in each step.

    The values of every step must cross zero.

    Args:
        values: values at the nodes, shape (n, POINTS + 1).
        passed: whether a value has crossed zero, same shape, true somewhere in each row but not in the first column.

    Returns:
        The roots, as shares of the step.
    """
    rows, after = np.arange(len(values)), passed.argmax(axis=1)
    nodes, coefficients = tables().nodes, apply(tables().to_legendre, values)
    low, high = nodes[after - 1], nodes[after]
    sign = np.where(values[rows, after] > 0, 1.0, -1.0)
    slopes = np.asarray(legendre.legder(coefficients, axis=1), dtype=np.float64)
    before, behind = values[rows, after - 1], values[rows, after]
    root = np.clip(low + (high - low) * before / np.where(before == behind, 1.0, before - behind), low, high)
    for _ in range(_ROOT_STEPS):  # Newton's method inside a bracket
        value = evaluate(coefficients, root[:, None])[:, 0] * sign
        slope = evaluate(slopes, root[:, None])[:, 0] * sign * 2
        low, high = np.where(value < 0, root, low), np.where(value < 0, high, root)
        moved = root - value / np.where(slope == 0, 1.0, slope)
        root = np.where((moved >= low) & (moved <= high) & (slope != 0), moved, (low + high) / 2)
    return np.asarray(root)
