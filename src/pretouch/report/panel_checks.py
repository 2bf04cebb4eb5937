"""Check the arguments of figure panels and explain invalid values.

A panel is a subplot of a figure.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import not_one_of, short_repr
from pretouch._core.numbers import FloatArray, finite

from .style import CURVES

_AIR = 0.06  # share of an axis between its end and an item that widened it


def called(kind: str, label: str) -> str:
    """Return the name of a plot item for error messages.

    An example is `curve 'finger sensor'`.
    """
    return f"{kind} {label!r}" if label else kind


def as_column(values: ArrayLike, name: str) -> FloatArray:
    """Copy a list of numbers to a one-dimensional array.

    Returns:
        The array; masked values become NaN.

    Raises:
        InvalidInputError: the values are not a list of numbers, the list is empty, or a value is infinite.
    """
    try:
        array = np.asarray(values)
    except ValueError:
        raise InvalidInputError(
            f"{name}: found values of different shapes, expected a list of numbers, such as [0.0, 1.5, 3.0]"
        ) from None
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        what = f"{array.dtype.name} of shape {array.shape}" if array.ndim else short_repr(values)
        raise InvalidInputError(
            f"{name}: found {what}, expected a list of numbers, such as [0.0, 1.5, 3.0]", value=values
        )
    if not len(array):
        raise InvalidInputError(f"{name}: found no values, expected at least one")
    column = np.array(array, dtype=np.float64)
    column[np.ma.getmaskarray(np.ma.asarray(values))] = np.nan
    if np.isinf(column).any():
        index = int(np.flatnonzero(np.isinf(column))[0])
        raise InvalidInputError(
            f"{name}: the value at index {index} is {column[index]:g}, but values must be finite; use NaN for a "
            "missing point"
        )
    column.setflags(write=False)
    return column


def as_number(value: Any, name: str) -> float:
    """Check that a value is one finite number, and return the number."""
    number = finite(value, name)
    if not isinstance(number, float):
        raise InvalidInputError(f"{name}: found an array of shape {np.shape(number)}, expected a single number")
    return number


def as_limits(limits: Any, name: str) -> tuple[float, float] | None:
    """Check and return the two ascending limits of an axis.

    Returns:
        The limits, or None if they are None.

    Raises:
        InvalidInputError: the limits are not two ascending numbers.
    """
    if limits is None:
        return None
    ends = finite(limits, name)
    if np.shape(ends) != (2,) or not ends[0] < ends[1]:
        raise InvalidInputError(
            f"{name}: found {limits!r}, expected two numbers, the smaller number first", value=limits
        )
    return float(ends[0]), float(ends[1])


def as_values(values: Any, kind: type, name: str) -> tuple[Any, ...]:
    """Check the class of all elements of a sequence.

    Returns:
        The elements.

    Raises:
        InvalidInputError: an element has another class, or the argument is no sequence.
    """
    if isinstance(values, kind):
        raise InvalidInputError(
            f"{name}: found a single {kind.__name__}, expected a list; write {name}=[{kind.__name__}(...)]",
            value=values,
        )
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise InvalidInputError(
            f"{name}: found {short_repr(values)}, expected a list of {kind.__name__}s", value=values
        )
    items = tuple(values)
    for value in items:
        if not isinstance(value, kind):
            raise InvalidInputError(f"{name}: found {type(value).__name__}, expected {kind.__name__}")
    return items


def check_choice(value: Any, choices: tuple[str, ...], name: str) -> None:
    """Check that an option has one of its allowed values."""
    if value not in choices:
        raise InvalidInputError(**not_one_of(name, value, choices))


def check_ends(low: Any, high: Any, subject: str) -> None:
    """Check the lower and upper ends of error bars or bands.

    Raises:
        InvalidInputError: only one end is given, or a lower end exceeds its upper end.
    """
    if (low is None) != (high is None):
        present, missing = ("high", "low") if low is None else ("low", "high")
        raise InvalidInputError(
            f"{subject}: the argument {present} is given without the argument {missing}; give both arguments or neither"
        )
    if low is not None and np.any(low > high):
        index = int(np.flatnonzero(low > high)[0])
        ends = f"low = {low[index]:g} above high = {high[index]:g} at index {index}"
        raise InvalidInputError(
            f"{subject}: found {ends}, expected low <= high", value=(float(low[index]), float(high[index]))
        )


def check_style(style: Any, subject: str) -> None:
    """Check that a line style exists in the color palette."""
    if style is not None and (isinstance(style, bool) or style not in range(len(CURVES))):
        raise InvalidInputError(
            f"{subject}: found the style {style!r}, expected an index of the color palette from 0 to "
            f"{len(CURVES) - 1}, or None",
            value=style,
        )


def check_axis(panel: Any, axis: str) -> None:
    """Check that the limits and scale of an axis fit its data.

    Raises:
        InvalidInputError: a labeled item is outside the limits, or a logarithmic axis has a value that is not positive.
    """
    ends = getattr(panel, f"{axis}_limits")
    if getattr(panel, f"{axis}_log"):
        for name, values in [*_numbers(panel, axis), (f"{axis}_limits", np.array(ends or ()))]:
            if np.any(values <= 0):
                raise InvalidInputError(
                    f"{name}: found {values[values <= 0][0]:g}, but a logarithmic axis needs positive numbers; "
                    f"use NaN for a missing point, or set {axis}_log=False"
                )
    for name, values in _numbers(panel, axis):
        nameless = name.startswith("curve:")
        if ends and not nameless and (np.nanmax(values) < ends[0] or np.nanmin(values) > ends[1]):
            raise InvalidInputError(
                f"{name}: all values lie outside {axis}_limits; widen these limits, or remove the values. The limits "
                f"are {ends[0]:g} and {ends[1]:g}. The values range from {np.nanmin(values):g} to {np.nanmax(values):g}"
            )


def widened(panel: Any, axis: str, limits: tuple[float, float] | None) -> tuple[float, float] | None:
    """Widen the limits of an axis until each labeled item is visible.

    Args:
        panel: the panel, with or without limits.
        axis: "x" or "y".
        limits: the wanted limits.

    Returns:
        The limits; None, for automatic limits, if the wanted limits are not two ascending finite numbers.
    """
    if limits is None or not (np.isfinite(limits).all() and limits[0] < limits[1]):
        return None
    low, high = limits
    logarithmic = getattr(panel, f"{axis}_log")
    for name, values in _numbers(panel, axis):
        if name.startswith("curve:"):  # a curve without a label
            continue
        nearest, farthest = float(np.nanmin(values)), float(np.nanmax(values))
        if farthest < low:
            low = farthest * (low / farthest) ** -_AIR if logarithmic else farthest - _AIR * (high - farthest)
        if nearest > high:
            high = nearest * (nearest / high) ** _AIR if logarithmic else nearest + _AIR * (nearest - low)
    return low, high


def _numbers(panel: Any, axis: str) -> Iterator[tuple[str, FloatArray]]:
    """Yield the coordinates of all plot items along one axis."""
    for curve in panel.curves:
        for name, column in curve.columns():
            if (name == "x") == (axis == "x") and np.isfinite(column).any():
                yield f"{called('curve', curve.label)}: {name}", column
    for mark in panel.marks:
        yield f"{called('mark', mark.label)}: {axis}", np.array([getattr(mark, axis)])
    if axis == "x":
        for span in panel.spans:
            yield called("span", span.label), np.array([span.start, span.end])
    kind = "positions" if axis == "x" else "levels"
    for text, at in getattr(panel, kind).items():
        yield f"{kind}: {text}", np.array([at])
    if panel.map is not None:
        yield f"map: {axis}", getattr(panel.map, axis)
