"""The response of y'' + 2 s y' + w^2 y, exact to rounding for every damping, through critical and for w -> 0.

The printed form of L(10) divides by lambda_2 - lambda_1 and by K_a and loses its digits where either vanishes. All
that it needs are the divided differences G_m = exp[0^m, z1, z2] at the points z = lambda t and m zeros:

    t^(m+1) G_m  is the response, from rest, to the force t^(m-1) / (m-1)!   (m = 0: to an impulse),

which are entire functions of (z1, z2). They are summed as a series near the origin and by recursion over the point
that lies farthest from zero elsewhere, where no digits are lost.
"""

from __future__ import annotations

import math
from typing import Any

from .compiler import kernel

__all__ = ["divided_differences", "respond"]

_SERIES_RADIUS = 1.5
_TERMS = 24


@kernel
def _phi(z: float, order: int) -> float:
    """exp[0^order, z] = sum z^k / (k + order)!."""
    if abs(z) < 1.0:
        term = 1.0
        for k in range(1, order + 1):
            term /= k
        total = term
        for k in range(1, 20):
            term *= z / (k + order)
            total += term
        return total
    value = math.exp(z)
    factorial = 1.0
    for k in range(order):
        if k > 1:
            factorial *= k
        value = (math.expm1(z) if k == 0 else value - 1.0 / factorial) / z
    return value


@kernel
def divided_differences(p: float, q: float, d: float) -> Any:
    """Return (G_-1, h_0, G_0, G_1, G_2, G_3) at z = lambda t, L(13): z1 + z2 = p, z1 z2 = q >= 0, (z1 - z2)^2 / 4 = d.

    G_-1 is the derivative of t G_0, and h_0 the free response to a unit displacement.
    """
    magnitude = abs(p) / 2 + math.sqrt(d) if d > 0 else math.sqrt(q)
    if magnitude < _SERIES_RADIUS:
        symmetric, before = 1.0, 0.0
        weight = 1.0
        g0 = g1 = g2 = g3 = 0.0
        derivative = 0.0
        for k in range(_TERMS):
            weight /= k + 1  # 1 / (k + 1)!
            g0 += symmetric * weight
            g1 += symmetric * weight / (k + 2)
            g2 += symmetric * weight / ((k + 2) * (k + 3))
            g3 += symmetric * weight / ((k + 2) * (k + 3) * (k + 4))
            derivative += symmetric * weight * (k + 1)
            symmetric, before = p * symmetric - q * before, symmetric
        return derivative, 1.0 - q * g1, g0, g1, g2, g3
    if d > 0:
        root = math.sqrt(d)
        far = p / 2 - root if p < 0 else p / 2 + root
        near = q / far
        top, low = max(near, far), min(near, far)
        g0 = math.exp(top) * _phi(low - top, 1)
        g1 = (g0 - _phi(near, 1)) / far
        g2 = (g1 - _phi(near, 2)) / far
        g3 = (g2 - _phi(near, 3)) / far
        return math.exp(far) + near * g0, math.exp(near) - near * g0, g0, g1, g2, g3
    decay, angle = math.exp(p / 2), math.sqrt(-d)
    sinc = math.sin(angle) / angle if angle > 0 else 1.0
    g0 = decay * sinc
    derivative = decay * (math.cos(angle) + p / 2 * sinc)
    g1 = (1.0 + p * g0 - derivative) / q
    g2 = (1.0 + p * g1 - g0) / q
    g3 = (0.5 + p * g2 - g1) / q
    return derivative, decay * (math.cos(angle) - p / 2 * sinc), g0, g1, g2, g3


@kernel
def respond(mass: float, damping: float, stiffness: float, start: Any, force: Any, t: float) -> Any:
    """Solve M y'' + D y' + K y = f_0 + f_1 t from (y, y') = start: L(10)-(13) without their quotients.

    Returns y, y', y'', y''' and the integral of y.
    """
    sigma, square = damping / (2 * mass), stiffness / mass
    p, q = -2 * sigma * t, square * t * t
    disc = damping * damping - 4 * mass * stiffness
    d = disc / (4 * mass * mass) * t * t
    slope, h0, g0, g1, g2, g3 = divided_differences(p, q, d)
    f1, f2, f3, f4 = t * g0, t * t * g1, t**3 * g2, t**4 * g3
    y0, v0 = start
    c0, c1 = force[0] / mass, force[1] / mass
    y = y0 * h0 + v0 * f1 + c0 * f2 + c1 * f3
    velocity = -square * y0 * f1 + v0 * slope + c0 * f1 + c1 * f2
    a0 = c0 - square * y0 - 2 * sigma * v0
    j0 = c1 - 2 * sigma * a0 - square * v0
    acceleration = a0 * h0 + j0 * f1
    jerk = j0 * slope - square * a0 * f1
    integral = y0 * (f1 + 2 * sigma * f2) + v0 * f2 + c0 * f3 + c1 * f4
    return y, velocity, acceleration, jerk, integral


@kernel
def respond_many(rows: Any, times: Any, out: Any) -> None:
    """Fill out[i, j] with y, y', y'' of `respond` for each row (M, D, K, y0, v0, f0, f1) at times[i, j]."""
    for i in range(rows.shape[0]):
        for j in range(times.shape[1]):
            start, force = (rows[i, 3], rows[i, 4]), (rows[i, 5], rows[i, 6])
            y, velocity, acceleration, _, _ = respond(rows[i, 0], rows[i, 1], rows[i, 2], start, force, times[i, j])
            out[i, j, 0], out[i, j, 1], out[i, j, 2] = y, velocity, acceleration
