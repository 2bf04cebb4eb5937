"""What would help: the best gain for the loop and what the verified one loses beside it, and the one best change.

Every candidate is run with the noise that the verdict has met.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray, finite_or_none
from pretouch._core.values import Value
from pretouch.design import GainDesign, Task
from pretouch.design.search import RUNS, GainAxis, Landscape, refine, scan
from pretouch.motion import ContactResult, LawNumber
from pretouch.simulation import GainLimit

from .appraisal import LoopOutcomes, LoopProblem, Requirement, foreseen_impact, part_of, status_of
from .effect import VerdictStatus, effect_of, mean_and_error
from .stability import Candidate, Passed, StabilityCheck, candidates_of, limit_of, stability_margin

_ERRORS: Final = 2.0  # standard errors that a change must gain: one in twenty does by chance
_WORTH: Final = 0.01  # of the objective: less is not worth a change
_MARGIN: Final = (
    2.0  # to instability: a gain that is proposed has it where any within the bounds can, a change keeps it
)
_FALL: Final = 0.8  # of the margin: what is left of it is said where it is less
_BEYOND: Final = 1e3  # a margin that needs no word
_SAME: Final = 1e-6  # of a gain
_ORDER: Final = (VerdictStatus.DOES_NOT_HOLD, VerdictStatus.HOLDS_NARROWLY, VerdictStatus.HOLDS)
_DIGITS: Final = 12  # of u = ln|D_p|: beyond, it is the same gain


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopCurve(Value):
    """The gains that were tried on the loop.

    Args:
        gain: D_p [N s], ascending, shape (n,).
        objective: its mean over the runs; infinite where a run ends without contact.
        standing: the least share of runs in which a limit holds beside the share required, at most 1; less where
            contact is no softer than without mitigation.
        share: the share of runs in which all limits hold at once.
        runs: how many runs of each.
    """

    gain: FloatArray
    objective: FloatArray
    standing: FloatArray
    share: FloatArray
    runs: int

    def __repr__(self) -> str:
        if not len(self.gain):
            return "<LoopCurve: no gain>"
        return f"<LoopCurve: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g}, {self.runs} runs>"


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
            where contact is no softer than without mitigation or the loop unstable.
        held: the share of runs with it in which the limit holds that was missed most; None where none was missed.
        margin: to instability with it; None where that is not known.
        status: by limits, effect and margin over the runs that it was compared by.
        helps: whether it turns that status to the better, or gains more than chance can, and leaves the loop stable.
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
    """The verified gain, and what is known of it before anything else is tried."""

    gain: float  # D_p [N s]
    predicted: ContactResult  # the nominal encounter with it in continuous time
    outcomes: LoopOutcomes  # what it leads to on the loop, over all runs
    design: GainDesign  # the ideal one
    stability: StabilityCheck | None  # None where it is not known, as the limit
    limit: GainLimit | None  # the strongest stable gains of the loop
    passed: Passed  # the distances that the encounter passes


def find_improvements(
    problem: LoopProblem, known: Verified
) -> tuple[Loss, tuple[LoopChange, ...], tuple[LoopChange, ...]]:
    """Return what a verified gain loses, changes, the most helpful first, and the loop as it is over the same runs."""
    task, gain, runs = problem.draws.task, known.gain, problem.draws.compared
    loop = task.loop
    search = _best_on_loop(problem, known)
    optimum, best, found = search.best, None, []
    better = search.nearest if optimum is None else optimum
    if better is not None:
        # over all runs: over those alone that it was chosen by, it would look better than it is
        same, margin = math.isclose(better, gain, rel_tol=_SAME), stability_margin(known.limit, better)
        outcomes = known.outcomes if same else problem.appraise(problem.compared(loop), better)
        best = None if optimum is None else outcomes.objective
        if not same:
            candidate = Candidate("gain", _redesign(problem.draws.task.law.number, gain, better, margin), loop)
            found.append(_compared(task, candidate, better, known.outcomes, replace(outcomes, margin=margin)))
    first = part_of(known.outcomes.result, slice(runs))
    part = replace(problem.appraised(first, loop, gain), margin=known.outcomes.margin)
    for candidate in _candidates(problem, known):
        outcomes = problem.appraise(problem.compared(candidate.loop), gain, runs)
        after = None
        if known.limit is not None:
            after = stability_margin(limit_of(candidate.loop, task.sensor, known.passed), gain)
        found.append(_compared(task, candidate, gain, part, replace(outcomes, margin=after)))
    own = (Candidate("as-it-is", "", loop), gain)
    as_it_is = tuple(_compared(task, *own, one, one) for one in (part, known.outcomes)[: 2 if runs < task.runs else 1])
    return _loss(task, known, search, best), tuple(sorted(found, key=_rank)), as_it_is


def _candidates(problem: LoopProblem, known: Verified) -> list[Candidate]:
    """Return what could be changed; readings are noisiest where ln xi deviates most, from contact to start."""
    draws, check, free = problem.draws, known.stability, problem.unmitigated
    sensor, c = draws.task.sensor, draws.task.loop.chain
    slope = np.abs(np.asarray(sensor.log_slope(known.passed[0])))
    xi = np.exp(np.asarray(sensor.log_output(known.passed[0])))
    noise = np.hypot(np.hypot(c.noise, c.relative_noise * xi) / xi, slope * c.distance_noise)
    ends = np.abs(free.relative_velocity[free.touched])
    fastest = max(ends.max(initial=0.0), np.abs(draws.scenarios.relative_velocity).max())  # [m/s]
    wanted = None
    if check is not None and check.margin < _MARGIN and math.isfinite(check.lowest_rate_with_margin):
        wanted = max(check.lowest_rate_with_margin, check.rate)
    return candidates_of(draws.task.loop, float(fastest * slope.max()), float(noise.max()), wanted)


def _loss(task: Task, known: Verified, search: _Search, best: FloatArray | None) -> Loss:
    """Put the objective of every run beside that with the best gain on the loop; None where there is none."""
    predicted, ideal = known.predicted, None
    if predicted.reached.all():
        speed = abs(task.scenario.obstacle.velocity)
        ideal = float(task.goal.value(predicted.end, speed, foreseen_impact(task)))
    own, other = known.outcomes.objective, np.full(task.runs, np.nan) if best is None else best
    mean, error = mean_and_error(own)
    with np.errstate(invalid="ignore"):
        loss, loss_error = mean_and_error(own - other)
    return Loss(
        predicted=ideal,
        objective=finite_or_none(mean),
        standard_error=finite_or_none(error),
        loop_gain=search.best,
        sought_margin=search.margin,
        loop_objective=finite_or_none(mean_and_error(other)[0]),
        loss=finite_or_none(loss),
        loss_error=finite_or_none(loss_error),
        curve=search.curve,
    )


class _Tried(NamedTuple):
    """What is kept of a gain that was tried."""

    gain: float  # D_p [N s]
    objective: float  # its mean
    standing: float  # how well limits are kept
    share: float  # of runs in which all are
    kept: bool  # whether they are kept as they must


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Search:
    """The search for the gain that is best on the loop: over the same encounters and noise for each."""

    problem: LoopProblem
    axis: GainAxis
    margin: float | None  # to instability, which all gains within the axis have; None where it is not known
    tried: dict[float, _Tried] = field(default_factory=dict)  # by the coordinate

    def merit(self, coordinate: FloatArray) -> FloatArray:
        """Return the mean objective at coordinates u where the limits are kept, infinity elsewhere."""
        places = {round(u, _DIGITS): u for u in coordinate.tolist()}
        new = {place: u for place, u in places.items() if place not in self.tried}
        if new:
            gains = self.axis.gain(np.array(list(new.values())))
            several = self.problem.appraise_each(gains)
            for place, gain, found in zip(new, gains.tolist(), several, strict=True):
                self.tried[place] = _Tried(gain, found.mean, found.standing, found.whole_share, found.is_kept)
        of = (self.tried[round(u, _DIGITS)] for u in coordinate.tolist())
        return np.array([one.objective if one.kept else math.inf for one in of])

    def landscape(self, coordinate: FloatArray) -> Landscape:
        """Return the merit as a scan takes it."""
        return Landscape(objective=self.merit(coordinate), ratios=np.empty((0, len(coordinate))))

    @property
    def best(self) -> float | None:
        """The best gain that keeps the limits [N s]; None where none that was tried does."""
        kept = [one for one in sorted(self.tried.values()) if one.kept]
        return min(kept, key=lambda one: one.objective).gain if kept else None

    @property
    def nearest(self) -> float | None:
        """The gain that stands best where none keeps them [N s]; None where none may be tried."""
        tried = sorted(self.tried.values())
        return max(tried, key=lambda one: (one.standing, -one.objective)).gain if tried else None

    @property
    def curve(self) -> LoopCurve:
        """All gains that were tried."""
        columns = np.array(sorted(self.tried.values()), dtype=np.float64).reshape(-1, len(_Tried._fields)).T
        gain, objective, standing, share, _ = columns
        runs = self.problem.draws.compared
        return LoopCurve(gain=gain, objective=objective, standing=standing, share=share, runs=runs)


def _best_on_loop(problem: LoopProblem, known: Verified) -> _Search:
    """Search the gain that is best on the loop, the verified and the ideal one among those that are tried."""
    (low, high), limit = problem.draws.task.stable_bounds(), known.limit
    margin, sign = None, problem.draws.task.law.number.sign
    if limit is not None:
        margin = _MARGIN if limit.allowed(_MARGIN) >= min(sign * low, sign * high) else 1.0
        # the ends of the axis are met to the bit: a gain that is proposed has the margin that it was sought with
        strongest = limit.strongest / margin
        low, high = (max(low, strongest), high) if sign < 0 else (low, min(high, strongest))
    axis = GainAxis(low=low, high=high)
    search = _Search(problem=problem, axis=axis, margin=margin)
    if axis.low <= axis.high:  # else no gain within the bounds may be tried
        among = [g for g in (known.gain, known.design.gain) if g is not None and axis.low <= g <= axis.high]
        search.merit(axis.coordinate(np.array(among)))
        scan(search.landscape, *axis.span, RUNS)
        u = np.array(sorted(search.tried))
        refine(search.merit, u, search.merit(u), RUNS)
    return search


def _redesign(number: LawNumber, gain: float, loop_gain: float, margin: float | None) -> str:
    """Say which gain to take, and how far the loop is from instability with it."""
    beside = "" if margin is None or margin > _BEYOND else f"; the loop is unstable at {margin:.3g} times that"
    return f"Take {number.equals(loop_gain)} instead of {number.text(gain)}{beside}."


def _compared(task: Task, candidate: Candidate, gain: float, before: LoopOutcomes, after: LoopOutcomes) -> LoopChange:
    worst, same = _worst_of_both(before, after)
    improvement, error = _improvement(before.objective, after.objective)
    keeps_margin = before.margin is None or (after.margin is not None and after.margin >= min(before.margin, _MARGIN))
    gains = improvement is not None and improvement > max(_ERRORS * (error or 0.0), _WORTH)
    better = after.standing >= before.standing and keeps_margin and gains
    was, status = status_of(task, before), status_of(task, after)
    turns = _ORDER.index(status) > _ORDER.index(was)
    return LoopChange(
        name=candidate.name,
        sentence=_with_margin(candidate, before.margin, after.margin),
        gain=gain,
        objective=finite_or_none(after.mean),
        improvement=improvement,
        improvement_error=error,
        standing=after.standing,
        held=None if worst.is_met else float(same.held.mean()),
        margin=after.margin,
        status=status,
        helps=after.stable == 1 and (turns or _stands_better(before, after) or better),
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
        change = effect_of(after.result, before.result)  # whether the speed at contact falls
        return change is not None and change.is_softer
    worst, same = _worst_of_both(before, after)
    rise = same.held.astype(np.float64) - worst.held
    return float(rise.mean()) > _ERRORS * float(rise.std()) / math.sqrt(len(rise))


def _improvement(before: FloatArray, after: FloatArray) -> tuple[float | None, float | None]:
    """Return the mean fall of the objective run by run and its standard error, as shares of what it was."""
    whole, _ = mean_and_error(before)
    with np.errstate(invalid="ignore"):
        fall, error = mean_and_error(before - after)
    if not (math.isfinite(whole) and math.isfinite(fall) and whole > 0):
        return None, None
    return fall / whole, error / whole if math.isfinite(error) else 0.0


def _rank(change: LoopChange) -> tuple[bool, int, float, float]:
    # in what is missed, what differs by rounding is a tie
    gained = -math.inf if change.improvement is None else change.improvement
    return (not change.helps, -_ORDER.index(change.status), -round(change.standing, 9), -gained)
