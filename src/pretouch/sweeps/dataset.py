"""Create the dataset with the results of a sweep, and write or open it as a NetCDF file."""

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
from pretouch.design.custom_objectives import CustomObjective
from pretouch.design.quantities import QUANTITY_KINDS
from pretouch.motion import DAMPER, ContactState
from pretouch.sensors import SensorModel

from .axes import inputs_of
from .plan import Plan
from .results import STATUS, result_attributes

if TYPE_CHECKING:
    import xarray as xr


DIGEST: Final = "digest"
_PACKAGES: Final = ("pretouch", "numpy", "scipy")
_FARTHEST: Final = 1.0  # m, up to which an unbounded curve is sampled for its hash
_SAMPLES: Final = 65
_PROBES: Final = 17


def attributes_of(plan: Plan) -> dict[str, Any]:
    """Return the metadata of a sweep: all its inputs, the software versions and the random seed."""
    # The seed is -1 if there is none.
    versions = {package: version(package) for package in _PACKAGES}
    inputs = _inputs_of(plan)
    names = ", ".join(plan.dims)
    return {
        "title": f"pretouch sweep of {'optimal gains' if plan.designs else 'contacts'} over {names}",
        "inputs": as_json(inputs, indent=None),
        "versions": as_json({"python": platform.python_version(), **versions}, indent=None),
        "seed": -1 if plan.seed is None else plan.seed,
        DIGEST: _digest({"inputs": inputs, "seed": plan.seed, "pretouch": versions["pretouch"]}),
    }


def _inputs_of(plan: Plan) -> dict[str, Any]:
    """Return all inputs of a sweep in SI units, in a form that JSON can represent."""
    # Columns of values are represented by their ends and a hash.
    task = plan.task
    parts = ("admittance", "obstacle", "plant", "reference")
    return {
        "scenario": {part: asdict(getattr(task.scenario, part)) for part in parts},
        "sensor": _sensor(task.sensor),
        "gain": task.gain,
        "objective": _objective(task.goal, task.impact) if plan.designs else None,
        "bounds": task.bounds,
        "constraints": {c.name: c.limit for c in task.limits},
        "impact": {"model": type(task.impact).__name__, **asdict(task.impact)} if task.impact else None,
        "method": task.method,
        "horizon": task.horizon,
        "axes": {axis.name: {name: _column(values) for name, values in axis.columns.items()} for axis in plan.axes},
        "results": plan.results,
        "chunk": plan.chunk,
    }


def differing_parts(attributes: dict[str, Any], plan: Plan) -> str:
    """Return the names of the inputs in which a stored dataset differs from a planned sweep."""
    # If all inputs are equal, the result is "seed or version of pretouch".
    try:
        stored = json.loads(attributes["inputs"])
    except (KeyError, ValueError, TypeError):
        return "inputs"
    wanted = json.loads(as_json(_inputs_of(plan)))
    return ", ".join(k for k in wanted if stored.get(k) != wanted[k]) or "seed or version of pretouch"


def _sensor(sensor: SensorModel) -> dict[str, Any]:
    """Return the parameters of a sensor curve, and a hash of its values that identifies a user-defined curve."""
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
    """Return the terms of an objective; for a user-defined objective, return its name and a hash of its values."""
    custom = isinstance(objective, CustomObjective)
    if not custom and all(term.quantity in QUANTITY_KINDS.built_in() for term in objective.terms):
        return asdict(objective)
    with np.errstate(all="ignore"):
        values = objective.value(ContactState(_Probes()), np.full(_PROBES, 0.3), impact)
    terms = {} if custom else asdict(objective)
    return {**terms, "name": objective.name, "values": hashlib.sha256(values.tobytes()).hexdigest()}


class _Probes:
    """Pseudorandom states at contact. The values of a user-defined objective at these states identify it."""

    def column(self, name: str) -> FloatArray:
        """Return reproducible pseudorandom values of one quantity at contact."""
        seed = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4])
        size = np.random.default_rng(seed).uniform(0.01, 1.0, _PROBES)
        return -size if name == "relative_velocity" else size


def _column(values: Any) -> dict[str, Any]:
    digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
    return {"count": len(values), "first": float(values[0]), "last": float(values[-1]), "sha256": digest}


def _digest(value: dict[str, Any]) -> str:
    return hashlib.sha256(as_json(value, indent=None).encode()).hexdigest()


def make_dataset(plan: Plan, columns: Mapping[str, Any]) -> xr.Dataset:
    """Make a dataset on the grid of a sweep; without results, the dataset contains only the axes."""
    xarray = require("xarray")
    coords: dict[str, Any] = {}
    units = inputs_of(plan.task)
    for axis in plan.axes:
        if axis.zipped:
            coords[axis.name] = (axis.name, np.arange(len(axis)), {"long_name": f"{axis.name} number"})
        for name, values in axis.columns.items():
            words = name.replace(".", " ").replace("_", " ")
            words = plan.task.law.number.label if name == "gain" and plan.task.law != DAMPER else words
            coords[name] = (axis.name, values, {"long_name": words, "units": units[name] or "1"})
    describe = partial(result_attributes, designs=plan.designs, law=plan.task.law)
    data = {name: (plan.dims, column, describe(name)) for name, column in columns.items()}
    return xarray.Dataset(data, coords=coords, attrs=attributes_of(plan))


_ENGINE = "h5netcdf"


def write_netcdf(dataset: xr.Dataset, path: Path, *, overwrite: bool) -> None:
    """Write a dataset to a NetCDF file while keeping only one variable in memory at a time.

    Raises:
        OutputExistsError: the file exists and `overwrite` is false.
        InvalidInputError: the folder cannot be written.
    """
    require(_ENGINE)
    require("h5py")
    temporary = temporary_path(path)
    try:
        plain = dataset.copy()
        for variable in plain.variables.values():
            if "flag_values" in variable.attrs:  # the CF conventions require the type of the variable
                variable.attrs["flag_values"] = np.array(variable.attrs["flag_values"], dtype=variable.dtype)
            variable.encoding = {}
        with _DeferringFile(temporary) as target:
            try:
                plain.to_netcdf(target, engine=_ENGINE)
            finally:
                target.check()
        if path.exists() and not overwrite:
            raise OutputExistsError(f"{path}: this file exists and is not overwritten")
        temporary.replace(path)
    except OSError as error:
        raise InvalidInputError(
            f"{path}: the file cannot be written ({error.strerror or error}), but the computed results are kept; "
            "run the same command again to finish the sweep"
        ) from None
    finally:
        temporary.unlink(missing_ok=True)


class _DeferringFile(io.RawIOBase):
    """A new file that stores its first write error, which the method `check` raises.

    After a write error, it ignores later writes.

    Without this class, HDF5 crashes the process if it cannot write its buffers when it closes a file.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._file = path.open("x+b", buffering=0)
        self._failure: OSError | None = None

    def check(self) -> None:
        """Wait until all data are on the disk; raise the first write error if an error has occurred."""
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
        """Read bytes into a buffer; after a write error, missing data are read as zeros."""
        count = self._file.readinto(buffer)
        if self._failure is not None:
            view = memoryview(buffer).cast("B")
            view[count or 0 :] = bytes(len(view) - (count or 0))
            return len(view)
        return count

    def write(self, data: Any, /) -> int:
        view = memoryview(data).cast("B")
        if self._failure is None:
            remaining = view
            try:
                while remaining:
                    remaining = remaining[self._file.write(remaining) :]
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
    """Open a NetCDF file of a sweep without loading its data; return None if pretouch did not write the file."""
    xarray = require("xarray")
    require(_ENGINE)
    try:
        with require("h5py").File(path, "r") as file:  # h5netcdf warns when it closes files that are not NetCDF
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
    """Return True if a dataset is readable, belongs to the planned sweep and contains only valid statuses."""
    try:
        codes = dataset[STATUS].values
        shapes = {dataset[name].shape for name in (STATUS, *plan.results)}
        meanings = result_attributes(STATUS, designs=plan.designs)["flag_values"]
        for name in plan.results:
            dataset[name][(-1,) * len(plan.shape)].load()
        return shapes == {plan.shape} and bool(np.isin(codes, meanings).all())
    except Exception:
        return False
