"""The sections [uncertainty] and [robust] of a scenario file: what is known of inputs, and what must hold all the same.

The keys of [uncertainty] are the inputs of `pretouch.motion.inputs`, each with its unit. Their models are made when a
file has that section: most have not, and should not wait for them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import lru_cache
from typing import Annotated, Any, Final, Self

from pydantic import BeforeValidator, Field, create_model, model_validator

from pretouch.design.constraints import CONSTRAINT_NAMES
from pretouch.motion.inputs import SCENARIO_INPUTS
from pretouch.sensors import known_curves
from pretouch.uncertainty.sampling import SAMPLINGS

from .quantities import Quantity, UnfitValueError, shown
from .section import Section, list_of, name_of, whole

__all__ = [
    "FROM_CALIBRATION",
    "MEASURES",
    "KnownInput",
    "RobustSection",
    "UncertaintySection",
    "uncertainty_section",
]

MEASURES: Final = ("expected", "quantile", "tail-mean", "worst-case")
FROM_CALIBRATION: Final = "parameters"
"""The key of [uncertainty] `sensor` that takes the covariance of the calibration."""

_KINDS: Final = ("normal", "uniform", "interval", "samples")
_EXAMPLES: Final[Mapping[str, str]] = {
    "kg": '"1 kg", "0.1 kg"',
    "N*s/m": '"10 N*s/m", "1 N*s/m"',
    "N/m": '"25 N/m", "2 N/m"',
    "rad/s": '"5 rad/s", "0.5 rad/s"',
    "m": '"42 mm", "1 mm"',
    "m/s": '"-0.3 m/s", "0.1 m/s"',
    "m/s^2": '"0 m/s^2", "0.1 m/s^2"',
    "1/m": '"-61 1/m", "2 1/m"',
    "1/m^2": '"474 1/m^2", "20 1/m^2"',
    "": "3.3, 0.1",
}


class KnownInput(Section):
    """What is known of one input: exactly one of four ways to say it, and where a normal distribution is cut."""

    normal: list[float] | None = None
    uniform: list[float] | None = None
    interval: list[float] | None = None
    samples: list[float] | None = None
    between: list[float] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = [kind for kind in _KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            what = " and ".join(given) or ("between alone" if self.between else "nothing")
            raise UnfitValueError(f"found {what}, expected exactly one of {', '.join(_KINDS)}")
        if self.between is not None and self.normal is None:
            raise UnfitValueError(
                f"found between beside {given[0]}, expected it beside normal only, which it cuts", "between"
            )
        for key in ("uniform", "interval", "between"):
            pair = getattr(self, key)
            if pair is not None and not pair[0] < pair[1]:
                raise UnfitValueError(f"found {pair[0]:g} before {pair[1]:g}, expected the smaller one first", key)
        if self.normal is not None and not self.normal[1] > 0:
            raise UnfitValueError(
                f"found a standard deviation of {self.normal[1]:g}, expected a positive one, after the mean", "normal"
            )
        return self


@lru_cache(maxsize=32)
def _known(unit: str) -> type[KnownInput]:
    """Make the model of an input of a unit."""
    one = Quantity(unit=unit, example="")
    what = f"quantities in {unit}" if unit else "numbers"
    example = f"[{_EXAMPLES.get(unit, _EXAMPLES[''])}]"
    pair = list_of(2, 2, f"a list of two {what}, the smaller one first")
    mean = list_of(2, 2, f"a list of two {what}, mean and standard deviation, such as {example}")
    cut = Annotated[float, Quantity(unit=unit, example="", infinite=True)]
    several = list_of(2, None, f"a list of two or more {what}")
    fields: dict[str, Any] = {
        "normal": (Annotated[list[Annotated[float, one]] | None, mean], None),
        "uniform": (Annotated[list[Annotated[float, one]] | None, pair], None),
        "interval": (Annotated[list[Annotated[float, one]] | None, pair], None),
        "samples": (Annotated[list[Annotated[float, one]] | None, several], None),
        "between": (Annotated[list[cut] | None, pair], None),
    }
    return create_model("KnownInput", __base__=KnownInput, **fields)


def _from_calibration(value: Any) -> Any:
    if value != "calibration":
        raise UnfitValueError('expected "calibration": the covariance of the fitted curve')
    return value


def _table_of(what: str) -> BeforeValidator:
    """Make the check that inputs stand in a table, since TOML allows `sensor = "calibration"` only instead of one."""

    def check(value: Any) -> Any:
        if value == "calibration" and what == "sensor":
            raise UnfitValueError(f'expected {what}.{FROM_CALIBRATION} = "calibration"')
        if not isinstance(value, dict):
            raise UnfitValueError(f"expected inputs such as {what}.{_FIRST[what]}")
        return value

    return BeforeValidator(check)


_PARTS: Final = {
    part: {name.split(".")[1]: unit for name, unit in SCENARIO_INPUTS.items() if name.startswith(f"{part}.")}
    for part in ("admittance", "obstacle", "plant", "reference")
}
_FIRST: Final = {
    "admittance": 'damping = { interval = ["9 N*s/m", "11 N*s/m"] }',
    "obstacle": 'velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
    "plant": 'velocity = { uniform = ["0 m/s", "1 cm/s"] }',
    "reference": 'position = { uniform = ["-1 mm", "1 mm"] }',
    "sensor": "exponent = { normal = [3.3, 0.1] }",
}


def _inputs(part: str) -> dict[str, str]:
    """Return the inputs of a part with their units: of a sensor those of all curves but the scale, which cancels."""
    if part != "sensor":
        return _PARTS[part]
    known = [f for curve in known_curves(foreign=True).values() for f in fields(curve) if "unit" in f.metadata]
    return {f.name: f.metadata["unit"] for f in known if f.metadata["of_output"] is None} | {"recess": "m"}


def _part(name: str) -> type[Section]:
    keys: dict[str, Any] = {key: (_known(unit) | None, None) for key, unit in _inputs(name).items()}
    if name == "sensor":
        keys[FROM_CALIBRATION] = (Annotated[str | None, BeforeValidator(_from_calibration)], None)
    return create_model(f"Uncertain{name.title()}", __base__=Section, **keys)


class UncertaintySection(Section):
    """[uncertainty]: a table of inputs for each part of the encounter; `uncertainty_section` says what is in them."""

    admittance: Any = None
    obstacle: Any = None
    plant: Any = None
    reference: Any = None
    sensor: Any = None


def uncertainty_section() -> type[UncertaintySection]:
    """Make the model of [uncertainty] with every input in its unit."""
    return _uncertainty_section(tuple(known_curves(foreign=True)))


@lru_cache(maxsize=4)
def _uncertainty_section(_curves: tuple[str, ...]) -> type[UncertaintySection]:
    fields: dict[str, Any] = {
        name: (Annotated[_part(name) | None, _table_of(name)], None) for name in (*_PARTS, "sensor")
    }
    return create_model("UncertaintySection", __base__=UncertaintySection, **fields)


def _share(value: Any) -> float:
    """Read a probability between 0 and 1, both left out."""
    number = Quantity(unit="", example="0.95").read(value)
    if not (isinstance(number, float) and 0 < number < 1):
        raise UnfitValueError("expected a probability between 0 and 1, such as 0.95")
    return number


def _required(value: Any) -> dict[str, float]:
    """Read the probabilities by the names of constraints."""
    if not isinstance(value, Mapping):
        raise UnfitValueError("expected constraints and probabilities, such as { relative_velocity = 0.99 }")
    found = {}
    for name, probability in value.items():
        if name not in CONSTRAINT_NAMES:
            raise UnfitValueError(
                f"found a constraint {shown(name)}, expected one of {', '.join(CONSTRAINT_NAMES)}", str(name)
            )
        number = probability if type(probability) in {int, float} else None
        if number is None or not 0 < number <= 1:
            raise UnfitValueError(
                f"found {shown(probability)}, expected a probability above 0 and at most 1, such as 0.99", str(name)
            )
        found[name] = float(number)
    return found


class RobustSection(Section):
    """What is made of an objective that differs from encounter to encounter, and how it is sampled."""

    measure: Annotated[str, name_of(*MEASURES)] = "expected"
    probability: Annotated[float | None, BeforeValidator(_share)] = None
    samples: Annotated[int, whole(2, "4096")] = 4096
    validation: Annotated[int, whole(2, "4096")] = 4096
    seed: Annotated[int, whole(0, "0")] = 0
    sampling: Annotated[str, name_of(*SAMPLINGS)] = "sobol"
    confidence: Annotated[float, BeforeValidator(_share)] = 0.95
    required: Annotated[dict[str, float], BeforeValidator(_required)] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _with_probability(self) -> Self:
        asks = self.measure in {"quantile", "tail-mean"}
        if asks and self.probability is None:
            raise UnfitValueError(
                f"missing probability, which {self.measure} needs; add, for example: probability = 0.9"
            )
        if not asks and self.probability is not None:
            raise UnfitValueError(
                f"found a probability beside {self.measure}, expected it with quantile or tail-mean only", "probability"
            )
        return self
