"""Measure time and memory of reading a large calibration file in a fresh process."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROWS = (10_000, 100_000, 1_000_000)
PROGRAM = """
import resource, sys, time
from pretouch.calibration import read_calibration
begun = time.process_time()
read_calibration(sys.argv[1])
print(time.process_time() - begun, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
_KILOBYTES = 1e6 if sys.platform == "darwin" else 1e3  # of ru_maxrss in a megabyte


def write(path: Path, rows: int, unit: str) -> None:
    """Write readings at 196 distances, as integers in counts or with five decimals in volts."""
    rng = np.random.default_rng(1)
    distances = rng.choice(np.arange(5.0, 201.0), rows)
    outputs = 20 + 3000 * np.exp(-distances / 30) + rng.normal(0.0, 4.0, rows)
    digits = 0 if unit == "counts" else 5
    lines = [f"{distance:g},{output:.{digits}f}" for distance, output in zip(distances, outputs, strict=True)]
    path.write_text("\n".join([f"distance [mm],output [{unit}]", *lines, "inf,20", "inf,21", ""]), encoding="utf-8")


def main() -> None:
    """Measure each size and unit once; integers repeat often, decimals rarely."""
    print("\nreading a calibration        processor time   memory of the process")
    with tempfile.TemporaryDirectory() as folder:
        for unit in ("counts", "V"):
            for rows in ROWS:
                path = Path(folder, "sensor.csv")
                write(path, rows, unit)
                done = subprocess.run(
                    [sys.executable, "-c", PROGRAM, str(path)], capture_output=True, text=True, check=True
                )
                seconds, memory = map(float, done.stdout.split())
                print(f"{rows:>9,} rows in {unit:6s}   {seconds:11.2f} s   {memory / _KILOBYTES:14.0f} MB")


if __name__ == "__main__":
    main()
