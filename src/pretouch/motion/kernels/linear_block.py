"""First contacts of many encounters with constant slope at once: the closed form on vectors, with its own proof.

Over-damped (or critical) motion, a = 0, v < 0. With the rates mu_1 <= mu_2, the roots of M mu^2 - (D + c) mu + K, and
F = (c v - K x_0) / M, the response is built from two functions that stay finite at mu_1 = mu_2 and at K = 0,

    h(t) = (e^(-mu_1 t) - e^(-mu_2 t)) / (mu_2 - mu_1),       f(t) = ((1 - e^(-mu_1 t)) / mu_1 - h) / mu_2 = int_0^t h,
    x~ = x_0 + u_0 h + F f,      l = p - x_0 + v t - u_0 h - F f,      l' = v - u_0 e^(-mu_2 t) - (F - mu_1 u_0) h,

each from the exponentials of -mu_1 t and -(mu_2 - mu_1) t less one, so that no digits are lost anywhere.

**First crossing.** 0 <= e^(-mu_2 t) <= 1, and h is never above (mu_1 + mu_2) / (mu_2 (mu_2 + 3 mu_1)): its maximum
is r^(-1 / (r - 1)) / mu_2 at r = mu_2 / mu_1, where ln r >= 2 (r - 1) / (r + 1) and e^-x <= 1 / (1 + x). Also
e^(-mu_2 t) and (mu_2 - mu_1) h are not negative and add to e^(-mu_1 t) <= 1. Either bounds l' from above; if that is
negative, l has one zero and it is the contact. Any over-damped plant at rest with D >= 0, c > 0 passes.

**Root.** f = t^2 / (2 + (mu_1 + mu_2) t + mu_1 mu_2 t^2) has the right limits for short and long times; one step of
Newton with it starts from the time after which steady motion would meet. Two steps of Householder's third order follow.
The second is proved: |x~^(k)| <= mu_1^(k-2) |x~''| + (k - 2) mu_2^(k-3) |x~''' + mu_1 x~''| at one time bounds what its
Taylor polynomial leaves out. What is not proved close goes on alone between two bounds, until the same proof holds;
where l' < 0 is not proved the encounter is left open, for the guaranteed path.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .blocks import BLOCK, exponential, load_row, rough_exponential
from .compiler import block_kernel, block_part, kernel

__all__ = ["OPEN", "contact_times", "decay_rates"]

OPEN = -1
_PROVED = -2  # l' < 0 is proved, the root is not yet
_TOLERANCE = 1e-11
_LEAST_APPROACH = 1e-6  # of |v| + |u_0|, far above rounding
_TRIES = 100

_M, _D, _K, _X0, _U0, _P, _V, _A, _GAIN, _TIME, _STATUS = (k * BLOCK for k in range(11))
_MU1, _MU2, _BY1, _BY2, _WIDTH, _BY_WIDTH, _GAP, _F, _SIZE = (k * BLOCK for k in range(11, 20))


@block_part
def decay_rates(mass: float, damping: float, stiffness: float, coupling: float, extra: float) -> Any:
    """Return (mu_1, mu_2, 1 / mu_1, 1 / mu_2, mu_2 - mu_1, its inverse), 1 / M, 1 / extra, and whether all are real.

    One division makes all inverses. mu_2 - mu_1 and mu_1 are kept 1e-9 and 1e-60 of the others from zero, which
    changes nothing that can be seen in a float and leaves no 0 / 0.
    """
    total = damping + coupling
    scale = total * total
    disc = (damping * damping - 4.0 * mass * stiffness) + coupling * (2.0 * damping + coupling)
    real = (disc >= -1e-15 * scale) & (total > 0.0) & (mass > 0.0) & (stiffness >= 0.0)
    root = math.sqrt(max(disc, 1e-18 * scale))  # M (mu_2 - mu_1)
    fast = 0.5 * (total + root)  # M mu_2
    product = max(mass * stiffness, 1e-60 * scale)  # M^2 mu_1 mu_2
    first, second = mass * product, root * fast
    whole = first * second
    inverse = 1.0 / (whole * extra)
    by_whole = inverse * extra
    by_first, by_second = by_whole * second, by_whole * first
    by_mass, by_fast = by_first * product, by_second * root
    rates = (
        product * by_fast * by_mass,
        fast * by_mass,
        fast * by_first * mass * mass,
        mass * by_fast,
        root * by_mass,
        mass * by_second * fast,
    )
    return rates, by_mass, inverse * whole, real


@block_part
def _approach(rates: Any, u0: float, v: float, force: float) -> Any:
    """Return the two bounds of -l' from below, the first of them times (mu_2 + 3 mu_1)."""
    mu1, mu2, _, by2, _, by_width = rates
    push, pull = max(-u0, 0.0), max(mu1 * u0 - force, 0.0)
    return (-v - push) * (mu2 + 3.0 * mu1) - pull * (mu1 + mu2) * by2, -v - max(push, pull * by_width)


@block_part
def _prepare(
    mass: float, damping: float, stiffness: float, x0: float, u0: float, p: float, v: float, a: float, coupling: float
) -> Any:
    """Return rates, l(0), F, a start for the root and whether l' < 0 is proved."""
    gap = p - x0
    below = v * (v * damping - stiffness * gap)
    rates, by_mass, by_below, real = decay_rates(mass, damping, stiffness, coupling, below)
    mu1, mu2 = rates[0], rates[1]
    force = (coupling * v - stiffness * x0) * by_mass
    weighted, plain = _approach(rates, u0, v, force)
    least = _LEAST_APPROACH * (abs(u0) - v)
    proved = real & (v < 0.0) & (gap > 0.0) & (a == 0.0) & ((weighted > least * (mu2 + 3.0 * mu1)) | (plain > least))
    total, product = mu1 + mu2, mu1 * mu2
    t = gap * (stiffness * p - (damping + coupling) * v) * by_below
    quadratic = 2.0 + (total + product * t) * t
    linear = (4.0 + total * t) * t
    value = quadratic * ((gap + v * t) * quadratic - force * t * t) - u0 * linear
    start = t - value / (v * quadratic * quadratic - force * linear - 4.0 * u0)
    return rates, gap, force, start, proved


@block_part
def _first_step(t: float, rates: Any, gap: float, v: float, u0: float, force: float) -> float:
    """One step of Householder's method of third order from t, with rough exponentials."""
    mu1, mu2, by1, by2, width, by_width = rates
    e1, m1 = rough_exponential(-mu1 * t)
    _, m = rough_exponential(-width * t)
    decay = e1 * m
    h = decay * by_width
    slope = (e1 - decay) - mu1 * h  # h'
    value = gap + v * t - u0 * h - force * ((m1 * by1 - h) * by2)
    y1 = force * h + u0 * slope
    total, product = mu1 + mu2, mu1 * mu2
    y2 = (force - total * u0) * slope - (product * u0) * h
    y3 = -total * y2 - product * y1
    l1 = v - y1
    square, turn = 6.0 * (l1 * l1), value * y2
    return t - value * (square + 3.0 * turn) / (l1 * (square + 6.0 * turn) - value * value * y3)


@block_part
def _proved_step(t: float, rates: Any, gap: float, v: float, u0: float, force: float, size: float) -> Any:
    """Make the same step with all digits; return where it ends, whether it is proved close to the root, and l(t)."""
    mu1, mu2, by1, by2, width, by_width = rates
    e1, m1 = exponential(-mu1 * t)
    _, m = exponential(-width * t)
    decay = e1 * m
    h = decay * by_width
    slope = (e1 - decay) - mu1 * h
    value = gap + v * t - u0 * h - force * ((m1 * by1 - h) * by2)
    y1 = force * h + u0 * slope
    total, product = mu1 + mu2, mu1 * mu2
    y2 = (force - total * u0) * slope - (product * u0) * h
    y3 = -total * y2 - product * y1
    y4 = -total * y3 - product * y2
    l1 = v - y1
    square, turn = 6.0 * (l1 * l1), value * y2
    bottom = l1 * (square + 6.0 * turn) - value * value * y3
    step = -value * (square + 3.0 * turn) / bottom
    rest = value + step * (l1 - step * (0.5 * y2 + step * ((1 / 6) * y3 + step * ((1 / 24) * y4))))
    end = t + step
    reach = abs(step) + 1e-10 * end
    bend, fast = abs(y2), reach * abs(y3 + mu1 * y2)
    fast_reach = mu2 * reach
    growth = 1.0 + fast_reach * (1.0 + 3.1 * fast_reach)  # above its exponential up to 4
    area = reach * fast_reach
    tail = area * area * (reach * (mu1 * bend) + 3.0 * fast) * (growth * (1 / 120))
    rounding = 4e-15 * (size - v * end + abs(u0) * h + abs(force) * (m1 * by1 + h) * by2)
    close = (
        (t > 0.0)
        & (fast_reach <= 4.0)
        & (2.0 * reach * (bend + fast) * growth <= -l1)
        & (abs(rest) + tail + rounding < _TOLERANCE * end * -l1)
    )
    return end, close, value


@block_kernel
def _solve_block(data: Any, slope: float, horizon: float, count: int) -> int:
    """Solve a block in three loops, short enough for a processor to overlap turns; return how many to refine."""
    waiting = 0
    for i in range(count):
        rates, gap, force, start, proved = _prepare(
            data[i + _M],
            data[i + _D],
            data[i + _K],
            data[i + _X0],
            data[i + _U0],
            data[i + _P],
            data[i + _V],
            data[i + _A],
            slope * data[i + _GAIN],
        )
        data[i + _MU1], data[i + _MU2], data[i + _BY1], data[i + _BY2] = rates[0], rates[1], rates[2], rates[3]
        data[i + _WIDTH], data[i + _BY_WIDTH] = rates[4], rates[5]
        data[i + _GAP], data[i + _F], data[i + _SIZE] = gap, force, gap + abs(data[i + _X0])
        data[i + _TIME] = start
        data[i + _STATUS] = _PROVED if proved else OPEN
    for i in range(count):
        rates = _kept_rates(data, i)
        data[i + _TIME] = _first_step(data[i + _TIME], rates, data[i + _GAP], data[i + _V], data[i + _U0], data[i + _F])
    for i in range(count):
        rates = _kept_rates(data, i)
        end, close, _ = _proved_step(
            data[i + _TIME], rates, data[i + _GAP], data[i + _V], data[i + _U0], data[i + _F], data[i + _SIZE]
        )
        data[i + _TIME] = end
        status = data[i + _STATUS]
        found = close & (end > 0.0) & (end <= horizon) & (status == _PROVED)
        data[i + _STATUS] = 0.0 if found else status
        waiting += (status == _PROVED) & (not found)
    return waiting


@block_part
def _kept_rates(data: Any, i: int) -> Any:
    return (
        data[i + _MU1],
        data[i + _MU2],
        data[i + _BY1],
        data[i + _BY2],
        data[i + _WIDTH],
        data[i + _BY_WIDTH],
    )


@kernel
def _refine(data: Any, i: int, horizon: float) -> Any:
    """Find the one zero of an l that is proved to fall, between two bounds; return its time and status."""
    rates, gap, force, size = _kept_rates(data, i), data[i + _GAP], data[i + _F], data[i + _SIZE]
    u0, v, t = data[i + _U0], data[i + _V], data[i + _TIME]
    weighted, plain = _approach(rates, u0, v, force)
    low, high = 0.0, 1.001 * gap / max(weighted / (rates[1] + 3.0 * rates[0]), plain)
    if high > horizon:
        high = horizon
        if not _proved_step(horizon, rates, gap, v, u0, force, size)[2] <= 0.0:
            return math.nan, OPEN
    if not low < t < high:
        t = min(gap / (abs(u0) - v), 0.5 * high)
    for k in range(_TRIES):
        end, close, value = _proved_step(t, rates, gap, v, u0, force, size)
        if close:
            return (end, 0) if 0.0 < end <= horizon else (math.nan, OPEN)
        if value > 0.0:
            low = t
        else:
            high = t
        slow = k % 4 == 3  # halves what steps of no use would leave as it is
        t = end if low < end < high and not slow else 0.5 * (low + high)
    return math.nan, OPEN


@kernel
def _refine_block(data: Any, time: Any, status: Any, horizon: float) -> None:
    """Go on with the encounters of a block whose root waits for its proof."""
    for i in range(time.size):
        if status[i] == _PROVED:
            time[i], status[i] = _refine(data, i, horizon)


@kernel
def contact_times(
    inputs: Any,
    slope: float,
    horizon: float,
    time: Any,
    status: Any,
) -> None:
    """Find first contacts of M x~'' + (D + c) x~' + K x~ = c (v + a t), c = slope gain, l = p + v t + a t^2 / 2 - x~.

    Args:
        inputs: M [kg], D [N s/m], K [N/m], x~(0) [m], x~'(0) [m/s], position [m], velocity [m/s] and acceleration
            [m/s^2] of the obstacle relative to the reference, and D_p [N s]: nine arrays, (n,) or (1,), contiguous.
        slope: g [1/m], one number.
        horizon: latest time of contact [s].
        time: filled with the times of contact [s], shape (n,); no number where the status is OPEN.
        status: filled with 0 (contact, proved to be the first, to 2e-11 of its time) or OPEN, shape (n,), int8.
    """
    data = np.empty(20 * BLOCK)
    for start in range(0, time.size, BLOCK):
        stop = min(start + BLOCK, time.size)
        load_row(data, _M, inputs[0], start, stop)
        load_row(data, _D, inputs[1], start, stop)
        load_row(data, _K, inputs[2], start, stop)
        load_row(data, _X0, inputs[3], start, stop)
        load_row(data, _U0, inputs[4], start, stop)
        load_row(data, _P, inputs[5], start, stop)
        load_row(data, _V, inputs[6], start, stop)
        load_row(data, _A, inputs[7], start, stop)
        load_row(data, _GAIN, inputs[8], start, stop)
        waiting = _solve_block(data, slope, horizon, stop - start)
        times, states = time[start:stop], status[start:stop]
        for i in range(times.size):
            times[i] = data[_TIME + i] if data[_STATUS + i] == 0.0 else math.nan
        for i in range(states.size):
            states[i] = np.int8(np.int32(data[_STATUS + i]))
        if waiting > 0:
            _refine_block(data, times, states, horizon)
