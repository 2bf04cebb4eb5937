"""The gain that is optimal within its bounds and constraints, with the evidence that it is."""

from __future__ import annotations

from collections.abc import Sequence

from pretouch.motion import Scenario
from pretouch.sensors import SensorModel

from .constraints import Constraint
from .evidence import find_evidence, find_evidence_of_many
from .impact import ImpactModel
from .own_objective import AnyObjective, as_objective
from .problem import Evaluator, GainProblem
from .result import GainDesign
from .search import GainAxis

__all__ = ["Evaluator", "design", "design_gain"]


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
    problem = GainProblem(
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
    return design(problem)


def design(problem: GainProblem) -> GainDesign:
    """Design the gain of a problem, or of each encounter of an array."""
    if problem.scenario.shape == ():
        return GainDesign.of(find_evidence(problem))
    return GainDesign.of(find_evidence_of_many(problem))
