"""Interpolate optimal gains over inputs that vary between encounters.

The encounters form a grid, such as all combinations of speeds and positions. The optimum depends smoothly on the
inputs, unless another minimum becomes the lowest, a bound or a limit is reached, or contact is lost. So gain and
objective are designed at Chebyshev nodes of each input and interpolated. The interval of an input is halved until the
last coefficients vanish. Encounters for which that fails are designed individually. Each interpolated gain is tested:
its encounter is solved and must have the interpolated objective, which reveals errors of gain and objective.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.fields import declared
from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import BoolArray, FloatArray, IntArray, chebyshev_basis
from pretouch.motion import ContactResult, Scenario
from pretouch.motion.scenario import scenario_with

from ..constraints import Constraint
from ..problem import GainProblem
from ..task import Task
from .compiled import OPTIMAL, search_compiled, supported_terms
from .landscape import HELD

Span: TypeAlias = tuple[tuple[float, float], ...]
"""The interval of the coordinate along each axis of a grid."""

_NODES: Final = 20  # of each input
_LEAST: Final = 2 * _NODES  # smallest number of values of an input for interpolation
_PER_NODE: Final = 20  # smallest number of encounters per node of a grid
_FEW: Final = 2  # the same of a part of a grid; smaller parts are designed individually
_PROBES: Final = 2  # encounters per input, and one more, that are also designed individually, as a test
_GAIN: Final = 1e-9  # largest last coefficients and largest error at the probes, relative to the gain
_VALUE: Final = 1e-10  # the same relative to the objective; also the largest error of the test of every encounter
_ROUNDED: Final = 1e-14  # largest relative rounding error of an interpolated gain
_WITHIN: Final = 1 - 1e-8  # share of each limit that interpolated designs use, so that they meet the limit itself
_EXCEEDED: Final = 1.0  # interpolated |quantity| / limit above which the optimum without limits is left out
_BINDING: Final = 1 - 1e-6  # smallest share of a limit that counts as binding
_AT_LIMIT: Final = 1e-8  # largest error of an interpolated objective if a limit is binding
_LOGARITHMIC: Final = 3.0  # ratio of largest to smallest value above which the logarithm is the coordinate
_BASIS: Final = chebyshev_basis(_NODES)

_interpolate: Final = kernel("interpolate", POINTER, INTEGER, DOUBLE, DOUBLE, POINTER, INTEGER, INTEGER, POINTER)


def find_family(problem: GainProblem) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Interpolate the optimal gains of many similar encounters.

    They differ in one input, or in several of which each varies along an axis of its own. Along other axes, such as
    short ones and those of several inputs, each index is interpolated on its own.

    Returns:
        The gains [N s], the objectives, and whether each interpolation is accurate. None if the encounters form no grid
        that is large enough, or if the compiled search does not support them.
    """
    scenario = problem.task.scenario
    inputs = dict(_array_inputs(scenario))
    varied = {name: value for name, value in inputs.items() if value.min() < value.max()}
    constant = {name: float(value.flat[0]) for name, value in inputs.items() if name not in varied}
    distinct = shape = np.broadcast_shapes(*(value.shape for value in varied.values()))
    if len(varied) == 1:  # an array of any shape is one axis
        varied, shape = {name: np.reshape(value, -1) for name, value in varied.items()}, (math.prod(shape),)
    varied = {name: np.reshape(v, (1,) * (len(shape) - v.ndim) + v.shape) for name, v in varied.items()}
    coordinates = _coordinates(varied, shape)
    if not coordinates or supported_terms(problem) is None:
        return None
    own = {c.name for c in coordinates.values()}
    others = {name: v for name, v in varied.items() if name not in own}
    within = tuple(replace(c, limit=c.limit * _WITHIN) for c in problem.task.limits)
    out = np.full((2, *shape), np.nan)
    # The optimum without limits is that with limits where it meets them. Elsewhere a limit is met exactly. Both depend
    # smoothly on the inputs, and are interpolated one after the other.
    for limits in ((), within) if within else ((),):
        wanted = np.isnan(out[0])
        for index in np.ndindex(*(1 if k in coordinates else n for k, n in enumerate(shape))):
            fixed = {name: float(v[tuple(np.minimum(index, np.array(v.shape) - 1))]) for name, v in others.items()}
            one, fixed = problem, constant | fixed
            if fixed or problem.task.limits:
                one = problem.changed(constraints=limits, scenario=scenario_with(scenario, fixed))
            place: Any = tuple(slice(None) if k in coordinates else i for k, i in enumerate(index))
            family = _Family(one, tuple(coordinates.values()), () if limits else within)
            family.cover(out[(slice(None), *place)], wanted[place])
    # inputs that are arrays of equal values repeat the same encounters
    gain, value = (np.broadcast_to(row.reshape(distinct), scenario.shape).reshape(-1) for row in out)
    complete = bool(np.isfinite(gain).all())
    tested = np.clip(gain if complete else np.where(np.isnan(gain), problem.axis.high, gain), *problem.axis.ends)
    for end in problem.axis.ends:  # an interpolated bound is rounded; the answer is the bound itself
        tested = np.where(np.abs(tested - end) <= _ROUNDED * abs(end), end, tested)
    return tested, value, _is_confirmed(problem, tested, value)


def _is_confirmed(problem: GainProblem, gain: FloatArray, value: FloatArray) -> BoolArray:
    """Return True for encounters with an accurate interpolated gain."""
    task, result = problem.task, problem.run(gain.reshape(problem.task.scenario.shape))
    solved = task.goal.value(result.end, abs(task.scenario.obstacle.velocity), task.impact).reshape(-1)
    if not task.limits:
        confirmed = np.abs(solved - value) <= _VALUE * solved
    else:
        ratio = _largest_ratio(task.limits, task, result).reshape(-1)
        allowed = np.where(ratio > _BINDING, _AT_LIMIT, _VALUE)  # at a limit the objective is not stationary
        confirmed = (np.abs(solved - value) <= allowed * solved) & (ratio <= HELD)
    reached = result.reached
    return np.asarray(confirmed if reached.all() else confirmed & reached.reshape(-1))


def _largest_ratio(limits: Sequence[Constraint], task: Task, result: ContactResult) -> FloatArray:
    """Return the largest |quantity| / limit of each encounter."""
    return np.asarray(np.max([c.magnitude(result.end, task.impact) / c.limit for c in limits], axis=0))


@dataclass(frozen=True, slots=True)
class _Coordinate:
    """The coordinate along one axis of a grid: an input of SCENARIO_INPUTS, or its logarithm."""

    name: str
    sign: float  # sign of the input if its logarithm is the coordinate, else 0
    place: FloatArray  # coordinate of every index of the axis, shape (n,)

    def value(self, place: FloatArray) -> FloatArray:
        """Return the input."""
        return self.sign * np.exp(place) if self.sign else place


@dataclass(frozen=True, slots=True)
class _Family:
    """Encounters that form a grid."""

    problem: GainProblem  # the problem of all encounters
    coordinates: tuple[_Coordinate, ...]
    limits: tuple[Constraint, ...]  # limits that the problem lacks; encounters that certainly exceed one are left out

    def cover(self, out: FloatArray, wanted: BoolArray) -> None:
        """Write gains and objectives, shape (2, n, ...), where they are wanted and can be interpolated."""
        self._cover(tuple(None for _ in self.coordinates), wanted, out)

    def _cover(self, indices: tuple[IntArray | None, ...], wanted: BoolArray, out: FloatArray) -> None:
        """Interpolate a part of the grid, or its halves if the error is too large. None stands for a whole axis."""
        part = wanted[_part(indices, wanted.shape)]
        if not part.all():  # the smallest part with all that are wanted
            others = tuple(tuple(k for k in range(part.ndim) if k != axis) for axis in range(part.ndim))
            each = (np.arange(n) if i is None else i for i, n in zip(indices, wanted.shape, strict=True))
            indices = tuple(i[part.any(axis=o)] for i, o in zip(each, others, strict=True))
        members = [c.place if i is None else c.place[i] for c, i in zip(self.coordinates, indices, strict=True)]
        if math.prod(map(len, members)) < _FEW * _NODES ** len(members):
            return
        span = tuple((float(m.min()), float(m.max())) for m in members)
        if not all(low < high for low, high in span):
            return
        found, widest = self._interpolate(span, members)
        if found is not None:
            out[(slice(None), *_part(indices, wanted.shape))] = found
        elif widest is not None:
            upper, of = members[widest] > sum(span[widest]) / 2, indices[widest]
            for half in (~upper, upper):
                part_of = np.flatnonzero(half) if of is None else of[half]
                self._cover((*indices[:widest], part_of, *indices[widest + 1 :]), wanted, out)

    def _interpolate(self, span: Span, members: list[FloatArray]) -> tuple[FloatArray | None, int | None]:
        """Fit polynomials to gain and objective.

        Returns:
            Gains and objectives of the members. If the fit is inaccurate, None and the axis to divide, or None for
            none, because no encounter has an optimum.
        """
        count, axes = _NODES ** len(span), range(1, len(span) + 1)
        nodes = [0.5 * (low + high) + 0.5 * (high - low) * _BASIS.nodes for low, high in span]
        grid, probes = [n.reshape(-1) for n in np.meshgrid(*nodes, indexing="ij")], _probes(members)
        designs = search_compiled(self._at([np.append(n, p) for n, p in zip(grid, probes, strict=True)]))
        optimal = designs is not None and designs[2] == OPTIMAL
        if designs is None or not np.any(optimal):
            return None, None
        if not np.all(optimal):
            return None, int(np.argmax(list(map(len, members))))
        both = designs[:2]
        least = np.array([_GAIN, _VALUE]) * np.abs(both).min(axis=1)
        coefficients = _coefficients(both[:, :count], len(nodes))
        error = np.abs(_at_points(probes, span, coefficients) - both[:, count:]).max(axis=1)
        tails = np.array([np.abs(np.moveaxis(coefficients, k, 1)[:, -2:]).reshape(2, -1).sum(axis=1) for k in axes])
        if (tails > least).any() or (error > least).any():
            return None, int(np.argmax((tails / least).max(axis=1)))
        if not self.limits:
            return _evaluate(members, span, coefficients), None
        result = self._at(grid).run(both[0, :count])
        ratio = _coefficients(_largest_ratio(self.limits, self.problem.task, result)[None], len(nodes))
        found = _evaluate(members, span, np.concatenate([coefficients, ratio]))
        found[:, found[2] > _EXCEEDED] = np.nan
        return found[:2], None

    def _at(self, places: list[FloatArray]) -> GainProblem:
        """Return the search problem for other values of the inputs, one array for each."""
        values = {c.name: c.value(place) for c, place in zip(self.coordinates, places, strict=True)}
        return self.problem.changed(scenario=scenario_with(self.problem.task.scenario, values))


def _probes(members: list[FloatArray]) -> list[FloatArray]:
    """Return the coordinates of some encounters, from one corner of a grid to the other along each axis."""
    count = _PROBES * len(members) + 1
    order = [np.arange(count) * (k + 1) % count if k else np.arange(count) for k in range(len(members))]
    return [m[(i * (len(m) - 1)) // (count - 1)] for m, i in zip(members, order, strict=True)]


def _coefficients(values: FloatArray, axes: int) -> FloatArray:
    """Return the Chebyshev coefficients of rows of values at the nodes of a grid, shape (rows, nodes, ...)."""
    coefficients = values.reshape(-1, *(_NODES,) * axes)
    for _ in range(axes):  # each step ends the turn of one axis
        coefficients = np.moveaxis(coefficients, 1, -1) @ _BASIS.to_terms.T
    return np.asarray(coefficients)


def _basis(place: FloatArray, span: tuple[float, float]) -> FloatArray:
    """Return the Chebyshev polynomials at some coordinates, shape (n, nodes)."""
    low, high = span
    return np.asarray(np.polynomial.chebyshev.chebvander((2 * place - low - high) / (high - low), _NODES - 1))


def _at_points(points: list[FloatArray], span: Span, coefficients: FloatArray) -> FloatArray:
    """Evaluate polynomials at points, with one array for each axis, shape (rows, points)."""
    if len(points) == 1:
        return _evaluate(points, span, coefficients)
    values = np.einsum("rn...,pn->rp...", coefficients, _basis(points[0], span[0]))
    for place, ends in zip(points[1:], span[1:], strict=True):
        values = np.einsum("rpn...,pn->rp...", values, _basis(place, ends))
    return np.asarray(values)


def _evaluate(members: list[FloatArray], span: Span, coefficients: FloatArray) -> FloatArray:
    """Evaluate polynomials on a grid, shape (rows, n, ...)."""
    rows, last = len(coefficients), members[-1]
    for k, (place, ends) in enumerate(zip(members[:-1], span[:-1], strict=True), start=1):
        coefficients = np.moveaxis(np.tensordot(coefficients, _basis(place, ends), (k, 1)), -1, k)
    out = np.empty((*map(len, members[:-1]), rows, len(last)))
    for index in np.ndindex(*out.shape[:-2]):
        terms = np.ascontiguousarray(coefficients[(slice(None), *index)])
        _interpolate(address(last), len(last), *span[-1], address(terms), _NODES, rows, address(out[index]))
    return np.moveaxis(out, -2, 0)


def _part(indices: tuple[IntArray | None, ...], shape: tuple[int, ...]) -> Any:
    """Return the index of a part of a grid. None stands for a whole axis."""
    if all(i is None for i in indices):
        return (slice(None),) * len(indices)
    return np.ix_(*(np.arange(n) if i is None else i for i, n in zip(indices, shape, strict=True)))


def _coordinates(varied: Mapping[str, FloatArray], shape: tuple[int, ...]) -> dict[int, _Coordinate]:
    """Choose the axes of a grid along which gains are interpolated: the longest that have an input of their own."""
    along = {k: [name for name, v in varied.items() if v.shape[k] > 1] for k in range(len(shape))}
    own = [k for k, names in along.items() if len(names) == 1 and varied[names[0]].size == shape[k] >= _LEAST]
    own.sort(key=lambda k: -shape[k])
    while own and math.prod(shape[k] for k in own) < _PER_NODE * _NODES ** len(own):
        own.pop()
    return {k: _coordinate(along[k][0], varied[along[k][0]].reshape(-1)) for k in sorted(own)}


def _coordinate(name: str, x: FloatArray) -> _Coordinate:
    low, high = float(x.min()), float(x.max())
    near, far = sorted((abs(low), abs(high)))
    logarithmic = low * high > 0 and far > _LOGARITHMIC * near
    sign = float(np.sign(low)) if logarithmic else 0.0
    return _Coordinate(name, sign, np.log(np.abs(x)) if logarithmic else np.ascontiguousarray(x))


def _array_inputs(scenario: Scenario) -> Iterator[tuple[str, FloatArray]]:
    """Yield each encounter input that is an array. Each item has the name and the value of the input."""
    for part in ("admittance", "obstacle", "plant", "reference"):
        body: Any = getattr(scenario, part)
        for f in declared(body.__class__):
            value = np.asarray(getattr(body, f.name))
            if value.size > 1:
                yield f"{part}.{f.name}", value.astype(np.float64)
