"""Describe the inputs of a sweep as JSON.

The description is compared with that of a stored sweep.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.designs import ImpactModel, Objective, Task
from pretouch.designs.custom_objectives import CustomObjective
from pretouch.designs.quantities import QUANTITY_KINDS
from pretouch.motion import ContactState
from pretouch.sensors import SensorModel

_FARTHEST: Final = 1.0  # m, up to which an unbounded curve is sampled for its hash
_SAMPLES: Final = 65
_PROBES: Final = 17


def spoken(name: str) -> str:
    """Return the name of an input with spaces.

    For example, `obstacle.velocity` becomes `obstacle velocity`.
    """
    return name.replace(".", " ").replace("_", " ")


def inputs_of_task(task: Task) -> dict[str, Any]:
    """Return all inputs of a task in SI units for JSON."""
    parts = ("admittance", "obstacle", "plant", "reference")
    return {
        "scenario": {part: asdict(getattr(task.scenario, part)) for part in parts},
        "sensor": identify_sensor(task.sensor),
        "gain": task.gain,
        "objective": _objective(task.goal, task.impact) if task.objective is not None else None,
        "bounds": task.bounds,
        "constraints": {c.name: c.limit for c in task.limits},
        "impact": {"model": type(task.impact).__name__, **asdict(task.impact)} if task.impact else None,
        "method": task.method,
        "horizon": task.horizon,
    }


def identify_sensor(sensor: SensorModel) -> dict[str, Any]:
    """Return the parameters and a hash of a sensor curve.

    The hash of its values identifies a user-defined curve.
    """
    low, high = sensor.valid_range
    distances = np.linspace(low, min(high, low + _FARTHEST), _SAMPLES)
    samples = np.stack([sensor.log_output(distances), sensor.log_slope(distances)])
    return {
        "model": sensor.name,
        "parameters": sensor.parameters,
        "valid_range": (low, high),
        "curve": hashlib.sha256(samples.tobytes()).hexdigest(),
    }


def _objective(objective: Objective, impact: ImpactModel | None) -> dict[str, Any]:
    """Return a dictionary that identifies an objective; a user's by its name and a hash of its values."""
    custom = isinstance(objective, CustomObjective)
    if not custom and all(term.quantity in QUANTITY_KINDS.built_in() for term in objective.terms):
        return asdict(objective)
    with np.errstate(all="ignore"):
        values = objective.value(ContactState(_Probes()), np.full(_PROBES, 0.3), impact)
    terms = {} if custom else asdict(objective)
    return {**terms, "name": objective.name, "values": hashlib.sha256(values.tobytes()).hexdigest()}


class _Probes:
    """Random contact states that distinguish objectives by their values."""

    def column(self, name: str) -> FloatArray:
        """Return reproducible pseudorandom values of one quantity at contact."""
        seed = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4])
        magnitudes = np.random.default_rng(seed).uniform(0.01, 1.0, _PROBES)
        return -magnitudes if name == "relative_velocity" else magnitudes
