"""Declare and check the fields of a custom class.

A field, for example of a custom sensor curve, has a unit and a sign.
"""

from ._core.fields import INPUT, OUTPUT, OUTPUT_RATE, check_declared, count, flag, quantity

__all__ = ["INPUT", "OUTPUT", "OUTPUT_RATE", "check_declared", "count", "flag", "quantity"]
