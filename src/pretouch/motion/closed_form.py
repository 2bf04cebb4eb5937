"""The closed form L(10)-(13) for a constant slope, of the compiled core: arrays are checked here, and solved there.

Over-damped contacts are found side by side on vectors, each proved to be the first; what that leaves open is solved one
by one, whatever it is like, in a form that keeps its digits for every damping and K -> 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import pack
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, columns, kernel, rows_of, shaped
from pretouch._core.numbers import FloatArray, IntArray

from .layout import COLUMNS, INPUTS, PEAKS, STATES

__all__ = ["OPEN", "find_contacts", "respond_many", "solve_linear"]

OPEN: Final = -1
"""The status of an encounter that is left to other ways."""

_BY: Final = INPUTS + 1  # derivatives: by g as well
_STATUS: Final = np.dtype(np.int8)
_INT: Final = np.dtype(np.int64)

_contacts = kernel("linear_contacts", POINTER, INTEGER, DOUBLE, DOUBLE, POINTER)
_solve = kernel("solve_linear", POINTER, INTEGER, DOUBLE, POINTER, DOUBLE, DOUBLE, DOUBLE, POINTER, POINTER)
_respond = kernel("respond", POINTER, INTEGER, POINTER, INTEGER, POINTER, INTEGER, INTEGER, INTEGER)


def find_contacts(
    inputs: Sequence[FloatArray],
    slope: float,
    horizon: float,
    time: FloatArray,
    status: NDArray[np.int8],
    *,
    given: bool = False,
    approach: FloatArray | None = None,
    states: FloatArray | None = None,
    gradients: FloatArray | None = None,
    peaks: FloatArray | None = None,
) -> None:
    """Find first contacts of M x~'' + (D + c) x~' + K x~ = c (v + a t), c = slope gain, l = p + v t + a t^2 / 2 - x~.

    What is filled beside times and statuses has no numbers where the status is OPEN.

    Args:
        inputs: the columns of layout.Relative: the first nine, for peaks all eleven, (n,) or (1,), contiguous.
        slope: g [1/m], one number.
        horizon: latest time of contact [s].
        time: filled with the times of contact [s], shape (n,).
        status: filled with 0 (contact, proved to be the first, to 2e-11 of its time) or OPEN, shape (n,), int8.
        given: whether time and status are what an earlier call has found, and only the rest is filled.
        approach: where wanted, filled with l' [m/s] at contact, shape (n,).
        states: where wanted, filled with layout.STATES after the time, shape (5, n): any part of an array whose last
            axis is contiguous.
        gradients: where wanted, filled with the derivatives of time, x~ and l' at contact by the nine inputs and g in
            SI, shape (3, 10, n).
        peaks: where wanted, filled with layout.PEAKS, also without numbers where not settled, shape (5, n): any part,
            as states.

    Raises:
        TypeError: a kernel would misread one of them.
    """
    n, expected = time.size, INPUTS if peaks is None else INPUTS + 2
    if len(inputs) < expected:
        raise TypeError(f"a kernel takes {expected} columns, not {len(inputs)}")
    wanted = pack(
        "10q",
        shaped(time, (n,)),
        shaped(status, (n,), _STATUS),
        given,
        0 if approach is None else shaped(approach, (n,)),
        *((0, 0) if states is None else rows_of(states, (len(STATES) - 1, n))),
        *((0, 0) if gradients is None else (shaped(gradients, (3, _BY, n)), n)),
        *((0, 0) if peaks is None else rows_of(peaks, (len(PEAKS), n))),
    )
    _contacts(columns(inputs[:expected], n), n, slope, horizon, wanted)


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
    n = len(values)
    encounters = shaped(values, (n, 10)), n, slope, shaped(gains, (n,))
    _solve(*encounters, *limits, shaped(rows, (n, len(COLUMNS))), shaped(status, (n,), _INT))


def respond_many(rows: FloatArray, times: FloatArray, out: FloatArray) -> None:
    """Solve M y'' + D y' + K y = f_0 + f_1 t at given times.

    Args:
        rows: M, D, K, y(0), y'(0), f_0, f_1 in SI units, shape (n, 7).
        times: t [s], shape (n, m).
        out: filled with the first k of y, y', y'', y''' and the integral of y, shape (n, m, k): any part of an array
            whose last axis is contiguous.
    """
    n, m = times.shape
    count = min(out.shape[-1], 5)
    into = rows_of(out, (n, m, count))
    _respond(shaped(rows, (n, 7)), n, address(times), m, *into, count)
