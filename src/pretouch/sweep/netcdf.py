"""A finished sweep as one NetCDF file, which appears whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pretouch._core.errors import InvalidInputError, OutputExistsError
from pretouch._core.extras import require

from .provenance import DIGEST

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["open_netcdf", "write_netcdf"]

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
