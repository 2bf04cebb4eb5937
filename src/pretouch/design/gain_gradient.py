"""How the optimal gain of each of many designs follows one input, exactly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch.motion import Scenario
from pretouch.motion.gradients import input_names
from pretouch.motion.inputs import map_fields

from .constraints import Constraint
from .gradient import follow_optimum, has_gradients

if TYPE_CHECKING:
    from .problem import Problem

__all__ = ["gain_gradient"]

_BLOCK: Final = 4096  # designs at a time: nine encounters each
_ACTIVE: Final = 1e-6  # of a limit, as in Certificate
_ON_BOUND: Final = 1e-9  # of the range of u


def gain_gradient(problem: Problem, gain: Any, name: str, design_one: Callable[[tuple[int, ...]], Any]) -> FloatArray:
    """Differentiate optimal gains by one input.

    Args:
        problem: what was designed, for one encounter or an array of them.
        gain: the optimal gains [N s], of the scenario's shape; NaN where there is none.
        name: the input, as in ContactGradients.inputs.
        design_one: gives the design of the encounter at an index, or its evidence, for those without exact derivatives.

    Returns:
        d D_p / d input, in N s per unit of the input, of the scenario's shape; NaN where there is no gain, and where
        the optimum lies so close to an edge of contact that it has no derivative.
    """
    flat = np.asarray(gain, dtype=np.float64).reshape(-1)
    found = np.full(flat.shape, np.nan)
    where = np.flatnonzero(np.isfinite(flat))
    left = where
    if problem.is_differentiable:
        _check(problem, name)
        parts = [_exact(problem, flat, where[i : i + _BLOCK], name, found) for i in range(0, len(where), _BLOCK)]
        left = np.concatenate(parts) if parts else where
    for i in left:
        index = tuple(int(k) for k in np.unravel_index(i, np.shape(gain)))
        entries = {s.name: s.gain_derivative for s in design_one(index).sensitivities}
        found[i] = entries.get(name, np.nan)
    return found.reshape(np.shape(gain))


def _check(problem: Problem, name: str) -> None:
    """Refuse an input that no contact depends on."""
    known = [n for n in input_names(problem.sensor) if n != "gain"]
    if name not in known:
        raise InvalidInputError(f"by: found {name!r}, expected one of {', '.join(known)}")


def _exact(problem: Problem, gain: FloatArray, where: IntArray, name: str, found: FloatArray) -> IntArray:
    """Fill what has exact derivatives; return what is left."""
    part = replace(problem, scenario=_column(problem.scenario, where))
    kinds = _kinds(part, gain[where])
    left = [where[kinds == _UNKNOWN]]
    for kind in np.unique(kinds[kinds != _UNKNOWN]):
        constraint = problem.constraints[kind] if kind >= 0 else None
        these = where[kinds == kind]
        if not has_gradients(problem.objective, constraint):
            left.append(these)
            continue
        found[these] = _followed(problem, constraint, gain[these], these, name, held=bool(kind == _BOUND))
        left.append(these[np.isnan(found[these])])
    return np.concatenate(left)


_INSIDE, _BOUND, _UNKNOWN = -1, -2, -3


def _kinds(problem: Problem, gain: FloatArray) -> Any:
    """Tell where each optimum sits: the number of the active constraint, or one of the three above."""
    axis = problem.axis
    kinds = np.full(len(gain), _INSIDE)
    ends = np.array(axis.span)
    near = np.abs(axis.coordinate(gain)[:, None] - ends) <= _ON_BOUND * (ends[1] - ends[0])
    kinds[near.any(axis=1)] = _BOUND
    if problem.constraints:
        end = problem.run(gain[:, None]).end
        for i, constraint in enumerate(problem.constraints):
            ratio = np.reshape(constraint.magnitude(end, problem.impact) / constraint.limit, -1)
            kinds[np.abs(ratio - 1) < _ACTIVE] = _BOUND if constraint.quantity == "gain" else i
    return kinds


def _followed(
    problem: Problem, constraint: Constraint | None, gain: FloatArray, which: IntArray, name: str, *, held: bool
) -> FloatArray:
    scenario = _column(problem.scenario, which)
    shifts = follow_optimum(
        run=replace(problem, scenario=scenario).run,
        scenario=scenario,
        objective=problem.objective,
        constraint=constraint,
        impact=problem.impact,
        axis=problem.axis,
        gain=gain,
        names=(name,),
        held=held,
    )
    return shifts[name].gain


def _column(scenario: Scenario, which: IntArray) -> Scenario:
    """Return some encounters as a column, shape (m, 1), so that a row of gains broadcasts with them."""
    shape = scenario.shape
    return map_fields(scenario, lambda value: np.broadcast_to(value, shape).reshape(-1)[which][:, None])
