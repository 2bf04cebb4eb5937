"""The one change that would help most: every candidate is run with the noise that the verdict has met."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, GainLimit

from .candidates import Approach, Candidate, candidates_of
from .parts import StabilityCheck
from .problem import LoopProblem, Outcomes, Requirement, effect_of, mean_and_error
from .proposals import Change
from .stability import limit_of, stability_margin

__all__ = ["try_changes"]

_ERRORS: Final = 2.0  # standard errors that a change must gain: one in twenty does by chance
_WORTH: Final = 0.01  # of the objective: less is not worth a change
_MARGIN: Final = 2.0  # to instability: a change must not go below it
_FALL: Final = 0.8  # of the margin: what is left of it is said where it is less
_BEYOND: Final = 1e3  # a margin that needs no word


def try_changes(
    problem: LoopProblem,
    loop: ClosedLoop,
    gain: float,
    *,
    whole: Outcomes,
    part: Outcomes,
    other: tuple[float, Outcomes] | None,
    stability: StabilityCheck | None,
    limit: GainLimit | None,
    distance: FloatArray,
    fastest: float,
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
        stability: the margin of the gain; None where it is not known.
        limit: the strongest stable gains of the loop; None where they are not known.
        distance: those that the encounter passes [m].
        fastest: fastest approach [m/s].

    Returns:
        The changes, the most helpful first.
    """
    sensor, runs = problem.draws.sensor, part.result.shape[0]
    slope = np.abs(np.asarray(sensor.log_slope(distance)))
    approach = Approach(
        steepest=float(slope.max()),
        fastest=fastest,
        noise=_log_noise(loop, sensor, distance, slope),
        wanted_rate=_wanted_rate(stability),
    )
    before, found = None if stability is None else stability.margin, []
    if other is not None:
        better, outcomes = other
        after = stability_margin(limit, better)
        candidate = Candidate(name="gain", sentence=_redesign(gain, better, after), loop=loop)
        found.append(_compared(candidate, better, _Side(whole, before), _Side(outcomes, after)))
    for candidate in candidates_of(loop, approach):
        outcomes = problem.appraise(problem.compared(candidate.loop), gain, runs)
        after = None if limit is None else stability_margin(limit_of(candidate.loop, sensor, distance), gain)
        found.append(_compared(candidate, gain, _Side(part, before), _Side(outcomes, after)))
    return tuple(sorted(found, key=_rank))


def _wanted_rate(stability: StabilityCheck | None) -> float | None:
    """Return the rate that gives the gain the usual margin, where it has it not and any rate does."""
    if stability is None or stability.margin >= _MARGIN or not math.isfinite(stability.lowest_rate_with_margin):
        return None
    return max(stability.lowest_rate_with_margin, stability.rate)


def _redesign(gain: float, loop_gain: float, margin: float | None) -> str:
    """Say which gain to take, and how far the loop is from instability with it."""
    beside = "" if margin is None or margin > _BEYOND else f"; the loop is unstable at {margin:.3g} times that"
    return f"Take D_p = {format_quantity(loop_gain, 'N*s')} instead of {format_quantity(gain, 'N*s')}{beside}."


class _Side:
    """Outcomes with the margin to instability as one more requirement."""

    def __init__(self, outcomes: Outcomes, margin: float | None) -> None:
        self.outcomes, self.margin = outcomes, margin

    @property
    def stable(self) -> float:
        return 1.0 if self.margin is None else min(self.margin, 1.0)

    @property
    def standing(self) -> float:
        return min(self.outcomes.standing, self.stable)

    def requirement(self, name: str) -> Requirement:
        return next(r for r in self.outcomes.requirements if r.name == name)


def _compared(candidate: Candidate, gain: float, before: _Side, after: _Side) -> Change:
    worst = min(before.outcomes.requirements, key=lambda r: r.standing)
    same = after.requirement(worst.name)
    improvement, error = _improvement(before.outcomes.objective, after.outcomes.objective)
    mean = after.outcomes.mean
    return Change(
        name=candidate.name,
        sentence=_with_margin(candidate, before.margin, after.margin),
        gain=gain,
        objective=mean if math.isfinite(mean) else None,
        improvement=improvement,
        improvement_error=error,
        standing=after.standing,
        held=None if worst.is_met else float(same.held.mean()),
        margin=after.margin,
        helps=_is_stable(after.margin)
        and (
            _stands_better(before, after)
            or (
                after.standing >= before.standing
                and _keeps_margin(before.margin, after.margin)
                and improvement is not None
                and improvement > max(_ERRORS * (error or 0.0), _WORTH)
            )
        ),
    )


def _with_margin(candidate: Candidate, before: float | None, after: float | None) -> str:
    """Return the sentence of a change; where it costs margin to instability, with what is left of it."""
    if candidate.name == "gain" or before is None or after is None:  # another gain has it in its sentence
        return candidate.sentence
    if after > _BEYOND or after >= _FALL * before:
        return candidate.sentence
    was = f" from {before:.3g}" if math.isfinite(before) else ""
    return f"{candidate.sentence.removesuffix('.')}; the margin to instability falls{was} to {after:.3g}."


def _stands_better(before: _Side, after: _Side) -> bool:
    """Tell whether what was missed most is missed less, by more than chance."""
    if after.standing <= before.standing:
        return False
    if before.stable <= before.standing:  # it was the margin, which no chance moves
        return True
    if before.outcomes.softness <= before.standing:
        return _falls(before.outcomes, after.outcomes)
    worst = min(before.outcomes.requirements, key=lambda r: r.standing)
    same = after.requirement(worst.name)
    rise = same.held.astype(np.float64) - worst.held
    return float(rise.mean()) > _ERRORS * float(rise.std()) / math.sqrt(len(rise))


def _falls(before: Outcomes, after: Outcomes) -> bool:
    """Tell whether the speed at contact falls, by more than chance."""
    change = effect_of(after.result, before.result)
    return change is not None and change.is_softer


def _is_stable(margin: float | None) -> bool:
    return margin is None or margin >= 1


def _keeps_margin(before: float | None, after: float | None) -> bool:
    return before is None or (after is not None and after >= min(before, _MARGIN))


def _improvement(before: FloatArray, after: FloatArray) -> tuple[float | None, float | None]:
    """Return the mean fall of the objective run by run and its standard error, as shares of what it was."""
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
