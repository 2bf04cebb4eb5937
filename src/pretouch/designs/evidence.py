"""Compute the evidence that a gain is optimal, and its sensitivities."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import Any, Final, TypeVar

import numpy as np

from pretouch._core.errors import ResultUnavailableError
from pretouch.motion import ContactResult

from .certificate import ACTIVE, Certificate, ConstraintOutcome, DesignStatus, IdealDesign, Sensitivity, TradeOff
from .constraints import Constraint
from .gain_jump import GainJump, describe_jump
from .problem import Answer, GainProblem
from .relaxation import Relaxation, relax_on_axis
from .search import Minimum, Scan, refine, search_axis
from .search.compiled import INFEASIBLE, OPTIMAL, UNCERTAIN, search_compiled
from .search.many import design_many, settle_one
from .sensitivity import gain_sensitivities

R = TypeVar("R")
_AT_RESERVE: Final = 1e-9  # distance in u from the end of a reserve within which an optimum lies at this end

# On a loop, an objective counts as smooth if |df/du| / f at its optimum is at most this, by differences over 0.2 of u.
# Ripples of the relative size r make |df/du| / f about sqrt(2 r f_uu / f).
_SMOOTH = 1e-2


def _part(make: Callable[[Any], R]) -> cached_property[R]:
    """Make a cached property that raises an error for several encounters."""

    @wraps(make)
    def part(evidence: GainEvidence) -> R:
        if evidence.scenario.shape:
            raise ResultUnavailableError(
                f"{make.__name__}: this result contains several designs, but a single design is needed; select "
                "one design with .at(index)"
            )
        return make(evidence)

    return cached_property(part)


@dataclass(frozen=True, kw_only=True, repr=False)
class GainEvidence(Answer):
    """Evidence that a designed gain is optimal.

    It contains all evaluated gains, the local minima and the results computed from them.

    Args:
        settled: status, optimal gain and objective, if a fast search has already found them, without the whole scan;
            arrays for an array of encounters.
    """

    settled: tuple[Any, Any, Any] | None

    @property
    def answer(self) -> tuple[Any, Any, Any]:
        """Status, optimal gain and objective of the design."""
        return self._searched if self.settled is None else self.settled

    @cached_property
    def _searched(self) -> tuple[Any, Any, Any]:
        if self.minima:
            best = self.minima[0]
            return DesignStatus.OPTIMAL, float(self.problem.axis.gain(best.coordinate)), best.value
        return DesignStatus.NO_CONTACT if self.nearest_gain is None else DesignStatus.INFEASIBLE, None, None

    @property
    def status(self) -> Any:
        """Status of the design, such as optimal or infeasible.

        It is infeasible if no gain meets all constraints, and no-contact if no gain results in contact. For an array of
        encounters, it is an array of statuses.
        """
        return self.answer[0]

    @property
    def gain(self) -> Any:
        """The optimal gain of the control law.

        Without an optimum, it is None, or NaN in an array.
        """
        return self.answer[1]

    @property
    def objective(self) -> Any:
        """The objective at the optimal gain.

        Without an optimum, it is None, or NaN in an array.
        """
        return self.answer[2]

    @_part
    def scanned(self) -> Scan:
        """The objective for a dense grid of gains.

        Returns:
            The scan, whose neighboring gains allow accurate interpolation.
        """
        return self._search[0]

    @_part
    def minima(self) -> tuple[Minimum, ...]:
        """All local minima of the objective, refined and sorted, best first."""
        return tuple(self._search[1])

    @_part
    def _search(self) -> tuple[Scan, list[Minimum]]:
        axis = self.problem.axis
        return search_axis(self.problem.landscape, *axis.span, reserve=axis.reserve)

    @_part
    def nearest_gain(self) -> float | None:
        """The gain with the smallest limit violation, if no gain is feasible.

        Returns:
            The gain; None unless the design is infeasible.
        """
        coordinate = self.scanned.least_violation
        return None if self.minima or coordinate is None else float(self.problem.axis.gain(coordinate))

    @_part
    def relaxations(self) -> tuple[Relaxation, ...]:
        """The limits that must be raised, and to what values, if no gain is feasible.

        Returns:
            The smallest value of each limit, with the other limits kept; the values of several limits if no limit
            alone suffices. Empty unless the design is infeasible.
        """
        if self.status is not DesignStatus.INFEASIBLE:
            return ()
        problem = self.problem
        return relax_on_axis(problem.landscape, problem.axis, self.scanned, problem.task.limits, number=self.number)

    @_part
    def result(self) -> ContactResult | None:
        """The predicted motion and contact at the optimal gain.

        Returns:
            The encounter; None if there is no optimum.
        """
        return None if self.gain is None else self.problem.run(self.gain)

    @_part
    def nearest(self) -> ContactResult | None:
        """The encounter at the gain with the smallest limit violation.

        Returns:
            The encounter; None unless the design is infeasible.
        """
        if self.gain is not None or self.nearest_gain is None:
            return None
        return self.problem.run(self.nearest_gain)

    @_part
    def no_mitigation(self) -> ContactResult:
        """The predicted motion and contact without mitigation (gain 0)."""
        return self.problem.run(0.0)

    @_part
    def scan_result(self) -> ContactResult:
        """The predicted motions and contacts for all gains that the search evaluated."""
        return self.problem.run(self.problem.axis.gain(self.scanned.coordinate))

    @_part
    def trade_off(self) -> TradeOff:
        """Objective and quantities at contact for every gain that the search evaluated."""
        return TradeOff(
            gain=self.problem.axis.gain(self.scanned.coordinate),
            objective=self.scanned.landscape.objective,
            reached=self.scanned.landscape.reached,
            feasible=self.scanned.landscape.feasible,
            state=self.scan_result.end,
        )

    @_part
    def constraints(self) -> tuple[ConstraintOutcome, ...]:
        """The value of each constraint at the designed gain.

        Returns:
            The constraints, each with the smallest value that any gain reaches.
        """
        shown = self.result or self.nearest
        return tuple(self._outcome(i, constraint, shown) for i, constraint in enumerate(self.problem.task.limits))

    def _outcome(self, i: int, constraint: Constraint, shown: ContactResult | None) -> ConstraintOutcome:
        problem = self.problem
        best = refine(
            lambda u: problem.landscape(u).ratios[i], self.scanned.coordinate, self.scanned.landscape.ratios[i]
        )
        value = None if shown is None else float(constraint.magnitude(shown.end, problem.task.impact))
        return ConstraintOutcome(
            name=constraint.name,
            quantity=constraint.quantity,
            unit=problem.task.law.number.entry(constraint.quantity).unit,
            limit=constraint.limit,
            value=value,
            margin=None if value is None else constraint.limit - value,
            active=value is not None and abs(value / constraint.limit - 1) < ACTIVE,
            best_value=best[0].value * constraint.limit if best else None,
            best_gain=float(problem.axis.gain(best[0].coordinate)) if best else None,
        )

    @_part
    def place(self) -> str:
        """The location of the optimal gain: inside the bounds, or on a limit.

        Returns:
            `interior`, `bound`, `corner`, `edge of contact`, `reserve`, or the name of the active constraint.
        """
        if self._is_settled_inside() or not self.minima or not self.minima[0].edge:
            return "interior"
        best = self.minima[0]
        active = next((o.name for o in self.constraints if o.active), None)
        if active is not None:
            return active
        if self.problem.axis.is_end(best.coordinate):
            return "bound"
        if best.jump is not None and min(abs(end - best.coordinate) for end in best.jump.ends) < _AT_RESERVE:
            return "reserve"
        reached = self.problem.landscape(np.array(best.bracket)).reached
        return "corner" if reached.all() else "edge of contact"

    def _is_settled_inside(self) -> bool:
        """Return True if the fast search found an optimum between the bounds of a task without limits."""
        p = self.problem
        free = self.settled is not None and self.gain is not None and not p.task.limits
        return free and not p.axis.is_end(float(p.axis.coordinate(self.gain)))

    @_part
    def jump(self) -> GainJump | None:
        """The jump of the objective, of a constraint or of contact, next to which the lowest objective lies.

        Returns:
            The jump, from which the designed gain keeps a distance; None without a jump.
        """
        if self.settled is not None or not self.minima:  # a fast search settles only smooth optima
            return None
        return describe_jump(self.problem, self.minima[0].jump)

    @_part
    def certificate(self) -> Certificate | None:
        """Evidence that the designed gain is the global optimum.

        Returns:
            The evidence; None if there is no optimum.
        """
        if not self.minima:
            return None
        axis, best = self.problem.axis, self.minima[0]
        low, high = best.bracket
        return Certificate(
            scanned=len(self.scanned.coordinate),
            resolution=self.scanned.resolution,
            local_minima=tuple((float(axis.gain(m.coordinate)), m.value) for m in self.minima),
            bracket=(float(axis.gain(low)), float(axis.gain(high))),
            stationarity=_stationarity(self.problem, self._at_answer(best)) if self.place == "interior" else None,
            at=self.place,
        )

    def _at_answer(self, best: Minimum) -> Minimum:
        """Return the best minimum, with gain and objective of the fast search if that succeeded."""
        if self.settled is None:
            return best
        return replace(best, coordinate=float(self.problem.axis.coordinate(self.gain)), value=float(self.objective))

    @_part
    def sensitivities(self) -> tuple[Sensitivity, ...]:
        """Derivatives of the optimal gain with respect to each input.

        Returns:
            One entry per input; empty if the optimum is not differentiable.
        """
        if self.gain is None or self.place in {"corner", "reserve"}:
            return ()
        p = self.problem
        if p.task.evaluate is not None and self.place == "interior" and not self._is_smooth():
            return ()
        return gain_sensitivities(p, self.gain, self.place)

    def _is_smooth(self) -> bool:
        """Return True if the objective is smooth at the optimum, so that finite differences are accurate."""
        slope = _stationarity(self.problem, self.minima[0]) if self.minima else None
        return slope is not None and slope < _SMOOTH

    @_part
    def ideal(self) -> IdealDesign | None:
        """The optimal gain in continuous time.

        Returns:
            Its comparison with the gain designed on the loop; None without `evaluate` or without an optimal gain.
        """
        p = self.problem
        if p.task.evaluate is None or self.gain is None:
            return None
        continuous = p.changed(evaluate=None)
        ideal = GainEvidence(problem=continuous, settled=settle(continuous))
        if ideal.gain is None:
            return None
        both = p.landscape(p.axis.coordinate(np.array([ideal.gain, self.gain])))
        value, best = map(float, both.objective)
        loss = value / best - 1 if best > 0 else math.inf if value > 0 else 0.0
        return IdealDesign(gain=ideal.gain, objective=value, loss=loss, feasible=bool(both.feasible[0]))


def settle(problem: GainProblem) -> tuple[Any, Any, Any] | None:
    """Find optimal gains by a fast search.

    Returns:
        Status, gain and objective; None if the search is not certain of the result.
    """
    if problem.task.scenario.shape:
        return design_many(problem, _search_one)
    free = problem.within_gain_limit()
    result = search_compiled(free)
    gain, value, outcome = (math.nan, math.nan, UNCERTAIN) if result is None else result[:, 0].tolist()
    if outcome == OPTIMAL:
        return DesignStatus.OPTIMAL, gain, value
    if outcome == INFEASIBLE:
        return DesignStatus.INFEASIBLE, None, None
    optimum = settle_one(free)
    return None if optimum is None else (DesignStatus.OPTIMAL, *optimum)


def _search_one(problem: GainProblem) -> tuple[Any, Any, Any]:
    return GainEvidence(problem=problem, settled=settle(problem) if problem.is_noisy else None).answer


def _stationarity(problem: GainProblem, best: Minimum) -> float | None:
    """Return |slope| / value of the objective at an optimum, by a five-point finite difference."""
    narrow = min(1e-2, 0.1 * (best.bracket[1] - best.bracket[0]))  # a sharp minimum has a narrow bracket
    step = narrow if problem.task.evaluate is None else 0.05  # wider than the ripples of a sampled loop
    f = problem.landscape(best.coordinate + step * np.array([-2.0, -1.0, 1.0, 2.0])).objective
    if best.value == 0 or not np.isfinite(f).all():  # the objective is 0, or contact ends within the steps
        return None
    return abs(float(f @ np.array([1.0, -8.0, 8.0, -1.0]) / (12 * step))) / best.value
