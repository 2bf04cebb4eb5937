"""Numbers at the public border, and the polynomials that all numerics use."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InvalidInputError

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


def is_number(value: Any) -> bool:
    """Tell whether a value is one real number, of Python or NumPy; truth values are none."""
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "iuf" and not np.ma.is_masked(value)
    return isinstance(value, Real | Decimal) and not isinstance(value, bool)


def as_float(value: Any) -> float:
    """Return a number as a float: infinite where it is beyond all floats, NaN where it is no number."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
    except ValueError:  # a signaling NaN of Decimal
        return math.nan


def is_whole(value: Any) -> bool:
    """Tell whether a value is a whole number, of Python or NumPy; truth values are none."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def are_numbers(value: Any) -> bool:
    """Tell whether a value is a number, or an array or nested sequence of them, NaN and infinite ones among them."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        return True
    return _numbers(value) is not None


def _numbers(value: ArrayLike) -> FloatArray | None:
    """Copy numbers into a float array; None for text, truth values, complex and masked ones, which NumPy converts."""
    try:
        if isinstance(value, list | tuple) and bool in map(type, value):
            return None
        given = np.asarray(value)
        if given.dtype.kind == "O" and any(isinstance(item, str | bytes | bool) for item in given.flat):
            return None
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


def chebyshev_nodes(count: int) -> FloatArray:
    """Return the roots of T_count, from 1 down: the nodes of an interpolation."""
    return np.asarray(np.cos((np.arange(count) + 0.5) * np.pi / count))


def chebyshev_extremes(degree: int) -> FloatArray:
    """Return where |T_degree| = 1, from 1 down to -1, shape (degree + 1,): between the nodes, and at the ends."""
    return np.asarray(np.cos(np.arange(degree + 1) * np.pi / degree))


def chebyshev_sum(terms: FloatArray, z: FloatArray | float) -> FloatArray:
    """Evaluate series, their coefficients along the first axis and one column for each, at one point each."""
    return np.asarray(np.polynomial.chebyshev.chebval(z, terms, tensor=False))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChebyshevBasis:
    """The polynomials up to a degree, as they are found from values at nodes.

    Args:
        nodes: where values are known, shape (n,).
        values: the polynomials there, shape (n, degree + 1).
        to_terms: from values at the nodes to coefficients, shape (degree + 1, n): through the values, or nearest to
            them in the mean square where there are more of them than coefficients.
        to_slope: from values at the nodes to the coefficients of the derivative, shape (degree, n).
        to_bend: the same for the second derivative, shape (degree - 1, n).
    """

    nodes: FloatArray
    values: FloatArray
    to_terms: FloatArray
    to_slope: FloatArray
    to_bend: FloatArray


@lru_cache
def chebyshev_basis(at: tuple[float, ...] | int, degree: int | None = None) -> ChebyshevBasis:
    """Make the basis for a number of nodes, or for given ones.

    Args:
        at: how many nodes; or nodes of one's own in [-1, 1].
        degree: of the highest polynomial; through all values where none is given.

    Returns:
        The basis.
    """
    where = chebyshev_nodes(at) if isinstance(at, int) else np.array(at)
    highest = len(where) - 1 if degree is None else degree
    values = np.asarray(np.polynomial.chebyshev.chebvander(where, highest))
    to_terms = np.linalg.inv(values) if highest == len(where) - 1 else np.linalg.pinv(values)
    return ChebyshevBasis(
        nodes=where,
        values=values,
        to_terms=to_terms,
        to_slope=np.asarray(np.polynomial.chebyshev.chebder(to_terms), dtype=np.float64),
        to_bend=np.asarray(np.polynomial.chebyshev.chebder(to_terms, 2), dtype=np.float64),
    )
