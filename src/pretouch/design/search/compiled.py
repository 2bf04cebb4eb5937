"""The compiled search for optimal gains: which problems it takes, and its call."""

from __future__ import annotations

import math
from ctypes import byref, c_int
from typing import Any, Final

import numpy as np

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import FloatArray, positive
from pretouch.motion import Scenario
from pretouch.motion.native_lanes import of_core
from pretouch.motion.parallel import for_stretches
from pretouch.motion.request import checked_method
from pretouch.motion.windows import Curves, alone, curve_windows, farthest
from pretouch.sensors import SensorModel
from pretouch.sensors.kept import kept_by_curve

from ..bound import falls
from ..impact import ElasticImpact
from ..objectives import Objective
from ..problem import GainProblem

__all__ = ["find_gains", "known_terms", "search_compiled"]

_ROWS: Final = {
    "time": 0,
    "displacement": 1,
    "velocity": 2,
    "acceleration": 3,
    "relative_velocity": 4,
    "virtual_force": 5,
}
_LEAST_LINEAR: Final = 128  # designs that are worth a thread
_LEAST_SERIES: Final = 16
_MOST: Final = 4096

find_gains: Final = kernel(
    *("find_gains", POINTER, INTEGER, DOUBLE, POINTER, c_int, DOUBLE, POINTER, INTEGER), *([DOUBLE] * 5), POINTER
)
"""Of addresses and numbers, as native/core/pretouch.h declares it."""


def search_compiled(problem: GainProblem) -> FloatArray | None:
    """Find the optimal gains of encounters, each alone, in compiled code.

    Args:
        problem: the problem, with one encounter or an array of them.

    Returns:
        The gain [N s] and the objective of each encounter and 1 where both are known for certain, shape (3, n); or None
        where a problem asks for what this search does not know: constraints, quantities of the whole motion, another
        evaluator; or there is no encounter.
    """
    found, size = known_terms(problem), math.prod(problem.task.scenario.shape)
    if found is None:
        return None
    linear = checked_method(problem.task.scenario, problem.task.sensor, problem.task.method) == "closed-form"
    horizon, terms = positive(problem.task.horizon, "horizon", "s"), np.array(found)
    if size == 0:
        return None
    axis, inputs = problem.axis, _inputs(problem.task.scenario, size)
    slope, *curve, _held = _curve(problem.task.sensor, farthest(problem.task.scenario, problem.task.sensor), linear)
    ends = (axis.scale, math.asinh(axis.low / axis.scale), math.asinh(axis.high / axis.scale), axis.low, axis.high)
    wanted = (slope, *curve, horizon, address(terms), len(terms), *ends)
    out = np.empty((3, size))

    def run(start: int, stop: int) -> None:
        whole = stop - start == size
        part = inputs if whole else np.ascontiguousarray(inputs[:, start:stop])
        found = out if whole else np.empty((3, stop - start))
        find_gains(address(part), stop - start, *wanted, address(found))
        if not whole:
            out[:, start:stop] = found

    for_stretches(run, size, least=_LEAST_LINEAR if linear else _LEAST_SERIES, most=_MOST)
    return out


def known_terms(problem: GainProblem) -> list[tuple[float, float, float, float]] | None:
    """Return a row per term, as pretouch_find_gains takes it; None where the search does not know the problem."""
    if problem.task.evaluate is not None or problem.task.constraints or problem.task.sensor.valid_range[0] > 0:
        return None
    if problem.task.method == "uniform-motion" or type(problem.task.goal) is not Objective:
        return None
    rows: list[tuple[float, float, float, float]] = []
    for term in problem.task.goal.terms:
        factor, exponent, quantity, scale = 1.0, 2.0, term.quantity, term.scale
        if quantity == "impact_force" and isinstance(problem.task.impact, ElasticImpact):
            factor, quantity = problem.task.impact.peak_force(1.0), "relative_velocity"
            exponent = 2 * problem.task.impact.speed_exponent
        row, follows = _ROWS.get(quantity), isinstance(scale, str)
        # a scale that follows a rest is none
        if row is None or (follows and not np.all(np.asarray(problem.task.scenario.obstacle.velocity) != 0)):
            return None
        rows.append((row, term.weight * (factor if isinstance(scale, str) else factor / scale) ** 2, exponent, follows))
    return rows


def _inputs(scenario: Scenario, size: int) -> FloatArray:
    """Return the relative quantities of every encounter, shape (10, n)."""
    columns = scenario.relative_columns()
    if scenario.shape == ():
        return np.array(columns).reshape(10, 1)
    inputs = np.empty((10, size))
    for row, column in zip(inputs, columns, strict=True):
        row[:] = np.broadcast_to(column, scenario.shape).reshape(-1)
    return inputs


@kept_by_curve(256)
def _curve(sensor: SensorModel, reach: float, linear: bool) -> tuple[float, Any, bool, Curves | None]:
    """Return g [1/m] at contact, the curve as the kernel reads it, whether g < 0 up to a distance, and what is read."""
    curve = None if linear else alone(curve_windows(sensor, 0.0, reach))
    read = None if curve is None else byref(of_core(curve, 1))
    return float(sensor.log_slope(0.0)), read, falls(sensor, reach), curve
