"""Who computes the blocks: this process, one after the other with the kernels' own threads, or the workers of Dask."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.values import Value

from .evaluation import Columns, evaluate
from .plan import Plan, Region
from .stores import Store

__all__ = ["BlockRecord", "Progress", "chunks_per_block", "regions_of", "run_block", "run_here"]

BLOCK_SECONDS: Final = 1.0
_TRIAL: Final = 32  # part of a chunk that is computed to see how long it takes


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockRecord:
    """What a block took.

    Args:
        block: its number.
        encounters: how many it has.
        computing: seconds of computing.
        writing: seconds of writing, beside the computing of the next chunk.
        repeated: whether it was finished already, so that nothing was done.
    """

    block: int
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


def regions_of(plan: Plan, per_block: int, block: int) -> Iterator[Region]:
    """Yield the chunks of a block."""
    for index in range(block * per_block, min((block + 1) * per_block, plan.chunk_count)):
        yield plan.region(index)


def size_of(region: Region) -> int:
    """Count the encounters of a region."""
    return int(np.prod([part.stop - part.start for part in region]))


def chunks_per_block(plan: Plan, *, seconds: float = BLOCK_SECONDS, workers: int = 1) -> int:
    """Choose how many chunks make a block, from a trial over the whole grid; it also finds mistakes before work begins.

    Args:
        plan: the sweep.
        seconds: how long a block should take.
        workers: how many compute; each should get several blocks.

    Returns:
        The number, at least 1. What is computed does not depend on it.
    """
    few = plan.thinned(1)
    evaluate(few, few.region(0))
    if plan.chunk_count == 1:
        return 1
    trial = plan.thinned(max(1, int(np.prod(plan.chunk)) // _TRIAL))
    start = time.perf_counter()
    evaluate(trial, trial.region(0))
    per_chunk = (time.perf_counter() - start) / trial.size * int(np.prod(plan.chunk))
    most = plan.chunk_count if workers == 1 else -(-plan.chunk_count // (4 * workers))
    return max(1, min(most, round(seconds / per_chunk)))


def run_block(plan: Plan, store: Store, block: int) -> BlockRecord:
    """Compute and keep a block: while a chunk is written, the next one is computed.

    Args:
        plan: the sweep.
        store: takes the results.
        block: its number.

    Returns:
        What it took.
    """
    computing = writing = 0.0
    count = 0

    def write(region: Region, columns: Columns) -> float:
        begun = time.perf_counter()
        store.write(region, columns)
        return time.perf_counter() - begun

    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="pretouch-writer") as writer:
        waiting = None
        for region in regions_of(plan, store.chunks_per_block, block):
            begun = time.perf_counter()
            columns = evaluate(plan, region)
            computing += time.perf_counter() - begun
            count += size_of(region)
            if waiting is not None:
                writing += waiting.result()
            waiting = writer.submit(write, region, columns)
        if waiting is not None:
            writing += waiting.result()
    store.finish(block)
    return BlockRecord(block=block, encounters=count, computing=computing, writing=writing)


def run_here(plan: Plan, store: Store, blocks: list[int], report: Callable[[BlockRecord], None]) -> None:
    """Compute blocks in this process.

    Args:
        plan: the sweep.
        store: takes the results.
        blocks: what is to be computed.
        report: told of every block.
    """
    for block in blocks:
        report(run_block(plan, store, block))
