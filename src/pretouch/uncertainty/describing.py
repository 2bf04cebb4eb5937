"""What is known of inputs, and how often something holds, in words."""

from __future__ import annotations

import math

from pretouch.motion.inputs import input_units
from pretouch.sensors import SensorModel

from .sampling import Uncertainty

__all__ = ["share_in_words", "uncertainty_in_words"]


def share_in_words(share: float) -> str:
    """Write a share in percent, rounded down: a bound from below stays one, and what is not all never reads as 100 %.

    Args:
        share: from 0 to 1.

    Returns:
        Text such as `99.41 %`.

    Examples:
        >>> share_in_words(0.99998), share_in_words(1.0)
        ('99.99 %', '100 %')
    """
    return f"{math.floor(1e4 * share + 1e-9) / 100:g} %"


def uncertainty_in_words(uncertainty: Uncertainty, sensor: SensorModel) -> list[tuple[str, str]]:
    """Say what is known of each uncertain input.

    Args:
        uncertainty: what is known, by the names of inputs.
        sensor: the sensor curve, whose parameters may be among them.

    Returns:
        Name and text of each.
    """
    units = input_units(sensor)
    return [row for name, known in uncertainty.items() for row in known.rows(name, units)]
