"""The inputs of a task that may be an axis of a sweep, and how one of them is changed."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Final

from pretouch.design import QUANTITY_UNITS, Constraint, Task
from pretouch.motion.inputs import SCENARIO_INPUTS, sensor_inputs, sensor_with

__all__ = ["ENCOUNTER_INPUTS", "inputs_of", "with_input"]

ENCOUNTER_INPUTS: Final = {"gain": "N*s", **SCENARIO_INPUTS}
"""The inputs that differ from encounter to encounter within one call of the solver, with their SI units."""


def inputs_of(task: Task) -> dict[str, str]:
    """Return every input of a task that may be an axis, with its SI unit; without an objective, contacts are found."""
    found = {**ENCOUNTER_INPUTS, **sensor_inputs(task.sensor)}
    if task.impact is not None:
        found |= {f"impact.{f.name}": _IMPACT_UNITS.get(f.name, "") for f in fields(task.impact)}
    if task.objective is not None:
        del found["gain"]
        found |= {f"constraint.{c.name}": c.unit for c in task.limits}
        for term in task.goal.terms:
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


def with_input(held: Task, name: str, value: float) -> Task:
    """Change an input that one call of the solver takes once: of the sensor, the impact, a limit or the objective."""
    part, _, rest = name.partition(".")
    if part == "sensor":
        return replace(held, sensor=sensor_with(held.sensor, {rest: value}))
    if part == "impact":
        impact: Any = held.impact
        return replace(held, impact=replace(impact, **{rest: value}))
    if part == "constraint":
        changed = (Constraint(name=c.name, limit=value) if c.name == rest else c for c in held.limits)
        return replace(held, constraints=tuple(changed))
    objective: Any = held.objective
    quantity, _, attribute = rest.rpartition(".")
    terms = (replace(t, **{attribute: value}) if t.quantity == quantity else t for t in objective.terms)
    return replace(held, objective=replace(objective, terms=tuple(terms)))
