"""Compare the section [chain] of `pretouch replay` with the sensors of ten recordings, whose properties are known.

The recordings are bags, MCAP files and CSV files. Their sensors report the absence of an object in seven ways. It
needs the extra `ros`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np

import pretouch as pt
import recorded
from pretouch._core.units import read_quantity
from pretouch.recording import replay
from pretouch.recording.reading import read_recordings

EXAMPLES: Final = Path(__file__).parents[1] / "examples"
START: Final = 1.7e9  # s since 1970
LIMITS: Final = (0.02, 4.0)  # m, range of the distance sensors
SEEN: Final = 0.45  # m, within which there is an object
SECONDS: Final = 50
REFERENCE_RATE: Final = 200.0  # Hz
UNITS: Final = {"rate": "Hz", "delay": "s", "jitter": "s", "distance_noise": "m", "distance_resolution": "m"}
TOLERANCE: Final = 0.2


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A sensor that is recorded.

    Args:
        name: kind of the recording and of the value without an object.
        write: writes the recording, and returns its path, and the topics of sensor and reference.
        idle: reading without an object; None for a sensor with an output, whose signal falls with the distance.
        chain: properties by the names of the section [chain].
        repeats: how often the driver publishes each value.
        lowest: lowest output.
    """

    name: str
    write: Callable[[Path, Sensor, np.ndarray, np.ndarray, np.ndarray, np.ndarray], tuple[Path, str, str]]
    idle: float | None
    chain: dict[str, float]
    repeats: int = 1
    lowest: float = -np.inf


def motion(time: np.ndarray, seed: int, between: tuple[float, float]) -> np.ndarray:
    """Return the distance of an object that comes five times, stays, and leaves the beam or goes away [m].

    Its nearest distances are between two values.
    """
    rng = np.random.default_rng(seed)
    distance = np.full(len(time), 0.6)
    start = 4.0
    for visit in range(5):
        speed, nearest, rest = rng.uniform(0.15, 0.4), rng.uniform(*between), rng.uniform(1.5, 3.0)
        arrival = start + (0.6 - nearest) / speed
        leaving = nearest + (rng.uniform(0.2, 0.5) * np.maximum(time - arrival - rest, 0.0) if visit % 2 else 0.0)
        wobble = 0.1 * nearest * np.sin(2 * np.pi * rng.uniform(0.5, 0.9) * (time - arrival)) * (time > arrival)
        course = np.maximum(0.6 - speed * (time - start), leaving + wobble)
        there = (time >= start) & ((visit % 2 == 1) | (time < arrival + rest))
        distance = np.where(there, np.minimum(distance, course), distance)
        start = arrival + rest + 2.0 + rng.uniform(1.0, 4.0)
    return distance


def readings(sensor: Sensor, seed: int) -> tuple[np.ndarray, ...]:
    """Return times and readings of the sensor, times and distances of the reference, and those at the first times."""
    rng, chain = np.random.default_rng([1, seed]), sensor.chain
    count = int(SECONDS * chain["rate"])
    index = np.flatnonzero(rng.random(count) >= chain.get("dropout", 0.0))
    time = index / chain["rate"] + chain.get("jitter", 0.0) * rng.standard_normal(len(index))
    nearest = (0.04, 0.09) if sensor.idle is not None else (0.01, 0.03)
    distance = motion(time - chain["delay"], seed, nearest)
    if sensor.idle is None:
        task = pt.load_scenario(EXAMPLES / "loop.toml")
        signal = task.sensor.output(distance)
        spread = np.hypot(chain["noise"], chain.get("relative_noise", 0.0) * signal)
        values = np.maximum(signal + chain["offset"] + spread * rng.standard_normal(len(time)), sensor.lowest)
        step = chain.get("resolution", 0.0)
    else:
        values = distance + chain["distance_noise"] * rng.standard_normal(len(time))
        step = chain.get("distance_resolution", 0.0)
    values = np.round(values / step) * step if step else values
    values = values if sensor.idle is None else np.where(distance < SEEN, np.maximum(values, 0.005), sensor.idle)
    if sensor.repeats > 1:
        values = np.repeat(values, sensor.repeats)
        time = (time[:, None] + np.arange(sensor.repeats) / chain["rate"] / sensor.repeats).ravel()
    clock = np.arange(0, SECONDS, 1 / REFERENCE_RATE)
    laser, beside = (
        np.where(true < SEEN, true + 3e-4 * rng.standard_normal(len(true)), np.inf)
        for true in (motion(clock, seed, nearest), motion(time, seed, nearest))
    )
    return time, values, clock, laser, beside


def write_ranges(storage: str) -> Callable[..., tuple[Path, str, str]]:
    """Return a function that writes a bag with two topics of type Range."""

    def write(folder: Path, _: Sensor, *columns: np.ndarray) -> tuple[Path, str, str]:
        types = recorded.store()
        time, values, clock, laser, _ = columns
        topics = {
            "/range": (recorded.RANGE, recorded.range_messages(types, time + START - 1e9, values, limits=LIMITS)),
            "/laser": (recorded.RANGE, recorded.range_messages(types, clock + START - 1e9, laser)),
        }
        return recorded.write_bag(folder / "bag", topics, storage=storage, types=types), "/range", "/laser"

    return write


def write_numbers(kind: str, unit: str, factor: float) -> Callable[..., tuple[Path, str, str]]:
    """Return a function that writes a bag with a topic of numbers, and one of ranges."""

    def write(folder: Path, _: Sensor, *columns: np.ndarray) -> tuple[Path, str, str]:
        types = recorded.store()
        time, values, clock, laser, _ = columns
        convert = float if kind == recorded.FLOAT else int
        moments = np.round(1e9 * (time + START)).astype(np.int64)
        rows = zip(moments.tolist(), np.round(values * factor, 6).tolist(), strict=True)
        topics = {
            "/sensor": (kind, [(t, types.types[kind](data=convert(v))) for t, v in rows]),
            "/laser": (recorded.RANGE, recorded.range_messages(types, clock + START - 1e9, laser)),
        }
        return recorded.write_bag(folder / "bag", topics, types=types), f"/sensor{unit}", "/laser"

    return write


def write_json(unit: str) -> Callable[..., tuple[Path, str, str]]:
    """Return a function that writes an MCAP file with JSON messages."""

    def write(folder: Path, _: Sensor, *columns: np.ndarray) -> tuple[Path, str, str]:
        time, values, clock, laser, _ = columns
        rows = {
            topic: [
                (int(t), {"stamp": {"sec": int(t // 10**9), "nanosec": int(t % 10**9)}, "value": float(v)})
                for t, v in zip(np.round(1e9 * (moment + START)).astype(np.int64), column, strict=True)
            ]
            for topic, moment, column in (("/sensor", time, values), ("/laser", clock, laser))
        }
        return recorded.write_json_mcap(folder / "run.mcap", rows), f"/sensor{unit}", "/laser [m]"

    return write


def write_table(folder: Path, sensor: Sensor, *columns: np.ndarray) -> tuple[Path, str, str]:
    """Write a CSV file whose rows have a reading and the distance of the reference at its time."""
    time, values, _, _, laser = columns
    title, factor = ("range [mm]", 1e3) if sensor.idle is not None else ("output", 1.0)
    rows = [
        f"{t:.6f},{factor * v:.6g},{1e3 * d:.7g}" for t, v, d in zip(time.tolist(), values.tolist(), laser, strict=True)
    ]
    path = folder / "run.csv"
    path.write_text("\n".join([f"time [s],{title},laser [mm]", *rows, ""]), encoding="utf-8")
    return path, title.split(" ")[0], "laser"


def _distance(rate: float, noise: float, delay: float, **more: float) -> dict[str, float]:
    return {"rate": rate, "distance_noise": noise, "delay": delay, **more}


def _output(rate: float, noise: float, offset: float, delay: float, **more: float) -> dict[str, float]:
    return {"rate": rate, "noise": noise, "offset": offset, "delay": delay, **more}


SENSORS: Final = (
    Sensor(name="bag of Range, infinity", write=write_ranges("MCAP"), idle=np.inf, chain=_distance(50, 3e-3, 0.02)),
    Sensor(
        name="bag of Range, -1",
        write=write_ranges("SQLITE3"),
        idle=-1.0,
        chain=_distance(30, 4.3e-3, 0.04, dropout=0.05),
    ),
    Sensor(
        name="bag of Range, max_range",
        write=write_ranges("MCAP"),
        idle=LIMITS[1],
        chain=_distance(100, 2e-3, 0.015, jitter=5e-4),
    ),
    Sensor(
        name="bag of UInt16, 8190 mm",
        write=write_numbers("std_msgs/msg/UInt16", " [mm]", 1e3),
        idle=8.19,
        chain=_distance(60, 4e-3, 0.025, distance_resolution=1e-3),
    ),
    Sensor(name="table, 0 mm", write=write_table, idle=0.0, chain=_distance(80, 2e-3, 0.02, jitter=3e-4)),
    Sensor(name="JSON, NaN", write=write_json(" [m]"), idle=np.nan, chain=_distance(40, 5e-3, 0.03, dropout=0.03)),
    Sensor(name="table, 65535 mm", write=write_table, idle=65.535, chain=_distance(25, 6e-3, 0.05)),
    Sensor(
        name="bag of Float64, offset",
        write=write_numbers(recorded.FLOAT, "", 1.0),
        idle=None,
        chain=_output(217, 27.0, 150.0, 0.012, relative_noise=0.01, jitter=2e-4, dropout=0.04),
    ),
    Sensor(
        name="JSON, output limited to 0",
        write=write_json(""),
        idle=None,
        chain=_output(120, 6.0, -40.0, 0.02, relative_noise=0.02, resolution=1.0),
        lowest=0.0,
    ),
    Sensor(
        name="table, each value five times",
        write=write_table,
        idle=None,
        chain=_output(100, 15.0, 90.0, 0.02, relative_noise=0.005),
        repeats=5,
    ),
)
"""The recorded sensors."""


def measure(sensor: Sensor, columns: tuple[np.ndarray, ...], folder: Path) -> dict[str, float]:
    """Write a recording, replay it, and return the section [chain] in SI units."""
    path, topic, reference = sensor.write(folder, sensor, *columns)
    task = pt.load_scenario(EXAMPLES / "loop.toml")
    settings = {"floor": 100.0, "sensor_period": 0.05, "offset": sensor.chain.get("offset", 0.0)}
    law = replace(task.loop.law, conditioning=replace(task.loop.law.conditioning, **settings))
    task = task.replace(gain=-0.86, loop=replace(task.loop, law=law))
    own, other = read_recordings(path, (topic, reference))
    section: dict[str, Any] = tomllib.loads(replay(task, own, reference=other).chain)["chain"]
    return {
        key: read_quantity(value, UNITS[key], name=key) if isinstance(value, str) and key in UNITS else value
        for key, value in section.items()
    }


def check(count: int, seed: int) -> int:
    """Compare each property of each recording, and return the number of those that are more than 20 % off."""
    wrong = 0
    for sensor in SENSORS:
        errors: dict[str, list[float]] = {}
        for i in range(count):
            columns = readings(sensor, seed + i)
            with tempfile.TemporaryDirectory() as folder:
                measured = measure(sensor, columns, Path(folder))
            lost = 1 - len(columns[0]) / (SECONDS * sensor.repeats * sensor.chain["rate"])
            for key, true in (sensor.chain | ({"dropout": lost} if lost > 1e-9 else {})).items():
                if key == "offset" and sensor.lowest > true:
                    continue  # the output never shows it
                errors.setdefault(key, []).append(measured.get(key, np.inf) / true - 1)
        wrong += sum(abs(error) > TOLERANCE for each in errors.values() for error in each)
        worst = {key: max(each, key=abs) for key, each in errors.items()}
        print(f"{sensor.name:30s}", ", ".join(f"{key} {100 * error:+.1f} %" for key, error in worst.items()))
    return wrong


def main() -> int:
    """Print the largest error of each property, and the number of properties that are more than 20 % off."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=1, help="recordings of each sensor")
    options.add_argument("--seed", type=int, default=1, help="seed of the first recording")
    given = options.parse_args()
    print(f"largest error of [chain], number of recordings of each sensor: {given.count}")
    wrong = check(given.count, given.seed)
    print(f"properties that are more than {100 * TOLERANCE:.0f} % off: {wrong}")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
