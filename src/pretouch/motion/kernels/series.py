"""Integrate L(1) with L(2) for any sensor curve by Taylor series, and find the first contact in them.

The slope of the curve is a piecewise polynomial, g = sum_j q_j z^j with z = (l - m) / h on the piece [m - h, m + h].
Inside one piece the motion

    M (x_o'' - l'') + D (x_o' - l') + K (x_o - l) = D_p d(ln xi)/dt

is a polynomial differential equation, so the Taylor coefficients of l follow from each other by convolutions, to any
order and without a derivative being formed. Each step is a polynomial whose error is at rounding; it is accepted only
when its coefficients prove that l either stays inside the piece or is monotone, so that a border, the contact among
them, is never passed twice unseen.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compiler import kernel

__all__ = ["ORDER", "solve_series", "trace_series"]

CONTACT, NEVER, HORIZON, LEFT_RANGE, UNRESOLVED = 0, 1, 2, 3, 4
ORDER = 20
_MAX_STEPS = 100_000  # about a quarter of a second
_OVERLAP = 1e-9  # of a piece's width: how far its polynomial is used beyond its border


@kernel
def _horner(c: Any, order: int, tau: float) -> float:
    value = c[order]
    for k in range(order - 1, -1, -1):
        value = value * tau + c[k]
    return value


@kernel
def _horner_slope(c: Any, order: int, tau: float) -> float:
    value = order * c[order]
    for k in range(order - 1, 0, -1):
        value = value * tau + k * c[k]
    return value


@kernel
def _expand(values: Any, gain: float, piece: Any, time: float, unit: float, l: float, speed: float, work: Any) -> None:  # noqa: E741
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
def _reach(work: Any, scale: float) -> float:
    """Return the largest tau at which the series of l and of l' unit are at rounding beside their scales."""
    c = work[0]
    size = max(abs(c[1]), abs(c[2]), 1e-6 * scale)
    reach = 2.0
    for k in (ORDER - 1, ORDER):
        if c[k] != 0:
            reach = min(reach, (1e-17 * scale / abs(c[k])) ** (1.0 / k))
            reach = min(reach, (1e-16 * size / (k * abs(c[k]))) ** (1.0 / (k - 1)))
    return reach


@kernel
def _certified(c: Any, low: float, high: float, tau: float) -> Any:
    """Tell whether l is proved monotone on [0, tau], and whether it is proved to stay in (low, high)."""
    rest, bend, power = 0.0, 0.0, 1.0
    for k in range(1, ORDER + 1):
        if k > 1:
            bend += k * abs(c[k]) * power
        power *= tau
        rest += abs(c[k]) * power
    return abs(c[1]) > bend, c[0] - rest > low and c[0] + rest < high


@kernel
def _level_time(c: Any, level: float, tau: float) -> float:
    """Find where a monotone series that passes a level on [0, tau] does so."""
    left, right = 0.0, tau
    rising = _horner(c, ORDER, tau) > level
    t = tau
    for _ in range(100):
        value = _horner(c, ORDER, t) - level
        if (value > 0) == rising:
            right = t
        else:
            left = t
        step = t - value / _horner_slope(c, ORDER, t)
        if abs(step - t) <= 4e-16 * tau:
            return t
        t = step if left <= step <= right else 0.5 * (left + right)
    return t


@kernel
def _peak(c: Any, order: int, shift: float, tilt: float, tau: float, so_far: float) -> float:
    """Return the larger of so_far and max |p(s) + shift + tilt s| over s in [0, tau]."""
    best = max(so_far, abs(c[0] + shift), abs(_horner(c, order, tau) + shift + tilt * tau))
    rest, power = abs(c[0] + shift), 1.0
    for k in range(1, order + 1):
        power *= tau
        rest += (abs(c[k]) if k > 1 else abs(c[1] + tilt)) * power
    if rest <= best:
        return best
    parts = 8
    left, slope_left = 0.0, c[1] + tilt
    if slope_left == 0.0:  # from rest: the way that it bends
        slope_left = c[2]
    for i in range(1, parts + 1):
        right = tau * i / parts
        slope_right = _horner_slope(c, order, right) + tilt
        if slope_left * slope_right < 0:
            a, b = left, right
            for _ in range(30):  # the peak is flat: 1e-9 in its place is 1e-18 in its height
                middle = 0.5 * (a + b)
                if (_horner_slope(c, order, middle) + tilt) * slope_left > 0:
                    a = middle
                else:
                    b = middle
            best = max(best, abs(_horner(c, order, a) + shift + tilt * a))
        left, slope_left = right, slope_right
    return best


@kernel
def _keep_extremes(values: Any, gain: float, work: Any, time: float, unit: float, tau: float, row: Any) -> None:
    """Raise the largest and lower the smallest quantities of a row over one step."""
    c, v, force = work[0], work[1], work[2]
    x = work[3]  # the powers are no longer needed: reuse their first two rows
    a = work[4]
    position = values[5] + (values[6] + values[7] * time / 2) * time
    for k in range(ORDER + 1):
        x[k] = -c[k]
        a[k] = -(k + 1) * v[k + 1] / unit if k < ORDER else 0.0
    x[0] += position
    x[1] += (values[6] + values[7] * time) * unit
    x[2] += values[7] / 2 * unit * unit
    a[0] += values[7]
    row[7] = _peak(x, ORDER, 0.0, 0.0, tau, row[7])
    row[10] = _peak(a, ORDER - 1, values[9], 0.0, tau, row[10])
    row[11] = max(row[11], abs(gain) * _peak(force, ORDER - 1, 0.0, 0.0, tau, row[11] / max(abs(gain), 1e-300)))
    for k in range(ORDER + 1):
        a[k] = -v[k]
    a[0] += values[6] + values[7] * time
    a[1] += values[7] * unit
    row[9] = _peak(a, ORDER, values[8] + values[9] * time, values[9] * unit, tau, row[9])
    x[0] += (values[8] + values[9] * time / 2) * time - values[3]
    x[1] += (values[8] + values[9] * time) * unit
    x[2] += values[9] / 2 * unit * unit
    row[8] = _peak(x, ORDER, 0.0, 0.0, tau, row[8])
    far, power = 0.0, 1.0
    for k in range(ORDER + 1):
        x[k] = -c[k]
        far += abs(c[k]) * power
        power *= tau
    row[12] = min(row[12], far - _peak(x, ORDER, far, 0.0, tau, 0.0))


@kernel
def _integral(values: Any, c: Any, time: float, unit: float, tau: float) -> float:
    """Integrate x~ over one step."""
    x0, x1, x2 = values[5] + (values[6] + values[7] * time / 2) * time, values[6] + values[7] * time, values[7]
    step = unit * tau
    total = c[ORDER] / (ORDER + 1)
    for k in range(ORDER - 1, -1, -1):
        total = total * tau + c[k] / (k + 1)
    return (x0 + (x1 / 2 + x2 / 6 * step) * step) * step - unit * tau * total


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
def _find_piece(pieces: Any, l: float) -> int:  # noqa: E741
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
    speed = _horner(v, ORDER, tau)
    end = time + unit * tau
    row[0], row[1] = end, l
    row[2] = values[5] + (values[6] + values[7] * end / 2) * end - l
    row[3] = values[6] + values[7] * end - speed
    row[4] = values[7] - _horner_slope(v, ORDER, tau) / unit
    row[5] = speed
    row[6] = gain * _horner(work[2], ORDER - 1, tau)


@kernel
def _encounter(values: Any, gain: float, pieces: Any, limits: Any, work: Any, row: Any, times: Any, trace: Any) -> int:
    """Solve one encounter; return its status. Where times are given, fill the trace at them."""
    horizon, contact_border, open_ended = limits
    l, speed = values[5] - values[3], values[6] - values[4]  # noqa: E741
    scale = l
    time, sample = 0.0, 0
    index = _find_piece(pieces, l)
    bottom, top = pieces[0, 0] - pieces[0, 1], pieces[-1, 0] + pieces[-1, 1]
    row[7:12] = 0.0
    row[12], row[13], row[14] = l, math.inf, 0.0
    if values[6] == 0 and values[7] == 0 and values[2] > 0 and gain <= 0:
        row[13] = values[5]
    rate = abs(values[1] + gain * pieces[index, 2]) / values[0] + math.sqrt(values[2] / values[0])
    unit = min(1.0 / rate if rate > 0 else 1.0, 2 * pieces[index, 1] / max(abs(speed), 1e-12), horizon)
    for _ in range(_MAX_STEPS):
        piece = pieces[index]
        _expand(values, gain, piece, time, unit, l, speed, work)
        c = work[0]
        reach = _reach(work, max(scale, l))
        tau = min(reach, (horizon - time) / unit)
        low, high = piece[0] - piece[1], piece[0] + piece[1]
        low -= _OVERLAP * piece[1] if index > 0 else 0.0
        high += _OVERLAP * piece[1]  # at the top as well: an object may rest where the range starts
        monotone, inside = _certified(c, low, high, tau)
        while not (monotone or inside) and tau > 1e-14:
            tau *= 0.5
            monotone, inside = _certified(c, low, high, tau)
        end = _horner(c, ORDER, tau)
        moved = 0
        if not inside and end <= low:
            tau, end, moved = _level_time(c, low, tau), low, -1
        elif not inside and end >= high:
            end = max(l, top) if index == pieces.shape[0] - 1 else high
            tau, moved = _level_time(c, end, tau), 1
        while sample < times.shape[0] and times[sample] <= time + unit * tau:
            s = (times[sample] - time) / unit
            at, fast = _horner(c, ORDER, s), _horner(work[1], ORDER, s)
            trace[sample, 0] = at
            t = times[sample]
            trace[sample, 1] = values[5] + (values[6] + values[7] * t / 2) * t - at
            trace[sample, 2] = values[6] + values[7] * t - fast
            trace[sample, 3] = values[7] - _horner_slope(work[1], ORDER, s) / unit
            sample += 1
        row[14] += _integral(values, c, time, unit, tau)
        _finish(values, gain, work, (time, unit, tau, end), row)
        _keep_extremes(values, gain, work, time, unit, tau, row)
        time, l, speed = row[0], end, row[5]  # noqa: E741
        if moved < 0 and index == 0:
            row[1] = row[12] = bottom
            return CONTACT if contact_border else LEFT_RANGE
        if moved > 0 and index == pieces.shape[0] - 1:
            row[1] = top
            return UNRESOLVED if open_ended else LEFT_RANGE
        index += moved
        floor = _floor_after(values, gain, l, speed)
        ceiling = 2 * values[5] - floor if values[2] > 0 else 2 * l - floor
        if floor > 0 and (open_ended or ceiling <= top):
            settled = abs(l - floor) <= 1e-12 * l
            if settled or time >= horizon or row[12] <= floor:
                if values[2] == 0:
                    row[13] = floor if settled else math.inf
                row[12] = min(row[12], row[13])
                return NEVER
        if time >= horizon:
            return HORIZON
        if not (math.isfinite(l) and math.isfinite(speed)):
            return UNRESOLVED
        unit = min(unit * reach, horizon)
    return UNRESOLVED


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
    work = np.zeros((3 + max(2, pieces.shape[1] - 2), ORDER + 2))
    none, nowhere = np.zeros(0), np.zeros((0, 4))
    for i in range(values.shape[0]):
        status[i] = _encounter(values[i], gains[i], pieces, limits, work, rows[i], none, nowhere)


@kernel
def trace_series(values: Any, gains: Any, pieces: Any, limits: Any, times: Any, trace: Any) -> None:
    """Fill trace[i, j] with layout.TRACE_COLUMNS of encounter i at times[i, j], ascending, until its end."""
    work = np.zeros((3 + max(2, pieces.shape[1] - 2), ORDER + 2))
    row = np.zeros(15)
    for i in range(values.shape[0]):
        _encounter(values[i], gains[i], pieces, limits, work, row, times[i], trace[i])
