"""Report the progress of a long computation.

A callback function receives the progress about once per second.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, TypeAlias

Listener: TypeAlias = Callable[[str], object]
"""A function that receives the progress as a sentence."""

_INTERVAL: Final = 1.0  # time between two calls [s]


class _Progress:
    """Counter of solved encounters for progress reports. It calls a listener function at most once per second."""

    def __init__(self, listener: Listener) -> None:
        self._listener, self._start, self._solved = listener, time.monotonic(), 0
        self._next, self._lock = self._start + _INTERVAL, threading.Lock()

    def add(self, count: int) -> None:
        with self._lock:
            self._solved += count
            if self._is_due():
                seconds = time.monotonic() - self._start
                self._listener(f"{self._solved:,} encounters solved in {seconds:.0f} s, still running")

    def announce(self, work: str) -> None:
        with self._lock:
            if self._is_due():
                self._listener(f"{work} ({time.monotonic() - self._start:.0f} s)")

    def _is_due(self) -> bool:
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + _INTERVAL
        return True


_current: _Progress | None = None


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Report progress to a listener inside a `with` block.

    The listener is called about once per second. The listener is called in the thread that does the work.

    Args:
        listener: function of a sentence, such as `12,000 encounters solved in 3 s, still running`.

    Yields:
        Nothing.
    """
    global _current  # noqa: PLW0603 - encounters are solved in many threads, for one listener
    before, _current = _current, _Progress(listener)
    try:
        yield
    finally:
        _current = before


def note_solved(count: int) -> None:
    """Count solved encounters for the progress report."""
    if _current is not None:
        _current.add(count)


def note_work(work: str) -> None:
    """Report the next step of a computation to the listener.

    An example of a step is `trying changes, 3 of 9`.
    """
    if _current is not None:
        _current.announce(work)
