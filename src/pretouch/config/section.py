"""What all sections of a scenario file share."""

from __future__ import annotations

from typing import Any, Final

from pydantic import BaseModel, BeforeValidator, ConfigDict

from .quantities import Quantity, UnfitValueError

__all__ = [
    "ACCELERATION",
    "LENGTH",
    "SPEED",
    "WEIGHT",
    "Section",
    "list_of",
    "name_of",
    "nearest",
    "one_of",
    "text",
    "truth",
    "whole",
]


class Section(BaseModel):
    """What every section shares: unknown keys are refused, nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=())


LENGTH: Final = Quantity(unit="m", example='"0 m"')
SPEED: Final = Quantity(unit="m/s", example='"0 m/s"')
ACCELERATION: Final = Quantity(unit="m/s^2", example='"0 m/s^2"')
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
