"""How large and how small a quantity may be that somebody writes down: so that products of such are numbers."""

from __future__ import annotations

from typing import Final

__all__ = ["MAGNITUDES", "WORKABLE", "has_workable_magnitude"]

MAGNITUDES: Final = (1e-60, 1e60)
"""Smallest and largest magnitude in SI: products of five, and squares of products of two, are finite and not zero."""

WORKABLE: Final = "of a magnitude from {:g} to {:g}, or 0".format(*MAGNITUDES)
"""What is expected of every quantity, for messages."""


def has_workable_magnitude(value: float) -> bool:
    """Tell whether a number is zero, or neither so small nor so large that its products are no numbers.

    Args:
        value: a finite number.

    Returns:
        Whether its magnitude is 0 or within MAGNITUDES.

    Examples:
        >>> has_workable_magnitude(-0.3), has_workable_magnitude(0.0), has_workable_magnitude(1e-308)
        (True, True, False)
    """
    return value == 0 or MAGNITUDES[0] <= abs(value) <= MAGNITUDES[1]
