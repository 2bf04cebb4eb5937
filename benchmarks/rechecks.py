"""Count right and wrong verdicts of `pretouch replay --recheck` over random drifts of sensors.

Run with `python -m benchmarks.rechecks`. Each case is a sensor of a description, whose offset, scale factor and
distance have drifted, and a recording at known distances, which are wrong by 0.3 mm (standard deviation).
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

import pretouch as pt
from pretouch.recording import Recording, recheck, replay
from pretouch.recording.calibration_recheck import TOLERANCE
from pretouch.recording.noise import quiet_floor
from pretouch.sensors import ExponentialFirstOrder, InversePower

EXAMPLES: Final = Path(__file__).parents[1] / "examples"
SECONDS: Final = 2.0  # at each distance
PLACEMENT: Final = 0.3e-3  # m, standard deviation of a distance
PLACES: Final = ((0.005, 0.04), (0.003, 0.015, 0.035), (0.004, 0.05))
SHIFTS: Final = (-0.02, 0.03)  # m, of the distance
LATE: Final = {"floor": 300.0, "position": 0.11}
STEEP: Final = ExponentialFirstOrder(scale=20_000.0, rate=-60.0)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A drift, with the contact speeds on the true curve.

    Args:
        task: the task with the curve of the calibration.
        recording: the readings of today.
        distances: the distances as the user knows them.
        then: contact speed of the calibration [m/s].
        now: with the drift.
        updated: with the drift and an updated offset.
        triggers: whether the controller takes the offset for an object.
    """

    task: pt.Task
    recording: Recording
    distances: Recording
    then: float
    now: float
    updated: float
    triggers: bool

    @property
    def right(self) -> str:
        """The verdict that is right if everything is known."""
        if abs(self.now / self.then - 1) <= TOLERANCE and not self.triggers:
            return "fine"
        return "update-offset" if abs(self.updated / self.then - 1) <= TOLERANCE else "recalibrate"


def tasks() -> tuple[pt.Task, ...]:
    """Return descriptions: that of the examples, one with a low floor, and one with an exponential curve."""
    task = pt.load_scenario(EXAMPLES / "loop.toml").replace(gain=-0.86)
    law = task.loop.law
    low = replace(law, conditioning=replace(law.conditioning, floor=LATE["floor"]))
    far = replace(task.scenario, obstacle=replace(task.scenario.obstacle, position=LATE["position"]))
    early = task.replace(scenario=far, loop=replace(task.loop, law=low))
    return task, early, early.replace(sensor=STEEP, gain=-1.1)


def drifted(sensor: Any, factor: float, shift: float) -> Any:
    """Return the curve k S(l + d)."""
    if isinstance(sensor, InversePower):
        return replace(sensor, scale=sensor.scale * factor, distance_offset=sensor.distance_offset + shift)
    return replace(sensor, scale=sensor.scale * factor * np.exp(sensor.rate * shift))


def speed_of(task: pt.Task, sensor: Any, offset: float, subtracted: float) -> float:
    """Return the contact speed on the loop without noise [m/s], as the mean over the phase of the sensor."""
    loop = task.loop
    chain = replace(loop.chain, noise=0.0, relative_noise=0.0, offset=offset, crosstalk=0.0)
    law = replace(loop.law, conditioning=replace(loop.law.conditioning, offset=subtracted))
    run = replace(loop, chain=chain, law=law, contact=None).run(task.scenario, sensor, task.gain, runs=16)
    return float(np.abs(run.relative_velocity).mean()) if np.all(run.touched) else np.nan


def case_of(seed: int) -> Case:
    """Return a random drift."""
    rng = np.random.default_rng([48, seed])
    task = tasks()[seed % 3]
    chain, conditioning = task.loop.chain, task.loop.law.conditioning
    size = rng.choice([0.1, 0.5, 1.0, 2.0], size=3)
    factor = float(np.exp(0.4 * size[0] * rng.standard_normal()))
    shift = float(np.clip(8e-3 * size[1] * rng.standard_normal(), *SHIFTS))
    then = chain.offset + chain.crosstalk
    offset = then + conditioning.floor * size[2] * float(rng.standard_normal())
    sensor = drifted(task.sensor, factor, shift)
    held = (np.inf, *PLACES[seed // 3 % 3])
    count = int(SECONDS * chain.rate)
    readings, known = [], []
    for distance in held:
        true = distance + PLACEMENT * float(rng.standard_normal()) if np.isfinite(distance) else distance
        signal = float(sensor.output(true)) if np.isfinite(distance) else 0.0
        noise = np.hypot(chain.noise, chain.relative_noise * signal) * rng.standard_normal(count)
        readings.append(np.clip(np.round(offset + signal + noise), None, chain.highest))
        known.append(np.full(count, distance))
    stamps = np.round(np.arange(len(held) * count) / chain.rate * 1e9).astype(np.int64)
    columns: dict[str, Any] = {"source": "today", "message_type": "column", "stamps": stamps, "clock": "column"}
    return Case(
        task=task,
        recording=Recording(topic="reading", values=np.concatenate(readings), **columns),
        distances=Recording(topic="distance", kind="distance", values=np.concatenate(known), **columns),
        then=speed_of(task, task.sensor, then, conditioning.offset),
        now=speed_of(task, sensor, offset, conditioning.offset),
        updated=speed_of(task, sensor, offset, offset),
        triggers=offset - conditioning.offset + quiet_floor(conditioning, chain.rate, chain.noise)
        >= conditioning.floor,
    )


def count_verdicts(count: int, seed: int) -> tuple[Counter[tuple[str, str]], int]:
    """Return how often each verdict was given for each right one, and the wrong "fine" with another contact speed."""
    counts: Counter[tuple[str, str]] = Counter()
    wrong = 0
    for number in range(count):
        case = case_of(seed + number)
        check = recheck(case.task, replay(case.task, case.recording), distances=case.distances)
        counts[case.right, check.decision] += 1
        wrong += check.decision == "fine" and not abs(case.now / case.then - 1) <= TOLERANCE
    return counts, wrong


def main(arguments: list[str] | None = None) -> None:
    """Print the table of verdicts."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=300, help="number of drifts")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first one")
    options = parser.parse_args(arguments)
    counts, wrong = count_verdicts(options.count, options.seed)
    names = ("fine", "update-offset", "recalibrate", "not-decided")
    print(f"{'right verdict':16s}" + "".join(f"{name:>16s}" for name in names))
    for right in names[:3]:
        print(f"{right:16s}" + "".join(f"{counts[right, name]:16d}" for name in names))
    total = sum(counts.values())
    agreed = sum(counts[name, name] for name in names[:3])
    undecided = sum(counts[right, "not-decided"] for right in names[:3])
    print(f"{agreed} of {total} verdicts are right, {undecided} are not decided, {total - agreed - undecided} differ")
    print(f'{wrong} wrong "fine" with a contact speed that differs by more than {100 * TOLERANCE:.0f} %')


if __name__ == "__main__":
    main()
