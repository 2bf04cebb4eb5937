"""Functions that declare the fields of a custom class, with unit, sign and example, and that check their values."""

from ._core.fields import INPUT, OUTPUT, OUTPUT_RATE, check_declared, count, flag, quantity

__all__ = ["INPUT", "OUTPUT", "OUTPUT_RATE", "check_declared", "count", "flag", "quantity"]
