"""The gain that is optimal within its bounds and constraints, with the evidence that it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite
from pretouch.motion import ContactResult, Scenario, find_contact
from pretouch.sensors import SensorModel

from .advice import design_warnings
from .constraints import Constraint
from .impact import ImpactModel
from .objectives import Objective
from .result import Certificate, ConstraintOutcome, DesignStatus, GainDesign, TradeOff
from .search import GainAxis, Landscape, Minimum, Scan, refine, scan
from .sensitivity import gain_sensitivities

__all__ = ["Evaluator", "design_gain"]

Evaluator: TypeAlias = Callable[[Scenario, SensorModel, Any], ContactResult]
_ACTIVE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
    """One design problem, and the two views of it that the search needs."""

    scenario: Scenario
    sensor: SensorModel
    objective: Objective
    constraints: tuple[Constraint, ...]
    impact: ImpactModel | None
    evaluate: Evaluator
    axis: GainAxis

    def landscape(self, coordinate: FloatArray) -> Landscape:
        return self.appraise(self.evaluate(self.scenario, self.sensor, self.axis.gain(coordinate)))

    def appraise(self, result: ContactResult) -> Landscape:
        reached = result.reached
        speed = abs(self.scenario.obstacle.velocity)
        value = self.objective.value(result.end, speed, self.impact)
        ratios = [c.magnitude(result.end, self.impact) / c.limit for c in self.constraints]
        return Landscape(
            objective=np.where(reached, value, np.inf),
            ratios=np.where(reached, np.reshape(ratios, (len(ratios), *np.shape(reached))), np.inf),
        )


def design_gain(
    scenario: Scenario,
    sensor: SensorModel,
    objective: Objective,
    *,
    bounds: tuple[float, float],
    constraints: Sequence[Constraint] = (),
    impact: ImpactModel | None = None,
    method: str = "auto",
    horizon: float = 600.0,
    evaluate: Evaluator | None = None,
) -> GainDesign:
    """Find the gain D_p that minimizes an objective like L(20) or L(22) at contact, L(21), L(23), within constraints.

    The whole range of gains is scanned until neighbors predict each other, each local minimum is refined, and the
    best one is the answer; nothing depends on a starting point.

    Args:
        scenario: one encounter.
        sensor: the sensor curve.
        objective: what is minimized.
        bounds: smallest and largest gain [N s]; mitigating gains are negative.
        constraints: limits that the encounter must keep.
        impact: physical properties, for objectives and constraints on forces.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].
        evaluate: solves encounters in the place of `find_contact`, from scenario, sensor and an array of gains.

    Returns:
        The design; infeasible and no-contact are statuses of it, not errors.

    Examples:
        >>> from pretouch.design import excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> design = design_gain(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     bounds=(-10.0, -0.01),
        ... )
        >>> round(design.gain, 4), round(design.objective, 5)
        (-0.7463, 0.10698)
    """
    low, high = (finite(b, "bounds", "N*s") for b in bounds)
    problem = _Problem(
        scenario=scenario,
        sensor=sensor,
        objective=objective,
        constraints=tuple(constraints),
        impact=impact,
        evaluate=evaluate or partial(find_contact, method=method, horizon=horizon),
        axis=GainAxis(low=low, high=high),
    )
    _check(problem)
    ends = problem.axis.coordinate(np.array([low, high]))
    scanned = scan(problem.landscape, float(ends[0]), float(ends[1]))
    minima = refine(lambda u: problem.landscape(u).merit, scanned.coordinate, scanned.landscape.merit)
    if minima:
        return _optimal(problem, scanned, minima)
    return _impossible(problem, scanned)


def _check(problem: _Problem) -> None:
    """Refuse what makes no sense as a design problem."""
    axis, shape = problem.axis, problem.scenario.shape
    if not axis.low < axis.high:
        raise InvalidInputError(f"bounds: found [{axis.low:g}, {axis.high:g}] N*s, expected the smaller gain first")
    if shape != ():
        raise InvalidInputError(f"scenario: found an array of shape {shape}, expected one encounter")
    names = [c.name for c in problem.constraints]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f"constraint {name}: found twice, expected once")


def _optimal(problem: _Problem, scanned: Scan, minima: list[Minimum]) -> GainDesign:
    """Report the best of the minima."""
    best = minima[0]
    gain = float(problem.axis.gain(best.coordinate))
    result = problem.evaluate(problem.scenario, problem.sensor, gain)
    speed = abs(problem.scenario.obstacle.velocity)
    outcomes = _outcomes(problem, scanned, result)
    active = next((o.name for o in outcomes if o.active), None) if best.edge else None
    at = active or ("bound" if best.edge and _at_bound(problem.axis, best.coordinate) else "interior")
    if best.edge and at == "interior":
        at = "edge of contact"
    certificate = Certificate(
        scanned=len(scanned.coordinate),
        resolution=scanned.resolution,
        local_minima=tuple((float(problem.axis.gain(m.coordinate)), m.value) for m in minima),
        bracket=(float(problem.axis.gain(best.bracket[0])), float(problem.axis.gain(best.bracket[1]))),
        stationarity=_stationarity(problem, best.coordinate, best.value) if at == "interior" else None,
        at=at,
    )
    return _design(
        problem,
        scanned,
        status=DesignStatus.OPTIMAL,
        gain=gain,
        objective=float(problem.objective.value(result.end, speed, problem.impact)),
        objective_parts={k: float(v) for k, v in problem.objective.parts(result.end, speed, problem.impact).items()},
        result=result,
        constraints=outcomes,
        certificate=certificate,
        sensitivities=gain_sensitivities(
            scenario=problem.scenario,
            sensor=problem.sensor,
            objective=problem.objective,
            constraint=next((c for c in problem.constraints if c.name == at), None),
            impact=problem.impact,
            evaluate=problem.evaluate,
            axis=problem.axis,
            gain=gain,
            at=at,
        ),
    )


def _impossible(problem: _Problem, scanned: Scan) -> GainDesign:
    """Report that no gain does: the one that comes nearest to the constraints, where there is contact at all."""
    nearest = refine(lambda u: problem.landscape(u).worst_ratio, scanned.coordinate, scanned.landscape.worst_ratio)
    result = None
    if nearest:
        gain = float(problem.axis.gain(nearest[0].coordinate))
        result = problem.evaluate(problem.scenario, problem.sensor, gain)
    return _design(
        problem,
        scanned,
        status=DesignStatus.INFEASIBLE if nearest else DesignStatus.NO_CONTACT,
        constraints=_outcomes(problem, scanned, result),
        nearest=result,
    )


def _design(problem: _Problem, scanned: Scan, *, status: DesignStatus, **parts: Any) -> GainDesign:
    """Fill in what every design has, and the warnings."""
    gains = problem.axis.gain(scanned.coordinate)
    scan_result = problem.evaluate(problem.scenario, problem.sensor, gains)
    nearest_distance = max(problem.sensor.valid_range[0], 0.0)
    values: dict[str, Any] = {
        "gain": None,
        "objective": None,
        "objective_parts": {},
        "result": None,
        "nearest": None,
        "certificate": None,
        "sensitivities": (),
        **parts,
    }
    gain = values["gain"]
    design = GainDesign(
        status=status,
        method=scan_result.method,
        no_mitigation=problem.evaluate(problem.scenario, problem.sensor, 0.0),
        damping_at_contact=None if gain is None else gain * problem.sensor.log_slope(nearest_distance),
        trade_off=TradeOff(
            gain=gains,
            objective=scanned.landscape.objective,
            reached=scanned.landscape.reached,
            feasible=scanned.landscape.feasible,
            state=scan_result.end,
        ),
        warnings=(),
        bounds=(problem.axis.low, problem.axis.high),
        scenario=problem.scenario,
        sensor=problem.sensor,
        definition=problem.objective,
        impact=problem.impact,
        **values,
    )
    return design_warnings(design, scan_result)


def _outcomes(problem: _Problem, scanned: Scan, result: ContactResult | None) -> tuple[ConstraintOutcome, ...]:
    """Report each constraint at a result, and the smallest magnitude that any gain reaches."""
    outcomes = []
    for i, constraint in enumerate(problem.constraints):
        best = refine(
            lambda u, i=i: problem.landscape(u).ratios[i],  # type: ignore[misc]
            scanned.coordinate,
            scanned.landscape.ratios[i],
        )
        value = None if result is None else float(constraint.magnitude(result.end, problem.impact))
        outcomes.append(
            ConstraintOutcome(
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
        )
    return tuple(outcomes)


def _at_bound(axis: GainAxis, coordinate: float) -> bool:
    ends = axis.coordinate(np.array([axis.low, axis.high]))
    return bool(np.any(np.abs(ends - coordinate) <= 1e-9 * (ends[1] - ends[0])))


def _stationarity(problem: _Problem, coordinate: float, value: float) -> float | None:
    """Return |df/du| / f at an interior optimum, by a five-point difference that the search did not use."""
    step = 1e-2
    f = problem.landscape(coordinate + step * np.array([-2.0, -1.0, 1.0, 2.0])).objective
    if not np.isfinite(f).all():  # the optimum lies that close to where contact ends
        return None
    return abs(float(f @ np.array([1.0, -8.0, 8.0, -1.0]) / (12 * step))) / value
