"""List the quantities in results with names, symbols and SI units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Entry:
    """Name, symbol and SI unit of a quantity in results.

    Args:
        words: name of the quantity in words.
        symbol: the letter's symbol.
        unit: SI unit.
        whole: whether the quantity depends on the whole motion, not only on the state at contact.
        limit: short name of the constraint on the quantity; empty if there is none.
        needs_impact: whether the quantity depends on the impact model.
        is_magnitude: whether limits and Pareto fronts use the magnitude of the quantity instead of the signed value.
    """

    words: str
    symbol: str
    unit: str
    whole: bool = False
    limit: str = ""
    needs_impact: bool = False
    is_magnitude: bool = True

    def in_words(self) -> Entry:
        """Return a copy of this entry with only name, symbol and unit."""
        return Entry(self.words, self.symbol, self.unit)

    @property
    def short(self) -> str:
        """The name of the quantity without the words "at contact"."""
        return self.words.removesuffix(" at contact")


QUANTITIES: Final[dict[str, Entry]] = {
    "time": Entry("time of contact", "t", "s", limit="time"),
    "distance": Entry("distance at contact", "l", "m"),
    "position": Entry("plant position at contact", "x", "m"),
    "velocity": Entry("plant velocity at contact", "x\u2032", "m/s"),
    "acceleration": Entry("plant acceleration at contact", "x\u2033", "m/s^2"),
    "displacement": Entry("deviation from the reference at contact", "x \u2212 x_d", "m"),
    "relative_velocity": Entry("relative velocity at contact", "l\u2032", "m/s", limit="relative_velocity"),
    "virtual_force": Entry("virtual force at contact", "F_p", "N"),
    "largest_excursion": Entry("largest excursion", "max |x \u2212 x_d|", "m", whole=True, limit="excursion"),
    "largest_travel": Entry("largest travel from the start", "max |x \u2212 x(0)|", "m", whole=True, limit="travel"),
    "largest_speed": Entry("largest plant speed", "max |x\u2032|", "m/s", whole=True, limit="speed"),
    "largest_acceleration": Entry(
        *("largest plant acceleration", "max |x\u2033|", "m/s^2"), whole=True, limit="acceleration"
    ),
    "largest_virtual_force": Entry("largest virtual force", "max |F_p|", "N", whole=True, limit="virtual_force"),
    "closest_distance": Entry("smallest distance", "min l", "m", whole=True),
    "settling_distance": Entry("settling distance", "l(\u221e)", "m", whole=True),
    "impulse_residual": Entry("residual of the impulse balance", "", "", whole=True),
    "drive_force": Entry(
        *("largest drive force", "m max |x\u2033|", "N"), whole=True, limit="drive_force", needs_impact=True
    ),
    "impact_force": Entry("peak impact force", "F", "N", limit="impact_force", needs_impact=True),
    "peak_force": Entry("peak contact force", "max F", "N", whole=True),
    "impulse": Entry("impulse of all contacts", "\u222bF dt", "N*s", whole=True),
    "rebound_velocity": Entry("relative velocity after impact", "l\u2032", "m/s"),
    "gain": Entry("gain", "D_p", "N*s", limit="gain"),
    "objective": Entry("objective", "f", ""),
}
"""Every quantity of results, objectives, limits and sweeps, by its name in code; users can add quantities."""


def words_for(name: str) -> str:
    """Return the name of a quantity in plain words.

    Args:
        name: such as `relative_velocity`.

    Returns:
        Words such as `relative velocity at contact`.

    Examples:
        >>> words_for("largest_excursion"), words_for("natural_frequency")
        ('largest excursion', 'natural frequency')
    """
    return QUANTITIES[name].words if name in QUANTITIES else name.replace("_", " ").replace("-", " ")


def unit_of(name: str) -> str:
    """Return the SI unit of a quantity with a given name."""
    return QUANTITIES[name].unit
