"""What could be better: the best gain for this loop, what the verified one loses beside it, and the changes."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.design import GainDesign

from .best_gain import LoopOptimum, best_on_loop
from .changes import try_changes
from .parts import Loss
from .problem import LoopProblem, Outcomes, mean_and_error
from .request import Request
from .stability import limit_of

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
    distance: FloatArray,
    fastest: float,
    damper: bool,
) -> dict[str, Any]:
    """Find the best gain on the loop and try the changes.

    Args:
        r: what was asked.
        problem: what gains and changes are appraised by.
        outcomes: what the verified gain leads to.
        gain: D_p [N s], the verified one.
        design: the ideal design.
        distance: those that the encounter passes [m].
        fastest: fastest approach [m/s].
        damper: whether the law acts as a damper, so that a stability limit is known.

    Returns:
        `loss` and `changes` of the verdict.
    """
    runs, other, loss = compared_runs(problem), None, None
    if outcomes.objective is not None:
        limit = limit_of(r.loop, r.sensor, distance) if damper else None
        optimum = best_on_loop(
            problem,
            r.loop,
            r.bounds,
            strongest=-np.inf if limit is None else limit.strongest,
            runs=runs,
            among=[g for g in (gain, design.gain) if g is not None],
        )
        better = optimum.nearest if optimum.gain is None else optimum.gain
        if better is not None and not math.isclose(better, gain, rel_tol=_SAME):
            other = better, problem.appraise(r.loop, better)
        best = None if optimum.gain is None else outcomes if other is None else other[1]
        loss = _loss(r, outcomes, gain, optimum, best)
    tried = try_changes(
        problem,
        r.loop,
        gain,
        whole=outcomes,
        part=outcomes if runs == r.runs else problem.appraise(r.loop, gain, runs),
        other=other,
        distance=distance,
        fastest=fastest,
        damper=damper,
    )
    return {"loss": loss, "changes": tried}


def _loss(r: Request, outcomes: Outcomes, gain: float, optimum: LoopOptimum, best: Outcomes | None) -> Loss:
    predicted, ideal = r.contact(gain), None
    if predicted.reached.all():
        ideal = float(r.objective.value(predicted.end, abs(r.scenario.obstacle.velocity), r.foreseen_impact))
    nothing = np.full(r.runs, np.nan)
    own = nothing if outcomes.objective is None else outcomes.objective
    other = nothing if best is None or best.objective is None else best.objective
    mean, error = mean_and_error(own)
    with np.errstate(invalid="ignore"):
        loss, loss_error = mean_and_error(own - other)
    return Loss(
        predicted=ideal,
        objective=_number(mean),
        standard_error=_number(error),
        loop_gain=optimum.gain,
        loop_objective=_number(mean_and_error(other)[0]),
        loss=_number(loss),
        loss_error=_number(loss_error),
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


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
