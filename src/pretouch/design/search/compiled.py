"""Arrays of designs: compiled, interpolated, side by side.

Optimal gains of many encounters that differ in one quantity: designs at a few, and what lies between them. The optimum
follows a quantity smoothly, except where two minima change places, an end is met, or contact is lost. So gain and
objective are interpolated at Chebyshev nodes, each designed alone, on intervals that are halved until the last
coefficients vanish; where they do not, as at such a place, the encounters are left to be designed alone. Each gain that
is interpolated is then put to the test: its own encounter is solved, and must lead to the objective that is
interpolated beside it. An optimum is flat, so this one number tells of an error in either.

Many designs at once: the scan and the refinement of `design_gain` over an array of encounters. Every encounter is
scanned at the same gains; a minimum inside is refined by the polynomial through the nodes of its bracket. An encounter
that this does not settle for certain, by the measures of the single design, is designed alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from ctypes import byref, c_int
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.fields import declared
from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import BoolArray, FloatArray, chebyshev_basis, positive
from pretouch.motion import DAMPER, Scenario
from pretouch.motion.curve import Curves, curve_windows, farthest, shared_curve
from pretouch.motion.kernels import of_core
from pretouch.motion.parallel import run_in_chunks
from pretouch.motion.request import choose_method
from pretouch.motion.scenario import scenario_with
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

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
    linear = choose_method(problem.task.scenario, problem.task.sensor, problem.task.method) == "closed-form"
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

    run_in_chunks(run, size, least=_LEAST_LINEAR if linear else _LEAST_SERIES, most=_MOST)
    return out


def known_terms(problem: GainProblem) -> list[tuple[float, float, float, float]] | None:
    """Return a row per term, as pretouch_find_gains takes it; None where the search does not know the problem."""
    if problem.task.evaluate is not None or problem.task.constraints or problem.task.sensor.valid_range[0] > 0:
        return None
    other = problem.task.law != DAMPER or problem.task.method == "uniform-motion"
    if other or type(problem.task.goal) is not Objective:
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


@cache_by_curve(256)
def _curve(sensor: SensorModel, reach: float, linear: bool) -> tuple[float, Any, bool, Curves | None]:
    """Return g [1/m] at contact, the curve as the kernel reads it, whether g < 0 up to a distance, and what is read."""
    curve = None if linear else shared_curve(curve_windows(sensor, 0.0, reach))
    read = None if curve is None else byref(of_core(curve, 1))
    return float(sensor.log_slope(0.0)), read, falls(sensor, reach), curve


_NODES: Final = 20
_LEAST: Final = 20 * _NODES  # encounters that are worth it
_FEW: Final = 2 * _NODES  # on an interval: fewer are designed alone
_PROBES: Final = 3  # encounters of an interval that are designed alone, too
_GAIN: Final = 1e-9  # of the gain: what its last coefficients, and the probes, may amount to
_VALUE: Final = 1e-10  # of the objective: the same, and the test of every encounter
_LOGARITHMIC: Final = 3.0  # ratio of largest to smallest from which the logarithm is the better coordinate
_BASIS: Final = chebyshev_basis(_NODES)

_interpolate: Final = kernel("interpolate", POINTER, INTEGER, DOUBLE, DOUBLE, POINTER, INTEGER, POINTER)


def find_family(problem: GainProblem) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Find gains [N s] and objectives of a family of encounters, and which are certain, shape (n,)."""
    # none where they differ in more than one quantity, are few, or no matter for the compiled search
    varied = list(_varied(problem.task.scenario))
    if len(varied) != 1 or np.size(varied[0][1]) < _LEAST or known_terms(problem) is None:
        return None
    family = _family(problem, *varied[0])
    out = np.full((2, family.place.size), np.nan)
    _cover(family, float(family.place.min()), float(family.place.max()), None, out)
    gain, value = out
    known = bool(np.isfinite(gain).all())
    tried = np.clip(gain if known else np.where(np.isnan(gain), problem.axis.high, gain), *problem.axis.ends)
    return tried, value, _is_met(problem, tried, value)


def _cover(family: _Family, low: float, high: float, which: Any, out: FloatArray) -> None:
    """Interpolate gain and objective of some encounters, or of all, on an interval or on its parts."""
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


def _is_met(problem: GainProblem, gain: FloatArray, value: FloatArray) -> BoolArray:
    """Tell for which encounters their gain leads to the objective, by solving each."""
    result = problem.run(gain.reshape(problem.task.scenario.shape))
    found = problem.task.goal.value(
        result.end, abs(problem.task.scenario.obstacle.velocity), problem.task.impact
    ).reshape(-1)
    met = np.abs(found - value) <= _VALUE * found
    reached = result.reached
    return np.asarray(met if reached.all() else met & reached.reshape(-1))


@dataclass(frozen=True, slots=True)
class _Family:
    """Encounters that differ in one quantity."""

    problem: GainProblem  # of any of them
    name: str  # of the quantity, one of SCENARIO_INPUTS
    sign: float  # of the quantity where its logarithm is the coordinate, else 0
    place: FloatArray  # the coordinate of every encounter, shape (n,)

    def at(self, place: FloatArray) -> GainProblem:
        """Return the problem of the encounters at some places."""
        value = self.sign * np.exp(place) if self.sign else place
        return self.problem.changed(scenario=scenario_with(self.problem.task.scenario, {self.name: value}))

    def interpolate(self, low: float, high: float, members: FloatArray) -> FloatArray | None:
        """Return the coefficients of gain and objective on an interval, shape (2, nodes), or None if they do not do."""
        probes = members[np.linspace(0, len(members) - 1, _PROBES).astype(np.int64)]
        nodes = 0.5 * (low + high) + 0.5 * (high - low) * _BASIS.nodes
        found = search_compiled(self.at(np.concatenate([nodes, probes])))
        if found is None or not found[2].all():
            return None
        both = found[:2]
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
    """Yield the fields that are arrays of more than one number."""
    for part in ("admittance", "obstacle", "plant", "reference"):
        body: Any = getattr(scenario, part)
        for f in declared(body.__class__):
            value = getattr(body, f.name)
            if np.size(value) > 1:
                yield f"{part}.{f.name}", value


_BLOCK: Final = 8192  # designs that are scanned side by side: 65 encounters each
_COUNTS: Final = (EXACT.first, 2 * EXACT.first - 1, 4 * EXACT.first - 3)  # gains, until neighbors predict each other

Found: TypeAlias = tuple[DesignStatus, float | None, float | None]
"""Status, gain [N s] and objective."""


def design_many(problem: GainProblem, search_one: Callable[[GainProblem], Found]) -> tuple[Any, Any, Any]:
    """Return status, gain [N s] and objective of every encounter, NaN unless optimal; some need the whole search."""
    shape = problem.task.scenario.shape
    free = problem.within_gain_limit()
    found = find_family(free)
    if found is not None and found[2].all():
        optimal = np.broadcast_to(np.array(DesignStatus.OPTIMAL.value, dtype="<U10"), shape)
        return optimal, found[0].reshape(shape), found[1].reshape(shape)
    size = int(np.prod(shape, dtype=np.int64))
    status = np.full(size, DesignStatus.OPTIMAL.value, dtype="<U10")
    gain, objective = np.full(size, np.nan), np.full(size, np.nan)
    waiting = np.arange(size)
    for again in (False, True):
        tried = search_compiled(free.column(waiting)) if again else found
        if tried is not None:
            settled = tried[2] == 1
            gain[waiting[settled]], objective[waiting[settled]] = tried[0][settled], tried[1][settled]
            waiting = waiting[~settled]
    for start in range(0, len(waiting), _BLOCK):
        which = waiting[start : start + _BLOCK]
        for count in () if problem.is_noisy else _COUNTS:  # noise belongs to an encounter, not to its place in a block
            best, value, settled = _design_block(free.column(which), count)
            gain[which[settled]], objective[which[settled]] = best[settled], value[settled]
            which = which[~settled]
            if not len(which):
                break
        for i in which:
            index = tuple(int(k) for k in np.unravel_index(i, shape))
            ended, best_gain, least = search_one(problem.at(index))
            status[i] = ended.value
            if best_gain is not None and least is not None:
                gain[i], objective[i] = best_gain, least
    return status.reshape(shape), gain.reshape(shape), objective.reshape(shape)


def settle_one(problem: GainProblem) -> tuple[float, float] | None:
    """Return gain [N s] and objective of one encounter, in the way of many; None where they are not certain."""
    gain, objective, settled = _design_block(problem, EXACT.first)
    return (float(gain[0]), float(objective[0])) if settled[0] else None


def _design_block(problem: GainProblem, count: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Design a column of encounters; return gain, objective, and for which that is settled."""
    u = np.linspace(*problem.axis.span, count)
    scanned = problem.landscape(u[None])
    every, merit = scanned.objective, scanned.merit
    settled = scanned.feasible.all(axis=1)  # an edge of contact or of a limit needs the search that halves intervals
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
