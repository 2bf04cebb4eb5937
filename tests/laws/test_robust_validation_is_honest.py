"""The intervals of a robust design's validation contain the true values, with any seed."""

from __future__ import annotations

import numpy as np
import pytest

import pretouch as pt

TASK = pt.Task(
    pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
    ),
    pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    pt.excursion_objective(position_scale=0.5, velocity_scale=0.3),
    bounds=(-10.0, -0.01),
    constraints=[
        pt.designs.Required(constraint=pt.Constraint(name="relative_velocity", limit=0.1), probability=0.5),
    ],
    uncertainty={
        "obstacle.velocity": pt.uncertainty.TruncatedNormal(location=-0.3, deviation=0.1, low=-0.6, high=-0.1),
        "obstacle.position": pt.uncertainty.Uniform(low=0.035, high=0.05),
    },
)
SEEDS = 40


@pytest.mark.parametrize("sampling", ["sobol", "random"])
def test_the_bounds_of_the_validation_contain_the_truth_for_all_seeds(sampling: str) -> None:
    def design(seed: int, validation: int = 300) -> pt.designs.RobustDesign:
        options = pt.designs.RobustOptions(samples=64, validation=validation, seed=seed, sampling=sampling)
        return pt.robust(TASK.replace(robust=options, bounds=(-0.800001, -0.8)))

    truth = design(1000, validation=40_000).validation
    held = truth.limits[0].held
    found = [design(seed).validation for seed in range(SEEDS)]
    assert 0.9 < held < 0.99
    misses = sum(one.limits[0].low > held for one in found)
    assert misses <= 0.05 * SEEDS + 3 * np.sqrt(0.05 * SEEDS)
    if sampling == "sobol":  # evenly spread: no seed is lucky
        assert np.std([one.limits[0].held for one in found]) < 0.5 * np.sqrt(held * (1 - held) / 300)
        assert misses == 0
