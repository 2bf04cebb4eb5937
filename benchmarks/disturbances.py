"""Measure what the robot does if its sensor fails: with the exported C code, and on the whole simulated loop.

    python -m benchmarks.disturbances --count 40 --seed 1

Draws disturbances (kind, distance at which they begin, start distance and speed of the object) for the virtual damper
and the virtual drag. The damper has the settings that the verdict recommends. The exported law is compiled with gcc,
and moves an ideal robot in front of the object. The whole loop is the one of the scenario file, with its robot and
contact. For both it prints

- the largest speed toward the object that a disturbance causes, and the largest share of the bound that the verdict
  states (required: at most 1),
- the number of contacts that are harder than without mitigation by more than this bound (required: none), and
- the number of contacts that are harder than without mitigation at all, and the number of those that are not harder
  with stuck readings, which only the return of the admittance to its reference moves (required: none of them).

The exit code is 0 if the requirements are met. A law that returns the robot to its reference cannot make contact
softer in every case: while it returns, the robot moves toward the object, and the object can arrive at any time. The
page on verification has the proof.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import pretouch as pt
from pretouch.control.structures import RawOutput, RawSample
from pretouch.exports import export
from pretouch.simulation import Disturbance
from pretouch.simulation.sensing import SensorRun

EXAMPLES = Path(__file__).parents[1] / "examples"
HARDER, LEAST = 0.02, 1e-3  # share of a speed, and m/s: smaller increases do not count
LONGEST = 3.0  # s
KINDS = ("cable", "object-leaves", "reflectance", "reflectance", "full-scale")
STATE = 16_384  # bytes: more than the state of any exported law


@dataclass(frozen=True)
class Failure:
    """A disturbance in one encounter."""

    disturbance: Disturbance
    position: float  # of the object at the start [m]
    velocity: float  # of the object [m/s]
    seed: int


def draw_failures(count: int, seed: int) -> list[Failure]:
    """Draw disturbances that begin during approaches."""
    rng = np.random.default_rng(seed)
    failures = []
    for number in range(count):
        kind = KINDS[number % len(KINDS)]
        factor = float(rng.choice([0.5, 2.0])) if kind == "reflectance" else None
        position = float(rng.uniform(0.03, 0.06))
        event = Disturbance(kind=kind, distance=float(rng.uniform(0.05, 0.95)) * position, factor=factor)
        failures.append(Failure(event, position, -float(rng.uniform(0.1, 0.6)), number))
    return failures


def guarded(name: str) -> tuple[pt.Task, float, float]:
    """Return the scenario with the settings that its verdict recommends, the bound of this verdict, and the gain."""
    task = pt.load_scenario(EXAMPLES / f"{name}.toml")
    verify = replace(task.verify, runs=60)
    task = task.replace(verify=verify, **({"gain": -0.86} if name == "loop" else {}))
    verdict = pt.verify(task, changes=False)
    breakage = verdict.breakage
    if breakage is not None and "approach_only" in breakage.remedy:
        law: Any = task.loop.law
        release = float(breakage.remedy.partition("release = ")[2].split()[0])
        only = replace(law.law, approach_only=True, release=release)
        task = task.replace(loop=replace(task.loop, law=replace(law, law=only)))
        verdict = pt.verify(task, changes=False)
        breakage = verdict.breakage
    if breakage is None or breakage.harder or verdict.gain is None:
        raise RuntimeError(f"{name}: the recommended settings do not prevent harder contacts")
    if breakage.bound is None:
        raise RuntimeError(f"{name}: the verdict states no bound")
    return task, breakage.bound, verdict.gain


def exported(task: pt.Task, folder: Path) -> ctypes.CDLL:
    """Export a law as C source, and compile it."""
    export(task, folder, verify=False)
    source = folder / "library.c"
    source.write_text(
        '#include "pretouch_design.h"\n'
        "void begin(void *state) { pretouch_design_start(state); }\n"
        "void step(void *state, const pretouch_sample *in, pretouch_output *out) {"
        " pretouch_design_step(state, in, out); }\n"
    )
    library = folder / "library.so"
    sources = [str(source), str(folder / "pretouch_law.c")]
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", *sources, "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def move(library: ctypes.CDLL, task: pt.Task, failure: Failure, event: Disturbance | None) -> tuple[float, float]:
    """Run the exported law with an ideal robot; return its largest speed toward the object and |l'| at contact [m/s].

    Without contact, the second speed is 0.
    """
    law: Any = task.loop.law
    period = law.period
    chain = replace(task.loop.chain, disturbances=() if event is None else (event,), random_phase=False)
    sensor = SensorRun(
        chain, task.sensor, distance=failure.position, farthest=1.0, period=period, seed=failure.seed, run=0
    )
    state, sample, out = ctypes.create_string_buffer(STATE), RawSample(), RawOutput()
    library.begin(state)
    x = v = fastest = 0.0
    for k in range(int(LONGEST / period)):
        t = k * period
        sample.fresh = sensor.deliver(t)
        sample.reading, sample.age = sensor.reading, max(t - sensor.measured, 0.0)
        library.step(state, ctypes.byref(sample), ctypes.byref(out))
        after = failure.position + failure.velocity * (t + period)
        while sensor.next <= t + period:
            part = (sensor.next - t) / period
            sensor.look(failure.position + failure.velocity * sensor.next - (x + part * (out.position - x)))
        x, v = out.position, out.velocity
        fastest = max(fastest, v)
        if after <= x:
            return fastest, max(v - failure.velocity, 0.0)
    return fastest, 0.0


def run_loop(task: pt.Task, gain: float, failure: Failure, event: Disturbance | None) -> tuple[float, float]:
    """Run the whole loop; return the same speeds."""
    chain = replace(task.loop.chain, disturbances=() if event is None else (event,))
    obstacle = pt.Obstacle(position=failure.position, velocity=failure.velocity)
    loop = replace(task.loop, chain=chain, seed=failure.seed, horizon=LONGEST)
    result = loop.run(replace(task.scenario, obstacle=obstacle), task.sensor, gain)
    return float(result.largest_advance), abs(float(result.relative_velocity)) if result.touched else 0.0


Run = Callable[[Failure, Disturbance | None], tuple[float, float]]


def judge(name: str, run: Run, failures: list[Failure], bound: float) -> int:
    """Print the results of one law; return the number of failures that are faster or harder than allowed."""
    wrong = harder = beyond = caused = 0
    fastest = share = 0.0
    for failure in failures:
        distance = failure.disturbance.distance or 0.0
        speed, contact = run(failure, failure.disturbance)
        places = [distance, *(part * failure.position for part in (0.9, 0.7, 0.5, 0.3, 0.1))]
        stuck = [run(failure, Disturbance(kind="stuck", distance=place)) for place in places]
        free = abs(failure.velocity)
        fastest, share = max(fastest, speed), max(share, speed / bound)
        is_harder = contact > (1 + HARDER) * free + LEAST
        is_beyond = contact > free + bound
        is_caused = contact > (1 + HARDER) * max(free, *(one for _, one in stuck)) + LEAST
        harder, beyond, caused = harder + is_harder, beyond + is_beyond, caused + is_caused
        wrong += is_beyond or is_caused or speed > bound
    print(
        f"  {name}: {len(failures)} disturbances, at most {fastest:.3g} m/s toward the object, {share:.3g} times the "
        f"bound of {bound:.3g} m/s; {harder} contacts are harder than without mitigation, {beyond} by more than the "
        f"bound, {caused} by more than the return to the reference"
    )
    return wrong


def check(count: int, seed: int) -> int:
    """Run all disturbances; return the number of those that are faster or harder than allowed."""
    failures, wrong = draw_failures(count, seed), 0
    for name in ("loop", "drag"):
        task, bound, gain = guarded(name)
        with tempfile.TemporaryDirectory() as folder:
            library = exported(task, Path(folder) / "law")
            wrong += judge(f"{name}, exported C", lambda f, e, c=library, t=task: move(c, t, f, e), failures, bound)
        wrong += judge(f"{name}, whole loop", lambda f, e, t=task, g=gain: run_loop(t, g, f, e), failures, bound)
    return wrong


def main() -> int:
    """Run the check."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=40, help="number of disturbances")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    return int(check(arguments.count, arguments.seed) > 0)


if __name__ == "__main__":
    sys.exit(main())
