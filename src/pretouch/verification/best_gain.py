"""The gain that is best on the loop itself, found by the one search with common random numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.design.search import RUNS, GainAxis, Landscape, refine, scan
from pretouch.simulation import GainLimit

from .appraisal import LoopProblem

__all__ = ["LoopCurve", "LoopOptimum", "best_on_loop"]

_MARGIN: Final = 2.0  # to instability, which a gain that is proposed keeps where any within the bounds can
_DIGITS: Final = 12  # of u = ln|D_p|: beyond, it is the same gain


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopCurve(Value):
    """The gains that were tried on the loop.

    Args:
        gain: D_p [N s], ascending, shape (n,).
        objective: its mean over the runs; infinite where a run ends without contact.
        standing: the least share of runs in which a limit holds beside the share required, at most 1; less where
            contact is harder than without mitigation.
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
        return f"<LoopCurve: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g} N s, {self.runs} runs>"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopOptimum:
    """The best gain on a loop.

    Args:
        gain: the best that keeps the limits [N s]; None where none that was tried does.
        nearest: the one that stands best where none keeps them [N s]; None where none may be tried.
        sought_margin: to instability, which all that were tried have; None where it is not known.
        curve: the gains that were tried.
    """

    gain: float | None
    nearest: float | None
    sought_margin: float | None
    curve: LoopCurve


def best_on_loop(problem: LoopProblem, limit: GainLimit | None, among: Sequence[float]) -> LoopOptimum:
    """Find the gain [N s] that is best on a loop, of which the strongest stable ones may be known; some are named."""
    # with a margin of 2 to instability; where no gain within the bounds has it, among all that are stable
    bounds = problem.draws.task.stable_bounds()
    sought = None if limit is None else _MARGIN if -limit.allowed(_MARGIN) <= bounds[1] else 1.0
    strongest = -math.inf if limit is None or sought is None else limit.strongest / sought
    # the ends of the axis are met to the bit: a gain that is proposed has the margin that it was sought with
    axis = GainAxis(low=max(bounds[0], strongest), high=bounds[1])
    search = _Search(problem=problem, axis=axis)
    if axis.low <= axis.high:  # else no gain within the bounds may be tried
        search.merit(axis.coordinate(np.array([g for g in among if axis.low <= g <= axis.high])))
        scan(search.landscape, *axis.span, RUNS)
        u = np.array(sorted(search.tried))
        refine(search.merit, u, search.merit(u), RUNS)
    return search.optimum(sought)


class _Tried(NamedTuple):
    """What is kept of a gain: D_p [N s], mean objective, how well limits are kept, share of whole runs; if kept."""

    gain: float
    objective: float
    standing: float
    share: float
    kept: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Search:
    problem: LoopProblem
    axis: GainAxis
    tried: dict[float, _Tried] = field(default_factory=dict)

    def merit(self, coordinate: FloatArray) -> FloatArray:
        """Return the mean objective at u = ln|D_p| where the limits are kept, infinity elsewhere."""
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

    def optimum(self, sought: float | None) -> LoopOptimum:
        """Return the best of all that were tried."""
        tried = sorted(self.tried.values())
        best = min((one for one in tried if one.kept), key=lambda one: one.objective, default=None)
        nearest = max(tried, key=lambda one: (one.standing, -one.objective), default=None)
        gain, objective, standing, share, _ = np.array(tried, dtype=np.float64).reshape(-1, 5).T
        runs = self.problem.draws.compared
        return LoopOptimum(
            gain=None if best is None else best.gain,
            nearest=None if nearest is None else nearest.gain,
            sought_margin=sought,
            curve=LoopCurve(gain=gain, objective=objective, standing=standing, share=share, runs=runs),
        )
