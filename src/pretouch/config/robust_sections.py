"""Define the keys of the sections `[uncertainty]` and `[robust]` of a scenario file.

The keys of [uncertainty] are the inputs of `pretouch.motion.scenario`, each with its unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import partial
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import INPUT
from pretouch._core.units import written_unit
from pretouch.designs.options import RobustOptions
from pretouch.designs.quantities import CONSTRAINT_NAMES
from pretouch.designs.robust.measures import ConditionalValueAtRisk, Expected, Measure, Quantile, WorstCase
from pretouch.motion.scenario import SCENARIO_INPUTS
from pretouch.sensors import sensor_curves
from pretouch.uncertainty.correlated import DISTRIBUTION_KINDS
from pretouch.uncertainty.ensemble import SAMPLINGS

from .quantities import Quantity, UnfitValueError, value_text
from .section import Key, Section, declared_keys, list_of, name_of, whole

FROM_CALIBRATION: Final = "parameters"
"""The key of [uncertainty] `sensor` that selects the covariance of the calibration."""

_EXAMPLES: Final[Mapping[str, str]] = {
    "kg": '"1 kg", "0.1 kg"',
    "N*s/m": '"10 N*s/m", "1 N*s/m"',
    "N/m": '"25 N/m", "2 N/m"',
    "rad/s": '"5 rad/s", "0.5 rad/s"',
    "m": '"42 mm", "1 mm"',
    "m/s": '"-0.3 m/s", "0.1 m/s"',
    "m/s^2": '"0 m/s²", "0.1 m/s²"',
    "1/m": '"-61 1/m", "2 1/m"',
    "1/m^2": '"474 1/m²", "20 1/m²"',
    "": "3.3, 0.1",
}
_INPUT_EXAMPLES: Final = {
    "admittance": 'damping = { interval = ["9 N*s/m", "11 N*s/m"] }',
    "obstacle": 'velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
    "plant": 'velocity = { uniform = ["0 m/s", "1 cm/s"] }',
    "reference": 'position = { uniform = ["-1 mm", "1 mm"] }',
    "sensor": "exponent = { normal = [3.3, 0.1] }",
}
"""An example of an uncertain input for each part of an encounter, for messages."""


def _check_distribution(values: Mapping[str, Any]) -> None:
    """Check the distribution of an uncertain input."""
    kinds = [kind for kind in values if kind != "between"]
    if len(kinds) != 1:
        what = " and ".join(kinds) or ("between alone" if "between" in values else "nothing")
        raise UnfitValueError(f"found {what}, expected exactly one of {', '.join(DISTRIBUTION_KINDS.names())}")
    if "between" in values and "normal" not in values:
        raise UnfitValueError(
            f'the key "between" is allowed only with the key "normal", not with the key "{kinds[0]}". Reason: '
            '"between" truncates a normal distribution',
            "between",
        )
    for key in ("uniform", "interval", "between"):
        pair = values.get(key)
        if pair is not None and not pair[0] < pair[1]:
            raise UnfitValueError(
                f"found the number {pair[0]:g} before the number {pair[1]:g}, expected the smaller number first", key
            )
    if "normal" in values and not values["normal"][1] > 0:
        deviation = values["normal"][1]
        raise UnfitValueError(
            f"found a standard deviation of {deviation:g}, expected a number above 0. The list contains the mean, "
            "then the standard deviation",
            "normal",
        )


def _distribution_section(unit: str) -> Section:
    """Describe the scenario-file keys of a probability distribution."""
    what = f"quantities in {written_unit(unit)}" if unit else "numbers"
    example = f"[{_EXAMPLES.get(unit, _EXAMPLES[''])}]"
    pair = f"a list of two {what}, the smaller one first"
    number, cut = Quantity(unit), Quantity(unit, infinite=True)
    return Section(
        {
            "normal": Key(
                list_of(
                    number,
                    2,
                    2,
                    f"a list of two {what}: the mean and the standard deviation, such as {example}",
                )
            ),
            "uniform": Key(list_of(number, 2, 2, pair)),
            "interval": Key(list_of(number, 2, 2, pair)),
            "samples": Key(list_of(number, 2, None, f"a list of two or more {what}")),
            "between": Key(list_of(cut, 2, 2, pair)),
        },
        _check_distribution,
        example="{ uniform = [smallest, largest] } or { normal = [mean, standard deviation] }",
        more=(DISTRIBUTION_KINDS, partial(_described_distribution, unit)),
    )


def _described_distribution(unit: str, name: str) -> Key | None:
    """Return the scenario-file key for a distribution from an installed package."""
    described = DISTRIBUTION_KINDS.find(name)
    if described is None:
        return None
    keys = declared_keys(described)
    for name_of_field, key in keys.items():
        if isinstance(key.read, Quantity) and key.read.unit == INPUT:
            keys[name_of_field] = replace(key, read=replace(key.read, unit=unit))
    section = Section(keys, example="{ " + ", ".join(f"{name_of_field} = ..." for name_of_field in keys) + " }")

    def read(table: Any) -> Any:
        values = section(table)
        try:
            return described(**values)
        except InvalidInputError as error:
            raise UnfitValueError(str(error)) from None

    return Key(read)


def _from_calibration(value: Any) -> Any:
    if value != "calibration":
        raise UnfitValueError('expected "calibration", for the covariance of the fitted curve')
    return value


def _inputs(part: str) -> dict[str, str]:
    """Return the inputs that may be uncertain in a scenario section. The result has the unit of each input.

    Examples of sections are the obstacle and the sensor. A sensor has the inputs of all curves, but no scale, which
    cancels from the slope.
    """
    if part != "sensor":
        units = {tuple(name.split(".")): unit for name, unit in SCENARIO_INPUTS.items()}
        return {name: unit for (of, name), unit in units.items() if of == part}
    parameters = [f for curve in sensor_curves(foreign=True).values() for f in fields(curve) if "unit" in f.metadata]
    return {f.name: f.metadata["unit"] for f in parameters if f.metadata["of_output"] is None} | {"recess": "m"}


def _part(part: str) -> Callable[[Any], Any]:
    """Make a parser for the uncertain inputs of a scenario section."""
    keys = {name: Key(_distribution_section(unit)) for name, unit in _inputs(part).items()}
    section = Section(keys | ({FROM_CALIBRATION: Key(_from_calibration)} if part == "sensor" else {}))

    def read(value: Any) -> Any:
        if value == "calibration" and part == "sensor":
            raise UnfitValueError(f'expected {part}.{FROM_CALIBRATION} = "calibration"')
        if not isinstance(value, dict):
            raise UnfitValueError(f"expected inputs such as {part}.{_INPUT_EXAMPLES[part]}")
        return section(value)

    return read


def uncertainty_section() -> Section:
    """Describe the section [uncertainty] of a scenario file."""
    return Section({part: Key(_part(part)) for part in _INPUT_EXAMPLES})


def read_probability(value: Any) -> float:
    """Parse a probability between 0 and 1.

    Returns:
        The probability; 0 and 1 are not allowed.

    Raises:
        UnfitValueError: the value is not such a probability.
    """
    number = Quantity("")(value)
    if not (isinstance(number, float) and 0 < number < 1):
        raise UnfitValueError("expected a probability between 0 and 1, such as 0.95")
    return number


def _required(value: Any) -> dict[str, float]:
    """Parse the required probability of each constraint."""
    if not isinstance(value, Mapping):
        raise UnfitValueError("expected constraints and probabilities, such as { relative_velocity = 0.99 }")
    for name, number in value.items():
        if name not in CONSTRAINT_NAMES:
            names = ", ".join(CONSTRAINT_NAMES)
            raise UnfitValueError(f"found a constraint {value_text(name)}, expected one of {names}", name)
        if type(number) not in {int, float} or not 0 < number <= 1:
            raise UnfitValueError(
                f"found the probability {value_text(number)}, expected a number greater than 0 and at most 1, such as "
                "0.99",
                name,
            )
    return {name: float(number) for name, number in value.items()}


def _check_measure(values: Mapping[str, Any]) -> None:
    measure = values.get("measure", "expected")
    needs_probability = measure in {"quantile", "tail-mean"}
    if needs_probability and "probability" not in values:
        raise UnfitValueError(
            f"the risk measure {measure} needs a probability, but the key probability is missing; add, "
            "for example: probability = 0.9"
        )
    if not needs_probability and "probability" in values:
        raise UnfitValueError(
            f"the risk measure {measure} does not use a probability; remove the key probability, or use "
            "the measure quantile or tail-mean",
            "probability",
        )


def _robust_options(
    measure: str,
    probability: float = 0.0,
    required: Any = None,  # noqa: ARG001 - belongs to the constraints
    **others: Any,
) -> RobustOptions:
    return RobustOptions(measure=_measure(measure, probability), **others)


def _measure(name: str, probability: float) -> Measure:
    if name == "quantile":
        return Quantile(probability=probability)
    if name == "tail-mean":
        return ConditionalValueAtRisk(probability=probability)
    return WorstCase() if name == "worst-case" else Expected()


ROBUST: Final = Section(
    {
        "measure": Key(name_of("expected", "quantile", "tail-mean", "worst-case"), "expected"),
        "probability": Key(read_probability),
        "samples": Key(whole(2, "4096"), 4096),
        "validation": Key(whole(2, "4096"), 4096),
        "seed": Key(whole(0, "0"), 0),
        "sampling": Key(name_of(*SAMPLINGS), "sobol"),
        "confidence": Key(read_probability, 0.95),
        "required": Key(_required),
    },
    _check_measure,
    _robust_options,
)
"""The measure of an objective over uncertain encounters, and the sampling of these encounters."""
