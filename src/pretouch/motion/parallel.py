"""Divide many encounters into chunks, and process the chunks in parallel threads.

The compiled kernels release the interpreter's lock. Where chunks end depends only on the number of encounters, not on
the number of cores. A kernel that processes several encounters together therefore processes the same group on every
machine, and its results are bitwise reproducible.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Final

_MAX_SPLIT: Final = 64  # chunks that are made only to occupy cores


def run_in_chunks(run: Callable[[int, int], object], size: int, *, least: int, most: int) -> None:
    """Process many encounters in parallel chunks on all processor cores.

    The chunks cover the range 0 to `size`.

    An interrupt takes effect between two chunks.

    Args:
        run: function of the start and the end of a chunk; chunks must not write to shared data.
        size: number of encounters.
        least: number of encounters that is worth a thread; chunks of an even division may have half as many.
        most: largest size of a chunk.
    """
    if 0 < size <= min(least, most):  # one chunk: skip the overhead of threads
        run(0, size)
        return
    chunks = _chunks(size, least, most)
    threads = min(_cores(), len(chunks)) if len(chunks) > 1 else 1
    if threads == 1:
        for chunk in chunks:
            run(*chunk)
        return
    remaining = deque(chunks)

    def work() -> None:
        while remaining:
            try:
                chunk = remaining.popleft()
            except IndexError:  # another thread took the last one
                return
            run(*chunk)

    helpers = [_pool().submit(work) for _ in range(threads - 1)]
    try:
        work()  # the calling thread works, too
        for helper in helpers:
            if not helper.cancel():  # a helper that has not begun is not needed
                helper.result()
    finally:
        remaining.clear()


def _chunks(size: int, least: int, most: int) -> list[tuple[int, int]]:
    """Split the encounters into equal chunks: a power of two of them, or more to respect `most`."""
    worth = max(-(-size // least), 1)
    count = max(min(1 << (worth - 1).bit_length(), _MAX_SPLIT), -(-size // most))
    length = max(-(-size // count), 1)
    return [(start, min(start + length, size)) for start in range(0, size, length)]


def _cores() -> int:
    affinity = getattr(os, "sched_getaffinity", None)  # not on every system
    return len(affinity(0)) if affinity else os.cpu_count() or 1


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=max(_cores() - 1, 1), thread_name_prefix="pretouch")


if hasattr(os, "register_at_fork"):  # a forked child has the pool without its threads and would wait forever
    os.register_at_fork(after_in_child=_pool.cache_clear)
