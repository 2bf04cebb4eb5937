"""Check the warning that the controller detects the object elsewhere than the encounter starts.

    python -m benchmarks.starts --count 100 --seed 1

Random loops with a random curve, floor, offset, crosstalk, step of the readings, speed and gain. In a third of them the
floor detects the object before the start, in a third after it, and in a third where the encounter starts. The program
follows both cures of each warning literally. It prints

- in how many loops of each third `simulate` warns (required: none of the last third, and in the others all
  except those in which speed and excursion change by less than 3 %),
- after how many cures the warning is gone (required: all; then the exit code is 0), and
- the largest change of the predicted contact speed between start and detection distance in loops without a warning.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
from pretouch.simulation import ClosedLoop, SensorChain
from pretouch.simulation.detection import NOTICED

KINDS = ("before the start", "after the start", "at the start")
CODE = "PT421: "


def random_task(rng: np.random.Generator, kind: str) -> pt.Task:
    """Return an encounter on a loop whose floor detects the object before, after or at the start."""
    start, scale = rng.uniform(0.02, 0.12), 10 ** rng.uniform(2.0, 4.5)
    curve: pt.sensors.SensorModel = pt.ExponentialFirstOrder(scale=scale, rate=-rng.uniform(15.0, 60.0))
    if rng.random() < 0.7:
        offset, exponent = rng.uniform(0.02, 0.06), rng.uniform(2.0, 4.0)
        curve = pt.InversePower(scale=scale * offset**exponent, distance_offset=offset, exponent=exponent)
    ratio = {KINDS[0]: rng.uniform(1.2, 4.0), KINDS[1]: rng.uniform(0.25, 0.8), KINDS[2]: rng.uniform(0.97, 1.03)}[kind]
    signal = float(curve.output(ratio * start))
    steps = 0.0 if rng.random() < 0.5 else signal * 10 ** rng.uniform(-4.0, -2.5)
    crosstalk, ambient = signal * rng.uniform(0.0, 3.0, 2)
    chain = SensorChain(
        rate=250.0, noise=0.01 * signal, relative_noise=2e-3, crosstalk=crosstalk, offset=ambient, resolution=steps
    )
    law = Controller(
        period=1e-3,
        conditioning=Conditioning(floor=signal, offset=crosstalk + ambient, sensor_period=chain.period),
        law=VirtualDamper(gain=0.0),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    speed, slope = rng.uniform(0.1, 0.6), abs(float(curve.log_slope(0.0)))
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=start, velocity=-speed),
    )
    return pt.Task(scenario, curve, loop=ClosedLoop(law=law, chain=chain), gain=-rng.uniform(15.0, 80.0) / slope)


def warning_of(task: pt.Task) -> str:
    """Return the warning of a simulated encounter; empty if there is none."""
    return next((text for text in pt.simulate(task).warnings if text.startswith(CODE)), "")


def cured(task: pt.Task, text: str) -> Iterator[pt.Task]:
    """Follow each cure of a warning literally."""
    position, floor = re.search(r'set position = "([\d.]+) mm"', text), re.search(r"set floor = (\S+) in", text)
    if position is not None:
        obstacle = replace(task.scenario.obstacle, position=float(position[1]) / 1e3)
        yield task.replace(scenario=replace(task.scenario, obstacle=obstacle))
    if floor is not None:
        law = task.loop.law
        sensing = replace(law.conditioning, floor=float(floor[1]))
        yield task.replace(loop=replace(task.loop, law=replace(law, conditioning=sensing)))


def change_of_contact(task: pt.Task) -> tuple[float, float]:
    """Return the relative changes of contact speed and largest excursion between start and detection distance."""
    moved = task.loop.detection(task.scenario, task.sensor).moved
    ends = [task.law.contact(s, task.sensor, task.gain).end for s in (task.scenario, moved)]
    names = "relative_velocity", "largest_excursion"
    speed, excursion = (abs(float(getattr(ends[1], n)) / float(getattr(ends[0], n)) - 1) for n in names)
    return speed, excursion


def check(count: int, seed: int) -> int:
    """Draw and check loops, and print the figures; return the exit code."""
    rng, wrong, largest = np.random.default_rng(seed), 0, 0.0
    for kind in KINDS:
        warned = cures = gone = unnoticed = 0
        for _ in range(count):
            task = random_task(rng, kind)
            text = warning_of(task)
            warned += bool(text)
            if not text:
                changes = change_of_contact(task)
                largest, unnoticed = max(largest, changes[0]), unnoticed + (max(changes) <= NOTICED)
            for other in cured(task, text):
                cures, gone = cures + 1, gone + (not warning_of(other))
        wrong += (warned if kind == KINDS[2] else count - warned - unnoticed) + cures - gone
        others = "" if kind == KINDS[2] else f", without a noticeable change in {unnoticed} others"
        print(f"floor detects {kind}: warned in {warned} of {count}{others}; {gone} of {cures} cures end the warning")
    print(f"largest change of the contact speed without a warning: {100 * largest:.1f} %")
    return int(wrong > 0)


def main() -> None:
    """Read the options, and run the check."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100, help="loops of each of the three kinds")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    sys.exit(check(options.count, options.seed))


if __name__ == "__main__":
    main()
