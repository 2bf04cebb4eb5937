"""The largest demands on the robot until the contacts that linear_block finds: the closed form on vectors.

Every derivative of x~ is a free response, with B = F - mu_1 u_0 and the functions of linear_block

    x~' = u_0 e_2 + B h,      x~'' = A e_2 - mu_1 B h,      x~''' = J e_2 + mu_1^2 B h,

A and J being x~'' and x~''' at the start. As h / e_2 = (e^((mu_2 - mu_1) t) - 1) / (mu_2 - mu_1) only grows, a response
y e_2 + b h has at most one zero, where h / e_2 = r = -y / b is positive, at

    t = ln(1 + (mu_2 - mu_1) r) / (mu_2 - mu_1),

which nothing makes singular. So x~, x~' and x~'' have at most one peak each inside the motion, and the largest
magnitude is that at the start, at the peak or at the end. A peak is flat: 1e-9 in its time is 1e-18 in its height, and
whatever the time that rounding leaves, no value that the motion does not reach is reported.

A reference that moves adds a line to x~; its peaks are then two, and they are left to the lanes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .blocks import BLOCK, exponential, load_row, rough_logarithm
from .compiler import block_kernel, block_part, kernel
from .linear_block import decay_rates

__all__ = ["PEAK_ROWS", "largest_demands"]

PEAK_ROWS = (
    "largest_excursion",
    "largest_travel",
    "largest_speed",
    "largest_acceleration",
    "largest_virtual_force",
)
_M, _D, _K, _X0, _U0, _V, _GAIN, _DRIFT, _PULL, _TIME, _OUT = (k * BLOCK for k in range(11))


@block_part
def _responses(t: float, rates: Any) -> Any:
    """Return e_2, h and f at t; f by its series where t is short."""
    mu1, mu2, by1, by2, width, by_width = rates
    e1, m1 = exponential(-mu1 * t)
    _, m = exponential(-width * t)
    decay = e1 * m
    h = decay * by_width
    z, w = -(mu1 + mu2) * t, mu1 * mu2 * t * t
    s2 = z * z - w
    s3 = z * s2 - w * z
    s4 = z * s3 - w * s2
    early = (0.5 + (1 / 6) * z) + ((1 / 24) * s2 + (1 / 120) * s3) + ((1 / 720) * s4 + (1 / 5040) * (z * s4 - w * s3))
    f = t * t * early if mu2 * t < 0.02 else (m1 * by1 - h) * by2
    return e1 - decay, h, f


@block_part
def _moment(ratio: float, rates: Any, end: float) -> float:
    """Return when h / e_2 is a ratio; 0 where that is not between the start and the end."""
    t = rates[5] * rough_logarithm(rates[4] * ratio)
    return t if (ratio > 0.0) & (t < end) else 0.0


@block_part
def _larger(first: float, second: float) -> float:
    return first if first > second else second


@block_kernel
def _peaks_block(data: Any, slope: float, count: int) -> None:
    """Fill five rows from _OUT on with PEAK_ROWS."""
    for i in range(count):
        x0, u0, v, end = data[i + _X0], data[i + _U0], data[i + _V], data[i + _TIME]
        drift, pull = data[i + _DRIFT], data[i + _PULL]
        coupling = slope * data[i + _GAIN]
        rates, by_mass, _, _ = decay_rates(data[i + _M], data[i + _D], data[i + _K], coupling, 1.0)
        mu1, by1 = rates[0], rates[2]
        total, product = mu1 + rates[1], mu1 * rates[1]
        force = (coupling * v - data[i + _K] * x0) * by_mass
        b, start = force - mu1 * u0, force - total * u0
        jerk, by_b = -total * start - product * u0, 1.0 / b
        _, h, f = _responses(_moment(-u0 * by_b, rates, end), rates)
        e, g, _ = _responses(_moment(start * by1 * by_b, rates, end), rates)
        e3, g3, _ = _responses(_moment(-jerk * by1 * by1 * by_b, rates, end), rates)
        e4, h4, f4 = _responses(end, rates)
        way, way4 = u0 * h + force * f, u0 * h4 + force * f4
        fast, fast4 = u0 * e + b * g, u0 * e4 + b * h4
        bend, bend4 = start * e3 - mu1 * b * g3, start * e4 - mu1 * b * h4
        data[i + _OUT] = _larger(abs(x0), _larger(abs(x0 + way), abs(x0 + way4)))
        travel = _larger(abs(way), abs(way4))
        speed = _larger(abs(u0 + drift), _larger(abs(fast + drift), abs(fast4 + drift)))
        data[i + _OUT + BLOCK] = travel if (drift == 0.0) & (pull == 0.0) else math.nan
        data[i + _OUT + 2 * BLOCK] = speed if pull == 0.0 else math.nan
        data[i + _OUT + 3 * BLOCK] = _larger(abs(start + pull), _larger(abs(bend + pull), abs(bend4 + pull)))
        data[i + _OUT + 4 * BLOCK] = abs(coupling) * _larger(abs(v - u0), _larger(abs(v - fast), abs(v - fast4)))


@kernel
def largest_demands(
    inputs: Any,
    drift: Any,
    pull: Any,
    slope: float,
    time: Any,
    status: Any,
    out: Any,
    first: int,
) -> None:
    """Fill columns of out, shape (5, m), with PEAK_ROWS until the times that linear_block.contact_times has found.

    Args:
        inputs: those of linear_block.contact_times; the acceleration of the reference is that of the obstacle.
        drift: velocity of the reference at t = 0 [m/s].
        pull: its acceleration [m/s^2].
        slope: g [1/m], one number.
        time: what contact_times has found, shape (n,).
        status: 0 or OPEN, as contact_times has left it, shape (n,).
        out: max |x~| [m], |x - x(0)| [m], |x'| [m/s], |x''| [m/s^2] and |F_p| [N]; nan where OPEN or not settled.
        first: the column of out that the first encounter takes.
    """
    data = np.empty(15 * BLOCK)
    for start in range(0, time.size, BLOCK):
        stop = min(start + BLOCK, time.size)
        load_row(data, _M, inputs[0], start, stop)
        load_row(data, _D, inputs[1], start, stop)
        load_row(data, _K, inputs[2], start, stop)
        load_row(data, _X0, inputs[3], start, stop)
        load_row(data, _U0, inputs[4], start, stop)
        load_row(data, _V, inputs[6], start, stop)
        load_row(data, _GAIN, inputs[8], start, stop)
        load_row(data, _DRIFT, drift, start, stop)
        load_row(data, _PULL, pull, start, stop)
        load_row(data, _TIME, time, start, stop)
        _peaks_block(data, slope, stop - start)
        for k in range(5):
            part = out[k, first + start : first + stop]
            for i in range(part.size):
                part[i] = data[_OUT + k * BLOCK + i] if status[start + i] == 0 else math.nan
