"""What is known of inputs, and how often something holds, in words."""

from __future__ import annotations

import math

from pretouch.motion.inputs import input_units
from pretouch.sensors import SensorModel

from .sampling import Uncertainty

__all__ = ["share_in_words", "uncertainty_in_words"]


def share_in_words(share: float) -> str:
    """Write a share from 0 to 1 in percent, rounded down: a bound from below stays one, what is not all is not 100 %.

    Returns:
        Text such as `99.99 %`, also for 0.99998.
    """
    return f"{math.floor(1e4 * share + 1e-9) / 100:g} %"


def uncertainty_in_words(uncertainty: Uncertainty, sensor: SensorModel) -> list[tuple[str, str]]:
    """Say what is known of each uncertain input, those of the sensor among them: name and text."""
    units = input_units(sensor)
    return [row for name, known in uncertainty.items() for row in known.rows(name, units)]
