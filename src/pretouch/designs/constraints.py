"""Define design constraints, which limit quantities such as the excursion or the contact speed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import finite
from pretouch.motion.contact import ContactState

from .impact import ImpactModel
from .quantities import CONSTRAINT_NAMES, QUANTITY_KINDS, QUANTITY_UNITS, contact_value, size_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraint:
    """An upper limit on a quantity, such as the robot's excursion.

    Args:
        name: a key of CONSTRAINT_NAMES: `excursion` (|x - x_d| over the whole motion), `travel` (|x - x(0)| over the
            whole motion), `relative_velocity` (at contact), `time` (of contact), `speed`, `acceleration`,
            `virtual_force` (of the plant, over the whole motion), `drive_force` (physical mass times largest
            acceleration), `impact_force` (peak force of the impact), `gain` (magnitude of the law's number, such as
            |D_p|, as `GainLimit.allowed`). Or a `ContactQuantity`.
        limit: the largest allowed magnitude > 0, in SI.
        source: what in a robot model sets the limit, such as "control range of elbow"; empty for a limit of the user.
            Constraints are equal without regard to it.

    Examples:
        >>> Constraint(name="excursion", limit=0.2).unit
        'm'
    """

    name: str
    limit: float
    source: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        check_types(self)
        if self.name not in CONSTRAINT_NAMES:
            QUANTITY_KINDS.find(self.name)  # reads the quantity of an installed package, which adds its constraint
        if self.name not in CONSTRAINT_NAMES:
            names = dict.fromkeys((*CONSTRAINT_NAMES, *QUANTITY_KINDS.installed()))
            refusal = not_one_of("constraint", self.name, names)
            own = next((name for name, quantity in CONSTRAINT_NAMES.items() if quantity == self.name), None)
            if own is not None:
                refusal["message"] += f". The limit of {self.name} has the name {own}"
            raise InvalidInputError(**refusal)
        if not finite(self.limit, f"constraint {self.name}", self.unit) > 0:
            raise InvalidInputError(
                f"constraint {self.name}: found a limit of {self.limit:g} {self.unit}, expected a positive limit",
                value=self.limit,
            )

    @property
    def quantity(self) -> str:
        """The name of the limited quantity, such as `excursion`."""
        return CONSTRAINT_NAMES[self.name]

    @property
    def unit(self) -> str:
        """The SI unit of the limited quantity."""
        return QUANTITY_UNITS[self.quantity]

    def magnitude(self, state: ContactState, impact: ImpactModel | None = None) -> Any:
        """Return the magnitude of the limited quantity at contact, in SI units."""
        return size_of(self.quantity, contact_value(self.quantity, state, impact))


def each_once(constraints: Iterable[Constraint]) -> None:
    """Raise an error if two constraints have the same name."""
    names = [constraint.name for constraint in constraints]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(
                f"constraint {name}: this constraint is given twice; remove one of the two constraints"
            )
