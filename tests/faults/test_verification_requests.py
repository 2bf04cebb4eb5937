"""Requests for a verdict that make no sense: what was found, what must hold."""

from __future__ import annotations

import re
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
    ("make", "message"),
    [
        (lambda: verdict(QUICK, runs=0), "runs: found 0, expected a positive whole number"),
        (lambda: verdict(QUICK, runs=True), "runs: found True"),
        (lambda: verdict(QUICK, runs=10**12), "runs: found 1,000,000,000,000 runs, which would need"),
        (lambda: verdict(QUICK, confidence=1.0), "confidence: found 1, expected a number between 0 and 1"),
        (lambda: verdict(QUICK, gain=float("nan")), "gain: found nan"),
        (lambda: verdict(QUICK, bounds=(-0.1, -1.0)), "bounds: found [-0.1, -1] N*s"),
        (lambda: verdict(replace(QUICK, seed=-1), runs=1), "seed: found -1"),
        (lambda: verdict(replace(QUICK, law=BareLaw(-0.7, 1e-3))), "has no method with_value"),
        (lambda: verdict(QUICK.law), "loop: found a Controller, expected a ClosedLoop"),
        (
            lambda: verdict(replace(QUICK, horizon=0.1)),
            "loop horizon: found 0.1 s, but contact is predicted only after",
        ),
        (
            lambda: verdict(QUICK, constraints=[velocity_limit(0.1), velocity_limit(0.2)]),
            "constraint relative_velocity: this constraint is given twice",
        ),
        (
            lambda: verdict(QUICK, constraints=[pt.Constraint(name="impact_force", limit=10.0)]),
            "impact_force: this quantity depends on the physical masses",
        ),
        (
            lambda: verdict(QUICK, uncertainty={"admittance.mass": pt.uncertainty.Uniform(low=1.0, high=2.0)}),
            "a setting of the controller and therefore known exactly",
        ),
        (
            lambda: verdict(QUICK, uncertainty={"obstacle.speed": pt.uncertainty.Uniform(low=1.0, high=2.0)}),
            "did you mean obstacle.velocity?",
        ),
        (
            lambda: pt.verify(pt.Task(SEVERAL, SENSOR, OBJECTIVE, loop=QUICK, bounds=BOUNDS)),
            "scenario: found an array of encounters of shape (2,), expected a single",
        ),
    ],
)
def test_a_request_that_makes_no_sense_says_why(make: Callable[[], object], message: str) -> None:
    with pytest.raises(pt.errors.InvalidInputError, match=re.escape(message)):
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
