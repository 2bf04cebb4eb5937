"""Solve many encounters side by side, and leave to solve_series whatever is not proved.

Eight encounters at a time take Taylor steps, each with its own time, its own step and its own window of its curve;
series_step holds the arithmetic. The windows of all curves lie in one table, and each encounter knows which are its
own. An encounter that ends makes room for the next at once: no lane waits for another, and no result depends on what
the other lanes hold. Encounters that reach the contact wait in a second set of rows until there are eight of them, to
be finished together.

What is proved. On each step, t = length * s with s in [0, 1], the sum b_1 + sum_k max(0, k b_k) bounds dl/ds from
above. A step counts only where that bound is negative: then l falls all along, its value at the end decides whether it
passed 0, and the first zero is the only one. Where the bound fails the step is shortened; where that does not help, the
encounter is left open.

What is estimated. The last coefficient of each step, as an error of l and of l', is carried to the contact (undamped,
or growing, or strengthened by a damping that fades), and divided by |l'|. Above 1e-10 of the time the encounter is left
open.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compiler import kernel
from .lanes import LANES, aligned_rows
from .series_gradient import RESPONSE_TOLERANCE, write_gradient
from .series_lane import (
    carry_responses,
    cut_steps,
    enter_window,
    find_window,
    level_part,
    pass_turn,
    take_step,
    window_slope,
)
from .series_peaks import ALL_ROWS, KEPT_ROWS, SPARE, follow_peaks, settle_peaks, start_peaks, write_peaks
from .series_step import MOST_STEPS, ORDER, ROWS, Row, find_in_step

__all__ = ["CONTACT", "OPEN", "contact_gradients", "contact_times", "solve_lanes"]

CONTACT, OPEN = 0, -1
_LARGEST_DOUBT = 1e-10  # of the time; 1e-9 is promised
_MOST_CUTS = 4  # of one step before it is taken for a turn
_LOW, _TOP, _SWITCH, _TERMS = 1, 2, 3, 5  # columns of a window
_NEVER = 1e300

DAMPING, STIFFNESS, GAIN = Row.DAMPING, Row.STIFFNESS, Row.GAIN
POSITION, VELOCITY, ACCELERATION = Row.POSITION, Row.VELOCITY, Row.ACCELERATION
TIME, DISTANCE, SPEED, INTEGRAL, ERROR, STRONGEST = range(Row.TIME, Row.TIME + 6)
CAP, LENGTH, END, BOUND, SCALE, HORIZON, STEPS = range(Row.CAP, Row.CAP + 7)
EDGE, SWITCH = Row.EDGE, Row.SWITCH
FINAL_TIME, FINAL_SPEED, FINAL_BEND, FINAL_INTEGRAL, DOUBT = range(Row.FINAL_TIME, Row.FINAL_TIME + 5)
START, MOVED, MASS, FIRST_SPEED, RESPONSES = range(Row.START, Row.START + 5)
TERMS, WIDEST, EXCESS = Row.TERMS, Row.WIDEST, Row.EXCESS


@kernel
def _finish(
    queue: Any, owners: Any, count: int, curves: Any, out: Any, gradients: Any, demands: Any, status: Any
) -> None:
    """Find the contacts of the encounters that wait, and write them."""
    windows, starts, curve_of = curves
    degree = windows.shape[1] - _TERMS - 1
    find_in_step(queue)
    if gradients is not None:
        cut_steps(queue, count)
        smooth = carry_responses(queue, degree)
    if demands is not None:
        cut_steps(queue, count)
        follow_peaks(queue, degree, owners, demands[3], demands[2])
    for lane in range(count):
        i, time = owners[lane], queue[FINAL_TIME, lane]
        if queue[DOUBT, lane] <= _LARGEST_DOUBT and time <= queue[HORIZON, lane] and queue[FINAL_SPEED, lane] < 0:
            p, v, a = queue[POSITION, lane], queue[VELOCITY, lane], queue[ACCELERATION, lane]
            out[0, i] = time
            out[1, i] = p + (v + a / 2 * time) * time
            out[2, i] = v + a * time - queue[FINAL_SPEED, lane]
            out[3, i] = a - queue[FINAL_BEND, lane]
            out[4, i] = queue[FINAL_SPEED, lane]
            out[5, i] = queue[FINAL_INTEGRAL, lane]
            status[i] = CONTACT
            if gradients is not None and (smooth >> lane) & 1:
                first = starts[curve_of[i] if curve_of.shape[0] > 1 else curve_of[0]]
                write_gradient(queue, lane, window_slope(windows, first, 0.0), gradients[:, :, i])
            if demands is not None:
                write_peaks(queue, lane, degree, i, demands[2])


@kernel
def contact_times(
    inputs: Any,
    curves: Any,
    horizon: float,
    out: Any,
    status: Any,
) -> None:
    """Find the first contact of encounters, where that can be proved.

    Args:
        inputs: M [kg], D [N s/m], K [N/m], x~(0) [m], x~'(0) [m/s], position [m], velocity [m/s] and acceleration
            [m/s^2] of the obstacle relative to the reference, and D_p [N s]: nine arrays, (n,) or (1,), contiguous.
        curves: windows of all curves as curve_windows gives them, from l = 0 upward; where those of each curve start
            there, and where the last ends; and which curve is that of each encounter, (n,) or (1,).
        horizon: the latest contact of interest [s].
        out: filled with time, x~, x~', x~'', l' and the integral of x~ until then, shape (6, n); nan where open.
        status: filled with CONTACT or OPEN, shape (n,).
    """
    solve_lanes(inputs, curves, horizon, out, None, None, status)


@kernel
def contact_gradients(
    inputs: Any,
    curves: Any,
    horizon: float,
    out: Any,
    gradients: Any,
    status: Any,
) -> None:
    """Find contacts as contact_times does, and how they depend on the inputs.

    Args:
        inputs: see contact_times.
        curves: see contact_times.
        horizon: see contact_times.
        out: see contact_times.
        gradients: filled with the derivatives of time, x~ and l' at contact by the nine inputs in the order above,
            shape (3, 9, n); nan where open.
        status: see contact_times.
    """
    gradients[:] = np.nan
    solve_lanes(inputs, curves, horizon, out, gradients, None, status)


@kernel
def solve_lanes(
    inputs: Any,
    curves: Any,
    horizon: float,
    out: Any,
    gradients: Any,
    demands: Any,
    status: Any,
) -> None:
    """Solve encounters, with gradients or demands unless these are None: then their code is not even compiled.

    Demands are the velocity and the acceleration of the reference, what is to be filled, and room for peaks.
    """
    mass, damping, stiffness, x0, u0, p, v, a, gain = inputs
    windows, starts, curve_of = curves
    n = status.shape[0]
    out[:] = np.nan
    status[:] = OPEN
    degree = windows.shape[1] - _TERMS - 1
    rows = ROWS if demands is None else ALL_ROWS
    work, queue = aligned_rows(rows), aligned_rows(rows)
    owner, owners = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    place, cuts = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    first, last = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)  # of the windows of its curve
    waiting, following, active, hint = 0, 0, 0, 0
    before = np.zeros((CAP - TIME, LANES))
    copied = EDGE if gradients is None else ROWS
    free = (1 << LANES) - 1
    while True:
        lane = 0
        while free and following < n:
            i = following
            following += 1
            while not (free >> lane) & 1:
                lane += 1
            m = mass[i] if mass.shape[0] > 1 else mass[0]
            d = damping[i] if damping.shape[0] > 1 else damping[0]
            s = stiffness[i] if stiffness.shape[0] > 1 else stiffness[0]
            x = x0[i] if x0.shape[0] > 1 else x0[0]
            u = u0[i] if u0.shape[0] > 1 else u0[0]
            position = p[i] if p.shape[0] > 1 else p[0]
            velocity = v[i] if v.shape[0] > 1 else v[0]
            acceleration = a[i] if a.shape[0] > 1 else a[0]
            g = gain[i] if gain.shape[0] > 1 else gain[0]
            l, speed = position - x, velocity - u  # noqa: E741
            whole = abs(d) + abs(s) + abs(acceleration) + abs(g) + abs(position) + abs(x) + abs(velocity) + abs(u)
            if not (m > 0 and m < math.inf and whole < math.inf and l > 0):
                continue
            curve = curve_of[i] if curve_of.shape[0] > 1 else curve_of[0]
            lowest, beyond = starts[curve], starts[curve + 1]
            if lowest == beyond or windows[lowest, _LOW] != 0.0:
                continue
            index = find_window(windows, lowest, beyond, l, hint)
            if index < 0:
                continue
            hint = index
            inverse = 1 / m
            work[DAMPING, lane], work[STIFFNESS, lane], work[GAIN, lane] = d * inverse, s * inverse, g * inverse
            work[POSITION, lane], work[VELOCITY, lane], work[ACCELERATION, lane] = position, velocity, acceleration
            work[TIME, lane], work[DISTANCE, lane], work[SPEED, lane] = 0.0, l, speed
            work[INTEGRAL, lane], work[ERROR, lane], work[STRONGEST, lane] = 0.0, 0.0, 0.0
            work[CAP, lane], work[SCALE, lane], work[STEPS, lane], work[HORIZON, lane] = _NEVER, l, 0.0, horizon
            enter_window(windows, lowest, index, work, lane)
            if gradients is not None:
                work[MASS, lane], work[WIDEST, lane] = m, 0.0
                work[SCALE, lane] /= SPARE  # dl'/dq rests on l'', which has lost two factors of order over length
                for row in range(RESPONSES, TERMS):
                    work[row, lane] = 0.0
                work[TERMS - 4, lane] = 1.0  # the response to l(0), and its momentum
                work[TERMS - 3, lane] = (d + g * window_slope(windows, index, l)) * inverse
                work[TERMS - 1, lane] = 1.0  # that to l'(0)
            if demands is not None:
                drift, pull = demands[0], demands[1]
                work[MASS, lane], work[FIRST_SPEED, lane] = m, speed
                start_peaks(
                    work,
                    lane,
                    x,
                    drift[i] if drift.shape[0] > 1 else drift[0],
                    pull[i] if pull.shape[0] > 1 else pull[0],
                )
            owner[lane], place[lane], cuts[lane] = i, index, 0
            first[lane], last[lane] = lowest, beyond
            free &= ~(1 << lane)
            active |= 1 << lane
        if active == 0:
            break
        rough = 0
        if gradients is not None:
            before[:] = work[TIME:CAP]
        mask = take_step(work, degree)
        stuck = ~mask & active
        if stuck:
            for lane in range(LANES):
                if (stuck >> lane) & 1 and not work[BOUND, lane] < 0:
                    low = max(work[EDGE, lane], 0.0)
                    if pass_turn(work, lane, low, windows[place[lane], _TOP]):
                        mask |= (1 + (work[DISTANCE, lane] < work[SWITCH, lane]) * (1 << LANES)) << lane
        if gradients is not None:
            rough = ~carry_responses(work, degree) & active
            for lane in range(LANES):
                if not (rough >> lane) & 1:
                    continue
                if work[STEPS, lane] >= MOST_STEPS:
                    rough &= ~(1 << lane)
                    continue
                if (mask >> lane) & 1:  # the motion is right, the responses are not: this step is taken back
                    work[TIME:CAP, lane] = before[:, lane]
                    cuts[lane] = 0
                part = 0.9 * (RESPONSE_TOLERANCE / work[EXCESS, lane]) ** (1.0 / ORDER)
                work[CAP, lane] = work[LENGTH, lane] * (part if part > 0.1 else 0.1)
            mask &= ~(rough | rough << LANES)
        if demands is not None:
            follow_peaks(work, degree, owner, demands[3], demands[2])
        stuck, late = ~mask & active & ~rough, (mask >> LANES) & active
        if not (stuck or late):
            continue
        for lane in range(LANES):
            if (late >> lane) & 1:
                index = place[lane]
                while index > first[lane] and work[DISTANCE, lane] <= windows[index, _SWITCH]:
                    index -= 1
                place[lane] = index
                enter_window(windows, first[lane], index, work, lane)
            if not (stuck >> lane) & 1:
                continue
            end, bound, length = work[END, lane], work[BOUND, lane], work[LENGTH, lane]
            over = True
            if work[CAP, lane] == _NEVER:  # the last step counted
                cuts[lane] = 0
            if bound < -1e-9 * abs(work[1, lane]) and work[STEPS, lane] < MOST_STEPS:
                if end <= 0.0 and place[lane] == first[lane]:
                    for row in range(copied):
                        queue[row, waiting] = work[row, lane]
                    if demands is not None:
                        for row in range(MASS, KEPT_ROWS):
                            queue[row, waiting] = work[row, lane]
                    owners[waiting] = owner[lane]
                    waiting += 1
                    if waiting == LANES:
                        _finish(queue, owners, waiting, curves, out, gradients, demands, status)
                        waiting = 0
                elif end <= work[EDGE, lane]:
                    work[CAP, lane] = length * level_part(work, lane, windows[place[lane], _LOW])
                    over = False
            elif bound < math.inf and cuts[lane] < _MOST_CUTS and work[STEPS, lane] < MOST_STEPS:
                cuts[lane] += 1
                over = False
                if place[lane] + 1 < last[lane] and work[DISTANCE, lane] > windows[place[lane] + 1, _SWITCH]:
                    place[lane] += 1  # l may rise: the window above has room
                    enter_window(windows, first[lane], place[lane], work, lane)
                else:
                    spare = work[1, lane] / (work[1, lane] - bound)
                    work[CAP, lane] = length * (0.95 * spare if 0.8 < spare < 1 else 0.7)
            if over:
                free |= 1 << lane
                active &= ~(1 << lane)
    if waiting:
        _finish(queue, owners, waiting, curves, out, gradients, demands, status)
    if demands is not None:
        settle_peaks(demands[3], demands[2])
        for i in range(n):
            if status[i] != CONTACT:
                demands[2][:, i] = np.nan
