"""The gain that is optimal within its bounds and constraints, with the evidence that it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pretouch.motion import Scenario
from pretouch.sensors import SensorModel

from .certificate import DesignStatus
from .constraints import Constraint
from .evidence import Evidence
from .impact import ImpactModel
from .own_objective import AnyObjective, as_objective
from .problem import Evaluator, Problem
from .result import GainDesign
from .search import GainAxis
from .search.compiled import search_compiled
from .search.many import ArrayEvidence, design_many, settle_one

__all__ = ["Evaluator", "design_gain", "design_one"]


def design_gain(
    scenario: Scenario,
    sensor: SensorModel,
    objective: AnyObjective,
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
        scenario: one encounter, or an array of them, each of which gets its own gain.
        sensor: the sensor curve.
        objective: what is minimized: an Objective, or an object or a function of your own (docs/design.md).
        bounds: smallest and largest gain [N s]; mitigating gains are negative.
        constraints: limits that the encounter must keep.
        impact: physical properties, for objectives and constraints on forces.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].
        evaluate: solves encounters in the place of `find_contact`, from scenario, sensor and an array of gains: a
            `ClosedLoop`, for the gain that is optimal on the sampled loop, or a function.

    Returns:
        The design; infeasible and no-contact are statuses of it, not errors. For an array of encounters, status,
        gain and objective are arrays, and `at` gives a single design with its evidence.

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
    problem = Problem(
        scenario=scenario,
        sensor=sensor,
        objective=as_objective(objective),
        constraints=tuple(constraints),
        impact=impact,
        axis=GainAxis.between(bounds),
        method=method,
        horizon=horizon,
        evaluator=evaluate,
    )
    if scenario.shape == ():
        return design_one(problem)
    search = design_one if problem.is_noisy else _search_one
    return _design(problem, *design_many(problem, search), ArrayEvidence(problem=problem))


def design_one(problem: Problem) -> GainDesign:
    """Design a single encounter, by the search of many where that settles it for certain.

    Args:
        problem: the problem, of one encounter.

    Returns:
        The design.
    """
    free = problem.within_gain_limit()
    found = search_compiled(free)
    gain, value, known = (math.nan, math.nan, 0.0) if found is None else found[:, 0].tolist()
    if not known:
        settled = settle_one(free)
        if settled is None:
            return _search_one(problem)
        gain, value = settled
    return _design(problem, DesignStatus.OPTIMAL, gain, value, Evidence(problem=problem, settled=gain))


def _search_one(problem: Problem) -> GainDesign:
    """Design a single encounter by the scan that halves intervals until neighbors predict each other."""
    evidence = Evidence(problem=problem)
    if evidence.best is not None:
        return _design(problem, DesignStatus.OPTIMAL, evidence.gain, evidence.best.value, evidence)
    contact = evidence.nearest_gain is not None
    return _design(problem, DesignStatus.INFEASIBLE if contact else DesignStatus.NO_CONTACT, None, None, evidence)


def _design(problem: Problem, status: Any, gain: Any, objective: Any, evidence: Any) -> GainDesign:
    return GainDesign(
        status=status,
        gain=gain,
        objective=objective,
        bounds=problem.axis.ends,
        scenario=problem.scenario,
        sensor=problem.sensor,
        definition=problem.objective,
        impact=problem.impact,
        evidence=evidence,
    )
