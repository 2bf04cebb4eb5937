"""The page of pretouch studio computes the same contacts, motions, gains and drags as Python, to 1e-12."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from page_core import built_core, solve_in_node
from pretouch.designs import Constraint, DesignStatus, DragEffect, Task, design_drag, design_gain
from pretouch.designs.objectives import excursion_objective, time_objective
from pretouch.designs.problem import GainProblem
from pretouch.designs.search import GainAxis
from pretouch.designs.search.compiled import OPTIMAL, limit_rows, search_compiled, supported_terms
from pretouch.motion import Admittance, Obstacle, Plant, Reference, Scenario, find_contact, solve_motion
from pretouch.motion.laws import Drag
from pretouch.motion.layout import COLUMNS
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, MittagLeffler, Recessed, Table
from pretouch.studio.curves import describe_curve

EXACT = 1e-12
_AT = np.linspace(0.0, 0.3, 61)


def random_sensor(rng: np.random.Generator):
    power = InversePower(scale=1e-5, distance_offset=rng.uniform(0.004, 0.08), exponent=rng.uniform(1.2, 5.0))
    second = ExponentialSecondOrder(scale=0.5, rate=rng.uniform(-90.0, -50.0), curvature=rng.uniform(20.0, 300.0))
    return [
        power,
        Recessed(sensor=power, recess=rng.uniform(0.001, 0.02)),
        ExponentialFirstOrder(scale=0.5, rate=rng.uniform(-90.0, -20.0)),
        second,
        MittagLeffler(scale=0.5, rate=-60.0, order=0.9),
        Table(distances=tuple(_AT), outputs=tuple(power.output(_AT))),
    ][rng.integers(6)]


def random_scenario(rng: np.random.Generator, *, at_rest: bool = False) -> Scenario:
    admittance = Admittance.from_natural_frequency(
        mass=rng.uniform(0.2, 5.0), natural_frequency=rng.uniform(0.5, 20.0), damping_ratio=rng.uniform(0.1, 2.0)
    )
    obstacle = Obstacle(position=rng.uniform(0.02, 0.07), velocity=-rng.uniform(0.05, 1.0))
    if at_rest:
        return Scenario(admittance=admittance, obstacle=obstacle)
    obstacle = replace(obstacle, acceleration=rng.uniform(-1.0, 0.3))
    plant = Plant(velocity=rng.uniform(-0.05, 0.03))
    return Scenario(
        admittance=admittance, obstacle=obstacle, plant=plant, reference=Reference(velocity=rng.uniform(-0.02, 0.02))
    )


def described(scenario: Scenario, sensor) -> dict:
    return {
        "encounter": scenario.relative().tolist(),
        "sensor": describe_curve(sensor, scenario.distance),
        "horizon": 600.0,
    }


def assert_same(value: float, expected: float, size: float) -> None:
    """Compare numbers relative to a size: a difference of large numbers can not be more accurate than those."""
    if math.isfinite(expected):
        assert abs(value - expected) <= EXACT * max(abs(expected), size)
    else:
        assert value == expected


@pytest.fixture(scope="module")
def encounters():
    rng = np.random.default_rng(28)
    return [(random_scenario(rng), random_sensor(rng), -(10 ** rng.uniform(-2, 0.7))) for _ in range(120)]


def test_contacts_and_demands_are_those_of_python(encounters):
    requests = [{"kind": "contact", "gains": [gain], **described(s, sensor)} for s, sensor, gain in encounters]
    ends = set()
    for (scenario, sensor, gain), (row,) in zip(encounters, solve_in_node(requests), strict=True):
        expected = find_contact(scenario, sensor, gain)
        ends.add(int(expected.status))
        assert row["status"] == int(expected.status)
        if not expected.reached:
            continue
        columns = expected.columns
        for name in COLUMNS:
            # a motion is as accurate as the path of the object, the force and the acceleration as their largest
            size = {"time": 0.0, "settling_distance": 0.0, "distance": scenario.distance}.get(name)
            if size is None:
                peak = {"virtual_force": "largest_virtual_force", "displacement_acceleration": "largest_acceleration"}
                size = abs(columns.raw(peak[name])[0]) if name in peak else 0.1
            assert_same(row[name], columns.raw(name)[0], size)
    assert len(ends) > 1  # not only contacts


def test_motions_are_those_of_python(encounters):
    chosen = [e for e in encounters[:60] if find_contact(*e).reached]
    expected = [solve_motion(scenario, sensor, gain, samples=40) for scenario, sensor, gain in chosen]
    requests = [
        {"kind": "trace", "gain": gain, "times": motion.time.tolist(), **described(s, sensor)}
        for (s, sensor, gain), motion in zip(chosen, expected, strict=True)
    ]
    for motion, found, (scenario, *_) in zip(expected, solve_in_node(requests), chosen, strict=True):
        speed, force = np.abs(motion.relative_velocity).max(), np.abs(motion.virtual_force).max()
        sizes = {"distance": scenario.distance, "displacement": scenario.distance, "relative_velocity": speed}
        for name, size in (sizes | {"virtual_force": force}).items():
            assert np.abs(np.array(found[name]) - getattr(motion, name)).max() <= 10 * EXACT * size, name


def random_task(rng: np.random.Generator) -> Task:
    objectives = (
        excursion_objective(position_scale=rng.uniform(0.05, 0.5), velocity_scale=rng.uniform(0.1, 0.5)),
        time_objective(time_scale=1.0, velocity_scale="obstacle speed"),
    )
    limits = [Constraint(name="excursion", limit=rng.uniform(0.02, 0.3))] if rng.random() < 0.5 else []
    scenario = random_scenario(rng, at_rest=True)
    return Task(scenario, random_sensor(rng), objectives[rng.integers(2)], bounds=(-10.0, -0.01), constraints=limits)


def test_designs_are_those_of_python():
    rng = np.random.default_rng(29)
    tasks = [random_task(rng) for _ in range(80)]
    requests, compiled = [], []
    for task in tasks:
        problem = GainProblem(task=task, axis=GainAxis.between(task.bounds))
        limits = [list(row) for row in limit_rows(problem, task.limits)]
        terms = [[float(x) for x in row] for row in supported_terms(problem)]
        request = {"kind": "design", "terms": terms, "limits": limits, "bounds": list(task.bounds)}
        requests.append(request | described(task.scenario, task.sensor))
        compiled.append(search_compiled(problem)[:, 0])
    outcomes = []
    for task, found, (gain, objective, outcome) in zip(tasks, solve_in_node(requests), compiled, strict=True):
        outcomes.append(found["status"])
        assert found["status"] == outcome
        if outcome == OPTIMAL:
            assert_same(found["objective"], objective, 0.0)
            assert design_gain(task).status is DesignStatus.OPTIMAL
            # the objective is flat at its minimum, so that its rounding error allows a larger one of the gain
            assert found["gain"] == pytest.approx(gain, rel=1e-7)
    assert outcomes.count(OPTIMAL) > len(tasks) / 2


def test_drags_are_those_of_python():
    rng = np.random.default_rng(30)
    requests, expected, motions = [], [], []
    for _ in range(60):
        scenario, sensor, ratio = random_scenario(rng, at_rest=True), random_sensor(rng), rng.uniform(0.02, 0.9)
        design = design_drag(Task(scenario, sensor, drag_effect=DragEffect(ratio=ratio)))
        motion = solve_motion(scenario, sensor, design.drag, law=Drag(), samples=30)
        request = {"kind": "drag", "ratio": ratio, "times": motion.time.tolist()}
        requests.append(request | described(scenario, sensor))
        expected.append(design)
        motions.append(motion)
    for design, motion, found in zip(expected, motions, solve_in_node(requests), strict=True):
        assert_same(found["gain"], design.drag, 0.0)
        end = design.result.end
        for name in ("time", "relative_velocity", "largest_acceleration", "largest_virtual_force", "largest_speed"):
            assert_same(found[name], getattr(end, name), 0.0)
        assert_same(found["largest_excursion"], end.largest_excursion, 0.1)
        scale = np.abs(motion.distance).max()
        assert np.abs(np.array(found["motion"]["distance"]) - motion.distance).max() <= 10 * EXACT * scale


def test_the_core_imports_nothing():
    content = built_core().read_bytes()
    sections, place = [], 8
    while place < len(content):
        sections.append(content[place])
        size, shift = 0, 0
        while True:
            place += 1
            size |= (content[place] & 0x7F) << shift
            shift += 7
            if content[place] < 0x80:
                break
        place += 1 + size
    assert content[:4] == b"\0asm"
    assert 2 not in sections  # the section of imports
