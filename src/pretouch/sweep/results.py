"""What a sweep can be asked for: contact quantities, the optimal gain, and a status for every encounter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.vocabulary import QUANTITIES, unit_of, words_for
from pretouch.design import DesignStatus, ImpactModel, quantity_of
from pretouch.motion import ContactResult, ContactState, ContactStatus

__all__ = [
    "ALWAYS",
    "DESIGN_CODES",
    "OF_DESIGNS",
    "STATUS",
    "WHOLE_MOTION",
    "check_results",
    "read",
    "result_attributes",
]

STATUS: Final = "status"
"""The result that every sweep has."""

_PHYSICAL: Final = ("drive_force", "impact_force")
ALWAYS: Final = ("closest_distance", "settling_distance", "impulse_residual")  # known of runs without contact, too

_OF_CONTACTS: Final = (*ContactState.names(), *_PHYSICAL, *ALWAYS)
OF_DESIGNS: Final = ("gain", "objective")
"""What only a design gives."""

DESIGN_CODES: Final[dict[str, int]] = {status.value: code for code, status in enumerate(DesignStatus)}
"""The number of each status of a design, 0 for optimal."""

WHOLE_MOTION: Final = frozenset(name for name in _OF_CONTACTS if QUANTITIES[name].whole)
"""Quantities that need the whole motion, not only its end: an encounter takes longer."""

_DEFAULT_CONTACTS: Final = ("time", "relative_velocity", "displacement")
_DEFAULT_DESIGNS: Final = ("gain", "objective", "relative_velocity")


def check_results(results: Sequence[str] | None, *, designs: bool, impact: ImpactModel | None) -> tuple[str, ...]:
    """Return the names of results without the status, which is always there; a few where none are given."""
    if results is None:
        return _DEFAULT_DESIGNS if designs else _DEFAULT_CONTACTS
    names = (results,) if isinstance(results, str) else tuple(results)
    known = (*(OF_DESIGNS if designs else ()), *_OF_CONTACTS)
    for name in names:
        if name in OF_DESIGNS and not designs:
            raise InvalidInputError(f"results: found {name!r}, which needs designs; give an objective and bounds")
        if name not in known and name != STATUS:
            raise InvalidInputError(f"results: found {name!r}, expected one of {', '.join(known)}")
        if name in _PHYSICAL and impact is None:
            raise InvalidInputError(
                f"results: found {name!r} without physical properties; give an impact model with the robot's mass"
            )
    return tuple(dict.fromkeys(name for name in names if name != STATUS))


def read(name: str, result: ContactResult, impact: Any) -> Any:
    """Read a contact quantity of a result in SI; NaN is put elsewhere where there is no contact."""
    if name in ALWAYS:
        return getattr(result, name)
    if name in ContactState.names():
        return getattr(result.end, name)
    return quantity_of(name, result.end, impact)


def result_attributes(name: str, *, designs: bool) -> dict[str, Any]:
    """Return the attributes of a variable: unit and name in words, or what each status means.

    Returns:
        Attributes as the CF conventions have them.

    Examples:
        >>> result_attributes("relative_velocity", designs=False)
        {'long_name': 'relative velocity at contact', 'units': 'm/s'}
    """
    if name == STATUS:
        ways = list(DESIGN_CODES) if designs else [status.label for status in ContactStatus]
        meanings = " ".join(ways)
        return {"long_name": "how it ended", "flag_values": list(range(len(ways))), "flag_meanings": meanings}
    words = f"optimal {name}" if name in OF_DESIGNS else f"{words_for(name)}{', optimal gain' if designs else ''}"
    return {"long_name": words, "units": unit_of(name) or "1"}
