"""Tell who waits how much has been computed: one listener, called from wherever encounters are solved."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, TypeAlias

Listener: TypeAlias = Callable[[int, float], object]
"""Takes how many encounters have been solved so far, and the seconds that this took."""

_SECONDS: Final = 2.0  # between two calls


class _Count:
    """Encounters that have been solved for one listener."""

    def __init__(self, listener: Listener) -> None:
        self._listener, self._begun, self._solved = listener, time.monotonic(), 0
        self._next, self._lock = self._begun + _SECONDS, threading.Lock()

    def add(self, count: int) -> None:
        with self._lock:
            self._solved += count
            now = time.monotonic()
            if now < self._next:
                return
            self._next = now + _SECONDS
            self._listener(self._solved, now - self._begun)


_current: _Count | None = None


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Call a listener every two seconds while encounters are solved, from the thread that solves them.

    Args:
        listener: takes how many have been solved, and the seconds since the listening began.

    Yields:
        Nothing.
    """
    global _current  # noqa: PLW0603 - encounters are solved in many threads, for one person who waits
    before, _current = _current, _Count(listener)
    try:
        yield
    finally:
        _current = before


def note_solved(count: int) -> None:
    """Count encounters that have been solved."""
    if _current is not None:
        _current.add(count)
