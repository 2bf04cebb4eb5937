"""What is known of a design beside its gain: each part is computed when it is first asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactResult

from .certificate import Certificate, ConstraintOutcome, DesignStatus, IdealDesign, Sensitivity, TradeOff
from .constraints import Constraint
from .problem import GainProblem
from .search import HELD, Minimum, Scan, refine, scan
from .search.compiled import search_compiled
from .search.many import Found, design_many, settle_one
from .sensitivity import gain_gradient, gain_sensitivities

__all__ = ["ArrayEvidence", "GainEvidence", "find_evidence", "find_evidence_of_many"]

_ACTIVE = 1e-6
_SMOOTH = 1e-2  # |df/du| / f over 0.2 of u around the optimum on a loop: ripples of r displace it to sqrt(2 r f_uu / f)


@dataclass(frozen=True, kw_only=True)
class GainEvidence(Value):
    """The scan and the minima of a design, and what follows from them.

    Args:
        problem: what was designed.
        settled: the optimal gain [N s] and the objective there, where these were settled without the whole scan.
    """

    problem: GainProblem
    settled: tuple[float, float] | None = None

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

    @property
    def gain(self) -> float | None:
        """The optimal gain [N s]."""
        if self.settled is not None:
            return self.settled[0]
        return None if self.best is None else float(self.problem.axis.gain(self.best.coordinate))

    @property
    def objective(self) -> float | None:
        """The objective there."""
        if self.settled is not None:
            return self.settled[1]
        return None if self.best is None else self.best.value

    @property
    def status(self) -> DesignStatus:
        """How the design ended."""
        if self.settled is not None or self.best is not None:
            return DesignStatus.OPTIMAL
        return DesignStatus.NO_CONTACT if self.nearest_gain is None else DesignStatus.INFEASIBLE

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
        if self.problem.axis.is_end(self.best.coordinate):
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
        found = find_evidence(replace(p, evaluator=None))
        if found.gain is None:
            return None
        both = p.landscape(p.axis.coordinate(np.array([found.gain, self.gain])))
        value, own = map(float, both.objective)
        loss = value / own - 1 if own > 0 else math.inf if value > 0 else 0.0
        return IdealDesign(gain=found.gain, objective=value, loss=loss, feasible=bool(both.feasible[0]))

    def gradient(self, name: str) -> float:
        """Differentiate the optimal gain by one input; NaN where there is none."""
        return math.nan if self.gain is None else float(gain_gradient(self.problem, self.gain, name, lambda _: self))


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayEvidence(Value):
    """In the place of the evidence of one design: says how to get that.

    Args:
        problem: what was designed.
        status: how each design ended, of the scenario's shape.
        gain: the optimal gains [N s]; NaN where there is none.
        objective: the objectives there.
    """

    problem: GainProblem
    status: Any
    gain: FloatArray
    objective: FloatArray

    def at(self, index: tuple[int, ...]) -> GainEvidence:
        """Design the encounter at an index, one integer per axis, alone."""
        return find_evidence(self.problem.at(index))

    def gradient(self, name: str) -> FloatArray:
        """Differentiate the optimal gains by one input."""
        return gain_gradient(self.problem, self.gain, name, self.at)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # as of a protocol of Python, which asks what there is
            raise AttributeError(name)
        raise ResultUnavailableError(
            f"{name}: found an array of designs, of which each has its own; choose one with .at(index)"
        )


def find_evidence(problem: GainProblem) -> GainEvidence:
    """Design a single encounter, by the search of many where that settles it for certain.

    Args:
        problem: the problem, of one encounter.

    Returns:
        The evidence; where nothing is settled, its scan is still to come.
    """
    free = problem.within_gain_limit()
    found = search_compiled(free)
    gain, value, known = (math.nan, math.nan, 0.0) if found is None else found[:, 0].tolist()
    return GainEvidence(problem=problem, settled=(gain, value) if known else settle_one(free))


def find_evidence_of_many(problem: GainProblem) -> ArrayEvidence:
    """Design every encounter of an array.

    Args:
        problem: the problem, with an array of encounters.

    Returns:
        The evidence.
    """

    def search_one(one: GainProblem) -> Found:
        alone = find_evidence(one) if problem.is_noisy else GainEvidence(problem=one)
        return alone.status, alone.gain, alone.objective

    status, gain, objective = design_many(problem, search_one)
    return ArrayEvidence(problem=problem, status=status, gain=gain, objective=objective)


def _stationarity(problem: GainProblem, best: Minimum) -> float | None:
    """Return |df/du| / f at an interior optimum, by a five-point difference that the search did not use."""
    narrow = min(1e-2, 0.1 * (best.bracket[1] - best.bracket[0]))  # a sharp minimum has a narrow bracket
    step = narrow if problem.evaluator is None else 0.05  # which reaches over the ripples of a loop that samples
    f = problem.landscape(best.coordinate + step * np.array([-2.0, -1.0, 1.0, 2.0])).objective
    if best.value == 0 or not np.isfinite(f).all():  # the optimum lies that close to where contact ends, or is nothing
        return None
    return abs(float(f @ np.array([1.0, -8.0, 8.0, -1.0]) / (12 * step))) / best.value
