"""How the objective and the constraints of encounters follow their inputs, by exact gradients."""

from __future__ import annotations

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.motion import ContactResult
from pretouch.uncertainty import Ensemble

from .. import gradient
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
    velocity = ensemble.scenario.obstacle.velocity
    of = _along(ensemble, result, name)
    return gradient.objective_slope(
        problem.objective, result.end, velocity=velocity, impact=problem.impact, by=name, of=of
    )


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
    of = _along(ensemble, result, name)
    return gradient.constraint_slope(constraint, result.end, problem.impact, of) / constraint.limit


def _along(ensemble: Ensemble, result: ContactResult, name: str) -> gradient.Slope:
    return lambda quantity: np.asarray(ensemble.slope(result, quantity, name))
