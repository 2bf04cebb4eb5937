"""Measure the additional time of derivatives and largest demands over contacts, as ratios of pairs run in turn.

Times are processor times of all threads, which hardly depend on other programs.

Run with `python -m benchmarks.gradients`; `--count` is the number of encounters, `--seconds` the time per pair.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

import pretouch as pt

from .peers.work import contacts, processors
from .solving import SCENARIO
from .solving import SENSORS as LETTER

SENSORS = LETTER | {
    "exponential-2": pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
    "mittag-leffler": pt.MittagLeffler(scale=1.0, rate=-80.0, order=0.8),
    "table": pt.Table(
        distances=(0.0, 0.005, 0.012, 0.02, 0.03, 0.045, 0.06),
        outputs=(0.46, 0.31, 0.205, 0.13, 0.083, 0.041, 0.022),
    ),
}
STATES = ("time", "position", "velocity", "acceleration", "relative_velocity", "virtual_force")
DEMANDS = (
    "largest_excursion",
    "largest_travel",
    "largest_speed",
    "largest_acceleration",
    "largest_virtual_force",
)
INPUTS = (
    *("gain", "admittance.mass", "admittance.damping", "admittance.stiffness"),
    *(f"{body}.{field}" for body in ("plant", "obstacle", "reference") for field in ("position", "velocity")),
)
FOLLOWED = 400

Run = Callable[[], pt.motion.ContactResult]
"""Finds contacts anew: nothing that is read is kept from call to call."""


def states(run: Run, names: tuple[str, ...] = STATES) -> pt.motion.ContactResult:
    """Find contacts and read quantities at contact."""
    found = run()
    for name in names:
        getattr(found.end, name)
    return found


def derivatives(run: Run, inputs: tuple[str, ...]) -> None:
    """Find contacts, states, and the derivatives of time and l' by some inputs."""
    gradients = states(run).gradients
    for by in inputs:
        gradients.of("time", by)
        gradients.of("relative_velocity", by)


def in_turn(first: Callable[[], object], second: Callable[[], object], seconds: float) -> tuple[float, float]:
    """Run two jobs in turn for some seconds; return the shortest time of the first [s] and the median of the ratios."""
    end, times = time.perf_counter() + seconds, []
    while len(times) < 3 or time.perf_counter() < end:
        start = time.process_time()
        first()
        middle = time.process_time()
        second()
        times.append((middle - start, time.process_time() - middle))
    return min(a for a, _ in times), statistics.median(b / a for a, b in times)


def rows(name: str, count: int, seconds: float) -> str:
    """Measure one curve; return a row of ratios."""
    speed, gain = contacts(count)
    scenario = pt.Scenario(
        admittance=SCENARIO.admittance, obstacle=pt.Obstacle(position=SCENARIO.obstacle.position, velocity=speed)
    )

    def run() -> pt.motion.ContactResult:
        return pt.find_contact(scenario, SENSORS[name], gain)

    jobs: tuple[Callable[[], object], ...] = (
        lambda: derivatives(run, INPUTS[:1]),
        lambda: derivatives(run, INPUTS),
        lambda: states(run, (*STATES, "largest_travel")),
        lambda: states(run, (*STATES, *DEMANDS)),
    )
    states(run)
    pairs = []
    for job in jobs:
        job()  # compiles, or loads, what it needs
        pairs.append(in_turn(lambda: states(run), job, seconds))
    base = min(shortest for shortest, _ in pairs)
    ratios = "".join(f"{ratio - 1:12.2f}" for _, ratio in pairs)
    return f"{name:16s}{base / count * 1e9:10.0f} ns{ratios}"


def followed(count: int) -> str:
    """Measure derivatives that are integrated along the motion: by the order of a Mittag-Leffler curve."""
    speed, gain = contacts(count)
    scenario = pt.Scenario(
        admittance=SCENARIO.admittance, obstacle=pt.Obstacle(position=SCENARIO.obstacle.position, velocity=speed)
    )
    best = float("inf")
    for _ in range(3):
        gradients = states(lambda: pt.find_contact(scenario, SENSORS["mittag-leffler"], gain)).gradients
        start = time.process_time()
        found = gradients.of("time", "sensor.order")
        best = min(best, time.process_time() - start)
    assert np.isfinite(found).all(), "a contact without its derivative"  # noqa: S101 - a program, not the package
    return f"followed, by the order of the Mittag-Leffler curve: {best / count * 1e3:.2f} ms each"


def main() -> None:
    """Print a row for each curve."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gradients", description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=float, default=1e5, help="of encounters (default 1e5)")
    parser.add_argument("--seconds", type=float, default=2.0, help="for each pair (default 2)")
    asked = parser.parse_args()
    count = int(asked.count)
    print(
        f"\n{count:,} encounters on {processors()} processors; what is read on top of contacts and states, over these"
    )
    head = ("derivative", f"all {len(INPUTS)}", "one demand", f"all {len(DEMANDS)}")
    print(f"{'':16s}{'contacts':>13s}" + "".join(f"{title:>12s}" for title in head))
    for name in SENSORS:
        print(rows(name, count, asked.seconds), flush=True)
    print(followed(min(count, FOLLOWED)))


if __name__ == "__main__":
    main()
