"""The guaranteed path for any curve, of the compiled core: arrays are checked here, and solved there."""

from __future__ import annotations

from ctypes import POINTER as POINTER_TO
from ctypes import Structure, byref
from typing import Any, Final

import numpy as np

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import FloatArray, IntArray

__all__ = ["FOLLOWED", "follow_gradients", "solve_series"]

FOLLOWED: Final = 9
"""How many inputs there are before those of the curve: M, D, K, x~(0), x~'(0), p, v, a, D_p."""

_INTEGER: Final = np.dtype(np.int64)
_SHORT: Final = np.dtype(np.int8)
_WIDEST: Final = 12  # middle, half width and ten coefficients of a piece


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
        limits: horizon [s], whether the lowest border is the contact, whether the curve goes on beyond the pieces.
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,).
        course: ascending times [s], shape (n, m), and what is filled with layout.TRACE_COLUMNS at them, shape
            (n, m, 4); what comes after the end of an encounter is left as it is.
    """
    n = len(values)
    _check(rows, (n, 15))
    _check(status, (n,))
    traced: tuple[int | None, int, int | None] = (None, 0, None)
    if course is not None:
        times, trace = course
        _check(times, (n, *times.shape[1:]))
        _check(trace, (n, times.shape[1], 4))
        traced = address(times), times.shape[1], address(trace)
    encounters = _encounters(values, gains, pieces, limits)
    _solve(*encounters, limits[0], address(rows), address(status, _INTEGER), *traced)


def follow_gradients(
    values: FloatArray,
    gains: FloatArray,
    pieces: FloatArray,
    terms: FloatArray,
    horizon: float,
    found: FloatArray,
    status: Any,
) -> None:
    """Follow encounters that end in contact, and find how time and l' there depend on the inputs.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        gains: D_p [N s], shape (n,).
        pieces: the curve from l = 0 upward, as curve_pieces gives it, shape (p, 2 + degree).
        terms: for each piece the coefficients of rho = dg/d(parameter) in z of m parameters of the curve, one at most,
            shape (p, m, degree).
        horizon: when to give up [s].
        found: filled with the derivatives of time and l' by the nine inputs and the parameter, shape (n, 2, 9 + m);
            nan where no contact is reached.
        status: filled with 0 where the contact was reached, 1 where l went beyond the pieces, else 2, shape (n,), int8.
    """
    n, many = len(values), min(terms.shape[1], 1)
    _check(terms, (len(pieces), many, pieces.shape[1] - 2))
    _check(found, (n, 2, FOLLOWED + many))
    _check(status, (n,))
    encounters = _encounters(values, gains, pieces, (horizon, True, False))
    _follow(*encounters, address(terms) if many else None, horizon, address(found), address(status, _SHORT))


def _encounters(
    values: FloatArray, gains: FloatArray, pieces: FloatArray, limits: tuple[float, bool, bool]
) -> tuple[int, int, int, Any]:
    """Return what the kernels take of the encounters and of their curve."""
    n, (count, width) = len(values), pieces.shape
    _check(values, (n, 10))
    _check(gains, (n,))
    if not (count > 0 and 3 <= width <= _WIDEST):
        raise TypeError(f"a curve has pieces of up to {_WIDEST} numbers, not {pieces.shape}")
    return address(values), n, address(gains), byref(_PiecesOfCore(address(pieces), count, width, *limits[1:]))


def _check(array: Any, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise TypeError(f"a kernel takes an array of shape {shape} here, not {array.shape}")
