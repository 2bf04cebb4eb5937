"""Call compiled code that finds the optimal gain of each encounter."""

from __future__ import annotations

import math
from collections.abc import Iterable
from ctypes import byref, c_int
from typing import Any, Final

import numpy as np

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import FloatArray, positive
from pretouch.motion import DAMPER, Scenario
from pretouch.motion.curve import LARGEST_START, curve_pieces, curve_tops, curve_windows, farthest, shared_curve
from pretouch.motion.kernels import of_core, pieces_of_core
from pretouch.motion.parallel import run_in_chunks
from pretouch.motion.request import choose_method
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

from ..constraints import Constraint
from ..impact import ElasticImpact, ImpactModel
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
    "largest_excursion": 6,
    "largest_travel": 7,
    "largest_speed": 8,
    "largest_acceleration": 9,
    "largest_virtual_force": 10,
}
_LEAST_LINEAR: Final = 128  # smallest number of designs per thread
_LEAST_SERIES: Final = 16
_MOST: Final = 4096

UNCERTAIN: Final = 0
"""Outcome of the compiled search if another search must decide."""

OPTIMAL: Final = 1
"""Outcome of the compiled search with an optimal gain."""

INFEASIBLE: Final = 2
"""Outcome of the compiled search if no gain meets the constraints."""

find_gains: Final = kernel(
    *("find_gains", POINTER, INTEGER, DOUBLE, POINTER, POINTER, DOUBLE, DOUBLE, c_int),
    *(DOUBLE, POINTER, INTEGER, POINTER, INTEGER),
    *([DOUBLE] * 5),
    POINTER,
)
"""Compiled search; its arguments are declared in native/core/pretouch.h."""


def search_compiled(problem: GainProblem) -> FloatArray | None:
    """Search for the optimal gain in compiled code.

    Each encounter gets its own gain.

    Args:
        problem: the problem, with one encounter or an array of encounters.

    Returns:
        Gain [N s], objective and outcome of each encounter, shape (3, n). The outcome is OPTIMAL, INFEASIBLE, or
        UNCERTAIN, which needs another search. None if there is no encounter, or if the compiled search does not
        support the problem, such as a user-defined objective, evaluator or impact model.
    """
    rows, limits = supported_terms(problem), limit_rows(problem, problem.task.limits)
    size = math.prod(problem.task.scenario.shape)
    if rows is None or limits is None:
        return None
    linear = choose_method(problem.task.scenario, problem.task.sensor, problem.task.method) == "closed-form"
    horizon, terms = positive(problem.task.horizon, "horizon", "s"), np.array(rows)
    if size == 0:
        return None
    axis, inputs = problem.axis, _inputs(problem.task.scenario, size)
    slope, *curve, _kept = _curve(problem.task.sensor, farthest(problem.task.scenario, problem.task.sensor), linear)
    ends = (axis.scale, math.asinh(axis.low / axis.scale), math.asinh(axis.high / axis.scale), axis.low, axis.high)
    bounds = np.array(limits).reshape(-1, 3)
    arguments = (slope, *curve, horizon, address(terms), len(terms), address(bounds), len(bounds), *ends)
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
    """Return the objective's terms for the compiled search.

    None if that search cannot solve the problem.
    """
    if problem.task.evaluate is not None or problem.task.sensor.valid_range[0] > 0:
        return None
    if problem.task.scenario.obstacle.course:
        return None
    other_motion = problem.task.law != DAMPER or problem.task.method == "uniform-motion"
    if other_motion or type(problem.task.goal) is not Objective:
        return None
    rows: list[tuple[float, float, float, float]] = []
    for term in problem.task.goal.terms:
        coded, scale = _row(term.quantity, problem.task.impact), term.scale
        follows = isinstance(scale, str)
        # If the scale is the obstacle's speed, this speed must not be 0.
        if coded is None or (follows and not np.all(np.asarray(problem.task.scenario.obstacle.velocity) != 0)):
            return None
        row, factor, exponent = coded
        size = factor if isinstance(scale, str) else factor / scale
        rows.append((row, term.weight * size**2, 2 * exponent, follows))
    return rows


def limit_rows(problem: GainProblem, limits: Iterable[Constraint]) -> list[tuple[float, float, float]] | None:
    """Convert limits to the format of the compiled search.

    Returns:
        One row per limit; None if that search cannot compute a limited quantity.
    """
    coded = [(_row(c.quantity, problem.task.impact), c.limit) for c in limits]
    rows = [(row[0], row[1] / limit, row[2]) for row, limit in coded if row is not None]
    return rows if len(rows) == len(coded) else None


def _row(quantity: str, impact: ImpactModel | None) -> tuple[float, float, float] | None:
    """Return row, factor and exponent of a quantity in the compiled search; None if that cannot compute it."""
    factor, exponent = 1.0, 1.0
    if quantity == "impact_force" and isinstance(impact, ElasticImpact):
        quantity, factor, exponent = "relative_velocity", float(impact.peak_force(1.0)), impact.speed_exponent
    elif quantity == "drive_force" and impact is not None:
        quantity, factor = "largest_acceleration", impact.robot_mass
    row = _ROWS.get(quantity)
    return None if row is None else (row, factor, exponent)


def _inputs(scenario: Scenario, size: int) -> FloatArray:
    """Return the ten numbers of each encounter, relative to the reference, for the compiled search."""
    columns = scenario.relative_columns()
    if scenario.shape == ():
        return np.array(columns).reshape(10, 1)
    inputs = np.empty((10, size))
    for row, column in zip(inputs, columns, strict=True):
        row[:] = np.broadcast_to(column, scenario.shape).reshape(-1)
    return inputs


@cache_by_curve(256)
def _curve(sensor: SensorModel, reach: float, linear: bool) -> tuple[float, Any, Any, float, float, bool, Any]:
    """Describe the sensor curve for the compiled search."""
    slope, ends, falling = float(sensor.log_slope(0.0)), sensor.valid_range, falls(sensor, reach)
    if linear:
        return slope, None, None, *ends, falling, None
    curves, pieces, core_pieces = shared_curve(curve_windows(sensor, 0.0, reach)), None, None
    if 0 < reach <= LARGEST_START:
        top, goes_on = next(curve_tops(sensor, 0.0, reach, 2.0 ** math.ceil(math.log2(4 * reach))))
        pieces = curve_pieces(sensor, 0.0, top)
        core_pieces = byref(pieces_of_core(pieces, True, goes_on))
    return slope, byref(of_core(curves, 1)), core_pieces, *ends, falling, (curves, pieces)
