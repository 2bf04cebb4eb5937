"""The linear loop once more, from one reading to the next, by the pieces of time between which no force changes.

It shares no code with `pretouch.simulation.linear_loop`: no pulses, no transfer function, no crossovers.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import expm

import pretouch as pt
from pretouch._core.numbers import FloatArray
from pretouch.simulation.robot import linear_plant


def lifted_loop(
    admittance: pt.Admittance, timing: pt.simulation.LoopTiming, damping: float, plant: Any = None
) -> FloatArray:
    """What a period makes of the plant at the start of an exposure, the forces of earlier readings, the last one."""
    system, push, output = linear_plant(admittance, plant or pt.simulation.IdealPlant())
    n, period, hold = len(push), timing.period, timing.holding
    exposure = min(timing.exposure, period)
    start = timing.delay + timing.exposure / 2  # of a force, after the start of its exposure
    m = max(math.ceil((start + hold) / period - 1e-12), 1) + 1
    changes = [start - j * period + after for j in range(m + 1) for after in (0.0, hold)]
    inside = [c for c in changes if 0 < c < period and abs(c - exposure) > 1e-13 * period]
    ends = sorted({0.0, exposure, period, *inside})
    block = np.zeros((n + 2, n + 2))  # the state, the integral of the position, a constant force
    block[:n, :n], block[n, :n], block[:n, n + 1] = system, output, push
    grown = np.eye(n + 1, n + m + 1)  # of the state at the start and of the forces u_0 ... u_m
    grown[n] = 0.0
    reading = np.concatenate([output, np.zeros(m + 1)])
    for left, right in pairwise(ends):
        step, middle = expm(block * (right - left)), (left + right) / 2
        acting = [float(start - j * period < middle < start - j * period + hold) for j in range(m + 1)]
        grown = step[: n + 1, : n + 1] @ grown + np.outer(step[: n + 1, n + 1], [*np.zeros(n), *acting])
        if right == exposure:
            reading = grown[n] / exposure
    now = np.zeros(n + m + 1)  # the new force, of the state, of u_1 ... u_m and of the last reading
    now[:-1] = -damping / hold * np.delete(reading, n)
    now[-1] = damping / hold
    matrix = np.zeros((n + m + 1, n + m + 1))
    matrix[:n, : n + m] = np.delete(grown[:n], n, axis=1)
    matrix[:n] += np.outer(grown[:n, n], now)
    matrix[n] = now
    matrix[n + 1 : n + m, n : n + m - 1] = np.eye(m - 1)
    matrix[n + m, : n + m] = np.delete(reading, n)
    return matrix


def lifted_radius(
    admittance: pt.Admittance, timing: pt.simulation.LoopTiming, damping: float, plant: Any = None
) -> float:
    """The spectral radius of the loop, without the eigenvalue of 1 of a position that nothing holds."""
    values = np.linalg.eigvals(lifted_loop(admittance, timing, damping, plant))
    if admittance.stiffness == 0:
        values = np.delete(values, np.argmin(np.abs(values - 1)))
    return float(np.abs(values).max())
