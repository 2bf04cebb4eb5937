"""The exact derivatives of a design's objective and constraint, and how the optimum follows each input.

Gradients of contacts go through the objective term by term. Along the coordinate u of the gain they are sampled at
Chebyshev's nodes beside the optimum, which gives f_up and f_uu as first derivatives of what is exact: no difference is
formed by any input.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.chebyshev import chebyshev_basis, chebyshev_sum
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch.motion.contact import ContactResult, ContactState
from pretouch.motion.scenario import Scenario

from .constraints import Constraint
from .impact import ImpactModel
from .objectives import OBSTACLE_SPEED, Objective
from .quantities import quantity_of
from .search import GainAxis

__all__ = [
    "Shift",
    "constraint_slope",
    "follow_optimum",
    "has_gradients",
    "objective_slope",
    "quantity_slope",
]

Slope: TypeAlias = Callable[[str], Any]
"""From a quantity at contact to its derivative by some input."""

_BASIS: Final = chebyshev_basis(9)
_HALF: Final = 0.08  # of u, from the optimum to the outermost samples: its eighth power is below the rounding of those
_BESIDE: Final = 0.5  # of that: no search is this far from its optimum
_AT_CONTACT: Final = frozenset(
    ("time", "position", "velocity", "acceleration", "displacement", "relative_velocity", "virtual_force")
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """How optima follow one input, arrays of the shape of the designs.

    Args:
        gain: d D_p / d input, in N s per unit of the input.
        objective: d f / d input at the optimum, per unit of the input.
    """

    gain: FloatArray
    objective: FloatArray


def has_gradients(objective: Objective, constraint: Constraint | None) -> bool:
    """Tell whether an objective and a constraint are made of quantities at contact, so that they have gradients.

    Args:
        objective: what is minimized.
        constraint: the active constraint, if any.

    Returns:
        False where a term needs the whole motion, or where a class of the user's computes the objective.
    """
    quantities = [t.quantity for t in objective.terms] + ([constraint.quantity] if constraint else [])
    known = _AT_CONTACT | {"impact_force"}
    return type(objective) is Objective and all(q in known for q in quantities)


def follow_optimum(
    *,
    run: Callable[[FloatArray], ContactResult],
    scenario: Scenario,
    objective: Objective,
    constraint: Constraint | None,
    impact: ImpactModel | None,
    axis: GainAxis,
    gain: FloatArray,
    names: tuple[str, ...],
    held: bool = False,
) -> dict[str, Shift]:
    """Differentiate optimal gains and their objectives by inputs.

    Inside, f_u = 0 holds along with every change, so du/dp = -f_up / f_uu; on an active constraint G = limit holds,
    so du/dp = -G_p / G_u; on a bound the gain stays.

    Args:
        run: solves the encounters with gains of shape (n, m), the designs along the first axis.
        scenario: the encounters, each field a number or of shape (n, 1).
        objective: what was minimized.
        constraint: the active constraint, if the optima sit on one.
        impact: the physical properties, where given.
        axis: the coordinate of the gain.
        gain: the optimal gains [N s], shape (n,).
        names: the inputs, as `ContactGradients` has them.
        held: whether the optima sit on a bound, and stay there.

    Returns:
        By name, arrays of shape (n,); NaN where a sample does not end in contact.
    """
    center = axis.coordinate(gain)
    gains = axis.scale * np.sinh(center[:, None] + _HALF * _BASIS.nodes)
    stretch = np.hypot(gains, axis.scale)
    result = run(gains)
    if held or constraint is not None:
        place = np.zeros(len(gain))
    slope = _objective_slope(result, scenario, objective, impact, "gain") * stretch  # f_u
    limited = None
    if held:
        bend = np.ones(len(gain))
    elif constraint is not None:
        limited = _constraint_slope(result, constraint, impact, "gain") * stretch
        bend = _value(limited, place)
    else:
        place = _root(slope)
        bend = _rise(slope, place)
    found = {}
    for name in names:
        by_input = _objective_slope(result, scenario, objective, impact, name)
        if held:
            shift = np.where(np.isfinite(_value(by_input, place)), 0.0, np.nan)
        elif constraint is not None:
            shift = -_value(_constraint_slope(result, constraint, impact, name), place) / bend
        else:
            shift = -_rise(by_input, place) / bend
        total = _value(by_input, place) + _value(slope, place) * shift
        at = np.hypot(axis.scale * np.sinh(center + _HALF * place), axis.scale)
        found[name] = Shift(gain=shift * at, objective=total)
    return found


def quantity_slope(quantity: str, state: ContactState, impact: ImpactModel | None, of: Slope) -> FloatArray:
    """Differentiate a quantity at contact by an input, an impact force among them.

    Args:
        quantity: the quantity.
        state: the state at contact.
        impact: the physical properties, where given.
        of: from a quantity of `ContactGradients` to its derivative by the input.

    Returns:
        The derivative in SI, of the shape of the state.

    Raises:
        ResultUnavailableError: an impact force without physical properties.
    """
    if quantity != "impact_force":
        return np.asarray(of(quantity))
    if impact is None:
        raise ResultUnavailableError("impact_force: needs the physical properties of robot and obstacle")
    return np.asarray(impact.peak_force_slope(state.relative_velocity) * of("relative_velocity"))


def objective_slope(
    objective: Objective, state: ContactState, *, velocity: Any, impact: ImpactModel | None, by: str, of: Slope
) -> FloatArray:
    """Differentiate sum of weight (q / s)^2 by an input; s may be the speed of the obstacle.

    Args:
        objective: the objective.
        state: the state at contact.
        velocity: that of the obstacle at the start [m/s].
        impact: the physical properties, where given.
        by: the input.
        of: from a quantity of `ContactGradients` to its derivative by the input.

    Returns:
        The derivative in SI, of the shape of the state.
    """
    total = np.zeros(np.shape(state.time))
    for term in objective.terms:
        value, scale = quantity_of(term.quantity, state, impact), term.scale_for(np.abs(velocity))
        change = quantity_slope(term.quantity, state, impact, of)
        if term.scale == OBSTACLE_SPEED and by == "obstacle.velocity":
            change = change - value * np.sign(velocity) / scale
        total = total + 2 * term.weight * value * change / np.square(scale)
    return total


def constraint_slope(constraint: Constraint, state: ContactState, impact: ImpactModel | None, of: Slope) -> FloatArray:
    """Differentiate the magnitude that a constraint limits by an input; arguments as in `objective_slope`."""
    sign = np.sign(quantity_of(constraint.quantity, state, impact))
    return np.asarray(sign * quantity_slope(constraint.quantity, state, impact, of))


def _along(result: ContactResult, by: str) -> Slope:
    return lambda quantity: np.asarray(result.gradients.of(quantity, by))


def _objective_slope(
    result: ContactResult, scenario: Scenario, objective: Objective, impact: ImpactModel | None, by: str
) -> FloatArray:
    velocity = scenario.obstacle.velocity
    return objective_slope(objective, result.end, velocity=velocity, impact=impact, by=by, of=_along(result, by))


def _constraint_slope(result: ContactResult, constraint: Constraint, impact: ImpactModel | None, by: str) -> FloatArray:
    return constraint_slope(constraint, result.end, impact, _along(result, by))


def _value(samples: FloatArray, place: FloatArray) -> FloatArray:
    return chebyshev_sum(_BASIS.to_terms @ samples.T, place)


def _rise(samples: FloatArray, place: FloatArray) -> FloatArray:
    """Return the derivative by u of what was sampled at the nodes, at a place in [-1, 1]."""
    return chebyshev_sum(_BASIS.to_slope @ samples.T, place) / _HALF


def _root(slope: FloatArray) -> FloatArray:
    """Return where f_u = 0, in [-1, 1] about the gain that the search has found, to more digits than it has."""
    place = np.zeros(len(slope))
    for _ in range(4):
        step = _value(slope, place) / _rise(slope, place) / _HALF
        place = np.clip(place - np.where(np.isfinite(step), step, 0.0), -1.0, 1.0)
    return np.where(np.abs(place) < _BESIDE, place, np.nan)
