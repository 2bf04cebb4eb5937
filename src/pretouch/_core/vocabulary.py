"""Name, symbol and SI unit of every quantity that results report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Entry:
    """Name, symbol and SI unit of a quantity that results report.

    Args:
        words: its name in words.
        symbol: the letter's symbol.
        unit: its SI unit.
        whole: whether it depends on the whole motion, not only on its end.
    """

    words: str
    symbol: str
    unit: str
    whole: bool = False


QUANTITIES: Final[dict[str, Entry]] = {
    "time": Entry("time of contact", "t", "s"),
    "distance": Entry("distance at contact", "l", "m"),
    "position": Entry("plant position at contact", "x", "m"),
    "velocity": Entry("plant velocity at contact", "x\u2032", "m/s"),
    "acceleration": Entry("plant acceleration at contact", "x\u2033", "m/s^2"),
    "displacement": Entry("deviation from the reference at contact", "x \u2212 x_d", "m"),
    "relative_velocity": Entry("relative velocity at contact", "l\u2032", "m/s"),
    "virtual_force": Entry("virtual force at contact", "F_p", "N"),
    "largest_excursion": Entry("largest excursion", "max |x \u2212 x_d|", "m", whole=True),
    "largest_travel": Entry("largest travel from the start", "max |x \u2212 x(0)|", "m", whole=True),
    "largest_speed": Entry("largest plant speed", "max |x\u2032|", "m/s", whole=True),
    "largest_acceleration": Entry("largest plant acceleration", "max |x\u2033|", "m/s^2", whole=True),
    "largest_virtual_force": Entry("largest virtual force", "max |F_p|", "N", whole=True),
    "closest_distance": Entry("smallest distance", "min l", "m", whole=True),
    "settling_distance": Entry("settling distance", "l(\u221e)", "m", whole=True),
    "impulse_residual": Entry("residual of the impulse balance", "", "", whole=True),
    "drive_force": Entry("largest drive force", "m max |x\u2033|", "N", whole=True),
    "impact_force": Entry("peak impact force", "F", "N"),
    "peak_force": Entry("peak contact force", "max F", "N", whole=True),
    "impulse": Entry("impulse of all contacts", "\u222bF dt", "N*s", whole=True),
    "rebound_velocity": Entry("relative velocity after impact", "l\u2032", "m/s"),
    "gain": Entry("gain", "D_p", "N*s"),
    "objective": Entry("objective", "f", ""),
}
"""Every quantity of results, objectives, limits and sweeps, by its name in code."""


def words_for(name: str) -> str:
    """Return the name of a quantity in words, such as `relative velocity at contact`.

    Args:
        name: such as `relative_velocity`.

    Returns:
        Words such as `relative velocity at contact`.

    Examples:
        >>> words_for("largest_excursion"), words_for("natural_frequency")
        ('largest excursion', 'natural frequency')
    """
    return QUANTITIES[name].words if name in QUANTITIES else name.replace("_", " ").replace("-", " ")


def in_short(name: str) -> str:
    """Return the name of a quantity in words without "at contact", such as `relative velocity`."""
    return words_for(name).removesuffix(" at contact")


def unit_of(name: str) -> str:
    """Return the SI unit of a quantity, given its name in code."""
    return QUANTITIES[name].unit
