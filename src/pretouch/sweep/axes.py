"""The axes of a sweep: named inputs, each with its values, alone or several side by side."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.values import Value
from pretouch.design import Task

from .inputs import ENCOUNTER_INPUTS, inputs_of

__all__ = ["Axes", "Axis", "make_axes"]

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
    """Check axes as they were given.

    Args:
        axes: what was given.
        held: what they change.

    Returns:
        The axes in their order.

    Raises:
        InvalidInputError: an input is unknown or named twice, or values are missing, not finite or not in one row.
    """
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
    if name not in known:
        near = get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(known)}"
        raise InvalidInputError(f"axes: found {name!r}, which is no input of this sweep; {hint}")
    values = np.atleast_1d(finite(given, name, known[name]))
    if values.ndim != 1 or not len(values):
        raise InvalidInputError(f"{name}: found values of shape {values.shape}, expected one row of one value or more")
    values.setflags(write=False)
    return values
