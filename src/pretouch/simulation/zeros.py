"""Where a function of one number is zero. SciPy's brentq does the same, and takes 0.1 s to load."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

__all__ = ["zero_between"]

_ROUNDING: Final = 4 * 2.0**-52


def zero_between(
    function: Callable[[float], float], one: tuple[float, float], other: tuple[float, float], tolerance: float
) -> float:
    """Find a zero between two places: by the inverse parabola through three, or halving where that may mislead.

    Args:
        function: the function; it may jump.
        one: a place, and what the function is there.
        other: another with a value of the other sign, or 0.
        tolerance: how far from a change of the sign the place may be.

    Returns:
        The place.

    Examples:
        >>> round(zero_between(lambda x: x**3 - 2, (0.0, -2.0), (4.0, 62.0), 1e-12), 10)
        1.2599210499
    """
    # T. R. Chandrupatla, Advances in Engineering Software 28 (1997) 145
    (b, at_b), (a, at_a), part = one, other, 0.5
    while True:
        x = a + part * (b - a)
        value = function(x)
        c, at_c = a, at_a
        if (value > 0) != (at_a > 0):
            b, at_b, c, at_c = a, at_a, b, at_b
        a, at_a = x, value
        best, least = (a, at_a) if abs(at_a) < abs(at_b) else (b, at_b)
        near = (tolerance + _ROUNDING * abs(best)) / abs(b - a)
        if near > 0.5 or least == 0:
            return best
        along, up = (a - b) / (c - b), (at_a - at_b) / (at_c - at_b)
        part = 0.5
        if up**2 < along and (1 - up) ** 2 < 1 - along:
            part = at_a / (at_b - at_a) * at_c / (at_b - at_c)
            part += (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b)
        part = min(max(part, near), 1 - near)
