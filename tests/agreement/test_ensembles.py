"""Encounters of many sensors, solved as encounters of one, are what each gives alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.motion import DRAG, Admittance, ContactState, Obstacle, Plant, Reference, Scenario, find_contact
from pretouch.sensors import (
    ExponentialFirstOrder,
    ExponentialSecondOrder,
    InversePower,
    MittagLeffler,
    Recessed,
    SensorModel,
)
from pretouch.uncertainty import make_ensemble
from refusals import refused

SCENARIO = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=20.0),
    obstacle=Obstacle(position=0.0422, velocity=-0.3, acceleration=-0.1),
    plant=Plant(position=0.001, velocity=0.01),
    reference=Reference(position=0.002, velocity=-0.01),
)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
RNG = np.random.default_rng(5)
SENSORS: dict[str, tuple[SensorModel, dict[str, np.ndarray]]] = {
    "inverse power": (
        POWER,
        {"sensor.exponent": RNG.uniform(2, 4, 12), "sensor.distance_offset": RNG.uniform(0.02, 0.06, 12)},
    ),
    "recessed inverse power": (
        Recessed(
            sensor=InversePower(scale=1.0, distance_offset=0.01, exponent=2.5, minimum_distance=0.003), recess=0.006
        ),
        {"sensor.exponent": RNG.uniform(2, 4, 12), "sensor.recess": RNG.uniform(0.004, 0.008, 12)},
    ),
    "first order": (ExponentialFirstOrder(scale=0.458, rate=-61.0), {"sensor.rate": RNG.uniform(-70, -50, 12)}),
    "second order": (
        ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
        {"sensor.rate": RNG.uniform(-80, -70, 12), "sensor.curvature": RNG.uniform(300, 500, 12)},
    ),
    "recessed second order": (
        Recessed(sensor=ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0), recess=0.004),
        {"sensor.curvature": RNG.uniform(300, 500, 12), "sensor.recess": RNG.uniform(0.0, 0.006, 12)},
    ),
    "bent the other way": (
        ExponentialSecondOrder(scale=0.480, rate=-50.0, curvature=-300.0),
        {"sensor.rate": RNG.uniform(-55, -45, 12), "sensor.curvature": RNG.uniform(-400, -200, 12)},
    ),
    "mittag-leffler": (
        MittagLeffler(scale=0.5, rate=-60.0, order=0.9),
        {"sensor.rate": RNG.uniform(-65, -55, 12), "sensor.order": RNG.uniform(0.8, 0.95, 12)},
    ),
    "scale": (POWER, {"sensor.scale": RNG.uniform(1e-6, 1e-5, 12)}),
}


@pytest.mark.parametrize("name", SENSORS)
def test_an_ensemble_is_what_each_of_its_encounters_gives_alone(name: str) -> None:
    sensor, own = SENSORS[name]
    values = {**own, "obstacle.velocity": RNG.uniform(-0.6, -0.1, 12), "admittance.mass": RNG.uniform(0.5, 2.0, 12)}
    several = make_ensemble(SCENARIO, sensor, values)
    gains = np.array([[-1.5], [-0.3], [0.0]])
    found = several.contacts(gains)
    assert found.reached.shape == (3, 12)
    for i in range(12):
        alone = find_contact(*several.at(i), gains[:, 0])
        np.testing.assert_array_equal(found.status[:, i], alone.status)
        for quantity in ContactState.names():
            # each way is good to 1e-11 or better, peaks of the motion to 1e-9; x'' is a difference of forces that were
            # as large as its peak
            forces = 1e-10 * alone.end.largest_acceleration.max() if quantity == "acceleration" else 0.0
            np.testing.assert_allclose(
                getattr(found.end, quantity)[:, i],
                getattr(alone.end, quantity),
                rtol=1e-8,
                atol=1e-11 + forces,
                err_msg=quantity,
            )
        np.testing.assert_allclose(found.gain[:, i], gains[:, 0], rtol=1e-14)


def test_curves_of_one_kind_are_one_call() -> None:
    for name in ("inverse power", "recessed inverse power", "first order", "second order", "recessed second order"):
        sensor, own = SENSORS[name]
        assert make_ensemble(SCENARIO, sensor, own).likeness is not None, name
    sensor, own = SENSORS["mittag-leffler"]
    assert make_ensemble(SCENARIO, sensor, own).likeness is None


def test_a_curve_that_ends_too_soon_is_solved_for_itself() -> None:
    """Where the calibrated range does not reach from the start to contact, its own checks have to speak."""
    short = InversePower(scale=1.0, distance_offset=0.01, exponent=2.0, minimum_distance=0.005)
    several = make_ensemble(SCENARIO, Recessed(sensor=short, recess=0.006), {"sensor.recess": [0.004, 0.007]})
    assert several.likeness is None
    assert several.contacts(-0.3).reached.tolist() == [False, True]


@pytest.mark.parametrize(
    ("values", "fields"),
    [
        (
            {"obstacle.speed": [1.0]},
            {"argument": "uncertainty", "value": "obstacle.speed", "remedy": "obstacle.velocity"},
        ),
        ({"sensor.rate": [1.0]}, {"argument": "uncertainty", "value": "sensor.rate", "remedy": "sensor.scale"}),
        ({"obstacle.velocity": [-0.1, -0.2], "admittance.mass": [1.0]}, {"argument": "uncertainty"}),
        ({}, {"argument": "uncertainty"}),
        ({"admittance.mass": [1.0, -1.0]}, {"argument": "uncertainty", "value": -1.0}),
        ({"sensor.exponent": [3.0, -1.0]}, {"argument": "uncertainty", "value": -1.0}),
    ],
)
def test_impossible_values_are_refused(values: dict[str, list[float]], fields: dict[str, Any]) -> None:
    with refused(**fields):
        make_ensemble(SCENARIO, POWER, values).contacts(-0.3)


DRAGGED = replace(SCENARIO, plant=Plant(position=0.002, velocity=-0.01))


@pytest.mark.parametrize("name", SENSORS)
def test_a_drag_meets_sensors_that_are_alike_as_it_meets_each(name: str) -> None:
    """Its number goes with the square of the slope, k^2 / s for the k of the damper; only rounding is left."""
    sensor, values = SENSORS[name]
    several = make_ensemble(DRAGGED, sensor, values, law=DRAG)
    together = several.contacts(0.0144)
    for i in range(12):
        alone = find_contact(*several.at(i), 0.0144, law="virtual-drag")
        assert together.gain[i] == pytest.approx(0.0144, rel=1e-14)
        for quantity, value in alone.end.as_dict().items():
            assert np.asarray(getattr(together.end, quantity))[i] == pytest.approx(value, rel=1e-10, abs=1e-13), (
                quantity
            )


def test_a_robust_drag_is_held_against_fresh_samples_and_its_worst_encounter_is_known() -> None:
    """The first-order shares of its inputs are those of central differences, good to the square of their 1e-3."""
    known = {"sensor.distance_offset": (0.04, 0.044), "obstacle.acceleration": (-0.3, 0.0)}
    task = pt.Task(
        DRAGGED,
        InversePower(scale=1.3e-5, distance_offset=0.0419, exponent=3.32),
        pt.excursion_objective(position_scale=0.5, velocity_scale=0.3),
        bounds=(1e-3, 0.05),
        law="virtual-drag",
        uncertainty={name: pt.uncertainty.Uniform(low=low, high=high) for name, (low, high) in known.items()},
        robust=pt.designs.RobustOptions(samples=32, validation=32),
    )
    design = pt.robust(task)
    assert design.gain is not None

    def objective(**inputs: float) -> float:
        one = make_ensemble(DRAGGED, task.sensor, {n: [inputs.get(n, np.mean(known[n]))] for n in known}, law=DRAG)
        return float(task.goal.value(one.contacts(design.gain).end, one.speed, None)[0])

    effect = {}
    for name, (low, high) in known.items():
        middle, step = (low + high) / 2, 1e-3 * (high - low)
        effect[name] = (objective(**{name: middle + step}) - objective(**{name: middle - step})) / 2e-3
    total = sum(change**2 for change in effect.values())
    for one in design.importance:
        assert one.by_gradient == pytest.approx(effect[one.name] ** 2 / total, rel=1e-4)
    assert "Robust drag" in str(design)
    worst = pt.robust(task.replace(robust=replace(task.robust, measure=pt.designs.WorstCase())))
    assert worst.worst is not None
    corners = [
        find_contact(
            replace(DRAGGED, obstacle=replace(DRAGGED.obstacle, acceleration=a)),
            InversePower(scale=1.3e-5, distance_offset=offset, exponent=3.32),
            worst.gain,
            law="virtual-drag",
        ).end
        for a in known["obstacle.acceleration"]
        for offset in known["sensor.distance_offset"]
    ]
    hardest = max((end.displacement / 0.5) ** 2 + (end.relative_velocity / 0.3) ** 2 for end in corners)
    assert hardest <= worst.value * (1 + 1e-6)
