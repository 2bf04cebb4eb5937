"""Measure the processor time of pretouch and of a peer in turn, so that a drift of the machine affects both."""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .protocol import Way
from .work import Column, contacts, designs, drags

__all__ = [
    "Pair",
    "Problem",
    "cost",
    "exp_cost",
    "fresh",
    "in_turn",
    "inputs_for",
    "job_for",
    "problem_for",
    "relative_error",
    "timed",
    "used",
]

_SAMPLE = 2e-3  # [s]: shorter calls are repeated until they last this long
_ROUND = 0.05  # [s]: a round of a job takes samples for so long, and keeps the shortest
_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Times of two jobs that were run in turn.

    Args:
        first: the shortest time of the first [s].
        second: the shortest time of the second [s].
        ratio: the median over the rounds of second / first, each the shortest of its samples.
        rounds: number of rounds.
    """

    first: float
    second: float
    ratio: float
    rounds: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """The inputs of a case for one sensor, and the reference results.

    Args:
        inputs: (v, D_p) in case B, (v, phi) in case F, (v,) in the others.
        answers: contact times or gains.
    """

    inputs: tuple[Column, ...]
    answers: Column


def job_for(way: Way, problem: Problem) -> tuple[Callable[[], Any], int, Column]:
    """Prepare a method for as many solves as it can handle; return job, number of solves and reference results."""
    count = min(len(problem.answers), way.largest)
    job = way.make(*(column[:count] for column in problem.inputs))
    return job, count, problem.answers[:count]


def relative_error(found: Any, answers: Column) -> float:
    """Return the largest relative error; infinite if a result is not a number."""
    error = np.abs(np.asarray(found, dtype=np.float64) / answers - 1)
    return float(np.where(np.isfinite(error), error, np.inf).max())


def in_turn(first: Callable[[], Any], second: Callable[[], Any], budget: float, least: int = 3) -> Pair:
    """Run two jobs in turn for about `budget` seconds, `least` rounds at least; both must have run before."""
    end = time.perf_counter() + budget
    times: list[tuple[float, float]] = []
    repeats = [_repeats(timed(job, 1)) for job in (first, second)]
    while len(times) < least or (time.perf_counter() < end and len(times) < 1000):
        times.append((_best(first, repeats[0]), _best(second, repeats[1])))
    return Pair(
        first=min(a for a, _ in times),
        second=min(b for _, b in times),
        ratio=statistics.median(b / a for a, b in times),
        rounds=len(times),
    )


def cost(job: Callable[[], Any], budget: float) -> float:
    """Return the shortest time of a job [s] that has run before."""
    end = time.perf_counter() + budget
    best = timed(job, 1)
    repeats = _repeats(best)
    while time.perf_counter() < end:
        best = min(best, timed(job, repeats))
    return best


def _repeats(seconds: float) -> int:
    return max(1, int(_SAMPLE / max(seconds, 1e-9)))


def _best(job: Callable[[], Any], repeats: int) -> float:
    """Return the shortest of the samples of one round."""
    end = time.perf_counter() + _ROUND
    best = timed(job, repeats)
    while time.perf_counter() < end:
        best = min(best, timed(job, repeats))
    return best


def timed(job: Callable[[], Any], repeats: int) -> float:
    """Return the mean processor time of some calls of a job [s]; a job of another process measures it there."""
    if hasattr(job, "timed"):
        return float(job.timed(repeats))
    start = used()
    for _ in range(repeats):
        job()
    return (used() - start) / repeats


def used() -> float:
    """Return the processor time of this process, of all its threads and of its finished child processes [s]."""
    kinds = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(kind.ru_utime + kind.ru_stime for kind in kinds)


def fresh(peer: str, sensor: str, tree: Path = _ROOT) -> Callable[[], Column]:
    """Make the job of a fresh interpreter that designs one gain by a peer, with the pretouch of a source tree."""
    command = [sys.executable, "-m", "benchmarks.peers.fresh", peer, sensor]
    environment = {**os.environ, "PYTHONPATH": str(tree / "src")}

    def job() -> Column:
        run = subprocess.run(command, cwd=_ROOT, env=environment, capture_output=True, text=True, check=True)
        return np.array([float(run.stdout)])

    return job


def exp_cost() -> float:
    """Return the time of one exp() on this machine [s]: NumPy's vectorized one, on numbers in the cache."""
    numbers = np.linspace(-8.0, 0.0, 2048)
    out = np.empty_like(numbers)
    return cost(lambda: np.exp(numbers, out=out), 0.5) / len(numbers)


def inputs_for(case: str, count: int) -> tuple[Column, ...]:
    """Draw the inputs of a case: (v, D_p) of contacts, (v, phi) of contacts of a drag, (v,) of designs."""
    return {"B": contacts, "F": drags}.get(case, lambda count: (designs(count),))(count)


def problem_for(case: str, sensor: str, count: int) -> Problem:
    """Draw a problem and solve it by the reference."""
    from .reference import drag_times, limited_gains, trusted_gains, trusted_times  # noqa: PLC0415 - it loads pretouch

    inputs = inputs_for(case, count)
    trusted = {"B": trusted_times, "E": limited_gains, "F": drag_times}.get(case, trusted_gains)
    return Problem(inputs=inputs, answers=trusted(sensor, *inputs))
