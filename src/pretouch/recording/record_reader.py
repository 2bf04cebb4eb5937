"""Read a sensor in a separate thread.

No reading is lost while the program computes or waits.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Final, NamedTuple

from .record_file import RecordFile
from .sources.source import ReadingSource

_POLL: Final = 0.02  # s between two looks for the first reading


class TimedReading(NamedTuple):
    """A sensor reading with its arrival time.

    The time [s] counts from the start of the recording. `place` is the distance at which the object was when the
    reading arrived, None while it moved.
    """

    time: float
    output: float
    distance: float | None
    place: float | None


class RecordReader:
    """Thread that reads a sensor and writes the raw file.

    Args:
        source: where the readings come from.
        file: where the readings go.
    """

    def __init__(self, source: ReadingSource, file: RecordFile) -> None:
        self._source, self._file = source, file
        self._queue = deque[TimedReading]()
        self._arrived, self._stop = threading.Event(), threading.Event()
        self._start = time.monotonic()
        self.place: float | None = None
        self.error: BaseException | None = None
        self.has_ended = False
        self.count = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def take(self, timeout: float) -> list[TimedReading]:
        """Wait for readings, and return those that arrived since the last call.

        Args:
            timeout: longest waiting time [s].

        Returns:
            The readings; an empty list after the timeout.
        """
        self._arrived.wait(timeout)
        self._arrived.clear()
        readings = []
        while self._queue:
            readings.append(self._queue.popleft())
        if not readings and self.error is not None:
            raise self.error
        return readings

    def wait_for_first(self, timeout: float) -> bool:
        """Wait for the first reading, and leave it in the queue.

        Args:
            timeout: longest waiting time [s].

        Returns:
            Whether a reading has arrived; also True after the end of the source.
        """
        end = time.monotonic() + timeout
        while not self.count and not self.has_ended and time.monotonic() < end:
            if self.error is not None:
                raise self.error
            self._stop.wait(_POLL)
        return bool(self.count) or self.has_ended

    def move_to(self, place: float | None) -> None:
        """Set the object distance, and discard all waiting readings.

        The distance [m] is None while the object moves.

        Args:
            place: the distance; infinite without an object.
        """
        self.place = place
        self._queue.clear()

    def close(self) -> None:
        """Stop the thread that reads the sensor."""
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                arrived = self._source.read()
                if arrived is None:
                    self.has_ended = True
                    break
                now = time.monotonic() - self._start
                place = self.place
                for output, distance, line in arrived:
                    self._file.add_raw(now, place if distance is None else distance, output, line)
                    self._queue.append(TimedReading(now, output, distance, place))
                self.count += len(arrived)
                if arrived:
                    self._arrived.set()
        except BaseException as error:  # raised again in the thread that waits for readings
            self.error = error
        self._arrived.set()
