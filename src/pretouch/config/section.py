"""What all sections of a scenario file share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields
from typing import Annotated, Any, Final, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, create_model

from .quantities import Quantity, UnfitValueError

__all__ = [
    "LENGTH",
    "WEIGHT",
    "Section",
    "list_of",
    "name_of",
    "nearest",
    "one_of",
    "section_of",
    "text",
    "truth",
    "whole",
]


class Section(BaseModel):
    """What every section shares: unknown keys are refused, nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=())


LENGTH: Final = Quantity(unit="m", example='"0 m"')
WEIGHT: Final = Quantity(unit="", example="1.0", sign="nonnegative")


def text(example: str) -> BeforeValidator:
    """Make the check that a value is text and not empty."""

    def check(value: Any) -> str:
        if not isinstance(value, str) or not value.strip() or "\0" in value:
            raise UnfitValueError(f"expected text, for example {example}")
        return value

    return BeforeValidator(check)


def truth(value: Any) -> bool:
    """Check that a value is true or false.

    Args:
        value: what was found.

    Returns:
        The value.

    Raises:
        UnfitValueError: it is neither.
    """
    if not isinstance(value, bool):
        raise UnfitValueError("expected true or false")
    return value


def whole(least: int, example: str) -> BeforeValidator:
    """Make the check that a value is a whole number from some number on."""

    def check(value: Any) -> int:
        if type(value) is not int or not least <= value < 2**31:
            raise UnfitValueError(f"expected a whole number of at least {least}, such as {example}")
        return value

    return BeforeValidator(check)


def name_of(*names: str) -> BeforeValidator:
    """Make the check that a value is one of some names."""

    def check(value: Any) -> str:
        if not isinstance(value, str) or value not in names:
            raise UnfitValueError(one_of(value, names))
        return value

    return BeforeValidator(check)


def one_of(value: Any, names: tuple[str, ...]) -> str:
    """Say which names are expected, the nearest first.

    Args:
        value: what was found.
        names: what is valid.

    Returns:
        The part of a message that follows what was found.

    Examples:
        >>> one_of("Exponential 1", ("exponential-1", "table"))
        'expected one of "exponential-1", "table"; did you mean "exponential-1"?'
    """
    listed = ", ".join(f'"{name}"' for name in names)
    near = nearest(value, names) if isinstance(value, str) else None
    return f"expected one of {listed}" + (f'; did you mean "{near}"?' if near else "")


def nearest(found: str, valid: tuple[str, ...]) -> str | None:
    """Find the valid name that a misspelt one is nearest to.

    Args:
        found: the misspelt name.
        valid: the valid names.

    Returns:
        The nearest name; None where none is near.

    Examples:
        >>> nearest("dampng", ("mass", "damping", "stiffness"))
        'damping'
    """
    from difflib import get_close_matches  # noqa: PLC0415 - only for mistakes

    plain = {name.replace("_", "-").lower(): name for name in valid}
    key = found[:80].strip().lower().replace("_", "-").replace(" ", "-")
    match = get_close_matches(key, list(plain), n=1, cutoff=0.6)
    return plain[match[0]] if match else None


def list_of(least: int, most: int | None, what: str) -> BeforeValidator:
    """Make the check that a value is a list with so many elements."""

    def check(value: Any) -> Any:
        if not isinstance(value, list) or len(value) < least or (most is not None and len(value) > most):
            raise UnfitValueError(f"expected {what}")
        return value

    return BeforeValidator(check)


S = TypeVar("S", bound=Section)


def section_of(
    *classes: Any,
    base: type[S],
    optional: bool = False,
    without: Iterable[str] = (),
    renamed: Mapping[str, str] | None = None,
) -> type[S]:
    """Make a section whose keys are the declared fields of dataclasses, each in its unit.

    Args:
        classes: the classes; what they have beside quantities, flags and counts is left out.
        base: the section that it extends, whose own keys come first.
        optional: whether every key may be left out, for a default that is not known here.
        without: fields that are no keys.
        renamed: keys for fields that are called otherwise in a file.

    Returns:
        The section, named after the first class.
    """
    keys: dict[str, Any] = {}
    for f in (f for cls in classes for f in fields(cls) if f.name not in without):
        kind = _type_of(f)
        if kind is None:
            continue
        default = None if optional else f.default
        required = default is MISSING
        keys[(renamed or {}).get(f.name, f.name)] = (
            kind if required else _or_none(kind, default),
            ... if required else default,
        )
    return create_model(f"{classes[0].__name__}Section", __base__=base, **keys)


def _type_of(f: Any) -> Any:
    """Return what a declared field takes in a file; None for a field that is not declared."""
    told = f.metadata
    if "unit" in told:
        unit = told["unit"] if told.get("of_output") is None else "output"
        return Annotated[
            float, Quantity(unit=unit, example=told["example"], sign=told["sign"], infinite=told["infinite"])
        ]
    if "flag" in told:
        return Annotated[bool, BeforeValidator(truth)]
    return Annotated[int, whole(told["least"], told["example"])] if "least" in told else None


def _or_none(kind: Any, default: Any) -> Any:
    if default is not None:
        return kind
    plain, check = kind.__origin__, kind.__metadata__[0]
    return Annotated[plain | None, check]
