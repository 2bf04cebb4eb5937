"""What a sweep holds where no axis says otherwise, and how one input of it is changed."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Final

from pretouch.design import QUANTITY_UNITS, Constraint, ImpactModel, Objective
from pretouch.motion import Scenario
from pretouch.motion.inputs import SCENARIO_INPUTS, sensor_inputs, sensor_with
from pretouch.sensors import SensorModel

__all__ = ["ENCOUNTER_INPUTS", "Held", "with_input"]

ENCOUNTER_INPUTS: Final = {"gain": "N*s", **SCENARIO_INPUTS}
"""The inputs that differ from encounter to encounter within one call of the solver, with their SI units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """The encounter, the sensor and what is asked for, as given.

    Args:
        scenario: one encounter.
        sensor: the sensor curve.
        gain: D_p [N s] of every encounter; None where an axis or a design gives it.
        objective: what designs minimize; None where contacts are asked for.
        bounds: gains between which designs look [N s].
        constraints: limits that designs keep.
        impact: physical properties, for forces.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].
    """

    scenario: Scenario
    sensor: SensorModel
    gain: float | None = None
    objective: Objective | None = None
    bounds: tuple[float, float] | None = None
    constraints: tuple[Constraint, ...] = ()
    impact: ImpactModel | None = None
    method: str = "auto"
    horizon: float = 600.0

    def inputs(self) -> dict[str, str]:
        """Return every input that may be an axis, with its SI unit."""
        found = {**ENCOUNTER_INPUTS, **sensor_inputs(self.sensor)}
        if self.objective is not None:
            del found["gain"]
        if self.impact is not None:
            found |= {f"impact.{f.name}": _IMPACT_UNITS.get(f.name, "") for f in fields(self.impact)}
        if self.objective is not None:
            found |= {f"constraint.{c.name}": c.unit for c in self.constraints}
            for term in self.objective.terms:
                found[f"objective.{term.quantity}.weight"] = ""
                found[f"objective.{term.quantity}.scale"] = QUANTITY_UNITS[term.quantity]
        return found


_IMPACT_UNITS: Final = {
    "robot_mass": "kg",
    "obstacle_mass": "kg",
    "stiffness": "N/m",
    "effective_modulus": "Pa",
    "radius": "m",
}


def with_input(held: Held, name: str, value: float) -> Held:
    """Change an input that one call of the solver takes once: of the sensor, the impact, a limit or the objective.

    Args:
        held: what is changed.
        name: the input, such as `sensor.exponent`.
        value: its new value in SI.

    Returns:
        The changed copy.
    """
    part, _, rest = name.partition(".")
    if part == "sensor":
        return replace(held, sensor=sensor_with(held.sensor, {rest: value}))
    if part == "impact":
        impact: Any = held.impact
        return replace(held, impact=replace(impact, **{rest: value}))
    if part == "constraint":
        changed = (Constraint(name=c.name, limit=value) if c.name == rest else c for c in held.constraints)
        return replace(held, constraints=tuple(changed))
    objective: Any = held.objective
    quantity, _, attribute = rest.rpartition(".")
    terms = (replace(t, **{attribute: value}) if t.quantity == quantity else t for t in objective.terms)
    return replace(held, objective=replace(objective, terms=tuple(terms)))
