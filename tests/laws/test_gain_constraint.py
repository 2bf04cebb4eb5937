"""A limit of the gain itself, such as that of a stable loop: the same as narrower bounds, but with its name."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pretouch as pt
from page_rows import line
from properties import examples
from refusals import refused

ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SCENARIO = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
POWER = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
EXPONENTIAL = pt.ExponentialFirstOrder(scale=0.458, rate=-61.0)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)
SAME = 1e-8  # a gain inside is found to 1e-9, one on the limit to 1e-11 below it


def limited(limit: float, name: str = "gain") -> pt.Constraint:
    return pt.Constraint(name=name, limit=limit)


def design(constraints: Any = (), *, sensor: Any = EXPONENTIAL, bounds: Any = BOUNDS, **changed: Any) -> Any:
    scenario = changed.pop("scenario", SCENARIO)
    return pt.design(pt.Task(scenario, sensor, OBJECTIVE, bounds=bounds, constraints=constraints, **changed))


@pytest.mark.parametrize("name", ["spede", "position", "displacement", "largest_speed"])
def test_a_constraint_without_a_limit_of_this_name_is_refused_when_it_is_made(name: str) -> None:
    with refused("constraint", value=name) as caught:
        limited(1.0, name)
    if name.startswith("largest_"):
        assert str(caught.value).endswith("has the name speed")
        assert limited(1.0, "speed").quantity == name


@examples(25)
@given(
    limit=st.floats(0.02, 9.0),
    speed=st.floats(-0.6, -0.1),
    sensor=st.sampled_from([POWER, EXPONENTIAL]),
    excursion=st.sampled_from([None, 0.09]),
)
def test_a_limit_of_the_gain_is_narrower_bounds(
    limit: float, speed: float, sensor: pt.sensors.SensorModel, excursion: float | None
) -> None:
    scenario = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=speed))
    others = [] if excursion is None else [limited(excursion, "excursion")]
    found = design([limited(limit), *others], scenario=scenario, sensor=sensor)
    clipped = design(others, scenario=scenario, sensor=sensor, bounds=(-limit, BOUNDS[1]))
    assert found.status == clipped.status
    if clipped.gain is not None:
        assert found.gain == pytest.approx(clipped.gain, rel=SAME)
        assert abs(found.gain) <= limit


@pytest.mark.parametrize("sensor", [POWER, EXPONENTIAL], ids=["inverse-power", "exponential-1"])
def test_an_active_limit_has_its_name_and_holds_the_gain(sensor: pt.sensors.SensorModel) -> None:
    found = design([limited(0.3)], sensor=sensor)
    (outcome,) = found.constraints
    assert found.certificate.at == "gain"
    assert (outcome.active, outcome.unit, outcome.quantity) == (True, "N*s", "gain")
    assert outcome.value == pytest.approx(0.3, rel=SAME)
    assert line(str(found), "the optimum lies") == "on the limit of the constraint gain"
    # the gain stays where its limit is; the objective follows the inputs as that of a given gain does
    assert found.gradient("obstacle.velocity") == 0.0
    by = {s.name: s for s in found.sensitivities}
    assert {s.gain_derivative for s in by.values()} == {0.0}
    step = 1e-6
    values = []
    for sign in (1, -1):
        moved = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3 + sign * step))
        end = pt.find_contact(moved, sensor, found.gain).contact
        values.append(float(OBJECTIVE.value(end, 0.3)))
    # central difference: error of the order step^2, and rounding of 1e-16 / step
    slope = (values[0] - values[1]) / (2 * step)
    assert by["obstacle.velocity"].objective_derivative == pytest.approx(slope, rel=1e-6)


def test_a_limit_that_holds_nothing_changes_nothing() -> None:
    found, free = design([limited(5.0)]), design()
    assert found.gain == pytest.approx(free.gain, rel=SAME)
    (outcome,) = found.constraints
    assert not outcome.active
    assert outcome.margin == pytest.approx(5.0 + found.gain, rel=SAME)
    assert found.gradient("obstacle.velocity") == pytest.approx(free.gradient("obstacle.velocity"), rel=1e-6)


def test_a_limit_below_all_bounds_is_infeasible_by_name() -> None:
    found = design([limited(0.005)])
    assert found.status is pt.designs.DesignStatus.INFEASIBLE
    assert found.nearest.gain == pytest.approx(-0.01)
    assert "gain cannot be limited to 0.005 N s" in str(found)


def test_bounds_on_both_sides_of_zero_are_limited_on_both() -> None:
    found = design([limited(0.3)], bounds=(-10.0, 5.0))
    assert found.gain == pytest.approx(-0.3, rel=SAME)
    tiny = design([limited(1e-6)], bounds=(-10.0, 5.0))  # a sliver between two gains of the scan
    assert tiny.gain == pytest.approx(-1e-6, rel=1e-3)


def test_arrays_of_encounters_are_limited_each() -> None:
    speeds = np.linspace(-0.6, -0.1, 60)
    scenario = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=speeds))
    free = design(scenario=scenario).gain
    limit = float(np.median(-free))
    found = design([limited(limit)], scenario=scenario)
    assert np.all(found.status == "optimal")
    # one local minimum in each of these encounters: the nearest gain that is allowed
    assert np.allclose(found.gain, np.maximum(free, -limit), rtol=SAME, atol=0)
    slopes = found.gradient("obstacle.velocity")
    held = free < -limit * (1 + 1e-6)
    assert np.all(slopes[held] == 0)
    assert np.allclose(slopes[~held], design(scenario=scenario).gradient("obstacle.velocity")[~held], rtol=1e-5)


def test_a_robust_gain_keeps_the_limit_in_every_sample() -> None:
    options: dict[str, Any] = {
        "uncertainty": {"obstacle.velocity": pt.uncertainty.Uniform(low=-0.4, high=-0.2)},
        "robust": pt.designs.RobustOptions(samples=128, validation=128),
    }
    for constraint in (limited(0.3), pt.designs.Required(constraint=limited(0.3), probability=0.9)):
        found = pt.robust(pt.Task(SCENARIO, EXPONENTIAL, OBJECTIVE, bounds=BOUNDS, constraints=[constraint], **options))
        assert found.gain == pytest.approx(-0.3, rel=SAME)
        assert found.validation.limits[0].held == 1.0
    infeasible = pt.robust(
        pt.Task(SCENARIO, EXPONENTIAL, OBJECTIVE, bounds=BOUNDS, constraints=[limited(0.005)], **options)
    )
    assert "gain cannot be limited to 0.005 N s" in str(infeasible)
    worst = pt.robust(
        pt.Task(
            SCENARIO,
            EXPONENTIAL,
            OBJECTIVE,
            bounds=BOUNDS,
            constraints=[limited(0.3)],
            **{**options, "robust": replace(options["robust"], measure=pt.designs.WorstCase())},
        )
    )
    assert worst.gain == pytest.approx(-0.3, rel=SAME)


def test_fronts_and_admittances_keep_the_limit() -> None:
    front = pt.pareto(pt.Task(SCENARIO, EXPONENTIAL, bounds=BOUNDS, constraints=[limited(0.5)]))
    clipped = pt.pareto(pt.Task(SCENARIO, EXPONENTIAL, bounds=(-0.5, BOUNDS[1])))
    assert np.abs(front.gain).max() == pytest.approx(0.5, rel=1e-6)
    assert front.values.min(axis=0) == pytest.approx(clipped.values.min(axis=0), rel=1e-6)
    found = pt.design(
        pt.Task(SCENARIO, EXPONENTIAL, OBJECTIVE, bounds=BOUNDS, damping_ratio=(0.7, 2.0), constraints=[limited(0.5)])
    )
    narrow = pt.design(pt.Task(SCENARIO, EXPONENTIAL, OBJECTIVE, bounds=(-0.5, BOUNDS[1]), damping_ratio=(0.7, 2.0)))
    assert found.gain == pytest.approx(-0.5, rel=1e-6)
    assert found.objective == pytest.approx(narrow.objective, rel=1e-6)
    assert "gain" in dict(found.certificate.active)


def test_a_stability_limit_is_a_constraint() -> None:
    timing = pt.simulation.LoopTiming(rate=60.0, delay=0.0128)
    limit = pt.simulation.gain_limit(POWER, ADMITTANCE, timing, distance=np.linspace(0, 0.0422, 33))
    allowed = limit.allowed(margin=2.0)
    assert allowed == -limit.strongest / 2 == -limit.bounds(margin=2.0)[0]
    found = design([limited(allowed)], sensor=POWER)
    assert found.certificate.at == "gain"
    assert found.gain == pytest.approx(-allowed, rel=SAME)
    with refused("margin", value=1.0):
        limit.allowed(margin=1.0)
    free = replace(limit, gain=np.full(33, -math.inf))
    assert free.allowed() == math.inf
    with refused("constraint gain"):
        limited(free.allowed())


def test_a_scenario_file_can_limit_the_gain(tmp_path: Path) -> None:
    source = Path(__file__).parents[2] / "examples" / "approach.toml"
    text = source.read_text(encoding="utf-8").replace('excursion = "0.2 m"', 'gain = "300 mN*s"')
    path = tmp_path / "limited.toml"
    path.write_text(text, encoding="utf-8")
    problem = pt.load_scenario(path)
    assert problem.constraints == (limited(0.3),)
    assert pt.design(problem).gain == pytest.approx(-0.3, rel=SAME)
