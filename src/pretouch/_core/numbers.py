"""Check and convert numbers that users pass, and evaluate Chebyshev polynomials."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from numbers import Real
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InvalidInputError
from .units import written_unit

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]

_FROM_ZERO: Final = (0.0, math.inf)
_ANY: Final = (-math.inf, math.inf)


def finite(value: ArrayLike, name: str, unit: str = "") -> Any:
    """Check that a number, or every number in an array, is finite.

    Args:
        value: a number or an array.
        name: name of the value in messages.
        unit: its SI unit, for messages.

    Returns:
        A float for a scalar, otherwise a read-only float array.

    Raises:
        InvalidInputError: a value is NaN, infinite or not a number.
    """
    scalar: Any = value
    if type(scalar) is float and math.isfinite(scalar):  # fast path of the most frequent case
        return scalar
    if type(scalar) is int and abs(scalar) < 2**53:
        return float(scalar)
    array = _numbers(value)
    if array is None:
        raise InvalidInputError(f"{name}: found {value!r}, expected a number{_in(unit)}", value=value)
    _require(np.isfinite(array), array, name, unit, "must be finite")
    if array.ndim == 0:
        return float(array)
    array.setflags(write=False)
    return array


def positive(value: ArrayLike, name: str, unit: str = "") -> Any:
    """Check that numbers are finite and positive.

    Returns:
        A float or a read-only array.
    """
    checked = finite(value, name, unit)
    if type(checked) is float and checked > 0:
        return checked
    _require(np.asarray(checked) > 0, np.asarray(checked), name, unit, "must be positive", limit=_FROM_ZERO)
    return checked


def nonnegative(value: ArrayLike, name: str, unit: str = "") -> Any:
    """Check that numbers are finite and not negative.

    Returns:
        A float or a read-only array.
    """
    checked = finite(value, name, unit)
    if type(checked) is float and checked >= 0:
        return checked
    _require(np.asarray(checked) >= 0, np.asarray(checked), name, unit, "must not be negative", limit=_FROM_ZERO)
    return checked


def checked_probability(value: Any, name: str = "probability") -> float:
    """Check that a probability lies between 0 and 1.

    Returns:
        The number as a float; 0 and 1 are not allowed.

    Raises:
        InvalidInputError: the number is not between 0 and 1.
    """
    number = float(finite(value, name))
    if not 0 < number < 1:
        raise InvalidInputError(
            f"{name}: found {number:g}, expected a number between 0 and 1, such as 0.95", value=number, limit=(0.0, 1.0)
        )
    return number


def float_or_array(value: Any) -> Any:
    """Convert a 0-dimensional array to a float.

    Returns:
        A float, or another array unchanged.
    """
    return float(value) if np.ndim(value) == 0 else value


def finite_or_none(value: Any) -> float | None:
    """Convert a finite number to a float.

    Args:
        value: a number.

    Returns:
        The number as a float, or None.
    """
    number = float(value)
    return number if math.isfinite(number) else None


def is_number(value: Any) -> bool:
    """Check whether a value is a single real number.

    Returns:
        True also for a number of NumPy; False for a boolean.
    """
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "iuf" and not np.ma.is_masked(value)
    return isinstance(value, Real | Decimal) and not isinstance(value, bool)


def as_float(value: Any) -> float:
    """Convert a number to a float without raising an error.

    Returns:
        Infinity on overflow, and NaN for a value that is not a number.
    """
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
    except ValueError:  # a signaling NaN of Decimal
        return math.nan


def is_whole(value: Any) -> bool:
    """Check whether a value is an integer.

    Returns:
        True also for an integer of NumPy; False for a boolean.
    """
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def are_numbers(value: Any) -> bool:
    """Check whether a value contains only numbers.

    Returns:
        True for a number, an array or a nested list of numbers, including NaN and infinity.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        return True
    return _numbers(value) is not None


def _numbers(value: ArrayLike) -> FloatArray | None:
    """Copy numbers into a float array. The result is None for text, booleans, complex or masked values."""
    try:
        if isinstance(value, list | tuple) and bool in map(type, value):
            return None
        raw = np.asarray(value)
        if raw.dtype.kind == "O" and any(isinstance(item, str | bytes | bool) for item in raw.flat):
            return None
        if raw.dtype.kind in "iufO" and not np.ma.is_masked(value):
            return np.array(raw, dtype=np.float64)
    except (TypeError, ValueError):
        pass
    except OverflowError:  # an integer beyond the largest float
        return np.array(np.inf)
    return None


def _require(
    holds: Any,
    array: FloatArray,
    name: str,
    unit: str,
    rule: str,
    *,
    limit: tuple[float, float] = (-math.inf, math.inf),
) -> None:
    if not np.all(holds):
        wrong = array[~np.atleast_1d(holds)][0] if array.ndim else float(array)
        number = float(wrong)
        raise InvalidInputError(f"{name}: found {number:g}{_unit(unit)}, which {rule}", value=number, limit=limit)


def _unit(unit: str) -> str:
    return f" {written_unit(unit)}" if unit else ""


def _in(unit: str) -> str:
    return f" in {written_unit(unit)}" if unit else ""


def chebyshev_nodes(count: int) -> FloatArray:
    """Return the roots of a Chebyshev polynomial in descending order."""
    return np.asarray(np.cos((np.arange(count) + 0.5) * np.pi / count))


def chebyshev_extremes(degree: int) -> FloatArray:
    """Return the extreme points of a Chebyshev polynomial.

    The points lie between -1 and 1.
    """
    return np.asarray(np.cos(np.arange(degree + 1) * np.pi / degree))


def chebyshev_sum(terms: FloatArray, z: FloatArray | float) -> FloatArray:
    """Return the values of several Chebyshev series, each at one point.

    Each column of `terms` has the coefficients of a series.
    """
    return np.asarray(np.polynomial.chebyshev.chebval(z, terms, tensor=False))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChebyshevBasis:
    """Chebyshev polynomials evaluated at nodes, with matrices that compute fit coefficients.

    The matrices convert function values at the nodes to coefficients.

    Args:
        nodes: the nodes, shape (n,).
        values: the polynomials at the nodes, shape (n, degree + 1).
        to_terms: maps values at the nodes to coefficients, shape (degree + 1, n): by interpolation, or by least squares
            if there are more nodes than coefficients.
        to_slope: maps values at the nodes to the coefficients of the first derivative, shape (degree, n).
        to_bend: maps values at the nodes to the coefficients of the second derivative, shape (degree - 1, n).
    """

    nodes: FloatArray
    values: FloatArray
    to_terms: FloatArray
    to_slope: FloatArray
    to_bend: FloatArray


@lru_cache
def chebyshev_basis(at: tuple[float, ...] | int, degree: int | None = None) -> ChebyshevBasis:
    """Create a basis of Chebyshev polynomials.

    The nodes are Chebyshev nodes or given points.

    Args:
        at: the number of nodes, or the nodes themselves, in [-1, 1].
        degree: degree of the highest polynomial; None for interpolation of all values.

    Returns:
        The basis.
    """
    nodes = chebyshev_nodes(at) if isinstance(at, int) else np.array(at)
    highest = len(nodes) - 1 if degree is None else degree
    values = np.asarray(np.polynomial.chebyshev.chebvander(nodes, highest))
    to_terms = np.linalg.inv(values) if highest == len(nodes) - 1 else np.linalg.pinv(values)
    return ChebyshevBasis(
        nodes=nodes,
        values=values,
        to_terms=to_terms,
        to_slope=np.asarray(np.polynomial.chebyshev.chebder(to_terms), dtype=np.float64),
        to_bend=np.asarray(np.polynomial.chebyshev.chebder(to_terms, 2), dtype=np.float64),
    )
