"""Recompute the constants of the Mittag-Leffler function, which the compiled core contains."""

from __future__ import annotations

import re
from pathlib import Path

import mpmath
import numpy as np

from pretouch.sensors.mittag_leffler import mittag_leffler

SOURCE = Path(__file__).parents[2] / "native/core/mittag_leffler.cpp"
NODES = 18


def test_nodes_and_weights_are_those_of_the_parabola() -> None:
    """s(u) = mu (1 + i u)^2 at half-integer steps of 3 / N; the weight is that of exp(s) ds / (2 pi i) over s."""
    text = SOURCE.read_text(encoding="utf-8").partition("PARABOLA[NODES] = {")[2].partition("};")[0]
    printed = np.array([[float(v) for v in row.split(",")] for row in re.findall(r"\{([^{}]+)\}", text)])
    assert printed.shape == (NODES, 4)
    with mpmath.workdps(30):
        step, mu = mpmath.mpf(3) / NODES, mpmath.pi * NODES / 12
        for row, j in zip(printed, range(NODES), strict=True):
            node = mpmath.mpc(1, (j + mpmath.mpf(0.5)) * step)
            s = mu * node**2
            weight = 2 * mu * step / mpmath.pi * mpmath.exp(s) * node / s
            exact = (mpmath.log(s).real, mpmath.log(s).imag, weight.real, weight.imag)
            assert all(value == float(number) for value, number in zip(row, exact, strict=True))


def test_a_value_does_not_depend_on_the_other_arguments() -> None:
    """The integral along the line starts below the farthest argument, also if others are near."""
    far = -(10.0 ** np.arange(1, 200, 7))
    for order in (0.7, 0.95):
        alone = [mittag_leffler(np.array([order]), np.array([[z]])) for z in far]
        together = mittag_leffler(np.array([order]), np.concatenate([[-1.0, -2.0], far])[None, :])
        for k, values in enumerate(together):
            np.testing.assert_allclose(values[0, 2:], [each[k][0, 0] for each in alone], rtol=1e-12)
