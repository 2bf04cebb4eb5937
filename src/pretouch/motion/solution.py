"""One call of the solver, solved as far as what is read of it needs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray

from .closed_form import solve_closed_form
from .contact import ContactStatus
from .integrator import integrate
from .kernels.layout import COLUMNS
from .over_damped import STATES, solve_over_damped
from .parallel import for_stretches
from .request import Request
from .uniform_motion import solve_uniform_motion

__all__ = ["Solution"]

_LEAST: Final = 512  # encounters that keep a thread busy for 10 ms
_MOST: Final = 16_384
_FEW: Final = 4096  # encounters that NumPy solves sooner than the compiled core is loaded
_AT: Final = {name: i for i, name in enumerate(COLUMNS)}


class Solution:
    """The columns of a result.

    Args:
        request: the encounters.
    """

    __slots__ = ("_known", "_rows", "_states", "_status", "request")

    def __init__(self, request: Request) -> None:
        self.request = request
        self._known: dict[str, Any] = {}
        self._rows: FloatArray | None = None
        self._states: dict[str, FloatArray] = {}
        if _plainly_solved(request):
            self._states, self._status = _fast(request)
        else:
            self._rows, self._status = _guaranteed(request)

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

    @property
    def rows(self) -> FloatArray:
        """What the guaranteed path gives for every run, shape (n, 15)."""
        if self._rows is None:
            self._rows, _ = _guaranteed(self.request)
        return self._rows

    @property
    def status(self) -> IntArray:
        """How every run ended, shape (n,)."""
        return self._status

    def raw(self, name: str) -> FloatArray:
        """Return one of layout.COLUMNS, shape (n,)."""
        return self._states[name] if name in self._states else self.rows[:, _AT[name]]

    def reference(self, derivative: int) -> FloatArray:
        """Return x_d, x_d' or x_d'' at the end of every run."""
        given, time = self.request.scenario.reference, self.raw("time").reshape(self.request.shape)
        if derivative == 2:
            return np.broadcast_to(given.acceleration, self.request.shape).reshape(-1)
        if derivative == 1:
            return np.asarray(given.velocity + given.acceleration * time).reshape(-1)
        return np.asarray(given.position + (given.velocity + given.acceleration * time / 2) * time).reshape(-1)


def _plainly_solved(request: Request) -> bool:
    """Tell whether a few encounters of a constant slope are solved without loading the compiled core."""
    loaded = f"{__package__}.kernels.compiler" in sys.modules
    return request.method == "closed-form" and not loaded and 0 < request.size <= _FEW


def _fast(request: Request) -> tuple[dict[str, FloatArray], IntArray]:
    """Solve what can be proved fast, and the rest by the guaranteed path."""
    slope = request.sensor.constant_log_slope or 0.0
    found, proved = solve_over_damped(request.columns, slope, request.horizon)
    states = dict(zip(STATES, found, strict=True))
    states["distance"] = np.zeros(request.size)
    states["virtual_force"] = slope * request.gain * states["relative_velocity"]
    status = np.full(request.size, int(ContactStatus.CONTACT))
    inside = request.sensor.valid_range[0] <= 0
    rest = np.flatnonzero(~proved) if inside else np.arange(request.size)
    if len(rest):
        rows, status[rest] = _guaranteed(request, rest)
        for name, values in states.items():
            values[rest] = rows[:, _AT[name]]
    return states, status


def _guaranteed(request: Request, which: IntArray | None = None) -> tuple[FloatArray, IntArray]:
    """Solve some or all encounters of a request by its method, whatever they are like."""
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
    return rows, status


def _hold_overflow(request: Request, which: IntArray | None, rows: FloatArray, status: IntArray) -> None:
    """Report a run whose numbers leave the range of floats, or of trust, as unresolved, in the state of its start."""
    always_finite = [i for i, name in enumerate(COLUMNS) if name != "settling_distance"]
    if np.isfinite(rows).all():
        return
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
    low, high = request.sensor.valid_range
    start, end = p - x_0, np.clip(solution.raw("distance"), low, high)
    rise = np.asarray(request.sensor.log_output(end)) - np.asarray(request.sensor.log_output(start))
    terms = np.stack(
        [
            mass * (solution.raw("displacement_velocity") - u_0),
            damping * (solution.raw("displacement") - x_0),
            stiffness * solution.raw("displacement_integral"),
            -request.gain * rise,
        ]
    )
    approach = np.maximum(mass * np.abs(v - u_0), damping * start)  # where nothing pushes, all terms vanish
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
