"""What would help: the best gain for the loop and what the verified one loses beside it, and the one best change.

Every candidate is run with the noise that the verdict has met.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, finite_or_none
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.design import GainDesign, Task
from pretouch.motion import ContactResult
from pretouch.simulation import GainLimit

from .appraisal import LoopOutcomes, LoopProblem, Requirement, effect_of, mean_and_error, part_of
from .best_gain import LoopCurve, LoopOptimum, best_on_loop
from .candidates import Approach, Candidate, candidates_of
from .request import foreseen_impact
from .stability import StabilityCheck, limit_of, stability_margin

__all__ = ["LoopChange", "Loss", "Verified", "find_improvements"]

_ERRORS: Final = 2.0  # standard errors that a change must gain: one in twenty does by chance
_WORTH: Final = 0.01  # of the objective: less is not worth a change
_MARGIN: Final = 2.0  # to instability: a change must not go below it
_FALL: Final = 0.8  # of the margin: what is left of it is said where it is less
_BEYOND: Final = 1e3  # a margin that needs no word
_SAME: Final = 1e-6  # of a gain


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss(Value):
    """What the gain costs beside the best one for this loop.

    Args:
        predicted: the objective of the nominal encounter in continuous time; None without contact.
        objective: its mean over the runs; None where a run ends without contact.
        standard_error: of that mean.
        loop_gain: the best gain on the loop that keeps the limits [N s]; None where none that was tried does.
        sought_margin: to instability, which the best gain was sought with: 2; 1 where no gain within the bounds has
            that; None where the margin is not known.
        loop_objective: the mean objective with that gain, over the same runs.
        loss: mean of objective - objective with the loop gain, run by run.
        loss_error: standard error of that mean.
        curve: the gains that were tried.
    """

    predicted: float | None
    objective: float | None
    standard_error: float | None
    loop_gain: float | None
    sought_margin: float | None
    loop_objective: float | None
    loss: float | None
    loss_error: float | None
    curve: LoopCurve


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopChange(Value):
    """One change of the loop or the gain, as it was simulated.

    Args:
        name: short name, such as `sensor-rate`.
        sentence: what to do, with numbers.
        gain: D_p with which it was run [N s].
        objective: the mean objective with it; None where a run ends without contact.
        improvement: by how much the objective falls, as a share of what it was; None where either is not known.
        improvement_error: standard error of that.
        standing: the least share of runs in which a limit holds beside the share required, with it; at most 1, less
            where contact is harder than without mitigation or the loop unstable.
        held: the share of runs with it in which the limit holds that was missed most; None where none was missed.
        margin: to instability with it; None where that is not known.
        helps: whether it gains more than chance can, and leaves the loop stable.
    """

    name: str
    sentence: str
    gain: float
    objective: float | None
    improvement: float | None
    improvement_error: float | None
    standing: float
    held: float | None
    margin: float | None
    helps: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verified:
    """The verified gain, and what is known of it before anything else is tried.

    Args:
        gain: D_p [N s].
        predicted: the nominal encounter with it in continuous time.
        outcomes: what it leads to on the loop, over all runs.
        design: the ideal design.
        stability: its margin; None where it is not known.
        limit: the strongest stable gains of the loop; None where they are not known.
        distance: those that the encounter passes [m].
    """

    gain: float
    predicted: ContactResult
    outcomes: LoopOutcomes
    design: GainDesign
    stability: StabilityCheck | None
    limit: GainLimit | None
    distance: FloatArray


def find_improvements(problem: LoopProblem, known: Verified) -> tuple[Loss, tuple[LoopChange, ...]]:
    """Find the best gain on the loop and try the changes of what a verified gain runs on.

    Returns:
        What the verified gain loses, and the changes: first by the limits that are missed, then by the objective.
    """
    task, gain, runs = problem.draws.task, known.gain, problem.draws.compared
    loop = task.loop
    among = [g for g in (gain, known.design.gain) if g is not None]
    optimum = best_on_loop(problem, known.limit, among)
    better, best = optimum.nearest if optimum.gain is None else optimum.gain, known.outcomes
    found = []
    if better is not None and not math.isclose(better, gain, rel_tol=_SAME):
        # over all runs: over those alone that it was chosen by, it would look better than it is
        margin = stability_margin(known.limit, better)
        best = replace(problem.appraise(problem.compared(loop), better), margin=margin)
        candidate = Candidate(name="gain", sentence=_redesign(gain, better, margin), loop=loop)
        found.append(_compared(candidate, better, known.outcomes, best))
    first = part_of(known.outcomes.result, slice(runs))
    part = replace(problem.appraised(first, loop, gain), margin=known.outcomes.margin)
    for candidate in candidates_of(loop, _approach(problem, known)):
        outcomes = problem.appraise(problem.compared(candidate.loop), gain, runs)
        after = None
        if known.limit is not None:
            after = stability_margin(limit_of(candidate.loop, task.sensor, known.distance), gain)
        found.append(_compared(candidate, gain, part, replace(outcomes, margin=after)))
    return _loss(task, known, optimum, None if optimum.gain is None else best), tuple(sorted(found, key=_rank))


def _approach(problem: LoopProblem, known: Verified) -> Approach:
    """Return what changes are measured by; readings are noisiest where ln xi deviates most, from contact to start."""
    draws, check = problem.draws, known.stability
    sensor, c = draws.task.sensor, draws.task.loop.chain
    slope = np.abs(np.asarray(sensor.log_slope(known.distance)))
    xi = np.exp(np.asarray(sensor.log_output(known.distance)))
    noise = np.hypot(np.hypot(c.noise, c.relative_noise * xi) / xi, slope * c.distance_noise)
    ends = np.abs(problem.unmitigated.relative_velocity[problem.unmitigated.touched])
    wanted = None
    if check is not None and check.margin < _MARGIN and math.isfinite(check.lowest_rate_with_margin):
        wanted = max(check.lowest_rate_with_margin, check.rate)
    return Approach(
        steepest=float(slope.max()),
        fastest=float(max(ends.max(initial=0.0), np.abs(draws.scenarios.relative_velocity).max())),
        noise=float(noise.max()),
        wanted_rate=wanted,
    )


def _loss(task: Task, known: Verified, optimum: LoopOptimum, best: LoopOutcomes | None) -> Loss:
    predicted, ideal = known.predicted, None
    if predicted.reached.all():
        speed = abs(task.scenario.obstacle.velocity)
        ideal = float(task.goal.value(predicted.end, speed, foreseen_impact(task)))
    own, other = known.outcomes.objective, np.full(task.runs, np.nan) if best is None else best.objective
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


def _redesign(gain: float, loop_gain: float, margin: float | None) -> str:
    """Say which gain to take, and how far the loop is from instability with it."""
    beside = "" if margin is None or margin > _BEYOND else f"; the loop is unstable at {margin:.3g} times that"
    return f"Take D_p = {format_quantity(loop_gain, 'N*s')} instead of {format_quantity(gain, 'N*s')}{beside}."


def _compared(candidate: Candidate, gain: float, before: LoopOutcomes, after: LoopOutcomes) -> LoopChange:
    worst, same = _worst_of_both(before, after)
    improvement, error = _improvement(before.objective, after.objective)
    mean = after.mean
    return LoopChange(
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


def _worst_of_both(before: LoopOutcomes, after: LoopOutcomes) -> tuple[Requirement, Requirement]:
    """Return what was missed most, before and after."""
    worst = before.worst
    return worst, next(r for r in after.requirements if r.name == worst.name)


def _with_margin(candidate: Candidate, before: float | None, after: float | None) -> str:
    """Return the sentence of a change; where it costs margin to instability, with what is left of it."""
    if candidate.name == "gain" or before is None or after is None:  # another gain has it in its sentence
        return candidate.sentence
    if after > _BEYOND or after >= _FALL * before:
        return candidate.sentence
    was = f" from {before:.3g}" if math.isfinite(before) else ""
    return f"{candidate.sentence.removesuffix('.')}; the margin to instability falls{was} to {after:.3g}."


def _stands_better(before: LoopOutcomes, after: LoopOutcomes) -> bool:
    """Tell whether what was missed most is missed less, by more than chance."""
    if after.standing <= before.standing:
        return False
    if before.stable <= before.standing:  # it was the margin, which no chance moves
        return True
    if before.softness <= before.standing:
        return _falls(before, after)
    worst, same = _worst_of_both(before, after)
    rise = same.held.astype(np.float64) - worst.held
    return float(rise.mean()) > _ERRORS * float(rise.std()) / math.sqrt(len(rise))


def _falls(before: LoopOutcomes, after: LoopOutcomes) -> bool:
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


def _rank(change: LoopChange) -> tuple[bool, float, float]:
    # in what is missed, what differs by rounding is a tie
    gained = -math.inf if change.improvement is None else change.improvement
    return (not change.helps, -round(change.standing, 9), -gained)
