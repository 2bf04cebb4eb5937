"""Reference results: the guaranteed path of pretouch, which tests compare with independent methods."""

from __future__ import annotations

import sys
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev

from .closed_form import merit, squared_slope
from .ours import scenario, sensor_named
from .work import BOUNDS, DISTANCE, MASS, Column, contacts, first_guess, latest

_SPEEDS = (0.05, 1.0)
_NODES = 28  # speeds at which the optimum is found; between them it is interpolated
_GRID = 61  # gains over all of the bounds, among which the lowest objective is taken
_AROUND = 24  # gains around it, through which a polynomial is fitted
_DEGREE = 14
_CHECKED = 200
_HALVINGS = 48  # of an interval of at most 7 in ln(-D_p): to rounding
_QUADRATURE = 64  # nodes; half as many give the same digits


def trusted_times(sensor: str, v: Column, gain: Column) -> Column:
    """Return contact times by the Taylor series of pretouch, for a curve with a closed form as well."""
    return np.asarray(_integrated(sensor, v, gain).contact.time)


def _integrated(sensor: str, v: Column, gain: Column) -> Any:
    """Solve contacts by the guaranteed path only, the reference for the fast one."""
    from pretouch.motion import ContactResult  # noqa: PLC0415
    from pretouch.motion.request import make_request  # noqa: PLC0415
    from pretouch.motion.solution import Solution  # noqa: PLC0415

    request = make_request(scenario(v), sensor_named(sensor), gain, "integration", 600.0)
    return ContactResult(Solution(request, whole=True), request.method)


def trusted_gains(sensor: str, v: Column) -> Column:
    """Return the optimal gains from contacts alone: no search of pretouch takes part."""
    return -np.exp(_optimum(sensor)(np.log(-v)))


def limited_gains(sensor: str, v: Column) -> Column:
    """Return the optimal gains of case E: both limits bound the contact time, which grows with -D_p."""
    until = np.array([latest(velocity) for velocity in v.tolist()])
    best = trusted_gains(sensor, v)
    low, high = np.full(len(v), np.log(-BOUNDS[1])), np.log(-best)
    within = trusted_times(sensor, v, best) <= until
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        early = trusted_times(sensor, v, -np.exp(middle)) <= until
        low, high = np.where(early, middle, low), np.where(early, high, middle)
    return np.where(within, best, -np.exp(low))


def drag_times(sensor: str, v: Column, drag: Column) -> Column:
    """Return contact times of a drag by Gauss-Legendre quadrature of dl / l' with l' = v exp(-phi / M int g^2 dl)."""
    nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE)
    growth = squared_slope(sensor, DISTANCE * (nodes + 1) / 2)
    return DISTANCE / 2 * (np.exp(drag[:, None] / MASS * growth) @ weights) / -v


@lru_cache(maxsize=2)
def _optimum(sensor: str) -> Chebyshev:
    """Return ln(-D_p) of the optimum as a polynomial in ln|v|.

    At each Chebyshev node the objective is a polynomial around its lowest value on a grid of all gains, and the
    optimum a root of its derivative.
    """
    low, high = np.log(_SPEEDS)
    nodes = low + (high - low) * (np.cos((np.arange(_NODES) + 0.5) * np.pi / _NODES) + 1) / 2
    optimum = Chebyshev.fit(nodes, _optima(sensor, np.exp(nodes)), _NODES - 1, domain=[low, high])
    tail = float(np.abs(optimum.coef[-4:]).max())
    if tail > 1e-10:
        raise ArithmeticError(f"the optimum is not resolved over the speed: {tail:.0e} is left of ln(-D_p)")
    return optimum


def _optima(sensor: str, speeds: Column) -> Column:
    """Return ln(-D_p) of the optimum at each speed."""
    grid = np.linspace(np.log(-BOUNDS[1]), np.log(-BOUNDS[0]), _GRID)
    values = _objective(sensor, speeds, np.broadcast_to(grid, (len(speeds), len(grid))))
    lowest, width = grid[np.argmin(values, axis=1)], grid[1] - grid[0]
    at = np.cos((np.arange(_AROUND) + 0.5) * np.pi / _AROUND)
    found = []
    for row in _objective(sensor, speeds, lowest[:, None] + width * at):
        roots = Chebyshev.fit(at, row, _DEGREE, domain=[-1, 1]).deriv().roots()
        (root,) = roots[(np.abs(roots.imag) < 1e-12) & (np.abs(roots.real) <= 1)].real
        found.append(root)
    return lowest + width * np.array(found)


def _objective(sensor: str, speeds: Column, log_gain: Column) -> Column:
    v = np.broadcast_to(-speeds[:, None], log_gain.shape)
    state = _integrated(sensor, v, -np.exp(log_gain)).contact
    return np.asarray(merit(state.time, v, state.relative_velocity))


def evidence(sensor: str) -> str:
    """Report the accuracy of the reference on some encounters."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
    from reference_integrator import integrate  # noqa: PLC0415

    v, gain = contacts(_CHECKED)
    found = _integrated(sensor, v, gain)
    time, speed = np.asarray(found.contact.time), np.asarray(found.contact.relative_velocity)
    ended = integrate(scenario(v), sensor_named(sensor), gain, time, 1200)
    off = np.abs(ended["distance"] / speed / time).max()
    guess = np.abs(np.log(trusted_gains(sensor, v) / -np.exp(first_guess(sensor, -v, np.log)))).max()
    return (
        f"{sensor}: impulse balance {np.max(found.impulse_residual):.0e}, contact times within {off:.0e} of a "
        f"Runge-Kutta method of order 8 on {_CHECKED} of them; start of the designs within {guess:.0%}"
    )
