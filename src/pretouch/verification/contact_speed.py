"""Say how fast the contacts of simulated runs are, and which of two contacts is harder."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.simulation import SimulationResult

UNSEEN: Final = 5e-5  # relative: a smaller difference does not show in four digits


def contact_speeds(result: SimulationResult) -> FloatArray:
    """Return the speed at contact of each run, 0 without contact [m/s]."""
    return np.where(result.touched, np.abs(result.relative_velocity), 0.0)


def is_harder(run: SimulationResult, free: SimulationResult) -> bool:
    """Return True if contact in one run is harder with the gain than without mitigation."""
    return bool(contact_speeds(run) > contact_speeds(free) * (1 + UNSEEN))


def percent(share: float) -> str:
    """Return the magnitude of a relative change as a percentage.

    Below 100 %, the text has two digits.
    """
    size = abs(100 * share)
    return f"{size:.0f} %" if size >= 99.5 else f"{size:.2g} %"


def higher_in_words(excess: float, other: str = "") -> str:
    """Return a relative change of a speed in words.

    Examples:
        >>> higher_in_words(0.12, "predicted"), higher_in_words(5.39, "predicted"), higher_in_words(-0.22)
        ('12 % higher than predicted', '6.4 times as high as predicted', '22 % lower')
    """
    if excess >= 1:
        times = 1 + excess
        text, link = f"{times:.0f}" if times >= 99.5 else f"{times:.2g}", "as"
        text = f"{text} times as high"
    else:
        text, link = f"{percent(excess)} {'higher' if excess > 0 else 'lower'}", "than"
    return f"{text} {link} {other}" if other else text
