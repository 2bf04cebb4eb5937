"""From a plan and its columns to an xarray Dataset: named axes, units, provenance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch._core.extras import require

from .inputs import inputs_of
from .plan import Plan
from .provenance import attributes_of
from .results import result_attributes

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["make_dataset"]


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
            coords[name] = (axis.name, values, {"long_name": words, "units": units[name] or "1"})
    data = {
        name: (plan.dims, column, result_attributes(name, designs=plan.designs)) for name, column in columns.items()
    }
    return xarray.Dataset(data, coords=coords, attrs=attributes_of(plan))
