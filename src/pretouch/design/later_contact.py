"""Test for which encounters a stronger gain provably delays contact."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion import ContactState, Scenario
from pretouch.motion.curve import farthest
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

from .objectives import Objective

_PROBES: Final = 257


def touches_later(scenario: Scenario, sensor: SensorModel) -> BoolArray:
    """Return for which encounters contact provably occurs later with a stronger gain."""
    # The proof is in docs/developers/fast-designs.md.
    falling = sensor.valid_range[0] <= 0 and falls(sensor, farthest(scenario, sensor))
    return np.asarray(premises_hold(scenario) & falling)


def premises_hold(scenario: Scenario) -> BoolArray:
    """Return for which encounters a stronger gain delays contact.

    The sensor output must fall with the distance.
    """
    # The premise that ln xi falls with the distance is tested by `falls`.
    if scenario.obstacle.course:
        return np.zeros(scenario.shape, dtype=bool)
    m, d, k, x0, u0, _, v, a, _, _ = scenario.relative_columns()
    room = np.asarray(d) * d - 4.0 * np.asarray(m) * k
    sigma = 0.5 * (d - np.sqrt(np.maximum(room, 0.0)))
    holds = (room >= 0) & (v < 0) & (np.asarray(a) <= 0) & (np.asarray(u0) > v) & (-d * v - k * x0 >= sigma * (u0 - v))
    return np.asarray(np.broadcast_to(holds, scenario.shape))


def least_objective(objective: Objective, state: ContactState, obstacle_speed: Any) -> FloatArray:
    """Return a lower bound of the objective for stronger gains.

    It follows from the contact with one gain.
    """
    # The bound is the part of the objective that can only grow with time; obstacle_speed is |x_o'| at the start [m/s].
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
