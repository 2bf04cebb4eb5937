"""From results to a dataset that says where it comes from, in memory and as one NetCDF file."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import secrets
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, OutputExistsError, require
from pretouch._core.files import as_json
from pretouch._core.numbers import FloatArray
from pretouch.design import ImpactModel, Objective
from pretouch.design.objectives import OwnObjective
from pretouch.motion import DAMPER, ContactState
from pretouch.sensors import SensorModel

from .axes import inputs_of
from .plan import Plan
from .results import result_attributes

if TYPE_CHECKING:
    import xarray as xr


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


def make_dataset(plan: Plan, columns: Mapping[str, Any]) -> xr.Dataset:
    """Put results, of the shape of the grid, on their axes; without results, return the axes alone."""
    xarray = require("xarray")
    coords: dict[str, Any] = {}
    units = inputs_of(plan.held)
    for axis in plan.axes:
        if axis.zipped:
            coords[axis.name] = (axis.name, np.arange(len(axis)), {"long_name": f"{axis.name} number"})
        for name, values in axis.columns.items():
            words = name.replace(".", " ").replace("_", " ")
            words = plan.held.law.number.label if name == "gain" and plan.held.law != DAMPER else words
            coords[name] = (axis.name, values, {"long_name": words, "units": units[name] or "1"})
    told = partial(result_attributes, designs=plan.designs, law=plan.held.law)
    data = {name: (plan.dims, column, told(name)) for name, column in columns.items()}
    return xarray.Dataset(data, coords=coords, attrs=attributes_of(plan))


_ENGINE = "h5netcdf"


def write_netcdf(dataset: xr.Dataset, path: Path, *, overwrite: bool) -> None:
    """Write a dataset, one variable in memory at a time.

    Raises:
        OutputExistsError: a file stands there and `overwrite` is false.
        InvalidInputError: the folder cannot be written.
    """
    require(_ENGINE)
    require("h5py")
    temporary = path.with_name(f".{path.name[:100]}.{secrets.token_hex(6)}.tmp")
    try:
        plain = dataset.copy()
        for variable in plain.variables.values():
            if "flag_values" in variable.attrs:  # of the type of what they stand for, as the conventions ask
                variable.attrs["flag_values"] = np.array(variable.attrs["flag_values"], dtype=variable.dtype)
            variable.encoding = {}
        plain.to_netcdf(temporary, engine=_ENGINE)
        if path.exists() and not overwrite:
            raise OutputExistsError(f"{path}: this file exists and is not overwritten unasked")
        temporary.replace(path)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def open_netcdf(path: str | os.PathLike[str]) -> xr.Dataset | None:
    """Open a sweep that was written as NetCDF, numbers when they are used; None where the file is no sweep of ours."""
    xarray = require("xarray")
    require(_ENGINE)
    require("h5py")
    try:
        dataset: xr.Dataset = xarray.open_dataset(path, engine=_ENGINE)
    except (OSError, ValueError, KeyError):
        return None
    if DIGEST not in dataset.attrs:
        dataset.close()
        return None
    return dataset
