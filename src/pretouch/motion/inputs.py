"""The inputs of an encounter by name, with their units, and how they are changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, Final

import numpy as np

from pretouch._core.declared import units_of_fields
from pretouch._core.errors import InvalidInputError
from pretouch.sensors import SensorModel

from .admittance import Admittance
from .scenario import Obstacle, Plant, Reference, Scenario

__all__ = ["SCENARIO_INPUTS", "input_units", "map_fields", "scenario_with", "sensor_inputs", "sensor_with"]

_PARTS: Final = {"admittance": Admittance, "obstacle": Obstacle, "plant": Plant, "reference": Reference}
_FREQUENCY: Final = {"admittance.natural_frequency": "rad/s", "admittance.damping_ratio": ""}
SCENARIO_INPUTS: Final[dict[str, str]] = {
    name: unit
    for part, cls in _PARTS.items()
    for name, unit in (
        *((f"{part}.{name}", unit) for name, unit in units_of_fields(cls).items()),
        *(_FREQUENCY.items() if part == "admittance" else ()),
    )
}
"""The inputs of a scenario with their SI units; those that differ from encounter to encounter within one call."""

_OF_DAMPING: Final = {"admittance.damping", "admittance.stiffness"}


def sensor_inputs(sensor: SensorModel) -> dict[str, str]:
    """Return the parameters of a curve, or of a recessed one, as inputs, `sensor.NAME`, with their SI units."""
    return {f"sensor.{name}": unit for name, unit in sensor.parameter_units.items()}


def input_units(sensor: SensorModel) -> dict[str, str]:
    """Return the SI unit of every input of encounters with a sensor, by name."""
    return {**SCENARIO_INPUTS, **sensor_inputs(sensor)}


def sensor_with(sensor: SensorModel, values: Mapping[str, float]) -> SensorModel:
    """Return a copy of a curve with other parameters, in SI, by names without `sensor.`."""
    return sensor.with_parameters(values)


def map_fields(scenario: Scenario, change: Callable[[Any], Any]) -> Scenario:
    """Return a copy of a scenario with every number or array changed in the same way."""
    parts = {}
    for part in ("admittance", "obstacle", "plant", "reference"):
        body: Any = getattr(scenario, part)
        parts[part] = replace(body, **{f.name: change(getattr(body, f.name)) for f in fields(body)})
    return replace(scenario, **parts)


def scenario_with(scenario: Scenario, values: Mapping[str, Any]) -> Scenario:
    """Change inputs of an encounter; arrays broadcast.

    Mass, damping and stiffness are changed each for itself; where natural frequency or damping ratio is named, the
    other of the two and the mass hold instead.

    Args:
        scenario: one encounter.
        values: input names, keys of SCENARIO_INPUTS, and values in SI.

    Returns:
        The encounters.

    Examples:
        >>> from pretouch.motion import Obstacle
        >>> still = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.04)
        ... )
        >>> scenario_with(still, {"obstacle.velocity": -0.3, "admittance.natural_frequency": 10.0}).admittance
        Admittance(mass=1.0, damping=20.0, stiffness=100.0)
    """
    changes: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        part, _, rest = name.partition(".")
        changes.setdefault(part, {})[rest] = value
    parts: dict[str, Any] = {}
    for part, given in changes.items():
        if part == "admittance":
            parts[part] = _admittance_with(scenario.admittance, given)
        else:
            parts[part] = replace(getattr(scenario, part), **given)
    return replace(scenario, **parts) if parts else scenario


def _admittance_with(admittance: Admittance, given: dict[str, Any]) -> Admittance:
    names = {f"admittance.{name}" for name in given}
    if not names & _FREQUENCY.keys():
        return replace(admittance, **given)
    if names & _OF_DAMPING:
        found = ", ".join(sorted(names - {"admittance.mass"}))
        raise InvalidInputError(
            f"inputs: found {found}, expected either damping and stiffness, or natural frequency and damping ratio"
        )
    if "damping_ratio" in given:
        ratio = given["damping_ratio"]
    elif np.all(np.asarray(admittance.stiffness) > 0):
        ratio = admittance.damping_ratio
    else:
        raise InvalidInputError(
            "inputs: found admittance.natural_frequency for a stiffness of 0 N/m, whose damping ratio is not defined; "
            "give admittance.damping_ratio, too"
        )
    return Admittance.from_natural_frequency(
        mass=given.get("mass", admittance.mass),
        natural_frequency=given.get("natural_frequency", admittance.natural_frequency),
        damping_ratio=ratio,
    )
