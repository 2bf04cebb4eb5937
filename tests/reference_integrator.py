"""An independent integration of L(1) with L(2): an explicit Runge-Kutta method of order 8, NumPy and SciPy's table.

It shares nothing with the kernels: other variables (the force from g itself, not from a polynomial of it), another
method, fixed steps, all encounters in lockstep. Coefficients: Dormand and Prince's of order 8, as SciPy publishes them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.integrate import DOP853
from scipy.interpolate import CubicSpline

from pretouch.motion import Scenario
from pretouch.sensors import MittagLeffler, SensorModel

_KNOTS = 20_000


def _step(slope: Callable, s: np.ndarray, h: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return y after a step; `slope` returns the derivatives of both rows of y."""
    stage = np.empty((DOP853.n_stages, *y.shape))
    rows = stage.reshape(DOP853.n_stages, -1)
    for i in range(DOP853.n_stages):
        there = y + h * (DOP853.A[i, :i] @ rows[:i]).reshape(y.shape) if i else y
        stage[i, 0], stage[i, 1] = slope(s + DOP853.C[i] * h, there)
    return y + h * (DOP853.B @ rows).reshape(y.shape)


@lru_cache(maxsize=4)
def _log_slope(sensor: SensorModel) -> Callable:
    """Return g, from a spline where the curve's own function takes a hundred times as long, good to 1e-12.

    Raises:
        ValueError: the spline is further from g halfway between its knots, where it is furthest.
    """
    if not isinstance(sensor, MittagLeffler):
        return sensor._log_slope  # without the checks of its arguments: the caller stays within the range
    low, high = sensor.valid_range
    knots = np.linspace(low, min(high, low + 1.0), _KNOTS)
    if high > low + 1.0:
        knots = np.append(knots, np.geomspace(low + 1.0, min(high, low + 1e3), _KNOTS)[1:])
    spline = CubicSpline(knots, sensor.log_slope(knots))
    between = (knots[:-1] + knots[1:]) / 2
    worst = np.max(np.abs(spline(between) / sensor.log_slope(between) - 1))
    if worst > 1e-12:
        raise ValueError(f"a spline of g is off by {worst:.1e}; take more knots")

    def slope(distance: np.ndarray) -> np.ndarray:
        found = spline(distance)
        beyond = distance > knots[-1]
        if beyond.any():
            found[beyond] = sensor.log_slope(distance[beyond])
        return found

    return slope


def _acceleration(scenario: Scenario, sensor: SensorModel, gain: np.ndarray) -> Callable:
    m, d, k, _, _, p, v, a, _, _ = np.moveaxis(scenario.relative(), -1, 0)
    low, high = sensor.valid_range
    slope = _log_slope(sensor)

    def relative_acceleration(t: np.ndarray, distance: np.ndarray, speed: np.ndarray) -> np.ndarray:
        g = slope(np.fmin(np.fmax(distance, low), high))  # NaN, from an overflow, becomes `low`
        xo, vo = p + (v + a * t / 2) * t, v + a * t
        return a + (d * (vo - speed) + k * (xo - distance) - gain * g * speed) / m

    return relative_acceleration


def integrate(scenario: Scenario, sensor: SensorModel, gain: np.ndarray, end: np.ndarray, steps: int) -> dict:
    """Integrate (l, l') over time, from 0 to `end` [s] in equal steps; outside its valid range g stays as at its end.

    Returns:
        l and l' at the end, the smallest l at any step before the last, the largest |x - x_d| and |x'| at the steps.
    """
    _, _, _, x0, u0, p, v, a, rv, ra = np.moveaxis(scenario.relative(), -1, 0)
    acceleration = _acceleration(scenario, sensor, gain)
    h = end / steps
    y = np.stack([p - x0, v - u0])
    smallest, excursion, speed = y[0].copy(), np.abs(x0), np.abs(u0 + rv)
    with np.errstate(all="ignore"):  # steps too long for a stiff encounter overflow; halving them tells
        for n in range(steps):
            if n:
                smallest = np.minimum(smallest, y[0])
            y = _step(lambda t, z: (z[1], acceleration(t, z[0], z[1])), n * h, h, y)
            t = (n + 1) * h
            excursion = np.maximum(excursion, np.abs(p + (v + a * t / 2) * t - y[0]))
            speed = np.maximum(speed, np.abs(v + a * t - y[1] + rv + ra * t))
    return {"distance": y[0], "relative_velocity": y[1], "smallest": smallest, "excursion": excursion, "speed": speed}


def integrate_over_distance(scenario: Scenario, sensor: SensorModel, gain: np.ndarray, steps: int) -> dict:
    """Integrate (t, l') over l from l(0) down to 0, from knot to knot, so that no step passes one.

    Returns:
        Time and l' at contact, and whether l' stayed negative all along, without which l is no clock.
    """
    _, _, _, x0, u0, p, v, _, _, _ = np.moveaxis(scenario.relative(), -1, 0)
    acceleration = _acceleration(scenario, sensor, gain)
    y = np.stack([np.zeros_like(p), v - u0])
    monotone = y[1] < 0
    edges = np.array([*sensor.knots[::-1], 0.0])
    here = p - x0
    with np.errstate(all="ignore"):
        for edge in edges:
            there = np.minimum(here, edge)
            h = (there - here) / steps
            for n in range(steps):
                y = _step(lambda s, z: (1 / z[1], acceleration(z[0], s, z[1]) / z[1]), here + n * h, h, y)
                monotone &= y[1] < 0
            here = there
    return {"time": y[0], "relative_velocity": y[1], "monotone": monotone}
