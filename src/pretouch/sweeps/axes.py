"""Define the axes of a parameter sweep.

An axis consists of the inputs that vary, and their values.
"""

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
from pretouch.designs import Constraint, Task
from pretouch.motion.scenario import SCENARIO_INPUTS, sensor_inputs, sensor_with

ENCOUNTER_INPUTS: Final = {"gain", *SCENARIO_INPUTS}
"""The inputs that may be arrays in one call of the solver."""


def inputs_of(task: Task) -> dict[str, str]:
    """Return every input that a sweep may vary, with its SI unit.

    `gain` may vary only for a task without an objective.
    """
    units = {"gain": task.law.number.unit, **SCENARIO_INPUTS, **sensor_inputs(task.sensor)}
    if task.impact is not None:
        units |= {f"impact.{f.name}": _IMPACT_UNITS.get(f.name, "") for f in fields(task.impact)}
    if task.objective is not None:
        del units["gain"]
        number = task.law.number
        units |= {f"constraint.{c.name}": number.entry(c.quantity).unit for c in task.limits}
        for term in task.goal.terms:
            units[f"objective.{term.quantity}.weight"] = ""
            units[f"objective.{term.quantity}.scale"] = number.entry(term.quantity).unit
    return units


_IMPACT_UNITS: Final = {
    "robot_mass": "kg",
    "obstacle_mass": "kg",
    "stiffness": "N/m",
    "effective_modulus": "Pa",
    "radius": "m",
}


def with_input(task: Task, name: str, value: float) -> Task:
    """Return a copy of the task with one changed input."""
    part, _, rest = name.partition(".")
    if part == "sensor":
        return replace(task, sensor=sensor_with(task.sensor, {rest: value}))
    if part == "impact":
        impact: Any = task.impact
        return replace(task, impact=replace(impact, **{rest: value}))
    if part == "constraint":
        changed = (Constraint(name=c.name, limit=value) if c.name == rest else c for c in task.limits)
        return replace(task, constraints=tuple(changed))
    objective: Any = task.objective
    quantity, _, attribute = rest.rpartition(".")
    terms = (replace(t, **{attribute: value}) if t.quantity == quantity else t for t in objective.terms)
    return replace(task, objective=replace(objective, terms=tuple(terms)))


_MOST: Final = 10_000_000  # values of one axis on the command line: 80 MB
_DIGITS: Final = 20
_BARE: Final = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*")
_FORM: Final = "expected NAME=START:STOP:COUNT, with :log for logarithmic spacing, or NAME=VALUE,VALUE,..."

Axes: TypeAlias = Mapping[str, ArrayLike | Mapping[str, ArrayLike]]
"""Names of inputs and their values; or a custom name and a mapping of inputs whose values are paired."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis(Value):
    """One axis of a sweep grid, with one or several inputs.

    Several inputs on one axis change together.

    Args:
        name: name of the dimension: an input, or a custom name such as `sample`.
        columns: the inputs that change along the axis, each with its values in SI, shape (n,).
        zipped: whether the axis has a custom name and several inputs with paired values.
    """

    name: str
    columns: Mapping[str, FloatArray]
    zipped: bool = False

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    @property
    def looped(self) -> bool:
        """True if each value of this axis needs its own solver call.

        An example is an axis with a sensor parameter.
        """
        return any(name not in ENCOUNTER_INPUTS for name in self.columns)

    def at(self, which: slice | FloatArray | Any) -> Axis:
        """Return the sweep axis with only some of its values."""
        return replace(self, columns={name: values[which] for name, values in self.columns.items()})


def make_axes(axes: Axes, task: Task) -> tuple[Axis, ...]:
    """Check and return the axes of a sweep.

    Returns:
        The axes.

    Raises:
        InvalidInputError: an input is unknown, or values are missing or invalid.
    """
    if not axes:
        raise InvalidInputError(
            'axes: found none, expected input names and values, such as {"obstacle.velocity": [-0.3, -0.2]}'
        )
    units = inputs_of(task)
    checked = tuple(_axis(str(name), values, units) for name, values in axes.items())
    names = [name for axis in checked for name in axis.columns]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InvalidInputError(
            f"axes: the input {twice} is on two axes, expected one axis for each input; remove the input from one axis"
        )
    return checked


def _axis(name: str, values: Any, units: Mapping[str, str]) -> Axis:
    if not isinstance(values, Mapping):
        return Axis(name=name, columns={name: _values(name, values, units)})
    if not re.fullmatch(r"[A-Za-z_]\w*", name) or name in units:
        raise InvalidInputError(
            f"axes: found {name!r} as the name of an axis of paired inputs. Use letters, digits and underscores, for "
            "example 'sample'. The name of an input is not allowed",
            value=name,
        )
    columns = {str(member): _values(str(member), column, units) for member, column in values.items()}
    lengths = {member: len(column) for member, column in columns.items()}
    if not columns or len(set(lengths.values())) > 1:
        listed = ", ".join(f"{n} values of {member}" for member, n in lengths.items()) or "no input"
        raise InvalidInputError(
            f"axes: found {listed} on the axis {name}, expected the same number of values for each input of the axis",
            value=lengths,
        )
    return Axis(name=name, columns=columns, zipped=True)


def _values(name: str, values: Any, units: Mapping[str, str]) -> FloatArray:
    column = np.atleast_1d(finite(values, name, _unit(name, units, "axes")))
    if column.ndim != 1 or not len(column):
        raise InvalidInputError(
            f"{name}: found an array of shape {column.shape}, expected a list of one or more values"
        )
    column.setflags(write=False)
    return column


def _unit(name: str, units: Mapping[str, str], option: str) -> str:
    """Return the unit of a sweep input. For an unknown input, the error suggests similar names."""
    if name not in units:
        similar = [key for key in units if key.rpartition(".")[2] == name]
        near = sorted(similar, key=lambda n: not n.startswith("obstacle.")) or get_close_matches(name, units, n=1)
        if near:
            raise InvalidInputError(
                f"{option}: the name {name!r} is not an input of this sweep; did you mean {' or '.join(near)}?",
                value=name,
                limit=tuple(units),
                remedy=near[0],
            )
        raise InvalidInputError(
            f"{option}: the name {name!r} is not an input of this sweep; expected one of {', '.join(units)}",
            value=name,
            limit=tuple(units),
        )
    return units[name]


def read_axis(text: str, units: Mapping[str, str]) -> tuple[str, FloatArray]:
    """Parse a sweep axis from a command line argument.

    Args:
        text: `NAME=START:STOP:COUNT`, `NAME=START:STOP:COUNT:log` or `NAME=VALUE,VALUE,...`; values with units, or bare
            in SI. START and STOP are included. In `30,40,50 mm`, the last unit applies to all.
        units: the SI unit of every allowed input.

    Returns:
        The name and the values in SI.

    Raises:
        InvalidInputError: the text has another form, or the input is unknown.

    Examples:
        >>> name, values = read_axis("obstacle.velocity=-1 m/s:-1 cm/s:100", {"obstacle.velocity": "m/s"})
        >>> len(values), float(values[0]), float(values[-1])
        (100, -1.0, -0.01)
        >>> read_axis("obstacle.position=30,40,50 mm", {"obstacle.position": "m"})[1].round(6).tolist()
        [0.03, 0.04, 0.05]
    """
    name, equals, values = (part.strip() for part in text.partition("="))
    if not (name and equals and values):
        raise InvalidInputError(f"--axis: found {text!r}, {_FORM}", value=text)
    unit = _unit(name, units, "--axis")
    parts = [part.strip() for part in values.split(":")]
    if len(parts) == 1:
        return name, np.array([read_quantity(each, unit, name=name) for each in _with_unit(values.split(","))])
    if len(parts) not in {3, 4} or parts[3:] not in ([], ["log"]):
        raise InvalidInputError(f"--axis: found {text!r}, {_FORM}", value=text)
    start, stop = (read_quantity(part, unit, name=name) for part in _with_unit(parts[:2]))
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise InvalidInputError(f"--axis: found {text!r}, expected finite ends", value=text)
    count = int(parts[2]) if parts[2].isdecimal() and len(parts[2]) < _DIGITS else 0
    if not 1 <= count <= _MOST:
        raise InvalidInputError(
            f"--axis: found {parts[2]!r} as the number of values of the input {name}, expected a whole number from 1 "
            f"to {_MOST:,}",
            value=parts[2],
        )
    if not parts[3:]:
        return name, np.linspace(start, stop, count)
    if not start * stop > 0:
        raise InvalidInputError(
            f"--axis: found {text!r}, but logarithmic spacing needs nonzero start and stop values of the same sign",
            value=text,
        )
    return name, np.geomspace(start, stop, count)


def _with_unit(parts: list[str]) -> list[str]:
    """Return quantities with the unit of the last one, if they have none."""
    parts = [part.strip() for part in parts]
    unit = _BARE.sub("", parts[-1], count=1)
    return [f"{part} {unit}" if unit and _BARE.fullmatch(part) else part for part in parts]
