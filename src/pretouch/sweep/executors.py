"""Who computes the blocks: this process, one after the other with the kernels' own threads, or the workers of Dask."""

from __future__ import annotations

import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from pretouch._core.values import Value

from .evaluation import Columns, evaluate
from .plan import Plan, Region
from .stores import Store

__all__ = ["BlockRecord", "Progress", "chunks_per_block", "run_block"]

_BLOCK_SECONDS: Final = 1.0
_TRIAL: Final = 32  # part of a chunk that is computed to see how long it takes


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockRecord:
    """What a block took.

    Args:
        encounters: how many it has.
        computing: seconds of computing.
        writing: seconds of writing, beside the computing of the next chunk.
        repeated: whether it was finished already, so that nothing was done.
    """

    encounters: int
    computing: float = 0.0
    writing: float = 0.0
    repeated: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress(Value):
    """How far a sweep is.

    Args:
        finished: encounters that are computed and kept, those of an earlier run included.
        total: encounters of the sweep.
        seconds: since this run began.
        computed: encounters that this run has computed.
        computing: seconds of computing in this run, of all processes together.
        writing: seconds of writing likewise.
    """

    finished: int
    total: int
    seconds: float
    computed: int = 0
    computing: float = 0.0
    writing: float = 0.0

    @property
    def remaining(self) -> float:
        """How many seconds are left at the pace of this run; NaN until it has computed something."""
        return (self.total - self.finished) * self.seconds / self.computed if self.computed else float("nan")


def chunks_per_block(plan: Plan, *, workers: int = 1) -> int:
    """Choose how many chunks make a block, by how long a trial over the whole grid takes; no result depends on it.

    Args:
        plan: the sweep. The trial also finds mistakes in it before work begins.
        workers: how many compute; each should get several blocks.

    Returns:
        As many as take about a second.
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
    """Compute and keep a block: while a chunk is written, the next one is computed."""
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
