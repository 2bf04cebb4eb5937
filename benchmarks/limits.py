"""Measure designs with limits: their time compared with designs without limits, and their agreement with a full scan.

    python -m benchmarks.limits --check 1000 --seed 1

Times are processor times of all threads, as ratios of pairs that run in turn. The check draws random encounters with
one to three limits. It compares the compiled search with the adaptive scan of the same task, and prints

- the share of tasks that the compiled search decides, and
- the number of decisions that differ from the adaptive scan (required: none; then the exit code is 0).

It also draws co-designs of gain and admittance with one to three limits. Some limits lie at a kink of the limited
quantity. A grid of admittances, each with a grid of gains, is narrowed around its best points without derivatives. The
program prints the number of co-designs that are worse by more than 1e-4 (required: none).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from dataclasses import replace

import numpy as np

import pretouch as pt
from pretouch.designs import design_admittance
from pretouch.designs.evidence import GainEvidence
from pretouch.designs.problem import GainProblem
from pretouch.designs.search import GainAxis
from pretouch.designs.search.compiled import INFEASIBLE, OPTIMAL, search_compiled
from pretouch.designs.search.freedom import make_freedom
from pretouch.designs.search.trials import Trials

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
WORSE = 1e-4  # largest relative difference of a co-design from the best of a grid
_KINKED = ("acceleration", "speed", "excursion", "travel", "virtual_force")
_ADMITTANCES = {1: 201, 2: 21}  # values of each free parameter of the admittance in the first grid, by their number
_STARTS = 3  # points of this grid around which it is narrowed


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


def trials_of(task: pt.Task) -> Trials:
    """Return the evaluation of the gains and admittances of a co-design."""
    free = task.natural_frequency, task.damping_ratio
    freedom = make_freedom(task.scenario, task.stable_bounds(), *free, law=task.law)
    problem = GainProblem(task=task, axis=freedom.axis)
    return Trials(freedom=freedom, encounters=problem, measures=(problem.merit,))


def random_co_design(rng: np.random.Generator) -> pt.Task | None:
    """Draw a co-design with one to three limits that some gain and admittance meets; None if few end in contact."""
    task = random_problem(rng).task
    frequency, ratio = float(rng.uniform(2.0, 8.0)), float(rng.uniform(0.4, 1.2))
    own = pt.Admittance.from_natural_frequency(
        mass=task.scenario.admittance.mass, natural_frequency=frequency, damping_ratio=ratio
    )
    free = {
        name: (value / float(rng.uniform(1.05, 2.0)), value * float(rng.uniform(1.05, 2.0)))
        for name, value in (("natural_frequency", frequency), ("damping_ratio", ratio))
    }
    if rng.random() < 0.5:
        del free[str(rng.choice(list(free)))]
    names = rng.choice(_KINKED, size=rng.integers(1, 4), replace=False, p=[0.4, 0.15, 0.15, 0.15, 0.15]).tolist()
    limits = tuple(pt.Constraint(name=name, limit=1.0) for name in names)
    task = task.replace(scenario=replace(task.scenario, admittance=own), constraints=limits, **free)
    trials = trials_of(task)
    ends = trials.freedom.spread(64)[rng.integers(64, size=2)]
    rows, reached = trials.rows(ends[0] + np.linspace(0.0, 1.0, 401)[:, None] * (ends[1] - ends[0]))
    if not reached.all():
        return None
    bend = np.round(np.diff(rows[:, 1], n=2) / rows[1:-1, 1], 6)  # the same limit on every processor
    at = 1 + int(bend.argmax()) if rng.random() < 0.7 else int(rng.integers(401))
    sizes = rows[at, 1:] * np.append(1.0, rng.uniform(1.0, 1.1, len(names) - 1))
    return task.replace(
        constraints=tuple(pt.Constraint(name=n, limit=float(s)) for n, s in zip(names, sizes, strict=True))
    )


def best_gains(
    trials: Trials, admittances: np.ndarray, low: np.ndarray, high: np.ndarray, first: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest objective of each admittance and its gain, from grids of gains that are narrowed."""
    best, at, count = np.full(len(admittances), np.inf), 0.5 * (low + high), first
    for _ in range(7):
        gains = np.linspace(low, high, count, axis=1)
        repeated = np.repeat(admittances, count, axis=0)
        values = trials.values(np.column_stack([gains.reshape(-1), repeated]))[:, 0].reshape(gains.shape)
        lowest = values.argmin(axis=1)[:, None]
        value = np.take_along_axis(values, lowest, axis=1)[:, 0]
        at = np.where(value < best, np.take_along_axis(gains, lowest, axis=1)[:, 0], at)
        best, half, count = np.minimum(best, value), (high - low) / (count - 1), 9
        low, high = np.clip(at - half, 0.0, 1.0), np.clip(at + half, 0.0, 1.0)
    return best, at


def best_of_grids(trials: Trials) -> float:
    """Return the lowest objective of grids of admittances and gains that are narrowed around the best points."""
    size = trials.freedom.size - 1

    def grid(one: np.ndarray) -> np.ndarray:
        return np.stack(np.meshgrid(*[one] * size), axis=-1).reshape(-1, size)

    every = grid(np.linspace(0.0, 1.0, _ADMITTANCES[size]))
    values, gains = best_gains(trials, every, np.zeros(len(every)), np.ones(len(every)), 97)
    starts: list[int] = []
    for i in np.argsort(values, kind="stable").tolist():
        if len(starts) < _STARTS and np.isfinite(values[i]):
            starts += [i] * all(np.abs(every[i] - every[j]).max() > 0.1 for j in starts)
    lowest = np.inf
    for i in starts:
        at, gain, value, radius = every[i], gains[i], values[i], 2 / (_ADMITTANCES[size] - 1)
        while radius > 1e-7:
            near = np.clip(at + radius * grid(np.linspace(-1.0, 1.0, 9)), 0.0, 1.0)
            window = (np.full(len(near), np.clip(gain + sign * 8 * radius, 0.0, 1.0)) for sign in (-1, 1))
            found, best = best_gains(trials, near, *window, 25)
            k = int(found.argmin())
            far = found[k] < value and np.abs(near[k] - at).max() > 0.6 * radius
            if found[k] < value:
                at, gain, value = near[k], best[k], found[k]
            radius *= 1.0 if far else 0.6
        lowest = min(lowest, float(value))
    return lowest


def check_together(count: int, seed: int) -> int:
    """Compare co-designs with narrowed grids; return the number of those that are worse."""
    worse = done = number = 0
    seconds, objectives = 0.0, []
    while done < count:
        task = random_co_design(np.random.default_rng([seed, number]))
        number += 1
        if task is None:
            continue
        done += 1
        start = time.process_time()
        design = design_admittance(task)
        seconds += time.process_time() - start
        found = np.inf if design.gain is None else design.objective
        least = best_of_grids(trials_of(task))
        objectives.append(found)
        if found > least * (1 + WORSE):
            worse += 1
            print(f"  co-design {number - 1}: objective {found}; a narrowed grid has {least}", flush=True)
    print(
        f"  {count} random co-designs, seed {seed}: {worse} worse than narrowed grids by more than {WORSE:g}; "
        f"{seconds:.1f} s of processor time; sum of the objectives "
        f"{sum(v for v in objectives if np.isfinite(v)):.9g}"
    )
    return worse


def main() -> int:
    """Measure the times and run the check."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=2.0, help="time of each pair; 0 for none")
    parser.add_argument("--count", type=int, default=2000, help="designs of an array")
    parser.add_argument("--many", type=int, default=1_000_000, help="designs of the largest array; 0 for none")
    parser.add_argument("--check", type=int, default=300, help="random tasks that are compared with the full scan")
    parser.add_argument("--together", type=int, default=60, help="random co-designs that are compared with grids")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print("Designs with limits")
    if options.seconds:
        times(options.seconds, options.count)
    if options.many:
        million(options.many)
    return int(check(options.check, options.seed) + check_together(options.together, options.seed) > 0)


if __name__ == "__main__":
    sys.exit(main())
