"""The motion of one run on the sampled loop, as the panels of the motion draw it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.motion import ContactResult, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop

__all__ = ["LoopMotion", "loop_motion"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMotion:
    """One run until contact, a sample per step of the law; each array has the shape (n,).

    Args:
        time: t [s].
        distance: l [m].
        position: x of the plant [m].
        relative_velocity: l' [m/s].
        virtual_force: F_p [N].
        result: how it ended.
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray
    relative_velocity: FloatArray
    virtual_force: FloatArray
    result: ContactResult


def loop_motion(
    loop: ClosedLoop, scenario: Scenario, sensor: SensorModel, gain: float, *, horizon: float
) -> LoopMotion:
    """Run an encounter on a loop, with the noise of its first run.

    Args:
        loop: the loop.
        scenario: the encounter.
        sensor: the sensor curve.
        gain: D_p [N s].
        horizon: up to when the motion is kept [s], where it does not end in contact.

    Returns:
        The motion, with the instant of contact as its last sample.
    """
    result = loop(scenario, sensor, gain)
    trace = replace(loop, contact=None).run(scenario, sensor, gain).trace()
    end = result.end
    last = float(end.time) if result.reached.all() else min(horizon, float(end.time))
    kept = trace.time < last
    obstacle = scenario.obstacle
    closing = obstacle.velocity + obstacle.acceleration * trace.time - trace.velocity
    columns = {
        "time": (trace.time, end.time),
        "distance": (trace.distance, end.distance),
        "position": (trace.position, end.position),
        "relative_velocity": (closing, end.relative_velocity),
        "virtual_force": (trace.virtual_force, end.virtual_force),
    }
    whole = last == end.time
    joined = {name: np.append(values[kept], at) if whole else values[kept] for name, (values, at) in columns.items()}
    return LoopMotion(**joined, result=result)
