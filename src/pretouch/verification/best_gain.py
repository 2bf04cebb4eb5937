"""The gain that is best on the loop itself: a scan with common random numbers, a finer one, then halving."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.design.search import GainAxis
from pretouch.simulation import ClosedLoop, GainLimit

from .appraisal import LoopProblem

__all__ = ["LoopCurve", "LoopOptimum", "best_on_loop"]

_MARGIN: Final = 2.0  # to instability, which a gain that is proposed keeps where any within the bounds can
_SCANNED: Final = 33
_BETWEEN: Final = 17  # between the neighbors of the best: on a loop that samples, the objective has ripples
_NARROW: Final = 2e-3  # of u = ln|D_p|: within a thousandth of the optimal gain the objective changes by a millionth


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


def best_on_loop(
    problem: LoopProblem,
    loop: ClosedLoop,
    bounds: tuple[float, float],
    *,
    limit: GainLimit | None,
    runs: int,
    among: Sequence[float] = (),
) -> LoopOptimum:
    """Find the gain that is best on a loop: over the same encounters and noise for each.

    33 gains at equal distances of ln|D_p| and those that are named are tried, then 17 between the neighbors of the best
    one that keeps the limits, for the objective has ripples where the loop samples; halving around the best of these
    finds the minimum to 0.1 % of the gain.

    Args:
        problem: what it is appraised by.
        loop: the loop.
        bounds: smallest and largest gain [N s].
        limit: the strongest stable gains, of which those with a margin of 2 are tried; where no gain within the bounds
            has it, all that are stable; None where they are not known.
        runs: how many runs of each.
        among: gains to be tried beside [N s].

    Returns:
        The optimum.
    """
    sought = None if limit is None else _MARGIN if -limit.allowed(_MARGIN) <= bounds[1] else 1.0
    strongest = -math.inf if limit is None or sought is None else limit.strongest / sought
    # the ends of the axis are met to the bit: a gain that is proposed has the margin that it was sought with
    axis = GainAxis(low=max(bounds[0], strongest), high=bounds[1])
    search = _Search(problem=problem, loop=problem.compared(loop), axis=axis, runs=runs)
    if axis.low > axis.high:  # no gain within the bounds may be tried
        return LoopOptimum(gain=None, nearest=None, sought_margin=sought, curve=search.curve())
    low, high = map(float, axis.coordinate(np.array(axis.ends)))
    beside = [float(axis.coordinate(g)) for g in among if axis.low <= g <= axis.high]
    tried = sorted({*np.linspace(low, high, _SCANNED).tolist(), *(u for u in beside if low <= u <= high)})
    low, middle, high = search.around_best(tried)
    if math.isfinite(search.merit(middle)):
        between = sorted({*np.linspace(low, high, _BETWEEN).tolist(), low, middle, high})
        search.refine(*search.around_best(between))
    return search.optimum(sought)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tried:
    """What is kept of a gain: mean objective, whether the limits are kept, how well they are, share of whole runs."""

    objective: float
    kept: bool
    standing: float
    share: float

    @property
    def merit(self) -> float:
        return self.objective if self.kept else math.inf


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Search:
    problem: LoopProblem
    loop: ClosedLoop
    axis: GainAxis
    runs: int
    tried: dict[float, _Tried] = field(default_factory=dict)

    def merit(self, u: float) -> float:
        """Return the mean objective at u = ln|D_p| where the limits are kept, infinity elsewhere."""
        if u not in self.tried:
            found = self.problem.appraise(self.loop, float(self.axis.gain(u)), self.runs)
            self.tried[u] = _Tried(
                objective=found.mean,
                kept=found.is_kept,
                standing=found.standing,
                share=found.whole_share,
            )
        return self.tried[u].merit

    def around_best(self, row: Sequence[float]) -> tuple[float, float, float]:
        """Return the best of a row of gains and its neighbors; an end is a neighbor of itself."""
        best = min(range(len(row)), key=lambda i: self.merit(row[i]))
        return row[max(best - 1, 0)], row[best], row[min(best + 1, len(row) - 1)]

    def refine(self, low: float, middle: float, high: float) -> None:
        """Halve both sides of the best gain until they are narrow; its merit never grows, so limits may end between."""
        while high - low > _NARROW:
            row = [low, (low + middle) / 2, middle, (middle + high) / 2, high]
            best = min(range(1, 4), key=lambda i: self.merit(row[i]))
            low, middle, high = row[best - 1 : best + 2]

    def optimum(self, sought: float | None) -> LoopOptimum:
        """Return the best of all that were tried."""
        kept = [u for u in self.tried if math.isfinite(self.merit(u))]
        gain = float(self.axis.gain(min(kept, key=self.merit))) if kept else None
        nearest = max(self.tried, key=lambda u: (self.tried[u].standing, -self.tried[u].objective))
        return LoopOptimum(gain=gain, nearest=float(self.axis.gain(nearest)), sought_margin=sought, curve=self.curve())

    def curve(self) -> LoopCurve:
        """Return all that were tried, by their gains."""
        tried = sorted(self.tried.items())
        return LoopCurve(
            gain=np.array([float(self.axis.gain(u)) for u, _ in tried]),
            objective=np.array([one.objective for _, one in tried]),
            standing=np.array([one.standing for _, one in tried]),
            share=np.array([one.share for _, one in tried]),
            runs=self.runs,
        )
