"""The common case of L(10)-(13) in NumPy, over-damped with an obstacle in uniform motion: needs no compiled core.

With c = g D_p and d = D + c, L(8) has the solution l = v t + q + C_1 exp(lambda_1 t) + C_2 exp(lambda_2 t) with
q = p - c v / K. Its velocity is v + A_1 E_1 + A_2 E_2 with A_i = lambda_i C_i and 0 < E_i <= 1, so that

    max(A_1, 0) + max(A_2, 0) < -v    proves    l' < 0 for good:

there is one zero of l, and whatever iteration ends on it has found the first contact. Encounters for which this or
the convergence is not proved are left to the guaranteed path.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray

__all__ = ["STATES", "solve_over_damped"]

STATES: Final = (
    "time",
    "displacement",
    "displacement_velocity",
    "displacement_acceleration",
    "relative_velocity",
    "displacement_integral",
)
"""The rows that are filled, by their names in layout.COLUMNS."""

_DISTINCT: Final = 1e-3  # of d^2: nearer to critical damping the two exponentials lose digits
_CANCELED: Final = 1e3  # largest loss of digits
_STEPS: Final = 12
_CONVERGED: Final = 1e-6  # of t: each step cubes what is left


def solve_over_damped(columns: tuple[FloatArray, ...], slope: float, horizon: float) -> tuple[FloatArray, BoolArray]:
    """Solve encounters of L(8) by L(10)-(13) where that is proved to find the first contact.

    Args:
        columns: relative quantities of Scenario.relative_columns and the gain, as in Request.columns.
        slope: g [1/m].
        horizon: how long to wait for contact [s].

    Returns:
        STATES at contact, shape (6, n), and which encounters are solved, shape (n,).
    """
    mass, damping, stiffness, x_0, u_0, p, v, a, _, _, gain = np.broadcast_arrays(*columns)
    coupling = slope * gain
    d = damping + coupling
    with np.errstate(all="ignore"):  # what is not finite is not proved
        disc = d * d - 4 * mass * stiffness
        fast = -(d + np.sqrt(disc)) / (2 * mass)
        slow = stiffness / (mass * fast)
        q = p - coupling * v / stiffness
        start, speed = p - x_0, v - u_0
        c_1 = (speed - v - fast * (start - q)) / (slow - fast)
        c_2 = start - q - c_1
        proved = (a == 0) & (d > 0) & (stiffness > 0) & (disc > _DISTINCT * d * d) & (speed < 0)
        proved &= np.maximum(slow * c_1, 0) + np.maximum(fast * c_2, 0) < -v * (1 - 1e-9)
        t, converged = _root(np.where(q > 0, q, start), start, (v, q, c_1, c_2, slow, fast))
        e_1, e_2 = np.exp(slow * t), np.exp(fast * t)
        rate = v + slow * c_1 * e_1 + fast * c_2 * e_2
        bend = slow * slow * c_1 * e_1 + fast * fast * c_2 * e_2
        decayed = c_1 * np.expm1(slow * t) / slow + c_2 * np.expm1(fast * t) / fast
        integral = (p - q) * t - decayed
        terms = np.abs(v * t) + np.abs(q) + np.abs(c_1) + np.abs(c_2)  # what cancels at contact
        proved &= terms < _CANCELED * np.abs(rate) * t
        proved &= converged & (t > 0) & (t <= horizon) & (rate < 0)
        states = np.stack([t, p + v * t, v - rate, -bend, rate, integral])
    return states, proved & np.isfinite(states).all(axis=0)


def _root(asymptotic: FloatArray, start: FloatArray, motion: tuple[FloatArray, ...]) -> tuple[FloatArray, BoolArray]:
    """Find the zero of a falling l from between the times of the free and the asymptotic motion, by Halley's method."""
    v, q, c_1, c_2, slow, fast = motion
    t = np.sqrt(asymptotic * start) / -v
    step = np.full_like(t, np.inf)
    for _ in range(_STEPS):
        e_1, e_2 = c_1 * np.exp(slow * t), c_2 * np.exp(fast * t)
        value = v * t + q + e_1 + e_2
        rate = v + slow * e_1 + fast * e_2
        bend = slow * slow * e_1 + fast * fast * e_2
        newton = value / rate
        step = newton / np.maximum(1 - 0.5 * newton * bend / rate, 0.5)
        t = np.maximum(t - step, 0.1 * t)
        if not (np.abs(step) > _CONVERGED * t).any():
            break
    return t, np.abs(step) <= _CONVERGED * t
