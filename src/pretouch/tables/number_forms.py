"""Patterns of the numbers in cells and lines: with a decimal point or comma, an exponent, or as hexadecimal digits."""

from __future__ import annotations

import re
import unicodedata
from decimal import Decimal
from typing import Final

_EXPONENT: Final = r"(?:[eE][-+]?\d+)?"
_HEXADECIMAL: Final = re.compile(r"0[xX][0-9a-fA-F]{1,8}")
WITH_POINT: Final = rf"[-+]?(?:\d+(?:\.\d*)?|\.\d+){_EXPONENT}"
"""A number with a decimal point, or without one."""
WITH_COMMA: Final = rf"[-+]?(?:\d+(?:,\d*)?|,\d+){_EXPONENT}"
"""A number with a decimal comma, or without one."""
UNSIGNED: Final = rf"(?:\d+(?:[.,]\d*)?|[.,]\d+){_EXPONENT}"
"""A number without a sign, with either decimal sign."""
WITHIN_LINE: Final = rf"[-+]?(?:\d+(?:[.,]\d+)?|[.,]\d+){_EXPONENT}"
"""A number in a line of text: a point or comma behind its digits belongs to the text."""
_WITH_D: Final = re.compile(r"([-+]?(?:\d+\.\d*|\.\d+))[dD]([-+]\d{1,3})")


_FRACTION: Final = re.compile(
    r"([-+]?)(?:(\d{1,4})(?:[ -]|(?=[\u00bc-\u00be\u2150-\u215e])))?"
    r"(?:(\d{1,2})\s*[/\u2044]\s*(\d{1,2})|([\u00bc-\u00be\u2150-\u215e]))\s*(\D.*)?",
    re.DOTALL,
)
_PARTS_OF_AN_INCH: Final = frozenset({2, 4, 8, 16, 32, 64})
_THOUSANDS: Final = re.compile(r"([-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+))\s?[kK]")


def from_fraction(cell: str) -> str | None:
    """Return a number with a fraction, as on a ruler in inches, with decimals; None for any other cell.

    Examples:
        >>> from_fraction("1/8"), from_fraction('1 1/4"'), from_fraction("\u00bd in"), from_fraction("1/3")
        ('0.125', '1.25"', '0.5in', None)
    """
    match = _FRACTION.fullmatch(cell.strip())
    if match is None:
        return None
    sign, whole, above, below, sign_of_fraction, rest = match.groups()
    if sign_of_fraction:
        part = unicodedata.numeric(sign_of_fraction)
    elif int(below) in _PARTS_OF_AN_INCH and int(above) < int(below):
        part = int(above) / int(below)
    else:
        return None
    return f"{sign}{int(whole or 0) + part:.12g}{rest or ''}"


def from_thousands(cell: str) -> str | None:
    """Return a number such as `9.60k` without its k; None for any other cell.

    Examples:
        >>> from_thousands("9.60k"), from_thousands("9.60")
        ('9600', None)
    """
    match = _THOUSANDS.fullmatch(cell.strip())
    return f"{(1000 * Decimal(match[1].replace(',', '.'))).normalize():f}" if match else None


def with_exponent(cell: str) -> str:
    """Return a number of Fortran, such as `4.0D-03`, with E in its exponent, and any other cell unchanged.

    Examples:
        >>> with_exponent("4.0D-03"), with_exponent("1D3")
        ('4.0E-03', '1D3')
    """
    match = _WITH_D.fullmatch(cell)
    return f"{match[1]}E{match[2]}" if match else cell


def is_hexadecimal(cell: str) -> bool:
    """Return True if a cell is a hexadecimal number such as `0x1F`."""
    return bool(_HEXADECIMAL.fullmatch(cell))


def in_decimal(cell: str) -> str:
    """Return a hexadecimal number in decimal digits, and any other cell unchanged.

    Examples:
        >>> in_decimal("0x1F"), in_decimal("12")
        ('31', '12')
    """
    return str(int(cell, 16)) if is_hexadecimal(cell) else cell
