"""Limits on the motion relative to the reference that can be held together, whatever force acts.

A speed is allowed only if the plant can come to rest from it within the excursion at the largest deceleration. In
periods of constant acceleration the way to rest is piecewise linear in the speed, so the largest speed that is
allowed next follows in closed form, and a state that can be stopped in time has a next state that can, too.
The admittance goes on from the motion that was limited: nothing winds up behind the limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import positive

__all__ = ["NO_LIMIT", "Limits", "MotionLimits", "limit_motion", "stopping_distance"]

NO_LIMIT = 1e9
"""In the place of a limit that is not given, in SI units: finite, so that what is within limits is finite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of the virtual force and of the motion relative to the reference; None for those that are not wanted.

    Args:
        force: largest |F_p| [N].
        speed: largest |x_v' - x_d'| [m/s].
        acceleration: largest |x_v'' - x_d''| [m/s^2], as the mean over a period.
        excursion: largest |x_v - x_d| [m].

    Examples:
        >>> Limits(force=20.0, speed=0.5)
        Limits(force=20.0, speed=0.5, acceleration=None, excursion=None)
    """

    force: float | None = None
    speed: float | None = None
    acceleration: float | None = None
    excursion: float | None = None

    def __post_init__(self) -> None:
        for name, unit in (("force", "N"), ("speed", "m/s"), ("acceleration", "m/s^2"), ("excursion", "m")):
            value = getattr(self, name)
            if value is not None:
                checked = positive(value, f"largest {name}", unit)
                if not isinstance(checked, float) or checked > NO_LIMIT:
                    raise InvalidInputError(
                        f"largest {name}: found {value!r}, expected one number up to {NO_LIMIT:g} {unit}; "
                        "leave it out for no limit"
                    )
                object.__setattr__(self, name, checked)


class MotionLimits(NamedTuple):
    """Period, largest speed, acceleration and excursion as numbers, `NO_LIMIT` where there is none."""

    period: float
    speed: float
    acceleration: float
    excursion: float


def stopping_distance(limits: MotionLimits, speed: float) -> float:
    """Return the way to rest [m] from a speed >= 0, in whole periods of constant acceleration within the limit.

    Full periods brake with the largest deceleration, the last with what is left.
    """
    n = limits
    step = n.acceleration * n.period
    whole = math.floor(speed / step)
    rest = speed - whole * step
    return n.period * (step / 2 * whole * whole + rest * (whole + 0.5))


def limit_motion(
    limits: MotionLimits, position: float, velocity: float, wanted_position: float, wanted_velocity: float
) -> tuple[float, float, bool]:
    """Keep what the admittance wants if it is within limits; otherwise go as far as they allow.

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
    low, high = max(-n.speed, velocity - step), min(n.speed, velocity + step)
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


def _fastest(limits: MotionLimits, room: float) -> float:
    """Return the largest speed v with T v / 2 + (way to rest from v) <= room."""
    n = limits
    step = n.acceleration * n.period
    left = max(room, 0.0)
    whole = math.floor((math.sqrt(1.0 + 8.0 * left / (step * n.period)) - 1.0) / 2)
    return step * whole + (left - step * n.period / 2 * whole * (whole + 1)) / (n.period * (whole + 1))
