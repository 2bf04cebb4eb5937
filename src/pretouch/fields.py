"""Declare the fields of a custom class, such as a custom sensor curve, with unit and sign, and check their values."""

from ._core.fields import INPUT, OUTPUT, OUTPUT_RATE, check_declared, count, flag, quantity

__all__ = ["INPUT", "OUTPUT", "OUTPUT_RATE", "check_declared", "count", "flag", "quantity"]
