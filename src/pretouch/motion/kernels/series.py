"""Integrate L(1) with L(2) for any sensor curve by Taylor series, and find the first contact in them.

The slope of the curve is a piecewise polynomial, g = sum_j q_j z^j with z = (l - m) / h on the piece [m - h, m + h].
Inside one piece the motion

    M (x_o'' - l'') + D (x_o' - l') + K (x_o - l) = D_p d(ln xi)/dt

is a polynomial differential equation, so the Taylor coefficients of l follow from each other by convolutions, to any
order and without a derivative being formed. Each step is a polynomial whose error is at rounding; it is accepted only
when its coefficients prove what l does on it (`polynomial`), so that a border, the contact among them, is never passed
twice unseen. Touches, and motions that come to zero but never arrive there, are told by `endings`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compiler import kernel
from .endings import is_left_alone, never_arrives, rest_resolution
from .polynomial import ORDER, accepted_step, horner, horner_slope, level_time
from .series_extremes import integral, keep_extremes
from .stiff_step import AHEAD, PATIENCE, ROWS, long_step

__all__ = [
    "MOST_STEPS",
    "OVERLAP",
    "expand",
    "find_piece",
    "first_unit",
    "reach_of",
    "scale_of",
    "solve_series",
    "trace_series",
]

CONTACT, NEVER, HORIZON, LEFT_RANGE, UNRESOLVED = 0, 1, 2, 3, 4
MOST_STEPS = 4_000
"""After so many steps, some hundredths of a second, a motion is given up, unless the curve has many pieces to cross."""

OVERLAP = 1e-9
"""Of a piece's width: how far its polynomial is used beyond its border."""

_PER_PIECE = 16  # further steps for each piece of the curve
_LEFT_OUT = 1e-16  # of l': what a step may leave out of it
_SLOW = 1e-6  # of l over a step: an l' that moves less need not be known better
_VANISHED = 1e-280  # of l at the start: a motion about l = 0 that is below it has come to rest


@kernel
def expand(values: Any, gain: float, piece: Any, time: float, unit: float, l: float, speed: float, work: Any) -> None:  # noqa: E741
    """Expand L(1) with L(2), which is L(4), L(7) or L(14) as the curve may be, with the obstacle of L(9), about a time.

    Fills the series in tau = (t - time) / unit: of l (work[0]), l' (work[1]) and d ln xi / dt (work[2]).
    """
    mass, damping, stiffness = values[0], values[1], values[2]
    x0, x1, x2 = values[5] + (values[6] + values[7] * time / 2) * time, values[6] + values[7] * time, values[7]
    middle, half, degree = piece[0], piece[1], piece.shape[0] - 2  # of ln xi: one above that of g
    c, v, force = work[0], work[1], work[2]
    powers = work[3:]
    c[0], v[0] = l, speed
    powers[0, 0] = (l - middle) / half
    for j in range(1, degree):
        powers[j, 0] = powers[j - 1, 0] * powers[0, 0]
    for k in range(ORDER):
        c[k + 1] = unit * v[k] / (k + 1)
        powers[0, k + 1] = c[k + 1] / half
        rise = piece[2] * powers[0, k + 1]
        for j in range(1, degree):
            total = 0.0
            for i in range(k + 2):
                total += powers[j - 1, i] * powers[0, k + 1 - i]
            powers[j, k + 1] = total
            rise += piece[2 + j] / (j + 1) * total
        force[k] = rise * half * (k + 1) / unit
        pull = damping * -v[k] - stiffness * c[k] - gain * force[k]
        if k == 0:
            pull += damping * x1 + stiffness * x0 + mass * x2
        elif k == 1:
            pull += (damping * x2 + stiffness * x1) * unit
        elif k == 2:
            pull += stiffness * x2 / 2 * unit * unit
        v[k + 1] = unit / (k + 1) * pull / mass


@kernel
def reach_of(work: Any, scale: float) -> float:
    """Return the largest tau at which the series of l and of l' unit are at rounding beside their scales."""
    c = work[0]
    size = max(abs(c[1]), abs(c[2]), _SLOW * scale)
    reach = 2.0
    for k in (ORDER - 1, ORDER):
        if c[k] != 0:
            reach = min(reach, (1e-17 * scale / abs(c[k])) ** (1.0 / k))
            reach = min(reach, (_LEFT_OUT * size / (k * abs(c[k]))) ** (1.0 / (k - 1)))
    return reach


@kernel
def _floor_after(values: Any, gain: float, l: float, speed: float) -> float:  # noqa: E741
    """Bound l from below for good: with the obstacle at rest a damping force only takes energy away; else -inf."""
    if values[6] != 0 or values[7] != 0 or gain > 0:
        return -math.inf
    if values[2] > 0:
        displacement = values[5] - l
        return values[5] - math.sqrt(displacement**2 + speed**2 * values[0] / values[2])
    return l - abs(speed) * values[0] / values[1] if values[1] > 0 else -math.inf


@kernel
def find_piece(pieces: Any, l: float) -> int:  # noqa: E741
    """Return the lowest piece whose upper border is not below l."""
    low, high = 0, pieces.shape[0] - 1
    while low < high:
        middle = (low + high) // 2
        if l <= pieces[middle, 0] + pieces[middle, 1]:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def _finish(values: Any, gain: float, work: Any, state: Any, row: Any) -> None:
    """Write the state at the end of a step."""
    time, unit, tau, l = state  # noqa: E741
    v = work[1]
    speed = horner(v, ORDER, tau)
    end = time + unit * tau
    row[0], row[1] = end, l
    row[2] = values[5] + (values[6] + values[7] * end / 2) * end - l
    row[3] = values[6] + values[7] * end - speed
    row[4] = values[7] - horner_slope(v, ORDER, tau) / unit
    row[5] = speed
    row[6] = gain * horner(work[2], ORDER - 1, tau)


@kernel
def scale_of(values: Any, start: float, time: float, l: float) -> float:  # noqa: E741
    """Return what an error of l [m] is to be small beside: l at the start, unless all that l consists of has gone."""
    path = abs(values[5]) + (abs(values[6]) + abs(values[7]) / 2 * time) * time
    return max(l, min(start, path))


@kernel
def first_unit(values: Any, gain: float, piece: Any, speed: float, horizon: float) -> float:
    """Return the unit of time [s] of the first step."""
    rate = abs(values[1] + gain * piece[2]) / values[0] + math.sqrt(values[2] / values[0])
    return min(1.0 / rate if rate > 0 else 1.0, 2 * piece[1] / max(abs(speed), 1e-12), horizon)


@kernel
def _least_damping(values: Any, gain: float, pieces: Any, top: float) -> float:
    """Bound D + D_p g(l) [N s/m] from below for all l up to a top."""
    if gain == 0:
        return values[1]
    least = math.inf
    for i in range(pieces.shape[0]):
        start = pieces[i, 0] - pieces[i, 1]
        if start >= top:
            break
        width = min(2.0, (top - start) / pieces[i, 1])  # of z, from -1 upward
        here, spread, steep, sign = 0.0, 0.0, 0.0, 1.0
        for j in range(pieces.shape[1] - 2):
            here += sign * pieces[i, 2 + j]
            spread += abs(pieces[i, 2 + j]) if j else 0.0
            steep += j * abs(pieces[i, 2 + j])
            sign = -sign
        bound = max(gain * here - abs(gain) * steep * width, gain * pieces[i, 2] - abs(gain) * spread)
        least = min(least, bound)
    return values[1] + (max(least, 0.0) if gain < 0 else least)  # g is never above 0


@kernel
def _never(values: Any, gain: float, pieces: Any, l: float, speed: float) -> bool:  # noqa: E741
    """Tell whether an l that is left alone is proved never to reach the lowest border from here on."""
    top = l
    if speed > 0 and values[2] > 0:
        top = values[5] + math.sqrt((l - values[5]) ** 2 + speed**2 * values[0] / values[2])
    bottom = pieces[0, 0] - pieces[0, 1]
    damping = _least_damping(values, gain, pieces, top)
    return never_arrives(values, damping, l, speed, bottom)


@kernel
def _rest(values: Any, damping: float, l: float, speed: float) -> float:  # noqa: E741
    """Return how far [m] an l that is left alone may still be from its resting place."""
    if values[2] == 0:
        return abs(speed) * values[0] / damping if damping > 0 else (math.inf if speed else 0.0)
    return math.sqrt((l - values[5]) ** 2 + speed**2 * values[0] / values[2])


@kernel
def _is_over(values: Any, gain: float, pieces: Any, open_ended: bool, last: bool, never: bool, row: Any) -> bool:
    """Tell whether l is proved to stay above 0 and within the range for good, at its end or close to its least."""
    l, speed, top = row[1], row[5], pieces[-1, 0] + pieces[-1, 1]  # noqa: E741
    if never and (open_ended or speed <= 0):
        damping = _least_damping(values, gain, pieces, l)
        rest, doubt = _rest(values, damping, l, speed), rest_resolution(values, damping)
        if not (last or rest <= doubt):
            return False
        if values[2] == 0:
            row[13] = max(l - rest, 0.0) if rest <= doubt else math.inf
        else:
            row[13] = max(row[13], 0.0)
        row[12] = min(row[12], row[13])
        return True
    floor = _floor_after(values, gain, l, speed)
    ceiling = 2 * values[5] - floor if values[2] > 0 else 2 * l - floor
    if not (floor > 0 and (open_ended or ceiling <= top)):
        return False
    settled = abs(l - floor) <= 1e-12 * l
    if not (settled or last or row[12] <= floor):
        return False
    if values[2] == 0:
        row[13] = floor if settled else math.inf
    row[12] = min(row[12], row[13])
    return True


@kernel
def _encounter(values: Any, gain: float, pieces: Any, limits: Any, work: Any, row: Any, times: Any, trace: Any) -> int:
    """Solve one encounter; return its status. Where times are given, fill the trace at them."""
    horizon, contact_border, open_ended = limits
    l, speed = values[5] - values[3], values[6] - values[4]  # noqa: E741
    start, time, sample = l, 0.0, 0
    index, last = find_piece(pieces, l), pieces.shape[0] - 1
    bottom, top = pieces[0, 0] - pieces[0, 1], pieces[-1, 0] + pieces[-1, 1]
    row[7:12] = 0.0
    row[12], row[13], row[14] = l, math.inf, 0.0
    if values[6] == 0 and values[7] == 0 and values[2] > 0 and gain <= 0:
        row[13] = values[5]
    alone = is_left_alone(values)
    never = alone and _never(values, gain, pieces, l, speed)
    taylor = first_unit(values, gain, pieces[index], speed, horizon)
    pace = np.array([0.0, PATIENCE, PATIENCE, 0.0])
    c = work[0]
    for _ in range(MOST_STEPS + _PER_PIECE * pieces.shape[0]):
        piece = pieces[index]
        low, high = piece[0] - piece[1], piece[0] + piece[1]
        low -= OVERLAP * piece[1] if index > 0 else 0.0
        high += OVERLAP * piece[1]  # at the top as well: an object may rest where the range starts
        way = l - low if speed < 0 else high - l
        longest = min(horizon - time, AHEAD * way / max(abs(speed), 1e-300))
        unit = long_step(values, gain, piece, (time, l, speed), taylor, longest, pace, work)
        tau = 1.0
        if unit == 0.0:
            unit, scale = taylor, scale_of(values, start, time, l)
            expand(values, gain, piece, time, unit, l, speed, work)
            tau = reach_of(work, scale)
            taylor = min(unit * tau, horizon)
            pace[3] = _LEFT_OUT * _SLOW * scale / taylor
        tau = min(tau, (horizon - time) / unit)
        borders = (low, high, -math.inf if never else bottom)
        tau, end, moved, touched, since = accepted_step(values, c, borders, (time, unit), tau)
        if moved > 0 and index == last:
            end = max(l, top)
            tau = level_time(c, end, since, tau) if horner(c, ORDER, since) < end else since
        while sample < times.shape[0] and times[sample] <= time + unit * tau:
            s = (times[sample] - time) / unit
            at, fast = horner(c, ORDER, s), horner(work[1], ORDER, s)
            trace[sample, 0] = at
            t = times[sample]
            trace[sample, 1] = values[5] + (values[6] + values[7] * t / 2) * t - at
            trace[sample, 2] = values[6] + values[7] * t - fast
            trace[sample, 3] = values[7] - horner_slope(work[1], ORDER, s) / unit
            sample += 1
        row[14] += integral(values, c, time, unit, tau)
        _finish(values, gain, work, (time, unit, tau, end), row)
        keep_extremes(values, gain, work, time, unit, tau, row)
        time, l, speed = row[0], end, row[5]  # noqa: E741
        if moved < 0 and (index == 0 or touched):
            row[1] = row[12] = bottom
            if touched:
                row[3], row[5], row[6] = row[3] + speed, 0.0, 0.0
            row[13] = bottom if never else row[13]  # then it is as close to its rest as rounding lets it come
            return NEVER if never else CONTACT if contact_border else LEFT_RANGE
        if moved > 0 and index == last:
            row[1] = top
            return UNRESOLVED if open_ended else LEFT_RANGE
        index += moved
        never = never or (alone and _never(values, gain, pieces, l, speed))
        vanished = alone and values[5] == 0 and values[2] > 0 and _rest(values, 0.0, l, speed) <= _VANISHED * start
        if vanished:
            row[12] = row[13] = 0.0
        if vanished or _is_over(values, gain, pieces, open_ended, time >= horizon, never, row):
            return NEVER
        if time >= horizon or not math.isfinite(l + speed):
            return HORIZON if time >= horizon else UNRESOLVED
    return NEVER if never and _is_over(values, gain, pieces, open_ended, True, never, row) else UNRESOLVED


@kernel
def solve_series(values: Any, gains: Any, pieces: Any, limits: Any, rows: Any, status: Any) -> None:
    """Solve encounters for a curve given as pieces.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        gains: D_p [N s], shape (n,).
        pieces: middle [m], half width [m] and coefficients of g in z [1/m] of each piece, shape (p, 2 + degree).
        limits: horizon [s], whether the lowest border is the contact, whether the curve goes on beyond the pieces.
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,).
    """
    work = np.zeros((max(ROWS, 3 + pieces.shape[1] - 2), ORDER + 2))
    none, nowhere = np.zeros(0), np.zeros((0, 4))
    for i in range(values.shape[0]):
        status[i] = _encounter(values[i], gains[i], pieces, limits, work, rows[i], none, nowhere)


@kernel
def trace_series(values: Any, gains: Any, pieces: Any, limits: Any, times: Any, trace: Any) -> None:
    """Fill trace[i, j] with layout.TRACE_COLUMNS of encounter i at times[i, j], ascending, until its end."""
    work = np.zeros((max(ROWS, 3 + pieces.shape[1] - 2), ORDER + 2))
    row = np.zeros(15)
    for i in range(values.shape[0]):
        _encounter(values[i], gains[i], pieces, limits, work, row, times[i], trace[i])
