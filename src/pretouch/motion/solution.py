"""Solve encounters lazily: compute only those quantities that the user accesses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value

from .curve import Curves, curve_windows, farthest, line_windows, reach_of, shared_curve
from .guaranteed import drag_impulses, solve_guaranteed
from .kernels import contact_times, find_contacts
from .layout import COLUMNS, PEAKS, STATES
from .parallel import run_in_chunks
from .request import Request

STIFF: Final = 500.0
"""Ratio of time to damping time constant at contact above which l'' is a difference of much larger numbers."""

_LANES: Final = 8  # smaller sets of encounters are solved completely at once
_LEAST_LINEAR: Final = 16_384  # encounters that are worth a thread
_LEAST: Final = 512  # encounters on other curves that are worth a thread
_MOST: Final = 1 << 18  # largest chunk
_BEYOND: Final = 4.0  # range of the fast path, relative to the farthest start
_FAST: Final = 1e100  # m/s; the products of larger speeds overflow on the fast paths
_KEPT: Final = 1 << 22  # largest number of encounters whose states at contact are stored with the times
_AT: Final = {name: i for i, name in enumerate(COLUMNS)}


class Solution(Value):
    """Lazily computed results of encounters.

    Each quantity, such as the contact time, is computed on first access. Two solutions are equal if their requests are.

    Each encounter is solved by the first method that proves its contact. For a constant slope this is first the
    vectorized closed form, then vectorized Taylor steps. The most robust method solves the remaining encounters,
    and all of them if they are few or if the whole motion is needed. Other quantities that are read later come from the
    same method.

    Args:
        request: the encounters.
        whole: whether the whole motion will be needed, so that the most robust method is used at once.
        peaks: the peak values of layout.PEAKS that will be read, so that Taylor steps compute them together with the
            contacts.

    Attributes:
        status: how every run ended, shape (n,).
        derivatives: cache of `gradients_of`.
    """

    __slots__ = (
        "_by_form",
        "_cache",
        "_columns",
        "_in_lanes",
        "_open",
        "_open_rows",
        "_rows",
        "derivatives",
        "request",
        "status",
    )

    def __init__(self, request: Request, *, whole: bool = False, peaks: Sequence[str] = ()) -> None:
        self.request = request
        self.derivatives: Any = None
        self.status: NDArray[np.int8]
        self._cache: dict[str, Any] = {}
        self._rows: FloatArray | None = None
        holds = request.many is not None or request.sensor.valid_range[0] <= 0
        speeds = request.relative.v, request.relative.u0
        holds = holds and all(v.min(initial=0.0) > -_FAST and v.max(initial=0.0) < _FAST for v in speeds)
        whole = whole or bool(request.scenario.obstacle.course)
        if whole or not holds or request.method == "uniform-motion" or request.size < _LANES:
            self._rows, self.status = solve_guaranteed(request)
            return
        self._by_form: NDArray[np.int8] | None = None
        self._in_lanes: tuple[IntArray | None, dict[str, FloatArray]] = None, {}
        kept = request.size <= _KEPT
        if request.method == "closed-form":
            self._columns = self._solve_by_form(kept)
        else:
            self._columns, self.status = _in_lanes(request, None, (*(STATES if kept else STATES[:1]), *peaks))
        self._open = np.flatnonzero(self.status)
        if len(self._open):
            self._open_rows, ended = solve_guaranteed(request, self._open)
            self.status[self._open] = ended
            self._fill_open(self._columns)

    def _solve_by_form(self, kept: bool) -> dict[str, FloatArray]:
        """Return contact times by the closed-form solution.

        Where the closed form fails, a Taylor-series solver replaces it. If `kept`, the relative velocity l' is computed
        as well.
        """
        request, outputs = self.request, {}
        columns = {"time": np.empty(request.size)}
        if kept:
            columns["relative_velocity"] = outputs["approach"] = np.empty(request.size)
        self.status = self._by_form = np.empty(request.size, dtype=np.int8)
        _fill_by_form(request, columns["time"], self.status, solved=False, **outputs)
        which = np.flatnonzero(self.status)
        if len(which):
            states, status = _in_lanes(request, which, STATES if kept else STATES[:1])
            proved = status == 0
            self.status = self.status.copy()
            self.status[which] = status
            for name, values in columns.items():
                values[which] = states[name]
            self._in_lanes = which[proved], {name: v[proved] for name, v in states.items()} if kept else {}
        return columns

    def _compared(self) -> tuple[Any, ...]:
        return (self.request,)

    def column(self, name: str) -> Any:
        """Return one result quantity, such as the contact time.

        The result is an array for several encounters, and a float for one.
        """
        if name not in self._cache:
            values = np.asarray(_DERIVED[name](self) if name in _DERIVED else self.raw(name))
            if self.request.shape == ():
                self._cache[name] = values.reshape(-1)[0].item()
            else:
                values = values.reshape(self.request.shape)
                values.setflags(write=False)
                self._cache[name] = values
        return self._cache[name]

    def raw(self, name: str) -> FloatArray:
        """Return one result quantity, such as the contact time, per encounter.

        `name` is one of layout.COLUMNS.
        """
        if self._rows is not None:
            return self._rows[:, _AT[name]]
        if name not in self._columns:
            columns = self._compute(name)
            self._fill_open(columns)
            self._columns = {**columns, **self._columns}
        if name in PEAKS:
            self._settle(name)
        return self._columns[name]

    def _compute(self, name: str) -> dict[str, FloatArray]:
        """Compute one result, and all others of its solver; meaningless for encounters without a proved contact."""
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
        rows, time = np.empty((len(STATES) - 1, request.size)), self._columns["time"]
        _fill_by_form(request, time, self._by_form, solved=True, states=rows)
        states = dict(zip(STATES, (time, *rows), strict=True))
        which, kept = self._in_lanes
        if which is not None:
            for name, values in (kept or _in_lanes(request, which)[0]).items():
                states[name][which] = values
        return states

    def _peaks(self) -> dict[str, FloatArray]:
        request = self.request
        if self._by_form is None:
            return _in_lanes(request, None, PEAKS)[0]
        rows = np.empty((len(PEAKS), request.size))
        _fill_by_form(request, self._columns["time"], self._by_form, solved=True, peaks=rows)
        peaks = dict(zip(PEAKS, rows, strict=True))
        which = np.flatnonzero(np.isnan(rows).any(axis=0) & self._proved())
        if len(which):
            for name, values in _in_lanes(request, which, PEAKS)[0].items():
                peaks[name][which] = np.where(np.isnan(peaks[name][which]), values, peaks[name][which])
        return peaks

    def _proved(self) -> BoolArray:
        """Return for each encounter whether a fast solver proved its contact."""
        proved = np.ones(self.request.size, dtype=np.bool_)
        proved[self._open] = False
        return proved

    def _fill_open(self, columns: dict[str, FloatArray]) -> None:
        """Insert the results of encounters that fast solvers could not solve."""
        if len(self._open):
            for name, values in columns.items():
                values[self._open] = self._open_rows[:, _AT[name]]

    def _settle(self, name: str) -> None:
        """Compute missing peak values by the most robust solver."""
        which = np.flatnonzero(np.isnan(self._columns[name]))
        if len(which):
            rows, _ = solve_guaranteed(self.request, which)
            for peak in self._columns.keys() & set(PEAKS):
                values = self._columns[peak]
                values[which] = np.where(np.isnan(values[which]), rows[:, _AT[peak]], values[which])

    @property
    def settled_acceleration(self) -> FloatArray:
        """The robot's final acceleration relative to the reference position [m/s^2].

        After hundreds of time constants it is a difference of much larger numbers. Lanes then have an error of 1e-7,
        which is too large for derivatives, so that the most robust solver is used.
        """
        name, request = "settled_acceleration", self.request
        if name not in self._cache:
            values, r = self.raw("displacement_acceleration"), request.relative
            if self._rows is None and request.method != "closed-form":
                decays = (r.damping + r.gain * request.sensor.log_slope(0.0)) / r.mass
                which = np.flatnonzero(self._proved() & (decays * self.raw("time") > STIFF))
                if len(which):
                    values = values.copy()
                    values[which] = solve_guaranteed(request, which)[0][:, _AT["displacement_acceleration"]]
            self._cache[name] = values
        return np.asarray(self._cache[name])

    def reference(self, derivative: int) -> FloatArray:
        """Return the final position, velocity or acceleration of the reference.

        `derivative` is 0 for the position [m], 1 for the velocity [m/s] and 2 for the acceleration [m/s^2].
        """
        reference, time = self.request.scenario.reference, self.raw("time").reshape(self.request.shape)
        if derivative == 2:
            return np.broadcast_to(reference.acceleration, self.request.shape).reshape(-1)
        if derivative == 1:
            return np.asarray(reference.velocity + reference.acceleration * time).reshape(-1)
        return np.asarray(reference.position + (reference.velocity + reference.acceleration * time / 2) * time).reshape(
            -1
        )


def _fill_by_form(
    request: Request, time: FloatArray, status: NDArray[np.int8], *, solved: bool, **outputs: FloatArray
) -> None:
    """Solve encounters with constant sensor slope by the closed form.

    If `solved`, only more results of solved encounters are computed.
    """
    slope = request.slope

    def run(start: int, stop: int) -> None:
        part = slice(start, stop)
        views = {name: array[..., part] for name, array in outputs.items()} if stop - start < request.size else outputs
        find_contacts(request.some(part), slope, request.horizon, time[part], status[part], solved=solved, **views)

    run_in_chunks(run, request.size, least=_LEAST_LINEAR, most=_MOST)


def _in_lanes(
    request: Request, which: IntArray | None, names: tuple[str, ...] = STATES
) -> tuple[dict[str, FloatArray], NDArray[np.int8]]:
    """Find contacts of many encounters by the Taylor-series solver.

    The solver proves that each contact is the first. The sensor curves must be valid down to l = 0.

    Returns:
        The named quantities of layout.STATES and layout.PEAKS, shape (m,) each, NaN if not determined; and the status,
        0 if a contact is proved, shape (m,).
    """
    size = request.size if which is None else len(which)
    kept, status = np.empty((len(names), size)), np.empty(size, dtype=np.int8)

    wanted = tuple(name for name in names if name in PEAKS)

    def take(part: slice, *outputs: FloatArray) -> None:
        rows = dict(zip((*STATES, *wanted), (row for output in outputs for row in output), strict=True))
        for row, name in zip(kept, names, strict=True):
            row[part] = rows[name]

    more = {"peaks": (len(wanted),)} if wanted else {}
    fill_by_lanes(request, which, _curves(request, which), status, take, most=_MOST, wanted=wanted, **more)
    return dict(zip(names, kept, strict=True)), status


def fill_by_lanes(
    request: Request,
    which: IntArray | None,
    curves: Curves,
    status: NDArray[np.int8],
    take: Callable[..., None],
    *,
    most: int,
    wanted: Sequence[str] = (),
    **more: tuple[int, ...],
) -> None:
    """Find contacts by the Taylor-series solver, chunk by chunk.

    Args:
        request: the encounters.
        which: indices of the m encounters to solve; None for all.
        curves: the curves of these encounters.
        status: filled with 0 if a contact is proved, else another value, shape (m,).
        take: receives the slice of a chunk, its states, shape (6, k), and its other outputs.
        most: largest size of a chunk.
        wanted: the peaks to compute, if `more` has peaks.
        **more: other outputs by their names in `contact_times`, with their shape for one encounter.
    """
    table, starts, curve_of = curves
    spare: list[FloatArray] = []  # Dask makes malloc return memory at once, and new memory costs 10 % of the time

    def run(start: int, stop: int) -> None:
        part = slice(start, stop)
        buffer = spare.pop() if spare else np.empty(len(STATES) * (stop - start))  # only the last chunk is shorter
        states = buffer[: len(STATES) * (stop - start)].reshape(len(STATES), -1)
        filled: dict[str, Any] = {name: np.empty((*shape, stop - start)) for name, shape in more.items()}
        part_curves = table, starts, curve_of if len(curve_of) == 1 else curve_of[part]
        some = request.some(part if which is None else which[part])
        contact_times(some, part_curves, request.horizon, states, status[part], wanted=wanted, **filled)
        take(part, states, *filled.values())
        spare.append(buffer)

    run_in_chunks(run, len(status), least=_LEAST, most=most)


def _curves(request: Request, which: IntArray | None) -> Curves:
    """Approximate the curves over all distances, which are rounded up so that few tables are cached."""
    if request.many is not None:
        windows = request.many.windows(reach_of(request.scenario))
        curve_of = (np.arange(request.size) if which is None else which) % len(request.many)
        return windows.table, windows.starts, curve_of
    reach = farthest(request.scenario, request.sensor)
    if request.method == "closed-form":
        top = min(_BEYOND * reach, request.sensor.valid_range[1])
        return shared_curve(line_windows(request.slope, top))
    return shared_curve(curve_windows(request.sensor, 0.0, reach))


def _settling(request: Request) -> FloatArray:
    """Return the distance at which each motion would settle without contact [m].

    It is infinite for motions that do not settle.
    """
    r = request.relative
    has_spring, is_free = r.stiffness > 0, (r.stiffness == 0) & (r.damping == 0)
    rests = ((r.v == 0) | is_free) & (r.a == 0)
    if request.method != "closed-form":
        return np.where(np.broadcast_to(rests & has_spring & (r.gain <= 0), request.size), r.p, np.inf)
    total = r.damping + request.slope * r.gain
    free = r.p - r.x0 + (r.v - r.u0) * r.mass / np.where(total > 0, total, 1.0)
    return np.where(np.broadcast_to(rests & (total > 0), request.size), np.where(has_spring, r.p, free), np.inf)


def _impulse_residual(solution: Solution) -> FloatArray:
    """Return the relative residual of the impulse balance.

    It measures the error of the computed motion. This is |M dx~' + D dx~ + K int x~ dt - D_p d ln xi| over the largest
    of its terms, M |l'(0)| and D l(0).
    """
    request = solution.request
    if request.method == "uniform-motion":
        return np.full(request.size, np.nan)
    if request.degree == 2:
        return _drag_residual(solution)
    r = request.relative
    begin = np.broadcast_to(r.p - r.x0, request.size)
    with np.errstate(all="ignore"):  # a custom curve may overflow at large distances
        rise = request.log_output(solution.raw("distance")) - request.log_output(begin)
    terms = np.stack(
        [
            r.mass * (solution.raw("displacement_velocity") - r.u0),
            r.damping * (solution.raw("displacement") - r.x0),
            r.stiffness * solution.raw("displacement_integral"),
            -r.gain * rise,
        ]
    )
    approach = np.maximum(r.mass * np.abs(r.v - r.u0), r.damping * (r.p - r.x0))  # without a force all terms are zero
    largest = np.maximum(np.abs(terms).max(axis=0), approach)
    return np.asarray(np.abs(terms.sum(axis=0)) / np.where(largest > 0, largest, 1.0))


def _drag_residual(solution: Solution) -> FloatArray:
    """Return the relative residual of the impulse balance under the virtual drag.

    This is |M dx~' + int A dt - int F dt| over the largest of its terms, M |l'| at both ends and D l(0). The force A of
    the admittance is zero while the drag switches it off.
    """
    r = solution.request.relative
    drag, admittance = drag_impulses(solution.request)
    terms = np.stack([r.mass * (solution.raw("displacement_velocity") - r.u0), admittance, -drag])
    momentum = r.mass * np.maximum(np.abs(r.v - r.u0), np.abs(solution.raw("relative_velocity")))
    largest = np.maximum.reduce([*np.abs(terms), momentum, np.broadcast_to(r.damping * (r.p - r.x0), momentum.shape)])
    return np.asarray(np.abs(terms.sum(axis=0)) / np.where(largest > 0, largest, 1.0))


_DERIVED: Final[dict[str, Callable[[Solution], Any]]] = {
    "status": lambda s: s.status,
    "gain": lambda s: s.request.gain.copy(),
    "position": lambda s: s.raw("displacement") + s.reference(0),
    "velocity": lambda s: s.raw("displacement_velocity") + s.reference(1),
    "acceleration": lambda s: s.raw("displacement_acceleration") + s.reference(2),
    "impulse_residual": _impulse_residual,
}
