"""Find jumps next to an optimum, and keep a distance from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value

from .landscape import Evaluate, Landscape

RESERVE: Final = 0.01 + 5e-4
"""Smallest distance of a recommended gain from a jump, as a share of the gain.

The virtual force is D_p g(l) l', so that 1 % of the gain stands for 1 % of the slope g, which calibrations seldom know
better. The rest is the largest change by rounding to the four digits that are printed.
"""

_SIZE: Final = 0.01  # relative change of the objective, or change of a ratio |quantity| / limit, that counts as a jump
_NODES: Final = 17  # coordinates in each round that narrows a jump
_NARROW: Final = 1e-9  # width in u of a jump
_ROUNDS: Final = 9
_MOST: Final = 3  # largest number of steep places that are narrowed


@dataclass(frozen=True, slots=True, kw_only=True)
class Jump(Value):
    """A jump of the objective, of a constraint or of contact.

    Args:
        low: the coordinate on one side.
        high: the coordinate on the other side, 1e-9 or less away.
        reserve: the distance in u that a recommended coordinate keeps.
        avoided: whether the recommended coordinate keeps this distance; False if no feasible coordinate does.
    """

    low: float
    high: float
    reserve: float
    avoided: bool = True

    def is_near(self, u: FloatArray) -> BoolArray:
        """Return True for coordinates that are closer than the reserve."""
        return np.asarray((u > self.low - self.reserve) & (u < self.high + self.reserve))

    @property
    def ends(self) -> tuple[float, float]:
        """The two nearest coordinates that keep the reserve."""
        return self.low - self.reserve, self.high + self.reserve


def find_jump(
    evaluate: Evaluate, at: float, reserve: float, ends: tuple[float, float], nodes: int = _NODES
) -> Jump | None:
    """Find the nearest jump around an optimum.

    Args:
        evaluate: a function that maps coordinates to a Landscape.
        at: the coordinate of the optimum.
        reserve: the distance in u to search.
        ends: start and end of the axis.
        nodes: number of coordinates on both sides of the optimum.

    Returns:
        The jump; None if objective, constraints and contact are continuous within this distance.
    """
    u = np.unique(np.clip(at + reserve * np.linspace(-1.0, 1.0, nodes), *ends))
    steps = _steps(evaluate(u))
    steep = np.flatnonzero(steps > _SIZE)
    nearest = steep[np.argsort(np.abs(0.5 * (u[steep] + u[steep + 1]) - at), kind="stable")][:_MOST]
    for i in map(int, nearest):
        sides = _narrow(evaluate, float(u[i]), float(u[i + 1]))
        if sides is not None:
            return Jump(low=sides[0], high=sides[1], reserve=reserve)
    return None


def _narrow(evaluate: Evaluate, low: float, high: float) -> tuple[float, float] | None:
    """Narrow an interval to its jump; None if the function is continuous in it."""
    for _ in range(_ROUNDS):
        if high - low <= _NARROW:
            return low, high
        u = np.linspace(low, high, _NODES)
        steps = _steps(evaluate(u))
        i = int(np.argmax(steps))
        if not steps[i] > _SIZE:
            return None
        low, high = float(u[i]), float(u[i + 1])
    return low, high


def _steps(landscape: Landscape) -> FloatArray:
    """Return the change between neighbors: relative for the objective, absolute for ratios that exceed a limit."""
    worst, objective, feasible = landscape.violation, landscape.objective, landscape.feasible
    reached = np.isfinite(worst) & np.isfinite(objective)
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.maximum(np.abs(objective[:-1]), np.abs(objective[1:]))
        step = np.where(size > 0, np.abs(np.diff(objective)) / size, 0.0)
        step = np.where(feasible[:-1] & feasible[1:], step, 0.0)
        exceeded = np.where(feasible[:-1] != feasible[1:], np.abs(np.diff(worst)), 0.0)
    step = np.maximum(step, np.where(np.isfinite(exceeded), exceeded, 0.0))
    return np.asarray(np.where(feasible[:-1] & ~reached[1:] | feasible[1:] & ~reached[:-1], np.inf, step))


def away_from(evaluate: Evaluate, jumps: Sequence[Jump]) -> Callable[[FloatArray], FloatArray]:
    """Return the merit of an axis that excludes the neighborhoods of jumps."""

    def merit(u: FloatArray) -> FloatArray:
        near = np.any([jump.is_near(u) for jump in jumps], axis=0)
        return np.where(near, np.inf, evaluate(u).merit)

    return merit
