"""The virtual drag, F = -phi |s'| s' with s = ln xi, during approaches only."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from .damping import Push
from .driving import DriveState
from .sensing import Observation

_ANY_CHANGE = 1500.0


class DragState(NamedTuple):
    """Smoothed level and rate of ln xi, the mark that the level has to exceed, and the rest of the hold time [s]."""

    level: float
    rate: float
    mark: float
    hold: float


def drag(n: Any, state: DragState, seen: Observation, driven: DriveState) -> tuple[DragState, Push]:
    """Return phi times rate and rise of ln xi, and the force that cancels the pull of the admittance."""
    x, v = driven.motion
    rise = fast = 0.0
    level, rate, mark, hold = state
    if seen.usable:
        sigma = math.sqrt(n.variance + n.relative_variance * seen.level * seen.level) / seen.level
        width, still = n.width * sigma, n.still * sigma
        before = 0.0 if seen.restarted else rate
        expected = seen.log_level if seen.restarted else level + before * seen.elapsed
        missed = seen.log_level - expected
        level = expected + n.level_share * missed
        largest = _ANY_CHANGE / n.sensor_period
        rate = before + n.rate_share * missed / max(seen.elapsed, n.sensor_period)
        rate = max(min(rate, largest), -largest)
        mark = level + width if seen.restarted else mark
        rise = max(level - mark, 0.0) if seen.detecting else 0.0
        mark = min(max(mark, level), level + width)
        fast = math.sqrt((rate - still) * (rate + still)) if rate > still else 0.0
    hold = n.hold if rise > 0.0 else hold
    approaching = seen.detecting and hold > 0.0
    own = max(n.own_advance * rise, -n.mass * v) if v > 0.0 else 0.0
    later = n.period / 2
    pull = n.stiffness * (x + later * v) + n.damping * (v + later * driven.delivery.force / n.mass)
    force = (min(pull, 0.0) if v <= 0.0 else 0.0) + n.mass * n.known_acceleration if approaching else 0.0
    left = max(hold - n.period, 0.0) if approaching else 0.0
    return DragState(level, rate, mark, left), Push(own - n.drag * fast * rise, force)
