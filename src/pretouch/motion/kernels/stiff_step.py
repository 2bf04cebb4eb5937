"""One long step of a stiff motion: a polynomial that meets L(1) with L(2) at ten points, Radau IIA.

Where D + D_p g is large beside M, a motion forgets its start within M / (D + D_p g) and then follows a slow course.
The steps of a Taylor series end after some of these times, however smooth the course is. Here l' is a polynomial over
the whole step, with l'' from the equation of motion at the points of Radau's quadrature; Newton's method finds it. The
method is L-stable: what rounding adds to the fast part is forgotten, too.

A step is accepted only when its own coefficients show that it is resolved: the last ones of l'' in Legendre polynomials
vanish beside l', or beside what rounding makes of it. So a fast part of a motion, a swing or the start, is never
stepped over: its polynomial would not end. The damping must be positive at all points: an unstable motion forgets
nothing.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.polynomial import legendre

from pretouch._core.numbers import FloatArray

from .compiler import kernel

__all__ = ["AHEAD", "PATIENCE", "ROWS", "collocate", "long_step"]

POINTS = 10
ROWS = 3 + 4 + POINTS
"""Rows of the work array of `collocate`, of more than POINTS columns each: three series and its room."""

PATIENCE = 64
"""Taylor steps until long ones are tried."""

AHEAD = 1.5
"""Of the way to a border: how far a long step may come, beyond it too."""

_LONG = 8.0  # times a Taylor step: what a long one begins with
_WORTH = 2.0  # times a Taylor step: what is shorter is not worth its ten points
_FORGOTTEN = 0.1  # of a wrong l': what is left of it after a long step, at most
_UNRESOLVED = 1e-12  # of l': the last coefficients of l''; those left out are smaller by tens, and l' by another ten
_NOISE = 300.0  # what rounding is multiplied by in the last Legendre coefficient: about POINTS^2, twice
_ROUNDING = 1.1e-16
_ITERATIONS = 10
_CLOSE = 1e-8  # of l': Newton's method has converged with one more step


def _nodes() -> FloatArray:
    """Return Radau's points in (0, 1], the zeros of P_s - P_{s-1}."""
    series = np.zeros(POINTS + 1)
    series[-2:] = -1.0, 1.0
    nodes = np.sort(legendre.legroots(series).real)
    for _ in range(3):
        nodes -= legendre.legval(nodes, series) / legendre.legval(nodes, legendre.legder(series))
    nodes[-1] = 1.0
    return np.asarray((nodes + 1) / 2)


def _to_legendre() -> FloatArray:
    """Return the matrix from values at the points to coefficients of shifted Legendre polynomials, degree s - 1."""
    values = legendre.legvander(2 * _NODES - 1, POINTS - 1)
    return np.asarray(np.linalg.inv(values))


def _integrals() -> FloatArray:
    """Return a_ij: the integral to point i of the polynomial that is one at point j and zero at the others."""
    x = 2 * _NODES - 1
    parts = [legendre.legval(x, legendre.legint(row, lbnd=-1)) / 2 for row in np.eye(POINTS)]
    return np.asarray(np.column_stack(parts) @ _TO_LEGENDRE)


def _to_powers() -> FloatArray:
    """Return the matrix from coefficients of shifted Legendre polynomials to those of powers; its numbers are whole."""
    found = np.zeros((POINTS, POINTS))
    for n in range(POINTS):
        for k in range(n + 1):
            found[k, n] = (-1) ** (n + k) * math.comb(n, k) * math.comb(n + k, k)
    return found


_NODES: Final = _nodes()
_TO_LEGENDRE: Final = _to_legendre()
_INTEGRALS: Final = _integrals()
_TWICE: Final = _INTEGRALS @ _INTEGRALS
_TO_POWERS: Final = _to_powers()


@kernel
def _solve(system: Any) -> bool:
    """Solve a linear system by elimination; the right-hand side, its last column, becomes the solution."""
    n = POINTS
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(system[i, k]) > abs(system[pivot, k]):
                pivot = i
        if not abs(system[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(k, n + 1):
                system[k, j], system[pivot, j] = system[pivot, j], system[k, j]
        for i in range(k + 1, n):
            factor = system[i, k] / system[k, k]
            for j in range(k + 1, n + 1):
                system[i, j] -= factor * system[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            system[k, n] -= system[k, j] * system[j, n]
        system[k, n] /= system[k, k]
    return True


@kernel
def _iterate(values: Any, gain: float, piece: Any, time: float, h: float, start: float, speed: float, room: Any) -> Any:
    """Take one step of Newton's method; return how far l' moved, and what rounding makes of l'."""
    mass, damping, stiffness = values[0], values[1], values[2]
    rise, v, l, force = room[0], room[1], room[2], room[3]  # noqa: E741 - h l'', l', l and d ln xi / dt at the points
    system = room[4:]
    noise = 0.0
    for i in range(POINTS):
        t = time + h * _NODES[i]
        z = (l[i] - piece[0]) / piece[1]
        g, bend = 0.0, 0.0
        for j in range(piece.shape[0] - 1, 1, -1):
            bend = bend * z + g
            g = g * z + piece[j]
        bend /= piece[1]
        held = damping + gain * g
        if not held > 0.0:
            return math.inf, 0.0
        force[i] = g * v[i]
        own = stiffness * (values[5] + (values[6] + values[7] * t / 2) * t)
        drive = own + damping * (values[6] + values[7] * t) + mass * values[7]
        residual = mass / h * rise[i] + held * v[i] + stiffness * l[i] - drive
        size = abs(own) + abs(damping * (values[6] + values[7] * t)) + abs(mass * values[7]) + abs(stiffness * l[i])
        noise = max(noise, _ROUNDING * size / (held + mass / h))
        spring = (stiffness + gain * bend * v[i]) * h
        for j in range(POINTS):
            system[i, j] = held * _INTEGRALS[i, j] + spring * _TWICE[i, j]
        system[i, i] += mass / h
        system[i, POINTS] = -residual
    if not _solve(system):
        return math.inf, 0.0
    change = 0.0
    for j in range(POINTS):
        rise[j] += system[j, POINTS]
    for i in range(POINTS):
        total = 0.0
        for j in range(POINTS):
            total += _INTEGRALS[i, j] * rise[j]
        change = max(change, abs(speed + total - v[i]))
        v[i] = speed + total
    for i in range(POINTS):
        total = 0.0
        for j in range(POINTS):
            total += _INTEGRALS[i, j] * v[j]
        l[i] = start + h * total
    return change, noise


@kernel
def _expand(at_points: Any, coefficients: Any, series: Any, first: int, factor: float) -> float:
    """Write the powers of the polynomial through the points, integrated where first is 1; return its last parts."""
    for k in range(POINTS):
        total = 0.0
        for j in range(POINTS):
            total += _TO_LEGENDRE[k, j] * at_points[j]
        coefficients[k] = total
    for k in range(POINTS):
        total = 0.0
        for n in range(POINTS - 1, k - 1, -1):
            total += _TO_POWERS[k, n] * coefficients[n]
        series[k + first] = factor * total / (k + 1 if first else 1)
    return abs(coefficients[POINTS - 1]) + abs(coefficients[POINTS - 2])


@kernel
def collocate(values: Any, gain: float, piece: Any, state: Any, h: float, doubt: float, work: Any) -> float:
    """Try one step of any length.

    Fills the series in tau = (t - time) / h: of l (work[0]), l' (work[1]) and d ln xi / dt (work[2]), as those of a
    Taylor step.

    Args:
        values: relative quantities of Scenario.relative, shape (10,).
        gain: D_p [N s].
        piece: middle [m], half width [m] and coefficients of g in z [1/m].
        state: time [s], l [m] and l' [m/s] at the start.
        h: length of the step [s].
        doubt: how well l' is known [m/s]: what is wrong with it is forgotten in the step.
        work: three series, of as many coefficients as a Taylor step has, and room from row 3 on, ROWS in all.

    Returns:
        The last coefficients of l'' over what they may be: at most 1 where the step is resolved, infinite where the
        equation has no solution that can be trusted.
    """
    time, l, speed = state  # noqa: E741
    room = work[3:]
    room[0, :POINTS] = 0.0
    room[1, :POINTS] = speed
    for i in range(POINTS):
        room[2, i] = l + h * speed * _NODES[i]
    noise, close = 0.0, False
    for _ in range(_ITERATIONS):
        change, noise = _iterate(values, gain, piece, time, h, l, speed, room)
        if not math.isfinite(change):
            return math.inf
        if close:
            break
        close = change <= _CLOSE * (abs(speed) + np.abs(room[1, :POINTS]).max()) + noise
    if not close:
        return math.inf
    for row in range(3):
        work[row, :] = 0.0
    work[0, 0], work[1, 0] = l, speed
    _expand(room[1], room[4], work[0], 1, h)
    last = _expand(room[0], room[4], work[1], 1, 1.0)
    _expand(room[3], room[4], work[2], 0, 1.0)
    fastest = max(abs(speed), np.abs(room[1, :POINTS]).max())
    return last / (_UNRESOLVED * fastest + _NOISE * (noise + doubt) + 1e-300)


@kernel
def long_step(
    values: Any, gain: float, piece: Any, state: Any, taylor: float, longest: float, pace: Any, work: Any
) -> float:
    """Try a step that is longer than those of Taylor's series; return its length, 0 where there is none.

    Args:
        values: relative quantities.
        gain: D_p [N s].
        piece: of the curve.
        state: time [s], l [m] and l' [m/s].
        taylor: the length of the last Taylor step [s].
        longest: the longest step that is of use [s].
        pace: the length of the next try [s], Taylor steps until then, those to wait after another failure, and how
            well l' is known [m/s].
        work: filled as by _expand.
    """
    if pace[1] > 0.0:
        pace[1] -= 1.0
        return 0.0
    h = min(max(pace[0], _LONG * taylor), longest)
    if h < _WORTH * taylor:  # a border is near
        return 0.0
    while h >= _WORTH * taylor:
        missed = collocate(values, gain, piece, state, h, pace[3], work)
        factor = 0.9 * missed**-0.1 if missed > 0.0 else 4.0
        if missed <= 1.0:
            if h < longest or pace[0] < h:
                pace[0] = h * min(factor, 4.0)
            pace[2] = PATIENCE
            pace[3] *= _FORGOTTEN
            return h
        h *= min(max(factor, 0.2), 0.5)
    pace[0], pace[1] = 0.0, pace[2]
    pace[2] *= 2.0
    return 0.0
