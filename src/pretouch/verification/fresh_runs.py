"""Simulate encounters and noise that no search has used, to confirm an advice."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pretouch.designs import Task

from .appraisal import LoopOutcomes, LoopProblem, draw_encounters
from .gain_search import runs_of_search
from .reasons import likely_runs

_FRESH: Final = 1  # added to the seed for the encounters and the noise of fresh runs
_FRESH_RUNS: Final = 1000  # number of fresh runs that confirm an advice about limits, at least
_FRESH_SENSORS: Final = 300  # the same if each run has its own sensor curve
_FRESH_ALWAYS: Final = 200  # the same without limits
_FACTOR: Final = 2  # fresh runs, as a multiple of the smallest number that can demonstrate a probability


def fresh_runs(task: Task) -> int:
    """Return how many fresh runs confirm an advice."""
    if not task.constraints:
        return _FRESH_ALWAYS
    uncertain = any(name.startswith("sensor.") for name in task.uncertainty)
    needed = runs_of_search(task, 0) * _FACTOR
    return max(_FRESH_SENSORS if uncertain else _FRESH_RUNS, needed)


def runs_that_show(outcomes: LoopOutcomes, confidence: float) -> int:
    """Return how many runs are likely to demonstrate every required probability; 0 if too many are needed."""
    counts = [
        likely_runs(int(r.held.sum()), len(r.held), r.probability, confidence)
        for r in outcomes.requirements
        if r.probability < 1
    ]
    return max((count or 0 for count in counts), default=0)


def fresh_outcomes(task: Task, count: int) -> LoopOutcomes:
    """Return the outcomes of a gain in encounters and noise that no search has used."""
    loop = replace(task.loop, seed=task.loop.seed + _FRESH)
    fresh = task.replace(loop=loop, verify=replace(task.verify, runs=count))
    draws = draw_encounters(fresh)
    gain = float(task.gain or 0.0)
    problem = LoopProblem(draws=draws, predicted=np.isfinite(draws.predicted(gain)[0]), unmitigated=None)
    return problem.appraise(problem.compared(loop), gain)
