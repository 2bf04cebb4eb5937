"""A designed gain keeps a distance from a jump, and reports the values on both sides."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pretouch as pt
from pretouch._core.numbers import FloatArray
from pretouch.designs import Constraint
from pretouch.designs.search import Landscape, search_axis
from pretouch.designs.search.jumps import RESERVE
from pretouch.motion import Plant
from pretouch.motion.bodies import Stretch

WIDE = 0.02


@given(at=st.floats(-4, 4), height=st.floats(0.05, 10), rising=st.booleans())
def test_the_best_minimum_keeps_the_distance(at: float, height: float, rising: bool) -> None:
    """The objective falls toward a jump: the answer lies at the end of the reserve, on the better side."""
    sign = 1.0 if rising else -1.0

    def evaluate(u: FloatArray) -> Landscape:
        beyond = sign * (u - at) > 0
        objective = np.where(beyond, 5 + height, 5 - np.tanh(1 - np.abs(u - at)) / 10)
        return Landscape(objective=objective, ratios=np.empty((0, len(u))))

    _, minima = search_axis(evaluate, -5.0, 5.0, reserve=lambda _: WIDE)
    assert minima[0].jump is not None
    assert minima[0].jump.low - 1e-9 <= at <= minima[0].jump.high + 1e-9
    assert minima[0].coordinate == pytest.approx(at - sign * WIDE, abs=1e-8)


def test_a_steep_limit_is_no_jump() -> None:
    """At a limit, the merit ends, but nothing jumps."""

    def evaluate(u: FloatArray) -> Landscape:
        return Landscape(objective=5 - u / 10, ratios=np.exp(u)[None])

    _, minima = search_axis(evaluate, -5.0, 5.0, reserve=lambda _: WIDE)
    assert minima[0].jump is None
    assert minima[0].coordinate == pytest.approx(0.0, abs=1e-9)


def test_a_narrow_band_next_to_a_jump_is_kept_and_reported() -> None:
    def evaluate(u: FloatArray) -> Landscape:
        objective = np.where(u > 0.5, 9.0, 5 - np.tanh(u))
        return Landscape(objective=objective, ratios=np.where(u > 0.5, 3.0, 1.495 - u)[None])

    _, minima = search_axis(evaluate, -5.0, 5.0, reserve=lambda _: WIDE)
    assert not minima[0].jump.avoided
    assert minima[0].coordinate == pytest.approx(0.5, abs=1e-8)


@pytest.fixture(scope="module")
def nearly_stopping() -> pt.designs.GainDesign:
    """An object that brakes for 2 ms from 0.3 m/s to rest, just before its contact."""
    course = (Stretch(until=0.3403, acceleration=0.0), Stretch(until=0.3423, acceleration=150.0))
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.0422, velocity=-0.3, course=course),
    )
    sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    return pt.design(pt.Task(scenario, sensor, objective, bounds=(-1.0, -0.01)))


def test_an_object_that_nearly_stops(nearly_stopping: pt.designs.GainDesign) -> None:
    """The lowest objective is that of a contact without speed; a gain 1e-9 away has a contact 0.15 s later."""
    design = nearly_stopping
    jump = design.jump
    assert jump is not None
    assert jump.kept
    assert jump.gains[0] == pytest.approx(jump.gains[1], rel=1e-8)
    assert jump.objective[1] < design.objective < 2 * jump.objective[0]
    assert min(abs(design.gain - g) for g in jump.gains) >= jump.reserve * (1 - 1e-6)
    assert jump.reserve == pytest.approx(RESERVE * abs(jump.gains[0]))
    assert [abs(v) for v in jump.relative_velocity] == pytest.approx([0.0337, 0.0], abs=1e-3)
    assert any(w.startswith("PT312") and "0.0337" in w for w in design.warnings)
    assert json.loads(json.dumps(design.to_dict()))["jump"]["kept"] is True


def test_a_small_change_of_gain_or_encounter_does_not_cross_the_jump(nearly_stopping: pt.designs.GainDesign) -> None:
    design = nearly_stopping
    nominal = float(design.problem.run(design.gain).end.time)
    for factor in (0.995, 1.005):
        assert float(design.problem.run(factor * design.gain).end.time) == pytest.approx(nominal, rel=0.02)


def test_a_gain_keeps_a_distance_from_the_edge_of_contact() -> None:
    """An object that turns back is missed by slightly stronger gains."""
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.0422, velocity=-0.3, acceleration=0.9),
        plant=Plant(),
    )
    sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    design = pt.design(pt.Task(scenario, sensor, objective, bounds=(-2.0, -0.01)))
    assert design.jump.misses
    assert design.jump.gains[0] < design.jump.gains[1]
    assert design.gain == pytest.approx(design.jump.gains[1] + design.jump.reserve, rel=1e-3)
    assert bool(design.problem.run(1.005 * design.gain).reached)
    assert [w[:5] for w in design.warnings if w[:5] in {"PT302", "PT312"}] == ["PT302"]


def test_a_smooth_optimum_has_no_jump(letter_encounter: pt.Scenario) -> None:
    sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    limits = (Constraint(name="excursion", limit=0.08),)
    for constraints in ((), limits):
        task = pt.Task(letter_encounter, sensor, objective, bounds=(-10.0, -0.01), constraints=constraints)
        assert pt.design(task).jump is None
