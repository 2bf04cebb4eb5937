"""The compiled kernels for a constant slope, behind checks of all that they would misread."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, columns, kernel
from pretouch._core.numbers import FloatArray, IntArray

from .layout import COLUMNS, PEAKS, STATES

__all__ = [
    "GRADIENT_INPUTS",
    "GRADIENT_OUTPUTS",
    "OPEN",
    "contact_approaches",
    "contact_gradients",
    "contact_states",
    "contact_times",
    "largest_demands",
    "respond_many",
    "solve_linear",
]

OPEN: Final = -1
"""The status of an encounter that is left to other ways."""

GRADIENT_OUTPUTS: Final = ("time", "displacement", "relative_velocity")
GRADIENT_INPUTS: Final = ("mass", "damping", "stiffness", "x0", "u0", "p", "v", "a", "gain", "slope")

_INPUTS: Final = 9
_VALUES: Final = 10
_RESPONSE: Final = 7  # M, D, K, y(0), y'(0) and the force
_STATE_ROWS: Final = len(STATES) - 1
_STATUS: Final = np.dtype(np.int8)
_INT: Final = np.dtype(np.int64)

_contacts = kernel("linear_contacts", POINTER, INTEGER, DOUBLE, DOUBLE, POINTER, POINTER, POINTER, INTEGER, INTEGER)
_approaches = kernel("linear_approaches", POINTER, INTEGER, DOUBLE, DOUBLE, POINTER, POINTER, POINTER)
_states = kernel("linear_states", POINTER, INTEGER, DOUBLE, POINTER, POINTER, POINTER, INTEGER, INTEGER)
_gradients = kernel("linear_gradients", POINTER, INTEGER, DOUBLE, POINTER, POINTER, POINTER)
_peaks = kernel("linear_peaks", POINTER, POINTER, INTEGER, DOUBLE, POINTER, POINTER, POINTER, INTEGER, INTEGER)
_solve = kernel("solve_linear", POINTER, INTEGER, DOUBLE, POINTER, DOUBLE, DOUBLE, DOUBLE, POINTER, POINTER)
_respond = kernel("respond", POINTER, INTEGER, POINTER, INTEGER, POINTER, INTEGER, INTEGER, INTEGER)


def contact_times(
    inputs: Sequence[FloatArray],
    slope: float,
    horizon: float,
    time: FloatArray,
    status: NDArray[np.int8],
    *,
    states: FloatArray | None = None,
    first: int = 0,
) -> None:
    """Find first contacts of M x~'' + (D + c) x~' + K x~ = c (v + a t), c = slope gain, l = p + v t + a t^2 / 2 - x~.

    Args:
        inputs: M [kg], D [N s/m], K [N/m], x~(0) [m], x~'(0) [m/s], position [m], velocity [m/s] and acceleration
            [m/s^2] of the obstacle relative to the reference, and D_p [N s]: nine arrays, (n,) or (1,), contiguous.
        slope: g [1/m], one number.
        horizon: latest time of contact [s].
        time: filled with the times of contact [s], shape (n,); no number where the status is OPEN.
        status: filled with 0 (contact, proved to be the first, to 2e-11 of its time) or OPEN, shape (n,), int8.
        states: where given, filled as by contact_states.
        first: the column of states that the first encounter takes.
    """
    count = time.size
    into = (None, 0, 0) if states is None else _rows(states, _STATE_ROWS, first, count)
    _contacts(_columns(inputs, _INPUTS, count), count, slope, horizon, address(time), _statuses(status, count), *into)


def contact_approaches(
    inputs: Sequence[FloatArray],
    slope: float,
    horizon: float,
    found: tuple[FloatArray, FloatArray],
    status: NDArray[np.int8],
) -> None:
    """Find first contacts as contact_times does, and l' there.

    Args:
        inputs: those of contact_times.
        slope: g [1/m], one number.
        horizon: latest time of contact [s].
        found: filled with the times of contact [s] and l' [m/s], shape (n,) each; no numbers where OPEN.
        status: filled with 0 or OPEN, shape (n,), int8.
    """
    time, approach = found
    count = time.size
    _check(approach.size == count, "found", approach)
    into = address(time), _statuses(status, count), address(approach)
    _approaches(_columns(inputs, _INPUTS, count), count, slope, horizon, *into)


def contact_states(
    inputs: Sequence[FloatArray],
    slope: float,
    time: FloatArray,
    status: NDArray[np.int8],
    out: FloatArray,
    *,
    first: int = 0,
) -> None:
    """Fill columns of out, shape (5, m), with the state at the times that contact_times has found.

    Args:
        inputs: those of contact_times.
        slope: g [1/m], one number.
        time: what contact_times has found, shape (n,).
        status: 0 or OPEN, as contact_times has left it, shape (n,).
        out: x~ [m], x~' [m/s], x~'' [m/s^2], l' [m/s] and the integral of x~ over [0, t] [m s]: layout.STATES after the
            time; nan where OPEN.
        first: the column of out that the first encounter takes.
    """
    count = time.size
    into = _rows(out, _STATE_ROWS, first, count)
    _states(_columns(inputs, _INPUTS, count), count, slope, address(time), _statuses(status, count), *into)


def contact_gradients(
    inputs: Sequence[FloatArray], slope: float, time: FloatArray, status: NDArray[np.int8], out: FloatArray
) -> None:
    """Fill out, shape (3, 10, n), with the derivatives of GRADIENT_OUTPUTS at contact to GRADIENT_INPUTS.

    Args:
        inputs: those of contact_times.
        slope: g [1/m], one number.
        time: what contact_times has found, shape (n,).
        status: 0 or OPEN, as contact_times has left it, shape (n,).
        out: derivatives in SI units; nan where OPEN.
    """
    count = time.size
    _check(out.shape == (len(GRADIENT_OUTPUTS), len(GRADIENT_INPUTS), count), "out", out)
    given = _columns(inputs, _INPUTS, count)
    _gradients(given, count, slope, address(time), _statuses(status, count), address(out))


def largest_demands(
    inputs: Sequence[FloatArray],
    reference: Sequence[FloatArray],
    slope: float,
    time: FloatArray,
    status: NDArray[np.int8],
    *,
    out: FloatArray,
    first: int = 0,
) -> None:
    """Fill columns of out, shape (5, m), with layout.PEAKS until the times that contact_times has found.

    Args:
        inputs: those of contact_times; the acceleration of the reference is that of the obstacle.
        reference: its velocity at t = 0 [m/s] and its acceleration [m/s^2], (n,) or (1,).
        slope: g [1/m], one number.
        time: what contact_times has found, shape (n,).
        status: 0 or OPEN, as contact_times has left it, shape (n,).
        out: max |x~| [m], |x - x(0)| [m], |x'| [m/s], |x''| [m/s^2] and |F_p| [N]; nan where OPEN or not settled.
        first: the column of out that the first encounter takes.
    """
    count = time.size
    given, own = _columns(inputs, _INPUTS, count), _columns(reference, 2, count)
    into = _rows(out, len(PEAKS), first, count)
    _peaks(given, own, count, slope, address(time), _statuses(status, count), *into)


def solve_linear(
    values: FloatArray,
    slope: float,
    gains: FloatArray,
    limits: tuple[float, float, float],
    rows: FloatArray,
    *,
    status: IntArray,
) -> None:
    """Solve L(7), in the distance L(8), where ln xi' is a slope, each encounter alone, whatever it is like.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        slope: g [1/m].
        gains: D_p [N s], shape (n,).
        limits: horizon [s], smallest and largest valid distance [m].
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,), int64.
    """
    count = len(values)
    _check(values.shape == (count, _VALUES), "values", values)
    _check(gains.shape == (count,), "gains", gains)
    _check(rows.shape == (count, len(COLUMNS)), "rows", rows)
    _check(status.shape == (count,), "status", status)
    into = address(rows), address(status, _INT)
    _solve(address(values), count, slope, address(gains), *limits, *into)


def respond_many(rows: FloatArray, times: FloatArray, out: FloatArray) -> None:
    """Solve M y'' + D y' + K y = f_0 + f_1 t at given times.

    Args:
        rows: M, D, K, y(0), y'(0), f_0, f_1 in SI units, shape (n, 7).
        times: t [s], shape (n, m).
        out: filled with the first k of y, y', y'', y''' and the integral of y, shape (n, m, k): any part of an array
            whose last axis is contiguous.

    Raises:
        TypeError: a kernel would misread one of them.
    """
    n, m = times.shape
    _check(rows.shape == (n, _RESPONSE), "rows", rows)
    _check(out.ndim == 3 and out.shape[:2] == (n, m) and 0 < out.shape[2] <= 5, "out", out)
    stride, step, last = out.strides
    number = out.itemsize
    if out.dtype != np.float64 or not out.flags.writeable or (last, stride % number, step % number) != (number, 0, 0):
        raise TypeError(f"out: a kernel writes rows of float64, not {out.dtype} with strides {out.strides}")
    start = int(out.__array_interface__["data"][0])
    _respond(address(rows), n, address(times), m, start, stride // number, step // number, out.shape[2])


def _check(holds: bool, name: str, array: NDArray[Any]) -> None:
    if not holds:
        raise TypeError(f"{name}: a kernel would misread an array of shape {array.shape}")


def _columns(arrays: Sequence[FloatArray], expected: int, count: int) -> Any:
    """Return addresses and strides of arrays of the size 1 or count."""
    if len(arrays) != expected:
        raise TypeError(f"a kernel takes {expected} columns, not {len(arrays)}")
    return columns(arrays, count)


def _statuses(status: NDArray[np.int8], count: int) -> int:
    _check(status.size == count, "status", status)
    return address(status, _STATUS)


def _rows(out: FloatArray, rows: int, first: int, count: int) -> tuple[int, int, int]:
    """Return the address, the length of a row and the column to begin with."""
    _check(out.ndim == 2 and len(out) == rows and 0 <= first <= out.shape[1] - count, "out", out)
    return address(out), out.shape[1], first
