"""Derivatives of the common case of L(10)-(13) in NumPy: what `over_damped` solves, without the compiled core.

The solution is an analytic function of its inputs, so the derivative by one of them is the imaginary part that a tiny
imaginary part of it causes: no difference is formed, and no digit is lost. At contact l(t, q) = 0, hence
dt/dq = -(dl/dq) / l', and l' changes by dl'/dq + l'' dt/dq.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray

__all__ = ["MOST", "over_damped_gradients"]

MOST: Final = 4096
"""Encounters that NumPy does sooner than the compiled core is loaded."""

_TINY: Final = 1e-100
_DISTINCT: Final = 1e-3  # of d^2: nearer to critical damping the two exponentials lose digits
_MOVED: Final = 1e-2  # of the slower time constant
_CANCELED: Final = 1e3  # largest loss of digits
_INPUTS: Final = (0, 1, 2, 3, 4, 5, 6, 7, 10)  # the columns of a request that count: the reference is in them


def over_damped_gradients(
    columns: tuple[FloatArray, ...], slope: float, time: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Differentiate contacts of over-damped motions of constant slope.

    Args:
        columns: relative quantities of Scenario.relative_columns and the gain, as in Request.columns.
        slope: g [1/m].
        time: the times of contact [s], shape (n,).

    Returns:
        Derivatives of time and of l' by mass, damping, stiffness, x~(0), x~'(0), p, v, a and D_p, shape (2, 9, n),
        and which of the encounters are of this kind and lose few digits, shape (n,).
    """
    given = [np.broadcast_to(c, time.shape) for c in columns]
    with np.errstate(all="ignore"):  # what is not finite is not vouched for
        _, speed, bend, largest = _motion(given, slope, time)
        total = given[1] + slope * given[10]
        apart = total * total - 4 * given[0] * given[2] > _DISTINCT * total * total
        usual = (given[7] == 0) & (total > 0) & (given[2] > 0) & apart & (speed < 0)
        usual &= given[2] * time > _MOVED * total  # a hardly felt stiffness has the derivative of a difference
        usual &= largest < _CANCELED * np.abs(speed) * time
        usual &= np.abs(total * slope * given[10]) < _CANCELED * (given[2] * time) ** 2  # the drift of an acceleration
        found = np.empty((2, len(_INPUTS), len(time)))
        for row, which in enumerate(_INPUTS):
            moved: list[Any] = list(given)
            moved[which] = given[which] + 1j * _TINY
            distance, rate, _, _ = _motion(moved, slope, time)
            found[0, row] = -distance.imag / _TINY / speed
            found[1, row] = rate.imag / _TINY + bend * found[0, row]
    return found, np.asarray(usual & np.isfinite(found).all(axis=(0, 1)))


def _motion(columns: Any, slope: float, t: FloatArray) -> tuple[Any, Any, Any, Any]:
    """Return l, l' and l'' at times t, and the sum of the terms of l."""
    mass, damping, stiffness, x_0, u_0, p, v, a, _, _, gain = columns
    coupling = slope * gain
    d = damping + coupling
    fast = -(d + np.sqrt(d * d - 4 * mass * stiffness)) / (2 * mass)
    slow = stiffness / (mass * fast)
    pull = coupling * a / stiffness  # what the acceleration of the obstacle adds to the motion in the end
    drift, q = v - pull, p - coupling * v / stiffness + d * pull / stiffness
    start, speed = p - x_0 - q, v - u_0 - drift
    c_1 = (speed - fast * start) / (slow - fast)
    e_1, e_2 = c_1 * np.exp(slow * t), (start - c_1) * np.exp(fast * t)
    path = (drift + a / 2 * t) * t
    largest = np.abs(v * t) + np.abs(q) + np.abs(c_1) + np.abs(start - c_1)
    return path + q + e_1 + e_2, drift + a * t + slow * e_1 + fast * e_2, a + slow**2 * e_1 + fast**2 * e_2, largest
