"""First contact and extremes of the linear motion L(8) of a curve with constant slope.

With x~ = x - x_d, the motion is M x~'' + (D + c D_p) x~' + K x~ = c D_p (v_o + a_o t), and x~''' is a free response: so
its zeros are known in closed form. Between two of them x~'' is monotone, so every line a + b t has at most one crossing
with x~' there on each side of the one zero of x~'' + b: a chain that encloses every zero of l'', l' and l, one each.
No contact can be missed, whatever the damping or the acceleration. What lies closer to zero than rounding lets one tell
is decided by `endings`.
"""

from __future__ import annotations

import math
from typing import Any

from .compiler import kernel
from .endings import is_left_alone, never_arrives, resolution
from .response import respond

__all__ = ["solve_linear"]

CONTACT, NEVER, HORIZON, LEFT_RANGE, UNRESOLVED = 0, 1, 2, 3, 4
_MAX_INTERVALS = 2_000_000
_VANISHED = 600.0  # time constants after which a motion about l = 0 is below 1e-260 of its start: it has come to rest


@kernel
def _line(system: Any, order: int, a: float, b: float, t: float) -> float:
    """x~^(order)(t) + a + b t."""
    y, velocity, acceleration, _, _ = respond(system[0], system[1], system[2], system[3], system[4], t)
    value = y if order == 0 else velocity if order == 1 else acceleration
    return value + a + b * t


@kernel
def _distance(system: Any, obstacle: Any, t: float) -> Any:
    """Return l and l' by L(10): the obstacle of L(9) less the response x~."""
    y, velocity, _, _, _ = respond(system[0], system[1], system[2], system[3], system[4], t)
    return (
        obstacle[0] + (obstacle[1] + obstacle[2] * t / 2) * t - y,
        obstacle[1] + obstacle[2] * t - velocity,
    )


@kernel
def _zero(system: Any, order: int, a: float, b: float, left: float, right: float) -> float:
    """Find the zero of a line that changes its sign once in between, or the right end where it does not."""
    f_left, f_right = _line(system, order, a, b, left), _line(system, order, a, b, right)
    if not (f_left < 0 < f_right or f_right < 0 < f_left):
        return right
    width = right - left
    for k in range(200):
        guess = left + f_left * (right - left) / (f_left - f_right)
        if k % 3 == 2:  # regula falsi must halve the bracket in three steps, or bisection does
            if right - left > 0.5 * width:
                guess = 0.5 * (left + right)
            width = right - left
        f_guess = _line(system, order, a, b, guess)
        if f_guess == 0:
            return guess
        if (f_guess < 0) == (f_left < 0):
            left, f_left = guess, f_guess
            f_right *= 0.5  # Illinois: the end that stays counts half
        else:
            right, f_right = guess, f_guess
            f_left *= 0.5
        if right - left <= 1e-13 * right:
            break
    return right


@kernel
def _crossing(system: Any, obstacle: Any, level: float, left: float, right: float) -> float:
    """Find where a monotone l passes a level between left and right: Newton's method held in the bracket."""
    rising = _distance(system, obstacle, right)[0] > level
    t, width = left, right - left
    for k in range(200):
        value, slope = _distance(system, obstacle, t)
        if (value > level) == rising:
            right = t
        else:
            left = t
        step = t - (value - level) / slope
        if abs(step - t) <= 4e-16 * abs(t):
            return t
        slow = False
        if k % 4 == 3:  # a step on an exponential is its time constant, however far the end: then bisection is faster
            slow = right - left > 0.5 * width
            width = right - left
        t = step if left <= step <= right and not slow else 0.5 * (left + right)
        if right - left <= 4e-16 * right:
            return right
    return t


@kernel
def _next_break(system: Any, k: int) -> float:
    """Return the k-th positive zero of x~''', infinite where there is none."""
    mass, damping, stiffness, start, force = system
    sigma, square = damping / (2 * mass), stiffness / mass
    a0 = (force[0] - stiffness * start[0] - damping * start[1]) / mass
    j0 = force[1] / mass - 2 * sigma * a0 - square * start[1]
    disc = (damping * damping - 4 * mass * stiffness) / (4 * mass * mass)
    if disc < 0:
        root = math.sqrt(-disc)
        # x~''' ~ j0 cos(w t) - (sigma j0 + w0^2 a0) sin(w t) / w
        first = math.atan2(j0 * root, sigma * j0 + square * a0) / root
        period = math.pi / root
        first -= math.floor(first / period) * period
        if first <= 0:
            first += period
        return first + k * period
    if k > 0 or j0 == 0:
        return math.inf
    quotient = sigma + square * a0 / j0
    if quotient * quotient <= disc or quotient <= 0:
        return math.inf
    ratio = math.sqrt(disc) / quotient
    scaled = 1.0 + ratio * ratio / 3 if ratio < 1e-5 else math.atanh(ratio) / ratio
    return scaled / quotient


@kernel
def _floor_after(system: Any, obstacle: Any, t: float) -> float:
    """Bound l from below after t: a particular motion that recedes less a free rest that decays; else -inf."""
    mass, damping, stiffness, _, force = system
    if damping < 0 or obstacle[2] < 0 or stiffness == 0:
        return -math.inf
    drift = force[1] / stiffness
    center = (force[0] - damping * drift) / stiffness + drift * t
    particular = obstacle[0] + (obstacle[1] + obstacle[2] * t / 2) * t - center
    speed = obstacle[1] + obstacle[2] * t - drift
    if speed < 0:
        return -math.inf
    value, slope = _distance(system, obstacle, t)
    rest, rest_slope = value - particular, slope - speed
    return particular - math.sqrt(rest * rest + rest_slope * rest_slope * mass / stiffness)


@kernel
def _settling(values: Any, damping: float) -> float:
    """Return the distance at which the motion comes to rest, infinite where it does not."""
    if not is_left_alone(values) or damping <= 0:
        return math.inf
    if values[2] > 0:
        return values[5]
    return values[5] - values[3] + (values[6] - values[4]) * values[0] / damping


@kernel
def _keep_extremes(system: Any, obstacle: Any, reference: Any, coupling: float, t: float, row: Any) -> None:
    """Raise the largest and lower the smallest quantities of a row to those at t."""
    y, velocity, acceleration, _, _ = respond(system[0], system[1], system[2], system[3], system[4], t)
    distance = obstacle[0] + (obstacle[1] + obstacle[2] * t / 2) * t - y
    travel = y - system[3][0] + (reference[0] + reference[1] * t / 2) * t
    row[7] = max(row[7], abs(y))
    row[8] = max(row[8], abs(travel))
    row[9] = max(row[9], abs(velocity + reference[0] + reference[1] * t))
    row[10] = max(row[10], abs(acceleration + reference[1]))
    row[11] = max(row[11], abs(coupling * (obstacle[1] + obstacle[2] * t - velocity)))
    row[12] = min(row[12], distance)


@kernel
def _first_exit(values: Any, system: Any, obstacle: Any, low: float, high: float, left: float, right: float) -> Any:
    """Return the first time in (left, right] at which l leaves (low, high), the level, and whether it is only touched.

    The time is infinite where l does not leave. Between left and right l'' is monotone.
    """
    velocity, acceleration = -obstacle[1], -obstacle[2]
    bend = _zero(system, 2, acceleration, 0.0, left, right)
    start = left
    for bend_end in (bend, right):
        turn = _zero(system, 1, velocity, acceleration, start, bend_end)
        for end in (turn, bend_end):
            if end > start:
                distance, speed = _distance(system, obstacle, end)
                turns = speed >= 0 or end < bend_end
                falls = abs(distance - low) <= resolution(values, end) and _distance(system, obstacle, start)[1] < 0
                if falls and turns:
                    return end, low, True
                if distance <= low:
                    return _crossing(system, obstacle, low, start, end), low, False
                if distance > high:
                    return _crossing(system, obstacle, high, start, end), high, False
                start = end
    return math.inf, 0.0, False


@kernel
def _follow_extremes(
    system: Any, obstacle: Any, reference: Any, coupling: float, left: float, right: float, stop: float, row: Any
) -> None:
    """Update the extremes of a row over (left, stop], inside (left, right) where x~'' is monotone."""
    _keep_extremes(system, obstacle, reference, coupling, stop, row)
    lines = ((-obstacle[1], -obstacle[2]), (0.0, 0.0), (reference[0], reference[1]))
    for a, b in lines:
        bend = _zero(system, 2, b, 0.0, left, right)
        start = left
        for bend_end in (bend, right):
            turn = _zero(system, 1, a, b, start, bend_end)
            for moment in (turn, bend_end):
                if moment < stop:
                    _keep_extremes(system, obstacle, reference, coupling, moment, row)
            start = bend_end


@kernel
def _finish(system: Any, obstacle: Any, coupling: float, t: float, row: Any) -> None:
    """Write the state at t."""
    y, velocity, acceleration, _, integral = respond(system[0], system[1], system[2], system[3], system[4], t)
    row[0] = t
    row[1] = obstacle[0] + (obstacle[1] + obstacle[2] * t / 2) * t - y
    row[2], row[3], row[4] = y, velocity, acceleration
    row[5] = obstacle[1] + obstacle[2] * t - velocity
    row[6] = coupling * row[5]
    row[14] = integral


@kernel
def _encounter(values: Any, slope: float, gain: float, limits: Any, row: Any) -> int:
    """Solve one encounter of L(7), in the distance L(8), up to its first l = 0; return its status."""
    coupling = slope * gain
    system = (
        values[0],
        values[1] + coupling,
        values[2],
        (values[3], values[4]),
        (coupling * values[6], coupling * values[7]),
    )
    obstacle, reference = (values[5], values[6], values[7]), (values[8], values[9])
    horizon, low, high = limits
    sigma = system[1] / (2 * system[0])
    if sigma < 0:  # a motion that grows has shown its sign long before its numbers overflow
        horizon = min(horizon, 300.0 / -sigma)
    alone, vanished = is_left_alone(values), math.inf
    if alone and obstacle[0] == 0 and values[2] > 0 and sigma > 0:
        vanished = _VANISHED / sigma
        horizon = min(horizon, vanished)
    row[7:12] = 0.0
    row[12] = math.inf
    row[13] = _settling(values, system[1])
    _keep_extremes(system, obstacle, reference, coupling, 0.0, row)
    left, floor_level, never = 0.0, max(low, 0.0), False
    for k in range(_MAX_INTERVALS):
        right = min(_next_break(system, k), horizon)
        if not right > left:
            continue
        if alone and not never:
            distance, speed = _distance(system, obstacle, left)
            never = never_arrives(values, system[1], distance, speed, floor_level)
        lowest = -math.inf if never else floor_level
        leave, level, touched = _first_exit(values, system, obstacle, lowest, high, left, right)
        stop = min(leave, right)
        _follow_extremes(system, obstacle, reference, coupling, left, right, stop, row)
        _finish(system, obstacle, coupling, stop, row)
        if leave < math.inf:
            row[1] = level
            row[12] = level if level < high else min(row[12], level)
            if touched:
                row[3], row[5], row[6] = row[3] + row[5], 0.0, 0.0
            return CONTACT if level == 0.0 else LEFT_RANGE
        never = never or right >= vanished
        if _is_over(values, system, obstacle, right, right >= horizon, high, never, row):
            return NEVER
        if right >= horizon:
            return HORIZON
        left = right
    return UNRESOLVED


@kernel
def _is_over(values: Any, system: Any, obstacle: Any, t: float, last: bool, high: float, never: bool, row: Any) -> bool:
    """Tell whether l is proved to stay above 0 and within the range for good, at its end or close to its least."""
    floor, settles = _floor_after(system, obstacle, t), row[13] < math.inf
    if values[2] == 0 and settles:
        floor = row[13]
    # what recedes leaves a range that ends; what swings about its resting place may
    stays = high == math.inf or (settles and 2 * row[13] - floor <= high)
    if never:
        stays = stays or row[5] <= 0  # then l falls from here on
    elif not floor > 0:
        return False
    if not (stays and (last or row[12] <= floor * (1 + 1e-12))):
        return False
    if settles:
        row[13] = max(row[13], 0.0)
        row[12] = min(row[12], row[13])
    row[1], row[12] = max(row[1], 0.0), max(row[12], 0.0)
    return True


@kernel
def _rounding(values: Any, coupling: float, t: float) -> float:
    """Return what a negative damping has made of the rounding of the start until t [m]; 0 without one."""
    damping = values[1] + coupling
    if damping >= 0:
        return 0.0
    root = math.sqrt(max(damping * damping - 4 * values[0] * values[2], 0.0))
    rate = (root - damping) / (2 * values[0])
    size = abs(values[3]) + abs(values[5]) + (abs(values[4]) + abs(values[6])) / rate + abs(values[7]) / rate**2
    return 2e-16 * size * math.exp(min(rate * t, 700.0))


@kernel
def solve_linear(values: Any, slope: float, gains: Any, limits: Any, rows: Any, status: Any) -> None:
    """Solve encounters with ln xi' = slope.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        slope: g [1/m].
        gains: D_p [N s], shape (n,).
        limits: horizon [s], smallest and largest valid distance [m].
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,).
    """
    for i in range(values.shape[0]):
        status[i] = _encounter(values[i], slope, gains[i], limits, rows[i])
        if _rounding(values[i], slope * gains[i], rows[i, 0]) > 1e-6 * (values[i, 5] - values[i, 3]):
            rows[i, 0] = math.nan  # not a number that could be trusted
