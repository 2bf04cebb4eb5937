"""Count tasks that are called infeasible although gains exist, and gains that depend on the given bounds.

    python -m benchmarks.narrow_bands --count 300 --seed 1

Each random task has limits that leave a narrow band of feasible gains, 0.3 to 5 % wide, around a known gain: between a
limit of strong gains and a limit of weak gains, or around the smallest value of one quantity. The program prints

- the tasks that a search calls infeasible although one of 4,000 gains is feasible,
- the tasks whose objective is higher than that of the best of the 4,000 gains, and
- the tasks whose gain depends on the bounds, of three ranges that contain it (required: none; then the exit code is 0).

It does so for designs by compiled code and by the full search, for virtual drags, for robust designs with several risk
measures and required probabilities, and for worst cases. Of Pareto fronts and of the gains that `verify` finds on the
simulated loop, it counts only the tasks that are wrongly infeasible: a front has no objective, and the search on the
loop resolves a gain to 0.1 %. Co-designs of gain and admittance must be feasible, and no worse than the gains at the
admittance of the band. The last four kinds take longer, so that they get a tenth of the tasks.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
from pretouch.designs import (
    ConditionalValueAtRisk,
    Constraint,
    Expected,
    HertzImpact,
    Quantile,
    Required,
    RobustOptions,
    WorstCase,
    design_admittance,
)
from pretouch.designs.evidence import GainEvidence
from pretouch.designs.problem import GainProblem
from pretouch.designs.robust import robust
from pretouch.designs.robust.problem import RobustProblem
from pretouch.designs.search import GainAxis, Landscape
from pretouch.motion import DAMPER, DRAG
from pretouch.uncertainty import Interval, TruncatedNormal, Uniform, sample_inputs
from pretouch.verification.appraisal import make_problem
from pretouch.verification.gain_search import GainSearch

BOUNDS = {DAMPER: (-10.0, -0.001), DRAG: (0.0001, 1.0)}
QUANTITIES = (
    "excursion",
    "travel",
    "time",
    "relative_velocity",
    "impact_force",
    "speed",
    "acceleration",
    "virtual_force",
)
GAINS = 4000
SAME = 1e-7  # largest relative difference of two objectives that count as the same
SAMPLES = 128
LOOP_RUNS = 2
AXES = ("mass", "damping", "stiffness")
WIDTHS = (3e-3, 5e-2)
_PLACES = 200  # gains at which quantities are compared to place a band


@dataclass(frozen=True)
class Kind:
    """A search that the benchmark measures.

    It has a name, the law, whether inputs vary, the search itself, whether the task has a loop, whether the admittance
    is free, and the share of the tasks.
    """

    name: str
    law: pt.ContinuousLaw
    varies: bool
    search: Callable[[pt.Task], tuple[float | None, float]]
    on_loop: bool = False
    is_free: bool = False
    is_worst: bool = False
    share: float = 1.0


def _designed(task: pt.Task) -> tuple[float | None, float]:
    design = pt.design(task)
    return design.gain, np.inf if design.gain is None else design.objective


def _scanned(task: pt.Task) -> tuple[float | None, float]:
    axis = GainAxis.between(task.stable_bounds(), task.law.number)
    design = GainEvidence(problem=GainProblem(task=task, axis=axis), settled=None)
    return design.gain, np.inf if design.gain is None else design.objective


def _robust(task: pt.Task) -> tuple[float | None, float]:
    design = robust(task)
    return design.gain, np.inf if design.value is None else design.value


def _front(task: pt.Task) -> tuple[float | None, float]:
    """Return the gain of any point of the front; a front has no objective."""
    gains = pt.pareto(task).gain
    return (float(gains[0]) if len(gains) else None), np.nan


def _together(task: pt.Task) -> tuple[float | None, float]:
    design = design_admittance(task)
    return design.gain, np.inf if design.gain is None else design.objective


def _on_loop(task: pt.Task) -> tuple[float | None, float]:
    """Return the best gain on the loop, as `verify` searches for it."""
    problem = problem_of(task)
    search = replace(problem.search, has_room=True, whole=False, tried={}).run([])
    best = search.best or search.relaxed().best
    return best, np.nan


KINDS = (
    Kind("design", DAMPER, False, _designed),
    Kind("design, full search", DAMPER, False, _scanned),
    Kind("design of a virtual drag", DRAG, False, _designed),
    Kind("robust", DAMPER, True, _robust),
    Kind("worst case", DAMPER, True, _robust, is_worst=True, share=0.1),
    Kind("Pareto front", DAMPER, False, _front, share=0.1),
    Kind("gain and admittance", DAMPER, False, _together, is_free=True, share=0.1),
    Kind("verify on the loop", DAMPER, False, _on_loop, on_loop=True, share=0.1),
)


@dataclass(frozen=True)
class LoopProblem:
    """The gains of a simulated loop: the ratios of the limits, and of the other requirements of a verdict."""

    search: GainSearch

    @property
    def axis(self) -> GainAxis:
        """The search variable of the gain."""
        return self.search.axis

    def every(self, coordinate: np.ndarray) -> Landscape:
        """Return the objective and the ratios of all requirements."""
        return self.search.landscape(coordinate)

    def landscape(self, coordinate: np.ndarray) -> Landscape:
        """Return the objective and the ratios of the limits."""
        found = self.every(coordinate)
        return Landscape(objective=found.objective, ratios=found.ratios[2:])  # after contact and contact speed


def problem_of(task: pt.Task) -> GainProblem | LoopProblem:
    """Return the problem whose gains a search evaluates."""
    axis = GainAxis.between(task.stable_bounds(), task.law.number)
    if task.loop is not None:
        problem = make_problem(task, max(task.bounds))
        fields = {"problem": problem, "loop": task.loop, "axis": axis, "margin": None, "runs": task.verify.runs}
        return LoopProblem(GainSearch(**fields, has_room=False, whole=True))
    if not task.uncertainty:
        return GainProblem(task=task, axis=axis)
    options = task.robust
    if isinstance(options.measure, WorstCase):
        box = {name: distribution.support for name, distribution in task.uncertainty.items()}
        return RobustProblem.over(task, axis, {name: np.linspace(*ends, SAMPLES) for name, ends in box.items()})
    values = sample_inputs(task.uncertainty, SAMPLES, seed=options.seed, sampling=options.sampling)
    return RobustProblem.over(task, axis, values, count=SAMPLES)


def random_task(kind: Kind, rng: np.random.Generator) -> pt.Task:
    """Draw an encounter without limits."""
    curves = (
        pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        pt.InversePower(scale=4.8, distance_offset=0.01101, exponent=2.101),
        pt.ExponentialFirstOrder(scale=1.0, rate=-float(rng.uniform(20.0, 60.0))),
    )
    speed = float(10 ** rng.uniform(-1.0, 0.0))
    scenario = pt.Scenario(
        admittance=pt.Admittance(
            mass=float(10 ** rng.uniform(-0.5, 0.7)),
            damping=float(10 ** rng.uniform(0.0, 1.7)),
            stiffness=float(rng.choice([0.0, 10 ** rng.uniform(0.0, 2.5)][kind.is_free :])),
        ),
        obstacle=pt.Obstacle(position=float(rng.uniform(0.02, 0.1)), velocity=-speed),
    )
    scale = float(rng.uniform(0.05, 1.0))
    objective = (
        pt.excursion_objective(position_scale=scale, velocity_scale=speed)
        if rng.random() < 0.6
        else pt.time_objective(time_scale=scale, velocity_scale=speed)
    )
    task = pt.Task(
        *(scenario, curves[rng.integers(len(curves))], objective),
        bounds=BOUNDS[kind.law],
        law=kind.law,
        impact=HertzImpact(robot_mass=0.4, effective_modulus=1e7, radius=0.01),
    )
    if kind.on_loop:
        virtual = VirtualAdmittance(**{name: getattr(scenario.admittance, name) for name in AXES})
        start = float(np.exp(task.sensor.log_output(scenario.obstacle.position)))
        sensing = Conditioning(floor=start, sensor_period=1e-3)
        law = Controller(period=1e-3, conditioning=sensing, law=VirtualDamper(gain=0.0), admittance=virtual)
        chain = pt.SensorChain(rate=1e3)
        loop = pt.ClosedLoop(law=law, chain=chain, horizon=20.0)
        return task.replace(loop=loop, verify=pt.designs.VerifyOptions(runs=LOOP_RUNS))
    if kind.is_free:
        a = scenario.admittance
        ratio = a.damping / (2 * np.sqrt(a.mass * a.stiffness))
        return task.replace(damping_ratio=(float(ratio) / 1.3, float(ratio) * 1.3))
    if not kind.varies:
        return task
    if kind.is_worst:
        spread = float(rng.uniform(0.05, 0.3)) * speed
        speeds = Interval(low=-speed - spread, high=-speed + spread)
        return task.replace(uncertainty={"obstacle.velocity": speeds}, robust=RobustOptions(measure=WorstCase()))
    spread = float(rng.uniform(0.05, 0.3)) * speed
    speeds = TruncatedNormal(location=-speed, deviation=spread / 2, low=-speed - spread, high=-speed + spread)
    measures = (Expected(), Quantile(probability=0.9), ConditionalValueAtRisk(probability=0.9))
    measure = measures[rng.integers(len(measures))]
    uncertainty = {"obstacle.velocity": speeds, "admittance.mass": Uniform(low=0.9, high=1.1)}
    if rng.random() < 0.5 or scenario.admittance.mass < 0.9 or scenario.admittance.mass > 1.1:
        del uncertainty["admittance.mass"]
    options = RobustOptions(samples=SAMPLES, validation=16, measure=measure)
    return task.replace(uncertainty=uncertainty, robust=options)


def with_band(task: pt.Task, rng: np.random.Generator) -> tuple[pt.Task, float] | None:
    """Add limits that leave a narrow band of gains; return also a gain of this band, or None without such limits."""
    names = rng.permutation(QUANTITIES)[:4].tolist()
    certain = not task.uncertainty or isinstance(task.robust.measure, WorstCase) or rng.random() < 0.5

    def limit(name: str, size: float) -> Constraint | Required:
        constraint = Constraint(name=name, limit=size)
        return constraint if certain else Required(constraint=constraint, probability=0.9)

    problem = problem_of(task.replace(constraints=tuple(limit(name, 1.0) for name in names)))
    low, high = problem.axis.span
    u = np.linspace(low, high, _PLACES)[5:-5]
    scanned = problem.landscape(u)
    usable = scanned.reached & np.isfinite(scanned.ratios).all(axis=0)
    if usable.sum() < 40:
        return None
    u, width = u[usable], float(np.exp(rng.uniform(*np.log(WIDTHS))))
    at = float(rng.choice(u[5:-5]))
    ends = at + 0.5 * width * np.array([-1.0, 1.0])
    values = problem.landscape(np.array([ends[0], at, ends[1]])).ratios
    grows, falls = (values[:, 2] > values[:, 1]) & (values[:, 1] > values[:, 0]), values[:, 0] > values[:, 1]
    falls &= values[:, 1] > values[:, 2]
    if grows.any() and falls.any() and rng.random() < 0.8:
        one, other = int(rng.choice(np.flatnonzero(grows))), int(rng.choice(np.flatnonzero(falls)))
        limits = (limit(names[one], float(values[one, 2])), limit(names[other], float(values[other, 0])))
        return task.replace(constraints=limits), float(problem.axis.gain(at))
    if task.loop is not None:  # the ripples of a sampled loop have smallest values by chance
        return None
    for k, name in enumerate(names):  # around the smallest value of a quantity
        row = scanned.ratios[k][usable]
        i = int(np.argmin(row))
        if 5 <= i < len(row) - 5 and np.ptp(row) > 1e-3 * row[i]:
            near = np.linspace(u[i - 1], u[i + 1], 401)
            valley = problem.landscape(near).ratios[k]
            least = int(np.argmin(valley))
            outside = problem.landscape(near[least] + 0.5 * width * np.array([-1.0, 1.0])).ratios[k]
            if np.isfinite(outside).all() and outside.min() > valley[least] * (1 + 1e-9):
                return task.replace(constraints=(limit(name, float(outside.min())),)), float(
                    problem.axis.gain(near[least])
                )
    return None


def tasks(kind: Kind, count: int, seed: int) -> Iterator[tuple[int, pt.Task, float]]:
    """Yield random tasks with a narrow band, with their number and a feasible gain."""
    found = number = 0
    while found < count:
        rng = np.random.default_rng([seed, number])
        number += 1
        banded = with_band(random_task(kind, rng), rng)
        if banded is not None:
            found += 1
            yield number - 1, *banded


def best_of_many(task: pt.Task, known: float) -> float:
    """Return the lowest objective of 4,000 gains within the bounds, and of as many around a known gain."""
    problem = problem_of(task)
    low, high = problem.axis.span
    near = np.clip(float(problem.axis.coordinate(known)) + np.linspace(-0.05, 0.05, GAINS // 10), low, high)
    if isinstance(problem, LoopProblem):  # the other gains take too long; one feasible gain is enough
        return float(problem.every(near[::20]).merit.min())
    return float(problem.landscape(np.concatenate([np.linspace(low, high, GAINS), near])).merit.min())


def check(kind: Kind, count: int, seed: int) -> int:
    """Search random tasks with three ranges of gains; print and return the number of wrong answers."""
    infeasible = worse = depends = 0
    for number, task, known in tasks(kind, count, seed):
        low, high = BOUNDS[kind.law]
        ranges = ((low, high), *(sorted((known * f, known / f)) for f in (4.0, 1.5)))
        answers = [kind.search(task.replace(bounds=(max(low, a), min(high, b)))) for a, b in ranges]
        brute = best_of_many(task, known)
        gain, objective = answers[0]
        if any(found is None for found, _ in answers) and np.isfinite(brute):
            infeasible += 1
            print(f"  {kind.name} {number}: infeasible with {[g is None for g, _ in answers]}, though {known:g} is not")
        elif objective > brute * (1 + SAME):
            worse += 1
            print(f"  {kind.name} {number}: {gain}, objective {objective}; a scan has {brute}")
        elif gain is not None and any(
            g is not None and not kind.is_free and abs(o / objective - 1) > SAME
            for (g, o), (a, b) in zip(answers, ranges, strict=True)
            if a < gain < b
        ):
            depends += 1
            print(f"  {kind.name} {number}: answers {answers} with bounds {ranges}")
    print(
        f"  {kind.name}: {count} tasks, seed {seed}: {infeasible} wrongly infeasible, {worse} worse than a scan of "
        f"{GAINS} gains, {depends} with gains that depend on the bounds",
        flush=True,
    )
    return infeasible + worse + depends


def main() -> int:
    """Check every search."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=300, help="random tasks of each search")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="part of the name of a search")
    options = parser.parse_args()
    print("Tasks with a narrow band of feasible gains")
    kinds = [kind for kind in KINDS if options.only in kind.name]
    return int(sum(check(kind, math.ceil(kind.share * options.count), options.seed) for kind in kinds) > 0)


if __name__ == "__main__":
    sys.exit(main())
