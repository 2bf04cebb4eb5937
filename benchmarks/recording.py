"""Count the lines that `pretouch record` loses at 1 kHz, and its processor time next to a loop around pyserial.

This process sends numbered lines through a pseudo terminal without waiting, as a sensor does. The processor time of
`pretouch record` includes its start; that of the loop does not.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
import serial

from recording_bench import PtySensor

RATE = 1000.0  # lines per second
STEP, CYCLE = 7919, 10007  # numbers that look like noise, so that the output counts as settled


def main() -> None:
    """Print the lines that were sent, recorded and lost, and the processor time for a line."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=60.0, help="duration of the recording")
    seconds = options.parse_args().seconds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with PtySensor(folder, rate=RATE, line=lambda _, number: b"%d\n" % (number * STEP % CYCLE)) as sensor:
            lines, lost, worst = record(sensor, folder, seconds)
            used = resource.getrusage(resource.RUSAGE_CHILDREN)
            record_time = (used.ru_utime + used.ru_stime) / lines
        with PtySensor(folder, rate=RATE, line=lambda _, number: b"%d\n" % number) as sensor:
            loop_time = plain_loop(sensor, min(seconds, 10.0))
    print(f"pretouch record: {lines:,} lines in {lines / RATE:.1f} s, {lost} lost, longest gap {1e3 * worst:.0f} ms")
    print(
        f"processor time per line: {1e6 * record_time:.0f} us, and {1e6 * loop_time:.0f} us of a loop around pyserial "
        f"that only parses ({record_time / loop_time:.1f} times)"
    )


def record(sensor: PtySensor, folder: Path, seconds: float) -> tuple[int, int, float]:
    """Record for some seconds; return the lines, those that are missing between them, and the longest gap [s]."""
    command = [sys.executable, "-m", "pretouch", "record", "sensor.csv", "--port", sensor.port, "--no-empty-scene"]
    command += ["--distances", "0 mm", "--dwell", f"{seconds} s", "--stage", "true {mm}"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 1:  # one distance is recorded, which is not enough for a calibration
        raise SystemExit(done.stderr)
    rows = [line.split(",") for line in (folder / "sensor-raw.csv").read_text().splitlines()[2:]]
    numbers = np.array([int(row[2]) for row in rows])
    positions = np.diff(numbers) * pow(STEP, -1, CYCLE) % CYCLE  # how many lines farther each line is
    return len(rows), int((positions - 1).sum()), float(np.diff([float(row[0]) for row in rows]).max())


def plain_loop(sensor: PtySensor, seconds: float) -> float:
    """Read lines with pyserial for some seconds, and return the processor time of this thread per line [s]."""
    with serial.Serial(sensor.port, 115200, timeout=1.0) as port:
        port.readline()
        start, end, count = time.thread_time(), time.monotonic() + seconds, 0
        while time.monotonic() < end:
            float(port.readline())
            count += 1
        return (time.thread_time() - start) / count


if __name__ == "__main__":
    main()
