"""Time verdicts, and measure the advantage of a gain designed on a loop over the ideal one.

Run with `python -m benchmarks.verdicts`; `--quick` uses one loop and few runs.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import pretouch as pt

from .solving import SCENARIO, SENSORS

SENSOR = SENSORS["inverse-power"]
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)
LIMITS = (pt.Constraint(name="relative_velocity", limit=0.1), pt.Constraint(name="excursion", limit=0.2))
CURVE = {"sensor.exponent": pt.robust.Normal(mean=3.32, deviation=0.05)}
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
DESIGNS = {"250 readings per second": FAST, "60 per second, exposure 16 ms, delay 4 ms": SLOW}


def verdict_times(runs: int, most: int) -> list[str]:
    """Time verdicts, warm; return a row for each loop, up to a number of loops."""
    rows = []
    for name, (which, uncertainty) in list(VERDICTS.items())[:most]:
        seconds = []
        for changes in (False, True):
            for count in (2, runs):  # the first one compiles
                start = time.perf_counter()
                pt.verify_gain(
                    pt.Task(
                        *(SCENARIO, SENSOR, OBJECTIVE),
                        loop=which,
                        bounds=BOUNDS,
                        constraints=LIMITS,
                        uncertainty=uncertainty or {},
                        verify=pt.VerifyOptions(runs=count),
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
        found = pt.robust.design_robust_gain(
            pt.Task(
                *(SCENARIO, SENSOR, OBJECTIVE),
                bounds=BOUNDS,
                uncertainty={},
                evaluate=which,
                robust=pt.robust.RobustOptions(samples=samples),
            )
        )
        seconds, loss = time.perf_counter() - start, found.loss_of_nominal
        lost = "-" if loss is None else f"{100 * loss.relative:.2f} +- {100 * loss.standard_error:.2f} %"
        gains = f"{found.gain:8.4f} N s, ideal {found.nominal_gain:.4f} N s"
        rows.append(f"{name:44s}{gains}, which loses {lost}{seconds:8.2f} s")
    return rows


def main() -> None:
    """Print all results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verdicts", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one loop, few runs")
    quick = parser.parse_args().quick
    runs, samples, most = (20, 16, 1) if quick else (1000, 256, len(VERDICTS))
    print(f"\nverdicts over {runs} runs, warm")
    print("\n".join(verdict_times(runs, most)))
    print(f"\ndesigns on loops over {samples} samples")
    print("\n".join(designs(samples, most)))


if __name__ == "__main__":
    main()
