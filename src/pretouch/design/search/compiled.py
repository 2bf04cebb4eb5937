"""Call compiled code that finds the optimal gain of each encounter."""

from __future__ import annotations

import math
from ctypes import byref, c_int
from typing import Any, Final

import numpy as np

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import FloatArray, positive
from pretouch.motion import DAMPER, Scenario
from pretouch.motion.curve import Curves, curve_windows, farthest, shared_curve
from pretouch.motion.kernels import of_core
from pretouch.motion.parallel import run_in_chunks
from pretouch.motion.request import choose_method
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

from ..impact import ElasticImpact
from ..later_contact import falls
from ..objectives import Objective
from ..problem import GainProblem

_ROWS: Final = {
    "time": 0,
    "displacement": 1,
    "velocity": 2,
    "acceleration": 3,
    "relative_velocity": 4,
    "virtual_force": 5,
}
_LEAST_LINEAR: Final = 128  # smallest number of designs per thread
_LEAST_SERIES: Final = 16
_MOST: Final = 4096

find_gains: Final = kernel(
    *("find_gains", POINTER, INTEGER, DOUBLE, POINTER, c_int, DOUBLE, POINTER, INTEGER), *([DOUBLE] * 5), POINTER
)
"""Compiled search; its arguments are declared in native/core/pretouch.h."""


def search_compiled(problem: GainProblem) -> FloatArray | None:
    """Find the optimal gain of each encounter by a search in compiled code.

    Args:
        problem: the problem, with one encounter or an array of encounters.

    Returns:
        Gain [N s], objective and certainty (1 or 0) of each encounter, shape (3, n). None if there is no encounter, or
        if the compiled search does not support the problem: constraints, quantities of the whole motion, evaluators.
    """
    rows, size = supported_terms(problem), math.prod(problem.task.scenario.shape)
    if rows is None:
        return None
    linear = choose_method(problem.task.scenario, problem.task.sensor, problem.task.method) == "closed-form"
    horizon, terms = positive(problem.task.horizon, "horizon", "s"), np.array(rows)
    if size == 0:
        return None
    axis, inputs = problem.axis, _inputs(problem.task.scenario, size)
    slope, *curve, _held = _curve(problem.task.sensor, farthest(problem.task.scenario, problem.task.sensor), linear)
    ends = (axis.scale, math.asinh(axis.low / axis.scale), math.asinh(axis.high / axis.scale), axis.low, axis.high)
    arguments = (slope, *curve, horizon, address(terms), len(terms), *ends)
    out = np.empty((3, size))

    def run(start: int, stop: int) -> None:
        whole = stop - start == size
        part = inputs if whole else np.ascontiguousarray(inputs[:, start:stop])
        result = out if whole else np.empty((3, stop - start))
        find_gains(address(part), stop - start, *arguments, address(result))
        if not whole:
            out[:, start:stop] = result

    run_in_chunks(run, size, least=_LEAST_LINEAR if linear else _LEAST_SERIES, most=_MOST)
    return out


def supported_terms(problem: GainProblem) -> list[tuple[float, float, float, float]] | None:
    """Return the terms of the objective for the compiled search; None if that search cannot solve the problem."""
    if problem.task.evaluate is not None or problem.task.constraints or problem.task.sensor.valid_range[0] > 0:
        return None
    other_motion = problem.task.law != DAMPER or problem.task.method == "uniform-motion"
    if other_motion or type(problem.task.goal) is not Objective:
        return None
    rows: list[tuple[float, float, float, float]] = []
    for term in problem.task.goal.terms:
        factor, exponent, quantity, scale = 1.0, 2.0, term.quantity, term.scale
        if quantity == "impact_force" and isinstance(problem.task.impact, ElasticImpact):
            factor, quantity = problem.task.impact.peak_force(1.0), "relative_velocity"
            exponent = 2 * problem.task.impact.speed_exponent
        row, follows = _ROWS.get(quantity), isinstance(scale, str)
        # If the scale is the obstacle's speed, this speed must not be 0.
        if row is None or (follows and not np.all(np.asarray(problem.task.scenario.obstacle.velocity) != 0)):
            return None
        rows.append((row, term.weight * (factor if isinstance(scale, str) else factor / scale) ** 2, exponent, follows))
    return rows


def _inputs(scenario: Scenario, size: int) -> FloatArray:
    """Return the ten numbers that describe each encounter for the compiled search, relative to the reference motion."""
    columns = scenario.relative_columns()
    if scenario.shape == ():
        return np.array(columns).reshape(10, 1)
    inputs = np.empty((10, size))
    for row, column in zip(inputs, columns, strict=True):
        row[:] = np.broadcast_to(column, scenario.shape).reshape(-1)
    return inputs


@cache_by_curve(256)
def _curve(sensor: SensorModel, reach: float, linear: bool) -> tuple[float, Any, bool, Curves | None]:
    """Return the sensor curve for the compiled search, and the slope g of this curve at contact [1/m]."""
    # The other results are a pointer to the curve and whether g < 0 up to `reach` [m].
    curve = None if linear else shared_curve(curve_windows(sensor, 0.0, reach))
    read = None if curve is None else byref(of_core(curve, 1))
    return float(sensor.log_slope(0.0)), read, falls(sensor, reach), curve
