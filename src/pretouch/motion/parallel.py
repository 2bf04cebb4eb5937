"""Work on stretches of many encounters in threads: the compiled kernels hold no lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

__all__ = ["for_stretches"]


def for_stretches(run: Callable[[int, int], object], size: int, *, least: int, most: int) -> None:
    """Run something over all of 0 to size, in stretches, on every core that this process may use.

    An interrupt ends it between two stretches.

    Args:
        run: takes the start and the end of a stretch; stretches must not share what they write.
        size: how many encounters there are.
        least: the shortest stretch that is worth a thread.
        most: the longest stretch.
    """
    threads = 1 if size <= least else min(_cores(), -(-size // least))
    if threads <= 1 and size <= most:
        if size:
            run(0, size)
        return
    length = min(most, -(-size // max(threads, 1)))
    stretches = [(start, min(start + length, size)) for start in range(0, size, length)]
    if threads <= 1:
        for stretch in stretches:
            run(*stretch)
        return
    own, others = stretches[::threads], [s for i, s in enumerate(stretches) if i % threads]
    waiting = [_pool().submit(run, *stretch) for stretch in others]
    try:
        for stretch in own:  # this thread works, too: it need not be woken
            run(*stretch)
        for future in waiting:
            future.result()
    finally:
        for future in waiting:
            future.cancel()


def _cores() -> int:
    affinity = getattr(os, "sched_getaffinity", None)  # not on every system
    return len(affinity(0)) if affinity else os.cpu_count() or 1


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=max(_cores() - 1, 1), thread_name_prefix="pretouch")


if hasattr(os, "register_at_fork"):  # a child process has the pool, but none of its threads: work would wait for good
    os.register_at_fork(after_in_child=_pool.cache_clear)
