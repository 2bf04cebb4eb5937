"""Patterns of the numbers in cells and lines: with a decimal point or comma, an exponent, or as hexadecimal digits."""

from __future__ import annotations

import re
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
