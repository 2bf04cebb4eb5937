"""Interpolate optimal gains over one input that varies between encounters.

The optimum depends smoothly on the input, unless another minimum becomes the lowest, a bound is reached, or contact is
lost. So gain and objective are designed at Chebyshev nodes and interpolated. The interval of the input is halved until
the last coefficients vanish. Encounters for which that fails are designed individually. Each interpolated gain is
tested: its encounter is solved and must have the interpolated objective, which reveals errors of gain and objective.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.fields import declared
from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import BoolArray, FloatArray, chebyshev_basis
from pretouch.motion import Scenario
from pretouch.motion.scenario import scenario_with

from ..problem import GainProblem
from .compiled import OPTIMAL, search_compiled, supported_terms
from .landscape import HELD

_NODES: Final = 20
_LEAST: Final = 20 * _NODES  # smallest number of encounters for interpolation
_FEW: Final = 2 * _NODES  # smallest number of encounters on an interval; fewer are designed individually
_PROBES: Final = 3  # encounters of an interval that are also designed individually, as a test
_GAIN: Final = 1e-9  # largest last coefficients and largest error at the probes, relative to the gain
_VALUE: Final = 1e-10  # the same relative to the objective; also the largest error of the test of every encounter
_ROUNDED: Final = 1e-14  # largest relative rounding error of an interpolated gain
_WITHIN: Final = 1 - 1e-8  # share of each limit that interpolated designs use, so that they meet the limit itself
_BINDING: Final = 1 - 1e-6  # smallest share of a limit that counts as binding
_AT_LIMIT: Final = 1e-8  # largest error of an interpolated objective if a limit is binding
_LOGARITHMIC: Final = 3.0  # ratio of largest to smallest value above which the logarithm is the coordinate
_BASIS: Final = chebyshev_basis(_NODES)

_interpolate: Final = kernel("interpolate", POINTER, INTEGER, DOUBLE, DOUBLE, POINTER, INTEGER, POINTER)


def find_family(problem: GainProblem) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Interpolate the optimal gains of many similar encounters.

    The encounters differ in one input. The result is None if they differ in more than one input, are few, or the
    compiled search does not support them.

    Returns:
        The gains [N s], the objectives, and whether each interpolation is accurate.
    """
    varied = list(_varied_inputs(problem.task.scenario))
    if len(varied) != 1 or np.size(varied[0][1]) < _LEAST or supported_terms(problem) is None:
        return None
    within = [replace(c, limit=c.limit * _WITHIN) for c in problem.task.limits]
    family = _family(problem.changed(constraints=within) if within else problem, *varied[0])
    out = np.full((2, family.place.size), np.nan)
    _cover(family, float(family.place.min()), float(family.place.max()), None, out)
    gain, value = out
    complete = bool(np.isfinite(gain).all())
    tested = np.clip(gain if complete else np.where(np.isnan(gain), problem.axis.high, gain), *problem.axis.ends)
    for end in problem.axis.ends:  # an interpolated bound is rounded; the answer is the bound itself
        tested = np.where(np.abs(tested - end) <= _ROUNDED * abs(end), end, tested)
    return tested, value, _is_confirmed(problem, tested, value)


def _cover(family: _Family, low: float, high: float, which: Any, out: FloatArray) -> None:
    """Interpolate optimal gains over an interval of one input. Halve the interval if the error is too large."""
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
    """Return True for encounters with an accurate interpolated gain."""
    task, result = problem.task, problem.run(gain.reshape(problem.task.scenario.shape))
    solved = task.goal.value(result.end, abs(task.scenario.obstacle.velocity), task.impact).reshape(-1)
    if not task.limits:
        confirmed = np.abs(solved - value) <= _VALUE * solved
    else:
        ratio = np.max([c.magnitude(result.end, task.impact).reshape(-1) / c.limit for c in task.limits], axis=0)
        allowed = np.where(ratio > _BINDING, _AT_LIMIT, _VALUE)  # at a limit the objective is not stationary
        confirmed = (np.abs(solved - value) <= allowed * solved) & (ratio <= HELD)
    reached = result.reached
    return np.asarray(confirmed if reached.all() else confirmed & reached.reshape(-1))


@dataclass(frozen=True, slots=True)
class _Family:
    """Encounters that differ in exactly one input."""

    problem: GainProblem  # the problem of all encounters
    name: str  # name of the input, one of SCENARIO_INPUTS
    sign: float  # sign of the input if its logarithm is the coordinate, else 0
    place: FloatArray  # coordinate of every encounter, shape (n,)

    def at(self, place: FloatArray) -> GainProblem:
        """Return the search problem for other values of one input.

        The encounters differ in this input.
        """
        value = self.sign * np.exp(place) if self.sign else place
        return self.problem.changed(scenario=scenario_with(self.problem.task.scenario, {self.name: value}))

    def interpolate(self, low: float, high: float, members: FloatArray) -> FloatArray | None:
        """Fit polynomials to gain and objective over one input.

        Returns:
            Chebyshev coefficients, shape (2, nodes); None if the fit is inaccurate.
        """
        probes = members[np.linspace(0, len(members) - 1, _PROBES).astype(np.int64)]
        nodes = 0.5 * (low + high) + 0.5 * (high - low) * _BASIS.nodes
        designs = search_compiled(self.at(np.concatenate([nodes, probes])))
        if designs is None or (designs[2] != OPTIMAL).any():
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


def _varied_inputs(scenario: Scenario) -> Iterator[tuple[str, Any]]:
    """Yield each encounter input that is an array. Each item has the name and the value of the input."""
    for part in ("admittance", "obstacle", "plant", "reference"):
        body: Any = getattr(scenario, part)
        for f in declared(body.__class__):
            value = getattr(body, f.name)
            if np.size(value) > 1:
                yield f"{part}.{f.name}", value
