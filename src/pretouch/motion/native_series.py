"""The guaranteed path for any curve, of the compiled core: arrays are checked here, and solved there."""

from __future__ import annotations

from ctypes import POINTER as POINTER_TO
from ctypes import Structure, byref
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel, shaped
from pretouch._core.numbers import FloatArray, IntArray

from .layout import COLUMNS, INPUTS, TRACE_COLUMNS

__all__ = ["Extent", "follow_gradients", "solve_series"]

_INTEGER: Final = np.dtype(np.int64)
_SHORT: Final = np.dtype(np.int8)
_WIDEST: Final = 12  # middle, half width and ten coefficients of a piece


class Extent(NamedTuple):
    """Where a motion ends.

    Args:
        horizon: when to give up [s].
        ends_in_contact: whether the lowest border of the pieces is the contact.
        open_ended: whether the curve goes on beyond the pieces.
    """

    horizon: float
    ends_in_contact: bool
    open_ended: bool


class _PiecesOfCore(Structure):
    """What the core calls pretouch_pieces."""

    _fields_ = (
        ("pieces", POINTER),
        ("count", INTEGER),
        ("width", INTEGER),
        ("ends_in_contact", INTEGER),
        ("open_ended", INTEGER),
    )


_ENCOUNTERS: Final = (POINTER, INTEGER, POINTER, POINTER_TO(_PiecesOfCore))
_solve: Final = kernel("solve_series", *_ENCOUNTERS, DOUBLE, POINTER, POINTER, POINTER, INTEGER, POINTER)
_follow: Final = kernel("follow_gradients", *_ENCOUNTERS, POINTER, DOUBLE, POINTER, POINTER)


def solve_series(
    values: FloatArray,
    gains: FloatArray,
    pieces: FloatArray,
    limits: tuple[float, bool, bool],
    rows: FloatArray,
    status: IntArray,
    course: tuple[FloatArray, FloatArray] | None = None,
) -> None:
    """Integrate L(1) with L(2), which is L(4), L(7) or L(14) as the curve may be, for a curve given as pieces.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        gains: D_p [N s], shape (n,).
        pieces: middle [m], half width [m] and coefficients of g in z [1/m] of each piece, shape (p, 2 + degree).
        limits: see Extent.
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,).
        course: ascending times [s], shape (n, m), and what is filled with layout.TRACE_COLUMNS at them, shape
            (n, m, 4); what comes after the end of an encounter is left as it is.
    """
    n = len(values)
    traced: tuple[int | None, int, int | None] = (None, 0, None)
    if course is not None:
        times, trace = course
        m = times.shape[1]
        traced = shaped(times, (n, m)), m, shaped(trace, (n, m, len(TRACE_COLUMNS)))
    filled = shaped(rows, (n, len(COLUMNS))), shaped(status, (n,), _INTEGER)
    _solve(*_encounters(values, gains, pieces, limits), limits[0], *filled, *traced)


def follow_gradients(
    values: FloatArray,
    gains: FloatArray,
    pieces: FloatArray,
    terms: FloatArray,
    horizon: float,
    found: FloatArray,
    status: NDArray[np.int8],
) -> None:
    """Follow encounters that end in contact, and find how time and l' there depend on the inputs.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        gains: D_p [N s], shape (n,).
        pieces: the curve from l = 0 upward, as curve_pieces gives it, shape (p, 2 + degree).
        terms: for each piece the coefficients of rho = dg/d(parameter) in z of m parameters of the curve, one at most,
            shape (p, m, degree).
        horizon: when to give up [s].
        found: filled with the derivatives of time and l' by layout.RELATIVE_INPUTS and the parameter, shape
            (n, 2, 9 + m); nan where no contact is reached.
        status: filled with 0 where the contact was reached, 1 where l went beyond the pieces, else 2, shape (n,).
    """
    n, many = len(values), min(terms.shape[1], 1)
    known = shaped(terms, (len(pieces), many, pieces.shape[1] - 2))
    filled = shaped(found, (n, 2, INPUTS + many)), shaped(status, (n,), _SHORT)
    encounters = _encounters(values, gains, pieces, Extent(horizon, ends_in_contact=True, open_ended=False))
    _follow(*encounters, known if many else None, horizon, *filled)


def _encounters(
    values: FloatArray, gains: FloatArray, pieces: FloatArray, limits: tuple[float, bool, bool]
) -> tuple[int, int, int, Any]:
    """Return what the kernels take of the encounters and of their curve."""
    n, (count, width) = len(values), pieces.shape
    if not (count > 0 and 3 <= width <= _WIDEST):
        raise TypeError(f"a curve has pieces of up to {_WIDEST} numbers, not {pieces.shape}")
    curve = byref(_PiecesOfCore(address(pieces), count, width, *limits[1:]))
    return shaped(values, (n, 10)), n, shaped(gains, (n,)), curve
