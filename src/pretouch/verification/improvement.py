"""What could be better: the best gain for this loop, what the verified one loses beside it, and the changes."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray, finite_or_none
from pretouch.design import GainDesign
from pretouch.simulation import GainLimit, SimulationResult

from .best_gain import LoopOptimum, best_on_loop
from .changes import try_changes
from .parts import StabilityCheck
from .problem import LoopProblem, Outcomes, mean_and_error
from .proposals import Loss
from .request import Request

__all__ = ["compared_runs", "find_improvements"]

_SAME: Final = 1e-6  # of a gain
_COMPARED: Final = 200
_COMPARED_SENSORS: Final = 100  # where each run has a sensor curve of its own, which is tabulated first


def find_improvements(
    r: Request,
    problem: LoopProblem,
    outcomes: Outcomes,
    gain: float,
    *,
    design: GainDesign,
    stability: StabilityCheck | None,
    limit: GainLimit | None,
    distance: FloatArray,
    fastest: float,
) -> dict[str, Any]:
    """Find the best gain on the loop and try the changes.

    Args:
        r: what was asked.
        problem: what gains and changes are appraised by.
        outcomes: what the verified gain leads to.
        gain: D_p [N s], the verified one.
        design: the ideal design.
        stability: the margin of the verified gain; None where it is not known.
        limit: the strongest stable gains of the loop; None where they are not known.
        distance: those that the encounter passes [m].
        fastest: fastest approach [m/s].

    Returns:
        `loss` and `changes` of the verdict.
    """
    runs, other = compared_runs(problem), None
    optimum = best_on_loop(
        problem,
        r.loop,
        r.bounds,
        limit=limit,
        runs=runs,
        among=[g for g in (gain, design.gain) if g is not None],
    )
    better = optimum.nearest if optimum.gain is None else optimum.gain
    if better is not None and not math.isclose(better, gain, rel_tol=_SAME):
        other = better, problem.appraise(r.loop, better)
    best = None if optimum.gain is None else outcomes if other is None else other[1]
    tried = try_changes(
        problem,
        r.loop,
        gain,
        whole=outcomes,
        part=problem.appraised(_first(outcomes.result, runs), r.loop, gain),
        other=other,
        stability=stability,
        limit=limit,
        distance=distance,
        fastest=fastest,
    )
    return {"loss": _loss(r, outcomes, gain, optimum, best), "changes": tried}


def _first(result: SimulationResult, count: int) -> SimulationResult:
    columns = {name: column[:count] for name, column in result.columns.items()}
    return SimulationResult(columns, result.contact_list[:count], result.trace_of)


def _loss(r: Request, outcomes: Outcomes, gain: float, optimum: LoopOptimum, best: Outcomes | None) -> Loss:
    predicted, ideal = r.contact(gain), None
    if predicted.reached.all():
        ideal = float(r.objective.value(predicted.end, abs(r.scenario.obstacle.velocity), r.foreseen_impact))
    own, other = outcomes.objective, np.full(r.runs, np.nan) if best is None else best.objective
    mean, error = mean_and_error(own)
    with np.errstate(invalid="ignore"):
        loss, loss_error = mean_and_error(own - other)
    return Loss(
        predicted=ideal,
        objective=finite_or_none(mean),
        standard_error=finite_or_none(error),
        loop_gain=optimum.gain,
        sought_margin=optimum.sought_margin,
        loop_objective=finite_or_none(mean_and_error(other)[0]),
        loss=finite_or_none(loss),
        loss_error=finite_or_none(loss_error),
        curve=optimum.curve,
    )


def compared_runs(problem: LoopProblem) -> int:
    """Return how many of the runs changes and gains are compared by.

    Args:
        problem: the problem.

    Returns:
        The number.
    """
    return min(problem.draws.count, _COMPARED_SENSORS if problem.draws.own_sensors else _COMPARED)
