"""The design of the virtual drag: one number, by the ratio of the speeds or by a limit on what it comes to.

Nothing is searched for an optimum: ratio and excursion trade off along one curve, and each limit picks one point of it.
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

from ..constraints import ImpactModel
from ..task import Task, placed
from .limits import DragEffect
from .result import DragDesign, predict_drag


def drag_by(
    sensor: SensorModel, distance: float, mass: float, *, impact: ImpactModel | None = None, **effect: Any
) -> DragDesign:
    """Choose the virtual drag by exactly one of its effects, without a task.

    Args:
        sensor: the sensor curve, which holds down to contact.
        distance: l_d [m], from which on the object is seen.
        mass: M of the virtual object [kg].
        impact: what the force follows the contact speed by; with `impact_force`.
        effect: the fields of a `DragEffect`.

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
    """Return the curve along which ratio and excursion trade off, one design with arrays.

    Args:
        sensor: the sensor curve, which holds down to contact.
        distance: l_d [m].
        mass: M of the virtual object [kg].
        ratios: rho of its points; 99 from 0.99 to 0.01 by default.

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
    """Say why the theory of the drag does not speak of an encounter; the empty text where it does."""
    plant, reference = scenario.plant, scenario.reference
    if scenario.shape:
        return "found an array of encounters, expected one"
    if scenario.obstacle.course:
        return "found an obstacle with a course, of which the prediction of a drag knows nothing: leave it to the loop"
    if (plant.position, plant.velocity) != (reference.position, reference.velocity):
        return "found a plant that does not rest at its reference, which a drag is designed for"
    if not scenario.relative_velocity < 0:
        return "found an obstacle that does not approach, expected a negative velocity"
    return ""


def chosen_drag(task: Task, effect: DragEffect) -> tuple[float, float]:
    """Return the drag of a task by its effect [N s^2], and up to which speed that is kept [m/s]."""
    speed = effect.largest_speed or -float(task.scenario.relative_velocity)
    mass, distance = float(task.scenario.admittance.mass), float(task.scenario.distance)
    drag, kept = replace(effect, largest_speed=speed).drag(task.sensor, distance, mass, task.impact)
    return float(drag), kept


@check_arguments
@placed
def design_drag(task: Task) -> DragDesign:
    """Choose the virtual drag of a task by its effect, which needs no search: it is the same at every speed.

    Args:
        task: the encounter, from whose distance on the object is seen, the sensor, and `effect`; where the effect has
            no largest speed, that of the encounter. With an objective the page shows the letter's optimum beside it.

    Returns:
        The design, with its task.

    Raises:
        InvalidInputError: there is no effect, or the drag has no prediction for such an encounter.

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
        ...         effect=DragEffect(ratio=0.15),
        ...     )
        ... )
        >>> round(design.drag, 6), round(design.result.contact.relative_velocity, 6)
        (0.014372, -0.045)
    """
    if task.effect is None:
        raise InvalidInputError(
            "effect: found none, expected what the drag is chosen by, such as DragEffect(ratio=0.15)"
        )
    if reason := why_no_drag(task.scenario):
        raise InvalidInputError(f"scenario: {reason}")
    drag, kept = chosen_drag(task, task.effect)
    mass, distance = float(task.scenario.admittance.mass), float(task.scenario.distance)
    return predict_drag(task.sensor, distance, mass, drag, largest_speed=kept, task=task)
