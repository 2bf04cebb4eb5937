"""How the objective and the constraints of encounters follow their inputs, by exact gradients."""

from __future__ import annotations

from typing import cast

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.motion import ContactResult
from pretouch.uncertainty import Ensemble

from ..impact import ImpactModel
from ..objectives import OBSTACLE_SPEED
from ..quantities import quantity_of
from .problem import RobustProblem

__all__ = ["limit_slope", "objective_slope"]


def objective_slope(problem: RobustProblem, ensemble: Ensemble, result: ContactResult, name: str) -> FloatArray:
    """Differentiate the objective by an input.

    Args:
        problem: the problem, of which objective and impact are used.
        ensemble: the encounters.
        result: their contacts.
        name: the input.

    Returns:
        The derivative in SI, shape (n,).
    """
    total = np.zeros(len(ensemble))
    velocity = ensemble.scenario.obstacle.velocity
    for term in problem.objective.terms:
        level, scale = quantity_of(term.quantity, result.end, problem.impact), term.scale_for(ensemble.speed)
        own = _change(problem, ensemble, result, term.quantity, name)
        if term.scale == OBSTACLE_SPEED and name == "obstacle.velocity":
            own = own - level * np.sign(velocity) / scale
        total = total + 2 * term.weight * level * own / np.square(scale)
    return total


def limit_slope(problem: RobustProblem, which: int, ensemble: Ensemble, result: ContactResult, name: str) -> FloatArray:
    """Differentiate |quantity| / limit of a constraint by an input.

    Args:
        problem: the problem.
        which: the number of the constraint.
        ensemble: the encounters.
        result: their contacts.
        name: the input.

    Returns:
        The derivative in SI, shape (n,).
    """
    constraint = problem.limits[which].constraint
    sign = np.sign(quantity_of(constraint.quantity, result.end, problem.impact))
    return np.asarray(sign * _change(problem, ensemble, result, constraint.quantity, name) / constraint.limit)


def _change(problem: RobustProblem, ensemble: Ensemble, result: ContactResult, quantity: str, name: str) -> FloatArray:
    if quantity != "impact_force":
        return np.asarray(ensemble.slope(result, quantity, name))
    rate = cast("ImpactModel", problem.impact).peak_force_slope(result.end.relative_velocity)
    return np.asarray(rate * ensemble.slope(result, "relative_velocity", name))
