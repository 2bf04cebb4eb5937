"""Constraints: limits of the quantities of a contact."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import finite
from pretouch.motion.contact import ContactState

from .impact import ImpactModel
from .quantities import QUANTITY_UNITS, quantity_of

CONSTRAINT_NAMES: Final[dict[str, str]] = {
    "excursion": "largest_excursion",
    "travel": "largest_travel",
    "relative_velocity": "relative_velocity",
    "time": "time",
    "speed": "largest_speed",
    "acceleration": "largest_acceleration",
    "virtual_force": "largest_virtual_force",
    "drive_force": "drive_force",
    "impact_force": "impact_force",
    "gain": "gain",
}
"""The quantity that each constraint limits, by the constraint's short name in a scenario file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraint:
    """An upper limit of the magnitude of a quantity, such as the excursion.

    Args:
        name: a key of CONSTRAINT_NAMES: `excursion` (|x - x_d| over the whole motion), `travel` (|x - x(0)| over the
            whole motion), `relative_velocity` (at contact), `time` (of contact), `speed`, `acceleration`,
            `virtual_force` (of the plant, over the whole motion), `drive_force` (physical mass times largest
            acceleration), `impact_force` (peak force of the impact), `gain` (magnitude of the law's number, such as
            |D_p|, as `GainLimit.allowed`).
        limit: the largest allowed magnitude > 0, in SI.

    Examples:
        >>> Constraint(name="excursion", limit=0.2).unit
        'm'
    """

    name: str
    limit: float

    def __post_init__(self) -> None:
        check_types(self)
        if self.name not in CONSTRAINT_NAMES:
            raise InvalidInputError(f"constraint: found {self.name!r}, expected one of {', '.join(CONSTRAINT_NAMES)}")
        if not finite(self.limit, f"constraint {self.name}", self.unit) > 0:
            raise InvalidInputError(f"constraint {self.name}: found {self.limit:g} {self.unit}, which must be positive")

    @property
    def quantity(self) -> str:
        """The quantity that this constraint limits."""
        return CONSTRAINT_NAMES[self.name]

    @property
    def unit(self) -> str:
        """The SI unit of the limit."""
        return QUANTITY_UNITS[self.quantity]

    def magnitude(self, state: ContactState, impact: ImpactModel | None = None) -> Any:
        """Return the magnitude of the limited quantity at contact, in SI units."""
        return np.abs(quantity_of(self.quantity, state, impact))


def each_once(constraints: Iterable[Constraint]) -> None:
    """Raise an error if two constraints have the same name."""
    names = [constraint.name for constraint in constraints]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f"constraint {name}: found twice, expected once; remove one of the two")
