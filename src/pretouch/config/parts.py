"""Load a scenario file for each built-in sensor part.

The tasks serve to compare the sensor parts, such as the VCNL4010.
"""

from __future__ import annotations

import copy
import hashlib
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.errors import InvalidInputError, ScenarioFileError
from pretouch._core.units import format_quantity
from pretouch.designs.task import Task
from pretouch.simulation import PARTS, SensorPart
from pretouch.simulation.detection import floor_at

from .document import read_document
from .robust_sections import FROM_CALIBRATION
from .sensor import keys_of_curve

_PART_KEYS: Final = ("offset", "floor", "saturation")  # keys of [controller] in the output unit of a part
_FAR: Final = 3.0  # a time-of-flight part reports no object beyond this multiple of the start distance
_SIGMAS: Final = 3.0  # default floor in standard deviations of the noise
_ANY_FLOOR: Final = 1e-12
_RATE: Final = "1 kHz"  # of the controller, if the file does not give one


class PartTasks(NamedTuple):
    """The tasks of all built-in sensor parts, and what was assumed.

    Args:
        tasks: the task of each part, by the name of the part.
        notes: sentences on the parts of the scenario that were replaced or assumed.
    """

    tasks: dict[str, Task]
    notes: tuple[str, ...]


def load_with_parts(path: str | os.PathLike[str]) -> dict[str, Task]:
    """Create a design task for each built-in sensor part, see `tasks_of_parts`.

    Args:
        path: the scenario file.

    Returns:
        The task of each part, by the name of the part.
    """
    return tasks_of_parts(path).tasks


def tasks_of_parts(path: str | os.PathLike[str]) -> PartTasks:
    """Create a design task for each built-in sensor part.

    The sensor chain of the scenario file is replaced by that of the part. The curve keeps its shape, also if it was
    fitted to a calibration. Its scale and the noise become those of the part, and the floor of the controller detects
    the object where the encounter starts. A file without [controller] gets a controller at 1 kHz.

    Args:
        path: the scenario file, with a sensor curve by its parameters or points, or with a calibration.

    Returns:
        The tasks, with notes.

    Raises:
        InvalidInputError: the file has mistakes, or its curve has no scale.
    """
    from . import load_document  # noqa: PLC0415 - this module is loaded by its package

    content, text, data = read_document(path)
    read = partial(load_document, Path(path), text, hashlib.sha256(content).hexdigest())
    notes = []
    has_controller = "controller" in data
    if "chain" not in data:  # each part replaces the chain and the floor
        controller = data.get("controller", {"rate": _RATE})
        data = {**data, "chain": {"rate": _RATE}, "controller": {"floor": _ANY_FLOOR, **controller}}
    elif not has_controller:
        data = {**data, "controller": {"rate": _RATE}}
    base = read(data)
    if base.calibration is not None:
        data, note = _without_calibration(data, base)
        notes.append(note)
    elif {"scale", "outputs"}.isdisjoint(data["sensor"]):
        raise InvalidInputError(
            f"{path}: the section [sensor] has neither scale nor outputs, but the comparison scales the curve for each "
            "sensor part. Give the curve by its parameters, by its points, or by a calibration"
        )
    if not has_controller:
        notes.append(f"The file has no section [controller]: a controller at {_RATE} is assumed for each part.")
    if base.loop is not None and "robot" not in data:
        notes.append("The file has no section [robot]: a robot that follows its commands exactly is assumed.")
    return PartTasks({name: _with_part(read, data, base, part) for name, part in PARTS.items()}, tuple(notes))


def _without_calibration(data: Mapping[str, Any], base: Task) -> tuple[dict[str, Any], str]:
    """Replace a calibration by its fitted curve.

    Returns:
        The changed document, and a note.
    """
    changed = copy.deepcopy(dict(data))
    name, curve = data["sensor"]["calibration"], base.sensor.bare[0]
    changed["sensor"] = keys_of_curve(base.sensor)
    uncertain = changed.get("uncertainty", {}).get("sensor", {})
    dropped = [key for key in (FROM_CALIBRATION, "scale") if uncertain.pop(key, None) is not None]
    if not uncertain and "uncertainty" in changed:
        changed["uncertainty"].pop("sensor", None)
        if not changed["uncertainty"]:
            del changed["uncertainty"]
    note = (
        f"All parts use the shape of the {curve.name} curve that was fitted to {name}, with the scale, noise, rate and "
        f"delay of the part. Another part has a curve of its own: measure it before you rely on the ranking. Beyond "
        f"{format_quantity(float(base.sensor.valid_range[1]), 'm')}, the output is assumed to fall with the square of "
        "the distance."
    )
    if dropped:
        note += f" The uncertain sensor.{dropped[0]} belongs to the calibration and is left out."
    return changed, note


def _with_part(
    read: Callable[[Mapping[str, Any]], Task], data: Mapping[str, Any], base: Task, part: SensorPart
) -> Task:
    """Create the design task for another sensor part."""
    changed = copy.deepcopy(dict(data))
    chain: dict[str, Any] = {"part": part.name}
    assert base.loop is not None  # noqa: S101 - the document has a chain and a controller
    rate = 1.0 / base.loop.law.period
    if part.chain.rate > rate:  # the controller reads such a part once per period
        chain["rate"] = rate
    start = float(np.max(base.scenario.distance))
    at, output = part.signal or (min(part.range[1], _FAR * start), 1.0)
    controller = {key: value for key, value in data["controller"].items() if key not in _PART_KEYS}
    if part.signal is None:
        controller["floor"] = output
        if data.get("law", {}).get("kind") == "virtual-drag":
            changed["law"]["noise"] = output / _SIGMAS
    factor = output / _output(base, at)
    changed |= {"chain": chain, "controller": controller}
    if "outputs" in changed["sensor"]:
        changed["sensor"]["outputs"] = [factor * value for value in getattr(base.sensor.bare[0], "outputs")]  # noqa: B009
    else:
        changed["sensor"]["scale"] = factor * _scale_of(base)
    try:
        task = read(changed)
        loop = task.loop
        assert loop is not None  # noqa: S101 - the document has a chain and a controller
        floor = floor_at(task.sensor, loop.chain, loop.law.conditioning, start)
        if floor is None:  # the default floor, which detects the object later
            return task
        changed["controller"]["floor"] = floor
        return read(changed)
    except ScenarioFileError as error:
        raise InvalidInputError(f"sensor part {part.name}: {error}") from None


def _output(base: Task, distance: float) -> float:
    """Return the output of the file's curve at a distance.

    Beyond the valid range of a calibrated curve, the output falls with the square of the distance from the sensor.
    """
    farthest, recess = float(base.sensor.valid_range[1]), base.sensor.bare[1]
    if base.calibration is None or distance <= farthest:
        return float(base.sensor.output(distance))
    return float(base.sensor.output(farthest)) * ((farthest + recess) / (distance + recess)) ** 2


def _scale_of(task: Task) -> float:
    """Return the scale of a task's sensor curve. The sensor may have a recess."""
    return float(getattr(task.sensor.bare[0], "scale"))  # noqa: B009 - curves with a scale only
