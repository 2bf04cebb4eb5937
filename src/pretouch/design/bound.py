"""Where stronger gains cannot do better: they touch later, and what grows with the time of contact is then larger."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion import ContactState, Scenario
from pretouch.motion.curve import farthest
from pretouch.sensors import SensorModel
from pretouch.sensors.model import kept_by_curve

from .objectives import Objective

_PROBES: Final = 257


def touches_later(scenario: Scenario, sensor: SensorModel) -> BoolArray:
    """Tell for which encounters a stronger mitigating gain is known to touch later (docs/fast-designs.md)."""
    known = sensor.valid_range[0] <= 0 and falls(sensor, farthest(scenario, sensor))
    return np.asarray(premises_hold(scenario) & known)


def premises_hold(scenario: Scenario) -> BoolArray:
    """Tell for which encounters the premises of the same proof hold, but that ln xi falls with the distance."""
    m, d, k, x0, u0, _, v, a, _, _ = scenario.relative_columns()
    room = np.asarray(d) * d - 4.0 * np.asarray(m) * k
    sigma = 0.5 * (d - np.sqrt(np.maximum(room, 0.0)))
    holds = (room >= 0) & (v < 0) & (np.asarray(a) <= 0) & (np.asarray(u0) > v) & (-d * v - k * x0 >= sigma * (u0 - v))
    return np.asarray(np.broadcast_to(holds, scenario.shape))


def least_objective(objective: Objective, state: ContactState, obstacle_speed: Any) -> FloatArray:
    """Bound an objective of every stronger gain from below where that touches later, given any state at contact."""
    # It is the part that time can only enlarge; obstacle_speed is |x_o'| at the start [m/s].
    total = np.zeros(np.shape(state.time))
    if type(objective) is not Objective:
        return total
    for term in objective.terms:
        if term.quantity not in {"time", "displacement"}:
            continue
        value = getattr(state, term.quantity)
        counts = value if term.quantity == "time" else np.minimum(value, 0.0)
        total = total + term.weight * (counts / term.scale_for(obstacle_speed)) ** 2
    return np.asarray(total)


@kept_by_curve(256)
def falls(sensor: SensorModel, reach: float) -> bool:
    """Tell whether ln xi falls with the distance, from contact to a distance [m]."""
    return bool((np.asarray(sensor.log_slope(np.linspace(0.0, reach, _PROBES))) < 0).all())
