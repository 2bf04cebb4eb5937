"""What a sweep came to, for a person and for a program."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.text_table import aligned
from pretouch._core.units import format_quantity

from .results import STATUS

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["sweep_as_dict", "sweep_as_text"]

_MOST_VALUES: Final = 10_000  # encounters whose values become part of the object
_MOST_READ: Final = 10**7  # encounters whose results are read back from a store for their ranges


def sweep_as_dict(dataset: xr.Dataset) -> dict[str, Any]:
    """Return a sweep as one object for JSON, all SI: with the values of up to 10,000 encounters."""
    status = dataset[STATUS]
    size = int(np.prod(status.shape))
    axes = {}
    for name in dataset.coords:
        values = dataset[name].values
        kept = values if len(values) <= _MOST_VALUES else None
        axes[str(name)] = {**_described(dataset[name]), "along": dataset[name].dims[0], "values": kept}
    results = {}
    for name in dataset.data_vars:
        if name != STATUS:
            low, high = _range(dataset[name].values) if size <= _MOST_READ else (None, None)
            values = dataset[name].values if size <= _MOST_VALUES else None
            results[str(name)] = {**_described(dataset[name]), "lowest": low, "highest": high, "values": values}
    return {
        "status": "finished",
        "encounters": size,
        "counts": counts(dataset),
        "dimensions": list(status.dims),
        "axes": axes,
        "results": results,
        "statuses": status.values if size <= _MOST_VALUES else None,
        "inputs": json.loads(dataset.attrs["inputs"]),
        "versions": json.loads(dataset.attrs["versions"]),
        "seed": None if dataset.attrs["seed"] == -1 else int(dataset.attrs["seed"]),
    }


def sweep_as_text(dataset: xr.Dataset) -> str:
    """Write a sweep for a person, in a few lines."""
    size = int(np.prod(dataset[STATUS].shape))
    ended = ", ".join(f"{count:,} {word}" for word, count in counts(dataset).items() if count)
    lines = [f"{size:,} encounters: {ended}", ""]
    rows: list[tuple[str, ...]] = [("", "from", "to", "values")]
    for name in dataset.coords:
        values, unit = dataset[name].values, _unit(dataset[name])
        rows.append((str(name), *(format_quantity(float(v), unit) for v in values[[0, -1]]), f"{len(values):,}"))
    rows.append(("", "lowest", "highest", ""))
    for name in dataset.data_vars:
        if name == STATUS:
            continue
        low, high = _range(dataset[name].values) if size <= _MOST_READ else (None, None)
        found = ("-" if v is None else format_quantity(v, _unit(dataset[name])) for v in (low, high))
        rows.append((str(name), *found, ""))
    return "\n".join([*lines, *aligned(rows)])


def counts(dataset: xr.Dataset) -> dict[str, int]:
    """Count how the encounters ended, by the word of each status."""
    words = dataset[STATUS].attrs["flag_meanings"].split()
    found = np.bincount(np.asarray(dataset[STATUS].values).ravel(), minlength=len(words))
    return dict(zip(words, map(int, found), strict=True))


def _range(values: Any) -> tuple[float | None, float | None]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if len(known) else (None, None)


def _unit(variable: Any) -> str:
    unit = str(variable.attrs.get("units", "1"))
    return "" if unit == "1" else unit


def _described(variable: Any) -> dict[str, Any]:
    return {"unit": variable.attrs.get("units", "1"), "name": variable.attrs.get("long_name", "")}
