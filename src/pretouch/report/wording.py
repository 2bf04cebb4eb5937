"""How numbers are written where a person reads them."""

from __future__ import annotations

import math

from pretouch._core.units import format_quantity, pretty_unit

__all__ = ["number", "quantity"]


def quantity(value: float | None, unit: str = "", digits: int = 4) -> str:
    """Write an SI value with its unit for a person.

    Args:
        value: the value in SI; None where there is none.
        unit: its SI unit.
        digits: significant digits.

    Returns:
        Text such as `42.2 mm`, and a dash for None or NaN.

    Examples:
        >>> quantity(8.8385, "m/s^2")
        '8.838 m/s²'
        >>> quantity(None, "m")
        '–'
    """
    if value is None or math.isnan(value):
        return "\u2013"
    if math.isinf(value):
        return ("" if value > 0 else "-") + "\u221e"
    return pretty_unit(format_quantity(value, unit, digits))


def number(value: float | None, digits: int = 4) -> str:
    """Write a pure number for a person, with a dash for None or NaN."""
    return quantity(value, "", digits)
