"""Seven readings of a sensor, the nearest of which may be wrong, and a scenario that uses them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pretouch as pt

DISTANCES = np.array([0.0, 0.010, 0.020, 0.030, 0.045, 0.060, 0.080])
OFFSET = 150.0
EMPTY = [150, 151, 149, 150, 150]
TRUTH = pt.InversePower(scale=3150 * 0.03**2, distance_offset=0.03, exponent=2.0)
NOISE = np.array([3.0, -6.0, 2.0, 4.0, -2.0, 1.0, -1.0])
TASK = """\
[sensor]
calibration = "sensor.csv"
[admittance]
mass = "1 kg"
damping = "10 N*s/m"
stiffness = "25 N/m"
[obstacle]
position = "80 mm"
velocity = "-0.3 m/s"
[objective]
kind = "excursion"
position_scale = "0.5 m"
velocity_scale = "0.3 m/s"
[gain]
bounds = ["-20 N*s", "-0.001 N*s"]
[uncertainty]
obstacle.velocity = { uniform = ["-0.35 m/s", "-0.25 m/s"] }
[robust]
samples = 32
"""


def readings(error: float = 0.0, at: int = 0, *, repeats: int = 0, empty: list[int] = EMPTY) -> pt.Calibration:
    """Return seven readings, one of them wrong by a share of its signal, and right repeats of this one."""
    signal = np.asarray(TRUTH.output(DISTANCES))
    outputs = OFFSET + signal + NOISE
    outputs[at] += error * signal[at]
    again = OFFSET + signal[at] + 4.0 * (np.arange(repeats) - repeats / 2)
    return pt.Calibration(
        distances=np.append(DISTANCES, np.full(repeats, DISTANCES[at])),
        outputs=np.round(np.append(outputs, again)),
        unit="counts",
        no_object=empty,
    )


def write_task(folder: Path, error: float = 0.27) -> Path:
    """Write a scenario and its calibration, whose nearest reading is wrong."""
    wrong = readings(error)
    rows = "".join(f"{1e3 * d:g},{y:g}\n" for d, y in zip(wrong.distances, wrong.outputs, strict=True))
    rows += "".join(f"inf,{y}\n" for y in EMPTY)
    (folder / "sensor.csv").write_text("distance [mm],output [counts]\n" + rows)
    (folder / "task.toml").write_text(TASK)
    return folder / "task.toml"
