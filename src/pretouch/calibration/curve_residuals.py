"""Residuals of sensor curves that the compiled core computes: the difference between readings and curves.

The residuals of one reading y of the offset o are (asinh((y - o) / w) - asinh(xi / w)) / c, with the width w and the
relative error c. Small signals are compared like numbers, and large ones like logarithms.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import Structure, byref
from dataclasses import dataclass, replace
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel, numbers, shaped
from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch.sensors import Family

Residuals: TypeAlias = Callable[[FloatArray, IntArray], FloatArray]
"""Function of parameters, shape (b, p), and indices of their problems, shape (b,); returns residuals, shape (b, n)."""

INDEX: Final = np.dtype(np.int64)


class FitOfCore(Structure):
    """C structure with the least-squares problems of one kind: pretouch_fit in native/core/pretouch.h."""

    _fields_ = (
        *numbers("parameters", "points", kind=INTEGER),
        ("function", POINTER),
        ("family", INTEGER),
        *numbers("first", "last"),
        *numbers("distances", "outputs", "widths", "errors", "offsets", "weights", kind=POINTER),
        *numbers("offset_step", "weight_step", kind=INTEGER),
        *numbers("above", "sharpness", "pulls", kind=POINTER),
    )


room: Final = kernel("fit_room", POINTER, result=INTEGER)
"""Compiled function that returns the size of the workspace of a fit."""

minimize: Final = kernel(
    "minimize",
    *(POINTER, POINTER, INTEGER, POINTER, POINTER, INTEGER, DOUBLE, INTEGER),
    *(POINTER, POINTER, POINTER, POINTER, POINTER),
)
"""Compiled minimizer; its arguments are declared in native/core/pretouch.h."""

_residuals: Final = kernel("fit_residuals", POINTER, POINTER, POINTER, INTEGER, POINTER, POINTER)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveResiduals:
    """Residuals of the curves of one family, as a function that the compiled core also knows.

    Args:
        family: a family with a number in the compiled core.
        distances: of the readings [m], shape (n,).
        outputs: mean outputs y at these distances.
        widths: w, in the unit of the outputs.
        errors: c, the relative errors.
        offsets: o of each problem, or of all, shape (1,); None if it is the last parameter.
        weights: factors of the residuals of each problem, shape (b, n), or of all, (1, n); None for 1.
        above: ln of the ceiling of each problem over its largest signal, infinite for none; None for no ceilings.
        sharpness: sharpness of each ceiling.
        pulls: a spring for each problem, shape (b, 3): the number of the coordinate, stiffness and target; None for
            none. The coordinates are those of the family and ln -g in the middle of the window.
    """

    family: Family
    distances: FloatArray
    outputs: FloatArray
    widths: FloatArray
    errors: FloatArray
    offsets: FloatArray | None = None
    weights: FloatArray | BoolArray | None = None
    above: FloatArray | None = None
    sharpness: FloatArray | None = None
    pulls: FloatArray | None = None

    def __call__(self, x: FloatArray, problem: IntArray) -> FloatArray:
        """Return the residuals of parameters x, shape (b, p), in the problems with these indices, shape (b,)."""
        fit, kept = self.in_core()
        rows, which = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(problem, dtype=np.int64)
        result, workspace = np.empty((len(rows), self.width)), np.empty(room(byref(fit)))
        inputs = shaped(rows, (len(rows), fit.parameters)), shaped(which, (len(rows),), INDEX)
        _residuals(byref(fit), *inputs, len(rows), address(result), address(workspace))
        del kept  # the arrays that the core has used
        return result

    @property
    def width(self) -> int:
        """The number of residuals of a problem."""
        return len(self.distances) + (self.pulls is not None)

    def pulled(self, pulls: FloatArray) -> CurveResiduals:
        """Return the residuals with an additional spring for each problem."""
        return replace(self, pulls=pulls)

    def in_core(self) -> tuple[FitOfCore, list[Any]]:
        """Return the structure for the compiled core, and the arrays to which it points."""
        kept: list[Any] = []

        def at(values: FloatArray | BoolArray | None, *shape: int) -> int | None:
            if values is None:
                return None
            array = np.ascontiguousarray(values, dtype=np.float64)
            kept.append(array)
            return shaped(array, shape)

        n, family, offsets, weights = len(self.distances), self.family, self.offsets, self.weights
        readings = (self.distances, self.outputs, self.widths, self.errors)
        fit = FitOfCore(
            family.size + (offsets is None),
            n,
            None,
            family.number,
            family.first,
            family.last,
            *(at(values, n) for values in readings),
            None if offsets is None else at(offsets, len(offsets)),
            None if weights is None else at(weights, len(weights), n),
            offsets is not None and len(offsets) > 1,
            n if weights is not None and len(weights) > 1 else 0,
            *(None if values is None else at(values, len(values)) for values in (self.above, self.sharpness)),
            None if self.pulls is None else at(self.pulls, len(self.pulls), 3),
        )
        return fit, kept
