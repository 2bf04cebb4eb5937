"""Measure designs with limits: their time compared with designs without limits, and their agreement with a full scan.

    python -m benchmarks.limits --check 1000 --seed 1

Times are processor times of all threads, as ratios of pairs that run in turn. The check draws random encounters with
one to three limits. It compares the compiled search with the adaptive scan of the same task, and prints

- the share of tasks that the compiled search decides, and
- the number of decisions that differ from the adaptive scan (required: none; then the exit code is 0).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

import numpy as np

import pretouch as pt
from pretouch.designs.evidence import GainEvidence
from pretouch.designs.problem import GainProblem
from pretouch.designs.search import GainAxis
from pretouch.designs.search.compiled import INFEASIBLE, OPTIMAL, search_compiled

from .gradients import in_turn
from .solving import SENSORS

OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
LIMITS = (pt.Constraint(name="excursion", limit=0.1), pt.Constraint(name="acceleration", limit=6.0))
RANGES = {
    "excursion": (0.003, 0.3),
    "travel": (0.003, 0.3),
    "relative_velocity": (0.02, 0.5),
    "time": (0.05, 1.0),
    "speed": (0.02, 1.0),
    "acceleration": (0.3, 30.0),
    "virtual_force": (0.3, 50.0),
}
BOUNDS = (-10.0, -0.01)
SAME = 2e-9  # largest relative difference of two objectives


def encounter(velocity: object, damping: object = 10.0) -> pt.Scenario:
    return pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=damping, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.0422, velocity=velocity),
    )


def times(seconds: float, count: int) -> None:
    """Print the time of designs without limits, and the ratio of designs with one and two limits."""
    rng = np.random.default_rng(1)
    speeds, damping = -rng.uniform(0.05, 1.0, count), rng.uniform(9.0, 12.0, count)
    scenarios = {
        "one design": (encounter(-0.3), 1),
        f"{count} designs that differ in two inputs": (encounter(speeds, damping), count),
        f"{count} designs that differ in their speed": (encounter(speeds), count),
    }
    for name, sensor in SENSORS.items():
        for kind, (scenario, size) in scenarios.items():
            task = pt.Task(scenario, sensor, OBJECTIVE, bounds=BOUNDS)
            for limits in (LIMITS[:1], LIMITS):
                limited = task.replace(constraints=limits)
                first, ratio = in_turn(lambda task=task: pt.design(task), lambda task=limited: pt.design(task), seconds)
                print(
                    f"  {name}, {kind}: {1e6 * first / size:.2f} us per design, "
                    f"{ratio:.2f} times as long with {len(limits)} limits",
                    flush=True,
                )


def million(count: int) -> None:
    """Print the time of many designs with a limit that differ in their speed and limit."""
    speeds = np.linspace(-1.0, -0.05, count // 10)
    for name, sensor in SENSORS.items():
        start = time.perf_counter()
        for limit in np.geomspace(0.02, 0.2, 10):
            task = pt.Task(encounter(speeds), sensor, OBJECTIVE, bounds=BOUNDS)
            pt.design(task.replace(constraints=[pt.Constraint(name="excursion", limit=float(limit))]))
        print(f"  {name}: {10 * len(speeds)} designs with one limit in {time.perf_counter() - start:.1f} s")


def random_problem(rng: np.random.Generator) -> GainProblem:
    """Draw an encounter with one to three limits."""
    sensor: pt.sensors.SensorModel = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    if rng.random() < 0.4:
        sensor = pt.ExponentialFirstOrder(scale=1.0, rate=-float(rng.uniform(20.0, 60.0)))
    scenario = pt.Scenario(
        admittance=pt.Admittance(
            mass=float(10 ** rng.uniform(-0.5, 0.7)),
            damping=float(10 ** rng.uniform(0.0, 1.7)),
            stiffness=float(rng.choice([0.0, 10 ** rng.uniform(0.0, 2.5)])),
        ),
        obstacle=pt.Obstacle(position=float(rng.uniform(0.01, 0.08)), velocity=-float(10 ** rng.uniform(-1.3, 0.3))),
    )
    names = rng.choice(list(RANGES), size=rng.integers(1, 4), replace=False).tolist()
    limits = [pt.Constraint(name=n, limit=float(10 ** rng.uniform(*np.log10(RANGES[n])))) for n in names]
    scale = float(rng.uniform(0.1, 1.0))
    objective = (
        pt.excursion_objective(position_scale=scale, velocity_scale=0.3)
        if rng.random() < 0.6
        else pt.time_objective(time_scale=scale, velocity_scale=0.3)
    )
    task = pt.Task(scenario, sensor, objective, bounds=BOUNDS, constraints=limits)
    return GainProblem(task=task, axis=GainAxis(low=BOUNDS[0], high=BOUNDS[1]))


def check(count: int, seed: int) -> int:
    """Compare the compiled search with the adaptive scan; return the number of different decisions."""
    outcomes: Counter[str] = Counter()
    different = 0
    for number in range(count):
        problem = random_problem(np.random.default_rng([seed, number]))
        found, known = search_compiled(problem), GainEvidence(problem=problem, settled=None)
        if found is None:
            raise RuntimeError("the compiled search does not support a task of this benchmark")
        _, objective, outcome = found[:, 0]
        status = str(known.status.value)
        outcomes["decided" if outcome in {OPTIMAL, INFEASIBLE} else f"left to the full scan, {status}"] += 1
        right = outcome != INFEASIBLE or status == "infeasible"
        if outcome == OPTIMAL:
            right = status == "optimal" and abs(objective - known.objective) <= SAME * known.objective
        if not right:
            different += 1
            print(f"  task {number} differs: {status}, objective {known.objective} instead of {objective}")
    print(f"  {count} random tasks, seed {seed}: {dict(outcomes)}; {different} different decisions")
    return different


def main() -> int:
    """Measure the times and run the check."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=2.0, help="time of each pair")
    parser.add_argument("--count", type=int, default=2000, help="designs of an array")
    parser.add_argument("--many", type=int, default=1_000_000, help="designs of the largest array; 0 for none")
    parser.add_argument("--check", type=int, default=300, help="random tasks that are compared with the full scan")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print("Designs with limits")
    times(options.seconds, options.count)
    if options.many:
        million(options.many)
    return int(check(options.check, options.seed) > 0)


if __name__ == "__main__":
    sys.exit(main())
