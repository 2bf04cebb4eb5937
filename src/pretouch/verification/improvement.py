"""Search for the gain and the loop change that help most.

Every candidate is simulated with the same noise as the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray, finite_or_none
from pretouch._core.progress import note_work
from pretouch._core.values import Value
from pretouch.design import GainDesign, Task
from pretouch.design.robust.required import limits_of, runs_to_show
from pretouch.design.search import RUNS, Effort, GainAxis, Landscape, search_axis
from pretouch.motion import ContactResult, LawNumber
from pretouch.simulation import ClosedLoop, GainLimit

from .appraisal import (
    ROOM,
    USUAL_MARGIN,
    LoopOutcomes,
    LoopProblem,
    Requirement,
    foreseen_impact,
    make_problem,
    part_of,
    status_of,
)
from .effect import SIGNIFICANT, VerdictStatus, effect_of, mean_and_error
from .settings import Setting, settings_between
from .stability import ChangedLoop, Passed, StabilityCheck, as_printed, candidates_of, limit_of, stability_margin

_WORTH: Final = 0.01  # smallest relative improvement of the objective that justifies a change
_FALL: Final = 0.8  # if a change reduces the margin below this share of it, the new margin is reported
_BEYOND: Final = 1e3  # a larger margin is not reported
_SAME: Final = 1e-6  # relative difference below which two gains are the same
_ORDER: Final = (VerdictStatus.DOES_NOT_HOLD, VerdictStatus.HOLDS_NARROWLY, VerdictStatus.HOLDS)
_DIGITS: Final = 12  # decimals of u = ln|D_p| that distinguish two gains
_MOST_SEARCHED: Final = 1000  # largest number of runs of each gain in a search
_UNVALUED: Final = 1e30  # objective of a gain without a mean objective: such gains are ranked after all others
_PRINTED: Final = (4, 5, 6, 8, 12)  # significant digits with which a gain may be printed, fewest first


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopCurve(Value):
    """Simulated results of all gains tried on the sampled loop.

    Args:
        gain: the law's number, such as D_p [N s], ascending, shape (n,).
        objective: mean objective over the runs; infinite if a run ends without contact.
        standing: score, at most 1: the smallest ratio of the share of runs that meet a limit to the required share;
            lower if contact is no softer than without mitigation.
        share: share of the runs that meet all limits.
        shortfall: at most 1 if every limit is met with a reserve; otherwise the worst |quantity| / limit with it. The
            reserve: the runs demonstrate the required probability, and 3 % of the limit remain free, unless no gain
            leaves so much.
        runs: number of runs of each gain. It is smaller if the first runs already show that the gain misses a
            requirement; the other columns are then results of these runs.
    """

    gain: FloatArray
    objective: FloatArray
    standing: FloatArray
    share: FloatArray
    shortfall: FloatArray
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
    loops: tuple[ChangedLoop, ...]  # the loops of the changes, other than that of the gain


def find_improvements(problem: LoopProblem, verified: Verified) -> Improvements:
    """Find changes that improve the sampled loop or its gain."""
    task, gain, runs = problem.draws.task, verified.gain, problem.draws.compared
    loop = task.loop
    search = search_on_loop(problem, verified)
    optimum, best, changes = search.best, None, []
    better = search.nearest() if optimum is None else optimum
    if better is not None:
        # All runs are used, because the gain would look too good on only those runs by which it was chosen.
        same, margin = math.isclose(better, gain, rel_tol=_SAME), stability_margin(verified.limit, better)
        outcomes = verified.outcomes if same else problem.appraise(problem.compared(loop), better)
        best = None if optimum is None else outcomes.objective
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
    return Improvements(loss, tuple(sorted(changes, key=_rank)), unchanged, search, tuple(candidates))


def _candidates(problem: LoopProblem, verified: Verified) -> list[ChangedLoop]:
    """Return changes of the loop that may improve the result."""
    check, rate, draws = verified.stability, None, problem.draws
    if check is not None and check.margin < USUAL_MARGIN and math.isfinite(check.lowest_rate_for_margin_2):
        rate = max(check.lowest_rate_for_margin_2, check.rate)
    start = float(np.exp(draws.task.sensor.log_output(float(draws.distance.mean()))))
    return candidates_of(draws.task.loop, *problem.changes_of_level(verified.passed[0]), rate, start)


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


class _Tried(NamedTuple):
    """Summary of the simulated results of one tried gain."""

    gain: float  # the law's number, such as D_p [N s]
    objective: float  # the mean objective
    standing: float  # score, at most 1
    share: float  # share of the runs that meet all limits
    runs: int  # number of runs
    shown: FloatArray  # the shortfalls of `LoopOutcomes`; lower bounds if `runs` is smaller than that of the search
    roomy: FloatArray  # the same if a share of the limits must remain free


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainSearch:
    """Search for the best gain on a sampled loop that meets every requirement with a reserve.

    All gains are simulated with the same encounters and noise. The best of many gains owes its result partly to chance,
    so each requirement must be met with a reserve.
    """

    problem: LoopProblem
    loop: ClosedLoop
    axis: GainAxis
    margin: float | None  # gain margin that all gains on the axis have; None if it is not known
    runs: int  # number of runs of each gain
    has_room: bool = True  # whether a share of each limit must remain free
    strictness: float = 1.0  # factor on the shortfalls
    whole: bool = False  # whether every gain is simulated in all runs, also if it misses a requirement
    tried: dict[float, _Tried] = field(default_factory=dict)  # the tried gains by coordinate

    def shortfalls(self, one: _Tried) -> FloatArray:
        """Return the shortfall of each requirement; at most 1 if it is met with the reserve."""
        return self.strictness * (one.roomy if self.has_room else one.shown)

    def worst(self, one: _Tried) -> float:
        """Return the largest shortfall of a gain."""
        return float(self.shortfalls(one).max())

    def results(self, coordinate: FloatArray) -> list[_Tried]:
        """Return the simulated results of each gain."""
        places = {round(u, _DIGITS): u for u in coordinate.tolist()}
        new = {place: u for place, u in places.items() if not self._is_decided(self.tried.get(place))}
        if new:
            note_work(
                f"searching for the best gain on the simulated loop; {len(self.tried)} gains were simulated so far"
            )
            gains = self.axis.gain(np.array(list(new.values())))
            is_open = None if self.whole else self._is_open
            outcomes = self.problem.appraise_each(self.loop, gains, self.runs, is_open)
            for place, gain, o in zip(new, gains.tolist(), outcomes, strict=True):
                self.tried[place] = self._tried(gain, o)
        return [self.tried[round(u, _DIGITS)] for u in coordinate.tolist()]

    def _is_decided(self, one: _Tried | None) -> bool:
        return one is not None and (one.runs == self.runs or (not self.whole and self.worst(one) > 1))

    def _is_open(self, outcomes: LoopOutcomes) -> bool:
        return self.worst(self._tried(0.0, outcomes)) <= 1

    def _tried(self, gain: float, o: LoopOutcomes) -> _Tried:
        """Summarize the simulated results of a gain."""
        confidence = self.problem.draws.task.verify.confidence
        shown, roomy = (o.shortfalls(self.runs, confidence, room) for room in (0.0, ROOM))
        return _Tried(gain, o.mean, o.standing, o.whole_share, o.result.shape[0], shown, roomy)

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Return the mean objectives and the shortfalls for the search algorithm."""
        results = self.results(coordinate)
        objective = [one.objective if math.isfinite(one.objective) else _UNVALUED for one in results]
        return Landscape(objective=np.array(objective), ratios=np.array([self.shortfalls(one) for one in results]).T)

    def run(self, among: list[float], effort: Effort = RUNS) -> GainSearch:
        """Search the axis, and try some gains in addition."""
        if self.axis.low < self.axis.high:
            self.results(self.axis.coordinate(np.array([g for g in among if self.axis.low <= g <= self.axis.high])))
            search_axis(self.landscape, *self.axis.span, effort)
        elif self.axis.low == self.axis.high:
            self.results(self.axis.coordinate(np.array([self.axis.low])))
        return self

    def relaxed(self, effort: Effort = RUNS) -> GainSearch:
        """Return a search that needs less reserve: no share of a limit must remain free."""
        return replace(self, has_room=False).run([], effort)

    def stricter(self, factor: float, effort: Effort = RUNS) -> GainSearch:
        """Return a search with more reserve."""
        return replace(self, strictness=self.strictness * factor).run([], effort)

    @property
    def best(self) -> float | None:
        """The best tried gain that meets all requirements with the reserve.

        It has the digits with which it is printed. None if no tried gain meets all of them.
        """
        kept = [one for one in self.tried.values() if one.runs == self.runs and self.worst(one) <= 1]
        if not kept:
            return None
        return self.printed(min(kept, key=lambda one: (one.objective, self.worst(one))).gain)

    def printed(self, gain: float) -> float:
        """Return a gain with as few digits as the bounds allow, at least four."""
        for digits in _PRINTED:
            step = 10.0 ** (math.floor(math.log10(abs(gain))) - digits + 1) if gain else 1.0
            near = as_printed(gain, digits)
            for one in (near, as_printed(near - step, digits), as_printed(near + step, digits)):
                if self.axis.low <= one <= self.axis.high and abs(one - gain) <= step:
                    return one
        return gain

    def nearest(self) -> float | None:
        """Return the tried gain with the smallest shortfall over all runs.

        None if no gain was tried.
        """
        # Gains that were given up are simulated further, as long as their shortfall can still be the smallest one.
        loop = self.problem.compared(self.loop)
        while self.tried:
            place, least = min(self.tried.items(), key=lambda item: (self.worst(item[1]), item[1].objective))
            if least.runs == self.runs:
                return self.printed(least.gain)
            self.tried[place] = self._tried(least.gain, self.problem.appraise(loop, least.gain, self.runs))
        return None

    @property
    def curve(self) -> LoopCurve:
        """The results of all tried gains, sorted by the gain."""
        tried = sorted(self.tried.values(), key=lambda one: one.gain)
        columns = {name: np.array([getattr(one, name) for one in tried]) for name in _COLUMNS}
        shortfall = np.array([self.worst(one) for one in tried])
        runs = np.array([one.runs for one in tried], dtype=np.int64)
        return LoopCurve(**columns, shortfall=shortfall, runs=runs)


_COLUMNS: Final = ("gain", "objective", "standing", "share")


def runs_of_search(task: Task, compared: int) -> int:
    """Return how many runs of each gain a search needs.

    So few runs cannot demonstrate a high probability: 299 runs are needed for 99 %, if the limit is met in all of them.
    """
    probabilities = [limit.probability for limit in limits_of(task.constraints) if limit.probability < 1]
    needed = [runs_to_show(1.0, p, task.verify.confidence) for p in probabilities]
    enough = max((_MOST_SEARCHED if count is None else count for count in needed), default=0)
    return max(compared, min(enough, _MOST_SEARCHED))


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


def stable_axis(task: Task, limit: GainLimit | None, least: float = USUAL_MARGIN) -> tuple[GainAxis, float | None]:
    """Return the gains with at least a gain margin, or else the stable ones, and their gain margin."""
    (low, high), margin, sign = task.stable_bounds(), None, task.law.number.sign
    if limit is not None:
        margin = least if limit.allowed(least) >= min(sign * low, sign * high) else 1.0
        # The ends of the axis are exact, so that every proposed gain has the required margin.
        strongest = limit.strongest / margin
        low, high = (max(low, strongest), high) if sign < 0 else (low, min(high, strongest))
    return GainAxis(low=low, high=high), margin


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
    return (not change.helps, -_ORDER.index(change.status), -round(change.standing, 9), -gained)
