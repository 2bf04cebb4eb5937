"""Solve an encounter: choose the way, run it, and hand the result over with its certificate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .contact import ContactResult
from .guaranteed import trace_guaranteed
from .layout import TRACE_COLUMNS
from .request import Request, make_request
from .scenario import Scenario
from .solution import Solution

__all__ = ["Motion", "find_contact", "solve_motion"]

_HORIZON: Final = 600.0


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Motion(Value):
    """A motion sampled from the entry into the detection range to its end: arrays with time as their last axis.

    Args:
        time: t [s], equally spaced.
        distance: l [m].
        position: x of the plant [m], absolute.
        velocity: x' of the plant [m/s].
        acceleration: x'' of the plant [m/s^2].
        displacement: x - x_d [m].
        relative_velocity: l' [m/s].
        virtual_force: F_p [N].
        result: how the encounter ended.
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    displacement: FloatArray
    relative_velocity: FloatArray
    virtual_force: FloatArray
    result: ContactResult

    def __repr__(self) -> str:
        many = "" if self.time.ndim == 1 else f"{int(np.prod(self.time.shape[:-1]))} motions, "
        return f"<Motion: {many}{self.time.shape[-1]} samples to {float(self.time.max()):.4g} s>"


def find_contact(
    scenario: Scenario,
    sensor: SensorModel,
    gain: ArrayLike,
    *,
    method: str = "auto",
    horizon: float = _HORIZON,
) -> ContactResult:
    """Find the first contact of an encounter, l = 0 of L(21) and L(23), and what it demands of the robot until then.

    The motion is that of L(1) with L(2), or by request the uniform motion L(16)-(19). A distance that comes to zero and
    turns there, within 1e-12 of its terms, is a contact with l' = 0; one that only decays to zero never is one.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve; its scale is of no consequence.
        gain: D_p [N s], broadcast with the scenario; negative gains mitigate.
        method: "closed-form" (L(10), for a constant slope only), "integration" (any curve), "uniform-motion"
            (L(16)-(19), one particular motion of the second-order exponential curve that does not start from the
            given state: it shifts an optimal gain by about 10 %), or "auto": closed form where the slope is
            constant, integration elsewhere.
        horizon: how long to wait for contact [s].

    Returns:
        Status and state at the end of each run, of the broadcast shape.

    Valid for:
        A plant that follows the virtual object exactly and a sensor without delay (the letter's Section II).

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = ExponentialFirstOrder(scale=0.458, rate=-61.0)
        >>> round(find_contact(scenario, sensor, -1.0).contact.position, 4)
        -0.1353
    """
    request = make_request(scenario, sensor, gain, method, horizon)
    return ContactResult(Solution(request), request.method)


def solve_motion(
    scenario: Scenario,
    sensor: SensorModel,
    gain: ArrayLike,
    *,
    method: str = "auto",
    horizon: float = _HORIZON,
    samples: int = 200,
) -> Motion:
    """Solve an encounter and sample its whole motion, L(1) with L(2).

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve.
        gain: D_p [N s], broadcast with the scenario.
        method: as in `find_contact`.
        horizon: how long to wait for contact [s].
        samples: how many instants, from 0 to the end of each run, ends included; at least 2.

    Returns:
        The motion; its arrays have the broadcast shape with the samples as a last axis.

    Raises:
        InvalidInputError: there are too few samples.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> motion = solve_motion(scenario, sensor, -0.7)
        >>> round(float(motion.position[-1]), 4)
        -0.0915
    """
    if samples < 2:
        raise InvalidInputError(f"samples: found {samples}, which must be at least 2")
    request = make_request(scenario, sensor, gain, method, horizon)
    result = ContactResult(Solution(request, whole=True), request.method)
    end = np.atleast_1d(np.asarray(result.end.time)).ravel()
    times = end[:, None] * np.linspace(0.0, 1.0, samples)
    times[:, -1] = end
    trace = np.empty((len(end), samples, len(TRACE_COLUMNS)))
    trace_guaranteed(request, times, trace)
    trace[:, -1, 0] = np.ravel(result.end.distance)
    return _motion(request, times, trace, result)


def _motion(request: Request, times: FloatArray, trace: FloatArray, result: ContactResult) -> Motion:
    """Return the trace as a motion, with the virtual force by L(2)."""
    shape, each, reference = (*request.shape, times.shape[-1]), request.relative, request.scenario.reference
    p, v, a = (x[:, None] for x in (each.p, each.v, each.a))
    distance, _, speed, acceleration = (trace[..., i] for i in range(len(TRACE_COLUMNS)))
    displacement, relative_velocity = p + (v + a * times / 2) * times - distance, v + a * times - speed
    with np.errstate(all="ignore"):  # a function of the user's may overflow where the object has gone far away
        slope = np.asarray(request.sensor.log_slope(np.clip(distance, *request.sensor.valid_range)))
    moment, force = times.reshape(shape), each.gain[:, None] * slope * relative_velocity
    x, u, w = (
        np.expand_dims(np.asarray(r), -1) for r in (reference.position, reference.velocity, reference.acceleration)
    )
    return Motion(
        time=moment,
        distance=distance.reshape(shape),
        position=displacement.reshape(shape) + x + (u + w * moment / 2) * moment,
        velocity=speed.reshape(shape) + u + w * moment,
        acceleration=acceleration.reshape(shape) + w,
        displacement=displacement.reshape(shape),
        relative_velocity=relative_velocity.reshape(shape),
        virtual_force=force.reshape(shape),
        result=result,
    )
