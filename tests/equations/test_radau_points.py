"""Recompute the Radau points and their matrices, which are constants of the compiled core."""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre

from pretouch._core.native import POINTER, address, kernel

POINTS = 10


def printed() -> list[np.ndarray]:
    """Points, integrals, matrix to Legendre coefficients, double integrals, and matrix from Legendre to powers."""
    tables = np.zeros(POINTS + 4 * POINTS**2)
    kernel("radau_points", POINTER)(address(tables))
    return [tables[:POINTS], *tables[POINTS:].reshape(4, POINTS, POINTS)]


def points() -> np.ndarray:
    """Zeros of P_s - P_{s-1}, in (0, 1]."""
    series = np.zeros(POINTS + 1)
    series[-2:] = -1.0, 1.0
    nodes = np.sort(legendre.legroots(series).real)
    for _ in range(3):
        nodes -= legendre.legval(nodes, series) / legendre.legval(nodes, legendre.legder(series))
    nodes[-1] = 1.0
    return np.asarray((nodes + 1) / 2)


def test_points_and_matrices_are_those_of_legendre_polynomials() -> None:
    """Equal within the rounding of sums of ten terms; values at the points and their inverses are at most 1."""
    nodes, integrals, to_legendre, twice, _ = printed()
    at = 2 * points() - 1
    values = legendre.legvander(at, POINTS - 1)
    rounding = 10 * np.finfo(float).eps
    assert np.abs(nodes - points()).max() < rounding
    assert np.abs(to_legendre @ values - np.eye(POINTS)).max() < 10 * rounding
    parts = np.column_stack([legendre.legval(at, legendre.legint(row, lbnd=-1)) / 2 for row in np.eye(POINTS)])
    assert np.abs(integrals - parts @ np.linalg.inv(values)).max() < rounding
    assert np.abs(twice - integrals @ integrals).max() < rounding


def test_coefficients_of_the_shifted_polynomials_are_whole_and_exact() -> None:
    to_powers = printed()[4]
    for n in range(POINTS):
        for k in range(POINTS):
            assert to_powers[k, n] == (-1) ** (n + k) * math.comb(n, k) * math.comb(n + k, k)


def test_the_quadrature_is_exact_up_to_its_degree() -> None:
    """Radau's ten weights integrate powers up to 2 s - 2 = 18; the stages integrate those up to 9."""
    nodes, integrals = printed()[:2]
    for power in range(2 * POINTS - 1):
        assert abs(integrals[-1] @ nodes**power - 1 / (power + 1)) < 1e-15
    for power in range(POINTS):
        assert np.abs(integrals @ nodes**power - nodes ** (power + 1) / (power + 1)).max() < 1e-15
