"""Time robust designs: four uncertain inputs, 10,000 samples, 10,000 samples for validation, a chance constraint.

The second part times an uncertain parameter of each kind of sensor, compared with an inverse power.

Run with `python -m benchmarks.robust_design`; `--families` runs the second part only. The shortest of three runs
counts, in the second part of five, in turn with the inverse power.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np

import pretouch as pt
from pretouch.sensors.model import parameter

SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
LIMIT = pt.designs.Required(constraint=pt.Constraint(name="relative_velocity", limit=0.15), probability=0.9)
COMMON = {
    "obstacle.velocity": pt.uncertainty.TruncatedNormal(location=-0.3, deviation=0.1, low=-0.6, high=-0.05),
    "obstacle.position": pt.uncertainty.Uniform(low=0.035, high=0.046),
    "admittance.damping": pt.uncertainty.Uniform(low=10.0, high=11.0),
}
CASES = {
    "exponential-1": (
        pt.ExponentialFirstOrder(scale=0.458, rate=-61.0),
        {"sensor.rate": pt.uncertainty.Normal(mean=-61.0, deviation=3.0)},
    ),
    "inverse-power": (
        pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        {"sensor.exponent": pt.uncertainty.Normal(mean=3.32, deviation=0.1)},
    ),
    "exponential-2": (
        pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
        {"sensor.rate": pt.uncertainty.Normal(mean=-74.0, deviation=1.0)},
    ),
    "mittag-leffler": (
        pt.MittagLeffler(scale=0.5, rate=-60.0, order=0.9),
        {"plant.velocity": pt.uncertainty.Uniform(low=0.0, high=0.02)},
    ),
}
MEASURES = (
    pt.designs.Expected(),
    pt.designs.Quantile(probability=0.9),
    pt.designs.ConditionalValueAtRisk(probability=0.9),
)
COUNT = 10_000


ROUNDS = 5
SIZES = (64, 1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gaussian(pt.sensors.SensorModel):
    """A custom sensor curve."""

    width: float = parameter("w", "m")
    offset: float = parameter("l_0", "m")
    name = "gaussian"

    def _log_output(self, distance: np.ndarray) -> np.ndarray:
        return -(((distance + self.offset) / self.width) ** 2)

    def _log_slope(self, distance: np.ndarray) -> np.ndarray:
        return -2 * (distance + self.offset) / self.width**2


BELL = Gaussian(width=0.05, offset=0.03)
TABLE = pt.Table(
    distances=(0.0, 0.005, 0.012, 0.02, 0.03, 0.045, 0.06), outputs=(0.46, 0.31, 0.205, 0.13, 0.083, 0.041, 0.022)
)
CUSTOM = pt.CustomSensor(
    log_output_function=lambda d: -40 * d - 3 * np.tanh(d / 0.02),
    log_slope_function=lambda d: -40 - 3 / 0.02 / np.cosh(d / 0.02) ** 2,
    maximum_distance=2.0,
)
MITTAG_LEFFLER = pt.MittagLeffler(scale=1.0, rate=-80.0, order=0.8)
RECESS = {"sensor.recess": pt.uncertainty.Uniform(low=0.004, high=0.006)}
FAMILIES = {
    "inverse-power, exponent": CASES["inverse-power"],
    "gaussian, width": (BELL, {"sensor.width": pt.uncertainty.Normal(mean=0.05, deviation=0.002)}),
    "gaussian, width and offset": (
        BELL,
        {
            "sensor.width": pt.uncertainty.Normal(mean=0.05, deviation=0.002),
            "sensor.offset": pt.uncertainty.Uniform(low=0.029, high=0.031),
        },
    ),
    "mittag-leffler, rate": (MITTAG_LEFFLER, {"sensor.rate": pt.uncertainty.Normal(mean=-80.0, deviation=2.0)}),
    "mittag-leffler, order": (MITTAG_LEFFLER, {"sensor.order": pt.uncertainty.Uniform(low=0.75, high=0.85)}),
    "recessed table": (pt.Recessed(sensor=TABLE, recess=0.005), RECESS),
    "recessed custom": (pt.Recessed(sensor=CUSTOM, recess=0.005), RECESS),
    "recessed gaussian": (pt.Recessed(sensor=BELL, recess=0.005), RECESS),
    "recessed mittag-leffler": (pt.Recessed(sensor=MITTAG_LEFFLER, recess=0.005), RECESS),
}


def seconds(sensor: pt.sensors.SensorModel, uncertainty: dict[str, object], count: int) -> tuple[float, float]:
    """Time a design: wall time and processor time."""
    start, used = time.perf_counter(), time.process_time()
    pt.robust(
        pt.Task(
            SCENARIO,
            sensor,
            OBJECTIVE,
            bounds=(-10.0, -0.01),
            uncertainty={"obstacle.velocity": COMMON["obstacle.velocity"], **uncertainty},
            robust=pt.designs.RobustOptions(samples=count, validation=count),
        )
    )
    return time.perf_counter() - start, time.process_time() - used


def families() -> None:
    """Print a line per kind of sensor and number of samples."""
    print(f"\n{'uncertain parameter':28s} samples     clock  over  processors  over")
    for count in SIZES:
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in FAMILIES}
        for sensor, own in FAMILIES.values():
            seconds(sensor, own, 16)  # compiles
        for _ in range(ROUNDS):
            for name, (sensor, own) in FAMILIES.items():
                times[name].append(seconds(sensor, own, count))
        base = np.min(times["inverse-power, exponent"], axis=0)
        for name, found in times.items():
            clock, used = np.min(found, axis=0)
            print(
                f"{name:28s} {count:7d} {1e3 * clock:6.0f} ms {clock / base[0]:5.1f} {1e3 * used:8.0f} ms "
                f"{used / base[1]:5.1f}"
            )


def designs() -> None:
    """Print a line per curve and measure."""
    for name, (sensor, own) in CASES.items():
        for measure in MEASURES:
            shortest = float("inf")
            for _ in range(3):
                start = time.perf_counter()
                design = pt.robust(
                    pt.Task(
                        SCENARIO,
                        sensor,
                        OBJECTIVE,
                        bounds=(-10.0, -0.01),
                        uncertainty={**COMMON, **own},
                        robust=pt.designs.RobustOptions(measure=measure, samples=COUNT, validation=COUNT),
                        constraints=[LIMIT],
                    )
                )
                shortest = min(shortest, time.perf_counter() - start)
            print(f"{name:15s}  {measure.label:24s}  {shortest:6.2f} s  D_p = {design.gain:.4f} N s")


def main() -> None:
    """Run the requested parts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--families", action="store_true", help="only what an uncertain sensor costs")
    if not parser.parse_args().families:
        designs()
    families()


if __name__ == "__main__":
    main()
