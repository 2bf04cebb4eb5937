"""Compute one block of a sweep, and measure the sweep's progress.

A block is a part of the encounters.
"""

from __future__ import annotations

import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from pretouch._core.values import Value

from .grid import Columns, Grid, Region
from .stores import Store

_BLOCK_SECONDS: Final = 1.0
_TRIAL: Final = 32  # a chunk is 32 times as large as the trial that measures the speed


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockRecord:
    """Size and computing time of one block of a sweep.

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
    """Number of finished encounters and elapsed time of a sweep.

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
        """Estimated remaining time of the sweep [s].

        It assumes the average speed of this run, and is NaN before any encounter is computed.
        """
        return (self.total - self.finished) * self.seconds / self.computed if self.computed else float("nan")


def chunks_per_block(plan: Grid, *, workers: int = 1) -> int:
    """Choose how many chunks of the sweep form one block.

    The choice is based on the duration of a trial run. The results of the sweep do not depend on this number.

    Args:
        plan: the sweep. The trial also detects mistakes in the sweep before the work begins.
        workers: number of workers; each should get several blocks.

    Returns:
        The number of chunks that together take about a second.
    """
    single = plan.thinned(1)
    single.evaluate(single.region(0))
    if plan.chunk_count == 1:
        return 1
    encounters = math.prod(plan.chunk)
    trial = plan.thinned(max(1, encounters // _TRIAL))
    start = time.perf_counter()
    trial.evaluate(trial.region(0))
    per_chunk = (time.perf_counter() - start) / trial.size * encounters
    most = plan.chunk_count if workers == 1 else -(-plan.chunk_count // (4 * workers))
    return max(1, min(most, round(_BLOCK_SECONDS / per_chunk)))


def run_block(plan: Grid, store: Store, block: int) -> BlockRecord:
    """Compute and store a block of encounters.

    Returns:
        Size and computing time of the block. Each chunk is computed while the previous one is being written.
    """
    computing = writing = 0.0

    def write(region: Region, columns: Columns) -> float:
        start = time.perf_counter()
        store.write(region, columns)
        return time.perf_counter() - start

    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="pretouch-writer") as writer:
        pending = None
        for region in store.regions(block):
            start = time.perf_counter()
            columns = plan.evaluate(region)
            computing += time.perf_counter() - start
            if pending is not None:
                writing += pending.result()
            pending = writer.submit(write, region, columns)
        if pending is not None:
            writing += pending.result()
    store.finish(block)
    return BlockRecord(encounters=store.size(block), computing=computing, writing=writing)
