"""How the optimum follows each input, exactly."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.chebyshev import chebyshev_basis, chebyshev_sum
from pretouch._core.numbers import FloatArray

from .constraints import Constraint
from .criteria import Criterion, along, ratio
from .problem import GainProblem

__all__ = ["follow_optimum", "has_gradients"]

_BASIS: Final = chebyshev_basis(9)
_HALF: Final = 0.08  # of u, from the optimum to the outermost samples: its eighth power is below the rounding of those
_BESIDE: Final = 0.5  # of that: no search is this far from its optimum


# Gradients of contacts go through the objective term by term. Along the coordinate u of the gain they are sampled at
# Chebyshev's nodes beside the optimum, which gives f_up and f_uu as first derivatives of what is exact: no difference
# is formed by any input.
def has_gradients(problem: GainProblem, constraint: Constraint | None) -> bool:
    """Tell whether encounters, objective and the active constraint, if any, have gradients."""
    limited = constraint is None or ratio(constraint, problem.task.impact).has_gradients
    return problem.is_differentiable and problem.merit.has_gradients and limited


def follow_optimum(
    problem: GainProblem,
    constraint: Constraint | None,
    *,
    gain: FloatArray,
    names: tuple[str, ...],
    held: bool = False,
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Differentiate optimal gains, shape (n,), and their objectives by inputs, as `ContactGradients` names them."""
    # Inside, f_u = 0 holds along with every change, so du/dp = -f_up / f_uu; on an active constraint G = limit holds,
    # so du/dp = -G_p / G_u; on a bound, where it is held, the gain stays. Each field of the scenario is a number or of
    # shape (n, 1). By name d D_p / d input [N s per unit] and d f / d input at the optimum, shape (n,); NaN where a
    # sample does not end in contact.
    axis = problem.axis
    center = axis.coordinate(gain)
    gains = axis.scale * np.sinh(center[:, None] + _HALF * _BASIS.nodes)
    stretch = np.hypot(gains, axis.scale)
    result = problem.run(gains)
    merit, velocity = problem.merit, problem.task.scenario.obstacle.velocity
    limited = None if constraint is None else ratio(constraint, problem.task.impact)

    def by(name: str, criterion: Criterion) -> FloatArray:
        return criterion.slope(result.end, along(result.gradients.of, name, velocity))

    slope = by("gain", merit) * stretch  # f_u
    free = limited is None and not held
    place = _root(slope) if free else np.zeros(len(gain))
    found = {}
    for name in names:
        by_input = by(name, merit)
        if limited is not None and not held:
            shift = -_value(by(name, limited), place) / _value(by("gain", limited) * stretch, place)
        elif held:
            shift = np.where(np.isfinite(_value(by_input, place)), 0.0, np.nan)
        else:
            shift = -_rise(by_input, place) / _rise(slope, place)
        total = _value(by_input, place) + _value(slope, place) * shift
        at = np.hypot(axis.scale * np.sinh(center + _HALF * place), axis.scale)
        found[name] = shift * at, total
    return found


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
