"""Measure encounters that are solved by numerical integration: custom laws, and obstacles with a course.

Custom laws are compared with SciPy's LSODA. The compiled solver of the virtual damper is compared with the numerical
integration of the same force, for an obstacle that stops and comes again.

Run with `python -m benchmarks.custom_laws`; `--encounters` is the number that is compared. `--quick` computes
one Pareto front instead of two.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

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


def contact_by_lsoda(gain: float) -> float:
    """Return the relative velocity at contact [m/s] by SciPy's LSODA, for one encounter."""

    def distance(time: float, state: Any) -> float:
        return float(START + SPEED * time - state[0])

    def rates(time: float, state: Any) -> tuple[float, float]:
        at = max(distance(time, state), 0.0)
        force = by_numbers(gain, 0.0, SENSOR.log_slope(at) * (SPEED - state[1]))
        return state[1], force - 10.0 * state[1] - 25.0 * state[0]

    distance.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(rates, (0.0, 600.0), (0.0, 0.0), method="LSODA", events=distance, rtol=1e-13, atol=1e-15)
    return SPEED - float(run.y[1, -1])


COURSE = (
    pt.motion.Stretch(until=0.05),
    pt.motion.Stretch(until=0.09, acceleration=5.0),
    pt.motion.Stretch(until=0.3),
    pt.motion.Stretch(until=0.4, acceleration=-3.0),
)
DAMPER = CustomLaw(
    kind="custom damper", number=LawNumber("gain", "D_p", "N*s", -1), force=lambda d, _, rate: d * rate, vectorized=True
)


def compare_course(gains: Any) -> None:
    """Print the time of encounters with a course by the compiled solver and by numerical integration."""
    obstacle = pt.Obstacle(position=START, velocity=-0.2, course=COURSE)
    scenario = pt.Scenario(admittance=SCENARIO.admittance, obstacle=obstacle)
    laws: tuple[Any, ...] = ("virtual-damper", DAMPER)
    runs = [processor_time(lambda law=law: pt.find_contact(scenario, SENSOR, gains, law=law)) for law in laws]  # type: ignore[misc]
    (compiled, result), (integrated, expected) = runs
    error = np.abs(result.contact.relative_velocity / expected.contact.relative_velocity - 1).max()
    print(f"processor time of {len(gains)} encounters of the damper with an obstacle that stops and comes again")
    print(f"  numerical integration {1e3 * integrated / len(gains):8.3f} ms per encounter")
    print(
        f"  compiled solver       {1e3 * compiled / len(gains):8.3f} ms per encounter,"
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
    parser.add_argument("--quick", action="store_true", help="no Pareto front by single numbers")
    options = parser.parse_args()
    gains = -np.geomspace(0.05, 5.0, options.encounters)
    peer, expected = processor_time(lambda: np.array([contact_by_lsoda(gain) for gain in gains.tolist()]))
    print(f"processor time of {len(gains)} encounters of a custom law, each relative to LSODA one after the other")
    print(f"  LSODA of SciPy      {1e3 * peer / len(gains):8.2f} ms per encounter")
    for name, law in LAWS.items():
        spent, result = processor_time(lambda law=law: pt.find_contact(SCENARIO, SENSOR, gains, law=law))  # type: ignore[misc]
        error = np.abs(result.contact.relative_velocity / expected - 1).max()
        print(
            f"  force of {name:14s} {1e3 * spent / len(gains):6.2f} ms per encounter,"
            f" {peer / spent:6.1f} times as fast, largest difference of l' {error:.0e}"
        )
    compare_course(gains)
    print("processor time of a Pareto front of excursion and contact speed")
    for name, law in list(LAWS.items())[1 if options.quick else 0 :]:
        task = pt.Task(SCENARIO, SENSOR, law=law, bounds=(-5.0, -0.01))
        spent, front = processor_time(lambda task=task: pt.pareto_front(task))  # type: ignore[misc]
        print(f"  force of {name:14s} {spent:6.2f} s, {len(front.gain)} points")


if __name__ == "__main__":
    main()
