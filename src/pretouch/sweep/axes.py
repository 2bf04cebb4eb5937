"""The inputs of a task that may be swept, and the axes over them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from difflib import get_close_matches
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import read_quantity
from pretouch._core.values import Value
from pretouch.design import QUANTITY_UNITS, Constraint, Task
from pretouch.motion.scenario import SCENARIO_INPUTS, sensor_inputs, sensor_with

ENCOUNTER_INPUTS: Final = {"gain", *SCENARIO_INPUTS}
"""The inputs that differ from encounter to encounter within one call of the solver."""


def inputs_of(task: Task) -> dict[str, str]:
    """Return every input of a task that may be an axis, with its SI unit; without an objective, contacts are found."""
    found = {"gain": task.law.number.unit, **SCENARIO_INPUTS, **sensor_inputs(task.sensor)}
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


_MOST: Final = 10_000_000  # values of one axis on the command line: 80 MB
_DIGITS: Final = 20
_FORM: Final = "expected NAME=START:STOP:COUNT, with :log for equal ratios, or NAME=VALUE,VALUE,..."

Axes: TypeAlias = Mapping[str, ArrayLike | Mapping[str, ArrayLike]]
"""Input names and their values; or a free name and a mapping of inputs whose values belong together one by one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis(Value):
    """One dimension of the grid.

    Args:
        name: of the dimension: the input itself, or a free name such as `sample`.
        columns: the inputs that change along it, each with its values in SI, shape (n,).
        zipped: whether the name is free and the inputs go side by side.
    """

    name: str
    columns: Mapping[str, FloatArray]
    zipped: bool = False

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    @property
    def looped(self) -> bool:
        """Whether one call of the solver takes a single value of it, as of a parameter of the sensor."""
        return any(name not in ENCOUNTER_INPUTS for name in self.columns)

    def at(self, which: slice | FloatArray | Any) -> Axis:
        """Return some of its values."""
        return replace(self, columns={name: values[which] for name, values in self.columns.items()})


def make_axes(axes: Axes, held: Task) -> tuple[Axis, ...]:
    """Check axes as they were given; raise InvalidInputError where one is no input of the task, or has no values."""
    if not axes:
        raise InvalidInputError(
            'axes: found none, expected input names and values, such as {"obstacle.velocity": [-0.3, -0.2]}'
        )
    known = inputs_of(held)
    found = tuple(_axis(str(name), given, known) for name, given in axes.items())
    names = [name for axis in found for name in axis.columns]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InvalidInputError(f"axes: found {twice} twice, expected every input once")
    return found


def _axis(name: str, given: Any, known: Mapping[str, str]) -> Axis:
    if not isinstance(given, Mapping):
        return Axis(name=name, columns={name: _values(name, given, known)})
    if not re.fullmatch(r"[A-Za-z_]\w*", name) or name in known:
        raise InvalidInputError(
            f"axes: found {name!r} for inputs side by side, expected a name of its own such as 'sample'"
        )
    columns = {str(member): _values(str(member), values, known) for member, values in given.items()}
    lengths = {member: len(values) for member, values in columns.items()}
    if not columns or len(set(lengths.values())) > 1:
        listed = ", ".join(f"{n} values of {member}" for member, n in lengths.items()) or "no input"
        raise InvalidInputError(f"axes: found {listed} along {name}, expected inputs with as many values each")
    return Axis(name=name, columns=columns, zipped=True)


def _values(name: str, given: Any, known: Mapping[str, str]) -> FloatArray:
    values = np.atleast_1d(finite(given, name, _unit(name, known, "axes")))
    if values.ndim != 1 or not len(values):
        raise InvalidInputError(f"{name}: found values of shape {values.shape}, expected one row of one value or more")
    values.setflags(write=False)
    return values


def _unit(name: str, known: Mapping[str, str], told: str) -> str:
    """Return the unit of an input, or say which inputs there are."""
    if name not in known:
        alike = [one for one in known if one.rpartition(".")[2] == name]
        near = sorted(alike, key=lambda one: not one.startswith("obstacle.")) or get_close_matches(name, known, n=1)
        hint = f"did you mean {' or '.join(near)}?" if near else f"expected one of {', '.join(known)}"
        raise InvalidInputError(f"{told}: found {name!r}, which is no input of this sweep; {hint}")
    return known[name]


def read_axis(text: str, units: Mapping[str, str]) -> tuple[str, FloatArray]:
    """Read the name of an input and its values, as they are written on the command line.

    Args:
        text: `NAME=START:STOP:COUNT`, `NAME=START:STOP:COUNT:log` or `NAME=VALUE,VALUE,...`; values with their units,
            or bare in SI. Both ends are among the values.
        units: the SI unit of every input that may be named.

    Returns:
        The name and the values in SI.

    Raises:
        InvalidInputError: the text is not of that form, or the input is unknown.

    Examples:
        >>> name, values = read_axis("obstacle.velocity=-1 m/s:-1 cm/s:100", {"obstacle.velocity": "m/s"})
        >>> len(values), float(values[0]), float(values[-1])
        (100, -1.0, -0.01)
    """
    name, equals, given = (part.strip() for part in text.partition("="))
    if not (name and equals and given):
        raise InvalidInputError(f"--axis: found {text!r}, {_FORM}")
    unit = _unit(name, units, "--axis")
    parts = [part.strip() for part in given.split(":")]
    if len(parts) == 1:
        return name, np.array([read_quantity(part.strip(), unit, name=name) for part in given.split(",")])
    if len(parts) not in {3, 4} or parts[3:] not in ([], ["log"]):
        raise InvalidInputError(f"--axis: found {text!r}, {_FORM}")
    start, stop = (read_quantity(part, unit, name=name) for part in parts[:2])
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise InvalidInputError(f"--axis: found {text!r}, expected finite ends")
    count = int(parts[2]) if parts[2].isdecimal() and len(parts[2]) < _DIGITS else 0
    if not 1 <= count <= _MOST:
        raise InvalidInputError(
            f"--axis: found {parts[2]!r} values of {name}, expected a whole number from 1 to {_MOST:,}"
        )
    if not parts[3:]:
        return name, np.linspace(start, stop, count)
    if not start * stop > 0:
        raise InvalidInputError(f"--axis: found {text!r}, expected ends of one sign and not zero for equal ratios")
    return name, np.geomspace(start, stop, count)
