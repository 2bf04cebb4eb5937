"""One call of the solver in its broadcast, flattened form, checked before anything is solved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite, positive
from pretouch.sensors import SensorModel

from .scenario import Scenario

__all__ = ["METHODS", "Request", "make_request"]

METHODS: Final = ("auto", "closed-form", "integration", "uniform-motion")


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """One call of the solver.

    Args:
        scenario: the encounters as they were given.
        sensor: the sensor curve.
        shape: the broadcast shape of scenario and gain.
        values: relative quantities of Scenario.relative, shape (n, 10).
        gain: D_p [N s], shape (n,).
        horizon: how long to wait for contact [s].
        method: the method chosen, never "auto".
    """

    scenario: Scenario
    sensor: SensorModel
    shape: tuple[int, ...]
    values: FloatArray
    gain: FloatArray
    horizon: float
    method: str


def make_request(scenario: Scenario, sensor: SensorModel, gain: ArrayLike, method: str, horizon: float) -> Request:
    """Check a call and flatten it; choose its method where that is left open."""
    if method not in METHODS:
        raise InvalidInputError(f"method: found {method!r}, expected one of {', '.join(METHODS)}")
    if method == "closed-form" and sensor.constant_log_slope is None:
        raise InvalidInputError(
            f"method: the closed form L(10) holds for a constant slope only, not for the {sensor.name} curve; "
            "use method='integration' or 'auto'"
        )
    if method == "auto":
        method = "integration" if sensor.constant_log_slope is None else "closed-form"
    gains = np.asarray(finite(gain, "gain", "N*s"))
    try:
        shape = np.broadcast_shapes(scenario.shape, gains.shape)
    except ValueError:
        raise InvalidInputError(f"gain: shape {gains.shape} does not broadcast with {scenario.shape}") from None
    distance = np.asarray(scenario.distance)
    inside = sensor.contains(distance)
    if not inside.all():
        low, high = sensor.valid_range
        raise InvalidInputError(
            f"obstacle position: found a distance of {float(distance[~inside].flat[0]):g} m at the start, outside the "
            f"{low:g} m to {high:g} m in which the {sensor.name} curve holds: the encounter starts when the object "
            "enters the detection range"
        )
    values = scenario.relative()
    return Request(
        scenario=scenario,
        sensor=sensor,
        shape=shape,
        values=np.ascontiguousarray(np.broadcast_to(values, (*shape, values.shape[-1])).reshape(-1, values.shape[-1])),
        gain=np.ascontiguousarray(np.broadcast_to(gains, shape).ravel()),
        horizon=positive(horizon, "horizon", "s"),
        method=method,
    )
