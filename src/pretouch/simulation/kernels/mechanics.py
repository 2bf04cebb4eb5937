"""Contact forces, and one step of plant and obstacle: the classical Runge-Kutta method of order 4."""

from __future__ import annotations

import math
from typing import Any

__all__ = [
    "advance",
    "contact_force",
    "contact_step",
    "elastic_duration",
    "first_touch",
    "hermite",
    "hermite_slope",
    "resolution",
]

_RESOLUTION = 1e-12
"""How close to zero a smallest distance is taken for zero, of the terms that l is the difference of, as in motion."""


def contact_force(contact: Any, depth: float, rate: float) -> float:
    """Return the force between the bodies [N], never below 0: they do not stick. At the touch itself damping acts."""
    stiffness, damping, exponent, scaled = contact[0], contact[1], contact[2], contact[3]
    if depth < 0.0:
        return 0.0
    grown = depth if exponent == 1.0 else depth * math.sqrt(depth) if exponent == 1.5 else depth**exponent
    force = stiffness * grown + damping * rate * (grown if scaled else 1.0)
    return max(force, 0.0)


def contact_step(contact: Any, inverse_mass: float, speed: float) -> float:
    """Return a step [s] that resolves a contact that starts with a relative speed: 1/50 of its time scale."""
    stiffness, damping, exponent, scaled = contact[0], contact[1], contact[2], contact[3]
    reduced = 1.0 / inverse_mass
    depth = ((exponent + 1.0) * 0.5 * reduced * speed * speed / stiffness) ** (1.0 / (exponent + 1.0))
    if depth <= 0.0:
        return 1e-3
    omega = math.sqrt(exponent * stiffness * depth ** (exponent - 1.0) * inverse_mass)
    loss = damping * (depth**exponent if scaled else 1.0) * inverse_mass
    return 0.02 / max(omega, loss)


def elastic_duration(contact: Any, inverse_mass: float, speed: float) -> float:
    """Return how long the bodies would touch [s], from a relative speed on, without loss and drive: m d'' = -k d^n."""
    stiffness, exponent = contact[0], contact[2]
    part = 1.0 / (exponent + 1.0)
    scale = (0.5 * (exponent + 1.0) / (stiffness * inverse_mass)) ** part  # depth / speed, where the speed is 1
    # to the deepest point and back: the integral of (1 - s^(n + 1))^(-1/2) from 0 to 1, which is pi / 2 for n = 1
    course = math.sqrt(math.pi) * math.gamma(1.0 + part) / math.gamma(0.5 + part)
    return 2.0 * course * scale * max(speed, 1e-9) ** ((1.0 - exponent) * part)


def hermite(start: float, start_slope: float, end: float, end_slope: float, s: float) -> float:
    """Return the cubic through both ends at the part s of the step; slopes are those over the whole step."""
    rise = end - start
    return start + s * (
        start_slope + s * (3.0 * rise - 2.0 * start_slope - end_slope + s * (start_slope + end_slope - 2.0 * rise))
    )


def hermite_slope(start: float, start_slope: float, end: float, end_slope: float, s: float) -> float:
    """Return the slope of the cubic through both ends at the part s of the step, over the whole step."""
    rise = end - start
    second, third = 3.0 * rise - 2.0 * start_slope - end_slope, start_slope + end_slope - 2.0 * rise
    return start_slope + s * (2.0 * second + s * 3.0 * third)


def resolution(start: float, obstacle: Any, position: float, t: float) -> float:
    """Return the distance [m] at a time that is not told from zero; obstacle: x_o, x_o' and x_o'' at the start."""
    way = (abs(obstacle[1]) + 0.5 * abs(obstacle[2]) * t) * t
    return _RESOLUTION * (abs(start) + abs(position) + abs(obstacle[0]) + way)


def first_touch(start: float, start_slope: float, end: float, end_slope: float, doubt: float) -> Any:
    """Find where the cubic through both ends of a step first comes to zero, and the least that it comes to.

    Between its turning points the cubic rises or falls, so that none of its zeros is missed, however short the dip. A
    smallest distance closer to zero than `doubt`, on either side, is a touch, there; one that the cubic only rises
    from, as after a contact, is none.

    Args:
        start: distance at the start of the step [m].
        start_slope: its slope there over the whole step [m].
        end: distance at the end [m].
        end_slope: its slope there over the whole step [m].
        doubt: the distance that is not told from zero [m].

    Returns:
        The part of the step at which it touches, 2 where it does not; the least distance up to the end [m].
    """
    lowest = min(start, end)
    if end > doubt and min(start + start_slope / 3.0, end - end_slope / 3.0) >= lowest:  # Bernstein: not below its ends
        return 2.0, lowest
    rise = end - start
    second, third = 3.0 * rise - 2.0 * start_slope - end_slope, start_slope + end_slope - 2.0 * rise
    root = second * second - 3.0 * third * start_slope
    near, far = 1.0, 1.0
    if root > 0.0:
        q = -second - math.copysign(math.sqrt(root), second)
        one = start_slope / q if abs(start_slope) < abs(q) else 1.0
        other = q / (3.0 * third) if abs(q) < abs(3.0 * third) else 1.0
        one, other = one if one > 0.0 else 1.0, other if other > 0.0 else 1.0
        near, far = min(one, other), max(one, other)
    left, before = 0.0, start
    for right in (near, far, 1.0):
        value = hermite(start, start_slope, end, end_slope, right)
        lowest = min(lowest, value)
        if value < before and value <= doubt:
            if right < 1.0 and value >= -doubt:
                return right, lowest
            return _zero(start, start_slope, end, end_slope, left, right), lowest
        left, before = right, value
    return 2.0, lowest


def _zero(start: float, start_slope: float, end: float, end_slope: float, low: float, high: float) -> float:
    """Return where the cubic, which falls from low to high, comes to zero: by bisection."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        if hermite(start, start_slope, end, end_slope, middle) > 0.0:
            low = middle
        else:
            high = middle
    return high


def _slopes(state: Any, at: float, target: Any, plant: Any, contact: Any, push: float) -> Any:
    """Derivatives of position, velocity, servo force, obstacle position, obstacle velocity and impulse."""
    x, v, f, x_o, v_o, _ = state
    mass, stiffness, reference_damping, own_damping, ahead, servo, coulomb, friction_speed = plant
    period, x_0, v_0, x_1, v_1, a_v = target
    s, rise = at / period, x_1 - x_0
    x_v = hermite(x_0, v_0 * period, x_1, v_1 * period, s)
    v_v = v_0 + s * (6.0 * rise / period - 4.0 * v_0 - 2.0 * v_1 + s * (3.0 * (v_0 + v_1) - 6.0 * rise / period))
    command = stiffness * (x_v - x) + reference_damping * v_v - own_damping * v + ahead * a_v
    drive, change = (f, servo * (command - f)) if servo > 0.0 else (command, 0.0)
    force = contact_force(contact, x - x_o, v - v_o)
    friction = coulomb * math.tanh(v / friction_speed) if coulomb > 0.0 else 0.0
    return v, (drive - friction - force) / mass, change, v_o, push + force * contact[4], force


def _along(state: Any, slopes: Any, h: float) -> Any:
    return (
        state[0] + h * slopes[0],
        state[1] + h * slopes[1],
        state[2] + h * slopes[2],
        state[3] + h * slopes[3],
        state[4] + h * slopes[4],
        state[5] + h * slopes[5],
    )


def advance(state: Any, at: float, h: float, target: Any, plant: Any, contact: Any, push: float) -> Any:
    """Advance plant and obstacle by h [s] within a controller period, from the time `at` in it."""
    k1 = _slopes(state, at, target, plant, contact, push)
    k2 = _slopes(_along(state, k1, 0.5 * h), at + 0.5 * h, target, plant, contact, push)
    k3 = _slopes(_along(state, k2, 0.5 * h), at + 0.5 * h, target, plant, contact, push)
    k4 = _slopes(_along(state, k3, h), at + h, target, plant, contact, push)
    return (
        state[0] + h / 6.0 * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]),
        state[1] + h / 6.0 * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]),
        state[2] + h / 6.0 * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2]),
        state[3] + h / 6.0 * (k1[3] + 2.0 * (k2[3] + k3[3]) + k4[3]),
        state[4] + h / 6.0 * (k1[4] + 2.0 * (k2[4] + k3[4]) + k4[4]),
        state[5] + h / 6.0 * (k1[5] + 2.0 * (k2[5] + k3[5]) + k4[5]),
    )
