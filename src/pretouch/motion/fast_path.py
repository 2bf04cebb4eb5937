"""Contacts that are found fast and proved, in stretches on all cores: by the closed form, and on any curve in lanes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import FloatArray, IntArray

from .layout import PEAKS, STATES
from .native_lanes import contact_times, find_contacts
from .parallel import for_stretches
from .request import Request
from .windows import Curves, alone, curve_windows, farthest, line_windows, reach_of

__all__ = ["fill_by_form", "fill_by_lanes", "peaks_in_lanes", "solve_in_lanes"]

_LEAST_LINEAR: Final = 16_384  # encounters that are worth a thread
_LEAST: Final = 512
_MOST: Final = 1 << 18
_BEYOND: Final = 4.0  # how far beyond the farthest start an object may go before it is left to the guaranteed path


def fill_by_form(
    request: Request, time: FloatArray, status: NDArray[np.int8], *, given: bool, **wanted: FloatArray
) -> None:
    """Have `find_contacts` find the contacts of encounters with a constant slope, or fill more of those found."""
    slope = request.slope

    def run(start: int, stop: int) -> None:
        part = slice(start, stop)
        views = {name: array[..., part] for name, array in wanted.items()} if stop - start < request.size else wanted
        find_contacts(request.some(part), slope, request.horizon, time[part], status[part], given=given, **views)

    for_stretches(run, request.size, least=_LEAST_LINEAR, most=_MOST)


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

    def take(part: slice, states: FloatArray) -> None:
        kept[:, part] = states[: len(kept)]

    fill_by_lanes(request, which, _curves(request, which), status, take, most=_MOST)
    return dict(zip(STATES, kept, strict=False)), status


def peaks_in_lanes(request: Request, which: IntArray | None) -> dict[str, FloatArray]:
    """Return layout.PEAKS by name, as `solve_in_lanes`; nan where no contact is proved or they are not settled."""
    size = request.size if which is None else len(which)
    kept, status = np.empty((len(PEAKS), size)), np.empty(size, dtype=np.int8)

    def take(part: slice, _: FloatArray, peaks: FloatArray) -> None:
        kept[:, part] = peaks

    fill_by_lanes(request, which, _curves(request, which), status, take, most=_MOST, peaks=(len(PEAKS),))
    return dict(zip(PEAKS, kept, strict=True))


def fill_by_lanes(
    request: Request,
    which: IntArray | None,
    curves: Curves,
    status: NDArray[np.int8],
    take: Callable[..., None],
    *,
    most: int,
    **more: tuple[int, ...],
) -> None:
    """Have `contact_times` find contacts, stretch by stretch.

    Args:
        request: the encounters.
        which: the indices of those to solve, m of them; None for all.
        curves: theirs.
        status: filled, shape (m,).
        take: takes where a stretch of the m lies, its states, shape (6, k), and what else is wanted.
        most: the longest stretch.
        **more: what else is wanted by its name in `contact_times`, with its shape for one encounter.
    """
    table, starts, curve_of = curves

    def run(start: int, stop: int) -> None:
        part = slice(start, stop)
        states = np.empty((len(STATES), stop - start))
        filled: dict[str, Any] = {name: np.empty((*shape, stop - start)) for name, shape in more.items()}
        own = table, starts, curve_of if len(curve_of) == 1 else curve_of[part]
        some = request.some(part if which is None else which[part])
        contact_times(some, own, request.horizon, states, status[part], **filled)
        take(part, states, *filled.values())

    for_stretches(run, len(status), least=_LEAST, most=most)


def _curves(request: Request, which: IntArray | None) -> Curves:
    """Return as much of the curves as the encounters need; few tables, so that they are kept."""
    if request.many is not None:
        windows = request.many.windows(reach_of(request.scenario))
        curve_of = (np.arange(request.size) if which is None else which) % len(request.many)
        return windows.table, windows.starts, curve_of
    reach = farthest(request.scenario, request.sensor)
    if request.method == "closed-form":
        top = min(_BEYOND * reach, request.sensor.valid_range[1])
        return alone(line_windows(request.slope, top))
    return alone(curve_windows(request.sensor, 0.0, reach))
