"""What is known of a design beside its gain: each part is computed when it is first asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactResult

from .certificate import Certificate, ConstraintOutcome, IdealDesign, Sensitivity, TradeOff
from .constraints import Constraint
from .problem import Problem
from .search import HELD, GainAxis, Minimum, Scan, refine, scan
from .sensitivity import gain_gradient, gain_sensitivities

__all__ = ["Evidence"]

_ACTIVE = 1e-6
_SMOOTH = 1e-2  # |df/du| / f over 0.2 of u around the optimum on a loop: ripples of r displace it to sqrt(2 r f_uu / f)


@dataclass(frozen=True, kw_only=True)
class Evidence(Value):
    """The scan and the minima of a design, and what follows from them.

    Args:
        problem: what was designed.
        settled: the optimal gain, where that was settled without the whole scan.
    """

    problem: Problem
    settled: float | None = None

    @cached_property
    def scanned(self) -> Scan:
        """The scan of the whole range, refined until neighbors predict each other."""
        return scan(self.problem.landscape, *self.problem.axis.span)

    @cached_property
    def minima(self) -> tuple[Minimum, ...]:
        """All local minima of the objective, refined, best first."""
        found = self.scanned
        minima = refine(self._merit, found.coordinate, found.landscape.merit)
        return tuple(minima or self._between_gains())

    def _merit(self, coordinate: FloatArray) -> FloatArray:
        return self.problem.landscape(coordinate).merit

    def _between_gains(self) -> list[Minimum]:
        """Return the minima within feasible gains that lie between those of the scan: limits may leave that little."""
        near = self._least_excess
        if near is None or near.value > HELD:
            return []
        steps = 0.5 ** np.arange(50)
        low, high = near.bracket
        below, above = ((end - near.coordinate) * steps for end in (low, high))
        u = np.unique(near.coordinate + np.concatenate([[0.0], below, above]))
        return refine(self._merit, u, self._merit(u))

    @cached_property
    def _least_excess(self) -> Minimum | None:
        """The gain at which the worst ratio of quantity and limit is least; None where none makes contact."""
        found, problem = self.scanned, self.problem
        near = refine(lambda u: problem.landscape(u).worst_ratio, found.coordinate, found.landscape.worst_ratio)
        return near[0] if near else None

    @property
    def best(self) -> Minimum | None:
        """The best minimum; None where no gain is feasible."""
        return self.minima[0] if self.minima else None

    @cached_property
    def nearest_gain(self) -> float | None:
        """Where no gain is feasible, the one that exceeds the limits least; None where none makes contact."""
        if self.minima or self._least_excess is None:
            return None
        return float(self.problem.axis.gain(self._least_excess.coordinate))

    @cached_property
    def gain(self) -> float | None:
        """The optimal gain [N s]."""
        if self.settled is not None:
            return self.settled
        return None if self.best is None else float(self.problem.axis.gain(self.best.coordinate))

    @cached_property
    def result(self) -> ContactResult | None:
        """The encounter at the optimal gain."""
        return None if self.gain is None else self.problem.run(self.gain)

    @cached_property
    def nearest(self) -> ContactResult | None:
        """The encounter at the nearest gain."""
        if self.gain is not None or self.nearest_gain is None:
            return None
        return self.problem.run(self.nearest_gain)

    @cached_property
    def no_mitigation(self) -> ContactResult:
        """The encounter with D_p = 0."""
        return self.problem.run(0.0)

    @cached_property
    def scan_result(self) -> ContactResult:
        """The encounters of the scan."""
        return self.problem.run(self.problem.axis.gain(self.scanned.coordinate))

    @cached_property
    def trade_off(self) -> TradeOff:
        """Objective and contact over the bounds."""
        return TradeOff(
            gain=self.problem.axis.gain(self.scanned.coordinate),
            objective=self.scanned.landscape.objective,
            reached=self.scanned.landscape.reached,
            feasible=self.scanned.landscape.feasible,
            state=self.scan_result.end,
        )

    @cached_property
    def constraints(self) -> tuple[ConstraintOutcome, ...]:
        """Each constraint at the chosen or nearest gain, and the smallest magnitude that any gain reaches."""
        shown = self.result or self.nearest
        return tuple(self._outcome(i, constraint, shown) for i, constraint in enumerate(self.problem.constraints))

    def _outcome(self, i: int, constraint: Constraint, shown: ContactResult | None) -> ConstraintOutcome:
        problem = self.problem
        best = refine(
            lambda u: problem.landscape(u).ratios[i], self.scanned.coordinate, self.scanned.landscape.ratios[i]
        )
        value = None if shown is None else float(constraint.magnitude(shown.end, problem.impact))
        return ConstraintOutcome(
            name=constraint.name,
            quantity=constraint.quantity,
            unit=constraint.unit,
            limit=constraint.limit,
            value=value,
            margin=None if value is None else constraint.limit - value,
            active=value is not None and abs(value / constraint.limit - 1) < _ACTIVE,
            best_value=best[0].value * constraint.limit if best else None,
            best_gain=float(problem.axis.gain(best[0].coordinate)) if best else None,
        )

    @cached_property
    def at(self) -> str:
        """Where the optimum sits, as in Certificate."""
        if self.settled is not None or self.best is None or not self.best.edge:
            return "interior"
        active = next((o.name for o in self.constraints if o.active), None)
        if active is not None:
            return active
        if _at_bound(self.problem.axis, self.best.coordinate):
            return "bound"
        reached = self.problem.landscape(np.array(self.best.bracket)).reached
        return "corner" if reached.all() else "edge of contact"

    @cached_property
    def certificate(self) -> Certificate | None:
        """Why the gain is believed to be the optimum."""
        if self.best is None:
            return None
        axis = self.problem.axis
        low, high = self.best.bracket
        return Certificate(
            scanned=len(self.scanned.coordinate),
            resolution=self.scanned.resolution,
            local_minima=tuple((float(axis.gain(m.coordinate)), m.value) for m in self.minima),
            bracket=(float(axis.gain(low)), float(axis.gain(high))),
            stationarity=_stationarity(self.problem, self.best) if self.at == "interior" else None,
            at=self.at,
        )

    @cached_property
    def sensitivities(self) -> tuple[Sensitivity, ...]:
        """The derivative of the optimum with respect to each input; none where it has none."""
        if self.gain is None or self.at == "corner":
            return ()
        p = self.problem
        if p.evaluator is not None and self.at == "interior" and not self._is_smooth():
            return ()
        return gain_sensitivities(p, self.gain, self.at)

    def _is_smooth(self) -> bool:
        """Tell whether the objective of somebody else's encounters is smooth as far as differences reach."""
        slope = None if self.best is None else _stationarity(self.problem, self.best)
        return slope is not None and slope < _SMOOTH

    @cached_property
    def ideal(self) -> IdealDesign | None:
        """What the design of continuous time comes to where somebody else solves the encounters."""
        p = self.problem
        if p.evaluator is None or self.gain is None:
            return None
        from .gain import design_one  # noqa: PLC0415 - it makes designs of evidence

        found = design_one(replace(p, evaluator=None))
        if found.gain is None:
            return None
        both = p.landscape(p.axis.coordinate(np.array([found.gain, self.gain])))
        value, own = map(float, both.objective)
        loss = value / own - 1 if own > 0 else math.inf if value > 0 else 0.0
        return IdealDesign(gain=float(found.gain), objective=value, loss=loss, feasible=bool(both.feasible[0]))

    def gradient(self, gain: float, name: str) -> Any:
        """Differentiate the optimal gain by one input.

        Args:
            gain: the optimal gain [N s].
            name: the input.

        Returns:
            The derivative.
        """
        return gain_gradient(self.problem, gain, name, lambda _: self)


def _at_bound(axis: GainAxis, coordinate: float) -> bool:
    low, high = axis.span
    return min(abs(coordinate - low), abs(coordinate - high)) <= 1e-9 * (high - low)


def _stationarity(problem: Problem, best: Minimum) -> float | None:
    """Return |df/du| / f at an interior optimum, by a five-point difference that the search did not use."""
    narrow = min(1e-2, 0.1 * (best.bracket[1] - best.bracket[0]))  # a sharp minimum has a narrow bracket
    step = narrow if problem.evaluator is None else 0.05  # which reaches over the ripples of a loop that samples
    f = problem.landscape(best.coordinate + step * np.array([-2.0, -1.0, 1.0, 2.0])).objective
    if best.value == 0 or not np.isfinite(f).all():  # the optimum lies that close to where contact ends, or is nothing
        return None
    return abs(float(f @ np.array([1.0, -8.0, 8.0, -1.0]) / (12 * step))) / best.value
