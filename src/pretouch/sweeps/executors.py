"""Compute one block of a sweep by calling the solvers with arrays of encounters."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pretouch._core.values import Value
from pretouch.design import Task, design_gain
from pretouch.motion import ContactStatus
from pretouch.motion.scenario import scenario_with

from .axes import ENCOUNTER_INPUTS, Axis
from .plan import Plan, Region, task_at
from .results import ALWAYS, DESIGN_CODES, OF_DESIGNS, STATUS, read
from .stores import Store

Columns: TypeAlias = dict[str, NDArray[Any]]
"""The status and every result by name, of one shape."""


def evaluate(plan: Plan, region: Region) -> Columns:
    """Return status and results of encounters in a part of the grid; results are NaN without contact or optimum."""
    # Each array has the shape of the region.
    axes = [axis.at(part) for axis, part in zip(plan.axes, region, strict=True)]
    shape = tuple(map(len, axes))
    looped = [k for k, axis in enumerate(axes) if axis.looped]
    if not looped:
        return {name: np.broadcast_to(a, shape) for name, a in _columns(plan.task, plan, _values(axes)).items()}
    results: Columns = {}
    for index in np.ndindex(*(shape[k] for k in looped)):
        task = task_at(plan.task, [axes[k] for k in looped], index)
        place = [slice(None)] * len(axes)
        for k, i in zip(looped, index, strict=True):
            place[k] = slice(i, i + 1)
        values = _values([axis.at(which) for axis, which in zip(axes, place, strict=True)])
        for name, column in _columns(task, plan, values).items():
            if name not in results:
                results[name] = np.empty(shape, dtype=column.dtype)
            results[name][tuple(place)] = column
    return results


def _values(axes: Sequence[Axis]) -> Columns:
    """Return the inputs of the encounters as arrays, with one dimension for each axis of the sweep."""
    values: Columns = {}
    for k, axis in enumerate(axes):
        shape = tuple(-1 if i == k else 1 for i in range(len(axes)))
        values |= {name: v.reshape(shape) for name, v in axis.columns.items() if name in ENCOUNTER_INPUTS}
    return values


def _columns(task: Task, plan: Plan, values: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Compute contacts or optimal gains for arrays of inputs in one call of the solver."""
    position = values.get("obstacle.position", np.full((1,) * len(plan.axes), task.scenario.obstacle.position))
    changed = {name: value for name, value in values.items() if name != "gain"}
    scenario = scenario_with(task.scenario, {**changed, "obstacle.position": position})
    options: dict[str, Any] = {"method": task.method, "horizon": task.horizon}
    if not plan.designs:
        gain: Any = values.get("gain", task.gain)
        contact = task.law.contact(scenario, task.sensor, gain, **options)
        results: dict[str, NDArray[Any]] = {STATUS: np.asarray(contact.status, dtype=np.int8)}
        good = results[STATUS] == ContactStatus.CONTACT
    else:
        design = design_gain(task.replace(scenario=scenario))
        words = np.asarray(design.status)
        status = np.zeros(words.shape, dtype=np.int8)
        for word, code in DESIGN_CODES.items():
            status[words == word] = code
        results = {STATUS: status, "gain": design.gain, "objective": design.objective}
        good = status == DESIGN_CODES["optimal"]
        if set(plan.results) - set(OF_DESIGNS):
            contact = task.law.contact(scenario, task.sensor, np.where(good, design.gain, 0.0), **options)
    for name in plan.results:
        if name not in results:
            column = read(name, contact, task.impact)
            complete = good.all() or (task.objective is None and name in ALWAYS)
            results[name] = np.asarray(column if complete else np.where(good, column, np.nan), dtype=np.float64)
    return {name: results[name] for name in (STATUS, *plan.results)}


_BLOCK_SECONDS: Final = 1.0
_TRIAL: Final = 32  # a chunk is 32 times as large as the trial that measures the speed


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockRecord:
    """Number of encounters in a block of a sweep, and the time for computing and writing this block.

    Args:
        encounters: number of encounters.
        computing: time of computing [s].
        writing: time of writing [s], parallel to the computing of the next chunk.
        repeated: whether the block was finished already, so that nothing was computed.
    """

    encounters: int
    computing: float = 0.0
    writing: float = 0.0
    repeated: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress(Value):
    """Progress of a sweep: the number of finished encounters and the elapsed time.

    Args:
        finished: number of encounters that are stored, including those of earlier runs.
        total: number of encounters of the sweep.
        seconds: time since the start of this run [s].
        computed: number of encounters that this run has computed.
        computing: time of computing in this run [s], summed over all processes.
        writing: time of writing in this run [s], summed over all processes.
    """

    finished: int
    total: int
    seconds: float
    computed: int = 0
    computing: float = 0.0
    writing: float = 0.0

    @property
    def remaining(self) -> float:
        """Estimated remaining time [s] at the present speed of computation; NaN before any encounter is computed."""
        return (self.total - self.finished) * self.seconds / self.computed if self.computed else float("nan")


def chunks_per_block(plan: Plan, *, workers: int = 1) -> int:
    """Choose how many chunks of the grid form one block of work, from the duration of a trial run.

    The results of the sweep do not depend on this number.

    Args:
        plan: the sweep. The trial also detects mistakes in it before the work begins.
        workers: number of workers; each should get several blocks.

    Returns:
        The number of chunks that together take about a second.
    """
    few = plan.thinned(1)
    evaluate(few, few.region(0))
    if plan.chunk_count == 1:
        return 1
    encounters = math.prod(plan.chunk)
    trial = plan.thinned(max(1, encounters // _TRIAL))
    start = time.perf_counter()
    evaluate(trial, trial.region(0))
    per_chunk = (time.perf_counter() - start) / trial.size * encounters
    most = plan.chunk_count if workers == 1 else -(-plan.chunk_count // (4 * workers))
    return max(1, min(most, round(_BLOCK_SECONDS / per_chunk)))


def run_block(plan: Plan, store: Store, block: int) -> BlockRecord:
    """Compute and store a block of encounters; the next results are computed while results are being written."""
    computing = writing = 0.0

    def write(region: Region, columns: Columns) -> float:
        begun = time.perf_counter()
        store.write(region, columns)
        return time.perf_counter() - begun

    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="pretouch-writer") as writer:
        waiting = None
        for region in store.regions(block):
            begun = time.perf_counter()
            columns = evaluate(plan, region)
            computing += time.perf_counter() - begun
            if waiting is not None:
                writing += waiting.result()
            waiting = writer.submit(write, region, columns)
        if waiting is not None:
            writing += waiting.result()
    store.finish(block)
    return BlockRecord(encounters=store.size(block), computing=computing, writing=writing)
