"""What is known at contact beside time and l', and how it changes when these two do: algebra, no motion."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from pretouch._core.numbers import FloatArray

from .solution import Solution

__all__ = ["DERIVATIVES", "Change"]


class Change(NamedTuple):
    """How one input changes a contact.

    Args:
        time: dt/dq of each run.
        speed: dl'/dq.
        inputs: by how much the relative inputs of L(9) change with it, by their names.
        slope: dg(0)/dq.
    """

    time: FloatArray
    speed: FloatArray
    inputs: dict[str, float]
    slope: float


def _obstacle_velocity(s: Solution) -> Any:
    """Return the velocity of the obstacle relative to the reference at contact."""
    return s.request.relative.v + s.request.relative.a * s.raw("time")


def _displacement(s: Solution, _: str, c: Change) -> Any:
    """Differentiate x~ = x_o(t)."""
    time, i = s.raw("time"), c.inputs
    own = i.get("p", 0.0) + (i.get("v", 0.0) + i.get("a", 0.0) * time / 2) * time
    return _obstacle_velocity(s) * c.time + own


def _displacement_velocity(s: Solution, c: Change) -> Any:
    """Differentiate x~' = x_o' - l'."""
    own = c.inputs.get("v", 0.0) + c.inputs.get("a", 0.0) * s.raw("time")
    return own + s.request.relative.a * c.time - c.speed


def _virtual_force(s: Solution, _: str, c: Change) -> Any:
    """Differentiate D_p g(0) l'."""
    slope, gain, speed = float(s.request.sensor.log_slope(0.0)), s.request.relative.gain, s.raw("relative_velocity")
    return slope * (gain * c.speed + c.inputs.get("gain", 0.0) * speed) + c.slope * (gain * speed)


def _displacement_acceleration(s: Solution, by: str, c: Change) -> Any:
    """Differentiate x~'' = (F_p - D x~' - K x~) / M."""
    r = s.request.relative
    total = _virtual_force(s, by, c) - r.damping * _displacement_velocity(s, c) - r.stiffness * _displacement(s, by, c)
    own = {"mass": "displacement_acceleration", "damping": "displacement_velocity", "stiffness": "displacement"}
    for name, quantity in own.items():
        if name in c.inputs:
            total = total - (s.settled_acceleration if name == "mass" else s.raw(quantity))
    return total / r.mass


def _position(s: Solution, by: str, c: Change) -> Any:
    time = s.raw("time")
    own = {"reference.position": 1.0, "reference.velocity": time, "reference.acceleration": time**2 / 2}
    return _displacement(s, by, c) + s.reference(1) * c.time + own.get(by, 0.0)


def _velocity(s: Solution, by: str, c: Change) -> Any:
    own = {"reference.velocity": 1.0, "reference.acceleration": s.raw("time")}
    return _displacement_velocity(s, c) + s.reference(2) * c.time + own.get(by, 0.0)


def _acceleration(s: Solution, by: str, c: Change) -> Any:
    return _displacement_acceleration(s, by, c) + (1.0 if by == "reference.acceleration" else 0.0)


DERIVATIVES: Final[dict[str, Any]] = {
    "time": lambda _, __, c: c.time,
    "relative_velocity": lambda _, __, c: c.speed,
    "displacement": _displacement,
    "virtual_force": _virtual_force,
    "position": _position,
    "velocity": _velocity,
    "acceleration": _acceleration,
}
"""By quantity: its derivative from a solution, the name of an input, and how that changes the contact."""
