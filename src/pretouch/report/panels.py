"""Describe the curves, points, ranges and maps in a figure panel.

A panel is a subplot whose axes have units.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .panel_checks import (
    as_column,
    as_limits,
    as_number,
    as_values,
    called,
    check_axis,
    check_choice,
    check_ends,
    check_style,
    widened,
)
from .style import CURVES

_UNIT: Final = re.compile(r"\[[^\]]+\]")
_KINDS: Final = ("line", "points", "both")
_SHAPES: Final = ("dot", "ring", "square")
_SPAN_KINDS: Final = ("blocked", "missing", "used")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Curve(Value):
    """One curve, or one set of points, in a plot.

    Args:
        x: horizontal coordinates, shape (N,), in the unit of the panel's x label.
        y: vertical coordinates, shape (N,), in the unit of the panel's y label; NaN breaks the line.
        label: name of the curve in the legend, in the color of the curve; empty for none.
        style: index of the palette, 0 to 4, for color, line style and marker; None for the position among the curves
            of the panel that are not quiet. A quiet curve ignores its style.
        kind: `line`, `points` for measured or sampled values, or `both`.
        low: lower ends, shape (N,): with `high` a band around a line, or a bar through every point.
        high: upper ends, shape (N,).
        quiet: True for a thin gray line, such as one of many similar motions.
        end: text at the last finite point, which is marked with a dot; a text that several curves of a panel share is
            written once. A dot outside the limits of the panel is not drawn.

    Raises:
        InvalidInputError: the columns differ in length, have no finite point or an infinite value, `low` is above
            `high` or only one of them is given, or the kind or the style is unknown.

    Examples:
        >>> Curve(x=[0.0, 10.0, 20.0], y=[0.1, float("nan"), 0.3], label="finger sensor")
        <Curve finger sensor: 2 of 3 points>
    """

    x: ArrayLike
    y: ArrayLike
    label: str = ""
    style: int | None = None
    kind: Literal["line", "points", "both"] = "line"
    low: ArrayLike | None = None
    high: ArrayLike | None = None
    quiet: bool = False
    end: str = ""

    def __post_init__(self) -> None:
        subject = called("curve", self.label)
        for name in ("x", "y", "low", "high"):
            if name in {"x", "y"} or getattr(self, name) is not None:
                object.__setattr__(self, name, as_column(getattr(self, name), f"{subject}: {name}"))
        sizes = {name: len(column) for name, column in self.columns()}
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{size} values of {name}" for name, size in sizes.items())
            raise InvalidInputError(
                f"{subject}: found {listed}, expected the same number of values in each column of a curve"
            )
        if not self.known.any():
            raise InvalidInputError(f"{subject}: this curve has no point with finite numbers x and y; remove the curve")
        check_ends(self.low, self.high, subject)
        check_choice(self.kind, _KINDS, f"{subject}: kind")
        check_types(self)
        check_style(self.style, subject)

    def columns(self) -> Iterator[tuple[str, FloatArray]]:
        """Yield the curve's data columns, such as x, with their names."""
        for name in ("x", "y", "low", "high"):
            column = getattr(self, name)
            if column is not None:
                yield name, column

    @property
    def known(self) -> Any:
        """Boolean mask of the curve points with finite x and y."""
        return np.isfinite(np.asarray(self.x, float)) & np.isfinite(np.asarray(self.y, float))

    def __repr__(self) -> str:
        return f"<Curve {self.label or 'without a name'}: {self.known.sum()} of {len(self.known)} points>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark(Value):
    """One highlighted point in a plot, such as an optimum.

    Args:
        x: horizontal coordinate, in the unit of the panel's x label.
        y: vertical coordinate, in the unit of the panel's y label.
        label: name of the point, in the legend, or next to the point if it is short; empty for none.
        style: index of the palette for the color, 0 to 4; None for black.
        shape: `dot`, `ring` or `square`.

    Raises:
        InvalidInputError: a coordinate is not finite, or the style or the shape is unknown.
    """

    x: float
    y: float
    label: str = ""
    style: int | None = None
    shape: Literal["dot", "ring", "square"] = "dot"

    def __post_init__(self) -> None:
        subject = called("mark", self.label)
        for name in ("x", "y"):
            object.__setattr__(self, name, as_number(getattr(self, name), f"{subject}: {name}"))
        check_choice(self.shape, _SHAPES, f"{subject}: shape")
        check_types(self)
        check_style(self.style, subject)


@dataclass(frozen=True, slots=True, kw_only=True)
class Span(Value):
    """A hatched or shaded range of the horizontal axis.

    It spans the whole height of the plot.

    Args:
        start: lower end, in the unit of the panel's x label.
        end: upper end, larger than `start`.
        label: name of the range, in the legend; empty for none.
        kind: `blocked` (hatched, for infeasible values), `missing` (hatched in the other direction, for missing values)
            or `used` (shaded).

    Raises:
        InvalidInputError: `end` is not larger than `start`, or the kind is unknown.
    """

    start: float
    end: float
    label: str = ""
    kind: Literal["blocked", "missing", "used"] = "blocked"

    def __post_init__(self) -> None:
        subject = called("span", self.label)
        for name in ("start", "end"):
            as_number(getattr(self, name), f"{subject}: {name}")
        start, end = as_limits((self.start, self.end), subject) or (0.0, 0.0)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "end", end)
        check_choice(self.kind, _SPAN_KINDS, f"{subject}: kind")
        check_types(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Map(Value):
    """A map of a quantity over two variables.

    The contour lines are labeled. Missing values are hatched.

    Args:
        x: coordinates of the columns of `values`, shape (N,), N >= 2, in the unit of the panel's x label.
        y: coordinates of the rows of `values`, shape (M,), M >= 2, in the unit of the panel's y label.
        values: shape (M, N), in the unit of the panel's title; NaN for missing values.

    Raises:
        InvalidInputError: a coordinate is infinite, a shape does not fit, or no value is finite.
    """

    x: ArrayLike
    y: ArrayLike
    values: ArrayLike

    def __post_init__(self) -> None:
        check_types(self)
        x, y = (as_column(getattr(self, name), f"map: {name}") for name in ("x", "y"))
        values = np.asarray(self.values, dtype=np.float64)
        if values.shape != (len(y), len(x)) or min(values.shape) < 2 or not np.isfinite(values).any():
            count = np.isfinite(values).sum()
            raise InvalidInputError(
                f"map: values: found an array of shape {values.shape} with {count} finite values, expected the shape "
                f"{(len(y), len(x))}. The map needs one row for each y and one column for each x. It needs at least "
                "2 rows, 2 columns and one finite value"
            )
        across, up = np.argsort(x), np.argsort(y)
        for name, column in (("x", x[across]), ("y", y[up]), ("values", values[up][:, across])):
            object.__setattr__(self, name, column)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Panel(Value):
    """One plot: a pair of axes with curves or with a map.

    Args:
        x_label: label of the horizontal axis, with its unit in brackets: `distance l [mm]`, or `[1]` for pure numbers.
        y_label: label of the vertical axis, with its unit in brackets.
        curves: the curves; at most five different styles are available for curves that are not quiet.
        map: a map; the title then has its unit in brackets.
        title: title above the panel; empty for none.
        marks: highlighted points.
        spans: ranges of the horizontal axis, drawn behind the curves.
        levels: horizontal reference lines: name to y.
        positions: vertical reference lines: name to x.
        x_log: True for a logarithmic horizontal axis, on which all numbers must be positive or NaN.
        y_log: True for a logarithmic vertical axis, on which all numbers must be positive or NaN.
        x_limits: limits of the horizontal axis; None for limits that contain all data.
        y_limits: limits of the vertical axis; None for limits that contain all data, from zero for positive data near
            zero.

    Raises:
        InvalidInputError: a unit is missing, there is neither a curve nor a map, a number on a logarithmic axis is not
            positive, the limits are not ascending or exclude something with a name, or there are more than five curves
            without a style.
    """

    x_label: str
    y_label: str
    curves: Sequence[Curve] = field(default=(), metadata={"checked": False})  # by as_values
    map: Map | None = None
    title: str = ""
    marks: Sequence[Mark] = field(default=(), metadata={"checked": False})
    spans: Sequence[Span] = field(default=(), metadata={"checked": False})
    levels: Mapping[str, float] = field(default_factory=dict)
    positions: Mapping[str, float] = field(default_factory=dict)
    x_log: bool = False
    y_log: bool = False
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_types(self)
        for name in ("x_label", "y_label", "title")[: 2 if self.map is None else 3]:
            if not _UNIT.search(getattr(self, name)):
                raise InvalidInputError(
                    f"{name}: found the text {getattr(self, name)!r}, expected a text with a unit in brackets, such "
                    "as 'distance l [mm]'. The unit of pure numbers is '[1]'"
                )
        for name, kind in (("curves", Curve), ("marks", Mark), ("spans", Span)):
            object.__setattr__(self, name, as_values(getattr(self, name), kind, name))
        if not self.curves and self.map is None:
            raise InvalidInputError("curves: found none, expected at least one Curve, or a map")
        for name in ("levels", "positions"):
            lines = {str(k): as_number(v, f"{name}: {k}") for k, v in dict(getattr(self, name)).items()}
            object.__setattr__(self, name, lines)
        for name in ("x", "y"):
            ends = f"{name}_limits"
            object.__setattr__(self, ends, as_limits(getattr(self, ends), ends))
            check_axis(self, name)
        loud = [curve for curve in self.curves if not curve.quiet]
        if any(curve.style is None for curve in loud[len(CURVES) :]):
            raise InvalidInputError(
                f"curves: found {len(loud)} curves in one panel, but there are only {len(CURVES)} line styles. "
                "Use quiet=True for background curves, or draw several panels. Curves can also share a style: set "
                "style to a number from 0 to 4"
            )

    def __repr__(self) -> str:
        size = f"{len(self.curves)} curve{'s' if len(self.curves) > 1 else ''}"
        return f"<Panel {self.title or self.y_label} over {self.x_label}: {size}>"


def containing(
    *, x_limits: tuple[float, float] | None = None, y_limits: tuple[float, float] | None = None, **options: Any
) -> Panel:
    """Return a panel whose limits contain each of its labeled items.

    Args:
        x_limits: the wanted limits of the x axis; they are widened if a labeled item lies outside.
        y_limits: the same for the y axis.
        options: the other arguments of `Panel`.

    Returns:
        The panel.

    Examples:
        >>> mark = Mark(x=0.5, y=8.0, label="optimum")
        >>> curve = Curve(x=[0.0, 1.0], y=[1.0, 2.0])
        >>> panel = containing(x_label="x [1]", y_label="y [1]", curves=[curve], marks=[mark], y_limits=(0.0, 2.0))
        >>> panel.y_limits
        (0.0, 8.48)
    """
    panel = Panel(**options)
    return replace(panel, x_limits=widened(panel, "x", x_limits), y_limits=widened(panel, "y", y_limits))
