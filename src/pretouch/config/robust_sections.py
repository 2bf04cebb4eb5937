"""The sections [uncertainty] and [robust] of a scenario file: what is known of inputs, and what must hold all the same.

The keys of [uncertainty] are the inputs of `pretouch.motion.scenario`, each with its unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, Final

from pretouch.design.constraints import CONSTRAINT_NAMES
from pretouch.motion.scenario import SCENARIO_INPUTS
from pretouch.sensors import known_curves
from pretouch.uncertainty.ensemble import SAMPLINGS

from .quantities import Quantity, UnfitValueError, shown
from .section import Key, Section, list_of, name_of, whole

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
_FIRST: Final = {
    "admittance": 'damping = { interval = ["9 N*s/m", "11 N*s/m"] }',
    "obstacle": 'velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }',
    "plant": 'velocity = { uniform = ["0 m/s", "1 cm/s"] }',
    "reference": 'position = { uniform = ["-1 mm", "1 mm"] }',
    "sensor": "exponent = { normal = [3.3, 0.1] }",
}
"""The parts of an encounter, each with an input that messages show."""


def _one_way(given: Mapping[str, Any]) -> None:
    """Hold what is known of an input: exactly one of four ways to say it, and where a normal distribution is cut."""
    ways = [kind for kind in _KINDS if kind in given]
    if len(ways) != 1:
        what = " and ".join(ways) or ("between alone" if "between" in given else "nothing")
        raise UnfitValueError(f"found {what}, expected exactly one of {', '.join(_KINDS)}")
    if "between" in given and "normal" not in given:
        raise UnfitValueError(
            f"found between beside {ways[0]}, expected it beside normal only, which it cuts", "between"
        )
    for key in ("uniform", "interval", "between"):
        pair = given.get(key)
        if pair is not None and not pair[0] < pair[1]:
            raise UnfitValueError(f"found {pair[0]:g} before {pair[1]:g}, expected the smaller one first", key)
    if "normal" in given and not given["normal"][1] > 0:
        deviation = given["normal"][1]
        raise UnfitValueError(
            f"found a standard deviation of {deviation:g}, expected a positive one, after the mean", "normal"
        )


def _known(unit: str) -> Section:
    """Return the table of an input in a unit."""
    what = f"quantities in {unit}" if unit else "numbers"
    example = f"[{_EXAMPLES.get(unit, _EXAMPLES[''])}]"
    pair = f"a list of two {what}, the smaller one first"
    one, cut = Quantity(unit), Quantity(unit, infinite=True)
    return Section(
        {
            "normal": Key(list_of(one, 2, 2, f"a list of two {what}, mean and standard deviation, such as {example}")),
            "uniform": Key(list_of(one, 2, 2, pair)),
            "interval": Key(list_of(one, 2, 2, pair)),
            "samples": Key(list_of(one, 2, None, f"a list of two or more {what}")),
            "between": Key(list_of(cut, 2, 2, pair)),
        },
        _one_way,
        example="{ uniform = [smallest, largest] } or { normal = [mean, standard deviation] }",
    )


def _from_calibration(value: Any) -> Any:
    if value != "calibration":
        raise UnfitValueError('expected "calibration": the covariance of the fitted curve')
    return value


def _inputs(part: str) -> dict[str, str]:
    """Return the inputs of a part with their units: of a sensor those of all curves but the scale, which cancels."""
    if part != "sensor":
        units = {tuple(name.split(".")): unit for name, unit in SCENARIO_INPUTS.items()}
        return {name: unit for (of, name), unit in units.items() if of == part}
    known = [f for curve in known_curves(foreign=True).values() for f in fields(curve) if "unit" in f.metadata]
    return {f.name: f.metadata["unit"] for f in known if f.metadata["of_output"] is None} | {"recess": "m"}


def _part(part: str) -> Callable[[Any], Any]:
    """Return what reads a part's inputs: a table, since TOML allows `sensor = "calibration"` only instead of one."""
    keys = {name: Key(_known(unit)) for name, unit in _inputs(part).items()}
    section = Section(keys | ({FROM_CALIBRATION: Key(_from_calibration)} if part == "sensor" else {}))

    def read(value: Any) -> Any:
        if value == "calibration" and part == "sensor":
            raise UnfitValueError(f'expected {part}.{FROM_CALIBRATION} = "calibration"')
        if not isinstance(value, dict):
            raise UnfitValueError(f"expected inputs such as {part}.{_FIRST[part]}")
        return section(value)

    return read


def uncertainty_section() -> Section:
    """Return [uncertainty], a table of inputs for each part of the encounter, foreign curves included."""
    return Section({part: Key(_part(part)) for part in _FIRST})


def _share(value: Any) -> float:
    """Read a probability between 0 and 1, both left out."""
    number = Quantity("")(value)
    if not (isinstance(number, float) and 0 < number < 1):
        raise UnfitValueError("expected a probability between 0 and 1, such as 0.95")
    return number


def _required(value: Any) -> dict[str, float]:
    """Read the probabilities by the names of constraints."""
    if not isinstance(value, Mapping):
        raise UnfitValueError("expected constraints and probabilities, such as { relative_velocity = 0.99 }")
    for name, number in value.items():
        if name not in CONSTRAINT_NAMES:
            known = ", ".join(CONSTRAINT_NAMES)
            raise UnfitValueError(f"found a constraint {shown(name)}, expected one of {known}", name)
        if type(number) not in {int, float} or not 0 < number <= 1:
            raise UnfitValueError(
                f"found {shown(number)}, expected a probability above 0 and at most 1, such as 0.99", name
            )
    return {name: float(number) for name, number in value.items()}


def _with_probability(given: Mapping[str, Any]) -> None:
    measure = given.get("measure", "expected")
    asks = measure in {"quantile", "tail-mean"}
    if asks and "probability" not in given:
        raise UnfitValueError(f"missing probability, which {measure} needs; add, for example: probability = 0.9")
    if not asks and "probability" in given:
        raise UnfitValueError(
            f"found a probability beside {measure}, expected it with quantile or tail-mean only", "probability"
        )


ROBUST: Final = Section(
    {
        "measure": Key(name_of("expected", "quantile", "tail-mean", "worst-case"), "expected"),
        "probability": Key(_share),
        "samples": Key(whole(2, "4096"), 4096),
        "validation": Key(whole(2, "4096"), 4096),
        "seed": Key(whole(0, "0"), 0),
        "sampling": Key(name_of(*SAMPLINGS), "sobol"),
        "confidence": Key(_share, 0.95),
        "required": Key(_required),
    },
    _with_probability,
)
"""What is made of an objective that differs from encounter to encounter, and how it is sampled."""
