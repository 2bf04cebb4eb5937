"""Optimal gains of many encounters that differ in one quantity: designs at a few, and what lies between them.

The optimum follows a quantity smoothly, except where two minima change places, an end is met, or contact is lost. So
gain and objective are interpolated at Chebyshev nodes, each designed alone, on intervals that are halved until the
last coefficients vanish; where they do not, as at such a place, the encounters are left to be designed alone. Each
gain that is interpolated is then put to the test: its own encounter is solved, and must lead to the objective that is
interpolated beside it. An optimum is flat, so this one number tells of an error in either.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from pretouch._core.chebyshev import chebyshev_basis
from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion import Scenario
from pretouch.motion.inputs import scenario_with

from ..problem import GainProblem
from .compiled import known_terms, search_compiled

__all__ = ["find_family"]

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
        for f in fields(body):
            value = getattr(body, f.name)
            if np.size(value) > 1:
                yield f"{part}.{f.name}", value
