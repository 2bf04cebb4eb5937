"""Chebyshev's polynomials on [-1, 1]: nodes, and what leads from values there to coefficients and derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .numbers import FloatArray

__all__ = ["ChebyshevBasis", "chebyshev_basis", "chebyshev_extremes", "chebyshev_nodes", "chebyshev_sum"]


def chebyshev_nodes(count: int) -> FloatArray:
    """Return the roots of T_count, from 1 down: the nodes of an interpolation."""
    return np.asarray(np.cos((np.arange(count) + 0.5) * np.pi / count))


def chebyshev_extremes(degree: int) -> FloatArray:
    """Return where |T_degree| = 1, from 1 down to -1, shape (degree + 1,): between the nodes, and at the ends."""
    return np.asarray(np.cos(np.arange(degree + 1) * np.pi / degree))


def chebyshev_sum(terms: FloatArray, z: FloatArray | float) -> FloatArray:
    """Evaluate series, their coefficients along the first axis and one column for each, at one point each."""
    return np.asarray(np.polynomial.chebyshev.chebval(z, terms, tensor=False))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChebyshevBasis:
    """The polynomials up to a degree, as they are found from values at nodes.

    Args:
        nodes: where values are known, shape (n,).
        values: the polynomials there, shape (n, degree + 1).
        to_terms: from values at the nodes to coefficients, shape (degree + 1, n): through the values, or nearest to
            them in the mean square where there are more of them than coefficients.
        to_slope: from values at the nodes to the coefficients of the derivative, shape (degree, n).
        to_bend: the same for the second derivative, shape (degree - 1, n).
    """

    nodes: FloatArray
    values: FloatArray
    to_terms: FloatArray
    to_slope: FloatArray
    to_bend: FloatArray


@lru_cache
def chebyshev_basis(at: tuple[float, ...] | int, degree: int | None = None) -> ChebyshevBasis:
    """Make the basis for a number of nodes, or for given ones.

    Args:
        at: how many nodes; or nodes of one's own in [-1, 1].
        degree: of the highest polynomial; through all values where none is given.

    Returns:
        The basis.
    """
    where = chebyshev_nodes(at) if isinstance(at, int) else np.array(at)
    highest = len(where) - 1 if degree is None else degree
    values = np.asarray(np.polynomial.chebyshev.chebvander(where, highest))
    to_terms = np.linalg.inv(values) if highest == len(where) - 1 else np.linalg.pinv(values)
    return ChebyshevBasis(
        nodes=where,
        values=values,
        to_terms=to_terms,
        to_slope=np.asarray(np.polynomial.chebyshev.chebder(to_terms), dtype=np.float64),
        to_bend=np.asarray(np.polynomial.chebyshev.chebder(to_terms, 2), dtype=np.float64),
    )
