"""Measure encounters of the sampled loop per second, compared with MuJoCo, and the accuracy of stability limits.

Run with `python -m benchmarks.loops`; `--quick` uses fewer runs and part of the grid.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from loop_samples import grows, simulated_limit
from mujoco_witness import witness_encounter

from .peers.protocol import missing
from .peers.work import processors
from .solving import SCENARIO, SENSORS

PERIOD = 1e-3
SENSOR = SENSORS["inverse-power"]
GAIN = -0.7463
LAW = Controller(
    period=PERIOD,
    conditioning=Conditioning(floor=1e-3),
    law=VirtualDamper(gain=GAIN),
    admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
)
CHAIN = pt.SensorChain(rate=1 / PERIOD, exposure=170e-6, delay=120e-6, noise=1e-3, relative_noise=2e-3)
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0)
CONTACT = pt.simulation.SpringDamper(stiffness=3e4, damping=60.0, obstacle_mass=1.0)
CASES: dict[str, dict[str, Any]] = {
    "ideal robot, until contact": {},
    "robot and contact, 0.2 s beyond": {"plant": ROBOT, "contact": CONTACT},
}
RUNS = 10_000
ROUNDS = 5
WITNESS_STEP = 1e-4  # the coarsest of the agreement test: 0.3 % of the peak force

RATES = (15.0, 30.0, 60.0, 125.0, 250.0, 500.0, 1000.0, 4000.0)
PARTS = (0.0, 0.25, 0.5, 1.0, 1.5, 2.5, 4.0)  # of a period: the delay
LARGEST_DIFFERENCE = 0.05
_HALVINGS = 12  # of a bracket of a factor of four: to 0.03 %
_PERIODS = 400


def throughput(count: int, rounds: int) -> list[str]:
    """Time many noisy encounters, warm; return a row for each case."""
    found = []
    for name, robot in CASES.items():
        # the same work but for the number of runs: compiled, and the table of the curve is there
        pt.simulation.simulate_loop(SCENARIO, SENSOR, LAW, chain=CHAIN, runs=64, seed=1, **robot)
        times, work = [], []
        for seed in range(rounds):
            start, worked = time.perf_counter(), time.process_time()
            run = pt.simulation.simulate_loop(SCENARIO, SENSOR, LAW, chain=CHAIN, runs=count, seed=seed, **robot)
            times.append(time.perf_counter() - start)
            work.append(time.process_time() - worked)
        best, median = min(times), float(np.median(times))
        step = min(work) / count / (float(np.mean(run.end_time)) / PERIOD)  # of all threads
        found.append(
            f"{name:34s}{best:7.2f} s{median:7.2f} s{count / best:9,.0f} runs/s{int(run.touched.sum()):9,d} contacts"
            f"{min(work):9.2f} s of processors{step * 1e9:7.0f} ns a step"
        )
    return found


def beside_mujoco(rounds: int) -> str:
    """Time encounters of pretouch and MuJoCo in turn: robot, contact, ideal sensor; pretouch alone and in a batch."""
    pair = CASES["robot and contact, 0.2 s beyond"]
    many = 1000
    ours, each, theirs, ratios = [], [], [], []
    for _ in range(rounds):
        start = time.perf_counter()
        mine = pt.simulation.simulate_loop(SCENARIO, SENSOR, LAW, **pair)
        ours.append(time.perf_counter() - start)
        start = time.perf_counter()
        pt.simulation.simulate_loop(SCENARIO, SENSOR, LAW, runs=many, **pair)
        each.append((time.perf_counter() - start) / many)
        start = time.perf_counter()
        other = witness_encounter(SCENARIO, SENSOR, LAW, time_step=WITNESS_STEP, **pair)
        theirs.append(time.perf_counter() - start)
        ratios.append(theirs[-1] / each[-1])
    force = abs(other.peak_force / mine.peak_force - 1)
    speed = abs(other.relative_velocity / mine.relative_velocity - 1)
    return (
        f"one encounter: pretouch {min(ours) * 1e3:.2f} ms alone, {min(each) * 1e6:.0f} us out of {many:,}; MuJoCo, at "
        f"{WITNESS_STEP:g} s and with the law in Python, {min(theirs) * 1e3:.0f} ms: {np.median(ratios):,.0f}x the "
        f"latter; they differ by {speed:.0e} in l' and {force:.0e} in the peak force"
    )


def difference(rate: float, part: float) -> tuple[float, float]:
    """Compare the limit of one loop; return the predicted damping [N s/m] and the relative difference of the simulated.

    The curve has g = -1/m everywhere, so the damping is -D_p; the loop steps twenty times per reading.
    """
    chain = pt.SensorChain(rate=rate, delay=part / rate)
    predicted = pt.simulation.largest_damping(
        SCENARIO.admittance, pt.simulation.LoopTiming(rate=rate, delay=chain.delay)
    ).damping
    curve = pt.ExponentialFirstOrder(scale=1.0, rate=-1.0)
    scenario = pt.Scenario(
        admittance=SCENARIO.admittance, obstacle=pt.Obstacle(position=1.0), plant=pt.Plant(position=1e-4)
    )

    def growth(damping: float) -> float:
        law = Controller(
            period=chain.period / 20,
            conditioning=Conditioning(floor=1e-3, sensor_period=chain.period),
            law=VirtualDamper(gain=-damping),
            admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        )
        return grows(pt.simulation.simulate_loop(scenario, curve, law, chain=chain, horizon=_PERIODS * chain.period))

    return predicted, simulated_limit(growth, predicted, _HALVINGS) / predicted - 1


def grid(rates: tuple[float, ...], parts: tuple[float, ...]) -> tuple[list[str], float]:
    """Compare limits over rates and delays; return a row for each rate, and the largest relative difference."""
    found = {point: difference(*point) for point in product(rates, parts)}
    lines = [f"{'rate':>8s}" + "".join(f"{part:>8g} T" for part in parts) + "   simulated over predicted - 1"]
    lines += [f"{rate:5g} Hz" + "".join(f"{found[rate, part][1]:>9.2%} " for part in parts) for rate in rates]
    return lines, max(abs(d) for _, d in found.values())


def main() -> None:
    """Print all results; end with an error if a limit is missed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.loops", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer runs, a corner of the grid")
    quick = parser.parse_args().quick
    count, rounds = (200, 2) if quick else (RUNS, ROUNDS)
    print(f"\n{count:,} encounters at {1 / PERIOD:g} Hz, warm, {processors()} processors: shortest and median")
    print("\n".join(throughput(count, rounds)))
    absent = missing("mujoco")
    print(f"one encounter compared with MuJoCo: {absent}" if absent else beside_mujoco(rounds))
    rates, parts = (RATES[2:4], PARTS[1:4:2]) if quick else (RATES, PARTS)
    print(f"\nstability limits at {len(rates) * len(parts)} points")
    lines, largest = grid(rates, parts)
    print("\n".join(lines))
    print(f"largest difference {largest:.2%}, allowed below {LARGEST_DIFFERENCE:.0%}")
    if largest >= LARGEST_DIFFERENCE:
        sys.exit("a predicted limit is missed")


if __name__ == "__main__":
    main()
