"""Contacts of any curve in lanes, and the largest demands until then, for all encounters of a request or some."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import FloatArray, IntArray

from .layout import PEAKS, STATES
from .native_lanes import contact_times
from .parallel import for_stretches
from .request import Request
from .windows import Curves, alone, curve_windows, farthest, line_windows, reach_of

__all__ = ["peaks_in_lanes", "solve_in_lanes"]

_LEAST: Final = 512  # encounters that are worth a thread
_MOST: Final = 1 << 18
_BEYOND: Final = 4.0  # how far beyond the farthest start an object may go before it is left to the guaranteed path


def solve_in_lanes(
    request: Request, which: IntArray | None, *, whole: bool = True
) -> tuple[dict[str, FloatArray], NDArray[np.int8]]:
    """Find and prove first contacts.

    Args:
        request: the encounters, on curves that hold down to l = 0.
        which: the indices of those to solve, m of them; None for all.
        whole: whether all of layout.STATES is wanted, or only the times.

    Returns:
        The quantities by name, shape (m,) each, and a status of 0 where a contact is proved, else another, shape (m,).
    """
    size = request.size if which is None else len(which)
    kept, status = np.empty((len(STATES) if whole else 1, size)), np.empty(size, dtype=np.int8)
    _run(request, which, kept, status)
    return dict(zip(STATES, kept, strict=False)), status


def peaks_in_lanes(request: Request, which: IntArray | None) -> dict[str, FloatArray]:
    """Return the largest demands until first contacts, layout.PEAKS by name.

    Args:
        request: the encounters, as for `solve_in_lanes`.
        which: the indices of those to solve, m of them; None for all.

    Returns:
        The demands, shape (m,) each, nan where no contact is proved or they are not settled.
    """
    size = request.size if which is None else len(which)
    peaks = np.empty((len(PEAKS), size))
    _run(request, which, np.empty((0, size)), np.empty(size, dtype=np.int8), peaks)
    return dict(zip(PEAKS, peaks, strict=True))


def _run(
    request: Request,
    which: IntArray | None,
    kept: FloatArray,
    status: NDArray[np.int8],
    peaks: FloatArray | None = None,
) -> None:
    """Fill status, as many of STATES as there are rows for, and layout.PEAKS where they are wanted."""
    curves, size = _curves(request, which), len(status)

    def run(start: int, stop: int) -> None:
        c, count = _columns(request, which, start, stop), stop - start
        inputs, own, part = (*c[:8], c[10]), _own(curves, start, stop), status[start:stop]
        out = kept if len(kept) == len(STATES) and count == size else np.empty((len(STATES), count))
        if peaks is None:
            contact_times(inputs, own, request.horizon, out, part)
        else:
            found = np.empty((len(PEAKS), count))
            contact_times(inputs, own, request.horizon, out, part, reference=c[8:10], peaks=found)
            peaks[:, start:stop] = found
        if out is not kept:
            kept[:, start:stop] = out[: len(kept)]

    for_stretches(run, size, least=_LEAST, most=_MOST)


def _columns(request: Request, which: IntArray | None, start: int, stop: int) -> tuple[FloatArray, ...]:
    if which is None:
        return request.block(start, stop)
    part = which[start:stop]
    return tuple(c if len(c) == 1 else c[part] for c in request.columns)


def _curves(request: Request, which: IntArray | None) -> Curves:
    """Return as much of the curves as the encounters need; few tables, so that they are kept."""
    if request.many is not None:
        windows = request.many.windows(reach_of(request.scenario))
        curve_of = (np.arange(request.size) if which is None else which) % len(request.many)
        return windows.table, windows.starts, curve_of
    reach = farthest(request.scenario, request.sensor)
    if request.method == "closed-form":
        top = min(_BEYOND * reach, request.sensor.valid_range[1])
        return alone(line_windows(request.sensor.constant_log_slope or 0.0, top))
    return alone(curve_windows(request.sensor, 0.0, reach))


def _own(curves: Curves, start: int, stop: int) -> Curves:
    """Return the curves of a stretch of encounters."""
    table, starts, curve_of = curves
    return curves if len(curve_of) == 1 else (table, starts, curve_of[start:stop])
