"""L(1) over one period, and limits of the motion that hold together."""

from __future__ import annotations

import math
import sys
from typing import Any


def advance_admittance(numbers: Any, position: float, velocity: float, force: float) -> tuple[float, float]:
    """Return x~ and x~' of L(1) one period later, the force F [N] being constant over it."""
    n = numbers
    return (
        n.position_from_position * position + n.position_from_velocity * velocity + n.position_from_force * force,
        n.velocity_from_position * position + n.velocity_from_velocity * velocity + n.velocity_from_force * force,
    )


def stopping_distance(limits: Any, speed: float) -> float:
    """Return the stopping distance [m] from a speed >= 0, braking in whole periods of constant deceleration.

    Full periods brake with the largest deceleration, the last with what is left.
    """
    n = limits
    step = n.acceleration * n.period
    whole = math.floor(speed / step)
    rest = speed - whole * step
    return n.period * (step / 2 * whole * whole + rest * (whole + 0.5))


def limit_motion(
    limits: Any, position: float, velocity: float, wanted_position: float, wanted_velocity: float
) -> tuple[float, float, bool]:
    """Limit the motion that the admittance requests.

    Args:
        limits: period and limits.
        position: x~ at the start of the period [m], from which the plant can be stopped in time.
        velocity: x~' there [m/s].
        wanted_position: x~ at its end, by the admittance.
        wanted_velocity: x~' at its end, by the admittance.

    Returns:
        x~ and x~' at the end, from which the plant can be stopped again, and whether a limit acted.
    """
    n = limits
    step = n.acceleration * n.period
    # so much smaller that the acceleration is within its limit also after rounding
    change = max(step - 2 * sys.float_info.epsilon * (abs(velocity) + step), 0.0)
    low, high = max(-n.speed, velocity - change), min(n.speed, velocity + change)
    moved, drifted = wanted_position - position, velocity * n.period
    # a stiff admittance can leave the limits and be back within a period: then the position tells
    steady = abs(moved) <= n.speed * n.period and abs(moved - drifted) <= step * n.period / 2
    if steady and low <= wanted_velocity <= high:
        way = stopping_distance(n, abs(wanted_velocity))
        ahead = wanted_position if wanted_velocity >= 0 else -wanted_position
        if abs(wanted_position) <= n.excursion and ahead + way <= n.excursion:
            return wanted_position, wanted_velocity, False
    high = min(high, _fastest(n, n.excursion - position - drifted / 2))
    low = max(low, -_fastest(n, n.excursion + position + drifted / 2))
    allowed = max(min(wanted_velocity, high), low)
    reached = position + drifted / 2 + n.period * allowed / 2
    return max(min(reached, n.excursion), -n.excursion), allowed, True


def _fastest(limits: Any, room: float) -> float:
    """Return the largest speed v with T v / 2 + (stopping distance from v) <= room."""
    n = limits
    step = n.acceleration * n.period
    left = max(room, 0.0)
    whole = math.floor((math.sqrt(1.0 + 8.0 * left / (step * n.period)) - 1.0) / 2)
    return step * whole + (left - step * n.period / 2 * whole * (whole + 1)) / (n.period * (whole + 1))
