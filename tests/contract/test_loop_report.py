"""Reports of designs on the sampled loop: they say what was run, and show that and nothing else."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from page_rows import row, table
from pretouch.report import report_html
from pretouch.report.motion_figures import loop_motion, runs_of

pytest.importorskip("matplotlib")

SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
LOOP = pt.ClosedLoop(
    law=pt.control.Controller(
        period=1e-3,
        conditioning=pt.control.Conditioning(floor=0.0455, sensor_period=4e-3),
        law=pt.control.VirtualDamper(gain=0.0),
        admittance=pt.control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    ),
    chain=pt.SensorChain(rate=250.0, exposure=170e-6, delay=120e-6, noise=1e-3),
)


def theirs(scenario: pt.Scenario, sensor: pt.sensors.SensorModel, gain: Any) -> pt.motion.ContactResult:
    return pt.find_contact(scenario, sensor, gain)


def design(evaluate: Any) -> pt.designs.GainDesign:
    return pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=(-2.0, -0.2), evaluate=evaluate))


@pytest.mark.slow
def test_a_design_report_shows_the_loop() -> None:
    found = design(LOOP)
    page = report_html(found)
    assert "Simulation of the sampled loop: sensor chain" in page
    assert "One run of the sampled loop" in page
    assert "with the same noise for every gain" in page
    assert "impulse balance" not in page  # the loop has none
    assert "Time is continuous" not in page
    assert not re.search(r"\bnan\b", page)
    chosen = runs_of(found)[1].motion
    assert chosen.time[-1] == found.result.end.time
    assert chosen.distance[-1] == 0.0
    assert chosen.relative_velocity[-1] == pytest.approx(found.result.end.relative_velocity, rel=1e-12)


def test_the_report_of_a_design_by_a_function_says_that_its_motion_is_not_known() -> None:
    page = report_html(design(theirs))
    assert "the user-defined evaluator returns no motions" in page
    assert "its assumptions are unknown here" in page
    assert "Time is continuous" not in page


def test_the_motion_of_a_loop_is_its_trace_up_to_contact() -> None:
    robot = replace(
        LOOP,
        plant=pt.simulation.PositionPlant(mass=1.0, bandwidth=30.0),
        contact=pt.simulation.SpringDamper(stiffness=1e5, damping=50.0),
    )
    found = loop_motion(robot, SCENARIO, SENSOR, -0.7, horizon=10.0)
    assert np.all(np.diff(found.time) > 0)
    assert np.all(found.distance >= 0)
    slope = np.diff(found.distance) / np.diff(found.time)
    middle = 0.5 * (found.relative_velocity[1:] + found.relative_velocity[:-1])
    # l' is the derivative of l: the mean over a step differs by some a' T^2 / 12
    assert np.abs(slope[:-1] - middle[:-1]).max() < 5e-3
    gone = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=0.1))
    away = loop_motion(LOOP, gone, SENSOR, 0.0, horizon=0.2)
    assert away.time[-1] < 0.2
    assert not away.result.reached.all()


@pytest.mark.slow
def test_a_robust_report_names_the_ideal_design() -> None:
    found = pt.robust(
        pt.Task(
            SCENARIO,
            SENSOR,
            OBJECTIVE,
            bounds=(-2.0, -0.2),
            uncertainty={},
            evaluate=LOOP,
            robust=pt.designs.RobustOptions(samples=32),
        )
    )
    page = report_html(found)
    assert table(page, "Results on fresh samples")[0][1:] == [
        "robust gain",
        "gain of the ideal design",
        "no mitigation",
    ]
    assert row(page, "noise") == ["noise of the sampled loop, different in each encounter"]
    assert row(page, "encounters solved by")[0].startswith("the sampled loop, with the same noise for every gain")
    assert "Simulation of the sampled loop: sensor chain" in page
    assert "nominal gain" not in page
    assert "Price of robustness" not in page  # it is known in continuous time only
    assert found.to_dict()["method"] == "loop"
    assert found.to_dict()["validation"]["loss_of_nominal"]["standard_error"] > 0
