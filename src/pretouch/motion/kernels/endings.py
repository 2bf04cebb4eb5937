"""What is told from zero and what is not, alike on every path: touches, and motions that never arrive.

l is the obstacle's path p + v t + a t^2 / 2 less x~, which is as large as that path where l is zero; so no computation
knows l there better than some rounding of the path's terms. The slope of a curve is met to 1e-13 of itself, and l with
it to 1e-13 of these terms. Ten times that is the RESOLUTION: a smallest distance that lies closer to zero, on either
side, is a touch.

A distance may also come to zero without a smallest one: with p, v and a so that l alone is left,

    M l'' + (D + D_p g) l' + K (l - p) = 0,

it tends to p (for K = 0 to l + l' M / (D + D_p g)), and where that is zero it never gets there. Let w = l - p > 0 and
z = w' / w. Then z' = -(z^2 + c z + k) with c = (D + D_p g) / M, k = K / M, which is not negative at z = -mu if
mu^2 - c mu + k <= 0. So with c >= c_0 on all that is ahead and c_0^2 >= 4 k, z never falls below the larger root
-mu_2(c_0) if it is not below it now: w stays above 0. For a constant c that decides it; for a curve c_0 tends to c(0).
A resting place within the RESOLUTION of zero, of what it is the difference of, is zero.
"""

from __future__ import annotations

import math
from typing import Any

from .compiler import kernel

__all__ = ["RESOLUTION", "is_left_alone", "never_arrives", "resolution", "rest_resolution"]

RESOLUTION = 1e-12
"""How close to zero a smallest distance is taken for zero, of the terms that l is the difference of."""

_ROUNDING = 1e-15  # of D^2, and of mu_2: a damping is critical to no more digits than it has


@kernel
def resolution(values: Any, t: float) -> float:
    """Return the distance [m] at a time that is not told from zero."""
    return RESOLUTION * (abs(values[5]) + (abs(values[6]) + abs(values[7]) / 2 * t) * t)


@kernel
def rest_resolution(values: Any, damping: float) -> float:
    """Return the distance [m] of a resting place that is not told from zero."""
    way = abs(values[6] - values[4]) * values[0] / damping if values[2] == 0 and damping > 0 else 0.0
    return RESOLUTION * (abs(values[5]) + abs(values[3]) + way)


@kernel
def is_left_alone(values: Any) -> bool:
    """Tell whether nothing drives l but itself: an obstacle at rest beside the reference, or nothing that holds."""
    return values[7] == 0 and (values[6] == 0 or (values[1] == 0 and values[2] == 0))


@kernel
def never_arrives(values: Any, damping: float, l: float, speed: float, level: float) -> bool:  # noqa: E741
    """Tell whether an l that is left alone tends to its resting place without ever passing a level.

    Args:
        values: relative quantities of Scenario.relative, with `is_left_alone`.
        damping: the least D + D_p g between the level and where l may still go [N s/m].
        l: the distance [m].
        speed: l' [m/s].
        level: where it would arrive [m].

    Returns:
        Whether that is proved.
    """
    mass, stiffness, center = values[0], values[2], values[5]
    doubt = rest_resolution(values, damping)
    if stiffness == 0:
        return speed >= 0 or (damping > 0 and l + speed * mass / damping >= level - doubt)
    square, product = damping * damping, 4 * mass * stiffness
    way = l - center
    if center < level - doubt or way < 0 or damping <= 0 or square - product < -_ROUNDING * square:
        return False
    fast = 0.5 * (damping + math.sqrt(max(square - product, 0.0)))  # M mu_2
    return mass * speed + fast * way >= -_ROUNDING * fast * way
