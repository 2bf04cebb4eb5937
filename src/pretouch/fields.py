"""Declare the fields of user-defined classes with unit, sign and example, and check the values of these fields."""

from ._core.fields import INPUT, OUTPUT, OUTPUT_RATE, check_declared, count, flag, quantity

__all__ = ["INPUT", "OUTPUT", "OUTPUT_RATE", "check_declared", "count", "flag", "quantity"]
