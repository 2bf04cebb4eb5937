"""The section [objective] of a scenario file, in its variants."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pretouch.design.quantities import QUANTITY_UNITS

from .quantities import Quantity, UnfitValueError
from .section import REQUIRED, TAG, WEIGHT, Key, Section, list_of, name_of

__all__ = ["OBJECTIVE_VARIANTS"]

_OBSTACLE: Final = ("obstacle speed",)


def _one_of_two(given: Mapping[str, Any]) -> None:
    """Hold the second term that L(20) and L(22) share: what is left of the impact, as speed or as force."""
    expected = 'expected either velocity_scale = "0.3 m/s" or force_scale = "100 N"'
    if {"velocity_scale", "force_scale"} <= set(given):
        raise UnfitValueError(f"found both velocity_scale and force_scale, {expected}", "force_scale")
    if not {"velocity_scale", "force_scale"} & set(given):
        raise UnfitValueError(f"missing velocity_scale, {expected}")
    for kind in ("velocity", "force"):
        if f"{kind}_weight" in given and f"{kind}_scale" not in given:
            raise UnfitValueError(f"found {kind}_weight without {kind}_scale, expected both or none", f"{kind}_weight")


def _compromise(first: str, unit: str, example: str) -> Section:
    """Return the section of a compromise: a term of its own, with scale and weight, and the one that is shared."""
    return Section(
        {
            "velocity_scale": Key(Quantity("m/s", '"0.3 m/s"', "nonzero", words=_OBSTACLE)),
            "velocity_weight": WEIGHT,
            "force_scale": Key(Quantity("N", '"100 N"', "nonzero")),
            "force_weight": WEIGHT,
            "kind": TAG,
            f"{first}_scale": Key(Quantity(unit, example, "nonzero"), REQUIRED),
            f"{first}_weight": WEIGHT,
        },
        _one_of_two,
    )


def _scale(quantity: str | None) -> Any:
    """Return what reads the scale of a quantity, in its unit."""
    if quantity is None:  # which is a mistake of its own
        return lambda _: 1.0
    words = _OBSTACLE if "velocity" in quantity or "speed" in quantity else ()
    return Quantity(QUANTITY_UNITS[quantity], "", "nonzero", words=words)


_TERM: Final = Section(
    {
        "quantity": Key(name_of(*QUANTITY_UNITS), REQUIRED, '"time"'),
        "scale": Key(_scale(None), REQUIRED, '"1 s"', after=("quantity", _scale)),
        "weight": WEIGHT,
    },
    example='{ quantity = "time", scale = "1 s" }',
)
"""One term weight * (quantity / scale)^2."""

_TERMS: Final = 'a list of terms such as { quantity = "time", scale = "1 s", weight = 1.0 }'

OBJECTIVE_VARIANTS: Final[dict[str, Section]] = {
    "excursion": _compromise("position", "m", '"0.5 m"'),
    "time": _compromise("time", "s", '"1 s"'),
    "custom": Section(
        {"kind": TAG, "terms": Key(list_of(_TERM, 1, None, _TERMS), REQUIRED, '[{ quantity = "time", scale = "1 s" }]')}
    ),
}
"""The variant that each `kind` takes: L(20), L(22), and any weighted combination of contact quantities."""
