"""One call of the solver, solved as far as what is read of it needs: fast where that can be proved, in stretches."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value

from .curve import Curves, alone, curve_windows, farthest, line_windows, reach_of
from .guaranteed import solve_guaranteed
from .kernels import contact_times, find_contacts
from .layout import COLUMNS, PEAKS, STATES
from .parallel import run_in_chunks
from .request import Request

STIFF: Final = 500.0
"""Time over that of the damping at contact, from which l'' is a difference of much larger numbers."""

_LANES: Final = 8  # below, all that is asked of a contact is solved at once
_LEAST_LINEAR: Final = 16_384  # encounters that are worth a thread
_LEAST: Final = 512
_MOST: Final = 1 << 18
_BEYOND: Final = 4.0  # how far beyond the farthest start an object may go before it is left to the guaranteed path
_KEPT: Final = 1 << 22  # encounters up to which the states are kept that come with the times
_AT: Final = {name: i for i, name in enumerate(COLUMNS)}


class Solution(Value):
    """The columns of a result; it equals that of the same request.

    Each encounter is solved by the first way that proves its contact: the closed form on vectors, for a constant slope;
    Taylor steps in lanes; the guaranteed path of its method, which takes what those leave open and all where there are
    few, or where the whole motion is asked for. What else is read is asked of the same way.

    Args:
        request: the encounters.
        whole: whether the whole motion will be asked for, so that the guaranteed path is taken at once.

    Attributes:
        status: how every run ended, shape (n,).
        derivatives: what `gradients_of` has made of it, kept here.
    """

    __slots__ = (
        "_by_form",
        "_found",
        "_in_lanes",
        "_known",
        "_open",
        "_open_rows",
        "_rows",
        "derivatives",
        "request",
        "status",
    )

    def __init__(self, request: Request, *, whole: bool = False) -> None:
        self.request = request
        self.derivatives: Any = None
        self.status: NDArray[np.int8]
        self._known: dict[str, Any] = {}
        self._rows: FloatArray | None = None
        holds = request.many is not None or request.sensor.valid_range[0] <= 0
        if whole or not holds or request.method == "uniform-motion" or request.size < _LANES:
            self._rows, self.status = solve_guaranteed(request)
            return
        self._by_form: NDArray[np.int8] | None = None
        self._in_lanes: tuple[IntArray | None, dict[str, FloatArray]] = None, {}
        kept = request.size <= _KEPT
        if request.method == "closed-form":
            self._found = self._solve_by_form(kept)
        else:
            self._found, self.status = _in_lanes(request, None, STATES if kept else STATES[:1])
        self._open = np.flatnonzero(self.status)
        if len(self._open):
            self._open_rows, ended = solve_guaranteed(request, self._open)
            self.status[self._open] = ended
            self._fill_open(self._found)

    def _solve_by_form(self, kept: bool) -> dict[str, FloatArray]:
        """Return times and, where they are kept, l' at contact, of the closed form and where it leaves one of lanes."""
        request, wanted = self.request, {}
        found = {"time": np.empty(request.size)}
        if kept:
            found["relative_velocity"] = wanted["approach"] = np.empty(request.size)
        self.status = self._by_form = np.empty(request.size, dtype=np.int8)
        _fill_by_form(request, found["time"], self.status, given=False, **wanted)
        which = np.flatnonzero(self.status)
        if len(which):
            states, status = _in_lanes(request, which, STATES if kept else STATES[:1])
            proved = status == 0
            self.status = self.status.copy()
            self.status[which] = status
            for name, values in found.items():
                values[which] = states[name]
            self._in_lanes = which[proved], {name: v[proved] for name, v in states.items()} if kept else {}
        return found

    def _compared(self) -> tuple[Any, ...]:
        return (self.request,)

    def column(self, name: str) -> Any:
        """Return a quantity of ContactState or ContactResult, of the broadcast shape; a float for a single run."""
        if name not in self._known:
            found = np.asarray(_DERIVED[name](self) if name in _DERIVED else self.raw(name))
            if self.request.shape == ():
                self._known[name] = found.reshape(-1)[0].item()
            else:
                found = found.reshape(self.request.shape)
                found.setflags(write=False)
                self._known[name] = found
        return self._known[name]

    def raw(self, name: str) -> FloatArray:
        """Return one of layout.COLUMNS, shape (n,)."""
        if self._rows is not None:
            return self._rows[:, _AT[name]]
        if name not in self._found:
            found = self._ask(name)
            self._fill_open(found)
            self._found = {**found, **self._found}
        if name in PEAKS:
            self._settle(name)
        return self._found[name]

    def _ask(self, name: str) -> dict[str, FloatArray]:
        """Return a quantity of contacts, and what else comes with it; without meaning where no contact is proved."""
        request = self.request
        if name == "virtual_force":  # by L(2)
            return {name: np.asarray(request.gain * (request.slope_at_contact * self.raw("relative_velocity")))}
        if name in {"distance", "closest_distance"}:
            return {name: np.zeros(request.size)}
        if name == "settling_distance":
            return {name: _settling(request)}
        return self._peaks() if name in PEAKS else self._states()

    def _states(self) -> dict[str, FloatArray]:
        request = self.request
        if self._by_form is None:
            return _in_lanes(request, None)[0]
        rows, time = np.empty((len(STATES) - 1, request.size)), self._found["time"]
        _fill_by_form(request, time, self._by_form, given=True, states=rows)
        states = dict(zip(STATES, (time, *rows), strict=True))
        which, known = self._in_lanes
        if which is not None:
            for name, values in (known or _in_lanes(request, which)[0]).items():
                states[name][which] = values
        return states

    def _peaks(self) -> dict[str, FloatArray]:
        request = self.request
        if self._by_form is None:
            return _in_lanes(request, None, PEAKS)[0]
        rows = np.empty((len(PEAKS), request.size))
        _fill_by_form(request, self._found["time"], self._by_form, given=True, peaks=rows)
        peaks = dict(zip(PEAKS, rows, strict=True))
        which = np.flatnonzero(np.isnan(rows).any(axis=0) & self._proved())
        if len(which):
            for name, values in _in_lanes(request, which, PEAKS)[0].items():
                peaks[name][which] = np.where(np.isnan(peaks[name][which]), values, peaks[name][which])
        return peaks

    def _proved(self) -> BoolArray:
        """Tell which contacts a fast way has found."""
        proved = np.ones(self.request.size, dtype=np.bool_)
        proved[self._open] = False
        return proved

    def _fill_open(self, found: dict[str, FloatArray]) -> None:
        """Put what the guaranteed path has found where the fast ones left encounters open."""
        if len(self._open):
            for name, values in found.items():
                values[self._open] = self._open_rows[:, _AT[name]]

    def _settle(self, name: str) -> None:
        """Solve by the guaranteed path where a fast one found a contact, but not this demand until then."""
        which = np.flatnonzero(np.isnan(self._found[name]))
        if len(which):
            rows, _ = solve_guaranteed(self.request, which)
            for other in PEAKS:
                values = self._found[other]
                values[which] = np.where(np.isnan(values[which]), rows[:, _AT[other]], values[which])

    @property
    def settled_acceleration(self) -> FloatArray:
        """x~'' at the end of every run to all digits, shape (n,).

        Where hundreds of time constants have passed, it is a difference of much larger numbers, which lanes have to
        1e-7 only; derivatives need it better.
        """
        name, request = "settled_acceleration", self.request
        if name not in self._known:
            found, r = self.raw("displacement_acceleration"), request.relative
            if self._rows is None and request.method != "closed-form":
                decays = (r.damping + r.gain * request.sensor.log_slope(0.0)) / r.mass
                which = np.flatnonzero(self._proved() & (decays * self.raw("time") > STIFF))
                if len(which):
                    found = found.copy()
                    found[which] = solve_guaranteed(request, which)[0][:, _AT["displacement_acceleration"]]
            self._known[name] = found
        return np.asarray(self._known[name])

    def reference(self, derivative: int) -> FloatArray:
        """Return x_d, x_d' or x_d'' at the end of every run."""
        given, time = self.request.scenario.reference, self.raw("time").reshape(self.request.shape)
        if derivative == 2:
            return np.broadcast_to(given.acceleration, self.request.shape).reshape(-1)
        if derivative == 1:
            return np.asarray(given.velocity + given.acceleration * time).reshape(-1)
        return np.asarray(given.position + (given.velocity + given.acceleration * time / 2) * time).reshape(-1)


def _fill_by_form(
    request: Request, time: FloatArray, status: NDArray[np.int8], *, given: bool, **wanted: FloatArray
) -> None:
    """Have `find_contacts` find the contacts of encounters with a constant slope, or fill more of those found."""
    slope = request.slope

    def run(start: int, stop: int) -> None:
        part = slice(start, stop)
        views = {name: array[..., part] for name, array in wanted.items()} if stop - start < request.size else wanted
        find_contacts(request.some(part), slope, request.horizon, time[part], status[part], given=given, **views)

    run_in_chunks(run, request.size, least=_LEAST_LINEAR, most=_MOST)


def _in_lanes(
    request: Request, which: IntArray | None, names: tuple[str, ...] = STATES
) -> tuple[dict[str, FloatArray], NDArray[np.int8]]:
    """Find and prove first contacts of some encounters or all, on curves that hold down to l = 0.

    Returns:
        Some of layout.STATES, or layout.PEAKS, nan where they are not settled, by name, shape (m,) each, and 0 where a
        contact is proved, shape (m,).
    """
    size = request.size if which is None else len(which)
    kept, status = np.empty((len(names), size)), np.empty(size, dtype=np.int8)

    def take(part: slice, *found: FloatArray) -> None:
        kept[:, part] = found[-1][: len(names)]

    more = {"peaks": (len(PEAKS),)} if names is PEAKS else {}
    fill_by_lanes(request, which, _curves(request, which), status, take, most=_MOST, **more)
    return dict(zip(names, kept, strict=True)), status


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
        status: filled with 0 where a contact is proved, else another, shape (m,).
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

    run_in_chunks(run, len(status), least=_LEAST, most=most)


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


def _settling(request: Request) -> FloatArray:
    """Return where a motion that ends in contact would come to rest, as the guaranteed paths have it."""
    r = request.relative
    held, floats = r.stiffness > 0, (r.stiffness == 0) & (r.damping == 0)
    rests = ((r.v == 0) | floats) & (r.a == 0)
    if request.method != "closed-form":
        return np.where(np.broadcast_to(rests & held & (r.gain <= 0), request.size), r.p, np.inf)
    total = r.damping + request.slope * r.gain
    free = r.p - r.x0 + (r.v - r.u0) * r.mass / np.where(total > 0, total, 1.0)
    return np.where(np.broadcast_to(rests & (total > 0), request.size), np.where(held, r.p, free), np.inf)


def _impulse_residual(solution: Solution) -> FloatArray:
    """Return |M dx~' + D dx~ + K int x~ dt - D_p d ln xi| over the largest of its terms, M |l'(0)| and D l(0)."""
    request = solution.request
    if request.method == "uniform-motion":
        return np.full(request.size, np.nan)
    r = request.relative
    begin = np.broadcast_to(r.p - r.x0, request.size)
    with np.errstate(all="ignore"):  # a function of the user's may overflow where the object has gone far away
        rise = request.log_output(solution.raw("distance")) - request.log_output(begin)
    terms = np.stack(
        [
            r.mass * (solution.raw("displacement_velocity") - r.u0),
            r.damping * (solution.raw("displacement") - r.x0),
            r.stiffness * solution.raw("displacement_integral"),
            -r.gain * rise,
        ]
    )
    approach = np.maximum(
        r.mass * np.abs(r.v - r.u0), r.damping * (r.p - r.x0)
    )  # where nothing pushes, all terms vanish
    largest = np.maximum(np.abs(terms).max(axis=0), approach)
    return np.asarray(np.abs(terms.sum(axis=0)) / np.where(largest > 0, largest, 1.0))


_DERIVED: Final[dict[str, Callable[[Solution], Any]]] = {
    "status": lambda s: s.status,
    "gain": lambda s: s.request.gain.copy(),
    "position": lambda s: s.raw("displacement") + s.reference(0),
    "velocity": lambda s: s.raw("displacement_velocity") + s.reference(1),
    "acceleration": lambda s: s.raw("displacement_acceleration") + s.reference(2),
    "impulse_residual": _impulse_residual,
}
