"""An infeasible task says which limit must be raised to what value, and the raised limit makes it feasible."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.units import to_si
from pretouch.designs import Constraint, DesignStatus, Expected, HertzImpact, Measure, Required, WorstCase
from pretouch.designs.front.result import FrontStatus
from pretouch.designs.page import gain_page
from pretouch.designs.relaxation import Relaxation, relaxations_in_words, round_up
from pretouch.designs.robust import robust
from pretouch.uncertainty import Uniform

BOTH = (Constraint(name="excursion", limit=0.052), Constraint(name="impact_force", limit=10.5))
TASK = pt.Task(
    pt.Scenario(
        admittance=pt.Admittance.from_natural_frequency(mass=1.0, natural_frequency=5.0),
        obstacle=pt.Obstacle(position=0.098, velocity=-0.3),
    ),
    pt.InversePower(scale=4.8, distance_offset=0.01101, exponent=2.101),
    pt.excursion_objective(position_scale=0.06, velocity_scale=0.25),
    bounds=(-10.0, -0.001),
    constraints=BOTH,
    impact=HertzImpact(robot_mass=0.4, effective_modulus=1e7, radius=0.01),
)
UNCERTAIN = TASK.replace(uncertainty={"obstacle.velocity": Uniform(low=-0.33, high=-0.27)})


def followed(task: pt.Task, relaxation: Relaxation) -> pt.Task:
    """Replace limits by the values that the sentence prints."""
    printed = dict(zip([limit.name for limit in relaxation.limits], _printed(relaxation), strict=True))

    def raised(limit: Any) -> Any:
        constraint = getattr(limit, "constraint", limit)
        new = replace(constraint, limit=printed.get(constraint.name, constraint.limit))
        return new if limit is constraint else replace(limit, constraint=new)

    return task.replace(constraints=tuple(map(raised, task.constraints)))


def _printed(relaxation: Relaxation) -> list[float]:
    (sentence,) = relaxations_in_words([relaxation])
    return [
        to_si(part.rpartition(" to ")[2], limit.unit, name=limit.name)
        for part, limit in zip(sentence.split(" and of "), relaxation.limits, strict=True)
    ]


def test_a_design_names_the_smallest_value_of_each_limit() -> None:
    design = pt.design(TASK)
    assert design.status is DesignStatus.INFEASIBLE
    assert {limit.name for one in design.relaxations for limit in one.limits} == {"excursion", "impact_force"}
    for one in design.relaxations:
        assert pt.design(followed(TASK, one)).status is DesignStatus.OPTIMAL
        (limit,) = one.limits
        tighter = tuple(replace(c, limit=0.985 * limit.raised) if c.name == limit.name else c for c in BOTH)
        assert pt.design(TASK.replace(constraints=tighter)).status is DesignStatus.INFEASIBLE
    assert design.to_dict()["relaxations"][0]["limits"][0]["raised"] == design.relaxations[0].limits[0].raised
    assert f"to {_shown(design.relaxations[0])}" in gain_page(design).next_step


def _shown(relaxation: Relaxation) -> str:
    return str(relaxation.limits[0]).rpartition(" to ")[2]


def test_two_limits_are_raised_together_if_neither_suffices_alone() -> None:
    """With bounds that contain a single kind of gain, both limits are below what any gain reaches."""
    task = TASK.replace(bounds=(-0.21, -0.2))
    limits = tuple(replace(c, limit=0.5 * c.limit) for c in BOTH)
    design = pt.design(task.replace(constraints=limits))
    (one,) = design.relaxations
    assert len(one.limits) == 2
    assert pt.design(followed(task.replace(constraints=limits), one)).status is DesignStatus.OPTIMAL


@pytest.mark.parametrize("measure", [Expected(), WorstCase()])
@pytest.mark.parametrize("probability", [1.0, 0.9])
def test_a_robust_design_names_values_that_suffice(measure: Measure, probability: float) -> None:
    if isinstance(measure, WorstCase) and probability < 1:
        return
    limits = tuple(Required(constraint=c, probability=probability) for c in BOTH)
    options = replace(UNCERTAIN.robust, measure=measure, samples=64, validation=64)
    task = UNCERTAIN.replace(constraints=limits, robust=options)
    design = robust(task)
    assert design.status is DesignStatus.INFEASIBLE
    assert len(design.relaxations) == 2
    for one in design.relaxations:
        assert robust(followed(task, one)).status is DesignStatus.OPTIMAL


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("free", [{}, {"natural_frequency": (4.9, 5.1)}])
def test_a_front_names_values_that_suffice(free: dict[str, Any]) -> None:
    task = TASK.replace(**free)
    front = pt.pareto(task)
    assert front.status is FrontStatus.INFEASIBLE
    assert front.relaxations
    assert pt.pareto(followed(task, front.relaxations[0])).status is FrontStatus.FOUND


@pytest.mark.slow
def test_a_co_design_names_values_that_suffice() -> None:
    task = TASK.replace(natural_frequency=(4.9, 5.1))
    design = pt.design(task)
    assert design.status is DesignStatus.INFEASIBLE
    assert design.best_ratio is not None
    for one in design.relaxations:
        assert pt.design(followed(task, one)).status is DesignStatus.OPTIMAL


def test_a_feasible_design_names_none() -> None:
    assert pt.design(TASK.replace(constraints=BOTH[:1])).relaxations == ()


@pytest.mark.parametrize("value", np.geomspace(1e-4, 3e3, 7))
def test_values_are_rounded_outward(value: float) -> None:
    assert value <= round_up(value) < 1.011 * value
