"""Output curves L(3), L(5), L(6) compared with the printed formulas, and their slopes with computer algebra."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy
from printed_letter import exact, xi

from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower

DISTANCES = np.linspace(0.0, 0.075, 31)
EPS = np.finfo(float).eps


@pytest.mark.equation("L(3)", "L(5)", "L(6)", by="the printed formulas in 50 digits")
@pytest.mark.parametrize(
    "sensor",
    [
        InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        InversePower(scale=2.0, distance_offset=0.003, exponent=2.0),
        ExponentialFirstOrder(scale=0.458, rate=-61.0),
        ExponentialFirstOrder(scale=1.25, rate=-63.46),
        ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
        ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=-200.0),
        ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=0.0),
    ],
    ids=repr,
)
def test_the_output_is_the_printed_formula(sensor: InversePower) -> None:
    for ell, output, log_output in zip(DISTANCES, sensor.output(DISTANCES), sensor.log_output(DISTANCES), strict=True):
        with mpmath.workdps(50):
            printed = xi(sensor, exact(ell))
            error = float((exact(output) - printed) / printed)
            log_error = float(exact(log_output) - mpmath.log(printed))
        # ln xi is a sum of terms of at most 12 here (ln 1.3e-5, n ln l_0), and the output its exponential: each of six
        # operations rounds by half a unit of them, which the exponential makes a relative error
        assert abs(log_error) <= 3 * EPS * 12
        assert abs(error) <= 3 * EPS * 12 + EPS


L, BETA, L0, N, A, B, C = sympy.symbols("l beta l_0 n a b c", real=True)


@pytest.mark.equation("L(2)", "L(3)", "L(5)", "L(6)", by="symbolic differentiation of the printed formulas")
@pytest.mark.parametrize(
    ("printed", "numbers", "sensor"),
    [
        (
            BETA / (L + L0) ** N,
            {BETA: 1.30e-5, L0: 0.0419, N: 3.32},
            InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ),
        (A * sympy.exp(C * L), {A: 0.458, C: -61.0}, ExponentialFirstOrder(scale=0.458, rate=-61.0)),
        (
            A * sympy.exp(B * L**2 + C * L),
            {A: 0.480, B: 474.0, C: -74.0},
            ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
        ),
    ],
    ids=["L(3)", "L(5)", "L(6)"],
)
def test_the_slope_is_the_derivative_of_the_output_over_the_output(
    printed: sympy.Expr, numbers: dict, sensor: InversePower
) -> None:
    """g = (d xi / dl) / xi, the factor of l' in F_p = D_p xi'/xi."""
    slope = (printed.diff(L) / printed).subs({symbol: sympy.Float(value, 50) for symbol, value in numbers.items()})
    for ell, g in zip(DISTANCES, sensor.log_slope(DISTANCES), strict=True):
        expected = slope.subs(L, sympy.Float(float(ell), 50)).evalf(40)
        # three operations at most, on terms of at most 80 / m
        assert abs(float(sympy.Float(float(g), 50) - expected)) <= 2 * EPS * 80
