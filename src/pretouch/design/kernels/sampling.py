"""What samples of a function tell of it: whether they resolve it, and where its minimum is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pretouch.motion.kernels.compiler import kernel

__all__ = ["AT", "LEAST", "NODES", "bottom_between", "guess_minimum", "is_resolved", "only_minimum"]

LEAST = 11
"""Samples that are needed to tell whether they resolve a function: six with even numbers."""

_RESOLVED = 1e-3
_STEEP = 0.03
_VANISHED = 1e-7  # of the curvature: an error of 1e-8 in z at most, since coefficients go on to fall
NODES = 8
AT = np.cos((np.arange(NODES) + 0.5) * np.pi / NODES)
_COEFFICIENTS = np.cos(np.outer(np.arange(NODES), (np.arange(NODES) + 0.5) * np.pi / NODES)) * 2 / NODES
_COEFFICIENTS[0] /= 2

_MIDDLE = np.array(  # of the quintic through 0 to 5, at 0.5 to 4.5
    [[math.prod((i + 0.5 - k) / (j - k) for k in range(6) if k != j) for j in range(6)] for i in range(5)]
)


@kernel
def is_resolved(f: Any, used: int) -> bool:
    """Tell whether every odd node is predicted by the quintic through the six even nodes nearest to it.

    An error counts beside the objective, or beside its rise over the gap: what is steep there hides no minimum.
    """
    for i in range(1, used - 1, 2):
        first = min(max(i - 5, 0), used - 11)
        row, guess = (i - first) // 2, 0.0
        for j in range(6):
            guess += _MIDDLE[row, j] * f[first + 2 * j]
        if not abs(guess - f[i]) <= _RESOLVED * abs(f[i]) + _STEEP * abs(f[i + 1] - f[i - 1]):
            return False
    return True


@kernel
def only_minimum(f: Any, used: int) -> int:
    """Return the node of the one minimum, -1 where there are more or where it is at an end."""
    found = -1
    for i in range(used):
        left = f[i - 1] if i > 0 else math.inf
        right = f[i + 1] if i < used - 1 else math.inf
        if f[i] <= left and f[i] < right:
            if found >= 0:
                return -1
            found = i
    return -1 if found <= 0 or found >= used - 1 else found


@kernel
def guess_minimum(f: Any, best: int, used: int) -> float:
    """Return where the quartic through five nodes around the best has its minimum, in steps from node 0."""
    c = min(max(best, 2), used - 3)
    y0, y1, y2, y3, y4 = f[c - 2], f[c - 1], f[c], f[c + 1], f[c + 2]
    a1 = (y0 - 8.0 * y1 + 8.0 * y3 - y4) / 12.0
    a2 = (-y0 + 16.0 * y1 - 30.0 * y2 + 16.0 * y3 - y4) / 24.0
    a3 = (-y0 + 2.0 * y1 - 2.0 * y3 + y4) / 12.0
    a4 = (y0 - 4.0 * y1 + 6.0 * y2 - 4.0 * y3 + y4) / 24.0
    s = float(best - c)
    for _ in range(6):
        s -= (a1 + s * (2.0 * a2 + s * (3.0 * a3 + s * 4.0 * a4))) / (2.0 * a2 + s * (6.0 * a3 + s * 12.0 * a4))
    if not abs(s - (best - c)) <= 1.0:
        s = float(best - c)
    return c + s


@kernel
def bottom_between(values: Any, c: Any, slope: Any, bend: Any) -> Any:
    """Return z in [-1, 1] and value of the minimum of the polynomial through the nodes, and whether it fits.

    It fits where its last coefficients vanish beside its curvature: no corner, no noise.

    Args:
        values: the function at the nodes.
        c: room for its Chebyshev coefficients, as slope and bend for those of its derivatives.
        slope: see c.
        bend: see c.
    """
    lowest = 0
    slope[NODES - 1], bend[NODES - 1], bend[NODES - 2] = 0.0, 0.0, 0.0
    for k in range(NODES):
        c[k] = 0.0
        for j in range(NODES):
            c[k] += _COEFFICIENTS[k, j] * values[j]
        if values[k] < values[lowest]:
            lowest = k
    for k in range(NODES - 1, 0, -1):
        slope[k - 1] = (slope[k + 1] if k + 1 < NODES else 0.0) + 2.0 * k * c[k]
    for k in range(NODES - 2, 0, -1):
        bend[k - 1] = (bend[k + 1] if k + 1 < NODES else 0.0) + 2.0 * k * slope[k]
    slope[0] /= 2.0
    bend[0] /= 2.0
    z, step, curvature = AT[lowest], 1.0, 0.0
    for _ in range(12):
        curvature = _series(bend, z)
        step = _series(slope, z) / curvature
        z = min(max(z - step, -1.0), 1.0)
        if abs(step) < 1e-14:
            break
    fits = curvature > 0.0 and abs(c[NODES - 1]) + abs(c[NODES - 2]) <= _VANISHED * abs(c[2]) and abs(step) < 1e-10
    return z, _series(c, z), fits


@kernel
def _series(c: Any, z: float) -> float:
    b1, b2 = 0.0, 0.0
    for k in range(NODES - 1, 0, -1):
        b1, b2 = c[k] + 2.0 * z * b1 - b2, b1
    return c[0] + z * b1 - b2
