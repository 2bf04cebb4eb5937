"""Solve all encounters of a sweep with few solver calls.

The solver accepts arrays of inputs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pretouch.designs import Task, design_gain
from pretouch.motion import ContactStatus
from pretouch.motion.scenario import scenario_with

from .axes import ENCOUNTER_INPUTS, Axis, with_input
from .grid import Columns
from .results import ALWAYS, DESIGN_CODES, OF_DESIGNS, STATUS, read


def solve_encounters(task: Task, axes: Sequence[Axis], names: Sequence[str]) -> Columns:
    """Solve all encounters of a sweep grid.

    Each array has the shape of the grid.

    Returns:
        The results; most are NaN for encounters without contact or optimal gain.
    """
    shape = tuple(map(len, axes))
    looped = [k for k, axis in enumerate(axes) if axis.looped]
    if not looped:
        return {name: np.broadcast_to(a, shape) for name, a in _columns(task, names, _values(task, axes)).items()}
    results: Columns = {}
    for index in np.ndindex(*(shape[k] for k in looped)):
        changed = task_at(task, [axes[k] for k in looped], index)
        region = [slice(None)] * len(axes)
        for k, i in zip(looped, index, strict=True):
            region[k] = slice(i, i + 1)
        values = _values(changed, [axis.at(which) for axis, which in zip(axes, region, strict=True)])
        for name, column in _columns(changed, names, values).items():
            if name not in results:
                results[name] = np.empty(shape, dtype=column.dtype)
            results[name][tuple(region)] = column
    return results


def _values(task: Task, axes: Sequence[Axis]) -> Columns:
    """Return the inputs of all encounters as arrays. Each axis of the sweep is one dimension."""
    values: Columns = {"obstacle.position": np.full((1,) * len(axes), task.scenario.obstacle.position)}
    for k, axis in enumerate(axes):
        shape = tuple(-1 if i == k else 1 for i in range(len(axes)))
        values |= {name: v.reshape(shape) for name, v in axis.columns.items() if name in ENCOUNTER_INPUTS}
    return values


def _columns(task: Task, names: Sequence[str], values: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Compute contacts or optimal gains in one call of the solver."""
    scenario = scenario_with(task.scenario, {name: value for name, value in values.items() if name != "gain"})
    options: dict[str, Any] = {"method": task.method, "horizon": task.horizon}
    if task.objective is None:
        gain: Any = values.get("gain", task.gain)
        contact = task.law.contact(scenario, task.sensor, gain, **options)
        results: dict[str, NDArray[Any]] = {STATUS: np.asarray(contact.status, dtype=np.int8)}
        good = results[STATUS] == ContactStatus.CONTACT
    else:
        design = design_gain(task.replace(scenario=scenario))
        words = np.asarray(design.status)
        status = np.zeros(words.shape, dtype=np.int8)
        for word, code in DESIGN_CODES.items():
            status[words == word] = code
        results = {STATUS: status, "gain": design.gain, "objective": design.objective}
        good = status == DESIGN_CODES["optimal"]
        if set(names) - set(OF_DESIGNS):
            contact = task.law.contact(scenario, task.sensor, np.where(good, design.gain, 0.0), **options)
    for name in names:
        if name not in results:
            column = read(name, contact, task.impact)
            complete = good.all() or (task.objective is None and name in ALWAYS)
            results[name] = np.asarray(column if complete else np.where(good, column, np.nan), dtype=np.float64)
    return {name: results[name] for name in (STATUS, *names)}


def task_at(task: Task, axes: Sequence[Axis], index: Sequence[int]) -> Task:
    """Return the task at one point of the sweep grid.

    Only inputs that the solver does not accept as arrays are changed.
    """
    for axis, i in zip(axes, index, strict=True):
        for name, values in axis.columns.items():
            if name not in ENCOUNTER_INPUTS:
                task = with_input(task, name, float(values[i]))
    return task
