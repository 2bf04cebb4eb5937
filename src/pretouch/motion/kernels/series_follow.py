"""How a contact depends on its inputs, followed along a motion of any kind: the scalar path, for what is not in lanes.

The motion is integrated again, by the expansion, the steps and the proofs of `series`, so that it ends where the
guaranteed path ends, through every turn and every border of the curve. Beside it run its small changes d of l,

    M d'' + D d' + K d + D_p (g d)' = f,    d' = y - c d,   y' = (f - K d) / M,   c = (D + D_p g) / M,

one for each input, each from its own start and with its own force f: x~'' for M, x~' for D, x~ for K, -d(ln xi)/dt for
D_p, and what obstacle and plant bring with them. A parameter of the curve that adds rho(l) to g has f = -D_p rho l'. No
identity is used to save a response, so this also tests those of `series_gradient`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compiler import kernel
from .polynomial import ORDER, accepted_step, horner, horner_slope
from .series import OVERLAP, expand, find_piece, first_unit, reach_of, scale_of

__all__ = ["FOLLOWED", "follow_gradients"]

FOLLOWED = 9
"""How many inputs there are before those of the curve: M, D, K, x~(0), x~'(0), p, v, a, D_p."""

_MOST_STEPS = 20_000  # what is stiffer is differentiated by differences
_REACHED, _BEYOND, _NO_CONTACT = 0, 1, 2
_TRIES = 8
_LEFT_OUT = 1e-15  # of the largest value of a response, per step


@kernel
def _start(held: float, state: Any) -> None:
    """Set the responses at t = 0: of x~(0), x~'(0), p and v to themselves."""
    state[:] = 0.0
    state[3, 0], state[3, 1] = -1.0, -held
    state[4, 1] = -1.0
    state[5, 0], state[5, 1] = 1.0, held
    state[6, 1] = 1.0


@kernel
def _fill_forces(values: Any, gain: float, time: float, unit: float, work: Any, rest: Any, forces: Any) -> None:
    """Fill the series of the force of each input, over M, in tau."""
    mass, damping, stiffness = values[0], values[1], values[2]
    l, speed, rise = work[0], work[1], work[2]  # noqa: E741
    velocity, bend = values[6] + values[7] * time, values[7]
    forces[:] = 0.0
    for k in range(ORDER):
        forces[0, k] = -(k + 1) * speed[k + 1] / unit
        forces[1, k], forces[2, k], forces[8, k] = -speed[k], -l[k], -rise[k]
        for j in range(rest.shape[0]):
            total = 0.0
            for i in range(k + 1):
                total += rest[j, i] * speed[k - i]
            forces[FOLLOWED + j, k] = -gain * total
    forces[0, 0] += bend
    forces[1, 0] += velocity
    forces[1, 1] += bend * unit
    forces[2, 0] += values[5] + (values[6] + bend / 2 * time) * time
    forces[2, 1] += velocity * unit
    forces[2, 2] += bend / 2 * unit * unit
    forces[5, 0] = stiffness
    forces[6, 0], forces[6, 1] = damping + stiffness * time, stiffness * unit
    forces[7, 0] = mass + (damping + stiffness * time / 2) * time
    forces[7, 1] = (damping + stiffness * time) * unit
    forces[7, 2] = stiffness / 2 * unit * unit
    forces /= mass


@kernel
def _slopes(piece: Any, terms: Any, work: Any, held: Any, rest: Any, damping: float, gain: float) -> None:
    """Fill the series of c and, for each parameter of the curve, of rho."""
    powers = work[3:]
    degree = piece.shape[0] - 2
    for k in range(ORDER + 1):
        total = 0.0
        for j in range(1, degree):
            total += piece[2 + j] * powers[j - 1, k]
        held[k] = gain * total
    held[0] += damping + gain * piece[2]
    for i in range(rest.shape[0]):
        for k in range(ORDER + 1):
            total = 0.0
            for j in range(1, degree):
                total += terms[i, j] * powers[j - 1, k]
            rest[i, k] = total
        rest[i, 0] += terms[i, 0]


@kernel
def _expand_responses(state: Any, held: Any, forces: Any, stiffness: float, unit: float, series: Any) -> None:
    """Fill the series of d and of y of each response; stiffness and held are over M."""
    for row in range(state.shape[0]):
        d, y = series[row, 0], series[row, 1]
        d[0], y[0] = state[row, 0], state[row, 1]
        for k in range(ORDER):
            total = y[k]
            for i in range(k + 1):
                total -= held[i] * d[k - i]
            d[k + 1] = unit * total / (k + 1)
            y[k + 1] = unit * (forces[row, k] - stiffness * d[k]) / (k + 1)


@kernel
def _response_reach(series: Any, sizes: Any, reach: float) -> float:
    """Return the largest tau, at most reach, at which every response is at rounding beside its largest value so far."""
    for row in range(series.shape[0]):
        d = series[row, 0]
        for _ in range(_TRIES):
            size, power = max(sizes[row], abs(d[0])), 1.0
            for k in range(1, ORDER - 3):  # a response that starts from rest is as large as it is about to be
                power *= reach
                size = max(size, abs(d[k]) * power)
            before = reach
            for k in (ORDER - 1, ORDER):
                if abs(d[k]) * reach**k > _LEFT_OUT * size:
                    reach *= (_LEFT_OUT * size / (abs(d[k]) * reach**k)) ** (1.0 / k)
            if reach > 0.9 * before:
                break
        sizes[row] = max(sizes[row], abs(d[0]))
    return reach


@kernel
def _follow(values: Any, gain: float, pieces: Any, terms: Any, horizon: float, room: Any, found: Any) -> int:
    """Follow one encounter to its contact and write its gradients; tell how it ended."""
    work, held, rest, forces, state, series, sizes = room
    l, speed = values[5] - values[3], values[6] - values[4]  # noqa: E741
    start, time = l, 0.0
    index, last = find_piece(pieces, l), pieces.shape[0] - 1
    bottom = pieces[0, 0] - pieces[0, 1]
    unit = first_unit(values, gain, pieces[index], speed, horizon)
    for step in range(_MOST_STEPS):
        piece = pieces[index]
        expand(values, gain, piece, time, unit, l, speed, work)
        c = work[0]
        _slopes(piece, terms[index], work, held, rest, values[1], gain)
        held /= values[0]
        if step == 0:
            _start(held[0], state)
            sizes[:] = 0.0
        _fill_forces(values, gain, time, unit, work, rest, forces)
        _expand_responses(state, held, forces, values[2] / values[0], unit, series)
        reach = _response_reach(series, sizes, reach_of(work, scale_of(values, start, time, l)))
        tau = min(reach, (horizon - time) / unit)
        low, high = piece[0] - piece[1], piece[0] + piece[1]
        low -= OVERLAP * piece[1] if index > 0 else 0.0
        high += OVERLAP * piece[1]
        tau, end, moved, touched, _ = accepted_step(values, c, (low, high, bottom), (time, unit), tau)
        for row in range(state.shape[0]):
            state[row, 0], state[row, 1] = horner(series[row, 0], ORDER, tau), horner(series[row, 1], ORDER, tau)
        time, l, speed = time + unit * tau, end, horner(work[1], ORDER, tau)  # noqa: E741
        if touched:
            return _NO_CONTACT  # one with l' = 0, which an arbitrarily small change turns into none
        if moved < 0 and index == 0:
            bend, now = horner_slope(work[1], ORDER, tau) / unit, horner(held, ORDER, tau)
            for row in range(state.shape[0]):
                found[0, row] = -state[row, 0] / speed
                found[1, row] = state[row, 1] - now * state[row, 0] + bend * found[0, row]
            return _REACHED
        if moved > 0 and index == last:
            return _BEYOND
        if time >= horizon or not math.isfinite(l + speed):
            return _NO_CONTACT
        index += moved
        unit = min(unit * reach, horizon)
    return _NO_CONTACT


@kernel
def follow_gradients(values: Any, gains: Any, pieces: Any, terms: Any, horizon: float, found: Any, status: Any) -> None:
    """Follow encounters that end in contact, and find how time and l' there depend on the inputs.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        gains: D_p [N s], shape (n,).
        pieces: the curve from l = 0 upward, as curve_pieces gives it, shape (p, 2 + degree).
        terms: for each piece and parameter of the curve the coefficients of rho = dg/d(parameter) in z, shape
            (p, m, degree).
        horizon: when to give up [s].
        found: filled with the derivatives of time and l' by the nine inputs and the parameters, shape (n, 2, 9 + m);
            nan where no contact is reached.
        status: filled with 0 where the contact was reached, 1 where l went beyond the pieces, else 2, shape (n,).
    """
    many = terms.shape[1]
    room = (
        np.zeros((3 + max(2, pieces.shape[1] - 2), ORDER + 2)),
        np.zeros(ORDER + 1),
        np.zeros((many, ORDER + 1)),
        np.zeros((FOLLOWED + many, ORDER)),
        np.zeros((FOLLOWED + many, 2)),
        np.zeros((FOLLOWED + many, 2, ORDER + 1)),
        np.zeros(FOLLOWED + many),
    )
    for i in range(values.shape[0]):
        status[i] = _follow(values[i], gains[i], pieces, terms, horizon, room, found[i])
        if status[i] != _REACHED:
            found[i] = np.nan
