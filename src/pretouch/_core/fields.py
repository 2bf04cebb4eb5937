"""Fields of dataclasses that declare unit, sign and an example, and the checks of their values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING, Field, field, fields
from functools import cache
from typing import Any, Final, Literal, TypeAlias

from .arguments import RULES_ATTRIBUTE, rules_of_fields
from .errors import InvalidInputError
from .numbers import finite, nonnegative, positive

Sign: TypeAlias = Literal["any", "positive", "nonnegative", "negative", "nonzero"]

OUTPUT: Final = "output"
"""The unit of a sensor output: V, counts, or none."""

ONE_ROBOT: Final = ": a controller runs one robot"
"""Why a controller takes no arrays."""

OUTPUT_RATE: Final = "output/s"
"""The unit of a change of a sensor output."""

_RULES: Final[dict[str, Callable[..., Any]]] = {"positive": positive, "nonnegative": nonnegative}
_TOLD: Final = {OUTPUT: "unit of xi", OUTPUT_RATE: "unit of xi per s"}


def quantity(
    unit: str,
    default: Any = MISSING,
    *,
    sign: Sign = "any",
    example: str = "",
    infinite: bool = False,
    **others: Any,
) -> Any:
    """Declare a field that is a number, or an array of them, in SI.

    Args:
        unit: its SI unit; the empty text for a pure number; OUTPUT or OUTPUT_RATE for a sensor output.
        default: its value where none is given; None where it may be left out.
        sign: what must hold.
        example: a value as a scenario file has it.
        infinite: whether it may be infinite.
        others: further metadata.

    Returns:
        The field.
    """
    told = {"unit": unit, "sign": sign, "example": example, "infinite": infinite, **others}
    return field(metadata=told) if default is MISSING else field(default=default, metadata=told)


def flag(default: bool) -> Any:
    """Declare a field that is true or false."""
    return field(default=default, metadata={"flag": True})


def count(least: int, default: int, example: str) -> Any:
    """Declare a field that is a whole number from some number on; the class checks it."""
    return field(default=default, metadata={"least": least, "example": example})


@cache
def declared(cls: Any) -> tuple[Any, ...]:
    """Return the fields of a dataclass that are quantities."""
    return tuple(f for f in fields(cls) if "unit" in f.metadata)


def units_of_fields(cls: Any) -> dict[str, str]:
    """Return the SI units of the quantities of a dataclass, by name."""
    return {f.name: f.metadata["unit"] for f in declared(cls)}


def check_declared(value: Any, *, arrays: bool = False, before: str = "", instead: str = "") -> None:
    """Check every field of a frozen dataclass, and keep quantities as floats; called in its `__post_init__`.

    Args:
        value: the instance.
        arrays: whether arrays will do.
        before: what stands before the name in messages.
        instead: why an array will not do, for the message.
    """
    kind: Any = type(value)
    if kind.__dict__.get(RULES_ATTRIBUTE) != {}:  # where nothing else is to be checked
        check_types(value, before)
    for name, least, above, full in _quick(kind):
        given = getattr(value, name)
        if type(given) is not float or not (given > least or (given == least and not above)) or given == math.inf:
            _check_one(value, full, arrays=arrays, before=before, instead=instead)


def check_types(value: Any, before: str = "") -> None:
    """Check the fields of a frozen dataclass that are no quantities by their annotations; called in `__post_init__`.

    Numbers of NumPy and other kinds are kept as those of Python.

    Args:
        value: the instance.
        before: what stands before the name in messages.
    """
    kind: Any = type(value)
    rules = kind.__dict__.get(RULES_ATTRIBUTE)
    for name, rule in (rules_of_fields(kind) if rules is None else rules).items():
        given = getattr(value, name)
        if given is not rule.default and type(given) not in rule.quick:
            kept = rule.check(given, before)
            if kept is not given:
                object.__setattr__(value, name, kept)


@cache
def _quick(cls: Any) -> tuple[tuple[str, float, bool, Any], ...]:
    """Return of each quantity its name, what a finite float must exceed or reach, which of the two, and its field."""
    ends = {"positive": (0.0, True), "nonnegative": (0.0, False)}
    found = []
    for f in declared(cls):
        least, above = ends.get(f.metadata["sign"], (-math.inf, True))
        found.append((f.name, least, above, f))
    return tuple(found)


def _check_one(value: Any, f: Field[Any], *, arrays: bool, before: str, instead: str) -> None:
    """Check what is not simply a finite float of the right sign."""
    given, told = getattr(value, f.name), f.metadata
    if given is None and f.default is None:
        return
    if told["infinite"] and isinstance(given, float) and math.isinf(given):
        if given < 0 and told["sign"] == "positive":
            raise InvalidInputError(f"{before}{f.name}: found -inf {told['unit']}, which must be positive")
        return
    unit = _TOLD.get(told["unit"], told["unit"])
    rule: Callable[..., Any] = _RULES.get(told["sign"], finite)
    number = rule(given, f"{before}{f.name}", unit)
    if not arrays and not isinstance(number, float):
        raise InvalidInputError(f"{before}{f.name}: found an array, expected one number{instead}")
    object.__setattr__(value, f.name, number)
