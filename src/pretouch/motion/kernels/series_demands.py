"""Contacts of any curve with the largest demands until then: a kernel that is compiled when these are read."""

from __future__ import annotations

from typing import Any

import numpy as np

from .compiler import kernel
from .lanes import LANES, aligned_rows
from .series_block import solve_lanes
from .series_peaks import WAITING_ROWS

__all__ = ["contact_peaks"]


@kernel
def contact_peaks(
    inputs: Any,
    drift: Any,
    pull: Any,
    curves: Any,
    horizon: float,
    out: Any,
    peaks: Any,
    status: Any,
) -> None:
    """Find contacts as contact_times does, and the largest demands on the robot until then.

    Args:
        inputs: see contact_times.
        drift: velocity of the reference at the start [m/s].
        pull: its acceleration [m/s^2].
        curves: see contact_times.
        horizon: see contact_times.
        out: see contact_times.
        peaks: filled with max |x~|, |x - x(0)|, |x'|, |x''| and |F_p|, shape (5, n); nan where open or not settled.
        status: see contact_times.
    """
    peaks[:] = 0.0
    room = (aligned_rows(WAITING_ROWS), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(1, np.int64))
    demands = (drift, pull, peaks, room)
    solve_lanes(inputs, curves, horizon, out, None, demands, status)
