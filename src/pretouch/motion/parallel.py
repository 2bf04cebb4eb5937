"""Run a function over chunks of many encounters, in parallel threads.

The compiled kernels release the interpreter's lock. Where chunks end depends only on the number of encounters, not on
the number of cores. A kernel that processes several encounters together therefore sees the same neighbors on every
machine and returns the same bits.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Final

_ENOUGH: Final = 64  # stretches, for as many cores


def run_in_chunks(run: Callable[[int, int], object], size: int, *, least: int, most: int) -> None:
    """Run something over all of 0 to size, in stretches, on every core that this process may use.

    An interrupt ends it between two stretches.

    Args:
        run: takes the start and the end of a stretch; stretches must not share what they write.
        size: how many encounters there are.
        least: how many are worth a thread; what is left of an even division may be half of it.
        most: the longest stretch.
    """
    if 0 < size <= min(least, most):  # one stretch, as below, without the rest of what is worth it for many
        run(0, size)
        return
    stretches = _stretches(size, least, most)
    threads = min(_cores(), len(stretches)) if len(stretches) > 1 else 1
    if threads == 1:
        for stretch in stretches:
            run(*stretch)
        return
    left = deque(stretches)

    def work() -> None:
        while left:
            try:
                stretch = left.popleft()
            except IndexError:  # another thread took the last one
                return
            run(*stretch)

    helpers = [_pool().submit(work) for _ in range(threads - 1)]
    try:
        work()  # this thread need not be woken
        for helper in helpers:
            if not helper.cancel():  # one that has not begun has nothing left to do
                helper.result()
    finally:
        left.clear()


def _stretches(size: int, least: int, most: int) -> list[tuple[int, int]]:
    """Cut 0 to size into equal stretches: a power of two of them, which suits most numbers of cores, or more."""
    worth = max(-(-size // least), 1)
    count = max(min(1 << (worth - 1).bit_length(), _ENOUGH), -(-size // most))
    length = max(-(-size // count), 1)
    return [(start, min(start + length, size)) for start in range(0, size, length)]


def _cores() -> int:
    affinity = getattr(os, "sched_getaffinity", None)  # not on every system
    return len(affinity(0)) if affinity else os.cpu_count() or 1


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=max(_cores() - 1, 1), thread_name_prefix="pretouch")


if hasattr(os, "register_at_fork"):  # a child process has the pool, but none of its threads: work would wait for good
    os.register_at_fork(after_in_child=_pool.cache_clear)
