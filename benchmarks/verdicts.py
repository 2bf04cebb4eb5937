"""Time verdicts and commands, and measure the advantage of a gain designed on a loop over the ideal one.

Run with `python -m benchmarks.verdicts`; `--quick` uses one loop, one command and few runs, `--commands` only times the
commands.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pretouch as pt
from pretouch.simulation import native_loop, result

from .solving import SCENARIO, SENSORS

SENSOR = SENSORS["inverse-power"]
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)
LIMITS = (pt.Constraint(name="relative_velocity", limit=0.1), pt.Constraint(name="excursion", limit=0.2))
CURVE = {"sensor.exponent": pt.uncertainty.Normal(mean=3.32, deviation=0.05)}
ROBOT = pt.simulation.ImpedancePlant(mass=4.0, stiffness=4000.0, damping=250.0)
CONTACT = pt.simulation.HuntCrossley(stiffness=1.33e6, dissipation=0.5, obstacle_mass=1.5)
NOISE = {"noise": 1e-3, "relative_noise": 2e-3}


def loop(chain: pt.SensorChain, period: float = 1e-3, **conditioning: int | float) -> pt.ClosedLoop:
    """Return a loop of the letter's admittance and a sensor chain."""
    told = pt.control.Conditioning(floor=1e-3, sensor_period=chain.period, **conditioning)
    admittance = pt.control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
    law = pt.control.Controller(
        period=period, conditioning=told, law=pt.control.VirtualDamper(gain=0.0), admittance=admittance
    )
    return pt.ClosedLoop(law=law, chain=chain)


FAST = loop(pt.SensorChain(rate=250.0, exposure=170e-6, delay=120e-6, random_phase=True, **NOISE))
SLOW = loop(pt.SensorChain(rate=60.0, exposure=0.016, delay=0.004, random_phase=True, **NOISE))
LETTER = loop(pt.SensorChain(rate=1e4, delay=1e-5, noise=2e-3), 1e-4, median_window=10, low_pass_order=5, cutoff=500.0)
VERDICTS = {
    "250 readings per second": (FAST, None),
    "the same, robot and contact": (replace(FAST, plant=ROBOT, contact=CONTACT), None),
    "the same, an uncertain curve": (FAST, CURVE),
    "10 kHz, filters of the letter": (LETTER, None),
}
EXAMPLES = Path(__file__).parents[1] / "examples"
COMMANDS = {
    "verify loop.toml": ("verify", "loop.toml"),
    "robust robust.toml": ("robust", "robust.toml"),
    "pareto tradeoff.toml": ("pareto", "tradeoff.toml"),
    "design approach.toml": ("design", "approach.toml"),
    "simulate loop.toml": ("simulate", "loop.toml"),
}
QUICKEST = "design approach.toml"
DESIGNS = {"250 readings per second": FAST, "60 per second, exposure 16 ms, delay 4 ms": SLOW}


def verdict_times(runs: int, most: int, *, warm: bool = True) -> list[str]:
    """Time verdicts, by default after a short one; return a row for each loop, up to a number of loops."""
    rows = []
    for name, (which, uncertainty) in list(VERDICTS.items())[:most]:
        seconds = []
        for changes in (False, True):
            for count in (2, runs) if warm else (runs,):  # the first one loads modules and caches
                start = time.perf_counter()
                pt.verify(
                    pt.Task(
                        *(SCENARIO, SENSOR, OBJECTIVE),
                        loop=which,
                        bounds=BOUNDS,
                        constraints=LIMITS,
                        uncertainty=uncertainty or {},
                        verify=pt.designs.VerifyOptions(runs=count),
                    ),
                    changes=changes,
                )
            seconds.append(time.perf_counter() - start)
        rows.append(f"{name:44s}{seconds[0]:8.2f} s{seconds[1]:8.2f} s with changes")
    return rows


def designs(samples: int, most: int) -> list[str]:
    """Design on loops, up to a number of them; return a row for each with the gain and the loss of the ideal one."""
    rows = []
    for name, which in list(DESIGNS.items())[:most]:
        start = time.perf_counter()
        found = pt.robust(
            pt.Task(
                *(SCENARIO, SENSOR, OBJECTIVE),
                bounds=BOUNDS,
                uncertainty={},
                evaluate=which,
                robust=pt.designs.RobustOptions(samples=samples),
            )
        )
        seconds, loss = time.perf_counter() - start, found.loss_of_nominal
        lost = "-" if loss is None else f"{100 * loss.relative:.2f} +- {100 * loss.standard_error:.2f} %"
        gains = f"{found.gain:8.4f} N s, ideal {found.nominal_gain:.4f} N s"
        rows.append(f"{name:44s}{gains}, which loses {lost}{seconds:8.2f} s")
    return rows


def processor_time(arguments: list[str]) -> float:
    """Return the processor time of a command in a new process [s], with all of its threads and imports."""
    # An installed package has compiled modules, so Python may store them.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryDirectory() as folder:
        before = os.times()
        command = [sys.executable, "-m", "pretouch", *arguments]
        subprocess.run(command, cwd=folder, env=environment, check=False, capture_output=True)
        after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def commands(rounds: int, names: Sequence[str]) -> list[str]:
    """Time commands on examples in turns, and return a row for each with its smallest processor times."""
    times: dict[tuple[str, str], float] = {}
    for _ in range(rounds):
        for name in names:
            verb, file = COMMANDS[name]
            for option in ("--no-report", "--report"):
                seconds = processor_time([verb, str(EXAMPLES / file), option])
                times[name, option] = min(seconds, times.get((name, option), seconds))
    return [
        f"{name:28s}{times[name, '--no-report']:8.2f} s{times[name, '--report']:8.2f} s with report" for name in names
    ]


def simulated(changes: bool) -> str:
    """Verify the gain of the example, and return a row with the numbers of simulated runs and controller steps."""
    counts: Counter[str] = Counter()
    module: Any = result  # which calls the function by this name
    run_loop = module.run_loop

    def counted(loop: Any, which: Any, *rest: Any, **more: Any) -> Any:
        outputs = run_loop(loop, which, *rest, **more)
        ends = outputs[0][:, native_loop.RESULT_COLUMNS.index("end_time")]
        kind = "at rest" if loop.horizon > 10 * loop.follow_time + 5 else "in encounters"
        counts[f"runs {kind}"] += len(which)
        counts[f"steps {kind}"] += int((ends / loop.laws[0].period).sum())
        return outputs

    task = pt.load_scenario(EXAMPLES / "loop.toml")
    module.run_loop = counted
    start = time.process_time()
    try:
        pt.verify(task, changes=changes)
    finally:
        module.run_loop = run_loop
    seconds = time.process_time() - start
    numbers = ", ".join(f"{number:,} {kind}" for kind, number in sorted(counts.items()))
    return f"{'with' if changes else 'without'} changes: {seconds:.2f} s of processor time, {numbers}"


def main() -> None:
    """Print all results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verdicts", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one loop, one command, few runs")
    parser.add_argument("--commands", action="store_true", help="only commands, and the runs of a verdict")
    options = parser.parse_args()
    quick = options.quick
    print("\nprocessor time of a new process, smallest of several")
    print("\n".join(commands(*((1, [QUICKEST]) if quick else (3, list(COMMANDS))))))
    print("\nsimulated by pretouch verify examples/loop.toml")
    print("\n".join(simulated(changes) for changes in ((False,) if quick else (False, True))))
    if options.commands:
        return
    runs, samples, most = (20, 16, 1) if quick else (1000, 256, len(VERDICTS))
    print(f"\nverdicts over {runs} runs" + ("" if quick else ", warm"))
    print("\n".join(verdict_times(runs, most, warm=not quick)))
    print(f"\ndesigns on loops over {samples} samples")
    print("\n".join(designs(samples, most)))


if __name__ == "__main__":
    main()
