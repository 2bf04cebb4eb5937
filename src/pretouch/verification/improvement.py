"""Search for the gain and the loop change that help most.

Every candidate is simulated with the same noise as the verdict.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray, finite_or_none
from pretouch._core.progress import note_work
from pretouch._core.values import Value
from pretouch.design import GainDesign, Task
from pretouch.design.search import RUNS, GainAxis, Landscape, refine, scan
from pretouch.motion import ContactResult, LawNumber
from pretouch.simulation import GainLimit

from .appraisal import USUAL_MARGIN, LoopOutcomes, LoopProblem, Requirement, foreseen_impact, part_of, status_of
from .effect import SIGNIFICANT, VerdictStatus, effect_of, mean_and_error
from .stability import ChangedLoop, Passed, StabilityCheck, candidates_of, limit_of, stability_margin

_WORTH: Final = 0.01  # smallest relative improvement of the objective that justifies a change
_FALL: Final = 0.8  # if a change reduces the margin below this share of it, the new margin is reported
_BEYOND: Final = 1e3  # a larger margin is not reported
_SAME: Final = 1e-6  # relative difference below which two gains are the same
_ORDER: Final = (VerdictStatus.DOES_NOT_HOLD, VerdictStatus.HOLDS_NARROWLY, VerdictStatus.HOLDS)
_DIGITS: Final = 12  # decimals of u = ln|D_p| that distinguish two gains


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopCurve(Value):
    """Simulated results of all gains tried on the sampled loop.

    Args:
        gain: the law's number, such as D_p [N s], ascending, shape (n,).
        objective: mean objective over the runs; infinite if a run ends without contact.
        standing: score, at most 1: the smallest ratio of the share of runs that meet a limit to the required share;
            lower if contact is no softer than without mitigation.
        share: share of the runs that meet all limits.
        runs: number of runs of each gain. It is smaller if the first runs already show that the gain misses a
            requirement; the other columns are then results of these runs.
    """

    gain: FloatArray
    objective: FloatArray
    standing: FloatArray
    share: FloatArray
    runs: IntArray

    def __repr__(self) -> str:
        if not len(self.gain):
            return "<LoopCurve: no gain>"
        first, last = self.gain[0], self.gain[-1]
        runs = f"at most {self.runs.max()} runs for each gain"
        return f"<LoopCurve: {len(self.gain)} gains from {first:g} to {last:g}, {runs}>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss(Value):
    """Objective of the verified gain compared with the best gain.

    Args:
        predicted: the objective of the nominal encounter in continuous time; None without contact.
        objective: the mean objective over the runs; None if a run ends without contact.
        standard_error: standard error of the mean objective.
        loop_gain: the best gain on the loop that meets the limits, such as D_p [N s]; None if no tried gain does.
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


class Verified(NamedTuple):
    """The verified gain with its prediction, runs and stability."""

    gain: float  # such as D_p [N s]
    predicted: ContactResult  # the nominal encounter with the gain in continuous time
    outcomes: LoopOutcomes  # the outcomes on the loop, over all runs
    design: GainDesign  # the ideal design
    stability: StabilityCheck | None  # None if it is not known; `limit` is then None, too
    limit: GainLimit | None  # the strongest stable gains of the loop
    passed: Passed  # the distances that the encounter passes


def find_improvements(
    problem: LoopProblem, verified: Verified
) -> tuple[Loss, tuple[LoopChange, ...], tuple[LoopChange, ...]]:
    """Find changes that improve the sampled loop or its gain.

    Returns:
        The comparison of the verified gain with the best gain, the changes, and the results for the unchanged loop.
    """
    task, gain, runs = problem.draws.task, verified.gain, problem.draws.compared
    loop = task.loop
    search = _best_on_loop(problem, verified)
    optimum, best, changes = search.best, None, []
    better = search.nearest() if optimum is None else optimum
    if better is not None:
        # All runs are used, because the gain would look too good on only those runs by which it was chosen.
        same, margin = math.isclose(better, gain, rel_tol=_SAME), stability_margin(verified.limit, better)
        outcomes = verified.outcomes if same else problem.appraise(problem.compared(loop), better)
        best = None if optimum is None else outcomes.objective
        if not same:
            candidate = ChangedLoop("gain", _redesign(problem.draws.task.law.number, gain, better, margin), loop)
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
    return _loss(task, verified, search, best), tuple(sorted(changes, key=_rank)), unchanged


def _candidates(problem: LoopProblem, verified: Verified) -> list[ChangedLoop]:
    """Return changes of the loop that may improve the result."""
    check, rate = verified.stability, None
    if check is not None and check.margin < USUAL_MARGIN and math.isfinite(check.lowest_rate_for_margin_2):
        rate = max(check.lowest_rate_for_margin_2, check.rate)
    return candidates_of(problem.draws.task.loop, *problem.changes_of_level(verified.passed[0]), rate)


def _loss(task: Task, verified: Verified, search: _Search, best: FloatArray | None) -> Loss:
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
        loop_gain=search.best,
        sought_margin=search.margin,
        loop_objective=finite_or_none(mean_and_error(best_objective)[0]),
        loss=finite_or_none(loss),
        loss_error=finite_or_none(loss_error),
        curve=search.curve,
    )


class _Tried(NamedTuple):
    """Summary of the simulated results of one tried gain."""

    gain: float  # the law's number, such as D_p [N s]
    objective: float  # the mean objective
    standing: float  # score, at most 1
    share: float  # share of the runs that meet all limits
    kept: bool  # whether all requirements are met
    runs: int  # number of runs
    bound: float  # the score is at most this after all runs


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Search:
    """Search for the best gain on the sampled loop.

    All gains are simulated with the same encounters and noise.
    """

    problem: LoopProblem
    axis: GainAxis
    margin: float | None  # gain margin that all gains on the axis have; None if it is not known
    tried: dict[float, _Tried] = field(default_factory=dict)  # the tried gains by coordinate

    def merit(self, coordinate: FloatArray) -> FloatArray:
        """Return the mean objective of each gain.

        It is infinite for a gain that misses a requirement.
        """
        places = {round(u, _DIGITS): u for u in coordinate.tolist()}
        new = {place: u for place, u in places.items() if place not in self.tried}
        if new:
            gains = self.axis.gain(np.array(list(new.values())))
            note_work(
                f"searching for the best gain on the simulated loop; {len(self.tried)} gains were simulated so far"
            )
            for place, gain, o in zip(new, gains.tolist(), self.problem.appraise_each(gains), strict=True):
                self.tried[place] = self._tried(gain, o)
        of = (self.tried[round(u, _DIGITS)] for u in coordinate.tolist())
        return np.array([one.objective if one.kept else math.inf for one in of])

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Return the mean objectives for the search algorithm."""
        return Landscape(objective=self.merit(coordinate), ratios=np.empty((0, len(coordinate))))

    @property
    def best(self) -> float | None:
        """The best tried gain that meets all requirements.

        None if no tried gain meets all of them.
        """
        kept = [one for one in sorted(self.tried.values()) if one.kept]
        return min(kept, key=lambda one: one.objective).gain if kept else None

    def _tried(self, gain: float, outcomes: LoopOutcomes) -> _Tried:
        """Summarize the simulated results of a gain."""
        runs = outcomes.result.shape[0]
        open_runs = self.problem.draws.compared - runs
        bound = outcomes.best_standing(open_runs) if open_runs else outcomes.standing
        return _Tried(
            *(gain, outcomes.mean, outcomes.standing, outcomes.whole_share, outcomes.is_kept and not open_runs),
            *(runs, bound),
        )

    def nearest(self) -> float | None:
        """Return the tried gain with the best score over all runs.

        None if no gain was tried.
        """
        # Gains that were given up are simulated further, as long as their score can still be the best one.
        whole, loop = self.problem.draws.compared, self.problem.compared(self.problem.draws.task.loop)
        while self.tried:
            complete = [one for one in sorted(self.tried.values()) if one.runs == whole]
            best = max(complete, key=lambda one: (one.standing, -one.objective), default=None)
            place, most = max(
                ((place, one) for place, one in self.tried.items() if one.runs < whole),
                key=lambda item: item[1].bound,
                default=(0.0, best),
            )
            if best is not None and (most is best or most is None or most.bound < best.standing):
                return best.gain
            if most is not None:
                self.tried[place] = self._tried(most.gain, self.problem.appraise(loop, most.gain, whole))
        return None

    @property
    def curve(self) -> LoopCurve:
        """The results of all tried gains, sorted by the gain."""
        columns = np.array(sorted(self.tried.values()), dtype=np.float64).reshape(-1, len(_Tried._fields)).T
        gain, objective, standing, share, _, runs, _ = columns
        return LoopCurve(gain=gain, objective=objective, standing=standing, share=share, runs=runs.astype(np.int64))


def _best_on_loop(problem: LoopProblem, verified: Verified) -> _Search:
    """Search for the best gain on the sampled loop."""
    # The search also tries the verified gain and the ideal gain.
    (low, high), limit = problem.draws.task.stable_bounds(), verified.limit
    margin, sign = None, problem.draws.task.law.number.sign
    if limit is not None:
        margin = USUAL_MARGIN if limit.allowed(USUAL_MARGIN) >= min(sign * low, sign * high) else 1.0
        # The ends of the axis are exact, so that every proposed gain has the required margin.
        strongest = limit.strongest / margin
        low, high = (max(low, strongest), high) if sign < 0 else (low, min(high, strongest))
    axis = GainAxis(low=low, high=high)
    search = _Search(problem=problem, axis=axis, margin=margin)
    if axis.low <= axis.high:  # else no gain within the bounds has the margin
        among = [g for g in (verified.gain, verified.design.gain) if g is not None and axis.low <= g <= axis.high]
        search.merit(axis.coordinate(np.array(among)))
        scan(search.landscape, *axis.span, RUNS)
        u = np.array(sorted(search.tried))
        refine(search.merit, u, search.merit(u), RUNS)
    return search


def _redesign(number: LawNumber, gain: float, loop_gain: float, margin: float | None) -> str:
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
    turns = _ORDER.index(status) > _ORDER.index(was)
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
    return (not change.helps, -_ORDER.index(change.status), -round(change.standing, 9), -gained)
