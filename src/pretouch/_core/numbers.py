"""Numbers at the public border: what was got and what must hold, and what of a result has no value."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InvalidInputError

__all__ = [
    "BoolArray",
    "FloatArray",
    "IntArray",
    "finite",
    "finite_or_none",
    "float_or_array",
    "nonnegative",
    "positive",
]

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]


def finite(value: ArrayLike, name: str, unit: str = "") -> Any:
    """Check that every number is finite.

    Args:
        value: a number or an array.
        name: what it is called in the message.
        unit: its SI unit, for the message.

    Returns:
        A float for a scalar, a read-only float array otherwise.

    Raises:
        InvalidInputError: a number is missing, infinite or no number at all.
    """
    given: Any = value
    if type(given) is float and math.isfinite(given):  # by far the most common: without a detour over an array
        return given
    if type(given) is int and abs(given) < 2**53:
        return float(given)
    array = _numbers(value)
    if array is None:
        raise InvalidInputError(f"{name}: found {value!r}, expected a number{_in(unit)}")
    _require(np.isfinite(array), array, name, unit, "must be finite")
    if array.ndim == 0:
        return float(array)
    array.setflags(write=False)
    return array


def positive(value: ArrayLike, name: str, unit: str = "") -> Any:
    """Check that every number is finite and above zero; return it as `finite` does."""
    checked = finite(value, name, unit)
    if type(checked) is float and checked > 0:
        return checked
    _require(np.asarray(checked) > 0, np.asarray(checked), name, unit, "must be positive")
    return checked


def nonnegative(value: ArrayLike, name: str, unit: str = "") -> Any:
    """Check that every number is finite and not below zero; return it as `finite` does."""
    checked = finite(value, name, unit)
    if type(checked) is float and checked >= 0:
        return checked
    _require(np.asarray(checked) >= 0, np.asarray(checked), name, unit, "must not be negative")
    return checked


def float_or_array(value: Any) -> Any:
    """Return a float for what has no dimension, an array as it is."""
    return float(value) if np.ndim(value) == 0 else value


def finite_or_none(value: Any) -> float | None:
    """Return a number for results, None where it is not finite: what has no value there, and null in JSON.

    Args:
        value: a number.

    Returns:
        The number as a float, or None.
    """
    number = float(value)
    return number if math.isfinite(number) else None


def _numbers(value: ArrayLike) -> FloatArray | None:
    """Copy numbers into a float array; None for text, truth values, complex and masked ones, which NumPy converts."""
    try:
        given = np.asarray(value)
        if given.dtype.kind in "iufO" and not np.ma.is_masked(value):
            return np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        pass
    except OverflowError:  # an integer beyond the largest float
        return np.array(np.inf)
    return None


def _require(holds: Any, array: FloatArray, name: str, unit: str, rule: str) -> None:
    if not np.all(holds):
        culprit = array[~np.atleast_1d(holds)][0] if array.ndim else float(array)
        raise InvalidInputError(f"{name}: found {float(culprit):g}{_unit(unit)}, which {rule}")


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def _in(unit: str) -> str:
    return f" in {unit}" if unit else ""
