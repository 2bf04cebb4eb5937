"""The one change that would help most: every candidate is run with the noise that the verdict has met."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop

from .candidates import Candidate, candidates_of
from .change_wording import redesign_sentence
from .parts import Change
from .problem import LoopProblem, Outcomes, Requirement, mean_and_error
from .stability import limit_of, stability_margin

__all__ = ["try_changes"]

_ERRORS: Final = 2.0  # standard errors that a change must gain: one in twenty does by chance
_WORTH: Final = 0.01  # of the objective: less is not worth a change
_MARGIN: Final = 2.0  # to instability: a change must not go below it


def try_changes(
    problem: LoopProblem,
    loop: ClosedLoop,
    gain: float,
    *,
    whole: Outcomes,
    part: Outcomes,
    other: tuple[float, Outcomes] | None,
    distance: FloatArray,
    fastest: float,
    damper: bool,
) -> tuple[Change, ...]:
    """Run every candidate and rank them: first by the limits that are missed, then by the objective.

    Args:
        problem: what they are appraised by.
        loop: the loop as it is.
        gain: D_p [N s].
        whole: what it leads to on the loop as it is, over all runs.
        part: the same over the runs that candidates are compared by.
        other: a gain that was found to be better, with what it leads to over all runs: over those alone that it was
            chosen by, it would look better than it is.
        distance: those that the encounter passes [m].
        fastest: fastest approach [m/s].
        damper: whether the law acts as a damper, so that a stability limit is known.

    Returns:
        The changes, the most helpful first.
    """
    sensor, runs = problem.draws.sensor, part.result.shape[0]
    slope = np.abs(np.asarray(sensor.log_slope(distance)))
    noise = _log_noise(loop, sensor, distance, slope)

    def margin(of: ClosedLoop, own: float) -> float | None:
        return stability_margin(limit_of(of, sensor, distance), own) if damper else None

    before, found = margin(loop, gain), []
    if other is not None:
        better, outcomes = other
        after = margin(loop, better)
        candidate = Candidate(name="gain", sentence=redesign_sentence(gain, better, after), loop=loop)
        found.append(_compared(candidate, better, _Side(whole, before), _Side(outcomes, after)))
    for candidate in candidates_of(loop, steepest=float(slope.max()), fastest=fastest, noise=noise):
        outcomes = problem.appraise(candidate.loop, gain, runs)
        after = margin(candidate.loop, gain)
        found.append(_compared(candidate, gain, _Side(part, before), _Side(outcomes, after)))
    return tuple(sorted(found, key=_rank))


class _Side:
    """Outcomes with the margin to instability as one more requirement."""

    def __init__(self, outcomes: Outcomes, margin: float | None) -> None:
        self.outcomes, self.margin = outcomes, margin

    @property
    def standing(self) -> float:
        stable = 1.0 if self.margin is None else min(self.margin, 1.0)
        return min(self.outcomes.standing, stable)

    def requirement(self, name: str) -> Requirement | None:
        return next((r for r in self.outcomes.requirements if r.name == name), None)


def _compared(candidate: Candidate, gain: float, before: _Side, after: _Side) -> Change:
    worst = min(before.outcomes.requirements, key=lambda r: r.standing)
    same = after.requirement(worst.name)
    improvement, error = _improvement(before.outcomes.objective, after.outcomes.objective)
    mean = after.outcomes.mean
    return Change(
        name=candidate.name,
        sentence=candidate.sentence,
        gain=gain,
        objective=mean if math.isfinite(mean) else None,
        improvement=improvement,
        improvement_error=error,
        standing=after.standing,
        held=None if worst.is_met or same is None else float(same.held.mean()),
        margin=after.margin,
        helps=_stands_better(before, after)
        or (
            after.standing >= before.standing
            and _keeps_margin(before.margin, after.margin)
            and improvement is not None
            and improvement > max(_ERRORS * (error or 0.0), _WORTH)
        ),
    )


def _stands_better(before: _Side, after: _Side) -> bool:
    """Tell whether what was missed most is missed less, by more than chance."""
    if after.standing <= before.standing:
        return False
    worst = min(before.outcomes.requirements, key=lambda r: r.standing)
    same = after.requirement(worst.name)
    if before.outcomes.standing > before.standing or same is None:  # it was the margin, which no chance moves
        return True
    rise = same.held.astype(np.float64) - worst.held
    return float(rise.mean()) > _ERRORS * float(rise.std()) / math.sqrt(len(rise))


def _keeps_margin(before: float | None, after: float | None) -> bool:
    return before is None or (after is not None and after >= min(before, _MARGIN))


def _improvement(before: FloatArray | None, after: FloatArray | None) -> tuple[float | None, float | None]:
    """Return the mean fall of the objective run by run and its standard error, as shares of what it was."""
    if before is None or after is None:
        return None, None
    whole, _ = mean_and_error(before)
    with np.errstate(invalid="ignore"):
        fall, error = mean_and_error(before - after)
    if not (math.isfinite(whole) and math.isfinite(fall) and whole > 0):
        return None, None
    return fall / whole, error / whole if math.isfinite(error) else 0.0


def _log_noise(loop: ClosedLoop, sensor: SensorModel, distance: FloatArray, slope: FloatArray) -> float:
    """Return the largest standard deviation of ln xi of a reading, from contact to the start."""
    c, xi = loop.chain, np.exp(np.asarray(sensor.log_output(distance)))
    own = np.hypot(np.hypot(c.noise, c.relative_noise * xi) / xi, slope * c.distance_noise)
    return float(own.max())


def _rank(change: Change) -> tuple[bool, float, float]:
    # in what is missed, what differs by rounding is a tie
    gained = -math.inf if change.improvement is None else change.improvement
    return (not change.helps, -round(change.standing, 9), -gained)
