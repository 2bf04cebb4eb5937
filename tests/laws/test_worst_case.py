"""The worst encounter of a box is found and certified, and the gain is the one for which it is mildest."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from pretouch.designs import (
    Constraint,
    Expected,
    Required,
    RobustOptions,
    Task,
    WorstCase,
    excursion_objective,
    time_objective,
)
from pretouch.designs.objectives import Objective, Term
from pretouch.designs.robust import robust
from pretouch.designs.search.box_maximum import maximize_on_box
from pretouch.motion import Admittance, Obstacle, Scenario
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, Recessed, SensorModel
from pretouch.uncertainty import Interval, Normal, TruncatedNormal, make_ensemble
from refusals import refused

SCENARIO = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=Obstacle(position=0.0422, velocity=-0.3),
)
FIRST = ExponentialFirstOrder(scale=0.458, rate=-61.0)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
F1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOX = {
    "obstacle.velocity": Interval(low=-0.5, high=-0.1),
    "obstacle.position": Interval(low=0.035, high=0.05),
}


def hills(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x, y, z = points.T
    value = np.sin(3 * x) * np.exp(-(y**2)) + 0.3 * z
    slopes = [3 * np.cos(3 * x) * np.exp(-(y**2)), -2 * y * np.sin(3 * x) * np.exp(-(y**2)), 0.3 + 0 * z]
    return value, np.stack(slopes, axis=1)


@pytest.mark.parametrize(
    ("low", "high", "best"),
    [
        ((-1.0, -1.0, -1.0), (2.0, 1.3, 1.0), 1.3),  # inside in two coordinates
        ((0.6, 0.2, 0.0), (0.9, 0.8, 1.0), np.sin(1.8) * np.exp(-0.04) + 0.3),  # at a corner
        ((-0.5, 0.3, 0.0), (0.1, 0.4, 0.0), np.sin(0.3) * np.exp(-0.09)),  # of a box without height
    ],
)
def test_the_largest_value_on_a_box_is_certified(low: tuple, high: tuple, best: float) -> None:
    found = maximize_on_box(hills, np.array(low), np.array(high), tolerance=1e-8)
    assert found.value == pytest.approx(best, rel=2e-8)
    assert best <= found.bound * (1 + 1e-12)
    assert found.bound <= best * (1 + 2e-8)
    assert ((found.point >= low) & (found.point <= high)).all()


def test_what_is_monotone_is_settled_at_a_corner_exactly() -> None:
    found = maximize_on_box(
        lambda p: (2 * p[:, 0] - p[:, 1], np.tile([2.0, -1.0], (len(p), 1))), np.zeros(2), np.ones(2), tolerance=1e-8
    )
    assert (found.value, found.bound, found.boxes, found.signs) == (2.0, 2.0, 1, (1, -1))


@pytest.mark.parametrize("sensor", [FIRST, POWER], ids=lambda s: s.name)
@pytest.mark.parametrize("objective", [F1, time_objective(time_scale=1.0, velocity_scale=0.3)], ids=["f_1", "f_2"])
def test_no_gain_has_a_milder_worst_encounter(sensor: SensorModel, objective: Objective) -> None:
    design = robust(
        Task(
            SCENARIO,
            sensor,
            objective,
            bounds=(-10.0, -0.01),
            uncertainty=BOX,
            robust=RobustOptions(measure=WorstCase(), validation=16),
        )
    )
    grid = np.array(list(product(np.linspace(-0.5, -0.1, 15), np.linspace(0.035, 0.05, 7))))
    dense = make_ensemble(SCENARIO, sensor, dict(zip(BOX, grid.T, strict=True)))
    gains = np.append(np.linspace(0.5, 1.5, 101) * design.gain, design.gain)
    result = dense.contacts(gains[:, None])
    worst = objective.value(result.end, dense.speed).max(axis=1)
    assert design.value == pytest.approx(worst[-1], rel=1e-9), "the corners are in the grid"
    assert (worst >= design.value * (1 - 1e-9)).all()
    assert design.worst is not None
    assert design.worst.lower <= design.worst.bound
    assert design.worst.bound == pytest.approx(design.worst.lower, rel=1e-9), "monotone: exact"


def test_a_worst_encounter_inside_the_box_is_found() -> None:
    """With a scale that follows the speed, neither the slowest nor the fastest obstacle need be the worst."""
    objective = Objective(
        terms=(
            Term(quantity="displacement", scale=0.1),
            Term(quantity="relative_velocity", scale="obstacle speed", weight=0.5),
            Term(quantity="time", scale=0.6),
        )
    )
    box = {"obstacle.velocity": Interval(low=-1.5, high=-0.05)}
    design = robust(
        Task(
            SCENARIO,
            FIRST,
            objective,
            bounds=(-3.0, -0.05),
            uncertainty=box,
            robust=RobustOptions(measure=WorstCase(), validation=16),
        )
    )
    speeds = -np.geomspace(0.05, 1.5, 4001)
    dense = make_ensemble(SCENARIO, FIRST, {"obstacle.velocity": speeds})
    values = objective.value(dense.contacts(design.gain).end, dense.speed)
    assert design.worst is not None
    assert values.max() <= design.worst.bound * (1 + 1e-12)
    assert design.worst.value == pytest.approx(values.max(), rel=1e-6)  # the grid misses the top by its step squared
    assert design.worst.bound == pytest.approx(design.worst.lower, rel=1e-6)


def test_a_limit_holds_in_the_worst_encounter_too() -> None:
    limit = Constraint(name="excursion", limit=0.12)
    design = robust(
        Task(
            SCENARIO,
            FIRST,
            F1,
            bounds=(-10.0, -0.01),
            uncertainty=BOX,
            robust=RobustOptions(measure=WorstCase()),
            constraints=[limit],
        )
    )
    free = robust(
        Task(SCENARIO, FIRST, F1, bounds=(-10.0, -0.01), uncertainty=BOX, robust=RobustOptions(measure=WorstCase()))
    )
    assert design.gain > free.gain, "weaker, since the limit binds"
    corners = make_ensemble(SCENARIO, FIRST, dict(zip(BOX, np.array([[-0.5, 0.035], [-0.5, 0.05]]).T, strict=True)))
    excursions = corners.contacts(design.gain).end.largest_excursion
    assert excursions.max() == pytest.approx(0.12, rel=1e-8)
    assert design.validation.limits[0].held == 1.0


SECOND = Recessed(sensor=ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0), recess=0.004)


@pytest.mark.parametrize("sensor", [FIRST, POWER, SECOND], ids=lambda s: s.name)
def test_slopes_of_an_ensemble_are_differences_of_it(sensor: SensorModel) -> None:
    """Also by the sensor's own parameters, whose encounters are those of one sensor, and by the natural frequency."""
    own = {
        FIRST: {"sensor.rate": -61.0},
        POWER: {"sensor.exponent": 3.32, "sensor.distance_offset": 0.0419},
        SECOND: {"sensor.rate": -74.0, "sensor.curvature": 474.0, "sensor.recess": 0.004},
    }[sensor]
    center = {
        "obstacle.velocity": -0.3,
        "obstacle.position": 0.0422,
        "admittance.mass": 1.0,
        "admittance.natural_frequency": 5.0,
        "admittance.damping_ratio": 1.2,
        "plant.velocity": 0.01,
        **own,
    }
    spread = np.array([[0.97, 1.0, 1.02]])
    values = {name: (value * spread).ravel() for name, value in center.items()}
    several = make_ensemble(SCENARIO, sensor, values)
    result = several.contacts(-0.7)
    for name in center:
        sides = []
        step = 1e-3 * np.abs(values[name])
        for k in (-2, -1, 1, 2):
            moved = make_ensemble(SCENARIO, sensor, {**values, name: values[name] + k * step})
            sides.append(moved.contacts(-0.7).end)
        for quantity in ("time", "displacement", "relative_velocity", "virtual_force"):
            a, b, c, d = (np.asarray(getattr(end, quantity)) for end in sides)
            difference = (a - 8 * b + 8 * c - d) / (12 * step)
            # the difference is good to the fourth power of the step, and to the 1e-11 of a contact over it
            natural = np.abs(getattr(result.end, quantity) / values[name])
            error = np.abs(several.slope(result, quantity, name) - difference)
            assert (error <= 2e-8 * (np.abs(difference) + natural)).all(), (name, quantity)


@pytest.mark.parametrize(
    ("known", "measure", "limits", "fields"),
    [
        (
            {"obstacle.velocity": Normal(mean=-0.3, deviation=0.1)},
            WorstCase(),
            [],
            {"argument": "uncertainty obstacle.velocity"},
        ),
        (
            {"obstacle.velocity": TruncatedNormal(location=-0.3, deviation=0.1, high=0)},
            WorstCase(),
            [],
            {"argument": "uncertainty obstacle.velocity"},
        ),
        (BOX, Expected(), [], {"argument": "uncertainty obstacle.velocity"}),
        (
            BOX,
            WorstCase(),
            [Required(constraint=Constraint(name="time", limit=1.0), probability=0.9)],
            {"argument": "constraint time", "value": 0.9},
        ),
    ],
)
def test_what_has_no_worst_case_is_refused(known: dict, measure: object, limits: list, fields: dict[str, Any]) -> None:
    with refused(**fields):
        robust(
            Task(
                SCENARIO,
                FIRST,
                F1,
                bounds=(-10.0, -0.01),
                uncertainty=known,
                robust=RobustOptions(measure=measure),
                constraints=limits,
            )
        )
