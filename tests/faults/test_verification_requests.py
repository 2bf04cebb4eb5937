"""Requests for a verdict that make no sense: what was found, what must hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

import pretouch as pt
from loop_samples import BareLaw
from refusals import refused
from verification_samples import BOUNDS, OBJECTIVE, QUICK, SCENARIO, SENSOR, velocity_limit, verdict

SEVERAL = replace(SCENARIO, obstacle=pt.Obstacle(position=[0.03, 0.04], velocity=-0.3))


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (lambda: verdict(QUICK, runs=0), {"argument": "runs", "value": 0}),
        (lambda: verdict(QUICK, runs=True), {"argument": "runs", "value": True}),
        (lambda: verdict(QUICK, runs=10**12), {"argument": "runs", "value": 1000000000000}),
        (lambda: verdict(QUICK, confidence=1.0), {"argument": "confidence", "value": 1.0, "limit": (0.0, 1.0)}),
        (lambda: verdict(QUICK, gain=float("nan")), {"argument": "gain"}),
        (lambda: verdict(QUICK, bounds=(-0.1, -1.0)), {"argument": "bounds", "value": (-0.1, -1.0)}),
        (lambda: verdict(replace(QUICK, seed=-1), runs=1), {"argument": "seed", "value": -1}),
        (lambda: verdict(replace(QUICK, law=BareLaw(-0.7, 1e-3))), {"argument": "loop"}),
        (lambda: verdict(QUICK.law), {"argument": "loop"}),
        (
            lambda: verdict(replace(QUICK, horizon=0.1)),
            {"argument": "loop horizon", "value": 0.1},
        ),
        (
            lambda: verdict(QUICK, constraints=[velocity_limit(0.1), velocity_limit(0.2)]),
            {"argument": "constraint relative_velocity"},
        ),
        (
            lambda: verdict(QUICK, constraints=[pt.Constraint(name="impact_force", limit=10.0)]),
            {"argument": "impact_force"},
        ),
        (
            lambda: verdict(QUICK, uncertainty={"admittance.mass": pt.uncertainty.Uniform(low=1.0, high=2.0)}),
            {"argument": "uncertainty"},
        ),
        (
            lambda: verdict(QUICK, uncertainty={"obstacle.speed": pt.uncertainty.Uniform(low=1.0, high=2.0)}),
            {"argument": "uncertainty", "value": "obstacle.speed", "remedy": "obstacle.velocity"},
        ),
        (
            lambda: pt.verify(pt.Task(SEVERAL, SENSOR, OBJECTIVE, loop=QUICK, bounds=BOUNDS)),
            {"argument": "scenario"},
        ),
        (lambda: verdict(QUICK, damping_ratio=(0.7, 1.5)), {"argument": "damping_ratio"}),
        (lambda: verdict(QUICK, gain=-0.7, natural_frequency=(3.0, 8.0)), {"argument": "natural_frequency"}),
        (
            lambda: pt.simulate(pt.Task(SCENARIO, SENSOR, loop=QUICK, gain=-0.7, damping_ratio=(0.7, 1.5))),
            {"argument": "damping_ratio"},
        ),
        (
            lambda: pt.robust(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, damping_ratio=(0.7, 1.5))),
            {"argument": "damping_ratio"},
        ),
    ],
)
def test_a_request_that_makes_no_sense_says_why(make: Callable[[], object], fields: dict[str, Any]) -> None:
    with refused(**fields):
        make()


@pytest.mark.parametrize("verb", [pt.verify, pt.simulate])
def test_the_law_of_a_task_is_that_of_its_loop(verb: Callable[[pt.Task], Any]) -> None:
    drag = replace(QUICK, law=replace(QUICK.law, law=pt.control.VirtualDrag(drag=0.0144, noise=1e-3)))
    task = pt.Task(
        SCENARIO, SENSOR, OBJECTIVE, bounds=(1e-3, 0.1), gain=0.0144, loop=drag, verify=pt.designs.VerifyOptions(runs=2)
    )
    assert task.law is pt.motion.DRAG
    assert task.replace(loop=QUICK, gain=-0.7).law is pt.motion.DAMPER
    with refused("law"):
        verb(task.replace(law="virtual-damper"))
    with refused("law", value="'friction'"):
        task.replace(law="friction")
