"""Sobol indices are those of SciPy, and to first order those of the gradients; inputs that go together count as one."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy import stats

from pretouch.designs import RobustOptions, Task, excursion_objective
from pretouch.designs.robust.importance import rank_uncertain_inputs
from pretouch.designs.robust.problem import RobustProblem
from pretouch.designs.search import GainAxis
from pretouch.motion import Admittance, Obstacle, Scenario
from pretouch.sensors import InversePower
from pretouch.uncertainty import CorrelatedNormal, Normal, Uncertainty, Uniform, make_ensemble

SCENARIO = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=Obstacle(position=0.0422, velocity=-0.3),
)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
OBJECTIVE = excursion_objective(position_scale=0.5, velocity_scale=0.3)
MAKE = partial(make_ensemble, SCENARIO, POWER)
KNOWN: Uncertainty = {
    "obstacle.velocity": Uniform(low=-0.4, high=-0.2),
    "obstacle.position": Uniform(low=0.038, high=0.046),
    "sensor.exponent": Normal(mean=3.32, deviation=0.1),
}


def ranked(known: Uncertainty, samples: int = 1 << 14) -> dict[str, object]:
    task = Task(SCENARIO, POWER, OBJECTIVE, uncertainty=known, robust=RobustOptions(samples=samples, seed=3))
    problem = RobustProblem.over(task, GainAxis(low=-10.0, high=-0.01), {"obstacle.velocity": [-0.3]})
    return {one.name: one for one in rank_uncertain_inputs(problem, -0.75)}


def test_indices_are_those_of_scipy() -> None:
    def values(points: np.ndarray) -> np.ndarray:
        ensemble = MAKE(dict(zip(KNOWN, points, strict=True)))
        return OBJECTIVE.value(ensemble.contacts(-0.75).end, ensemble.speed)

    class Known:
        def __init__(self, known: object) -> None:
            self.ppf = known.quantile

    theirs = stats.sobol_indices(
        func=values, n=1 << 13, dists=[Known(k) for k in KNOWN.values()], rng=np.random.default_rng(1)
    )
    ours = ranked(KNOWN)
    for i, name in enumerate(KNOWN):
        one = ours[name]
        # five standard errors of ours; SciPy's Sobol points are better than that
        assert abs(one.alone - theirs.first_order[i]) < 5 * one.alone_error + 0.005
        assert abs(one.total - theirs.total_order[i]) < 5 * one.total_error + 0.005


def test_the_most_important_comes_first_and_shares_add_up() -> None:
    ours = ranked(KNOWN)
    totals = [one.total for one in ours.values()]
    assert totals == sorted(totals, reverse=True)
    assert next(iter(ours)) == "obstacle.velocity"
    assert sum(one.by_gradient for one in ours.values()) == pytest.approx(1.0)


def test_a_little_uncertainty_is_what_gradients_say() -> None:
    small = {
        "obstacle.velocity": Uniform(low=-0.303, high=-0.297),
        "obstacle.position": Normal(mean=0.0422, deviation=1e-4),
        "sensor.exponent": Normal(mean=3.32, deviation=0.01),
    }
    for one in ranked(small).values():
        assert abs(one.alone - one.by_gradient) < 5 * one.alone_error + 1e-3
        assert abs(one.total - one.by_gradient) < 5 * one.total_error + 1e-3


def test_inputs_that_go_together_count_as_one() -> None:
    both = CorrelatedNormal(
        names=("sensor.exponent", "sensor.distance_offset"),
        mean=(3.32, 0.0419),
        covariance=((1e-2, 1.8e-4), (1.8e-4, 4e-6)),
    )
    ours = ranked({"obstacle.position": KNOWN["obstacle.position"], "calibration": both})
    assert ours["calibration"].inputs == both.names
    assert sum(one.total for one in ours.values()) == pytest.approx(1.0, abs=0.03)
    assert abs(ours["calibration"].total - ours["calibration"].by_gradient) < 0.03
