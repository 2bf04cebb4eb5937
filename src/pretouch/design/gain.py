"""The gain that is optimal within its bounds and constraints, with the evidence that it is."""

from __future__ import annotations

from .problem import GainProblem
from .result import GainDesign
from .search import GainAxis
from .task import Task, placed

__all__ = ["design_gain"]


@placed
def design_gain(task: Task) -> GainDesign:
    """Find the gain D_p that minimizes an objective like L(20) or L(22) at contact, L(21), L(23), within constraints.

    The whole range of gains is scanned until neighbors predict each other, each local minimum is refined, and the
    best one is the answer; nothing depends on a starting point.

    Args:
        task: the encounter, or an array of them, the objective, the bounds, and where given constraints, impact,
            method, horizon and `evaluate`.

    Returns:
        The design; infeasible and no-contact are statuses of it, not errors. For an array of encounters, status,
        gain and objective are arrays, and `at` gives a single design with its evidence.

    Examples:
        >>> from pretouch.design import excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle, Scenario
        >>> from pretouch.sensors import InversePower
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     bounds=(-10.0, -0.01),
        ... )
        >>> design = design_gain(task)
        >>> round(design.gain, 4), round(design.objective, 5)
        (-0.7463, 0.10698)
    """
    return GainDesign.of(GainProblem(task=task, axis=GainAxis.between(task.stable_bounds())))
