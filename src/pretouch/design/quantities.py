"""Quantities of a contact that objectives and constraints use, with their units."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.vocabulary import unit_of
from pretouch.motion.contact import ContactState

from .impact import ImpactModel

_STATE_FIELDS: Final = tuple(name for name in ContactState.names() if name != "distance")  # the distance is always 0

QUANTITY_UNITS: Final[dict[str, str]] = {
    name: unit_of(name) for name in (*_STATE_FIELDS, "drive_force", "impact_force", "gain")
}
"""SI unit of every quantity: the fields of ContactState, two that need the robot's physical mass, and the gain."""


@check_arguments
def quantity_of(name: str, state: ContactState, impact: ImpactModel | None = None) -> Any:
    """Return a quantity at contact by its name, such as `impact_force`.

    Args:
        name: a key of QUANTITY_UNITS. `drive_force` is the physical mass times the largest acceleration;
            `impact_force` is the peak force of the impact at the relative velocity of contact; `gain` is the law's
            number of the run, such as D_p [N s].
        state: the state at contact.
        impact: the physical properties, needed for `drive_force` and `impact_force`.

    Returns:
        The quantity in SI, of the shape of the state.

    Raises:
        InvalidInputError: the quantity is unknown, or it needs physical properties and there is no impact model.
    """
    if name not in QUANTITY_UNITS:
        raise InvalidInputError(f"quantity: found {name!r}, expected one of {', '.join(QUANTITY_UNITS)}")
    if name in _STATE_FIELDS:
        return getattr(state, name)
    if name == "gain":
        return state.columns.column("gain")
    if impact is None:
        raise InvalidInputError(
            f"{name}: needs the physical properties of robot and obstacle; pass an impact model with the robot's "
            "reflected mass, which is not the virtual mass of the admittance"
        )
    if name == "drive_force":
        return impact.robot_mass * np.asarray(state.largest_acceleration)
    return impact.peak_force(state.relative_velocity)
