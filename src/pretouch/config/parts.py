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
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, ScenarioFileError
from pretouch.design.task import Task
from pretouch.simulation import PARTS, SensorPart

from .document import read_document

_PART_KEYS: Final = ("offset", "floor", "saturation")  # keys of [controller] in the output unit of a part
_FAR: Final = 3.0  # a time-of-flight part reports no object beyond this multiple of the start distance
_SIGMAS: Final = 3.0  # default floor in standard deviations of the noise


def load_with_parts(path: str | os.PathLike[str]) -> dict[str, Task]:
    """Create a design task for each built-in sensor part.

    The sensor chain of the scenario file is replaced by that of the part. The curve keeps its shape. Its scale, the
    floor of the controller and the noise become those of the part.

    Args:
        path: the scenario file, with [chain] and [controller] and a sensor curve by its parameters.

    Returns:
        The task of each part, by the name of the part.

    Raises:
        InvalidInputError: the file has mistakes or no sampled loop, or its curve has no scale.
    """
    from . import load_document  # noqa: PLC0415 - this module is loaded by its package

    content, text, data = read_document(path)
    missing = [section for section in ("chain", "controller") if section not in data]
    if missing:
        raise InvalidInputError(
            f"{path}: found no section [{missing[0]}], expected [chain] and [controller]. A comparison of sensor parts "
            "needs their rate, delay and noise. To write a file with both sections, run: pretouch init"
        )
    if "scale" not in data.get("sensor", {}):
        raise InvalidInputError(
            f"{path}: the section [sensor] has no key scale, but the comparison changes this key for each sensor part. "
            "If the section has a calibration, replace it by the model and the parameters that pretouch fit prints"
        )
    read = partial(load_document, Path(path), text, hashlib.sha256(content).hexdigest())
    base = read(data)
    return {name: _with_part(read, data, base, part) for name, part in PARTS.items()}


def _with_part(read: Callable[[Mapping[str, Any]], Task], data: dict[str, Any], base: Task, part: SensorPart) -> Task:
    """Create the design task for another sensor part."""
    changed = copy.deepcopy(data)
    chain: dict[str, Any] = {"part": part.name}
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
    scale = float(base.sensor.output(at)) / _scale_of(base)
    changed |= {"chain": chain, "controller": controller}
    changed["sensor"]["scale"] = output / scale
    try:
        return read(changed)
    except ScenarioFileError as error:
        raise InvalidInputError(f"sensor part {part.name}: {error}") from None


def _scale_of(task: Task) -> float:
    """Return the scale of a task's sensor curve.

    The sensor may have a recess.
    """
    return float(getattr(getattr(task.sensor, "sensor", task.sensor), "scale"))  # noqa: B009 - curves with a scale only
