"""One call of the solver, solved as far as what is read of it needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value

from .closed_form import solve_closed_form
from .fast_path import DEMANDS, QUICK, FastPath, is_worth_it
from .integrator import integrate
from .layout import COLUMNS
from .parallel import for_stretches
from .request import Request, SeveralCurves
from .status import ContactStatus
from .uniform_motion import solve_uniform_motion

__all__ = ["STIFF", "Solution"]

STIFF: Final = 500.0
"""Time over that of the damping at contact, from which l'' is a difference of much larger numbers."""

_LEAST: Final = 512  # encounters that keep a thread busy for 10 ms
_MOST: Final = 16_384
_AT: Final = {name: i for i, name in enumerate(COLUMNS)}


class Solution(Value):
    """The columns of a result; it equals that of the same request.

    Times and statuses come from a path that proves each contact it finds; what it leaves open, and what needs the whole
    motion, is left to the guaranteed path.

    Args:
        request: the encounters.
        whole: whether the whole motion will be asked for, so that the guaranteed path is taken at once.

    Attributes:
        derivatives: what `gradients_of` has made of it, kept here.
    """

    __slots__ = (
        "_fast",
        "_known",
        "_open",
        "_open_rows",
        "_path",
        "_rows",
        "_status",
        "derivatives",
        "request",
    )

    def __init__(self, request: Request, *, whole: bool = False) -> None:
        self.request = request
        self._known: dict[str, Any] = {}
        self._rows: FloatArray | None = None
        self.derivatives: Any = None
        self._status: NDArray[Any]
        self._fast: dict[str, FloatArray] = {}
        if whole or not request.holds_at_contact or not is_worth_it(request):
            self._rows, self._status = _guaranteed(request)
            return
        self._path = FastPath(request)
        self._fast, self._status = dict(self._path.known), self._path.status
        if self._status.any():
            self._open = np.flatnonzero(self._status)
            self._open_rows, open_status = _guaranteed(request, self._open)
            self._status = self._status.copy()
            self._status[self._open] = open_status
            self._fill(self._fast)

    def _compared(self) -> tuple[Any, ...]:
        return (self.request,)

    def column(self, name: str) -> Any:
        """Return a quantity of every run, a float for a single one.

        Args:
            name: of a field of ContactState or ContactResult.

        Returns:
            The quantity, of the broadcast shape.
        """
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
        if name not in self._fast:
            if name == "virtual_force":
                found = {name: self._path.force(self.raw("relative_velocity"))}
            else:
                found = self._path.states() if name in QUICK else self._path.demands(name)
            self._fill(found)
            self._fast = {**found, **self._fast}
        if name in DEMANDS:
            self._settle(name)
        return self._fast[name]

    def _fill(self, states: dict[str, FloatArray]) -> None:
        """Put what the guaranteed path has found where the fast one left encounters open."""
        if self._status is not self._path.status:
            for name, values in states.items():
                values[self._open] = self._open_rows[:, _AT[name]]

    def _settle(self, name: str) -> None:
        """Solve by the guaranteed path where the fast one found a contact, but not this demand until then."""
        which = np.flatnonzero(np.isnan(self._fast[name]))
        if len(which):
            rows, _ = _guaranteed(self.request, which)
            for other in DEMANDS & self._fast.keys():
                values = self._fast[other]
                values[which] = np.where(np.isnan(values[which]), rows[:, _AT[other]], values[which])

    @property
    def settled_acceleration(self) -> FloatArray:
        """x~'' at the end of every run to all digits, shape (n,).

        Where hundreds of time constants have passed, it is a difference of much larger numbers, which lanes have to
        1e-7 only; derivatives need it better.
        """
        name = "settled_acceleration"
        if name not in self._known:
            self._known[name] = self._find_settled_acceleration()
        return np.asarray(self._known[name])

    def _find_settled_acceleration(self) -> FloatArray:
        found, request = self.raw("displacement_acceleration"), self.request
        if self._rows is not None or request.method == "closed-form":
            return found
        mass, damping, gain = (request.columns[i] for i in (0, 1, 10))
        decays = (damping + gain * request.sensor.log_slope(max(request.sensor.valid_range[0], 0.0))) / mass
        which = np.flatnonzero((self._path.status == 0) & (decays * self.raw("time") > STIFF))
        if len(which):
            found = found.copy()
            found[which] = _guaranteed(request, which)[0][:, _AT["displacement_acceleration"]]
        return found

    @property
    def status(self) -> NDArray[Any]:
        """How every run ended, shape (n,)."""
        return self._status

    def reference(self, derivative: int) -> FloatArray:
        """Return x_d, x_d' or x_d'' at the end of every run."""
        given, time = self.request.scenario.reference, self.raw("time").reshape(self.request.shape)
        if derivative == 2:
            return np.broadcast_to(given.acceleration, self.request.shape).reshape(-1)
        if derivative == 1:
            return np.asarray(given.velocity + given.acceleration * time).reshape(-1)
        return np.asarray(given.position + (given.velocity + given.acceleration * time / 2) * time).reshape(-1)


def _guaranteed(request: Request, which: IntArray | None = None) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve some or all encounters of a request by its method, whatever they are like."""
    if request.many is not None:
        return _guaranteed_of_many(request, request.many, np.arange(request.size) if which is None else which)
    count = request.size if which is None else len(which)
    rows = np.empty((count, len(COLUMNS)))
    status = np.empty(count, dtype=np.int64)
    if request.method == "uniform-motion":
        values, gain = request.part(slice(None) if which is None else which)
        solve_uniform_motion(values, request.sensor, gain, rows, status)
    else:
        solve = solve_closed_form if request.method == "closed-form" else integrate

        def run(start: int, stop: int) -> None:
            part = slice(start, stop) if which is None else which[start:stop]
            solve(request, part, rows[start:stop], status[start:stop])

        for_stretches(run, count, least=_LEAST, most=_MOST)
    _hold_overflow(request, which, rows, status)
    return rows, status.astype(np.int8)


def _guaranteed_of_many(request: Request, many: SeveralCurves, which: IntArray) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve encounters of which each has a curve of its own, curve after curve."""
    rows, status = np.empty((len(which), len(COLUMNS))), np.empty(len(which), dtype=np.int8)
    place, curve = np.divmod(which, len(many))
    for index in np.unique(curve):
        own = np.flatnonzero(curve == index)
        rows[own], status[own] = _guaranteed(many.alone(request, int(index)), place[own])
    return rows, status


def _hold_overflow(request: Request, which: IntArray | None, rows: FloatArray, status: IntArray) -> None:
    """Report a run whose numbers leave the range of floats, or of trust, as unresolved, in the state of its start."""
    always_finite = [i for i, name in enumerate(COLUMNS) if name != "settling_distance"]
    bad = np.flatnonzero(~np.isfinite(rows[:, always_finite]).all(axis=1))
    if len(bad):
        v, _ = request.part(bad if which is None else which[bad])
        start = dict.fromkeys(COLUMNS, np.zeros(len(v)))
        start |= {
            "distance": v[:, 5] - v[:, 3],
            "displacement": v[:, 3],
            "displacement_velocity": v[:, 4],
            "relative_velocity": v[:, 6] - v[:, 4],
            "largest_excursion": np.abs(v[:, 3]),
            "largest_speed": np.abs(v[:, 4] + v[:, 8]),
            "closest_distance": v[:, 5] - v[:, 3],
            "settling_distance": np.full(len(v), np.inf),
        }
        rows[bad] = np.column_stack([start[name] for name in COLUMNS])
        status[bad] = ContactStatus.UNRESOLVED


def _impulse_residual(solution: Solution) -> FloatArray:
    """Return |M dx~' + D dx~ + K int x~ dt - D_p d ln xi| over the largest of its terms, M |l'(0)| and D l(0)."""
    request = solution.request
    if request.method == "uniform-motion":
        return np.full(request.size, np.nan)
    mass, damping, stiffness, x_0, u_0, p, v = (request.column(i) for i in range(7))
    with np.errstate(all="ignore"):  # a function of the user's may overflow where the object has gone far away
        rise = request.log_output(solution.raw("distance")) - request.log_output(p - x_0)
    terms = np.stack(
        [
            mass * (solution.raw("displacement_velocity") - u_0),
            damping * (solution.raw("displacement") - x_0),
            stiffness * solution.raw("displacement_integral"),
            -request.gain * rise,
        ]
    )
    approach = np.maximum(mass * np.abs(v - u_0), damping * (p - x_0))  # where nothing pushes, all terms vanish
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
