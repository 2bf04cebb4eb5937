"""What quantities are called where a person reads them, and how their numbers are written."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from pretouch._core.units import format_quantity, pretty_unit
from pretouch.design.objectives import Objective
from pretouch.design.own_objective import OwnObjective
from pretouch.design.quantities import QUANTITY_UNITS

__all__ = ["QUANTITY_LABELS", "number", "objective_rows", "quantity", "quantity_label", "word"]

QUANTITY_LABELS: Final[dict[str, tuple[str, str]]] = {
    "time": ("time of contact", "t"),
    "position": ("plant position at contact", "x"),
    "velocity": ("plant velocity at contact", "x\u2032"),
    "acceleration": ("plant acceleration at contact", "x\u2033"),
    "displacement": ("deviation from the reference at contact", "x \u2212 x_d"),
    "relative_velocity": ("relative velocity at contact", "l\u2032"),
    "virtual_force": ("virtual force at contact", "F_p"),
    "largest_excursion": ("largest deviation from the reference", "max |x \u2212 x_d|"),
    "largest_travel": ("largest travel from the start", "max |x \u2212 x(0)|"),
    "largest_speed": ("largest plant speed", "max |x\u2032|"),
    "largest_acceleration": ("largest plant acceleration", "max |x\u2033|"),
    "largest_virtual_force": ("largest virtual force", "max |F_p|"),
    "drive_force": ("largest drive force", "m max |x\u2033|"),
    "impact_force": ("peak impact force", "F"),
    "gain": ("gain", "D_p"),
}
"""Words and symbol of every quantity that objectives and constraints speak of."""


def quantity_label(name: str) -> str:
    """Return the words for a quantity."""
    return QUANTITY_LABELS[name][0] if name in QUANTITY_LABELS else word(name)


def word(name: str) -> str:
    """Write a name from code for a person: `relative_velocity` as `relative velocity`."""
    return name.replace("_", " ").replace("-", " ")


def quantity(value: float | None, unit: str = "", digits: int = 4) -> str:
    """Write an SI value with its unit for a person.

    Args:
        value: the value in SI; None where there is none.
        unit: its SI unit.
        digits: significant digits.

    Returns:
        Text such as `42.2 mm`, and a dash for None or NaN.

    Examples:
        >>> quantity(8.8385, "m/s^2")
        '8.838 m/s²'
        >>> quantity(None, "m")
        '–'
    """
    if value is None or math.isnan(value):
        return "\u2013"
    if math.isinf(value):
        return ("" if value > 0 else "-") + "\u221e"
    return pretty_unit(format_quantity(value, unit, digits))


def number(value: float | None, digits: int = 4) -> str:
    """Write a pure number for a person, with a dash for None or NaN."""
    return quantity(value, "", digits)


def objective_rows(objective: Objective) -> Iterator[tuple[str, str, str]]:
    """Say what an objective is made of, as far as that is known.

    Args:
        objective: what was minimized.

    Yields:
        Quantity, typical value and weight of each term; one row for an objective of a user's own.
    """
    if isinstance(objective, OwnObjective):
        yield f"{objective.name}: an objective of the user\u2019s own", "\u2013", "\u2013"
        return
    for term in objective.terms:
        own = word(term.scale) if isinstance(term.scale, str) else None
        scale = own or quantity(abs(float(term.scale)), QUANTITY_UNITS[term.quantity])
        yield quantity_label(term.quantity), scale, number(term.weight)
