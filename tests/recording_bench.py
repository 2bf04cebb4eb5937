"""A sensor on a bench behind a pseudo terminal, and a linear stage that moves the object in front of it."""

from __future__ import annotations

import math
import os
import shlex
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path

import numpy as np

OFFSET, SCALE, SOURCE, NOISE = 600.0, 9000.0, 0.03, 6.0  # counts, counts, m, counts


def signal(distance: float) -> float:
    """Return xi of the sensor on the bench in counts: an inverse power with n = 3; 0 without an object."""
    return 0.0 if math.isinf(distance) else SCALE * (1 + distance / SOURCE) ** -3


class PtySensor:
    """A serial port on which a sensor sends a line for each reading.

    The stage writes the position of the object into a file, from which the sensor takes its distance.

    Args:
        folder: where the file of the stage lies.
        rate: readings per second.
        line: makes the bytes of a reading from its output and the number of the reading.
    """

    def __init__(
        self, folder: Path, rate: float = 500.0, line: Callable[[int, int], bytes] = lambda y, _: b"%d\r\n" % y
    ) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._rate, self._line, self._random = rate, line, np.random.default_rng(1)
        self.position = folder / "stage.txt"
        script = folder / "stage.sh"  # of the shell, which starts in a twentieth of the time of Python
        script.write_text(f'printf %s "$1" > {shlex.quote(str(self.position))}\n')
        self.stage = f"/bin/sh {shlex.quote(str(script))} {{mm}}"
        self.sent, self.is_sending = 0, True
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> PtySensor:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """End the sensor, so that its port is gone."""
        if not self._stop.is_set():
            self._stop.set()
            self._thread.join()
            os.close(self._slave)
            os.close(self._master)

    def send(self, data: bytes) -> None:
        """Send bytes as they are, as far as the port takes them."""
        try:
            os.write(self._master, data)
        except BlockingIOError:  # nobody reads
            return

    @property
    def distance(self) -> float:
        """Where the object is [m]; infinite before the stage has moved."""
        try:
            return float(self.position.read_text()) / 1000
        except (OSError, ValueError):
            return math.inf

    def _run(self) -> None:
        due, distance = time.monotonic(), math.inf
        while not self._stop.is_set():
            if self.sent % 8 == 0:
                distance = self.distance
            if self.is_sending:
                output = OFFSET + signal(distance) + NOISE * self._random.standard_normal()
                self.send(self._line(round(output), self.sent))
                self.sent += 1
            due += 1 / self._rate
            time.sleep(max(due - time.monotonic(), 0.0))
