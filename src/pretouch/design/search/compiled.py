"""Search for optimal gains of encounters in compiled code."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from ctypes import byref, c_int
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import BoolArray, FloatArray, chebyshev_basis, positive
from pretouch._core.values import declared
from pretouch.motion import DAMPER, Scenario
from pretouch.motion.curve import Curves, alone, curve_windows, farthest
from pretouch.motion.kernels import of_core
from pretouch.motion.request import checked_method, for_stretches
from pretouch.motion.scenario import scenario_with
from pretouch.sensors import SensorModel
from pretouch.sensors.model import kept_by_curve

from ..certificate import DesignStatus, falls
from ..constraints import ElasticImpact
from ..objectives import Objective
from ..problem import GainProblem
from .minima import NODES, interpolate, minimize_polynomials
from .scan import EXACT, predict

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
    """Find the optimal gain of each encounter in compiled code.

    Args:
        problem: the problem, with one encounter or an array of encounters.

    Returns:
        Gain [N s], objective and certainty (1 or 0) of each encounter, shape (3, n). None if there is no encounter, or
        if the compiled search does not support the problem: constraints, quantities of the whole motion, evaluators.
    """
    rows, size = supported_terms(problem), math.prod(problem.task.scenario.shape)
    if rows is None:
        return None
    linear = checked_method(problem.task.scenario, problem.task.sensor, problem.task.method) == "closed-form"
    horizon, terms = positive(problem.task.horizon, "horizon", "s"), np.array(rows)
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
        result = out if whole else np.empty((3, stop - start))
        find_gains(address(part), stop - start, *wanted, address(result))
        if not whole:
            out[:, start:stop] = result

    for_stretches(run, size, least=_LEAST_LINEAR if linear else _LEAST_SERIES, most=_MOST)
    return out


def supported_terms(problem: GainProblem) -> list[tuple[float, float, float, float]] | None:
    """Return one row per term for pretouch_find_gains; None if the compiled search does not support the problem."""
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
        # A scale that equals the obstacle's speed must not be 0.
        if row is None or (follows and not np.all(np.asarray(problem.task.scenario.obstacle.velocity) != 0)):
            return None
        rows.append((row, term.weight * (factor if isinstance(scale, str) else factor / scale) ** 2, exponent, follows))
    return rows


def _inputs(scenario: Scenario, size: int) -> FloatArray:
    """Return the ten relative quantities of every encounter, shape (10, n)."""
    columns = scenario.relative_columns()
    if scenario.shape == ():
        return np.array(columns).reshape(10, 1)
    inputs = np.empty((10, size))
    for row, column in zip(inputs, columns, strict=True):
        row[:] = np.broadcast_to(column, scenario.shape).reshape(-1)
    return inputs


@kept_by_curve(256)
def _curve(sensor: SensorModel, reach: float, linear: bool) -> tuple[float, Any, bool, Curves | None]:
    """Return g at contact [1/m], a pointer to the curve, whether g < 0 up to `reach` [m], and the curve to keep alive."""
    curve = None if linear else alone(curve_windows(sensor, 0.0, reach))
    read = None if curve is None else byref(of_core(curve, 1))
    return float(sensor.log_slope(0.0)), read, falls(sensor, reach), curve


_NODES: Final = 20
_LEAST: Final = 20 * _NODES  # smallest number of encounters for interpolation
_FEW: Final = 2 * _NODES  # smallest number of encounters on an interval; fewer are designed individually
_PROBES: Final = 3  # encounters of an interval that are also designed individually, as a test
_GAIN: Final = 1e-9  # largest last coefficients and largest error at the probes, relative to the gain
_VALUE: Final = 1e-10  # the same relative to the objective; also the largest error of the test of every encounter
_LOGARITHMIC: Final = 3.0  # ratio of largest to smallest value above which the logarithm is the coordinate
_BASIS: Final = chebyshev_basis(_NODES)

_interpolate: Final = kernel("interpolate", POINTER, INTEGER, DOUBLE, DOUBLE, POINTER, INTEGER, POINTER)


def find_family(problem: GainProblem) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Return gains [N s] and objectives of encounters that differ in one input, and which are certain, shape (n,)."""
    # None if they differ in more than one input, are few, or are not supported by the compiled search.
    varied = list(_varied(problem.task.scenario))
    if len(varied) != 1 or np.size(varied[0][1]) < _LEAST or supported_terms(problem) is None:
        return None
    family = _family(problem, *varied[0])
    out = np.full((2, family.place.size), np.nan)
    _cover(family, float(family.place.min()), float(family.place.max()), None, out)
    gain, value = out
    complete = bool(np.isfinite(gain).all())
    tested = np.clip(gain if complete else np.where(np.isnan(gain), problem.axis.high, gain), *problem.axis.ends)
    return tested, value, _is_confirmed(problem, tested, value)


def _cover(family: _Family, low: float, high: float, which: Any, out: FloatArray) -> None:
    """Interpolate gain and objective of encounters (all or a selection) on an interval, which is halved if needed."""
    place = family.place if which is None else family.place[which]
    if len(place) < _FEW or not low < high:
        return
    coefficients = family.interpolate(low, high, place)
    if coefficients is not None:
        if which is None:
            _evaluate(place, low, high, coefficients, out)
        else:
            out[:, which] = _evaluate(place, low, high, coefficients, np.empty((2, len(place))))
        return
    middle = 0.5 * (low + high)
    every = np.arange(len(place)) if which is None else which
    _cover(family, low, middle, every[place <= middle], out)
    _cover(family, middle, high, every[place > middle], out)


def _evaluate(place: FloatArray, low: float, high: float, coefficients: FloatArray, out: FloatArray) -> FloatArray:
    coefficients = np.ascontiguousarray(coefficients)
    _interpolate(address(place), place.size, low, high, address(coefficients), coefficients.shape[1], address(out))
    return out


def _is_confirmed(problem: GainProblem, gain: FloatArray, value: FloatArray) -> BoolArray:
    """Return for which encounters the gain leads to the interpolated objective; each one is solved."""
    result = problem.run(gain.reshape(problem.task.scenario.shape))
    solved = problem.task.goal.value(
        result.end, abs(problem.task.scenario.obstacle.velocity), problem.task.impact
    ).reshape(-1)
    confirmed = np.abs(solved - value) <= _VALUE * solved
    reached = result.reached
    return np.asarray(confirmed if reached.all() else confirmed & reached.reshape(-1))


@dataclass(frozen=True, slots=True)
class _Family:
    """Encounters that differ in one input."""

    problem: GainProblem  # the problem of all encounters
    name: str  # name of the input, one of SCENARIO_INPUTS
    sign: float  # sign of the input if its logarithm is the coordinate, else 0
    place: FloatArray  # coordinate of every encounter, shape (n,)

    def at(self, place: FloatArray) -> GainProblem:
        """Return the problem of the encounters at coordinates of the input."""
        value = self.sign * np.exp(place) if self.sign else place
        return self.problem.changed(scenario=scenario_with(self.problem.task.scenario, {self.name: value}))

    def interpolate(self, low: float, high: float, members: FloatArray) -> FloatArray | None:
        """Return Chebyshev coefficients of gain and objective on an interval, shape (2, nodes); None if not accurate."""
        probes = members[np.linspace(0, len(members) - 1, _PROBES).astype(np.int64)]
        nodes = 0.5 * (low + high) + 0.5 * (high - low) * _BASIS.nodes
        designs = search_compiled(self.at(np.concatenate([nodes, probes])))
        if designs is None or not designs[2].all():
            return None
        both = designs[:2]
        coefficients = both[:, :_NODES] @ _BASIS.to_terms.T
        least = np.array([_GAIN, _VALUE]) * np.abs(both).min(axis=1)
        between = _evaluate(probes, low, high, coefficients, np.empty((2, _PROBES)))
        error = np.abs(between - both[:, _NODES:]).max(axis=1)
        if (np.abs(coefficients[:, -2:]).sum(axis=1) > least).any() or (error > least).any():
            return None
        return np.asarray(coefficients)


def _family(problem: GainProblem, name: str, value: Any) -> _Family:
    x = np.asarray(value, dtype=np.float64).reshape(-1)
    low, high = float(x.min()), float(x.max())
    near, far = sorted((abs(low), abs(high)))
    logarithmic = low * high > 0 and far > _LOGARITHMIC * near
    sign = float(np.sign(low)) if logarithmic else 0.0
    return _Family(problem, name, sign, np.log(np.abs(x)) if logarithmic else x)


def _varied(scenario: Scenario) -> Iterator[tuple[str, Any]]:
    """Yield name and value of the inputs that are arrays of more than one number."""
    for part in ("admittance", "obstacle", "plant", "reference"):
        body: Any = getattr(scenario, part)
        for f in declared(body.__class__):
            value = getattr(body, f.name)
            if np.size(value) > 1:
                yield f"{part}.{f.name}", value


_BLOCK: Final = 8192  # designs that are scanned together, with 65 encounters each
_COUNTS: Final = (EXACT.first, 2 * EXACT.first - 1, 4 * EXACT.first - 3)  # gains of ever finer scans

Found: TypeAlias = tuple[DesignStatus, float | None, float | None]
"""Status, gain and objective of one design."""


def design_many(problem: GainProblem, search_one: Callable[[GainProblem], Found]) -> tuple[Any, Any, Any]:
    """Return status, gain and objective of every encounter, NaN unless optimal; `search_one` solves difficult ones."""
    shape = problem.task.scenario.shape
    free = problem.within_gain_limit()
    family = find_family(free)
    if family is not None and family[2].all():
        optimal = np.broadcast_to(np.array(DesignStatus.OPTIMAL.value, dtype="<U10"), shape)
        return optimal, family[0].reshape(shape), family[1].reshape(shape)
    size = int(np.prod(shape, dtype=np.int64))
    status = np.full(size, DesignStatus.OPTIMAL.value, dtype="<U10")
    gain, objective = np.full(size, np.nan), np.full(size, np.nan)
    waiting = np.arange(size)
    for again in (False, True):
        tried = search_compiled(free.column(waiting)) if again else family
        if tried is not None:
            settled = tried[2] == 1
            gain[waiting[settled]], objective[waiting[settled]] = tried[0][settled], tried[1][settled]
            waiting = waiting[~settled]
    for start in range(0, len(waiting), _BLOCK):
        which = waiting[start : start + _BLOCK]
        for count in () if problem.is_noisy else _COUNTS:  # blocks would change the noise of the encounters
            best, value, settled = _design_block(free.column(which), count)
            gain[which[settled]], objective[which[settled]] = best[settled], value[settled]
            which = which[~settled]
            if not len(which):
                break
        for i in which:
            index = tuple(int(k) for k in np.unravel_index(i, shape))
            result, best_gain, lowest = search_one(problem.at(index))
            status[i] = result.value
            if best_gain is not None and lowest is not None:
                gain[i], objective[i] = best_gain, lowest
    return status.reshape(shape), gain.reshape(shape), objective.reshape(shape)


def settle_one(problem: GainProblem) -> tuple[float, float] | None:
    """Return gain and objective of one encounter, by the search for many; None if they are not certain."""
    gain, objective, settled = _design_block(problem, EXACT.first)
    return (float(gain[0]), float(objective[0])) if settled[0] else None


def _design_block(problem: GainProblem, count: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Design a column of encounters; return gain, objective, and for which encounters these are certain."""
    u = np.linspace(*problem.axis.span, count)
    scanned = problem.landscape(u[None])
    every, merit = scanned.objective, scanned.merit
    settled = scanned.feasible.all(axis=1)  # an edge of contact or of a limit needs the adaptive scan
    with np.errstate(invalid="ignore"):
        predicted = predict(u[::2], every[:, ::2], np.arange(count // 2))
        error = np.abs(predicted / every[:, 1::2] - 1).max(axis=1)
    settled &= error <= EXACT.resolved
    best = np.argmin(merit, axis=1)
    lower, upper = np.clip(best - 1, 0, None), np.clip(best + 1, None, count - 1)
    settled &= (best > 0) & (best < count - 1) & (_count_minima(merit) == 1)
    middle, half = (u[lower] + u[upper]) / 2, (u[upper] - u[lower]) / 2
    values = problem.landscape(middle[:, None] + half[:, None] * NODES).objective
    z, polished = minimize_polynomials(values)
    return np.asarray(problem.axis.gain(middle + half * z)), interpolate(values, z), settled & polished


def _count_minima(merit: FloatArray) -> Any:
    padded = np.pad(merit, ((0, 0), (1, 1)), constant_values=np.inf)
    return ((merit <= padded[:, :-2]) & (merit < padded[:, 2:]) & np.isfinite(merit)).sum(axis=1)
