"""Contacts that are found fast and proved: the closed form, and any curve in lanes. The rest is left open."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Travels

from .closed_form import find_contacts
from .lane_path import peaks_in_lanes, solve_in_lanes
from .layout import PEAKS, STATES
from .parallel import for_stretches
from .request import Request

__all__ = ["DEMANDS", "QUICK", "FastPath", "is_worth_it"]

QUICK: Final = frozenset((*STATES, "distance"))
"""What is known of a contact without the rest of its motion, and the virtual force by L(2) with that."""

DEMANDS: Final = frozenset((*PEAKS, "closest_distance", "settling_distance"))
"""What else is known of a motion that ends in contact."""

_LANES: Final = 8  # below, all that is asked of a contact is solved at once
_LEAST_LINEAR: Final = 16_384  # encounters that are worth a thread
_MOST: Final = 1 << 18
_KEPT: Final = 1 << 22  # encounters up to which the states are kept that come with the times
_CONTACT: Final = np.int8(0)


def is_worth_it(request: Request) -> bool:
    """Tell whether a request is large enough."""
    return request.method != "uniform-motion" and request.size >= _LANES


class FastPath(Travels):
    """First contacts that are found and proved, each by the first way that succeeds, and what is read of them.

    A constant slope takes the closed form on vectors first, then, as any curve, Taylor steps in lanes.

    Args:
        request: the encounters, to be solved by closed form or integration, on a curve that holds down to l = 0.

    Attributes:
        status: 0 where a contact is proved, else another, shape (n,).
        by_form: the statuses that the closed form left, shape (n,); None where it is not asked.
        known: their times, and what else of QUICK came with them, shape (n,) each; without meaning where not proved.
    """

    __slots__ = ("_in_lanes", "_which", "by_form", "known", "request", "status")

    def __init__(self, request: Request) -> None:
        self.request = request
        self.by_form: NDArray[np.int8] | None = None
        self._which: IntArray = np.arange(0)
        self._in_lanes: dict[str, FloatArray] = {}
        is_small = request.size <= _KEPT
        if request.method != "closed-form":
            states, self.status = solve_in_lanes(request, None, whole=is_small)
            self.known = _at_surface(states) if is_small else states
            return
        self.known, wanted = {"time": np.empty(request.size)}, {}
        if is_small:
            self.known["relative_velocity"] = wanted["approach"] = np.empty(request.size)
        self.by_form = self.status = np.empty(request.size, dtype=np.int8)
        self._fill(given=False, **wanted)
        if self.status.any():
            which = np.flatnonzero(self.status)
            states, status = solve_in_lanes(request, which, whole=is_small)
            self.status, self._which = self.status.copy(), which[status == _CONTACT]
            self.status[which] = status
            for name, values in self.known.items():
                values[which] = states[name]
            if is_small:
                self._in_lanes = {name: values[status == _CONTACT] for name, values in states.items()}

    def _fill(self, *, given: bool = True, **wanted: Any) -> None:
        """Fill what is wanted of the contacts of the closed form, by its names in `find_contacts`."""
        request, slope, time = self.request, self.request.slope, self.known["time"]
        status = self.status if self.by_form is None else self.by_form

        def run(start: int, stop: int) -> None:
            part = slice(start, stop)
            views = (
                {name: array[..., part] for name, array in wanted.items()} if stop - start < request.size else wanted
            )
            found = time[part], status[part]
            find_contacts(request.inputs(start, stop), slope, request.horizon, *found, given=given, **views)

        for_stretches(run, request.size, least=_LEAST_LINEAR, most=_MOST)

    def states(self) -> dict[str, FloatArray]:
        """Return all of QUICK, shape (n,) each; without meaning where no contact is proved."""
        request = self.request
        if self.by_form is None:
            return _at_surface(solve_in_lanes(request, None)[0])
        rows = np.empty((len(STATES) - 1, request.size))
        self._fill(states=rows)
        states = dict(zip(STATES, (self.known["time"], *rows), strict=True))
        if len(self._which):
            for name, values in (self._in_lanes or solve_in_lanes(request, self._which)[0]).items():
                states[name][self._which] = values
        return _at_surface(states)

    def force(self, relative_velocity: FloatArray) -> FloatArray:
        """Return F_p at contact by L(2), shape (n,), from l' there."""
        return np.asarray(self.request.gain * (self.request.slope_at_contact * relative_velocity))

    def demands(self, name: str) -> dict[str, FloatArray]:
        """Return one of DEMANDS and what else comes with it, shape (n,) each; nan where that is not settled."""
        request = self.request
        if name == "closest_distance":
            return {name: np.zeros(request.size)}
        if name == "settling_distance":
            return {name: _settling(request)}
        if self.by_form is None:
            return peaks_in_lanes(request, None)
        rows = np.empty((len(PEAKS), request.size))
        self._fill(peaks=rows)
        which = np.flatnonzero(np.isnan(rows).any(axis=0) & (self.status == _CONTACT))
        peaks = dict(zip(PEAKS, rows, strict=True))
        if len(which):
            for peak, values in peaks_in_lanes(request, which).items():
                peaks[peak][which] = np.where(np.isnan(peaks[peak][which]), values, peaks[peak][which])
        return peaks


def _settling(request: Request) -> FloatArray:
    """Return where a motion that ends in contact would come to rest, as the guaranteed paths have it."""
    mass, damping, stiffness, x_0, u_0, p, v, a = (request.column(i) for i in range(8))
    held, floats = stiffness > 0, (stiffness == 0) & (damping == 0)
    rests = ((v == 0) | floats) & (a == 0)
    if request.method != "closed-form":
        return np.where(rests & held & (request.gain <= 0), p, np.inf)
    total = damping + request.slope * request.gain
    free = p - x_0 + (v - u_0) * mass / np.where(total > 0, total, 1.0)
    return np.where(rests & (total > 0), np.where(held, p, free), np.inf)


def _at_surface(states: dict[str, FloatArray]) -> dict[str, FloatArray]:
    return {**states, "distance": np.zeros_like(states["time"])}
