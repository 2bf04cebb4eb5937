"""The closed form L(10)-(13) for a constant slope, in a form that keeps its digits for every damping and K -> 0."""

from __future__ import annotations

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray

from .native_linear import respond_many, solve_linear
from .request import Request, Which

__all__ = ["solve_closed_form", "trace_closed_form"]


def solve_closed_form(request: Request, which: Which, rows: FloatArray, status: IntArray) -> None:
    """Solve some encounters by L(10)-(13), their contact as the first zero of l.

    Args:
        request: the encounters, with a curve of constant slope.
        which: those to solve, m of them.
        rows: filled with layout.COLUMNS, shape (m, 15).
        status: filled with the numbers of ContactStatus, shape (m,).
    """
    values, gain = request.part(which)
    low, high = request.sensor.valid_range
    slope = request.sensor.constant_log_slope or 0.0
    solve_linear(values, slope, gain, (request.horizon, low, high), rows, status=status)


def trace_closed_form(request: Request, times: FloatArray, trace: FloatArray) -> None:
    """Fill trace with x~, x~' and x~'' of L(10)-(13) in its last three columns at given times, shape (n, times, 4)."""
    v, coupling = request.values, (request.sensor.constant_log_slope or 0.0) * request.gain
    rows = np.column_stack([v[:, 0], v[:, 1] + coupling, v[:, 2:5], coupling * v[:, 6], coupling * v[:, 7]])
    respond_many(rows, times, trace[..., 1:])
