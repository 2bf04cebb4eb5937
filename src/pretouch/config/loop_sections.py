"""The sections of a scenario file that describe the sampled loop: [chain], [controller], [robot], [contact], [loop].

Their validators are built when a file has such a section: most have none, and should not wait for them.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Final, Self

from pydantic import ConfigDict, ValidationInfo, field_validator, model_validator

from pretouch._core.declared import declared
from pretouch._core.errors import UnitError
from pretouch._core.magnitudes import has_workable_magnitude
from pretouch._core.units import parse_unit
from pretouch.control import Conditioning, Limits, VirtualDamper
from pretouch.simulation.chain import SensorChain
from pretouch.simulation.contact import ContactModel, HuntCrossley, SpringDamper
from pretouch.simulation.plant import IdealPlant, ImpedancePlant, PlantModel, PositionPlant

from .quantities import Quantity, UnfitValueError
from .section import Section, section_of, text, whole

__all__ = [
    "CONTACTS",
    "LOOP_VARIANTS",
    "PLANTS",
    "ChainSection",
    "ControllerSection",
    "KindSection",
    "LoopSection",
]

_RATE: Final = Quantity(unit="Hz", example='"1 kHz"', sign="positive")
_SPAN: Final = Quantity(unit="s", example='"1 ms"', sign="positive")
_FORCE: Final = Quantity(unit="N", example='"20 N"', sign="positive")
_POWER_LAW: Final = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(\w*N)/(\w*m)(?:\^(\d+\.?\d*))?\s*", re.I
)


class DeferredSection(Section):
    """A section whose validators wait for the first file that has it."""

    model_config = ConfigDict(defer_build=True)


class _Chain(DeferredSection):
    part: Annotated[str | None, text('"VCNL4010"')] = None
    phase: Annotated[float | str, Quantity(unit="s", example='"random"', sign="nonnegative", words=("random",))] = (
        "random"
    )

    @model_validator(mode="after")
    def _how_often(self) -> Self:
        if self.part is None and self.rate is None:  # type: ignore[attr-defined]
            raise UnfitValueError('missing rate, expected rate = "250 Hz", or part = "VCNL4010", which has one')
        return self


ChainSection: Any = section_of(SensorChain, base=_Chain, optional=True, without=("phase", "random_phase"))
"""[chain], what lies between the distance and the controller's readings; None as the part or the calibration has it."""


class _Controller(DeferredSection):
    rate: Annotated[float | None, _RATE] = None
    period: Annotated[float | None, _SPAN] = None
    floor: Annotated[float | None, Quantity(unit="output", example="30.0", sign="positive")] = None
    offset: Annotated[float | None, Quantity(unit="output", example="0.0")] = None
    contact_gain: Annotated[float | None, Quantity(unit="", example="0.0", sign="nonnegative")] = None
    contact_threshold: Annotated[float, _FORCE] = 1.0
    gain: Annotated[float | None, Quantity(unit="N*s", example='"-0.7 N*s"')] = None

    @model_validator(mode="after")
    def _one_clock(self) -> Self:
        expected = 'expected one of rate = "1 kHz" and period = "1 ms"'
        if self.rate is None and self.period is None:
            raise UnfitValueError(f"missing rate, {expected}")
        if self.rate is not None and self.period is not None:
            raise UnfitValueError(f"found both rate and period, {expected}", "period")
        return self


ControllerSection: Any = section_of(
    *(Conditioning, VirtualDamper, Limits),
    base=_Controller,
    without=("floor", "offset", "sensor_period", "gain"),
    renamed={f.name: f"largest_{f.name}" for f in declared(Limits)},
)
"""[controller], the sampled law; its virtual admittance is that of [admittance]."""


class KindSection(DeferredSection):
    """A section whose `kind` names the class that it describes."""

    kind: str


class _HuntCrossley(KindSection):
    exponent: Annotated[float, Quantity(unit="", example="1.5", sign="positive")] = 1.5  # read before the stiffness

    @field_validator("stiffness", mode="before", check_fields=False)
    @classmethod
    def _in_its_power(cls, value: Any, info: ValidationInfo) -> Any:
        """Turn text such as "1e6 N/m^1.5" into SI, where its power is that of the exponent."""
        exponent = info.data.get("exponent", 1.5)
        if not isinstance(value, str):
            return value
        match = _POWER_LAW.fullmatch(value)
        try:
            if match and float(match[4] or 1) == exponent:
                force, length = parse_unit(match[2]).factor, parse_unit(match[3]).factor
                number = float(match[1]) * force / length**exponent
                if has_workable_magnitude(number):
                    return number
        except (UnitError, ArithmeticError):
            pass
        raise UnfitValueError(f'expected a positive quantity in N/m^{exponent:g}, such as "1e6 N/m^{exponent:g}"')


class LoopSection(DeferredSection):
    """How the loop is run, and how far from instability the gain is to stay."""

    runs: Annotated[int, whole(1, "1000")] = 1000
    seed: Annotated[int, whole(0, "0")] = 0
    horizon: Annotated[float, _SPAN] = 10.0
    follow: Annotated[float, Quantity(unit="s", example='"1 ms"', sign="nonnegative")] = 0.2
    stability_margin: Annotated[float | None, Quantity(unit="", example="2.0", sign="positive")] = None

    @model_validator(mode="after")
    def _beyond_one(self) -> Self:
        if self.stability_margin is not None and not self.stability_margin > 1:
            raise UnfitValueError(
                f"found {self.stability_margin:g}, expected a number above 1, such as 2: how many times the gain could "
                "grow until the loop is unstable",
                "stability_margin",
            )
        return self


PLANTS: Final[dict[str, type[PlantModel]]] = {
    plant.kind: plant for plant in (IdealPlant, ImpedancePlant, PositionPlant)
}
"""The robots that a file may name by their kind."""

CONTACTS: Final[dict[str, type[ContactModel]]] = {contact.kind: contact for contact in (HuntCrossley, SpringDamper)}
"""The contacts that a file may name by their kind."""

LOOP_VARIANTS: Final[dict[str, dict[str, type[Section]]]] = {
    "chain": {"": ChainSection},
    "controller": {"": ControllerSection},
    "robot": {kind: section_of(plant, base=KindSection) for kind, plant in PLANTS.items()},
    "contact": {
        kind: section_of(contact, base=_HuntCrossley if contact is HuntCrossley else KindSection, without=("exponent",))
        for kind, contact in CONTACTS.items()
    },
    "loop": {"": LoopSection},
}
"""The sections of a loop in their variants."""
