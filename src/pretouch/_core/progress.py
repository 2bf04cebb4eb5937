"""Report progress: one listener is called regularly while encounters are solved."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, TypeAlias

Listener: TypeAlias = Callable[[int, float], object]
"""A function of the number of encounters solved so far and the elapsed time [s]."""

_INTERVAL: Final = 2.0  # s between two calls


class _Count:
    """Counts solved encounters, and calls the listener."""

    def __init__(self, listener: Listener) -> None:
        self._listener, self._start, self._solved = listener, time.monotonic(), 0
        self._next, self._lock = self._start + _INTERVAL, threading.Lock()

    def add(self, count: int) -> None:
        with self._lock:
            self._solved += count
            now = time.monotonic()
            if now < self._next:
                return
            self._next = now + _INTERVAL
            self._listener(self._solved, now - self._start)


_current: _Count | None = None


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Call a listener every two seconds while encounters are solved, in the thread that solves them.

    Args:
        listener: function of the number of solved encounters and the time [s] since this context was entered.

    Yields:
        Nothing.
    """
    global _current  # noqa: PLW0603 - encounters are solved in many threads, for one listener
    before, _current = _current, _Count(listener)
    try:
        yield
    finally:
        _current = before


def note_solved(count: int) -> None:
    """Add solved encounters to the count of the current listener."""
    if _current is not None:
        _current.add(count)
