"""Measure custom laws, which SciPy's LSODA integrates one encounter at a time, and obstacles with a course.

Encounters with a course are solved by the compiled solver under the virtual damper and the virtual drag. They are
compared with custom laws of the same forces. Designs and fronts of a custom law are timed.

Run with `python -m benchmarks.custom_laws`; `--encounters` is the number of encounters. `--quick` computes neither a
robust design nor a Pareto front.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import pretouch as pt
from pretouch.motion import CustomLaw, LawNumber

SLOW = 1.0  # the rate of ln xi below which the law of docs/how-to/own-law.md ignores an approach [1/s]
NUMBER = LawNumber("gain", "D_z", "N*s", -1)
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SPEED, START = -0.3, 0.0422
SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=START, velocity=SPEED),
)


def by_numbers(gain: float, _: float, rate: float) -> float:
    """Return the force of the law for single numbers."""
    return gain * max(rate - SLOW, 0.0)


def by_arrays(gain: Any, _: Any, rate: Any) -> Any:
    """Return the force of the law for arrays."""
    return gain * np.maximum(rate - SLOW, 0.0)


LAWS = {
    "single numbers": CustomLaw(kind="dead-zone", number=NUMBER, force=by_numbers),
    "arrays": CustomLaw(kind="dead-zone", number=NUMBER, force=by_arrays, vectorized=True),
}


COURSE = (
    pt.motion.Stretch(until=0.05),
    pt.motion.Stretch(until=0.09, acceleration=5.0),
    pt.motion.Stretch(until=0.3),
    pt.motion.Stretch(until=0.4, acceleration=-3.0),
)
AGAIN = {
    "virtual-damper": CustomLaw(kind="damper", number=NUMBER, force=lambda gain, _, rate: gain * rate),
    "virtual-drag": CustomLaw(
        kind="drag",
        number=LawNumber("drag", "phi", "N*s^2", 1),
        force=lambda drag, _, rate: -drag * rate * max(rate, 0.0),
        suspends_admittance=True,
    ),
}


def compare_course(law: str, numbers: Any) -> None:
    """Print the time of encounters with a course by the compiled solver and by numerical integration."""
    obstacle = pt.Obstacle(position=START, velocity=-0.2, course=COURSE)
    scenario = pt.Scenario(admittance=SCENARIO.admittance, obstacle=obstacle)
    each: tuple[Any, ...] = (law, AGAIN[law])
    runs = [processor_time(lambda law=law: pt.find_contact(scenario, SENSOR, numbers, law=law)) for law in each]  # type: ignore[misc]
    (compiled, result), (integrated, expected) = runs
    error = np.abs(result.contact.relative_velocity / expected.contact.relative_velocity - 1).max()
    print(f"processor time of {len(numbers)} encounters of the {law} with an obstacle that stops and comes again")
    print(f"  custom law       {1e3 * integrated / len(numbers):8.3f} ms per encounter")
    print(
        f"  compiled solver  {1e3 * compiled / len(numbers):8.3f} ms per encounter,"
        f" {integrated / compiled:6.1f} times as fast, largest difference of l' {error:.0e}"
    )


def processor_time(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the processor time of a call [s] and its result."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--encounters", type=int, default=300)
    parser.add_argument("--quick", action="store_true", help="neither a robust design nor a Pareto front")
    parser.add_argument("--samples", type=int, default=4, help="samples of the robust design")
    options = parser.parse_args()
    gains = -np.geomspace(0.05, 5.0, options.encounters)
    pt.find_contact(SCENARIO, SENSOR, gains[:1], law=LAWS["arrays"])  # SciPy is loaded only now
    print(f"processor time of {len(gains)} encounters of a custom law")
    for name, law in LAWS.items():
        spent, result = processor_time(lambda law=law: pt.find_contact(SCENARIO, SENSOR, gains, law=law))  # type: ignore[misc]
        print(
            f"  force of {name:14s} {1e3 * spent / len(gains):6.2f} ms per encounter,"
            f" largest residual of the impulse balance {result.impulse_residual.max():.0e}"
        )
    compare_course("virtual-damper", gains)
    compare_course("virtual-drag", np.geomspace(1e-4, 0.02, options.encounters))
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    uniform = pt.uncertainty.Uniform(low=-0.4, high=-0.2)
    for name, law in LAWS.items():
        task = pt.Task(SCENARIO, SENSOR, objective, law=law, bounds=(-5.0, -0.01))
        several = task.replace(
            uncertainty={"obstacle.velocity": uniform}, robust=pt.designs.RobustOptions(samples=options.samples)
        )
        work: dict[str, Callable[[], Any]] = {"design": lambda task=task: pt.design(task)}  # type: ignore[misc]
        if not options.quick:
            work[f"robust design of {options.samples} samples"] = lambda task=several: pt.robust(task)  # type: ignore[misc]
            work["Pareto front"] = lambda task=task: pt.pareto(task.replace(objective=None))  # type: ignore[misc]
        for what, function in work.items():
            print(f"processor time of a {what}, force of {name}: {processor_time(function)[0]:.2f} s")


if __name__ == "__main__":
    main()
