"""The overdamped closed form L(10)-(13), written once for math, NumPy, JAX, CasADi and heyoka.

`m` is the module with `exp` and `sqrt` for the arguments.
"""

from __future__ import annotations

from typing import Any

from .work import DAMPING, DISTANCE, EXPONENT, MASS, OFFSET, POSITION_SCALE, RATE, STIFFNESS, VELOCITY_SCALE

__all__ = ["distance", "householder", "merit", "polish", "slopes", "solve", "squared_slope", "start"]


def _motion(m: Any, v: Any, gain: Any) -> tuple[Any, ...]:
    """Return both eigenvalues, the final drift, and the amplitude of each eigenvalue."""
    half = (DAMPING + RATE * gain) / (2 * MASS)
    fast = -(half + m.sqrt(half * half - STIFFNESS / MASS))
    slow = STIFFNESS / MASS / fast
    drift = RATE / STIFFNESS * gain * v
    of_fast = drift * slow / (fast - slow)
    return fast, slow, drift, of_fast, -drift - of_fast


def distance(m: Any, t: Any, v: Any, gain: Any) -> tuple[Any, Any, Any, Any]:
    """Return l, l', l'' and l''' at t."""
    fast, slow, drift, of_fast, of_slow = _motion(m, v, gain)
    a, b = of_fast * m.exp(fast * t), of_slow * m.exp(slow * t)
    a1, b1 = fast * a, slow * b
    a2, b2 = fast * a1, slow * b1
    return DISTANCE + v * t - drift - (a + b), v - (a1 + b1), -(a2 + b2), -(fast * a2 + slow * b2)


def start(m: Any, v: Any, gain: Any) -> Any:
    """Estimate the contact between that without a force and that of the final steady motion."""
    free = -DISTANCE / v
    return m.sqrt(free * (free + RATE / STIFFNESS * gain))


def householder(m: Any, t: Any, v: Any, gain: Any) -> Any:
    """Improve a guess of the contact: order four."""
    level, speed, bend, jerk = distance(m, t, v, gain)
    inverse = 1 / speed
    step, curve, third = -level * inverse, 0.5 * bend * inverse, jerk * inverse / 6
    return t + step * (1 + curve * step) / (1 + step * (2 * curve + third * step))


def polish(m: Any, t: Any, v: Any, gain: Any) -> Any:
    """Improve a guess of the contact: the inverse of the Taylor series of l to the sixth power, order seven."""
    fast, slow, drift, of_fast, of_slow = _motion(m, v, gain)
    a, b = of_fast * m.exp(fast * t), of_slow * m.exp(slow * t)
    level = DISTANCE + v * t - drift - (a + b)
    a, b = fast * a, slow * b
    inverse = 1 / (v - (a + b))
    c = []
    for k in range(2, 7):
        a, b = fast / k * a, slow / k * b
        c.append(-(a + b) * inverse)
    c2, c3, c4, c5, c6 = c
    s = c2 * c2
    h = -level * inverse
    d6 = c2 * (s * (84 * c3 - 42 * s) - 28 * (c3 * c3 + c2 * c4) + 7 * c5) + 7 * c3 * c4 - c6
    d5 = s * (14 * s - 21 * c3) + 3 * c3 * c3 + 6 * c2 * c4 - c5
    d4 = 5 * c2 * (c3 - s) - c4
    return t + h * (1 + h * (-c2 + h * (2 * s - c3 + h * (d4 + h * (d5 + h * d6)))))


def solve(m: Any, v: Any, gain: Any) -> Any:
    """Return the contact time by two evaluations of the closed form, with an error of 2e-11 in all cases."""
    return polish(m, householder(m, start(m, v, gain), v, gain), v, gain)


def merit(t: Any, v: Any, speed: Any) -> Any:
    """Return the objective f_1 of a contact at t with l' = speed."""
    return ((DISTANCE + v * t) / POSITION_SCALE) ** 2 + (speed / VELOCITY_SCALE) ** 2


def squared_slope(sensor: str, distance: Any) -> Any:
    """Return the integral of g^2 from a distance to that of the start [1/m], where g = d(ln xi)/dl."""
    if sensor == "exponential-1":
        return RATE * RATE * (DISTANCE - distance)
    return EXPONENT * EXPONENT * (1 / (distance + OFFSET) - 1 / (DISTANCE + OFFSET))


def slopes(m: Any, t: Any, v: Any, gain: Any) -> tuple[Any, Any]:
    """Return the derivatives of l and l' by the gain at a fixed t."""
    fast, slow, drift, of_fast, of_slow = _motion(m, v, gain)
    half = (DAMPING + RATE * gain) / (2 * MASS)
    half_g = RATE / (2 * MASS)
    fast_g = -half_g * (1 + half / m.sqrt(half * half - STIFFNESS / MASS))
    slow_g = -slow / fast * fast_g
    drift_g = RATE / STIFFNESS * v
    of_fast_g = (drift_g * slow + drift * slow_g - of_fast * (fast_g - slow_g)) / (fast - slow)
    of_slow_g = -drift_g - of_fast_g
    a, b = m.exp(fast * t), m.exp(slow * t)
    level = -drift_g - (of_fast_g + of_fast * fast_g * t) * a - (of_slow_g + of_slow * slow_g * t) * b
    a_g = of_fast_g * fast + of_fast * fast_g * (1 + fast * t)
    b_g = of_slow_g * slow + of_slow * slow_g * (1 + slow * t)
    return level, -(a_g * a + b_g * b)
