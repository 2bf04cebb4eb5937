"""Define the quantities, such as the contact speed, that objectives and constraints can use."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.extensions import Extensions
from pretouch._core.messages import not_one_of, short_repr
from pretouch._core.units import parse_unit
from pretouch._core.vocabulary import QUANTITIES, Entry
from pretouch.motion.contact import ContactState

from .impact import ImpactModel

Formula: TypeAlias = Callable[[ContactState, Any], Any]
"""Function of the state at contact and the impact model that returns a quantity."""

_OF_STATE: Final = (
    *("time", "position", "velocity", "acceleration", "displacement", "relative_velocity", "virtual_force"),
    *("largest_excursion", "largest_travel", "largest_speed", "largest_acceleration", "largest_virtual_force"),
)
_FORMULAS: Final[dict[str, Formula]] = {
    **{name: lambda state, _, name=name: getattr(state, name) for name in _OF_STATE},  # type: ignore[misc]
    "drive_force": lambda state, impact: impact.robot_mass * state.largest_acceleration,
    "impact_force": lambda state, impact: impact.peak_force(state.relative_velocity),
    "gain": lambda state, _: state.columns.column("gain"),
}
"""What objectives and constraints can use, by name; the vocabulary has names, symbols and units."""

_BUILT_IN: Final = {name: entry for name, entry in QUANTITIES.items() if name in _FORMULAS}

QUANTITY_UNITS: Final[dict[str, str]] = {name: entry.unit for name, entry in _BUILT_IN.items()}
"""The SI unit of every contact quantity, built-in or user-defined, by the name of the quantity."""

CONSTRAINT_NAMES: Final[dict[str, str]] = {entry.limit: name for name, entry in _BUILT_IN.items() if entry.limit}
"""The quantity that each constraint limits, by the constraint's short name in a scenario file."""


class ContactQuantity(str):
    """A user-defined contact quantity.

    It works in objectives, constraints, Pareto fronts, sweeps, verification and reports.

    It is the name of the quantity, with all that describes it. Its `name` is also that of its constraint. If two
    have the same name, the later one replaces the earlier one.

    Args:
        name: its name in code, files and JSON documents.
        value: function of the state at contact, or of many states at once, and of the impact model, which returns it.
        unit: its SI unit.
        words: its name in words; by default, its name.
        symbol: its symbol.
        needs_impact: whether the function needs the impact model.
        is_magnitude: whether limits and Pareto fronts use its magnitude, not its signed value.

    Examples:
        >>> from pretouch.designs import Constraint
        >>> def energy(state, impact):
        ...     return 0.5 * impact.robot_mass * state.relative_velocity**2
        >>> ENERGY = ContactQuantity("energy", energy, unit="J", symbol="E", needs_impact=True)
        >>> Constraint(name=ENERGY, limit=0.1).unit
        'J'
    """

    __slots__ = ("_make",)
    _make: Callable[[], ContactQuantity]

    @check_arguments
    def __new__(  # noqa: D102 - the class describes it
        cls,
        name: str,
        value: Formula,
        *,
        unit: str = "",
        words: str = "",
        symbol: str = "",
        needs_impact: bool = False,
        is_magnitude: bool = True,
    ) -> ContactQuantity:
        if name in _BUILT_IN or not name.isidentifier():
            raise InvalidInputError(
                f"name: found {name!r}, expected letters, digits and underscores. The names of the built-in "
                f"quantities are not allowed: {', '.join(_BUILT_IN)}",
                value=name,
            )
        parse_unit(unit)
        entry = Entry(
            words or name.replace("_", " "),
            symbol,
            unit,
            whole=True,  # it may read any quantity of the state
            limit=name,
            needs_impact=needs_impact,
            is_magnitude=is_magnitude,
        )
        QUANTITIES[name], QUANTITY_UNITS[name], CONSTRAINT_NAMES[name] = entry, unit, name
        _FORMULAS[name] = value
        quantity = super().__new__(cls, name)
        options: dict[str, Any] = {"unit": unit, "words": words, "symbol": symbol, "needs_impact": needs_impact}
        quantity._make = partial(ContactQuantity, name, value, **options, is_magnitude=is_magnitude)
        return quantity

    def __reduce__(self) -> tuple[Any, ...]:
        return self._make, ()  # so that another process knows it, too


def _quantity_problem(name: str, quantity: Any) -> str:
    """Return why a quantity of an installed package is invalid; empty if it is valid."""
    if not isinstance(quantity, ContactQuantity):
        return f"found {short_repr(quantity)}, expected a pretouch.designs.ContactQuantity"
    return (
        ""
        if quantity == name
        else f'the name of the quantity is "{quantity}", but must equal the name of the entry point; use '
        "the same name for both"
    )


QUANTITY_KINDS: Final = Extensions(group="pretouch.terms", built_in=lambda: _BUILT_IN, problem=_quantity_problem)
"""The quantities that files may name: those of pretouch, and those of installed packages."""


def find_quantity(name: str) -> Entry | None:
    """Find a contact quantity by its name.

    Returns:
        The built-in, user-defined or installed quantity; None if the name is unknown.
    """
    if name not in QUANTITY_UNITS and QUANTITY_KINDS.find(name) is None:
        return None
    return QUANTITIES[name]


def check_quantity(name: str, argument: str) -> None:
    """Raise an error if a quantity name is unknown.

    Raises:
        InvalidInputError: the name is unknown; the message names the `argument` that contains it.
    """
    if find_quantity(name) is None:
        names = dict.fromkeys((*QUANTITY_UNITS, *QUANTITY_KINDS.names()))
        raise InvalidInputError(**not_one_of(argument, name, names))


@check_arguments
def quantity_of(name: str, state: ContactState, impact: ImpactModel | None = None) -> Any:
    """Return the value of a named quantity at contact.

    Args:
        name: a key of QUANTITY_UNITS. `drive_force` is the physical mass times the largest acceleration;
            `impact_force` is the peak force of the impact at the relative velocity of contact; `gain` is the law's
            number of the run, such as D_p [N s].
        state: the state at contact.
        impact: the physical properties, needed for `drive_force` and `impact_force`.

    Returns:
        The quantity in SI, of the shape of the state. An unknown quantity, and one that needs physical properties
        without an impact model, raise InvalidInputError.
    """
    check_quantity(name, "quantity")
    return contact_value(name, state, impact)


def contact_value(name: str, state: ContactState, impact: ImpactModel | None) -> Any:
    """Return the value of a quantity whose name a task has already checked.

    Raises:
        InvalidInputError: the quantity needs an impact model, and there is none.
    """
    if impact is None and QUANTITIES[name].needs_impact:
        raise InvalidInputError(
            f"{name}: this quantity depends on the physical masses of robot and obstacle. Pass an impact model "
            "with these masses. The mass of the robot is its reflected mass, not the virtual mass of the admittance"
        )
    return _FORMULAS[name](state, impact)


def size_of(name: str, value: Any) -> Any:
    """Return the value of a quantity that is compared with its limit.

    It is the magnitude or the signed value.
    """
    return np.abs(value) if QUANTITIES[name].is_magnitude else np.asarray(value)
