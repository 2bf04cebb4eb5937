"""Search for the best gain on a sampled loop that meets every requirement with a reserve."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.progress import note_work
from pretouch._core.values import Value
from pretouch.designs import Task
from pretouch.designs.robust.required import limits_of, runs_to_show
from pretouch.designs.search import RUNS, Effort, GainAxis, Landscape, search_axis
from pretouch.simulation import ClosedLoop, GainLimit

from .appraisal import ROOM, USUAL_MARGIN, LoopOutcomes, LoopProblem
from .changed_loop import as_printed

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
    strictness: float | FloatArray = 1.0  # factor on the shortfalls, or one factor for each of them
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
        """Return a search that needs less reserve: no share of a limit must remain free.

        Requirements that need more reserve than others keep it.
        """
        strictness = np.where(np.asarray(self.strictness) > 1, self.strictness / np.float64(1 - ROOM), 1.0)
        return replace(self, has_room=False, strictness=strictness).run([], effort)

    def stricter(self, factor: FloatArray, effort: Effort = RUNS) -> GainSearch:
        """Return a search with more reserve, by one factor for each requirement."""
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

        None if no gain was tried. Gains that were given up are simulated further, as long as their shortfall can still
        be the smallest one.
        """
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


def stable_axis(
    task: Task, limit: GainLimit | None, least: float = USUAL_MARGIN, required: float | None = None
) -> tuple[GainAxis, float | None]:
    """Return the gains with at least a gain margin, or else the stable ones, and their gain margin.

    If a margin is required, only gains with this margin are returned, and the axis is empty if there are none.
    """
    (low, high), margin, sign = task.stable_bounds(), None, task.law.number.sign
    if limit is not None:
        margin = least if limit.allowed(least) >= min(sign * low, sign * high) else 1.0
        margin = max(margin, required or 1.0)
        # The ends of the axis are exact, so that every proposed gain has the required margin.
        strongest = limit.strongest / margin
        low, high = (max(low, strongest), high) if sign < 0 else (low, min(high, strongest))
    return GainAxis(low=low, high=high), margin
