"""The search for one optimal gain per encounter, compiled: a scan, a proof of what it leaves out, and a polish.

Gains are scanned from the weakest to the strongest, equally spaced in u = asinh(D_p / s), and more are put between them
until the others predict every second one. If one minimum then lies inside, the objective is interpolated at eight nodes
close to it.

**Where a scan may end.** If g < 0, D^2 >= 4 M K, v < 0, a <= 0 and -D v - K x_0 >= sigma (u_0 - v) > 0, with sigma
the smaller root of sigma^2 - D sigma + M K, then l falls until contact for every mitigating gain, and of two gains the
stronger touches later (proved in docs/fast-designs.md). A term of the objective that grows with the time of contact
(the time itself; the displacement, which at contact is p + v t + a t^2 / 2, once that is negative) is therefore a lower
bound for all stronger gains; where that exceeds the best objective found, no stronger gain can be the optimum, and none
is solved.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pretouch.motion.kernels import linear_block, linear_block_states, series_block
from pretouch.motion.kernels.blocks import BLOCK
from pretouch.motion.kernels.compiler import kernel

from .sampling import AT, LEAST, NODES, bottom_between, guess_minimum, is_resolved, only_minimum

__all__ = ["ACCELERATION", "DISPLACEMENT", "FORCE", "RELATIVE_VELOCITY", "TIME", "VELOCITY", "find_gains"]

TIME, DISPLACEMENT, VELOCITY, ACCELERATION, RELATIVE_VELOCITY, FORCE = range(6)
"""What the terms of an objective may speak of: the rows of the states at contact."""

_FIRST = 17  # gains of the first scan
_LARGEST = 129
_VECTORS = 8
_WIDEST = 0.5  # of u between two of them
_PART = 2  # gains that are solved at a time where the next may not be needed
_HALF = 0.05  # of u around the minimum, at first
_MOVES = 8

_MASS, _DAMPING, _STIFFNESS, _X0, _U0, _P, _V, _A, _OWN_V, _OWN_A = range(10)
_KIND, _FACTOR, _EXPONENT, _FOLLOWS = range(4)


@kernel
def _solve_linear(inputs: Any, k: int, gains: Any, slope: float, horizon: float, data: Any, states: Any) -> int:
    """Solve an encounter of constant slope for some gains; return how many contacts are proved before one is not."""
    count = gains.size
    filled = -(-count // _VECTORS) * _VECTORS  # a loop over less would not run on vectors
    for row in range(8):
        data[row * BLOCK : row * BLOCK + filled] = inputs[row, k]
    data[8 * BLOCK : 8 * BLOCK + count] = gains
    data[8 * BLOCK + count : 8 * BLOCK + filled] = gains[count - 1]
    times, status = 9 * BLOCK, 10 * BLOCK
    if linear_block._solve_block(data, slope, horizon, filled):
        for i in range(count):
            if data[status + i] == linear_block._PROVED:
                data[times + i], data[status + i] = linear_block._refine(data, i, horizon)
    for i in range(count):
        if data[status + i] != 0.0:
            count = i
            break
    linear_block_states._states_block(data, slope, filled)
    for row in range(5):
        states[row, :count] = data[times + row * BLOCK : times + row * BLOCK + count]
    return count


@kernel
def _solve_series(inputs: Any, k: int, gains: Any, curves: Any, horizon: float, states: Any, status: Any) -> int:
    """Solve an encounter of any curve for some gains; return how many contacts are proved before one is not."""
    count = gains.size
    out, found = states[:, :count], status[:count]
    one = (
        inputs[_MASS, k : k + 1],
        inputs[_DAMPING, k : k + 1],
        inputs[_STIFFNESS, k : k + 1],
        inputs[_X0, k : k + 1],
        inputs[_U0, k : k + 1],
        inputs[_P, k : k + 1],
        inputs[_V, k : k + 1],
        inputs[_A, k : k + 1],
        gains,
    )
    series_block.solve_lanes(one, curves, horizon, out, None, None, found)
    for i in range(count):
        if found[i] != series_block.CONTACT:
            return i
    return count


@kernel
def _weigh(inputs: Any, k: int, terms: Any, gain: float, end_slope: float, states: Any, i: int, least: bool) -> float:
    """Return the objective of one solved gain, or the part of it that grows with the time of contact."""
    total, time = 0.0, states[TIME, i]
    speed = abs(inputs[_V, k] + inputs[_OWN_V, k])
    for j in range(terms.shape[0]):
        kind = int(terms[j, _KIND])
        if least and not (kind == TIME or (kind == DISPLACEMENT and states[DISPLACEMENT, i] <= 0.0)):
            continue
        value = states[kind, i] if kind != FORCE else gain * end_slope * states[RELATIVE_VELOCITY, i]
        if kind == VELOCITY:
            value += inputs[_OWN_V, k] + inputs[_OWN_A, k] * time
        elif kind == ACCELERATION:
            value += inputs[_OWN_A, k]
        exponent = terms[j, _EXPONENT]
        power = value * value if exponent == 2.0 else abs(value) ** exponent
        if terms[j, _FOLLOWS] != 0.0:
            power /= speed * speed
        total += terms[j, _FACTOR] * power
    return total


@kernel
def _gain_at(axis: Any, part: float) -> float:
    """Return the gain [N s] at a part of the way from the weakest to the strongest."""
    scale, strong, weak, low, high = axis
    return min(max(scale * math.sinh(weak + (strong - weak) * part), low), high)


@kernel
def _ends_early(inputs: Any, k: int, falling: bool) -> bool:
    """Tell whether stronger gains touch later, by the proof of this module."""
    m, d, s = inputs[_MASS, k], inputs[_DAMPING, k], inputs[_STIFFNESS, k]
    v, u0 = inputs[_V, k], inputs[_U0, k]
    room = d * d - 4.0 * m * s
    if not (falling and d >= 0.0 and s >= 0.0 and room >= 0.0 and v < 0.0 and u0 > v and inputs[_A, k] <= 0.0):
        return False
    sigma = 2.0 * m * s / (d + math.sqrt(room)) if d > 0.0 else 0.0
    return -d * v - s * inputs[_X0, k] >= sigma * (u0 - v)


@kernel
def _last_needed(
    inputs: Any, k: int, terms: Any, slope: float, states: Any, f: Any, gains: Any, start: int, used: int
) -> int:
    """Return after how many gains a scan may end, an odd number; 0 where it has to go on."""
    lowest = math.inf
    for i in range(used):
        lowest = min(lowest, f[i])
        if i < max(start, LEAST - 1) or i % 2 == 1 or gains[i] >= 0.0:
            continue
        if _weigh(inputs, k, terms, gains[i], slope, states, i - start, True) > lowest:
            return i + 1
    return 0


@kernel
def _appraise(
    inputs: Any, k: int, slope: float, curves: Any, horizon: float, terms: Any, gains: Any, f: Any, room: Any
) -> int:
    """Fill f with the objective of some gains; return how many contacts are proved before one is not."""
    states, status, data = room
    if curves is None:
        solved = _solve_linear(inputs, k, gains, slope, horizon, data, states)
    else:
        solved = _solve_series(inputs, k, gains, curves, horizon, states, status)
    for i in range(solved):
        f[i] = _weigh(inputs, k, terms, gains[i], slope, states, i, False)
    return solved


@kernel
def _scan(
    inputs: Any, k: int, slope: float, curves: Any, horizon: float, terms: Any, axis: Any, falling: bool, count: int,
    table: Any, room: Any,
) -> int:  # fmt: skip
    """Appraise gains from the weakest to the strongest that is needed, the rows of table; return how many, or 0."""
    gains, f = table[0], table[1]
    ends_early = _ends_early(inputs, k, falling)
    for i in range(count):
        gains[i] = _gain_at(axis, i / (count - 1))
    used = 0
    while used < count:
        start, following = used, count
        if curves is not None and ends_early:  # strong gains make stiff motions
            following = min(count, used + (_PART if used else LEAST))
        part = gains[start:following]
        used += _appraise(inputs, k, slope, curves, horizon, terms, part, f[start:following], room)
        if ends_early:
            ends = _last_needed(inputs, k, terms, slope, room[0], f, gains, start, used)
            if ends > 0:
                return ends
        if used < following:
            return 0
    return used


@kernel
def _double(
    inputs: Any, k: int, slope: float, curves: Any, horizon: float, terms: Any, axis: Any, count: int, used: int,
    table: Any, room: Any,
) -> bool:  # fmt: skip
    """Put a gain between each two of a scan, which has then count on the whole axis; tell whether all are solved."""
    f, gains, between = table[1], table[0, : used - 1], table[2, : used - 1]
    for i in range(used - 1, 0, -1):
        f[2 * i] = f[i]
    for i in range(used - 1):
        gains[i] = _gain_at(axis, (2 * i + 1) / (count - 1))
    solved = _appraise(inputs, k, slope, curves, horizon, terms, gains, between, room)
    for i in range(solved):
        f[2 * i + 1] = between[i]
    return solved == used - 1


@kernel
def find_gains(
    inputs: Any,
    slope: float,
    curves: Any,
    falling: bool,
    horizon: float,
    terms: Any,
    scale: float,
    strong: float,
    weak: float,
    low: float,
    high: float,
    out: Any,
) -> None:
    """Find the optimal gain of encounters, each alone, where that is settled for certain.

    Args:
        inputs: M, D, K, x~(0), x~'(0), p, v, a, velocity and acceleration of the reference; SI, shape (10, n).
        slope: g [1/m] at l = 0; everywhere, where curves is None.
        curves: the curve of all encounters as contact_times has it, or None for a constant slope.
        falling: whether g < 0 wherever an encounter may come.
        horizon: latest time of contact [s].
        terms: one row per term factor * |quantity|^exponent: quantity (TIME to FORCE), factor in SI, exponent, and 1
            where the term is divided by the obstacle's squared speed, else 0.
        scale: s [N s] of u = asinh(D_p / s).
        strong: u of the strongest gain, the lower bound.
        weak: u of the weakest gain.
        low: the strongest gain [N s].
        high: the weakest gain [N s].
        out: filled with the optimal gains [N s], the objective there, and 1 where both are known for certain, else 0;
            shape (3, n).
    """
    axis = (scale, strong, weak, low, high)
    table = np.empty((3, _LARGEST))
    room = (np.empty((6, _LARGEST)), np.empty(_LARGEST, np.int8), np.empty(20 * BLOCK))
    nodes, values = np.empty(NODES), np.empty(NODES)
    work = (np.empty(NODES), np.empty(NODES), np.empty(NODES))
    for k in range(out.shape[1]):
        out[0, k], out[1, k], out[2, k] = math.nan, math.nan, 0.0
        count = _FIRST
        while abs(strong - weak) > _WIDEST * (count - 1) and 2 * count - 1 <= _LARGEST:
            count = 2 * count - 1
        used = _scan(inputs, k, slope, curves, horizon, terms, axis, falling, count, table, room)
        known = used > 0
        while known and not is_resolved(table[1], used):
            count = 2 * count - 1
            known = 2 * used - 1 <= _LARGEST and _double(
                inputs, k, slope, curves, horizon, terms, axis, count, used, table, room
            )
            used = 2 * used - 1
        best = only_minimum(table[1], used) if known else -1
        if best < 0:
            continue
        step = (strong - weak) / (count - 1)
        center = weak + step * guess_minimum(table[1], best, used)
        first, last = weak + step * (best + 1), weak + step * (best - 1)
        half = _HALF
        for _ in range(_MOVES):
            for i in range(NODES):
                nodes[i] = _gain_at(axis, (center + half * AT[i] - weak) / (strong - weak))
            if _appraise(inputs, k, slope, curves, horizon, terms, nodes, values, room) < NODES:
                break
            z, bottom, fits = bottom_between(values, *work)
            u = center + half * z
            if abs(z) <= 0.9 and fits:
                if first <= u <= last:
                    out[0, k], out[1, k], out[2, k] = _gain_at(axis, (u - weak) / (strong - weak)), bottom, 1.0
                break
            center = min(max(u, first), last)
            if abs(z) <= 0.9:
                half *= 0.5
