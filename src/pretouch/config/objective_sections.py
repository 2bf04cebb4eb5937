"""The section [objective] of a scenario file, in its variants."""

from __future__ import annotations

from typing import Annotated, Any, Final, Self

from pydantic import ValidationInfo, field_validator, model_validator

from pretouch.design.quantities import QUANTITY_UNITS

from .quantities import Quantity, UnfitValueError
from .section import WEIGHT, Section, list_of, name_of

__all__ = [
    "OBJECTIVE_SECTIONS",
    "CompromiseSection",
    "CustomObjective",
    "ExcursionObjective",
    "TermSection",
    "TimeObjective",
]

_OBSTACLE: Final = ("obstacle speed",)
_SPEED: Final = Quantity(unit="m/s", example='"0.3 m/s"', sign="nonzero", words=_OBSTACLE)


class CompromiseSection(Section):
    """The second term that L(20) and L(22) share: what is left of the impact, as speed or as force."""

    velocity_scale: Annotated[float | str | None, _SPEED] = None
    velocity_weight: Annotated[float, WEIGHT] = 1.0
    force_scale: Annotated[float | None, Quantity(unit="N", example='"100 N"', sign="nonzero")] = None
    force_weight: Annotated[float, WEIGHT] = 1.0

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        given = self.model_fields_set
        expected = 'expected either velocity_scale = "0.3 m/s" or force_scale = "100 N"'
        if {"velocity_scale", "force_scale"} <= given:
            raise UnfitValueError(f"found both velocity_scale and force_scale, {expected}", "force_scale")
        if not {"velocity_scale", "force_scale"} & given:
            raise UnfitValueError(f"missing velocity_scale, {expected}")
        for kind in ("velocity", "force"):
            if f"{kind}_weight" in given and f"{kind}_scale" not in given:
                raise UnfitValueError(
                    f"found {kind}_weight without {kind}_scale, expected both or none", f"{kind}_weight"
                )
        return self


class ExcursionObjective(CompromiseSection):
    """`kind = "excursion"`, L(20)."""

    kind: str
    position_scale: Annotated[float, Quantity(unit="m", example='"0.5 m"', sign="nonzero")]
    position_weight: Annotated[float, WEIGHT] = 1.0


class TimeObjective(CompromiseSection):
    """`kind = "time"`, L(22)."""

    kind: str
    time_scale: Annotated[float, Quantity(unit="s", example='"1 s"', sign="nonzero")]
    time_weight: Annotated[float, WEIGHT] = 1.0


class TermSection(Section):
    """One term weight * (quantity / scale)^2."""

    quantity: Annotated[str, name_of(*QUANTITY_UNITS)]
    scale: float | str
    weight: Annotated[float, WEIGHT] = 1.0

    @field_validator("scale", mode="plain")
    @classmethod
    def _in_its_unit(cls, value: Any, info: ValidationInfo) -> float | str:
        """Read the scale in the unit of its quantity."""
        name = info.data.get("quantity")
        if name is None:  # the quantity is a mistake of its own
            return 1.0
        words = _OBSTACLE if "velocity" in name or "speed" in name else ()
        return Quantity(unit=QUANTITY_UNITS[name], example="", sign="nonzero", words=words).read(value)


class CustomObjective(Section):
    """`kind = "custom"`: any weighted combination of contact quantities."""

    kind: str
    terms: Annotated[
        list[TermSection],
        list_of(1, None, 'a list of terms such as { quantity = "time", scale = "1 s", weight = 1.0 }'),
    ]


OBJECTIVE_SECTIONS: Final[dict[str, type[Section]]] = {
    "excursion": ExcursionObjective,
    "time": TimeObjective,
    "custom": CustomObjective,
}
"""The variant that each `kind` takes."""
