"""Choose the coefficient phi of a virtual drag.

The drag meets a limit or a required ratio of contact to approach speed.

No optimization is needed: ratio and excursion trade off along one curve, and each limit selects one point of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.motion import Scenario
from pretouch.sensors import SensorModel

from ..impact import ImpactModel
from ..task import Task, with_file_location
from .limits import DragEffect
from .result import DragDesign, predict_drag


def drag_by(
    sensor: SensorModel, distance: float, mass: float, *, impact: ImpactModel | None = None, **effect: Any
) -> DragDesign:
    """Find the virtual drag with a given contact speed, excursion or acceleration.

    The requirement, such as a largest excursion, determines the coefficient phi.

    Args:
        sensor: the sensor curve, which must be valid down to contact.
        distance: detection distance l_d [m].
        mass: M of the virtual object [kg].
        impact: the impact model, for a limit of `impact_force`.
        effect: fields of `DragEffect`.

    Returns:
        The design.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> drag = drag_by(sensor, 0.0422, 1.0, ratio=0.15)
        >>> round(drag.drag, 6), round(drag.excursion, 6)
        (0.014372, 0.059619)
        >>> round(drag_by(sensor, 0.0422, 1.0, acceleration=2.0, largest_speed=0.3).ratio, 4)
        0.1522
    """
    drag, speed = DragEffect(**effect).drag(sensor, distance, mass, impact)
    return predict_drag(sensor, distance, mass, drag, largest_speed=speed)


def drag_trade_off(sensor: SensorModel, distance: float, mass: float, ratios: FloatArray | None = None) -> DragDesign:
    """Return contact speed and excursion for many virtual drags.

    The drags differ in their coefficient phi. The result is one design whose fields are arrays.

    Args:
        sensor: the sensor curve, which must be valid down to contact.
        distance: l_d [m].
        mass: M of the virtual object [kg].
        ratios: rho of the points; by default 99 from 0.99 to 0.01.

    Returns:
        The curve.

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> curve = drag_trade_off(ExponentialFirstOrder(scale=1.0, rate=-60.0), 0.04, 1.0, np.array([0.5, 0.1]))
        >>> np.round(curve.excursion, 4)
        array([0.0177, 0.1163])
    """
    return drag_by(sensor, distance, mass, ratio=np.linspace(0.99, 0.01, 99) if ratios is None else ratios)


def why_no_drag(scenario: Scenario) -> str:
    """Return why the virtual drag formulas do not apply.

    The text is empty if the formulas are valid for the encounter.
    """
    plant, reference = scenario.plant, scenario.reference
    if scenario.shape:
        return "found an array of encounters, expected one"
    if scenario.obstacle.course:
        return "found an obstacle with a course, expected uniform motion: simulate it on a loop instead"
    if (plant.position, plant.velocity) != (reference.position, reference.velocity):
        return "found a plant that is not at rest at its reference, expected one that is"
    if not scenario.relative_velocity < 0:
        return "found an obstacle that does not approach, expected a negative velocity"
    return ""


def chosen_drag(task: Task, effect: DragEffect) -> tuple[float, float]:
    """Return the virtual drag that meets a requirement.

    The result is the drag phi [N s^2], and the approach speed [m/s] up to which it meets the requirement.
    """
    speed = effect.largest_speed or -float(task.scenario.relative_velocity)
    mass, distance = float(task.scenario.admittance.mass), float(task.scenario.distance)
    drag, kept = replace(effect, largest_speed=speed).drag(task.sensor, distance, mass, task.impact)
    return float(drag), kept


@check_arguments
@with_file_location
def design_drag(task: Task) -> DragDesign:
    """Design a virtual drag for the requirement of a task.

    An example of a requirement is a largest excursion.

    Args:
        task: the encounter, which starts at the detection distance, the sensor, and `drag_effect`. The default of the
            effect's largest speed is the speed of the encounter. With an objective, the page also shows the letter's
            optimal gain for comparison.

    Returns:
        The design, with its task.

    Raises:
        InvalidInputError: the task has no effect, or the prediction of the drag does not apply to its encounter.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> design = design_drag(
        ...     Task(
        ...         Scenario(
        ...             admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...             obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...         ),
        ...         InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...         drag_effect=DragEffect(ratio=0.15),
        ...     )
        ... )
        >>> round(design.drag, 6), round(design.result.contact.relative_velocity, 6)
        (0.014372, -0.045)
    """
    if task.drag_effect is None:
        raise InvalidInputError(
            "drag_effect: found none, expected the requirement on the drag, such as DragEffect(ratio=0.15)"
        )
    if reason := why_no_drag(task.scenario):
        raise InvalidInputError(f"scenario: {reason}")
    drag, kept = chosen_drag(task, task.drag_effect)
    mass, distance = float(task.scenario.admittance.mass), float(task.scenario.distance)
    return predict_drag(task.sensor, distance, mass, drag, largest_speed=kept, task=task)
