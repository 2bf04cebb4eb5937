"""Declare and check dataclass fields for physical quantities.

A declaration gives the unit, the sign and an example value of the field.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING, Field, field, fields
from functools import cache
from typing import Any, Final, Literal, TypeAlias

from .arguments import RULES_ATTRIBUTE, rules_of_fields
from .errors import InvalidInputError
from .numbers import finite, nonnegative, positive
from .units import written_unit

Sign: TypeAlias = Literal["any", "positive", "nonnegative", "negative", "nonzero"]

OUTPUT: Final = "output"
"""Placeholder for the unit of a sensor output: V, counts, or none."""

INPUT: Final = "input"
"""Placeholder for the unit of the uncertain input that a distribution describes."""

ONE_ROBOT: Final = ": a controller runs one robot"
"""The reason why a controller takes no arrays, for messages."""

OUTPUT_RATE: Final = "output/s"
"""Placeholder for the unit of the rate of change of a sensor output."""

_RULES: Final[dict[str, Callable[..., Any]]] = {"positive": positive, "nonnegative": nonnegative}
_UNIT_WORDS: Final = {OUTPUT: "unit of xi", OUTPUT_RATE: "unit of xi per s", INPUT: "unit of the input"}


def quantity(
    unit: str,
    default: Any = MISSING,
    *,
    sign: Sign = "any",
    example: str = "",
    infinite: bool = False,
    **others: Any,
) -> Any:
    """Declare a dataclass field for a physical quantity.

    The value is a number or an array of numbers in SI units.

    Args:
        unit: SI unit; empty for a pure number; OUTPUT or OUTPUT_RATE for a sensor output;
            INPUT for the unit of the uncertain input that a distribution describes.
        default: default value; None if the field is optional.
        sign: required sign.
        example: an example value, in the syntax of scenario files.
        infinite: whether infinite values are allowed.
        others: further metadata.

    Returns:
        The field.
    """
    metadata = {"unit": unit, "sign": sign, "example": example, "infinite": infinite, **others}
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


def flag(default: bool) -> Any:
    """Declare a dataclass field that is true or false."""
    return field(default=default, metadata={"flag": True})


def count(least: int, default: int, example: str) -> Any:
    """Return an integer dataclass field with a smallest allowed value.

    The dataclass itself checks the value.
    """
    return field(default=default, metadata={"least": least, "example": example})


@cache
def declared(cls: Any) -> tuple[Any, ...]:
    """Return those fields of a dataclass that were declared as physical quantities."""
    return tuple(f for f in fields(cls) if "unit" in f.metadata)


def units_of_fields(cls: Any) -> dict[str, str]:
    """Return the SI units of a dataclass by field name.

    Only physical quantities are included.
    """
    return {f.name: f.metadata["unit"] for f in declared(cls)}


def check_declared(value: Any, *, arrays: bool = False, before: str = "", instead: str = "") -> None:
    """Check every field of a frozen dataclass.

    Physical quantities are converted to floats. Dataclasses call this function in `__post_init__`.

    Args:
        value: the instance.
        arrays: whether arrays are allowed.
        before: text before the field's name in messages.
        instead: end of the message about a forbidden array: the reason why arrays are not allowed.
    """
    kind: Any = type(value)
    if kind.__dict__.get(RULES_ATTRIBUTE) != {}:  # empty if all fields are quantities
        check_types(value, before)
    for name, least, above, full in _quick(kind):
        number = getattr(value, name)
        if type(number) is not float or not (number > least or (number == least and not above)) or number == math.inf:
            _check_one(value, full, arrays=arrays, before=before, instead=instead)


def check_types(value: Any, before: str = "") -> None:
    """Check the field types of a frozen dataclass.

    Physical quantities are not checked. Dataclasses call this function in `__post_init__`. It converts NumPy numbers to
    Python numbers.

    Args:
        value: the instance.
        before: text before the field's name in messages.
    """
    kind: Any = type(value)
    rules = kind.__dict__.get(RULES_ATTRIBUTE)
    for name, rule in (rules_of_fields(kind) if rules is None else rules).items():
        content = getattr(value, name)
        if content is not rule.default and type(content) not in rule.quick:
            checked = rule.check(content, before)
            if checked is not content:
                object.__setattr__(value, name, checked)


@cache
def _quick(cls: Any) -> tuple[tuple[str, float, bool, Any], ...]:
    """Return name, lower limit, whether the limit itself is excluded, and field of each quantity of a dataclass."""
    ends = {"positive": (0.0, True), "nonnegative": (0.0, False)}
    checks = []
    for f in declared(cls):
        least, above = ends.get(f.metadata["sign"], (-math.inf, True))
        checks.append((f.name, least, above, f))
    return tuple(checks)


def _check_one(value: Any, f: Field[Any], *, arrays: bool, before: str, instead: str) -> None:
    """Check one dataclass field against all its rules."""
    number, metadata = getattr(value, f.name), f.metadata
    if number is None and f.default is None:
        return
    if metadata["infinite"] and isinstance(number, float) and math.isinf(number):
        if number < 0 and metadata["sign"] == "positive":
            unit = written_unit(metadata["unit"])
            raise InvalidInputError(
                f"{before}{f.name}: found -inf {unit}, which must be positive", value=number, limit=(0.0, math.inf)
            )
        return
    unit = _UNIT_WORDS.get(metadata["unit"], metadata["unit"])
    rule: Callable[..., Any] = _RULES.get(metadata["sign"], finite)
    checked = rule(number, f"{before}{f.name}", unit)
    if not arrays and not isinstance(checked, float):
        raise InvalidInputError(f"{before}{f.name}: found an array, expected one number{instead}", value=number)
    object.__setattr__(value, f.name, checked)
