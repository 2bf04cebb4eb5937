"""The kernels that solve many encounters of any curve side by side, and leave open what they do not prove."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import POINTER as POINTER_TO
from ctypes import Structure, byref
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, columns, kernel, shaped
from pretouch._core.numbers import FloatArray, IntArray

from .layout import INPUTS, PEAKS, STATES
from .windows import HIGH_DEGREE, LOW_DEGREE, TERMS, Curves

__all__ = ["CONTACT", "OPEN", "contact_times", "of_core"]

CONTACT: Final = 0
"""The status of an encounter whose first contact is proved."""

OPEN: Final = -1
"""The status of all others."""

_STATUS: Final = np.dtype(np.int8)
_INDEX: Final = np.dtype(np.int64)
_WIDTHS: Final = frozenset(TERMS + 1 + degree for degree in (0, 1, LOW_DEGREE, HIGH_DEGREE))


class _CurvesOfCore(Structure):
    """What the core calls pretouch_curves."""

    _fields_ = (
        ("windows", POINTER),
        ("rows", INTEGER),
        ("width", INTEGER),
        ("starts", POINTER),
        ("curve_of", POINTER),
        ("stride", INTEGER),
    )


_CURVES: Final = POINTER_TO(_CurvesOfCore)
_contacts: Final = kernel("series_contacts", POINTER, POINTER, INTEGER, _CURVES, DOUBLE, *[POINTER] * 4)


def contact_times(
    inputs: Sequence[FloatArray],
    curves: Curves,
    horizon: float,
    out: FloatArray,
    status: NDArray[np.int8],
    *,
    gradients: FloatArray | None = None,
    peaks: FloatArray | None = None,
) -> None:
    """Find the first contact of encounters, where that can be proved.

    Args:
        inputs: the columns of layout.Relative: the first nine, for peaks all eleven, (n,) or (1,), contiguous.
        curves: from l = 0 upward.
        horizon: the latest contact of interest [s].
        out: filled with layout.STATES, shape (6, n); nan where open.
        status: filled with CONTACT or OPEN, shape (n,).
        gradients: filled with the derivatives of time, x~ and l' at contact by the nine inputs, shape (3, 9, n); nan
            where open.
        peaks: without gradients, filled with layout.PEAKS, shape (5, n); nan where open or not settled.

    Raises:
        TypeError: there are too few columns.
    """
    n = len(status)
    filled = (
        shaped(out, (len(STATES), n)),
        None if gradients is None else shaped(gradients, (3, INPUTS, n)),
        None if peaks is None else shaped(peaks, (len(PEAKS), n)),
        address(status, _STATUS),
    )
    if len(inputs) < INPUTS + (0 if peaks is None else 2):
        raise TypeError(f"a kernel takes {INPUTS} columns, or two more for the peaks, not {len(inputs)}")
    reference = None if peaks is None else columns(inputs[INPUTS:], n)
    _contacts(columns(inputs[:INPUTS], n), reference, n, byref(of_core(curves, n)), horizon, *filled)


def of_core(curves: Curves, n: int) -> _CurvesOfCore:
    """Return the curves of n encounters as the core reads them: what `byref` takes; the arrays must outlive it."""
    windows, starts, curve_of = curves
    rows, width = windows.shape
    shared = len(curve_of) == 1
    if width not in _WIDTHS or not (shared or len(curve_of) == n):
        raise ValueError(f"windows of {width} columns, and curves of {len(curve_of)} of {n} encounters")
    if not (_is_known(starts, curve_of, rows) if shared else _are_known(starts, curve_of, rows)):
        raise ValueError("an encounter has a curve whose windows are not in the table")
    at = address(windows), address(starts, _INDEX), address(curve_of, _INDEX)
    return _CurvesOfCore(at[0], rows, width, at[1], at[2], 0 if shared else 1)


def _is_known(starts: IntArray, curve_of: IntArray, rows: int) -> bool:
    """Tell whether the one curve is in the table, without the overhead of NumPy's functions."""
    which = int(curve_of[0])
    return 0 <= which < len(starts) - 1 and 0 <= int(starts[which]) <= int(starts[which + 1]) <= rows


def _are_known(starts: IntArray, curve_of: IntArray, rows: int) -> bool:
    """Tell whether the windows of every curve are in the table, and the curve of every encounter is one of them."""
    if len(starts) == 0 or starts[0] < 0 or starts[-1] > rows or (np.diff(starts) < 0).any():
        return False
    return len(curve_of) == 0 or bool(curve_of.min() >= 0 and curve_of.max() < len(starts) - 1)
