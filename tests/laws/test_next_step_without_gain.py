"""The next step of an infeasible design names other bounds and starts only if a gain exists with them."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

import pretouch as pt
from pretouch.report.pages import page_of
from pretouch.simulation.detection import detection_distance
from verification_samples import loop_of

SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)


def task(speed: float, excursion: float, bounds: tuple[float, float] = (-10.0, -0.01)) -> pt.Task:
    limits = [
        pt.Constraint(name="relative_velocity", limit=speed),
        pt.Constraint(name="excursion", limit=excursion),
    ]
    return pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=bounds, constraints=limits)


def next_step(of: pt.Task) -> str:
    design = pt.design(of)
    assert design.gain is None
    return page_of(design).next_step


@pytest.mark.parametrize(
    ("infeasible", "helps"),
    [
        (task(0.02, 0.001), ()),
        (task(0.02, 0.1), ("start",)),
        (task(0.07, 0.1), ("start",)),
        (task(0.07, 0.2, (-0.5, -0.1)), ("bounds",)),
        (task(0.07, 0.2, (-0.05, -0.02)), ("bounds",)),
    ],
)
def test_following_the_next_step_leads_to_a_gain(infeasible: pt.Task, helps: tuple[str, ...]) -> None:
    text = next_step(infeasible)
    wider = re.search(r"bounds of the gain to (\S+) N s to (\S+) N s", text)
    start = re.search(r"act from a distance of (\S+) mm", text)
    assert ((wider is not None), (start is not None)) == ("bounds" in helps, "start" in helps)
    if wider is not None:
        assert pt.design(infeasible.replace(bounds=(float(wider[1]), float(wider[2])))).gain is not None
    if start is not None:
        moved = replace(SCENARIO, obstacle=replace(SCENARIO.obstacle, position=1e-3 * float(start[1])))
        assert pt.design(infeasible.replace(scenario=moved)).gain is not None
    assert "earlier" not in text


def test_a_much_nearer_start_is_named_if_a_gain_exists_from_there() -> None:
    """From 300 mm, the excursion is used up before contact; from 50 mm, it is not."""
    obstacle = pt.Obstacle(position=0.3, velocity=-0.5)
    far = task(0.2, 0.04, (-10.0, -1e-3)).replace(scenario=replace(SCENARIO, obstacle=obstacle))
    start = re.search(r"act from a distance of (\S+) mm", next_step(far))
    assert start is not None
    nearer = replace(SCENARIO, obstacle=replace(obstacle, position=1e-3 * float(start[1])))
    assert pt.design(far.replace(scenario=nearer)).gain is not None


@pytest.mark.parametrize(("noise", "is_detected"), [(1e-4, True), (50.0, False)])
def test_the_floor_that_belongs_to_the_start_is_named(noise: float, is_detected: bool) -> None:
    """With the floor of the old start, the law would act from there on, as before."""
    infeasible = task(0.02, 0.1)
    loop = loop_of(noise=noise)
    text = next_step(infeasible.replace(loop=loop))
    start, floor = re.search(r"from a distance of (\S+) mm", text), re.search(r"floor = (\S+) in \[controller\]", text)
    assert start is not None
    assert (floor is not None) == is_detected
    assert ("does not detect the object there" in text) != is_detected
    if floor is not None:
        conditioning = replace(loop.law.conditioning, floor=float(floor[1]))
        # three digits of the floor of a signal whose slope is at most 80 1/m
        seen = detection_distance(SENSOR, loop.chain, conditioning)
        assert seen == pytest.approx(1e-3 * float(start[1]), rel=0.01)
