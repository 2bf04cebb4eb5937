"""From results to a dataset that says where it comes from, in memory and as one NetCDF file."""

from __future__ import annotations

import hashlib
import io
import json
import os
import platform
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, OutputExistsError, require
from pretouch._core.files import as_json, temporary_path
from pretouch._core.numbers import FloatArray
from pretouch.design import ImpactModel, Objective
from pretouch.design.custom_objectives import OwnObjective
from pretouch.motion import DAMPER, ContactState
from pretouch.sensors import SensorModel

from .axes import inputs_of
from .plan import Plan
from .results import STATUS, result_attributes

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
    temporary = temporary_path(path)
    try:
        plain = dataset.copy()
        for variable in plain.variables.values():
            if "flag_values" in variable.attrs:  # of the type of what they stand for, as the conventions ask
                variable.attrs["flag_values"] = np.array(variable.attrs["flag_values"], dtype=variable.dtype)
            variable.encoding = {}
        with _PatientFile(temporary) as target:
            try:
                plain.to_netcdf(target, engine=_ENGINE)
            finally:
                target.check()
        if path.exists() and not overwrite:
            raise OutputExistsError(f"{path}: this file exists and is not overwritten unasked")
        temporary.replace(path)
    except OSError as error:
        raise InvalidInputError(
            f"{path}: cannot be written ({error.strerror or error}); what is computed is kept, and the same command "
            "goes on from there"
        ) from None
    finally:
        temporary.unlink(missing_ok=True)


class _PatientFile(io.RawIOBase):
    """A new file that remembers the first error of the disk, and takes everything after it without keeping it.

    HDF5 crashes the process where it cannot write what it holds when it closes a file.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._file = path.open("x+b", buffering=0)
        self._failure: OSError | None = None

    def check(self) -> None:
        """Wait until the disk has everything; raise what it refused."""
        if self._failure is None:
            os.fsync(self._file.fileno())
        else:
            raise self._failure

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._file.tell()

    def seek(self, offset: int, whence: int = 0, /) -> int:
        return self._file.seek(offset, whence)

    def readinto(self, buffer: Any, /) -> int | None:
        """Read; what was not kept is read as zeros."""
        count = self._file.readinto(buffer)
        if self._failure is not None:
            view = memoryview(buffer).cast("B")
            view[count or 0 :] = bytes(len(view) - (count or 0))
            return len(view)
        return count

    def write(self, data: Any, /) -> int:
        view = memoryview(data).cast("B")
        if self._failure is None:
            left = view
            try:
                while left:
                    left = left[self._file.write(left) :]
            except OSError as error:
                self._failure = error
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        wanted = self.tell() if size is None else size
        if self._failure is None:
            try:
                self._file.truncate(wanted)
            except OSError as error:
                self._failure = error
        return wanted

    def close(self) -> None:
        self._file.close()
        super().close()


def open_netcdf(path: str | os.PathLike[str]) -> xr.Dataset | None:
    """Open a sweep that was written as NetCDF, numbers when they are used; None where the file is no sweep of ours."""
    xarray = require("xarray")
    require(_ENGINE)
    try:
        with require("h5py").File(path, "r") as file:  # of other files h5netcdf complains once more when it is deleted
            if DIGEST not in file.attrs:
                return None
        dataset: xr.Dataset = xarray.open_dataset(path, engine=_ENGINE)
    except Exception:
        return None
    if DIGEST not in dataset.attrs:
        dataset.close()
        return None
    return dataset


def is_intact(dataset: xr.Dataset, plan: Plan) -> bool:
    """Tell whether every variable of a dataset can be read and has the shape of the plan, and each status is known."""
    try:
        codes = dataset[STATUS].values
        shapes = {dataset[name].shape for name in (STATUS, *plan.results)}
        meanings = result_attributes(STATUS, designs=plan.designs)["flag_values"]
        for name in plan.results:
            dataset[name][(-1,) * len(plan.shape)].load()
        return shapes == {plan.shape} and bool(np.isin(codes, meanings).all())
    except Exception:
        return False
