"""Integration of L(1) with L(2) for any curve: the compiled kernel over as much of the curve as the motion needs."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray

from .curve import curve_pieces, curve_reach
from .layout import COLUMNS
from .native_series import solve_series
from .request import Request, Which
from .status import ContactStatus

__all__ = ["integrate", "trace_integration"]

_GROWTH: Final = 64.0
_FARTHEST: Final = 1e12
_BLOCK: Final = 16


def integrate(request: Request, which: Which, rows: FloatArray, status: IntArray) -> None:
    """Integrate L(1) with L(2) for some encounters, again with more pieces of the curve for those that outgrow them.

    With the curves L(3), L(5) and L(6) this is L(4), L(7) and L(14).

    Args:
        request: the encounters.
        which: those to solve, m of them.
        rows: filled with layout.COLUMNS, shape (m, 15).
        status: filled with the numbers of ContactStatus, shape (m,).
    """
    values, gain = request.part(which)
    reach = _first_reach(request)
    pieces, limits = _pieces(request, reach)
    for start in range(0, len(rows), _BLOCK):  # an interrupt gets through between blocks, not inside compiled code
        part = slice(start, start + _BLOCK)
        solve_series(values[part], gain[part], pieces, limits, rows[part], status[part])
    while limits[2] and reach < _FARTHEST:
        again = np.flatnonzero((status == ContactStatus.UNRESOLVED) & (rows[:, 1] >= reach))
        if not len(again):
            return
        reach *= _GROWTH
        pieces, limits = _pieces(request, reach)
        more, more_status = np.empty((len(again), rows.shape[1])), np.empty(len(again), dtype=np.int64)
        solve_series(values[again], gain[again], pieces, limits, more, more_status)
        rows[again], status[again] = more, more_status


def trace_integration(request: Request, times: FloatArray, trace: FloatArray) -> None:
    """Fill trace with layout.TRACE_COLUMNS at ascending times until each run's end, shape (n, times, 4)."""
    reach, which = _first_reach(request), np.arange(request.size)
    trace[...] = np.nan
    while True:
        values, gain = request.part(which)
        pieces, limits = _pieces(request, reach)
        part = np.full((len(which), *trace.shape[1:]), np.nan)
        rows, status = np.empty((len(which), len(COLUMNS))), np.empty(len(which), dtype=np.int64)
        solve_series(values, gain, pieces, limits, rows, status, (times[which], part))
        trace[which] = part
        which = which[np.isnan(part).any(axis=(1, 2))]  # the others would end a rounding earlier on other pieces
        if not len(which) or not limits[2] or reach > _FARTHEST:
            return
        reach *= _GROWTH


def _pieces(request: Request, reach: float) -> tuple[FloatArray, tuple[float, bool, bool]]:
    """Return the curve's pieces up to a reach, or as far as it can be followed, and the limits that go with them."""
    low, high = request.sensor.valid_range
    wanted, bottom = min(high, reach), max(low, 0.0)
    top = curve_reach(request.sensor, bottom, min(wanted, max(reach / _GROWTH, _farthest(request))), wanted)
    limits = (request.horizon, low <= 0, top < high and top == wanted)
    return curve_pieces(request.sensor, bottom, top), limits


def _farthest(request: Request) -> float:
    return float(np.max(request.columns[5] - request.columns[3], initial=0.0))


def _first_reach(request: Request) -> float:
    return 2.0 ** math.ceil(math.log2(4 * _farthest(request)))
