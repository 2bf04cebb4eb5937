"""Design a task as the command `pretouch design` does."""

from typing import Any

from .admittance import design_admittance
from .admittance_result import AdmittanceDesign
from .drag import DragDesign, design_drag
from .gain import GainDesign, design_gain
from .task import Task


def design(task: Task) -> GainDesign | AdmittanceDesign | DragDesign:
    """Find the optimal gain, the optimal gain and admittance, or a virtual drag.

    The task decides: a drag for a task with `drag_effect`, gain and admittance for bounds of natural frequency or
    damping ratio, otherwise the gain.

    Args:
        task: the encounter or an array of encounters, the sensor, and an objective with bounds of the gain or an effect
            of the drag.

    Returns:
        The design, with its evidence. Infeasible and no-contact are statuses, not errors.

    Raises:
        InvalidInputError: the request makes no sense.

    Examples:
        >>> from pretouch.designs import Task, excursion_objective
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
        >>> found = design(task)
        >>> round(found.gain, 4), round(found.objective, 5)
        (-0.7463, 0.10698)
        >>> round(design(task.replace(damping_ratio=(0.7, 2.0))).damping_ratio, 3)
        2.0
    """  # noqa: DOC502 - raised by the functions below
    given: Any = task  # each of the three functions checks its type
    if isinstance(given, Task) and given.drag_effect is not None:
        return design_drag(given)
    if isinstance(given, Task) and given.is_admittance_free:
        return design_admittance(given)
    return design_gain(given)
