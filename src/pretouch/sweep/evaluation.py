"""One chunk of a sweep: the public verbs on arrays, for every value of what they take once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pretouch.design import Task, design_gain
from pretouch.motion import ContactStatus, find_contact
from pretouch.motion.inputs import scenario_with

from .axes import Axis
from .inputs import ENCOUNTER_INPUTS
from .plan import Plan, Region, held_at
from .results import ALWAYS, DESIGN_CODES, OF_DESIGNS, STATUS, read

__all__ = ["Columns", "evaluate"]

Columns: TypeAlias = dict[str, NDArray[Any]]
"""The status and every result by name, of one shape."""


def evaluate(plan: Plan, region: Region) -> Columns:
    """Return status and results of a part of the grid, of its shape; NaN where there is no contact or no optimum."""
    axes = [axis.at(part) for axis, part in zip(plan.axes, region, strict=True)]
    shape = tuple(map(len, axes))
    looped = [k for k, axis in enumerate(axes) if axis.looped]
    if not looped:
        return {name: np.broadcast_to(a, shape) for name, a in _columns(plan.held, plan, _values(axes)).items()}
    found: Columns = {}
    for index in np.ndindex(*(shape[k] for k in looped)):
        held = held_at(plan.held, [axes[k] for k in looped], index)
        place = [slice(None)] * len(axes)
        for k, i in zip(looped, index, strict=True):
            place[k] = slice(i, i + 1)
        values = _values([axis.at(which) for axis, which in zip(axes, place, strict=True)])
        for name, column in _columns(held, plan, values).items():
            if name not in found:
                found[name] = np.empty(shape, dtype=column.dtype)
            found[name][tuple(place)] = column
    return found


def _values(axes: Sequence[Axis]) -> Columns:
    """Lay the inputs of encounters out along the dimensions of their axes, so that they broadcast."""
    values: Columns = {}
    for k, axis in enumerate(axes):
        shape = tuple(-1 if i == k else 1 for i in range(len(axes)))
        values |= {name: v.reshape(shape) for name, v in axis.columns.items() if name in ENCOUNTER_INPUTS}
    return values


def _columns(held: Task, plan: Plan, values: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Solve encounters that share a sensor and whatever else the solver takes once."""
    position = values.get("obstacle.position", np.full((1,) * len(plan.axes), held.scenario.obstacle.position))
    changed = {name: value for name, value in values.items() if name != "gain"}
    scenario = scenario_with(held.scenario, {**changed, "obstacle.position": position})
    options: dict[str, Any] = {"method": held.method, "horizon": held.horizon}
    if not plan.designs:
        gain: Any = values.get("gain", held.gain)
        contact = find_contact(scenario, held.sensor, gain, **options)
        found: dict[str, NDArray[Any]] = {STATUS: np.asarray(contact.status, dtype=np.int8)}
        good = found[STATUS] == ContactStatus.CONTACT
    else:
        design = design_gain(held.replace(scenario=scenario))
        words = np.asarray(design.status)
        status = np.zeros(words.shape, dtype=np.int8)
        for word, code in DESIGN_CODES.items():
            status[words == word] = code
        found = {STATUS: status, "gain": design.gain, "objective": design.objective}
        good = status == DESIGN_CODES["optimal"]
        if set(plan.results) - set(OF_DESIGNS):
            contact = find_contact(scenario, held.sensor, np.where(good, design.gain, 0.0), **options)
    for name in plan.results:
        if name not in found:
            column = read(name, contact, held.impact)
            known = good.all() or (held.objective is None and name in ALWAYS)
            found[name] = np.asarray(column if known else np.where(good, column, np.nan), dtype=np.float64)
    return {name: found[name] for name in (STATUS, *plan.results)}
