"""How long a robust design takes: four uncertain inputs, 10,000 samples and as many fresh ones, a chance constraint.

Run with `python -m benchmarks.robust_design`. The shortest of three runs counts; the first compiles.
"""

from __future__ import annotations

import time

import pretouch as pt

SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
LIMIT = pt.Required(constraint=pt.Constraint(name="relative_velocity", limit=0.15), probability=0.9)
COMMON = {
    "obstacle.velocity": pt.TruncatedNormal(location=-0.3, deviation=0.1, low=-0.6, high=-0.05),
    "obstacle.position": pt.Uniform(low=0.035, high=0.046),
    "admittance.damping": pt.Uniform(low=10.0, high=11.0),
}
CASES = {
    "exponential-1": (
        pt.ExponentialFirstOrder(scale=0.458, rate=-61.0),
        {"sensor.rate": pt.Normal(mean=-61.0, deviation=3.0)},
    ),
    "inverse-power": (
        pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        {"sensor.exponent": pt.Normal(mean=3.32, deviation=0.1)},
    ),
    "exponential-2": (
        pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
        {"sensor.rate": pt.Normal(mean=-74.0, deviation=1.0)},
    ),
    "mittag-leffler": (
        pt.MittagLeffler(scale=0.5, rate=-60.0, order=0.9),
        {"plant.velocity": pt.Uniform(low=0.0, high=0.02)},
    ),
}
MEASURES = (pt.Expected(), pt.Quantile(probability=0.9), pt.ConditionalValueAtRisk(probability=0.9))
COUNT = 10_000


def main() -> None:
    """Print a line per curve and measure."""
    for name, (sensor, own) in CASES.items():
        for measure in MEASURES:
            shortest = float("inf")
            for _ in range(3):
                start = time.perf_counter()
                design = pt.design_robust_gain(
                    SCENARIO,
                    sensor,
                    OBJECTIVE,
                    bounds=(-10.0, -0.01),
                    uncertainty={**COMMON, **own},
                    measure=measure,
                    constraints=[LIMIT],
                    samples=COUNT,
                    validation=COUNT,
                )
                shortest = min(shortest, time.perf_counter() - start)
            print(f"{name:15s}  {measure.label:24s}  {shortest:6.2f} s  D_p = {design.gain:.4f} N s")


if __name__ == "__main__":
    main()
