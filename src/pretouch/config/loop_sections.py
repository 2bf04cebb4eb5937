"""The sections of a scenario file that describe the sampled loop: [chain], [controller], [robot], [contact], [loop].

Their validators are built when a file has such a section: most have none, and should not wait for them.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Final, Self

from pydantic import BeforeValidator, ConfigDict, ValidationInfo, field_validator, model_validator

from pretouch._core.errors import UnitError
from pretouch._core.magnitudes import has_workable_magnitude
from pretouch._core.units import parse_unit

from .quantities import Quantity, UnfitValueError
from .section import Section, text, truth, whole

__all__ = [
    "CONTACT_SECTIONS",
    "LOOP_SECTIONS",
    "ROBOT_SECTIONS",
    "ChainSection",
    "ContactSection",
    "ControllerSection",
    "HuntCrossleySection",
    "IdealSection",
    "ImpedanceSection",
    "LoopSection",
    "PositionSection",
    "RobotSection",
    "SpringDamperSection",
]

LOOP_SECTIONS: Final = ("chain", "controller", "robot", "contact", "loop")
"""The sections of which a file has the first two, or none."""

_OUTPUT: Final = Quantity(unit="output", example="0.0")
_SPREAD: Final = Quantity(unit="output", example="10.0", sign="nonnegative")
_END: Final = Quantity(unit="output", example="65535.0", infinite=True)
_RATE: Final = Quantity(unit="Hz", example='"1 kHz"', sign="positive")
_TIME: Final = Quantity(unit="s", example='"1 ms"', sign="nonnegative")
_SPAN: Final = Quantity(unit="s", example='"1 ms"', sign="positive")
_LENGTH: Final = Quantity(unit="m", example='"1 mm"', sign="nonnegative")
_SHARE: Final = Quantity(unit="", example="0.0", sign="nonnegative")
_MASS: Final = Quantity(unit="kg", example='"4 kg"', sign="positive")
_STIFFNESS: Final = Quantity(unit="N/m", example='"10 kN/m"', sign="positive")
_DAMPING: Final = Quantity(unit="N*s/m", example='"100 N*s/m"', sign="nonnegative")
_FORCE: Final = Quantity(unit="N", example='"20 N"', sign="positive")
_POWER_LAW: Final = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(\w*N)/(\w*m)(?:\^(\d+\.?\d*))?\s*", re.I
)


class DeferredSection(Section):
    """A section whose validators wait for the first file that has it."""

    model_config = ConfigDict(defer_build=True)


class ChainSection(DeferredSection):
    """What lies between the distance and the controller's readings; None as the part or the calibration has it."""

    part: Annotated[str | None, text('"VCNL4010"')] = None
    rate: Annotated[float | None, _RATE] = None
    phase: Annotated[float | str, Quantity(unit="s", example='"random"', sign="nonnegative", words=("random",))] = (
        "random"
    )
    exposure: Annotated[float | None, _TIME] = None
    delay: Annotated[float | None, _TIME] = None
    jitter: Annotated[float | None, _TIME] = None
    noise: Annotated[float | None, _SPREAD] = None
    relative_noise: Annotated[float | None, _SHARE] = None
    misfit: Annotated[float | None, _SHARE] = None
    misfit_length: Annotated[float | None, _LENGTH] = None
    offset: Annotated[float | None, _OUTPUT] = None
    crosstalk: Annotated[float | None, _OUTPUT] = None
    drift: Annotated[float | None, Quantity(unit="output/s", example="0.0")] = None
    lowest: Annotated[float | None, _END] = None
    highest: Annotated[float | None, _END] = None
    resolution: Annotated[float | None, _SPREAD] = None
    dropout: Annotated[float | None, _SHARE] = None
    reports_distance: Annotated[bool | None, BeforeValidator(truth)] = None
    distance_noise: Annotated[float | None, _LENGTH] = None
    distance_resolution: Annotated[float | None, _LENGTH] = None

    @model_validator(mode="after")
    def _how_often(self) -> Self:
        if self.part is None and self.rate is None:
            raise UnfitValueError('missing rate, expected rate = "250 Hz", or part = "VCNL4010", which has one')
        return self


class ControllerSection(DeferredSection):
    """The sampled law; its virtual admittance is that of [admittance]."""

    rate: Annotated[float | None, _RATE] = None
    period: Annotated[float | None, _SPAN] = None
    floor: Annotated[float | None, Quantity(unit="output", example="30.0", sign="positive")] = None
    offset: Annotated[float | None, _OUTPUT] = None
    saturation: Annotated[float | None, _OUTPUT] = None
    median_window: Annotated[int, whole(1, "3")] = 1
    low_pass_order: Annotated[int, whole(0, "2")] = 0
    cutoff: Annotated[float | None, _RATE] = None
    timeout: Annotated[float | None, _SPAN] = None
    fade_time: Annotated[float | None, _TIME] = None
    largest_rate: Annotated[float | None, Quantity(unit="1/s", example='"100 1/s"', sign="positive")] = None
    approach_only: Annotated[bool, BeforeValidator(truth)] = False
    release: Annotated[float, _SHARE] = 0.0
    ramp_time: Annotated[float, _TIME] = 0.0
    largest_force: Annotated[float | None, _FORCE] = None
    largest_speed: Annotated[float | None, Quantity(unit="m/s", example='"1 m/s"', sign="positive")] = None
    largest_acceleration: Annotated[float | None, Quantity(unit="m/s^2", example='"10 m/s^2"', sign="positive")] = None
    largest_excursion: Annotated[float | None, Quantity(unit="m", example='"0.2 m"', sign="positive")] = None
    contact_gain: Annotated[float | None, _SHARE] = None
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


class RobotSection(DeferredSection):
    """The robot that follows the virtual object."""

    kind: str


class IdealSection(RobotSection):
    """`kind = "ideal"`: x = x_v, without a mass."""


class ImpedanceSection(RobotSection):
    """`kind = "impedance"`: a mass that an impedance controller pulls after the virtual object."""

    mass: Annotated[float, _MASS]
    stiffness: Annotated[float, _STIFFNESS]
    damping: Annotated[float, _DAMPING]
    bandwidth: Annotated[float, Quantity(unit="Hz", example='"100 Hz"', sign="positive", infinite=True)] = math.inf
    viscous_friction: Annotated[float, _DAMPING] = 0.0
    coulomb_friction: Annotated[float, Quantity(unit="N", example='"1 N"', sign="nonnegative")] = 0.0
    friction_speed: Annotated[float, Quantity(unit="m/s", example='"1 mm/s"', sign="positive")] = 1e-3
    feedforward: Annotated[bool, BeforeValidator(truth)] = True


class PositionSection(RobotSection):
    """`kind = "position"`: a position-controlled robot, a lag of second order."""

    mass: Annotated[float, _MASS]
    bandwidth: Annotated[float, Quantity(unit="Hz", example='"20 Hz"', sign="positive")]
    damping_ratio: Annotated[float, Quantity(unit="", example="1.0", sign="positive")] = 1.0


class ContactSection(DeferredSection):
    """The contact force between robot and obstacle."""

    kind: str
    obstacle_mass: Annotated[float, Quantity(unit="kg", example='"inf"', sign="positive", infinite=True)] = math.inf


class HuntCrossleySection(ContactSection):
    """`kind = "hunt-crossley"`: F = k d^n (1 + a d'). The unit of k follows from the exponent, which is read first."""

    exponent: Annotated[float, Quantity(unit="", example="1.5", sign="positive")] = 1.5
    stiffness: Annotated[float, Quantity(unit="N/m^n", example='"1e6 N/m^1.5"', sign="positive")]
    dissipation: Annotated[float, Quantity(unit="s/m", example='"0.5 s/m"', sign="nonnegative")] = 0.0

    @field_validator("stiffness", mode="before")
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


class SpringDamperSection(ContactSection):
    """`kind = "spring-damper"`: F = max(0, k d + c d')."""

    stiffness: Annotated[float, _STIFFNESS]
    damping: Annotated[float, _DAMPING] = 0.0


class LoopSection(DeferredSection):
    """How the loop is run, and how far from instability the gain is to stay."""

    runs: Annotated[int, whole(1, "1000")] = 1000
    seed: Annotated[int, whole(0, "0")] = 0
    horizon: Annotated[float, _SPAN] = 10.0
    follow: Annotated[float, _TIME] = 0.2
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


ROBOT_SECTIONS: Final[dict[str, type[Section]]] = {
    "ideal": IdealSection,
    "impedance": ImpedanceSection,
    "position": PositionSection,
}
CONTACT_SECTIONS: Final[dict[str, type[Section]]] = {
    "hunt-crossley": HuntCrossleySection,
    "spring-damper": SpringDamperSection,
}
"""The variants that each `kind` takes."""
