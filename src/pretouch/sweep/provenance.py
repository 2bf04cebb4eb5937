"""Where a dataset comes from: inputs, versions, seed, and a digest that tells one sweep from another."""

from __future__ import annotations

import hashlib
import json
import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from pretouch._core.json_text import as_json
from pretouch._core.numbers import FloatArray
from pretouch.design import ImpactModel, Objective
from pretouch.design.own_objective import OwnObjective
from pretouch.motion import ContactState
from pretouch.sensors import SensorModel

from .plan import Plan

__all__ = ["DIGEST", "attributes_of", "differing_parts"]

DIGEST: Final = "digest"
_PACKAGES: Final = ("pretouch", "numpy", "scipy")
_FARTHEST: Final = 1.0  # m, to which a curve without an end is looked at
_SAMPLES: Final = 65
_PROBES: Final = 17


def attributes_of(plan: Plan) -> dict[str, Any]:
    """Return the attributes of a dataset, everything that its numbers follow from: `seed` is -1 for none."""
    found = {package: version(package) for package in _PACKAGES}
    inputs = _asked(plan)
    names = ", ".join(plan.dims)
    return {
        "title": f"pretouch sweep of {'optimal gains' if plan.designs else 'contacts'} over {names}",
        "inputs": as_json(inputs, indent=None),
        "versions": as_json({"python": platform.python_version(), **found}, indent=None),
        "seed": -1 if plan.seed is None else plan.seed,
        DIGEST: _digest({"inputs": inputs, "seed": plan.seed, "pretouch": found["pretouch"]}),
    }


def _asked(plan: Plan) -> dict[str, Any]:
    """Return what a sweep was asked, numbers in SI, as an object for JSON; long columns by their ends and a hash."""
    held = plan.held
    parts = ("admittance", "obstacle", "plant", "reference")
    return {
        "scenario": {part: asdict(getattr(held.scenario, part)) for part in parts},
        "sensor": _sensor(held.sensor),
        "gain": held.gain,
        "objective": _objective(held.goal, held.impact) if plan.designs else None,
        "bounds": held.bounds,
        "constraints": {c.name: c.limit for c in held.limits},
        "impact": {"model": type(held.impact).__name__, **asdict(held.impact)} if held.impact else None,
        "method": held.method,
        "horizon": held.horizon,
        "axes": {axis.name: {name: _column(values) for name, values in axis.columns.items()} for axis in plan.axes},
        "results": plan.results,
        "chunk": plan.chunk,
    }


def differing_parts(attributes: dict[str, Any], plan: Plan) -> str:
    """Say in which inputs a dataset of these attributes differs from a plan; what else may, where all are the same."""
    try:
        found = json.loads(attributes["inputs"])
    except (KeyError, ValueError, TypeError):
        return "inputs"
    wanted = json.loads(as_json(_asked(plan)))
    return ", ".join(k for k in wanted if found.get(k) != wanted[k]) or "seed or version of pretouch"


def _sensor(sensor: SensorModel) -> dict[str, Any]:
    """Return a curve by its parameters and by what it says: a curve may be a user's own functions."""
    low, high = sensor.valid_range
    distances = np.linspace(low, min(high, low + _FARTHEST), _SAMPLES)
    said = np.stack([sensor.log_output(distances), sensor.log_slope(distances)])
    return {
        "model": sensor.name,
        "parameters": sensor.parameters,
        "valid_range": (low, high),
        "curve": hashlib.sha256(said.tobytes()).hexdigest(),
    }


def _objective(objective: Objective, impact: ImpactModel | None) -> dict[str, Any]:
    """Return an objective by its terms; one of a user's own by its name and by what it says of some contacts."""
    if not isinstance(objective, OwnObjective):
        return asdict(objective)
    with np.errstate(all="ignore"):
        said = objective.value(ContactState(_Probes()), np.full(_PROBES, 0.3), impact)
    return {"name": objective.name, "values": hashlib.sha256(said.tobytes()).hexdigest()}


class _Probes:
    """Contacts that tell objectives apart."""

    def column(self, name: str) -> FloatArray:
        """Return other numbers for each quantity."""
        seed = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4])
        size = np.random.default_rng(seed).uniform(0.01, 1.0, _PROBES)
        return -size if name == "relative_velocity" else size


def _column(values: Any) -> dict[str, Any]:
    digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
    return {"count": len(values), "first": float(values[0]), "last": float(values[-1]), "sha256": digest}


def _digest(value: dict[str, Any]) -> str:
    return hashlib.sha256(as_json(value, indent=None).encode()).hexdigest()
