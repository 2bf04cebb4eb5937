"""Contacts that are found fast and proved: the closed form, and any curve in lanes. The rest is left open."""

from __future__ import annotations

import itertools
import math
import sys
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel

from .over_damped import STATES, solve_over_damped, states_over_damped
from .parallel import for_stretches
from .request import Request
from .scenario import Scenario
from .windows import curve_windows

__all__ = ["QUICK", "farthest", "find_contacts", "find_states", "is_compiled", "is_worth_it"]

QUICK: Final = frozenset((*STATES, "distance", "virtual_force"))
"""What is known of a contact without the rest of its motion."""

_LANES: Final = 8  # below, all that is asked of a contact is solved at once
_FEW: Final = 4096  # encounters that NumPy solves sooner than the compiled core is loaded
_LEAST_LINEAR: Final = 16_384  # encounters that are worth a thread
_LEAST_SERIES: Final = 512
_MOST: Final = 1 << 18
_KEPT: Final = 1 << 22  # encounters up to which the states are kept that come with the times
_OFTEN: Final = 200  # questions after which NumPy has taken about as long as loading does
_ASKED: Final = itertools.count()
_CONTACT, _OPEN = np.int8(0), np.int8(-1)


def is_worth_it(request: Request) -> bool:
    """Tell whether a request is large enough, or so small that it should not load the compiled core."""
    if request.method == "uniform-motion":
        return False
    return request.size >= _LANES or (request.method == "closed-form" and not is_compiled() and request.size > 0)


def find_contacts(request: Request) -> tuple[dict[str, FloatArray], NDArray[np.int8]]:
    """Find and prove first contacts.

    Args:
        request: the encounters, to be solved by closed form or integration, on a curve that holds down to l = 0.

    Returns:
        Their times, and what else of QUICK comes with them, shape (n,) each, and a status of 0 where a contact is
        proved, else another.
    """
    if request.method == "closed-form":
        return _find_linear(request)
    return _find_series(request)


def find_states(request: Request, time: FloatArray, status: NDArray[np.int8]) -> dict[str, FloatArray]:
    """Return all of QUICK at contacts that `find_contacts` has found.

    Args:
        request: the same encounters.
        time: their times [s], shape (n,).
        status: their statuses, shape (n,).

    Returns:
        The quantities by name, shape (n,) each; without meaning where the status is not 0.
    """
    if request.method != "closed-form":
        return _series_states(request)[0]
    slope = request.sensor.constant_log_slope or 0.0
    if is_compiled():
        from .kernels import linear_block_states  # noqa: PLC0415 - the compiled core is loaded when it pays

        contact_states: Any = linear_block_states.contact_states
        rows = np.empty((5, request.size))

        def run(start: int, stop: int) -> None:
            c, out = request.block(start, stop), np.empty((5, stop - start))
            contact_states(*c[:8], c[10], slope, time[start:stop], status[start:stop], out)
            rows[:, start:stop] = out

        for_stretches(run, request.size, least=_LEAST_LINEAR, most=_MOST)
        states = dict(zip(STATES, (time, *rows), strict=True))
    else:
        states = states_over_damped(request.columns, slope, time)
    return _with_force(request, states)


def farthest(scenario: Scenario, sensor: SensorModel) -> float:
    """Return a distance [m] that no encounter exceeds at the start, one of few: a power of two or the curve's end."""
    distance = scenario.distance
    largest = distance if type(distance) is float else float(np.max(distance, initial=0.0))
    return min(2.0 ** math.frexp(largest)[1], sensor.valid_range[1])


def is_compiled() -> bool:
    """Tell whether the compiled core is loaded already, or worth loading: a process that asks often goes on to ask."""
    return next(_ASKED) >= _OFTEN or f"{__package__}.kernels.compiler" in sys.modules


def _with_force(request: Request, states: dict[str, FloatArray]) -> dict[str, FloatArray]:
    force = request.gain * (float(request.sensor.log_slope(0.0)) * states["relative_velocity"])
    return {**states, "distance": np.zeros(request.size), "virtual_force": force}


def _find_linear(request: Request) -> tuple[dict[str, FloatArray], NDArray[np.int8]]:
    slope = request.sensor.constant_log_slope or 0.0
    if not is_compiled() and request.size <= _FEW:
        states, proved = solve_over_damped(request.columns, slope, request.horizon)
        return {"time": states["time"]}, np.where(proved, _CONTACT, _OPEN)
    from .kernels import linear_block  # noqa: PLC0415 - the compiled core is loaded when it pays

    contact_times: Any = linear_block.contact_times
    time, status = np.empty(request.size), np.empty(request.size, dtype=np.int8)

    def run(start: int, stop: int) -> None:
        c = request.block(start, stop)
        contact_times(*c[:8], c[10], slope, request.horizon, time[start:stop], status[start:stop])

    for_stretches(run, request.size, least=_LEAST_LINEAR, most=_MOST)
    return {"time": time}, status


def _find_series(request: Request) -> tuple[dict[str, FloatArray], NDArray[np.int8]]:
    states, status = _series_states(request, whole=request.size <= _KEPT)
    return states, status


def _series_states(request: Request, *, whole: bool = True) -> tuple[dict[str, FloatArray], NDArray[np.int8]]:
    """Solve encounters in lanes; keep the whole states or only the times."""
    from .kernels import series_block  # noqa: PLC0415 - the compiled core is loaded when a motion is solved

    contact_times: Any = series_block.contact_times
    windows = curve_windows(request.sensor, 0.0, farthest(request.scenario, request.sensor))
    kept = np.empty((len(STATES) if whole else 1, request.size))
    status = np.empty(request.size, dtype=np.int8)

    def run(start: int, stop: int) -> None:
        c, out = request.block(start, stop), np.empty((len(STATES), stop - start))
        contact_times(*c[:8], c[10], windows, request.horizon, out, status[start:stop])
        kept[:, start:stop] = out[: len(kept)]

    for_stretches(run, request.size, least=_LEAST_SERIES, most=_MOST)
    states = dict(zip(STATES, kept, strict=False))
    return _with_force(request, states) if whole else states, status
