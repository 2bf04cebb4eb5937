"""Test whether a stronger gain provably delays contact, and whether contact is impossible."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion import ContactState, Scenario
from pretouch.motion.curve import LARGEST_START, farthest
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

from .objectives import Objective

_PROBES: Final = 257


def touches_later(scenario: Scenario, sensor: SensorModel) -> BoolArray:
    """Return True for encounters in which a stronger gain provably delays contact.

    The proof is in docs/developers/fast-designs.md.
    """
    falling = sensor.valid_range[0] <= 0 and falls(sensor, farthest(scenario, sensor))
    return np.asarray(premises_hold(scenario) & falling)


def never_touches(scenario: Scenario, sensor: SensorModel) -> BoolArray:
    """Return True for encounters without contact at any mitigating gain.

    The result is proved; False means that there is no proof. The proof is in docs/developers/fast-designs.md.
    """
    start, end = farthest(scenario, sensor), min(sensor.valid_range[1], LARGEST_START)
    falling = sensor.valid_range[0] <= 0 and falls(sensor, start) and falls(sensor, end)
    in_range = np.asarray(scenario.distance) <= end  # else solving raises an error
    return np.asarray(premises_hold(scenario, receding=True) & falling & in_range)


def premises_hold(scenario: Scenario, *, receding: bool = False) -> BoolArray:
    """Return True for encounters in which a stronger gain delays contact.

    With `receding`, return True for encounters in which the distance never falls. The sensor output must fall with the
    distance in both cases. The premise that ln xi falls with the distance is tested by `falls`.
    """
    if scenario.obstacle.course:
        return np.zeros(scenario.shape, dtype=bool)
    m, d, k, x0, u0, _, v, a, _, _ = map(np.asarray, scenario.relative_columns())
    room = d * d - 4.0 * m * k
    sigma = 0.5 * (d - np.sqrt(np.maximum(room, 0.0)))
    moves = (v >= 0) & (a >= 0) & (u0 <= v) if receding else (v < 0) & (a <= 0) & (u0 > v)
    sign = 1.0 if receding else -1.0
    holds = (room >= 0) & moves & (sign * (d * v + k * x0) >= sign * sigma * (v - u0))
    return np.asarray(np.broadcast_to(holds, scenario.shape))


def least_objective(objective: Objective, state: ContactState, obstacle_speed: Any) -> FloatArray:
    """Return a lower bound of the objective for stronger gains.

    It follows from the contact with one gain. The bound is the part of the objective that can only grow with time;
    obstacle_speed is |x_o'| at the start [m/s].
    """
    total = np.zeros(np.shape(state.time))
    if type(objective) is not Objective:
        return total
    for term in objective.terms:
        if term.quantity not in {"time", "displacement"}:
            continue
        value = getattr(state, term.quantity)
        growing = value if term.quantity == "time" else np.minimum(value, 0.0)
        total = total + term.weight * (growing / term.scale_for(obstacle_speed)) ** 2
    return np.asarray(total)


@cache_by_curve(256)
def falls(sensor: SensorModel, reach: float) -> bool:
    """Return True if the sensor output falls with the distance.

    The distances are between contact and `reach` [m].
    """
    return bool((np.asarray(sensor.log_slope(np.linspace(0.0, reach, _PROBES))) < 0).all())
