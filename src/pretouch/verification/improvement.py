"""Search for the gain and the loop change that help most.

Every candidate is simulated with the same noise as the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray, finite_or_none
from pretouch._core.progress import note_work
from pretouch._core.values import Value
from pretouch.designs import GainDesign, Task
from pretouch.motion import ContactResult, LawNumber
from pretouch.simulation import GainLimit, SimulationResult

from .appraisal import (
    USUAL_MARGIN,
    LoopOutcomes,
    LoopProblem,
    Requirement,
    foreseen_impact,
    make_problem,
    part_of,
    status_of,
)
from .changed_loop import ChangedLoop, candidates_of
from .effect import SIGNIFICANT, VerdictStatus, effect_of, mean_and_error
from .gain_search import GainSearch, LoopCurve, runs_of_search, stable_axis
from .settings import Setting, settings_between
from .stability import Passed, StabilityCheck, limit_of, stability_margin

_WORTH: Final = 0.01  # smallest relative improvement of the objective that justifies a change
_FALL: Final = 0.8  # if a change reduces the margin below this share of it, the new margin is reported
_BEYOND: Final = 1e3  # a larger margin is not reported
_SAME: Final = 1e-6  # relative difference below which two gains are the same


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss(Value):
    """Objective of the verified gain compared with the best gain.

    Args:
        predicted: the objective of the nominal encounter in continuous time; None without contact.
        objective: the mean objective over the runs; None if a run ends without contact.
        standard_error: standard error of the mean objective.
        loop_gain: the best gain on the loop that meets the limits with a reserve, such as D_p [N s]; None if no tried
            gain does. The reserve is that of `LoopCurve`.
        sought_margin: gain margin required of the best gain: 2, or 1 if no gain within the bounds has 2; None if the
            margin is not known.
        loop_objective: the mean objective with the best gain, over the same runs.
        loss: mean over the runs of the objective with the verified gain minus that with the best gain.
        loss_error: standard error of the loss.
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
    """Simulated results after one change of the loop or of the gain.

    Args:
        name: short name, such as `sensor-rate`.
        sentence: what to do, with numbers.
        gain: the gain of these runs, such as D_p [N s].
        objective: the mean objective with the change; None if a run ends without contact.
        improvement: relative decrease of the objective; None if it is not known.
        improvement_error: standard error of the improvement.
        standing: score with the change, at most 1: the smallest ratio of the share of runs that meet a limit to the
            required share; lower if contact is no softer than without mitigation or the loop is unstable.
        held: share of the runs with the change that meet the limit that was missed most; None if none was missed.
        margin: gain margin with the change; None if it is not known.
        status: status by limits, effect and gain margin over the compared runs.
        helps: whether the loop stays stable and the change improves the status or is a significant improvement.
        settings: the change as keys of a scenario file and their new values; None removes a key.
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
    status: VerdictStatus
    helps: bool
    settings: Mapping[str, Setting] = field(default_factory=dict)


class Verified(NamedTuple):
    """The verified gain with its prediction, runs and stability."""

    gain: float  # such as D_p [N s]
    predicted: ContactResult  # the nominal encounter with the gain in continuous time
    outcomes: LoopOutcomes  # the outcomes on the loop, over all runs
    design: GainDesign  # the ideal design
    stability: StabilityCheck | None  # None if it is not known; `limit` is then None, too
    limit: GainLimit | None  # the strongest stable gains of the loop
    passed: Passed  # the distances that the encounter passes


class Improvements(NamedTuple):
    """Changes of the sampled loop and of its gain, with their results."""

    loss: Loss  # the verified gain compared with the best gain
    changes: tuple[LoopChange, ...]  # most helpful first
    unchanged: tuple[LoopChange, ...]  # the unchanged loop, over the runs of changes and over all runs
    search: GainSearch  # the search for the best gain on the unchanged loop
    best: tuple[float, SimulationResult] | None  # the best or nearest gain of the search, and all of its runs
    loops: tuple[ChangedLoop, ...]  # the loops of the changes, other than that of the gain


def find_improvements(problem: LoopProblem, verified: Verified) -> Improvements:
    """Find changes that improve the sampled loop or its gain."""
    task, gain, runs = problem.draws.task, verified.gain, problem.draws.compared
    loop = task.loop
    search = search_on_loop(problem, verified)
    optimum, best, runs_of_best, changes = search.best, None, None, []
    better = search.nearest() if optimum is None else optimum
    if better is not None:
        # All runs are used, because the gain would look too good on only those runs by which it was chosen.
        same, margin = math.isclose(better, gain, rel_tol=_SAME), stability_margin(verified.limit, better)
        outcomes = verified.outcomes if same else problem.appraise(problem.compared(loop), better)
        best, runs_of_best = None if optimum is None else outcomes.objective, (better, outcomes.result)
        if not same:
            candidate = ChangedLoop("gain", redesign(task.law.number, gain, better, margin), loop)
            changes.append(
                _evaluate_change(task, candidate, better, verified.outcomes, replace(outcomes, margin=margin))
            )
    first = part_of(verified.outcomes.result, slice(runs))
    part = replace(problem.appraised(first, loop, gain), margin=verified.outcomes.margin)
    candidates = _candidates(problem, verified)
    for number, candidate in enumerate(candidates, 1):
        note_work(f"simulating change {number} of {len(candidates)}")
        outcomes = problem.appraise(problem.compared(candidate.loop), gain, runs)
        after = None
        if verified.limit is not None:
            after = stability_margin(limit_of(candidate.loop, task.sensor, verified.passed), gain)
        changes.append(_evaluate_change(task, candidate, gain, part, replace(outcomes, margin=after)))
    same_loop = ChangedLoop("as-it-is", "", loop)
    references = (part, verified.outcomes)[: 2 if runs < task.verify.runs else 1]
    unchanged = tuple(_evaluate_change(task, same_loop, gain, reference, reference) for reference in references)
    loss = _loss(task, verified, search, optimum, best)
    return Improvements(loss, tuple(sorted(changes, key=_rank)), unchanged, search, runs_of_best, tuple(candidates))


def _candidates(problem: LoopProblem, verified: Verified) -> list[ChangedLoop]:
    """Return changes of the loop that may improve the result."""
    check, rate, draws = verified.stability, None, problem.draws
    if check is not None and check.margin < USUAL_MARGIN and math.isfinite(check.lowest_rate_for_margin_2):
        rate = max(check.lowest_rate_for_margin_2, check.rate)
    start = float(np.exp(draws.task.sensor.log_output(float(draws.distance.mean()))))
    most = draws.task.largest_sensor_rate
    return candidates_of(
        draws.task.loop, *problem.changes_of_level(verified.passed[0]), rate, start, most=most, gain=verified.gain
    )


def _loss(task: Task, verified: Verified, search: GainSearch, optimum: float | None, best: FloatArray | None) -> Loss:
    """Compare the objectives of the verified and the best gain."""
    predicted, ideal = verified.predicted, None
    if predicted.reached.all():
        speed = abs(task.scenario.obstacle.velocity)
        ideal = float(task.goal.value(predicted.end, speed, foreseen_impact(task)))
    own, best_objective = verified.outcomes.objective, np.full(task.verify.runs, np.nan) if best is None else best
    mean, error = mean_and_error(own)
    with np.errstate(invalid="ignore"):
        loss, loss_error = mean_and_error(own - best_objective)
    return Loss(
        predicted=ideal,
        objective=finite_or_none(mean),
        standard_error=finite_or_none(error),
        loop_gain=optimum,
        sought_margin=search.margin,
        loop_objective=finite_or_none(mean_and_error(best_objective)[0]),
        loss=finite_or_none(loss),
        loss_error=finite_or_none(loss_error),
        curve=search.curve,
    )


def search_on_loop(problem: LoopProblem, verified: Verified) -> GainSearch:
    """Search for the best gain on the sampled loop.

    The search also tries the verified gain and the ideal gain.

    Returns:
        The search, with all tried gains.
    """
    task = problem.draws.task
    runs = runs_of_search(task, problem.draws.compared)
    if runs > task.verify.runs:
        problem = make_problem(task.replace(verify=replace(task.verify, runs=runs)), verified.gain)
    axis, margin = stable_axis(task, verified.limit)
    search = GainSearch(problem=problem, loop=task.loop, axis=axis, margin=margin, runs=runs)
    search.run([g for g in (verified.gain, verified.design.gain) if g is not None])
    return search if search.best is not None else search.relaxed()


def redesign(number: LawNumber, gain: float, loop_gain: float, margin: float | None) -> str:
    """Return a sentence that recommends another gain."""
    stable = "" if margin is None or margin > _BEYOND else f" (gain margin {margin:.3g})"
    return f"Use {number.equals(loop_gain)} instead of {number.text(gain)}{stable}."


def _evaluate_change(
    task: Task, candidate: ChangedLoop, gain: float, before: LoopOutcomes, after: LoopOutcomes
) -> LoopChange:
    worst, same = _worst_of_both(before, after)
    improvement, error = _improvement(before.objective, after.objective)
    kept = before.margin is None or (after.margin is not None and after.margin >= min(before.margin, USUAL_MARGIN))
    gains = improvement is not None and improvement > max(SIGNIFICANT * (error or 0.0), _WORTH)
    better = after.standing >= before.standing and kept and gains
    was, status = status_of(task, before), status_of(task, after)
    turns = status.place < was.place
    return LoopChange(
        name=candidate.name,
        sentence=_add_margin(candidate, before.margin, after.margin),
        gain=gain,
        objective=finite_or_none(after.mean),
        improvement=improvement,
        improvement_error=error,
        standing=after.standing,
        held=None if worst.is_met else float(same.held.mean()),
        margin=after.margin,
        status=status,
        helps=after.stable == 1 and (turns or _meets_more_often(before, after) or better),
        settings=settings_between(
            task, task.replace(gain=gain if candidate.name == "gain" else task.gain, loop=candidate.loop)
        ),
    )


def _worst_of_both(before: LoopOutcomes, after: LoopOutcomes) -> tuple[Requirement, Requirement]:
    """Return the most missed requirement, evaluated before and after a change.

    It is the one that was missed most before the change.
    """
    worst = before.worst
    return worst, next(r for r in after.requirements if r.name == worst.name)


def _add_margin(candidate: ChangedLoop, before: float | None, after: float | None) -> str:
    """Add a warning about a smaller gain margin to a recommendation."""
    if candidate.name == "gain" or before is None or after is None:  # for a gain, the sentence already has the margin
        return candidate.sentence
    if after > _BEYOND or after >= _FALL * before:
        return candidate.sentence
    was = f" from {before:.3g}" if math.isfinite(before) else ""
    return f"{candidate.sentence.removesuffix('.')}; the gain margin falls{was} to {after:.3g}."


def _meets_more_often(before: LoopOutcomes, after: LoopOutcomes) -> bool:
    """Return True if a change significantly improves the lowest score.

    Scores rate each requirement, stability and the contact speed.
    """
    if after.standing <= before.standing:
        return False
    if before.stable <= before.standing:  # the margin was decisive; it does not depend on chance
        return True
    if before.softness <= before.standing:
        change = effect_of(after.result, before.result)  # whether the speed at contact falls
        return change is not None and change.is_softer
    worst, same = _worst_of_both(before, after)
    rise = same.held.astype(np.float64) - worst.held
    return float(rise.mean()) > SIGNIFICANT * float(rise.std()) / math.sqrt(len(rise))


def _improvement(before: FloatArray, after: FloatArray) -> tuple[float | None, float | None]:
    """Return the relative decrease of the objective and its standard error."""
    whole, _ = mean_and_error(before)
    with np.errstate(invalid="ignore"):
        fall, error = mean_and_error(before - after)
    if not (math.isfinite(whole) and math.isfinite(fall) and whole > 0):
        return None, None
    return fall / whole, error / whole if math.isfinite(error) else 0.0


def _rank(change: LoopChange) -> tuple[bool, int, float, float]:
    # Scores that differ only by rounding count as equal.
    gained = -math.inf if change.improvement is None else change.improvement
    return (not change.helps, change.status.place, -round(change.standing, 9), -gained)
