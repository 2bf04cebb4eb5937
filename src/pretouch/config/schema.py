"""The sections of a scenario file, their keys, and the unit that each key takes.

This is the one place where they are named: messages and the test of docs/scenario-file.md read them from here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Self

from pydantic import BeforeValidator, create_model, model_validator

from pretouch.design.constraints import CONSTRAINT_NAMES
from pretouch.design.quantities import QUANTITY_UNITS
from pretouch.motion.admittance import Admittance
from pretouch.motion.scenario import Obstacle, Plant, Reference

from .objective_sections import OBJECTIVE_SECTIONS
from .quantities import Quantity, UnfitValueError
from .robust_sections import RobustSection, UncertaintySection
from .section import Section, list_of, name_of, section_of
from .sensor_sections import SENSOR_SECTIONS

__all__ = [
    "BODIES",
    "LOOP_SECTIONS",
    "REQUIRED",
    "SECTIONS",
    "DampedAdmittance",
    "FrequencyAdmittance",
    "GainSection",
    "HertzSection",
    "ImpactSection",
    "MotionSection",
    "ParetoSection",
    "SpringSection",
    "keys_of",
    "quantity_of_key",
]

_MASS: Final = Quantity(unit="kg", example='"1 kg"', sign="positive")


def _angular(value: Any) -> Any:
    """Refuse Hz for an angular frequency: 5 Hz is either 5 rad/s or 31.4 rad/s, and nobody knows which."""
    if isinstance(value, str) and "Hz" in value:
        raise UnfitValueError(
            'expected an angular frequency in rad/s: Hz is ambiguous here, 1 Hz is 2*pi = "6.2832 rad/s"'
        )
    return value


_FREQUENCY: Final = Quantity(unit="rad/s", example='"5 rad/s"', sign="nonnegative")
_RATIO: Final = Quantity(unit="", example="1.0", sign="nonnegative")


class AdmittanceSection(Section):
    """What may be chosen along with the gain, in every form of [admittance]."""

    natural_frequency_bounds: Annotated[
        list[Annotated[float, _FREQUENCY, BeforeValidator(_angular)]] | None,
        list_of(2, 2, "a list of two quantities in rad/s, the lower bound first"),
    ] = None
    damping_ratio_bounds: Annotated[
        list[Annotated[float, _RATIO]] | None, list_of(2, 2, "a list of two numbers, the lower bound first")
    ] = None

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for key in ("natural_frequency_bounds", "damping_ratio_bounds"):
            ends = getattr(self, key)
            if ends is not None and not ends[0] < ends[1]:
                raise UnfitValueError(f"found bounds from {ends[0]:g} to {ends[1]:g}, expected the lower first", key)
        return self


DampedAdmittance: Final = section_of(Admittance, base=AdmittanceSection)
"""Mass, damping and stiffness of L(1)."""


class FrequencyAdmittance(AdmittanceSection):
    """Mass, natural frequency and damping ratio; critically damped by default, as in the letter."""

    mass: Annotated[float, _MASS]
    natural_frequency: Annotated[float, _FREQUENCY, BeforeValidator(_angular)]
    damping_ratio: Annotated[float, _RATIO] = 1.0


class GainSection(Section):
    """Between which gains the optimum is sought."""

    bounds: Annotated[
        list[Annotated[float, Quantity(unit="N*s", example='["-10 N*s", "-0.01 N*s"]')]],
        list_of(2, 2, "a list of two quantities in N*s, the lower bound first"),
    ]

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        low, high = self.bounds
        if not low < high:
            raise UnfitValueError(
                f"found bounds from {low:g} N*s to {high:g} N*s, expected the lower bound first", "bounds"
            )
        return self


_LIMITS: Final[dict[str, Any]] = {
    name: (Annotated[float | None, Quantity(unit=QUANTITY_UNITS[quantity], example="", sign="positive")], None)
    for name, quantity in CONSTRAINT_NAMES.items()
}
ConstraintsSection: Final[type[Section]] = create_model("ConstraintsSection", __base__=Section, **_LIMITS)
"""The limits: one key for each name of CONSTRAINT_NAMES."""


class ImpactSection(Section):
    """The masses that meet; the robot's is its physical reflected mass, not that of the admittance."""

    robot_mass: Annotated[float, Quantity(unit="kg", example='"4 kg"', sign="positive")]
    obstacle_mass: Annotated[float, Quantity(unit="kg", example='"inf"', sign="positive", infinite=True)] = math.inf


class SpringSection(ImpactSection):
    """Impact on a given contact stiffness."""

    stiffness: Annotated[float, Quantity(unit="N/m", example='"10 kN/m"', sign="positive")]


class HertzSection(ImpactSection):
    """Impact of a sphere by Hertz's law."""

    effective_modulus: Annotated[float, Quantity(unit="Pa", example='"10 MPa"', sign="positive")]
    radius: Annotated[float, Quantity(unit="m", example='"10 mm"', sign="positive")]


class MotionSection(Section):
    """How encounters are solved."""

    method: Annotated[str, name_of("auto", "closed-form", "integration", "uniform-motion")] = "auto"
    horizon: Annotated[float, Quantity(unit="s", example='"1 h"', sign="positive")] = 600.0


class ParetoSection(Section):
    """What `pretouch pareto` trades."""

    quantities: Annotated[
        list[Annotated[str, name_of(*QUANTITY_UNITS)]] | None,
        list_of(2, 3, 'a list of two or three quantities such as "displacement", "relative_velocity"'),
    ] = None
    choice: Annotated[float | None, Quantity(unit="N*s", example='"-0.7 N*s"')] = None

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        if self.quantities is not None and len(set(self.quantities)) < len(self.quantities):
            raise UnfitValueError("found a quantity twice, expected each once", "quantities")
        return self


BODIES: Final = {"obstacle": Obstacle, "plant": Plant, "reference": Reference}
"""What moves in an encounter, by its section."""

_ALWAYS: Final[Mapping[str, Mapping[str, type[Section]]]] = {
    "sensor": SENSOR_SECTIONS,
    "admittance": {"damping": DampedAdmittance, "natural_frequency": FrequencyAdmittance},
    **{name: {"": section_of(body, base=Section)} for name, body in BODIES.items()},
    "objective": OBJECTIVE_SECTIONS,
    "gain": {"": GainSection},
    "constraints": {"": ConstraintsSection},
    "impact": {"stiffness": SpringSection, "radius": HertzSection},
    "motion": {"": MotionSection},
    "pareto": {"": ParetoSection},
    "uncertainty": {"": UncertaintySection},
    "robust": {"": RobustSection},
}
LOOP_SECTIONS: Final = ("chain", "controller", "robot", "contact", "loop")
"""The sections of which a file has the first two, or none."""


class _Sections(Mapping[str, Mapping[str, type[Section]]]):
    """Those of a loop load the simulation, for which most files should not wait."""

    def __getitem__(self, name: str) -> Mapping[str, type[Section]]:
        if name not in LOOP_SECTIONS:
            return _ALWAYS[name]
        from .loop_sections import LOOP_VARIANTS  # noqa: PLC0415

        return LOOP_VARIANTS[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*_ALWAYS, *LOOP_SECTIONS))

    def __len__(self) -> int:
        return len(_ALWAYS) + len(LOOP_SECTIONS)


SECTIONS: Final = _Sections()
"""Every section in its variants, each variant by what distinguishes it."""

REQUIRED: Final[Mapping[str, str]] = {
    "sensor": 'calibration = "sensor.csv"',
    "admittance": 'mass = "1 kg", damping = "10 N*s/m", stiffness = "25 N/m"',
    "obstacle": 'position = "42.2 mm", velocity = "-0.3 m/s"',
    "objective": 'kind = "excursion", position_scale = "0.5 m", velocity_scale = "0.3 m/s"',
    "gain": 'bounds = ["-10 N*s", "-0.01 N*s"]',
}
"""The sections that a file must have, each with an example of its keys."""


def keys_of(section: str) -> tuple[str, ...]:
    """Return every key that some variant of a section takes, in the order of the schema."""
    return tuple(dict.fromkeys(key for variant in SECTIONS[section].values() for key in variant.model_fields))


def quantity_of_key(variant: type[Section], key: str) -> Quantity | None:
    """Return what a key takes; None where that is no single quantity."""
    metadata = variant.model_fields[key].metadata if key in variant.model_fields else ()
    return next((m for m in metadata if isinstance(m, Quantity)), None)
