"""Solve encounters or find optimal gains over a grid of inputs."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError, OutOfRangeError, OutputExistsError, require
from pretouch._core.numbers import finite
from pretouch.designs import Task
from pretouch.designs.task import with_file_location

from .axes import Axes
from .cluster import connected, run_on, worker_count
from .dataset import DIGEST, attributes_of, differing_parts, is_intact, open_netcdf, write_netcdf
from .executors import BlockRecord, Progress, chunks_per_block, run_block
from .gain_warnings import CHANGE_THE_LIMIT
from .grid import Grid
from .plan import make_plan
from .stores import MemoryStore, Store, ZarrStore, in_use, is_sweep, refuse_beyond_memory, remove_unused, replace_sweep

if TYPE_CHECKING:
    import xarray as xr


S = TypeVar("S", bound=Store)

_NETCDF: Final = (".nc", ".nc4")
_ZARR: Final = ".zarr"


@check_arguments
def sweep(
    task: Task,
    axes: Axes,
    *,
    results: Sequence[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    dask: Any = None,
    seed: int | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> xr.Dataset:
    """Compute contacts or optimal gains on a grid of input values.

    On one machine the compiled kernels use all cores. With an output, finished blocks are stored: if a sweep is
    interrupted, the same call resumes it and computes only the missing blocks.

    Args:
        task: one encounter with its sensor; it has the values of all inputs that are not on an axis. If the task or an
            axis has gains, contacts are computed. Otherwise each encounter gets its optimal gain, by objective, bounds,
            constraints and stability margin. A stability margin is allowed if no axis changes the stability limit.
        axes: values of inputs, in SI. A name is an input: `gain`; `admittance.mass`, `.damping`, `.stiffness`,
            `.natural_frequency`, `.damping_ratio`; any quantity of `obstacle`, `plant`, `reference`; `sensor.` with a
            parameter of the curve, or `recess`; `impact.` with a property; for designs `constraint.` with the name of
            a constraint of the task, and `objective.` with a quantity and `.weight` or `.scale`. Or a custom name such
            as `sample` and a mapping of inputs whose values are paired.
        results: quantities of `ContactState`, `drive_force`, `impact_force`, `closest_distance`, `settling_distance`,
            `impulse_residual`; for designs also `gain` and `objective`, and all quantities at the optimum. None for a
            default selection; the status is always added.
        output: a Zarr folder `NAME.zarr` or a NetCDF file `NAME.nc`; None for a dataset in memory.
        overwrite: whether another sweep at the output may be replaced; other files are never replaced.
        dask: address of a Dask scheduler, or a `distributed.Client`; its workers write to the output themselves.
        seed: seed of the random number generator that made the values, for the record.
        progress: function that is called with a `Progress` after each block.

    Returns:
        A dataset with one dimension per axis and units in the attributes of every variable; its own attributes hold
        inputs, versions and seed. Values are NaN without a contact or an optimal gain; `status` has the reason.

    Raises:
        OutOfRangeError: an encounter starts outside the range of the sensor.

    Examples:
        >>> import numpy as np
        >>> from pretouch.motion import Admittance, Obstacle, Scenario
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422),
        ...     ),
        ...     ExponentialFirstOrder(scale=0.458, rate=-61.0),
        ... )
        >>> dataset = sweep(
        ...     task,
        ...     {"obstacle.velocity": [-0.3, -0.2], "gain": np.linspace(-1.0, -0.1, 10)},
        ...     results=["relative_velocity"],
        ... )
        >>> dict(dataset["relative_velocity"].sizes)
        {'obstacle.velocity': 2, 'gain': 10}
    """
    try:
        plan = make_plan(_sweep_task(task, axes), axes, results=results, seed=seed)
    except OutOfRangeError as error:
        if task.source is None:
            raise
        raise OutOfRangeError(task.source.explained(error)) from error
    return run_sweep(plan, output, overwrite=overwrite, dask=dask, progress=progress)


def run_sweep(
    plan: Grid,
    output: str | os.PathLike[str] | None,
    *,
    overwrite: bool = False,
    dask: Any = None,
    progress: Callable[[Progress], object] | None = None,
) -> xr.Dataset:
    """Compute the encounters of a planned sweep.

    If the sweep was interrupted, only the missing encounters are computed.

    Args:
        plan: the sweep.
        output: as in `sweep`.
        overwrite: as in `sweep`.
        dask: as in `sweep`.
        progress: as in `sweep`.

    Returns:
        The dataset.

    Raises:
        InvalidInputError: the request is invalid.
    """
    require("xarray")
    target = None if output is None else Path(output)
    if target is None:
        if dask is not None:
            raise InvalidInputError(
                "dask: found no output, expected output='NAME.zarr' in a folder to which all workers can write"
            )
        refuse_beyond_memory(plan)
        return _complete(MemoryStore(plan, chunks_per_block(plan)), progress).dataset()
    if target.suffix in _NETCDF:
        return _to_netcdf(plan, target, overwrite=overwrite, dask=dask, progress=progress)
    if target.suffix != _ZARR:
        raise InvalidInputError(
            f"output: found {str(target)!r}, expected a file name with the ending {_ZARR} or {_NETCDF[0]}"
        )
    return _to_zarr(plan, target, overwrite=overwrite, dask=dask, progress=progress).dataset()


def _sweep_task(task: Task, axes: Axes) -> Task:
    """Return the task without an objective if gains are given; otherwise with bounds within the stable gains."""
    names = [name for axis, values in axes.items() for name in (values if isinstance(values, Mapping) else (axis,))]
    if task.gain is not None or "gain" in names or task.objective is None:
        gain = None if task.gain is None else finite(task.gain, "gain", task.law.number.unit)
        return task.replace(gain=gain, objective=None, source=None, evaluate=None)
    bounds = _stable_bounds(task, names)
    return task.replace(bounds=bounds, constraints=task.limits, stability_margin=None, source=None, evaluate=None)


@with_file_location
def _stable_bounds(task: Task, names: Sequence[str]) -> tuple[float, float]:
    """Return the bounds within the gain margin; a sweep axis that changes them raises an error."""
    changing = [name for name in names if name.startswith(CHANGE_THE_LIMIT)]
    if changing and task.stability_margin is not None:
        raise InvalidInputError(
            f"stability_margin: a sweep over the input {changing[0]} cannot require a gain margin. The stability limit "
            "changes with this input. Remove stability_margin, or set a fixed gain"
        )
    return task.stable_bounds()


def _complete(
    store: S, progress: Callable[[Progress], object] | None, run_blocks: Callable[..., None] | None = None
) -> S:
    """Compute the remaining blocks of a sweep, in this process or by `run_blocks`, and report progress."""
    start, finished = time.perf_counter(), store.intact()
    before = sum(store.size(int(block)) for block in np.flatnonzero(finished))
    current = Progress(finished=before, total=store.plan.size, seconds=0.0)

    def report(record: BlockRecord) -> None:
        nonlocal current
        current = replace(
            current,
            finished=current.finished + record.encounters,
            computed=current.computed + (0 if record.repeated else record.encounters),
            computing=current.computing + record.computing,
            writing=current.writing + record.writing,
            seconds=time.perf_counter() - start,
        )
        if progress is not None:
            progress(current)

    report(BlockRecord(encounters=0))
    blocks = [int(block) for block in np.flatnonzero(~finished)]
    if run_blocks is not None:
        run_blocks(blocks, report)
        return store
    for block in blocks:
        report(run_block(store.plan, store, block))
    return store


def _to_zarr(
    plan: Grid,
    target: Path,
    *,
    overwrite: bool,
    dask: Any,
    progress: Any,
    on_complete: Callable[[ZarrStore], object] = lambda _: None,
) -> ZarrStore:
    """Start or resume a sweep in a Zarr folder. `on_complete` is called while the folder is still locked."""
    require("zarr")
    with nullcontext() if dask is None else connected(dask) as client:
        while True:
            if overwrite and target.exists() and not _contains_sweep(target, plan):
                replace_sweep(target)
            if not target.exists():
                workers = 1 if client is None else worker_count(client)
                ZarrStore.create(target, plan, chunks_per_block(plan, workers=workers))
            with in_use(target) as exists:
                if not exists:  # another process has removed the folder meanwhile
                    continue
                store = ZarrStore(target, plan)
                _complete(store, progress, None if client is None else partial(run_on, client, store))
                on_complete(store)
                return store


def _contains_sweep(target: Path, plan: Grid) -> bool:
    try:
        ZarrStore(target, plan)
    except OutputExistsError:
        return False
    return True


def _to_netcdf(plan: Grid, target: Path, *, overwrite: bool, dask: Any, progress: Any) -> xr.Dataset:
    """Return a computed sweep after writing its NetCDF file.

    A temporary Zarr folder contains the results until the file is written. Equal sweeps may run at the same time: all
    compute into the folder, the first to finish writes the file, and the last removes the folder.

    Raises:
        InvalidInputError: the file was written, but cannot be read.
    """
    folder = target.with_name(f"{target.name}.unfinished{_ZARR}")
    dataset = _open_finished(plan, target, overwrite=overwrite)
    if dataset is None:

        def write(store: ZarrStore) -> None:
            if _is_written(plan, target):
                return
            try:
                with store.dataset() as computed:
                    write_netcdf(computed, target, overwrite=overwrite)
            except OutputExistsError:
                if not _is_written(plan, target):  # else an equal sweep has written the file at the same time
                    raise

        _to_zarr(plan, folder, overwrite=overwrite, dask=dask, progress=progress, on_complete=write)
        dataset = open_netcdf(target)
    if is_sweep(folder):  # an earlier run may have been killed before it removed the folder
        remove_unused(folder)
    if dataset is None:
        raise InvalidInputError(f"{target}: the file was written, but cannot be read; run the sweep again")
    return dataset


def _is_written(plan: Grid, target: Path) -> bool:
    """Return True if a NetCDF file contains the complete sweep."""
    dataset = open_netcdf(target)
    if dataset is None:
        return False
    with dataset:
        return dataset.attrs[DIGEST] == attributes_of(plan)[DIGEST] and is_intact(dataset, plan)


def _open_finished(plan: Grid, target: Path, *, overwrite: bool) -> xr.Dataset | None:
    """Open the output file if it contains the same sweep. A file that must not be replaced raises an error."""
    if not target.exists():
        return None
    dataset = open_netcdf(target)
    equal = dataset is not None and dataset.attrs[DIGEST] == attributes_of(plan)[DIGEST]
    if dataset is not None and equal and is_intact(dataset, plan):
        return dataset
    if dataset is not None:
        dataset.close()
    if not overwrite or dataset is None:
        if dataset is None:
            raise OutputExistsError(
                f"{target}: this file does not contain a sweep, so pretouch does not overwrite it; choose another "
                "name with --output",
                remedy="--output",
            )
        problem, differing = f"{target}: the stored sweep is damaged.", ""
        if not equal:
            differing = differing_parts(dataset.attrs, plan)
            problem = f"{target}: the stored sweep differs from the requested sweep in {differing}."
        raise OutputExistsError(
            f"{problem} Therefore, pretouch does not overwrite the file. Choose another name with --output, or replace "
            "the file with --force (overwrite=True in Python)",
            value=differing or None,
            remedy="--force",
        )
    return None
