"""States at the contacts that linear_block finds, and their exact derivatives, on vectors.

With e_1, e_2 the exponentials of -mu_1 t, -mu_2 t and * the convolution over [0, t], h = e_1 * e_2 and f = 1 * h, the
sensitivity S of x~ to a coefficient is again a forced motion from rest, M S'' + (D + c) S' + K S = -x~'' (to M), -x~'
(to D), -x~ (to K), v - x~' (to c = g D_p): a convolution of h / M with what stands on the right. All that x~ is made of
are 1, h, h' and f, so all that is needed are

    j = h * h,      h * h' = j' = e_2 * h - mu_1 j,      h * f = (f * e_1 - j) / mu_2,      1 * f,

which quotients by mu_2 - mu_1 and mu_1 give away from zero and the functions phi_m of the exponential near it. At the
contact l(t, q) = 0, so dt/dq = -(dl/dq) / l', and any quantity y there changes by dy/dq + y' dt/dq.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .blocks import BLOCK, exponential_parts, load_row
from .compiler import block_kernel, block_part, kernel
from .linear_block import decay_rates

__all__ = ["GRADIENT_INPUTS", "GRADIENT_OUTPUTS", "STATE_ROWS", "contact_gradients", "contact_states"]

STATE_ROWS = (
    "displacement",
    "displacement_velocity",
    "displacement_acceleration",
    "relative_velocity",
    "displacement_integral",
)
GRADIENT_OUTPUTS = ("time", "displacement", "relative_velocity")
GRADIENT_INPUTS = ("mass", "damping", "stiffness", "x0", "u0", "p", "v", "a", "gain", "slope")

_M, _D, _K, _X0, _U0, _P, _V, _A, _GAIN, _TIME, _OUT = (k * BLOCK for k in range(11))


@block_part
def _early(t: float, z: float, w: float) -> Any:
    """Return f and 1 * f by their series in z = -(mu_1 + mu_2) t and w = mu_1 mu_2 t^2, for short t."""
    s2 = z * z - w
    s3 = z * s2 - w * z
    s4 = z * s3 - w * s2
    s5 = z * s4 - w * s3
    s6 = z * s5 - w * s4
    f = (0.5 + (1 / 6) * z) + ((1 / 24) * s2 + (1 / 120) * s3) + ((1 / 720) * s4 + ((1 / 5040) * s5 + (1 / 40320) * s6))
    last = (1 / 5040) * s4 + ((1 / 40320) * s5 + (1 / 362880) * s6)
    return t * t * f, t * t * t * (((1 / 6) + (1 / 24) * z) + ((1 / 120) * s2 + (1 / 720) * s3) + last)


@block_part
def _functions(t: float, rates: Any) -> Any:
    """Return h, h', f, 1 * f, and e_2 * h, h * h, h * f, which the derivatives need."""
    mu1, mu2, by1, by2, width, by_width = rates
    total = mu1 + mu2
    e1, m1, p1, _, near1 = exponential_parts(-mu1 * t)
    e, m, p, cubic, near = exponential_parts(-width * t)
    decay, square, x, x1 = e1 * m, t * t, width * t, mu1 * t
    h = decay * by_width
    e2 = e1 * e
    slope = e2 - mu1 * h
    f = (m1 * by1 - h) * by2
    second = square * p1 if near1 else (t - m1 * by1) * by1  # 1 * 1 * e_1
    ramp = square * (1.0 - (1.0 + x1) * p1) if near1 else (m1 * by1 - t * e1) * by1  # 1 * e_1 * e_1
    late = e1 * square
    fast = late * (1.0 - (1.0 + x) * p) if near else (h - t * e2) * by_width  # e_2 * h
    slow = late * p if near else (t * e1 - h) * by_width  # e_1 * h
    twice = late * t * (0.5 - (x + 2.0) * cubic) if near else (t * (e1 + e2) - 2.0 * h) * by_width * by_width
    f3 = (second - f) * by2
    early, early3 = _early(t, -total * t, mu1 * mu2 * square)
    short = mu2 * t < 0.03
    f, f3 = early if short else f, early3 if short else f3
    return h, slope, f, f3, fast, twice, ((ramp - slow) * by2 - twice) * by2


@block_kernel
def _states_block(data: Any, slope: float, count: int) -> None:
    """Fill five rows from _OUT on with STATE_ROWS."""
    for i in range(count):
        mass, stiffness, x0, u0, v, t = (
            data[i + _M],
            data[i + _K],
            data[i + _X0],
            data[i + _U0],
            data[i + _V],
            data[i + _TIME],
        )
        coupling = slope * data[i + _GAIN]
        rates, by_mass, _, _ = decay_rates(mass, data[i + _D], stiffness, coupling, 1.0)
        force = (coupling * v - stiffness * x0) * by_mass
        h, h1, f, f3, _, _, _ = _functions(t, rates)
        velocity = force * h + u0 * h1
        data[i + _OUT] = x0 + u0 * h + force * f
        data[i + _OUT + BLOCK] = velocity
        data[i + _OUT + 2 * BLOCK] = (force - (rates[0] + rates[1]) * u0) * h1 - rates[0] * rates[1] * u0 * h
        data[i + _OUT + 3 * BLOCK] = v - velocity
        data[i + _OUT + 4 * BLOCK] = x0 * t + u0 * f + force * f3


@block_part
def _keep(data: Any, at: int, of_distance: float, of_speed: float, fixed: float, state: Any) -> None:
    """Write the derivatives of t, x~ and l' to one input, from those of -l, -l' at a fixed time and those of x_o."""
    velocity, bend, by_speed = state
    time = of_distance * by_speed
    data[at] = time
    data[at + 10 * BLOCK] = of_distance + fixed + velocity * time
    data[at + 20 * BLOCK] = -of_speed - bend * time


@block_kernel
def _gradients_block(data: Any, slope: float, count: int) -> None:
    """Fill thirty rows from _OUT on: derivatives of GRADIENT_OUTPUTS, ten rows each, to GRADIENT_INPUTS."""
    for i in range(count):
        stiffness, x0, u0, v, t = data[i + _K], data[i + _X0], data[i + _U0], data[i + _V], data[i + _TIME]
        gain = data[i + _GAIN]
        coupling = slope * gain
        rates, by_mass, _, _ = decay_rates(data[i + _M], data[i + _D], stiffness, coupling, 1.0)
        total, product = rates[0] + rates[1], rates[0] * rates[1]
        force = (coupling * v - stiffness * x0) * by_mass
        h, h1, f, f3, fast, j, jf = _functions(t, rates)
        j1 = fast - rates[0] * j
        j2 = h - total * j1 - product * j
        start = force - total * u0  # x~''(0)
        velocity, bend = force * h + u0 * h1, start * h1 - product * u0 * h
        state = (velocity, bend, 1.0 / (v - velocity))
        at = i + _OUT
        damp, damp1 = -by_mass * (force * j + u0 * j1), -by_mass * (force * j1 + u0 * j2)
        inertia, inertia1 = start * j1 - product * u0 * j, start * j2 - product * u0 * j1
        _keep(data, at, -by_mass * inertia, -by_mass * inertia1, 0.0, state)
        _keep(data, at + BLOCK, damp, damp1, 0.0, state)
        spring, spring1 = x0 * f + u0 * j + force * jf, x0 * h + u0 * j1 + force * j
        _keep(data, at + 2 * BLOCK, -by_mass * spring, -by_mass * spring1, 0.0, state)
        _keep(data, at + 3 * BLOCK, 1.0 - product * f, -product * h, 0.0, state)
        _keep(data, at + 4 * BLOCK, h, h1, 0.0, state)
        _keep(data, at + 5 * BLOCK, -1.0, 0.0, 1.0, state)
        push = coupling * by_mass
        _keep(data, at + 6 * BLOCK, push * f - t, push * h - 1.0, t, state)
        half = 0.5 * t * t
        _keep(data, at + 7 * BLOCK, push * f3 - half, push * f - t, half, state)
        couple, couple1 = damp + v * by_mass * f, damp1 + v * by_mass * h
        _keep(data, at + 8 * BLOCK, slope * couple, slope * couple1, 0.0, state)
        _keep(data, at + 9 * BLOCK, gain * couple, gain * couple1, 0.0, state)


@block_part
def _load(
    data: Any,
    inputs: Any,
    time: Any,
    start: int,
    stop: int,
) -> None:
    load_row(data, _M, inputs[0], start, stop)
    load_row(data, _D, inputs[1], start, stop)
    load_row(data, _K, inputs[2], start, stop)
    load_row(data, _X0, inputs[3], start, stop)
    load_row(data, _U0, inputs[4], start, stop)
    load_row(data, _P, inputs[5], start, stop)
    load_row(data, _V, inputs[6], start, stop)
    load_row(data, _A, inputs[7], start, stop)
    load_row(data, _GAIN, inputs[8], start, stop)
    load_row(data, _TIME, time, start, stop)


@block_part
def _store(data: Any, row: int, part: Any, status: Any) -> None:
    """Copy a row to its place; what is OPEN gets no number."""
    for i in range(part.size):
        part[i] = data[row + i] if status[i] == 0 else np.nan


@kernel
def contact_states(
    inputs: Any,
    slope: float,
    time: Any,
    status: Any,
    out: Any,
    first: int,
) -> None:
    """Fill columns of out, shape (5, m), with STATE_ROWS at the times that contact_times has found for the same inputs.

    Args:
        inputs: those of contact_times.
        slope: g [1/m], one number.
        time: what contact_times has found, shape (n,).
        status: 0 or OPEN, as contact_times has left it, shape (n,).
        out: x~ [m], x~' [m/s], x~'' [m/s^2], l' [m/s] and the integral of x~ over [0, t] [m s]; nan where OPEN.
        first: the column of out that the first encounter takes.
    """
    data = np.empty(15 * BLOCK)
    for start in range(0, time.size, BLOCK):
        stop = min(start + BLOCK, time.size)
        _load(data, inputs, time, start, stop)
        _states_block(data, slope, stop - start)
        states = status[start:stop]
        for k in range(5):
            _store(data, _OUT + k * BLOCK, out[k, first + start : first + stop], states)


@kernel
def contact_gradients(
    inputs: Any,
    slope: float,
    time: Any,
    status: Any,
    out: Any,
) -> None:
    """Fill out, shape (3, 10, n), with the derivatives of GRADIENT_OUTPUTS at contact to GRADIENT_INPUTS.

    Args:
        inputs: those of contact_times.
        slope: g [1/m], one number.
        time: what contact_times has found, shape (n,).
        status: 0 or OPEN, as contact_times has left it, shape (n,).
        out: derivatives in SI units; nan where OPEN.
    """
    data = np.empty(40 * BLOCK)
    for start in range(0, time.size, BLOCK):
        stop = min(start + BLOCK, time.size)
        _load(data, inputs, time, start, stop)
        _gradients_block(data, slope, stop - start)
        states = status[start:stop]
        for q in range(3):
            for k in range(10):
                _store(data, _OUT + (10 * q + k) * BLOCK, out[q, k, start:stop], states)
