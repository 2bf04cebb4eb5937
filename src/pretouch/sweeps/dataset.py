"""Create, write and open the dataset of a sweep.

The file format is NetCDF.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.errors import OutputError, OutputExistsError, require
from pretouch._core.files import as_json, temporary_path

from .grid import Grid
from .results import STATUS

if TYPE_CHECKING:
    import xarray as xr


DIGEST: Final = "digest"
_PACKAGES: Final = ("pretouch", "numpy", "scipy")


def attributes_of(plan: Grid) -> dict[str, Any]:
    """Return the metadata of a sweep.

    These are all inputs, the software versions and the random seed. The seed is -1 if there is none.
    """
    versions = {package: version(package) for package in _PACKAGES}
    inputs = _inputs_of(plan)
    names = ", ".join(plan.dims)
    return {
        "title": f"pretouch sweep of {plan.subject} over {names}",
        "inputs": as_json(inputs, indent=None),
        "versions": as_json({"python": platform.python_version(), **versions}, indent=None),
        "seed": -1 if plan.seed is None else plan.seed,
        DIGEST: _digest({"inputs": inputs, "seed": plan.seed, "pretouch": versions["pretouch"]}),
    }


def _inputs_of(plan: Grid) -> dict[str, Any]:
    """Return all inputs of a sweep in SI units for JSON. Columns of values are represented by their ends and a hash."""
    axes = {axis.name: {name: _column(values) for name, values in axis.columns.items()} for axis in plan.axes}
    return {**plan.inputs(), "axes": axes, "results": plan.results, "chunk": plan.chunk}


def differing_parts(attributes: dict[str, Any], plan: Grid) -> str:
    """Return the names of inputs that differ from the stored sweep.

    If all inputs are equal, the result is "seed or version of pretouch".
    """
    try:
        stored = json.loads(attributes["inputs"])
    except (KeyError, ValueError, TypeError):
        return "inputs"
    planned = json.loads(as_json(_inputs_of(plan)))
    return ", ".join(k for k in planned if stored.get(k) != planned[k]) or "seed or version of pretouch"


def _column(values: Any) -> dict[str, Any]:
    digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
    return {"count": len(values), "first": float(values[0]), "last": float(values[-1]), "sha256": digest}


def _digest(value: dict[str, Any]) -> str:
    return hashlib.sha256(as_json(value, indent=None).encode()).hexdigest()


def make_dataset(plan: Grid, columns: Mapping[str, Any]) -> xr.Dataset:
    """Create an xarray dataset with axes and results of a sweep.

    Returns:
        The dataset; without results, it contains only the axes.
    """
    xarray = require("xarray")
    coords: dict[str, Any] = {}
    for axis in plan.axes:
        if axis.zipped:
            coords[axis.name] = (axis.name, np.arange(len(axis)), {"long_name": f"{axis.name} number"})
        for name, values in axis.columns.items():
            coords[name] = (axis.name, values, plan.input_attributes(name))
    data = {name: (plan.dims, column, plan.result_attributes(name)) for name, column in columns.items()}
    return xarray.Dataset(data, coords=coords, attrs=attributes_of(plan))


_ENGINE = "h5netcdf"


def write_netcdf(dataset: xr.Dataset, path: Path, *, overwrite: bool) -> None:
    """Write a dataset to a NetCDF file.

    Only one variable at a time is in memory.

    Raises:
        OutputExistsError: the file exists and `overwrite` is false.
        OutputError: the file cannot be written, for example because the disk is full.
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
        raise OutputError(
            f"{path}: the file cannot be written ({error.strerror or error}). The computed results are kept. To finish "
            "the sweep, run the same command again",
            value=error.strerror,
        ) from None
    finally:
        temporary.unlink(missing_ok=True)


class _DeferringFile(io.RawIOBase):
    """File that remembers its first write error.

    The method `check` raises this error later. After a write error, the file ignores later writes. Without this class,
    HDF5 crashes the process if it cannot write its buffers when it closes a file.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._file = path.open("x+b", buffering=0)
        self._failure: OSError | None = None

    def check(self) -> None:
        """Wait until all data are on the disk.

        If a write error has occurred, the first one is raised.
        """
        self._flush()
        if self._failure is not None:
            raise self._failure

    def _flush(self) -> None:
        """Wait until all data are on the disk, unless the file is closed or has failed before."""
        if self._failure is None and not self._file.closed:
            try:
                os.fsync(self._file.fileno())
            except OSError as error:
                self._failure = error

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
        """Read bytes from the file into a buffer.

        Returns:
            The number of bytes; after a write error, missing data are read as zeros.
        """
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
        length = self.tell() if size is None else size
        if self._failure is None:
            try:
                self._file.truncate(length)
            except OSError as error:
                self._failure = error
        return length

    def close(self) -> None:
        self._flush()  # some versions of xarray close the file before `check` is called
        self._file.close()
        super().close()


def open_netcdf(path: str | os.PathLike[str]) -> xr.Dataset | None:
    """Open a NetCDF file of a sweep without loading its data.

    Returns:
        The dataset; None if pretouch did not write the file.
    """
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


def is_intact(dataset: xr.Dataset, plan: Grid) -> bool:
    """Return True if a stored sweep dataset is intact.

    It must be readable, belong to the planned sweep and contain only valid statuses.
    """
    try:
        codes = dataset[STATUS].values
        shapes = {dataset[name].shape for name in (STATUS, *plan.results)}
        meanings = plan.result_attributes(STATUS)["flag_values"]
        for name in plan.results:
            dataset[name][(-1,) * len(plan.shape)].load()
        return shapes == {plan.shape} and bool(np.isin(codes, meanings).all())
    except Exception:
        return False
