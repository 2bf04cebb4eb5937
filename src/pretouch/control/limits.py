"""Limits on the motion relative to the reference that can be held together, whatever force acts.

A speed is allowed only if the plant can come to rest from it within the excursion at the largest deceleration. In
periods of constant acceleration the way to rest is piecewise linear in the speed, so the largest speed that is
allowed next follows in closed form, and a state that can be stopped in time has a next state that can, too.
The admittance goes on from the motion that was limited: nothing winds up behind the limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import positive

from .structures import MotionLimits

__all__ = ["NO_LIMIT", "Limits", "stopping_distance"]

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


def stopping_distance(limits: MotionLimits, speed: float) -> float:
    """Return the way to rest [m] from a speed >= 0, in whole periods of constant acceleration within the limit.

    Full periods brake with the largest deceleration, the last with what is left.
    """
    n = limits
    step = n.acceleration * n.period
    whole = math.floor(speed / step)
    rest = speed - whole * step
    return float(n.period * (step / 2 * whole * whole + rest * (whole + 0.5)))
