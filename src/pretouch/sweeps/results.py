"""Define and summarize the results of a sweep.

The summary is text or JSON.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.blocks import aligned
from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import not_one_of
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import QUANTITIES, unit_of, words_for
from pretouch.designs import QUANTITY_UNITS, DesignStatus, ImpactModel, quantity_of
from pretouch.designs.quantities import QUANTITY_KINDS, find_quantity
from pretouch.motion import DAMPER, ContactResult, ContactState, ContactStatus, ContinuousLaw

if TYPE_CHECKING:
    import xarray as xr


STATUS: Final = "status"
"""The result that every sweep has."""

ALWAYS: Final = (
    "closest_distance",
    "settling_distance",
    "impulse_residual",
)
"""The results that also have values in encounters without contact."""

OF_DESIGNS: Final = ("gain", "objective")
"""The results that only designs have."""

DESIGN_CODES: Final[dict[str, int]] = {status.value: code for code, status in enumerate(DesignStatus)}
"""The number of each status of a design, 0 for optimal."""

_DEFAULT_CONTACTS: Final = ("time", "relative_velocity", "displacement")
_DEFAULT_DESIGNS: Final = ("gain", "objective", "relative_velocity")


def check_results(results: Sequence[str] | None, *, designs: bool, impact: ImpactModel | None) -> tuple[str, ...]:
    """Check the names of the requested results.

    The status is not among the returned names.

    Returns:
        The names, or the default results if none are requested.

    Raises:
        InvalidInputError: a name is unknown, or its result needs a design or an impact model.
    """
    if results is None:
        return _DEFAULT_DESIGNS if designs else _DEFAULT_CONTACTS
    names = (results,) if isinstance(results, str) else tuple(results)
    for name in names:
        if name in OF_DESIGNS and not designs:
            raise InvalidInputError(
                f"results: the result {name!r} needs an optimal gain for each encounter; add an objective and "
                "the bounds of the gain"
            )
        if name not in {STATUS, *OF_DESIGNS, *ALWAYS, *ContactState.names()} and find_quantity(name) is None:
            of_contacts = (*ContactState.names(), *QUANTITY_UNITS, *QUANTITY_KINDS.installed(), *ALWAYS)
            allowed = dict.fromkeys((*(OF_DESIGNS if designs else ()), *of_contacts))
            raise InvalidInputError(**not_one_of("results", name, allowed))
        if name != STATUS and QUANTITIES[name].needs_impact and impact is None:
            raise InvalidInputError(
                f"results: the result {name!r} needs an impact model; add an impact model with the robot's mass"
            )
    return tuple(dict.fromkeys(name for name in names if name != STATUS))


def is_of_whole_motion(name: str) -> bool:
    """Return True if a result depends on the whole motion.

    The computation of such a result takes longer.
    """
    return name not in OF_DESIGNS and name in QUANTITIES and QUANTITIES[name].whole


def read(name: str, result: ContactResult, impact: Any) -> Any:
    """Return a quantity at the end of each encounter.

    The value is in SI units. It also exists for encounters without contact.
    """
    if name in ALWAYS:
        return getattr(result, name)
    if name in ContactState.names():
        return getattr(result.end, name)
    return quantity_of(name, result.end, impact)


def result_attributes(name: str, *, designs: bool, law: ContinuousLaw = DAMPER) -> dict[str, Any]:
    """Return the metadata of a dataset variable.

    They include its name in plain words and its unit.

    Returns:
        Attributes that follow the CF conventions.

    Examples:
        >>> result_attributes("relative_velocity", designs=False)
        {'long_name': 'relative velocity at contact', 'units': 'm/s'}
    """
    if name == STATUS:
        labels = list(DESIGN_CODES) if designs else [status.label for status in ContactStatus]
        meanings = " ".join(labels)
        return {
            "long_name": "status of the encounter",
            "flag_values": list(range(len(labels))),
            "flag_meanings": meanings,
        }
    if name == "gain" and law != DAMPER:
        return {"long_name": f"optimal {law.number.label}", "units": law.number.unit}
    words = f"optimal {name}" if name in OF_DESIGNS else f"{words_for(name)}{', optimal gain' if designs else ''}"
    unit = law.number.unit if name == "gain" else unit_of(name)
    return {"long_name": words, "units": unit or "1"}


_MOST_VALUES: Final = 10_000  # largest number of encounters whose values are in the JSON object
_MOST_LISTED: Final = 1_000_000  # largest number of encounters in a table on disk
_MOST_ROWS: Final = 20  # largest number of encounters that are printed one by one
_MOST_READ: Final = 10**7  # largest number of encounters for which the ranges of results are computed


def sweep_as_dict(dataset: xr.Dataset) -> dict[str, Any]:
    """Return a sweep as a JSON object in SI units.

    All values are included if there are at most 10,000 encounters.
    """
    status = dataset[STATUS]
    size = int(np.prod(status.shape))
    axes = {}
    for name in dataset.coords:
        values = dataset[name].values if dataset[name].size <= _MOST_VALUES else None
        axes[str(name)] = {**_described(dataset[name]), "along": dataset[name].dims[0], "values": values}
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


def sweep_as_text(dataset: xr.Dataset, remarks: Sequence[str] = ()) -> str:
    """Return a sweep as text.

    It contains the number of encounters per status, and a table with a row for each encounter. A large sweep also has
    the ranges of inputs and results, and its table has evenly spaced encounters.

    Args:
        dataset: the sweep.
        remarks: lines that stand before the table.

    Returns:
        The text.
    """
    size = int(np.prod(dataset[STATUS].shape))
    statuses = ", ".join(f"{count:,} {word}" for word, count in counts(dataset).items() if count)
    lines = [f"{size:,} encounter{'s' if size > 1 else ''}: {statuses}", ""]
    lines += [*remarks, ""] if remarks else []
    if size <= _MOST_ROWS:
        return "\n".join([*lines, *aligned(_rows(dataset, range(size)))])
    some = sorted({round(i) for i in np.linspace(0, size - 1, _MOST_ROWS // 2).tolist()})
    rest = (
        f"These are {len(some)} of {size:,} encounters, evenly spaced. All of them: --table NAME.csv or NAME.md,\n"
        f"--output NAME.nc or NAME.zarr, or --json (up to {_MOST_VALUES:,})."
    )
    rows: list[tuple[str, ...]] = [("", "from", "to", "values")]
    for name in dataset.coords:
        values, unit = dataset[name].values, _unit(dataset[name])
        rows.append((str(name), *(format_quantity(float(v), unit) for v in values[[0, -1]]), f"{len(values):,}"))
    rows.append(("", "lowest", "highest", ""))
    for name in dataset.data_vars:
        if name == STATUS:
            continue
        low, high = _range(dataset[name].values) if size <= _MOST_READ else (None, None)
        ends = ("-" if v is None else format_quantity(v, _unit(dataset[name])) for v in (low, high))
        rows.append((str(name), *ends, ""))
    return "\n".join([*lines, *aligned(rows), "", *aligned(_rows(dataset, some)), "", rest])


def sweep_as_csv(dataset: xr.Dataset) -> str:
    """Return a sweep as a CSV table in SI units, with a row for each encounter.

    The header has the units; an encounter without a value has an empty cell.

    Args:
        dataset: the sweep.
    """
    head, columns = _columns(dataset)
    names = [f"{name} [{unit}]" if unit else name for name, unit in head]
    cells = [[f"{v:.15g}" if np.isfinite(v) else "" for v in column.tolist()] for column in columns]
    rows = zip(*cells, _status_words(dataset), strict=True)
    return "\n".join([",".join([*names, STATUS]), *map(",".join, rows)]) + "\n"


def sweep_as_markdown(dataset: xr.Dataset) -> str:
    """Return a sweep as a Markdown table with a row for each encounter.

    Args:
        dataset: the sweep.
    """
    _columns(dataset)  # raises an error if there are too many
    head, *rows = _rows(dataset, range(int(np.prod(dataset[STATUS].shape))))
    lines = [head, ("---:",) * (len(head) - 1) + ("---",), *rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in lines) + "\n"


def _columns(dataset: xr.Dataset) -> tuple[list[tuple[str, str]], list[Any]]:
    """Return names and units of inputs and results, and their values for each encounter."""
    status = dataset[STATUS]
    size = int(np.prod(status.shape))
    if size > _MOST_LISTED:
        raise InvalidInputError(
            f"--table: found {size:,} encounters, expected at most {_MOST_LISTED:,} in a table; write a dataset with "
            "--output NAME.nc or NAME.zarr, or use fewer values"
        )
    names = [*dataset.coords, *(name for name in dataset.data_vars if name != STATUS)]
    columns = [dataset[name].broadcast_like(status).transpose(*status.dims).values.ravel() for name in names]
    return [(str(name), _unit(dataset[name])) for name in names], columns


def _status_words(dataset: xr.Dataset) -> list[str]:
    words = dataset[STATUS].attrs["flag_meanings"].split()
    return [words[code] for code in np.asarray(dataset[STATUS].values).ravel().tolist()]


def _rows(dataset: xr.Dataset, which: Sequence[int]) -> list[tuple[str, ...]]:
    """Return the inputs, the results and the status of some encounters as table rows, in C order."""
    status, words = dataset[STATUS], dataset[STATUS].attrs["flag_meanings"].split()
    results = [name for name in dataset.data_vars if name != STATUS]
    rows = [(*map(str, dataset.coords), *map(str, results), STATUS)]
    is_whole = len(which) == int(np.prod(status.shape))  # a large dataset on disk is read only where it is shown
    read = {name: dataset[name].values if is_whole else dataset[name] for name in (*results, STATUS)}
    for number in which:
        index = np.unravel_index(number, status.shape)
        place = dict(zip(status.dims, index, strict=True))
        inputs = (
            _cell(dataset[name].values[place[dataset[name].dims[0]]], _unit(dataset[name])) for name in dataset.coords
        )
        values = (_cell(read[name][index], _unit(dataset[name])) for name in results)
        rows.append((*inputs, *values, words[int(read[STATUS][index])]))
    return rows


def _cell(value: Any, unit: str) -> str:
    return format_quantity(float(value), unit) if np.isfinite(float(value)) else "-"


def counts(dataset: xr.Dataset) -> dict[str, int]:
    """Return the number of encounters with each status."""
    words = dataset[STATUS].attrs["flag_meanings"].split()
    numbers = np.bincount(np.asarray(dataset[STATUS].values).ravel(), minlength=len(words))
    return dict(zip(words, map(int, numbers), strict=True))


def _range(values: Any) -> tuple[float | None, float | None]:
    numbers = values[np.isfinite(values)]
    return (float(numbers.min()), float(numbers.max())) if len(numbers) else (None, None)


def _unit(variable: Any) -> str:
    unit = str(variable.attrs.get("units", "1"))
    return "" if unit == "1" else unit


def _described(variable: Any) -> dict[str, Any]:
    return {"unit": variable.attrs.get("units", "1"), "name": variable.attrs.get("long_name", "")}
